#!/usr/bin/env bash
# Makes the table of docs/results.md anew: every scene with every family of maps, at 0.35 times the images' size, every third
# frame. Usage: bash scripts/results.sh [OPTIONS OF SWEEP]; at full size: bash scripts/results.sh --scale 1 --stride 1
set -euo pipefail
cd "$(dirname "$0")/.."
exec /usr/bin/python3 scripts/pages.py make scenes -- "$@"
