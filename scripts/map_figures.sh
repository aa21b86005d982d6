#!/usr/bin/env bash
# Makes the tables and pictures of docs/map-figures.md and docs/map.md anew (some minutes); options (--parts) go to the bench.
set -euo pipefail
cd "$(dirname "$0")/.."
bash scripts/build.sh --target tsdfpp_bench
build/release/tsdfpp_bench figures --out docs/map-figures "$@"
/usr/bin/python3 scripts/plot_map_figures.py docs/map-figures docs/pictures docs/map-figures.md
