#!/usr/bin/env bash
# From a bare Debian 12 to the comparison on the bundled toy-car scene: out/toycar3/report.html, or that in another folder.
# Usage: bash scripts/demo.sh [OUT]
set -euo pipefail
cd "$(dirname "$0")/.."
out=${1:-out/toycar3}
bash scripts/setup.sh
bash scripts/build.sh --target tsdfpp_command
build/release/tsdfpp compare scenes/toycar3.toml --out "$out" --every 32 --record
build/release/tsdfpp report "$out"
