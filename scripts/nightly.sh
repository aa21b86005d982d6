#!/usr/bin/env bash
# What does not fit in CI's time: the full gates with every sabotage, the audit of the quick ones, and the long experiments.
# All cells are kept below OUT (out/nightly by default), so a run that was stopped goes on from there.
set -euo pipefail
cd "$(dirname "$0")/.."
out=${1:-out/nightly}
tsdfpp=build/release/tsdfpp
status=0
"$tsdfpp" gate results/gates.toml --profile quick --sabotages --out "$out/quick" || status=$?
"$tsdfpp" gate results/gates.toml --profile full --sabotages --out "$out/full" || status=$?
"$tsdfpp" gate results/gates.toml --audit --out "$out/audit" || status=$?
for experiment in eval/experiments/*.toml; do
  [ -e "$experiment" ] || continue
  "$tsdfpp" sweep "$experiment" --out "$out/experiments/$(basename "$experiment" .toml)" || status=$?
done
exit "$status"
