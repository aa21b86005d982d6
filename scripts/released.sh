#!/usr/bin/env bash
# Makes the tables of docs/released.md anew (some minutes of two cores); options (--scenes) go to the bench.
set -euo pipefail
cd "$(dirname "$0")/.."
bash scripts/build.sh --target tsdfpp_bench
build/release/tsdfpp_bench released --out docs/released "$@"
/usr/bin/python3 scripts/plot_map_figures.py docs/released docs/pictures docs/released.md
