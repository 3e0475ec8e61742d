#!/bin/bash -l
# What a job runs: a task of the array makes its shard, the job after it merges all of them. submit.sh submits it with
#
#     job.sh PREPARE SHARDS OUT PROGRAM SCENE [OPTION...]
#
# and nothing here is edited. The program takes the place of the shell, so that Slurm's SIGTERM reaches it (time limit,
# scancel, preemption): it keeps its records and ends with 143. --resume goes on from them when the task runs again, after
# a requeue or for a new submission, begins where nothing was kept, and is done at once where the shard is finished.
eval "$1"
prepare || {
    echo "error: prepare, of the settings, failed on $(hostname) with $?" >&2
    exit 1
}
set -euo pipefail
shards="$2" out="$3" program="$4" scene="$5"
shift 5
command -v "$program" >/dev/null || {
    echo "error: no program '$program' on $(hostname); set program, or load its module in prepare" >&2
    exit 1
}
# Not every cluster binds a job to its processors.
if [[ -n "${SLURM_CPUS_PER_TASK:-}" ]]; then export RAYON_NUM_THREADS="$SLURM_CPUS_PER_TASK"; fi
start=$((${SLURM_RESTART_COUNT:-0} + 1))

if [[ -n "${SLURM_ARRAY_TASK_ID:-}" ]]; then
    shard="$SLURM_ARRAY_TASK_ID"
    echo "shard $shard of $shards on $(hostname), job ${SLURM_ARRAY_JOB_ID}_$shard, start $start"
    exec "$program" map "$scene" --shard "$shard/$shards" --out "$out.shard-$shard-of-$shards" --resume "$@"
fi

echo "merge of $shards shards on $(hostname), job $SLURM_JOB_ID, start $start"
# Whether the scene and the program are still those of the shards, which only a run of a shard can tell; it is finished, and
# takes no card.
if [[ -e "$out.shard-1-of-$shards/manifest.json" ]]; then
    "$program" map "$scene" --shard "1/$shards" --out "$out.shard-1-of-$shards" --resume --quiet "$@"
fi
# Those that are not there are named by the program.
parts=()
for ((shard = 1; shard <= shards; shard++)); do
    if [[ -d "$out.shard-$shard-of-$shards" ]]; then parts+=("$out.shard-$shard-of-$shards"); fi
done
# A merge that was cut short leaves files; submit.sh lets none begin over anything else.
exec "$program" merge "$out" "${parts[@]}" --force
