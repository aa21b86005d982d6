#!/usr/bin/env bash
# Runs experiments of eval/experiments/ (all but ci, by default), draws their plots into docs/pictures and puts their numbers
# into docs/experiments.md; goes on where it was stopped. Usage: bash scripts/experiments.sh [NAME ...] [-- OPTIONS OF SWEEP]
set -euo pipefail
cd "$(dirname "$0")/.."
names=()
while [ $# -gt 0 ] && [ "$1" != "--" ]; do names+=("$1"); shift; done
if [ $# -gt 0 ]; then shift; fi
if [ ${#names[@]} -eq 0 ]; then names=(claim voxel truncation noise masks poses speed objects moves limits); fi
bash scripts/build.sh --target tsdfpp_command
for name in "${names[@]}"; do
  out="out/experiments/$name"
  build/release/tsdfpp sweep "eval/experiments/$name.toml" --out "$out" "$@"
  /usr/bin/python3 scripts/plot_experiment.py "$out" docs/pictures docs/experiments.md
done
