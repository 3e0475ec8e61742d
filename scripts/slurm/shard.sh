#!/bin/bash -l
# One task of the array: one shard of a map. submit.sh submits it with
#
#     shard.sh PREPARE SHARDS OUT PROGRAM SCENE [OPTION...]
#
# The program takes the place of the shell, so that Slurm's SIGTERM reaches it (time limit, scancel, preemption): it
# keeps its records and ends with 143. --resume goes on from them when the task runs again, after a requeue or for a new
# submission, and is done at once where the shard is finished.
eval "$1"
prepare || {
    echo "error: prepare, of the settings, failed on $(hostname) with $?" >&2
    exit 1
}
set -euo pipefail
shards="$2" out="$3" program="$4" scene="$5"
shift 5
index="$SLURM_ARRAY_TASK_ID"
command -v "$program" >/dev/null || {
    echo "error: no program $program on $(hostname); set program, or load its module in prepare" >&2
    exit 1
}
# Not every cluster binds a task to its processors.
if [[ -n "${SLURM_CPUS_PER_TASK:-}" ]]; then export RAYON_NUM_THREADS="$SLURM_CPUS_PER_TASK"; fi
echo "shard $index of $shards on $(hostname), job ${SLURM_ARRAY_JOB_ID}_$index, start $((${SLURM_RESTART_COUNT:-0} + 1))"
exec "$program" map "$scene" --shard "$index/$shards" --out "$out.shard-$index-of-$shards" --resume "$@"
