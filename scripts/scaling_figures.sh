#!/usr/bin/env bash
# Makes the tables and plots of docs/scaling.md anew (some ten minutes on an idle machine with two cores); options
# (--parts, --frames, --runs) go to the bench.
set -euo pipefail
cd "$(dirname "$0")/.."
exec /usr/bin/python3 scripts/pages.py make scaling -- "$@"
