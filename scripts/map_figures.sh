#!/usr/bin/env bash
# Makes the tables and pictures of docs/map-figures.md and docs/map.md anew (some minutes).
# Usage: bash scripts/map_figures.sh [--parts NAME,NAME]
set -euo pipefail
cd "$(dirname "$0")/.."
parts=(decay layers switches sweep slice ghosts)
if [ "${1:-}" = "--parts" ]; then IFS=, read -ra parts <<<"$2"; shift 2; fi
if [ $# -gt 0 ]; then echo "unknown option '$1', expected --parts" >&2; exit 2; fi
exec /usr/bin/python3 scripts/pages.py make "${parts[@]}"
