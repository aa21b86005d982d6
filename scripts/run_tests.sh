#!/usr/bin/env bash
# Runs the tests of a build folder with ctest, and ends with a line on how many were skipped and what they need, if any.
# With CI=true in the environment a skip is a failure where ../shared is there, which has what tests need.
# Usage: bash scripts/run_tests.sh FOLDER [options of ctest]
set -euo pipefail
cd "$(dirname "$0")/.."
folder=$1
shift
report=$(cd "$folder" && pwd)/tests.xml
rm -f "$report"
status=0
ctest --test-dir "$folder" --output-on-failure --output-junit "$report" "$@" || status=$?
python3 scripts/skipped_tests.py "$report" ../shared || status=$?
exit "$status"
