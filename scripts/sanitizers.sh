#!/usr/bin/env bash
# Builds the tests with ASan and UBSan into build/asan and runs them, the corpora of malformed files among them.
# Usage: bash scripts/sanitizers.sh [pattern of tests for ctest -R; all by default]
# ROOMS="core;sequence;tests" in the environment builds those rooms only (CMakeLists.txt).
set -euo pipefail
cd "$(dirname "$0")/.."
log=build/configure-asan.log
mkdir -p build
if ! cmake --preset asan ${ROOMS:+"-DTSDFPP_ROOMS=$ROOMS"} >"$log" 2>&1; then
  cat "$log" >&2
  exit 1
fi
cmake --build --preset asan
# Leaks are not looked for: OpenGL drivers keep what they have until the end. Anything else ends the test.
export ASAN_OPTIONS=detect_leaks=0:abort_on_error=1
export UBSAN_OPTIONS=halt_on_error=1:abort_on_error=1:print_stacktrace=1
ctest --test-dir build/asan --output-on-failure -j "$(nproc)" ${1:+-R "$1"}
