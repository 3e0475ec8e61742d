#!/usr/bin/env bash
# Tests the Python package as users install it: in a new environment, away from the sources. The tests include the lines of the
# README and the notebook. Installs the given wheel, else ./python. With --notebook, runs the notebook and writes it with its
# figures instead.
#
#     scripts/python.sh [WHEEL]
#     scripts/python.sh --notebook
set -euo pipefail
root="$(cd "$(dirname "$0")/.." && pwd)"

fail() {
    printf 'error: %s\n' "$*" >&2
    exit 1
}

python="$(command -v python3 || command -v python)" || fail "Python is missing; install 3.10 or later"
notebook=
package="$root/python"
case "${1:-}" in
    --notebook) notebook="$root/docs/python.ipynb" ;;
    -*) fail "unknown option $1; usage: scripts/python.sh [WHEEL | --notebook]" ;;
    ?*) package="$(cd "$(dirname "$1")" && pwd)/$(basename "$1")" ;;
esac

scratch="$(mktemp -d)"
trap 'rm -rf "$scratch"' EXIT
"$python" -m venv "$scratch/venv"
bin="$scratch/venv/bin"
[[ -d "$bin" ]] || bin="$scratch/venv/Scripts"
pip() { "$bin/python" -m pip install --quiet --disable-pip-version-check "$@"; }

began=$SECONDS
pip "${package}[plot,progress,dask]"
printf '== installed in %d s\n' $((SECONDS - began))
pip -r "$root/python/tests/requirements.txt"
cd "$scratch"
export MPLBACKEND=Agg
if [[ -n "$notebook" ]]; then
    pip nbclient ipykernel
    unset MPLBACKEND
    "$bin/python" - "$notebook" <<'PYTHON'
import sys

import nbformat
from nbclient import NotebookClient

notebook = nbformat.read(sys.argv[1], as_version=4)
NotebookClient(notebook, timeout=300, kernel_name="python3").execute()
for cell in notebook.cells:
    # Removes the times of execution.
    cell.metadata.pop("execution", None)
nbformat.write(notebook, sys.argv[1])
PYTHON
    exit
fi
began=$SECONDS
"$bin/rattlemap" --version
"$bin/python" -m pytest -q -rs -p no:cacheprovider --durations=10 --durations-min=1 "$root/python/tests"
# Only an installed package has entry points, which xarray uses.
"$bin/rattlemap" map "$root/scenes/e_omega.toml" --set axis.0.count=8 --set axis.1.count=8 --engine cpu --quiet --out map
"$bin/python" -c 'import xarray; print(xarray.open_dataset("map", engine="rattlemap").sizes)'
printf '== tested in %d s\n' $((SECONDS - began))
