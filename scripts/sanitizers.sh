#!/usr/bin/env bash
# Builds the tests with sanitizers and runs them, the corpora of malformed files among them.
# Usage: bash scripts/sanitizers.sh [asan|tsan] [pattern of tests for ctest -R; all by default]
#   asan (the default) is ASan and UBSan in build/asan, tsan is TSan in build/tsan.
# In the environment: ROOMS="core;mapper;tests" builds those rooms only (CMakeLists.txt); SHORT=1 draws five
# random sequences of events in place of sixty and leaves out the walk of ten thousand moves, as .ci/run does.
set -euo pipefail
cd "$(dirname "$0")/.."
preset=asan
case "${1:-}" in asan | tsan)
  preset=$1
  shift
  ;;
esac
log=build/configure-$preset.log
mkdir -p build
if ! cmake --preset "$preset" ${ROOMS:+"-DTSDFPP_ROOMS=$ROOMS"} >"$log" 2>&1; then
  cat "$log" >&2
  exit 1
fi
cmake --build --preset "$preset"

# Leaks are not looked for: OpenGL drivers keep what they have until the end. Anything else ends the test.
export ASAN_OPTIONS=detect_leaks=0:abort_on_error=1
export UBSAN_OPTIONS=halt_on_error=1:abort_on_error=1:print_stacktrace=1
# Nothing is suppressed; what oneTBB orders is told by tests/sanitizers/tbb_happens_before.cc. Memory that a library
# writes which is not instrumented (OpenCV's own threads) is not looked at.
export TSAN_OPTIONS=halt_on_error=1:ignore_noninstrumented_modules=1
run=()
# Kernels that spread addresses widely leave GCC 12's TSan no room for its shadow.
if [ "$preset" = tsan ] && setarch "$(uname -m)" -R true 2>/dev/null; then run=(setarch "$(uname -m)" -R); fi
left_out=()
if [ -n "${SHORT:-}" ]; then
  export RC_PARAMS="max_success=5 seed=20211"
  left_out=(-E TenThousand)
fi
"${run[@]}" ctest --test-dir "build/$preset" --output-on-failure -j "$(nproc)" ${1:+-R "$1"} "${left_out[@]}"
