#!/usr/bin/env bash
# Makes the audit table of docs/gates.md again, between its two marks.
set -euo pipefail
cd "$(dirname "$0")/.."
out=${1:-out/gates-audit}
build/release/tsdfpp gate results/gates.toml --profile quick --audit --out "$out" >/dev/null
awk -v table="$out/audit.md" '
  /<!-- audit begins -->/ { print; print ""; while ((getline line < table) > 0) print line; print ""; skip = 1 }
  /<!-- audit ends -->/ { skip = 0 }
  !skip || /<!-- audit begins -->/ { if (!/<!-- audit begins -->/) print }
' docs/gates.md >docs/gates.md.part
mv docs/gates.md.part docs/gates.md
