#!/usr/bin/env bash
# Submits a map to Slurm: an array job of its shards, and a merge once all of them are done.
#
#     scripts/slurm/submit.sh [SETTINGS]
#
# SETTINGS is settings.sh beside this script unless given: there is everything that a person edits. When a task failed or
# met its time limit, or some nodes went down: call it again with the same settings. Shards that are finished are left
# out; one of them is looked at again, which shows that scene, program and cards are still theirs. While jobs of the last
# call are in the queue, nothing is submitted. Each shard keeps its folder, $out.shard-I-of-N, and its log,
# $out.slurm/shard-I.log, to which every start is appended.
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
cpus='' gpus='' constraint='' memory='' time='' at_once='' merge_memory='' merge_time='' partition='' account=''
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
mkdir -p "$logs"
if [[ -s "$logs/jobs" ]]; then
    left="$(squeue --noheader --jobs="$(<"$logs/jobs")" --format='%i %T' 2>/dev/null || true)"
    [[ -z "$left" ]] || fail 2 "jobs of the last call are in the queue: ${left//$'\n'/, }; wait for them, or scancel them"
fi

# What is missing, and one that is not.
missing=() finished=()
for ((index = 1; index <= shards; index++)); do
    if [[ -e "$out.shard-$index-of-$shards/manifest.json" ]]; then finished+=("$index"); else missing+=("$index"); fi
done
tasks=("${missing[@]}" "${finished[@]:0:1}")
array="$(IFS=,; echo "${tasks[*]}")"
((${#missing[@]} < shards)) || array="1-$shards"

# Arguments of sbatch for each setting that says something.
from() { [[ -z "$2" ]] || printf '%s\0' "$1=$2"; }
readarray -d '' -t both < <(from --partition "$partition" && from --account "$account")
both+=(--parsable --chdir="$PWD" --open-mode=append --ntasks=1 "${job_options[@]}")
readarray -d '' -t per_task < <(
    from --cpus-per-task "$cpus" && from --gpus-per-task "$gpus" && from --constraint "$constraint"
    from --mem "$memory" && from --time "$time"
)
readarray -d '' -t per_merge < <(from --mem "$merge_memory" && from --time "$merge_time")
map=("$scene" --engine "$engine")
[[ -z "$precision" ]] || map+=(--precision "$precision")
[[ -z "$adapter" ]] || map+=(--adapter "$adapter")
map+=("${map_options[@]}")
name="$(basename "$out")"
# Slurm reads % in names of logs.
log="${logs//%/%%}"
prepare="$(declare -f prepare)"

# SIGTERM half a minute before the time limit, to the program and not to steps, of which there are none.
array_job="$(
    sbatch "${both[@]}" "${per_task[@]}" --array="$array${at_once:+%$at_once}" --job-name="$name" --requeue \
        --signal=B:TERM@30 --output="$log/shard-%a.log" "${task_options[@]}" \
        "$here/shard.sh" "$prepare" "$shards" "$out" "$program" "${map[@]}"
)" || fail 1 "Slurm did not take the array job; nothing is submitted"
# Of federated clusters the answer is ID;CLUSTER.
array_job="${array_job%%;*}"
merge_job="$(
    sbatch "${both[@]}" "${per_merge[@]}" --dependency="afterok:$array_job" --kill-on-invalid-dep=yes \
        --job-name="$name-merge" --requeue --output="$log/merge.log" "${merge_options[@]}" \
        "$here/merge.sh" "$prepare" "$shards" "$out" "$program"
)" || {
    scancel "$array_job"
    fail 1 "Slurm did not take the merge; the array job $array_job is cancelled"
}
merge_job="${merge_job%%;*}"
echo "$array_job,$merge_job" >"$logs/jobs"

if ((${#missing[@]})); then
    echo "array job $array_job: ${#missing[@]} of $shards shards of $scene (tasks $array)"
else
    echo "array job $array_job: all $shards shards of $scene are there, one is looked at again (task $array)"
fi
echo "merge job $merge_job: $out, once all of them are done; if one fails, Slurm cancels it: then call this again"
echo "watch:  squeue --jobs=$array_job,$merge_job"
printf 'logs:   tail %q/shard-*.log %q/merge.log\n' "$logs" "$logs"
echo "cancel: scancel $array_job $merge_job"
