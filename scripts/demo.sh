#!/usr/bin/env bash
# From a bare Debian 12 to the comparison on the bundled toy-car scene: out/toycar3/report.html.
set -euo pipefail
cd "$(dirname "$0")/.."
bash scripts/setup.sh
bash scripts/build.sh --target tsdfpp_command
build/release/tsdfpp compare scenes/toycar3.toml --out out/toycar3 --every 32 --record
build/release/tsdfpp report out/toycar3
