#!/usr/bin/env bash
# What does not fit in CI's time: the full gates with every sabotage, the scored values of all pages made anew and compared
# with what the pages say (the audit of the gates, the mutations of the metrics and the experiments among them), the tests
# that do more where there is time (tests/thorough.h), the mapper's tests under ASan with UBSan and under TSan, a minute of
# fuzzing each reader of files, kills and faults of every command, a build in which every file has only the headers that it
# names, the mapper installed from a build of its own, and the experiments that are in no page.
# All cells are kept below OUT (out/nightly by default), so a run that was stopped goes on from there.
# Usage: bash scripts/nightly.sh [--gates-only] [OUT]; --gates-only leaves out all but the gates.
set -euo pipefail
cd "$(dirname "$0")/.."
gates_only=no
if [ "${1:-}" = "--gates-only" ]; then gates_only=yes; shift; fi
out=${1:-out/nightly}
tsdfpp=build/release/tsdfpp
status=0
# The full profile holds the quick one's experiments too.
"$tsdfpp" gate results/gates.toml --profile full --sabotages --out "$out/gates" || status=$?
if [ "$gates_only" = yes ]; then exit "$status"; fi
/usr/bin/python3 scripts/pages.py check scored --scratch "$out" || status=$?
# Fails where anything was lost, and compares what was tried with docs/robustness.md.
/usr/bin/python3 scripts/pages.py check faults --scratch "$out" || status=$?
TSDFPP_THOROUGH=1 bash scripts/run_tests.sh build/release -j "$(nproc)" -R '^(KilledCommands|ToyCar3)\.' || status=$?
for preset in asan tsan; do ROOMS="core;mapper;tests" bash scripts/sanitizers.sh "$preset" || status=$?; done
bash scripts/fuzz.sh --record "$out/fuzz.json" || status=$?
cmake --preset release -B build/plain -DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON -DCMAKE_UNITY_BUILD=OFF && cmake --build build/plain || status=$?
bash scripts/check_install.sh || status=$?
before=$(git rev-list -1 --before='25 hours ago' HEAD)
if [ -n "$before" ]; then bash scripts/tidy.sh --since "$before" || status=$?; fi
# Those of the pages have their cells by now.
for experiment in eval/experiments/*.toml; do
  "$tsdfpp" sweep "$experiment" --out "$out/experiments/$(basename "$experiment" .toml)" || status=$?
done
exit "$status"
