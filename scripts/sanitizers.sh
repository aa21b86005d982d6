#!/usr/bin/env bash
# Builds the tests with sanitizers and runs them, the corpora of malformed files among them.
# Usage: bash scripts/sanitizers.sh [asan|tsan] [pattern of tests for ctest -R; all by default]
#   asan (the default) is ASan and UBSan in build/asan, tsan is TSan in build/tsan.
# In the environment: ROOMS="core;mapper;tests" builds those rooms only (CMakeLists.txt).
# SHORT=1 is quick (.ci/run has time for its asan), in build/asan-short and build/tsan-short: the mapper's tests without what is
# slow to build (tests/sanitizers/CMakeLists.txt) or to run (below), in two processes; five random sequences of events in
# place of sixty; and without UBSan's checks of every access through a pointer (null, alignment, type, size), which take
# half of its build and of which ASan notices the first by itself. Under ASan also the inputs that are kept of fuzzing the
# readers of files (docs/fuzzing.md).
set -euo pipefail
cd "$(dirname "$0")/.."
preset=asan
case "${1:-}" in asan | tsan)
  preset=$1
  shift
  ;;
esac
folder=build/$preset
settings=()
targets=()
if [ -n "${SHORT:-}" ]; then
  if [ -n "${1:-}" ]; then
    echo "sanitizers.sh: SHORT=1 takes no pattern, found '$1'" >&2
    exit 2
  fi
  folder=build/$preset-short
  ROOMS="core;mapper;tests"
  targets=(--target mapper_short_tests planted_fault)
  if [ "$preset" = asan ]; then targets+=(fuzz_short_tests); fi
  # The map's checks of itself after every step, which ASan's run makes, find no races.
  if [ "$preset" = tsan ]; then settings=("-DCMAKE_CXX_FLAGS_DEBUG=-O1 -g1 -DNDEBUG"); fi
  if [ "$preset" = asan ]; then
    settings=("-DTSDFPP_SANITIZE=address,bool,bounds,enum,integer-divide-by-zero,return,shift,signed-integer-overflow,unreachable,vla-bound,pointer-overflow,builtin,float-cast-overflow")
  fi
fi
log=build/configure-$preset.log
mkdir -p build
if ! cmake --preset "$preset" -B "$folder" "${settings[@]}" ${ROOMS:+"-DTSDFPP_ROOMS=$ROOMS"} >"$log" 2>&1; then
  cat "$log" >&2
  exit 1
fi
cmake --build "$folder" "${targets[@]}"

# Leaks are not looked for: OpenGL drivers keep what they have until the end. Anything else ends the test.
export ASAN_OPTIONS=detect_leaks=0:abort_on_error=1
export UBSAN_OPTIONS=halt_on_error=1:abort_on_error=1:print_stacktrace=1
# Nothing is suppressed; what oneTBB orders is told by tests/sanitizers/tbb_happens_before.cc. Memory that a library
# writes which is not instrumented (OpenCV's own threads) is not looked at.
export TSAN_OPTIONS=halt_on_error=1:ignore_noninstrumented_modules=1
run=()
# Kernels that spread addresses widely leave GCC 12's TSan no room for its shadow.
if [ "$preset" = tsan ] && setarch "$(uname -m)" -R true 2>/dev/null; then run=(setarch "$(uname -m)" -R); fi

if [ -z "${SHORT:-}" ]; then
  "${run[@]}" bash scripts/run_tests.sh "$folder" -j "$(nproc)" ${1:+-R "$1"}
  exit
fi
"${run[@]}" ctest --test-dir "$folder" --output-on-failure -R '^Sanitizers'
# What fuzzing the readers of files has left (docs/fuzzing.md); the saved maps are among the mapper's tests.
if [ "$preset" = asan ]; then GTEST_BRIEF=1 "$folder/tests/sanitizers/fuzz_short_tests"; fi
# Thousands of moves and frames; comparisons with the dense references, which the random sequences make too, but for ten
# of those with renames.
left_out='*TenThousand*:*DoesNotGrow*:*AgreesWithTinySteps*:*LiesInTheReferences*:*/LayeredQuery*:*ARenamedObject*:Reveal*'
# Every map by the same code, and the same rays and scenes several times: the nightly run has them all.
left_out+=':*RandomRenames*:*MapSymmetries*:*RayCast.Sees*:*OfABall*:*EveryMethod.Instruction*:*OnlyBlocksThat*'
left_out+=':*KeptScene*:*CoverTest.*SeenFromAbove*'
# Whole maps by plain kernels, each of which its own test calls; readers that meet, which is for TSan.
if [ "$preset" = asan ]; then left_out+=':*PlainMap*:*ConcurrentReaders*'; fi
# Of fuzz targets the mapper's tests have that of saved maps alone; fuzz_short_tests has the others.
left_out+=':*EveryReaderOfASequence*'
for part in 1 2 3 4 5 6 7; do left_out+=":*Rims.InventNoTable/$part:*Rims.AnImageAt*/$part"; done
# In these the anchored volumes have all that the others have; masks are repaired otherwise in one field.
for method in tsdf tsdf_min tsdf_guarded tsdf_static tsdf__ tsdf___literal volumes; do
  left_out+=":*LatticeEdge*/$method:*SceneChanges*/$method:*FarPartOfMethod*/$method:*MaskRepairOfVolumes*/$method"
  if [ "$method" != tsdf ]; then left_out+=":*MaskRepairOfMethod*/$method"; fi
done
# What no other thread takes part in, or other tests do on several threads too, has nothing for TSan.
if [ "$preset" = tsan ]; then
  left_out+=':BlockGrid*:HalfLanes*:*Invariants*:MapFileErrors*:*EveryFlippedByte*:*EveryTruncation*:*MadeUp*:MeshCache*'
  left_out+=':*DropsWhatAnother*:*LatticeEdge*:*LatticeRange*:*PipelineRange*'
fi
export RC_PARAMS="max_success=5 seed=20211" GTEST_TOTAL_SHARDS=2 GTEST_BRIEF=1
pids=()
for shard in 0 1; do
  GTEST_SHARD_INDEX=$shard "${run[@]}" "$folder/tests/sanitizers/mapper_short_tests" --gtest_filter="-$left_out" &
  pids+=($!)
done
failed=0
for pid in "${pids[@]}"; do wait "$pid" || failed=1; done
exit "$failed"
