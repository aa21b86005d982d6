#!/usr/bin/env bash
# Makes the tables and plots of docs/scaling.md anew (some ten minutes on an idle machine with two cores); options
# (--parts, --frames, --runs) go to the bench.
set -euo pipefail
cd "$(dirname "$0")/.."
bash scripts/build.sh --target tsdfpp_bench
build/release/tsdfpp_bench scaling --out docs/scaling "$@"
/usr/bin/python3 scripts/plot_scaling_figures.py docs/scaling docs/pictures docs/scaling.md
