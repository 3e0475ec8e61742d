#!/bin/bash -l
#SBATCH --job-name=rattlemap --array=1-8
#SBATCH --cpus-per-task=4 --mem=2G --time=01:00:00
#SBATCH --requeue --signal=B:TERM@30
#SBATCH --open-mode=append --output=slurm-shard-%a.log
# Computes a map as an array job, one shard per task. Copy this file, edit the lines above and the settings below, then
# submit the shards and a merge that waits for them:
#
#     job=$(sbatch --parsable slurm.sh)
#     sbatch --dependency=afterok:$job --wrap 'rattlemap merge out/e_omega out/e_omega.shard-*'
#
# Submit again after a failure or a time limit: finished shards end at once, others continue from their records.
# For GPUs set engine=gpu and add `#SBATCH --gpus-per-task=1`. All tasks must use the same engine, precision and card model.
set -euo pipefail
scene=scenes/e_omega.toml
out=out/e_omega
shards=8            # the last index of --array
engine=cpu          # cpu or gpu
options=()          # more options of `rattlemap map`, for example (--precision f64 --set F=60)
# module load vulkan

export RAYON_NUM_THREADS="${SLURM_CPUS_PER_TASK:-0}"
# `exec` replaces the shell, so that Slurm's SIGTERM reaches the program. It then stores its records and exits with 143.
exec rattlemap map "$scene" --engine "$engine" --shard "$SLURM_ARRAY_TASK_ID/$shards" \
    --out "$out.shard-$SLURM_ARRAY_TASK_ID-of-$shards" --resume "${options[@]}"
