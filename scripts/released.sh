#!/usr/bin/env bash
# Makes the tables of docs/released.md anew (some twenty minutes of two cores); options (--scenes) go to the bench.
set -euo pipefail
cd "$(dirname "$0")/.."
exec /usr/bin/python3 scripts/pages.py make released -- "$@"
