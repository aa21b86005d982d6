#!/usr/bin/env bash
# Makes the table of docs/results.md anew: every scene with every family of maps, at 0.35 times the images' size, every third
# frame. Usage: bash scripts/results.sh [OPTIONS OF SWEEP]; at full size: bash scripts/results.sh --scale 1 --stride 1
set -euo pipefail
cd "$(dirname "$0")/.."
bash scripts/build.sh --target tsdfpp_command
build/release/tsdfpp sweep eval/experiments/scenes.toml --out out/experiments/scenes "$@"
/usr/bin/python3 scripts/plot_experiment.py out/experiments/scenes docs/pictures docs/results.md
