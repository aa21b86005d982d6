#!/usr/bin/env bash
# The pictures of the report in the documents: bash scripts/report_pictures.sh [RUN], a recorded comparison
# (out/toycar3 by default, as scripts/demo.sh leaves it) into docs/pictures/report-*.jpg.
set -euo pipefail
cd "$(dirname "$0")/.."
run=${1:-out/toycar3}
scratch=$(mktemp -d)
trap 'rm -rf "$scratch"' EXIT
build/release/tsdfpp report "$run" --out "$scratch/report.html" >/dev/null
node viewer/screenshots.mjs .deps/viewer "$(command -v chromium)" "$scratch/report.html" docs/pictures
