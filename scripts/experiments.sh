#!/usr/bin/env bash
# Runs experiments of eval/experiments/ (those of docs/experiments.md, by default), draws their plots into docs/pictures and
# puts their numbers into the page; goes on where it was stopped. Usage: bash scripts/experiments.sh [NAME ...] [-- OPTIONS OF SWEEP]
set -euo pipefail
cd "$(dirname "$0")/.."
names=()
while [ $# -gt 0 ] && [ "$1" != "--" ]; do names+=("$1"); shift; done
if [ $# -gt 0 ]; then shift; fi
if [ ${#names[@]} -eq 0 ]; then names=(claim baseline voxel truncation noise masks repair poses speed objects moves limits); fi
exec /usr/bin/python3 scripts/pages.py make "${names[@]}" -- "$@"
