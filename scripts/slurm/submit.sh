#!/usr/bin/env bash
# Submits a map to Slurm: an array job of its shards, and a merge once all of them are done.
#
#     scripts/slurm/submit.sh [SETTINGS]
#
# SETTINGS is settings.sh beside this script unless given: there is everything that a person edits. When a task failed or
# met its time limit: call it again with the same settings. Shards that are finished are left out, others go on where they
# were. While jobs of the last call are in the queue, nothing is submitted. Each shard has a folder, $out.shard-I-of-N, and
# a log, $out.slurm/shard-I.log, to which every start is appended.
#
# Exit code 0: submitted, or finished already; 1: Slurm refused; 2: the settings are wrong, or the jobs are still there.
set -euo pipefail

fail() {
    local code="$1"
    shift
    printf 'error: %s\n' "$*" >&2
    exit "$code"
}

here="$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd)"
settings="${1:-$here/settings.sh}"
[[ $# -le 1 && "$settings" != -* ]] || fail 2 "usage: submit.sh [SETTINGS]"
[[ -f "$settings" ]] || fail 2 "no settings $settings"
command -v sbatch >/dev/null || fail 2 "sbatch is missing: this is for a login node of a Slurm cluster"

scene='' out='' shards='' engine='' precision='' adapter='' program=rattlemap
cpus='' gpus='' constraint='' memory='' time='' at_once='' merge_cpus='' merge_memory='' merge_time='' partition='' account=''
map_options=() task_options=() merge_options=() job_options=()
# shellcheck disable=SC2317 # Jobs call it.
prepare() { :; }
# `source` looks for a bare name in PATH first.
[[ "$settings" == */* ]] || settings="./$settings"
# shellcheck source=scripts/slurm/settings.sh
source "$settings"

[[ -f "$scene" ]] || fail 2 "$settings: no scene '$scene' here, in $PWD"
[[ -n "$out" ]] || fail 2 "$settings: out is empty; name the map's folder"
[[ "$shards" =~ ^[1-9][0-9]*$ ]] || fail 2 "$settings: shards is '$shards'; write a number from 1"
[[ "$engine" == cpu || "$engine" == gpu ]] ||
    fail 2 "$settings: engine is '$engine'; write cpu or gpu: each node might choose another one"
[[ "$engine" == gpu || -z "$precision$adapter$gpus" ]] ||
    fail 2 "$settings: precision, adapter and gpus are for engine=gpu; leave them empty for cpu"
[[ -z "$at_once" || "$at_once" =~ ^[1-9][0-9]*$ ]] ||
    fail 2 "$settings: at_once is '$at_once'; write a number from 1, or nothing"
if [[ "$program" == */* ]]; then
    [[ -x "$program" ]] || fail 2 "$settings: no program '$program'"
    program="$(realpath "$program")"
fi
out="${out%/}"
if [[ -e "$out/manifest.json" ]]; then
    echo "$out is finished; to compute it anew remove it, or choose another out"
    exit 0
fi

logs="$out.slurm"
if [[ ! -e "$logs/merge.log" && -n "$(ls -A "$out" 2>/dev/null)" ]]; then
    fail 2 "$out holds something that no merge of these shards has left; choose another out, or remove it"
fi
mkdir -p "$logs"
if [[ -s "$logs/jobs" ]]; then
    left="$(squeue --noheader --jobs="$(<"$logs/jobs")" --format='%i %T' 2>/dev/null || true)"
    [[ -z "$left" ]] || fail 2 "jobs of the last call are in the queue: ${left//$'\n'/, }; wait for them, or scancel them"
fi

missing=()
for ((shard = 1; shard <= shards; shard++)); do
    [[ -e "$out.shard-$shard-of-$shards/manifest.json" ]] || missing+=("$shard")
done
array="$(IFS=,; echo "${missing[*]}")"
((${#missing[@]} < shards)) || array="1-$shards"

# Arguments of sbatch for each setting that says something.
from() { [[ -z "$2" ]] || printf '%s\0' "$1=$2"; }
readarray -d '' -t both < <(from --partition "$partition" && from --account "$account")
both+=(--parsable --chdir="$PWD" --open-mode=append --ntasks=1 "${job_options[@]}")
readarray -d '' -t per_task < <(
    from --cpus-per-task "$cpus" && from --gpus-per-task "$gpus" && from --constraint "$constraint"
    from --mem "$memory" && from --time "$time"
)
readarray -d '' -t per_merge < <(from --cpus-per-task "$merge_cpus" && from --mem "$merge_memory" && from --time "$merge_time")
options=(--engine "$engine")
[[ -z "$precision" ]] || options+=(--precision "$precision")
[[ -z "$adapter" ]] || options+=(--adapter "$adapter")
job=("$here/job.sh" "$(declare -f prepare)" "$shards" "$out" "$program" "$scene" "${options[@]}" "${map_options[@]}")
name="$(basename "$out")"
# Slurm reads % in names of logs.
log="${logs//%/%%}"

jobs=() after=()
if ((${#missing[@]})); then
    # SIGTERM half a minute before the time limit, to the program and not to steps, of which there are none.
    array_job="$(
        sbatch "${both[@]}" "${per_task[@]}" --array="$array${at_once:+%$at_once}" --job-name="$name" --requeue \
            --signal=B:TERM@30 --output="$log/shard-%a.log" "${task_options[@]}" "${job[@]}"
    )" || fail 1 "Slurm did not take the array job; nothing is submitted"
    # Of federated clusters the answer is ID;CLUSTER.
    jobs+=("${array_job%%;*}")
    # The merge could do nothing without one of them: it leaves the queue when one fails.
    after=(--dependency="afterok:${jobs[0]}" --kill-on-invalid-dep=yes)
fi
merge_job="$(
    sbatch "${both[@]}" "${per_merge[@]}" "${after[@]}" --job-name="$name-merge" --requeue \
        --output="$log/merge.log" "${merge_options[@]}" "${job[@]}"
)" || {
    ((${#jobs[@]} == 0)) || scancel "${jobs[@]}"
    fail 1 "Slurm did not take the merge; nothing is submitted"
}
jobs+=("${merge_job%%;*}")
list="$(IFS=,; echo "${jobs[*]}")"
echo "$list" >"$logs/jobs"

if ((${#missing[@]})); then
    echo "array job ${jobs[0]}: ${#missing[@]} of $shards shards of $scene (tasks $array)"
    echo "merge job ${jobs[1]}: $out, once all of them are done; if one fails, Slurm cancels it: then call this again"
else
    echo "merge job ${jobs[0]}: $out; all $shards shards are finished"
fi
echo "watch:  squeue --jobs=$list"
printf 'logs:   tail %q/*.log\n' "$logs"
echo "cancel: scancel ${jobs[*]}"
