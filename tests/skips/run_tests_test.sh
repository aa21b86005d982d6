#!/usr/bin/env bash
# scripts/run_tests.sh: what it says of tests that are skipped, and when that is a failure. The scripts run in a folder of
# their own, so that a ../shared can be there or not.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
mkdir -p "$folder/repository"
cp -r "$here/../../scripts" "$folder/repository/scripts"
cd "$folder"
cmake -S "$here" -B build -DCMAKE_BUILD_TYPE=Debug >log 2>&1 && cmake --build build >>log 2>&1 || { cat log; exit 1; }

# expect CODE CI PATTERN [LINE...]: the exit code, and the lines from "skipped" on in what is printed.
expect() {
  local code=0
  CI=$2 bash repository/scripts/run_tests.sh "$folder/build" -R "$3" >printed 2>&1 || code=$?
  printf '%s\n' "${@:4}" | sed '/^$/d' >wanted
  if [ "$code" != "$1" ] || ! diff wanted <(grep '^skipped' printed) >&2; then
    echo "CI=$2 $3: exit code $code, expected $1; printed:"
    cat printed
    exit 1
  fi
}
counted='skipped: 4 of 5 tests; 2 need ../shared/data/meshes, 1 needs a tool, 1 needs something that they do not name'
named='Planted.DoesNotSay, Planted.NeedsAFolder, Planted.NeedsATool, Planted.NeedsItToo'
expect 0 '' Planted.Passes
expect 0 true Planted.Passes
expect 0 '' Planted "$counted"
expect 0 true Planted "$counted"
mkdir shared
expect 0 '' Planted "$counted"
expect 0 true Planted.Passes
expect 1 true Planted "$counted" "skipped tests fail, as CI=true and ../shared is there: $named"
# Failed, so not skipped; ctest's own exit code stays.
expect 8 '' Failing
echo "run_tests.sh: 8 cases as expected"
