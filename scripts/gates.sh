#!/usr/bin/env bash
# Runs the quick accuracy gates, each sabotage in turn among them; leaves out/gates/gates.md, .json and .junit.xml.
# With options, such as --sabotage NAME or --profile full, runs tsdfpp gate with those instead.
set -euo pipefail
cd "$(dirname "$0")/.."
[ $# -gt 0 ] || set -- --profile quick --sabotages
build/release/tsdfpp gate results/gates.toml "$@"
