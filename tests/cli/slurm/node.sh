#!/usr/bin/env bash
# Starts a Slurm cluster of one node for tests: munged, slurmctld and slurmd. All files are in FOLDER; nothing in /etc is
# read or written, and root is not needed.
#
#     node.sh FOLDER CONTROLLER_PORT NODE_PORT CPUS
#
# Prints `ready` once the node accepts jobs. When standard input closes, it cancels all jobs and stops the daemons, so that
# a test that dies leaves nothing behind. Slurm's commands find the node through SLURM_CONF=FOLDER/slurm.conf.
set -euo pipefail
export LC_ALL=C PATH="$PATH:/usr/sbin:/sbin"

folder="$(realpath "$1")"
controller_port="$2" node_port="$3" cpus="$4"
export SLURM_CONF="$folder/slurm.conf"
user="$(id -un)"

unable() {
    echo "no Slurm node: $*" >&2
    exit 1
}

mkdir -p "$folder"/{munge,state,spool}
chmod 700 "$folder/munge" "$folder/state" "$folder/spool"
head -c 1024 /dev/urandom >"$folder/munge/key"
chmod 400 "$folder/munge/key"
# Slurm 23.02 and later need this line to run without control groups.
version="$(slurmd -V)"
[[ "${version##* }" =~ ^([0-9]+)\.([0-9]+) ]] || unable "which version is this: $version?"
if ((BASH_REMATCH[1] >= 23)); then echo "CgroupPlugin=disabled" >"$folder/cgroup.conf"; fi
# config_overrides allows more processors than the machine has. The short scheduling intervals save waiting time.
cat >"$SLURM_CONF" <<CONF
ClusterName=test
SlurmctldHost=localhost(127.0.0.1)
SlurmctldPort=$controller_port
SlurmdPort=$node_port
SlurmUser=$user
SlurmdUser=$user
AuthType=auth/munge
AuthInfo=socket=$folder/munge/socket
CredType=cred/munge
ProctrackType=proctrack/linuxproc
TaskPlugin=task/none
SelectType=select/cons_tres
SelectTypeParameters=CR_Core
SlurmdParameters=config_overrides
SchedulerParameters=sched_interval=1,sched_min_interval=10000,batch_sched_delay=0
JobAcctGatherType=jobacct_gather/none
AccountingStorageType=accounting_storage/none
MpiDefault=none
ReturnToService=2
KillWait=10
StateSaveLocation=$folder/state
SlurmdSpoolDir=$folder/spool
SlurmctldPidFile=$folder/slurmctld.pid
SlurmdPidFile=$folder/slurmd.pid
NodeName=node NodeHostname=localhost NodeAddr=127.0.0.1 CPUs=$cpus RealMemory=4000
PartitionName=all Nodes=node Default=YES MaxTime=INFINITE State=UP
CONF

daemons=()
# Lists processes that daemons left behind; only they have this node's configuration in their environment.
orphans() { grep -lsazxF "SLURM_CONF=$SLURM_CONF" /proc/[0-9]*/environ | cut -d/ -f3 | grep -vx "$$" || true; }
stop() {
    trap '' INT TERM
    scancel --quiet --user="$user" 2>/dev/null || true
    # slurmstepd outlives slurmd, so jobs must end first.
    local wait pid
    for ((wait = 0; wait < 50; wait++)); do
        [[ -n "$(squeue --noheader 2>/dev/null)" ]] || break
        sleep 0.1
    done
    ((${#daemons[@]} == 0)) || kill -TERM "${daemons[@]}" 2>/dev/null || true
    for ((wait = 0; wait < 30; wait++)); do
        [[ -n "$(orphans)" ]] || break
        sleep 0.1
    done
    for pid in $(orphans); do kill -KILL "$pid" 2>/dev/null || true; done
    wait
}
trap stop EXIT
trap 'exit 143' TERM
trap 'exit 130' INT

munged --foreground --force --num-threads=2 --key-file="$folder/munge/key" --socket="$folder/munge/socket" \
    --pid-file="$folder/munge/pid" --seed-file="$folder/munge/seed" --log-file="$folder/munge.log" \
    </dev/null >"$folder/munged.out" 2>&1 &
daemons+=($!)
for ((wait = 0; wait < 100; wait++)); do
    [[ ! -S "$folder/munge/socket" ]] || break
    sleep 0.05
done
slurmctld -D -c -L "$folder/slurmctld.log" </dev/null >"$folder/slurmctld.out" 2>&1 &
daemons+=($!)
slurmd -D -c -N node -L "$folder/slurmd.log" </dev/null >"$folder/slurmd.out" 2>&1 &
daemons+=($!)
for ((wait = 0; wait < 300; wait++)); do
    state="$(sinfo --noheader --format=%T 2>/dev/null || true)"
    [[ "$state" != idle ]] || break
    for pid in "${daemons[@]}"; do
        kill -0 "$pid" 2>/dev/null || unable "a daemon ended: $(tail -qn 2 "$folder"/*.out "$folder"/*.log)"
    done
    sleep 0.05
done
[[ "$state" == idle ]] || unable "it is '$state' after 15 s: $(tail -qn 2 "$folder"/*.out "$folder"/*.log)"
echo ready
# `read` ends at once when a signal is trapped.
while read -r _; do :; done
