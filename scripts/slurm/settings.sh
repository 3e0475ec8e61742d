# shellcheck shell=bash disable=SC2034
# One map as an array job on Slurm: what to compute, and what each task needs. The only file to edit; then
#
#     scripts/slurm/submit.sh [SETTINGS]
#
# submits the shards and the merge. Copy the folder, or this file under another name for another map. submit.sh reads the
# file once: jobs keep what they were submitted with. Relative paths start where submit.sh is called, and all paths must
# be seen by every node. Empty values are the cluster's, or the program's, own.

# The map. All shards are of one engine, one precision and one model of card, or the merge refuses them.
scene=scenes/e_omega.toml
out=out/e_omega     # the map; the shards' folders lie beside it ($out.shard-I-of-N), as do the logs ($out.slurm)
shards=8            # tasks; a multiple of what runs at once. Small ones wait less and lose less
engine=cpu          # cpu or gpu
precision=          # gpu: f32 (its own) or f64
adapter=            # gpu: the card that a task takes, where it sees several (see rattlemap devices); all: a task takes all
map_options=()      # more for rattlemap map: (--set parameters.F=60)
program=rattlemap   # a name that jobs find after `prepare`, or a path

# What a task gets: one task per card, or per so many processors.
cpus=4              # on the CPU engine as many threads; with a GPU two are enough
gpus=               # with engine=gpu: 1, or a model of card and a number: a100:1
constraint=         # a feature of nodes, so that all cards are of one model: a100
memory=2G
time=01:00:00       # a task that is not done by then is gone on with when submit.sh is called again
at_once=            # tasks that run at a time, at most
task_options=()     # more for sbatch: (--exclusive)

# What the merge gets; it takes no card.
merge_cpus=2
merge_memory=2G
merge_time=00:30:00
merge_options=()

# Both of them.
partition=
account=
job_options=()      # more for sbatch: (--qos=low --mail-type=FAIL,END)

# Runs first in each job.
prepare() {
    # module load vulkan
    :
}
