#!/bin/bash -l
# The job after the array: all shards become one map. submit.sh submits it with
#
#     merge.sh PREPARE SHARDS OUT PROGRAM
#
# The shards' folders stay as they are. The program refuses shards that are missing, unfinished, damaged or of another
# map, before it writes.
eval "$1"
prepare || {
    echo "error: prepare, of the settings, failed on $(hostname) with $?" >&2
    exit 1
}
set -euo pipefail
shards="$2" out="$3" program="$4"
command -v "$program" >/dev/null || {
    echo "error: no program $program on $(hostname); set program, or load its module in prepare" >&2
    exit 1
}
parts=()
for ((index = 1; index <= shards; index++)); do parts+=("$out.shard-$index-of-$shards"); done
# A merge that was cut short leaves files, and no manifest; submit.sh touches no finished map.
exec "$program" merge "$out" "${parts[@]}" --force
