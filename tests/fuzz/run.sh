#!/usr/bin/env bash
# Fuzzes targets, some at a time, each for some seconds of a core, and goes on from the corpus that it left the last time.
# A machine that is busy with other things takes longer for them. Needs nothing but bash: `scripts/fuzz.sh --bundle DIR`
# copies it with all that it runs. Beside it lie tsdfpp_fuzz, corpus/ and, where the libraries are not installed, lib/.
# Usage: bash run.sh [--seconds S] [--jobs N] [--targets a,b]
# In the environment: OUT, where $OUT/<target>/ gets corpus/, crashes/, logs and runs.tsv (by default ./out); FUZZ_HOME,
# where the program and the corpora are, if not beside this script.
set -euo pipefail
home=${FUZZ_HOME:-$(cd "$(dirname "$0")" && pwd)}
seconds=60
jobs=$(nproc)
targets=
while [ $# -gt 0 ]; do
  case "$1" in
  --seconds) seconds=$2 ;;
  --jobs) jobs=$2 ;;
  --targets) targets=${2//,/ } ;;
  *)
    echo "run.sh: '$1' is no option, expected --seconds S, --jobs N or --targets a,b" >&2
    exit 2
    ;;
  esac
  shift 2
done
OUT=${OUT:-out}
mkdir -p "$OUT"
OUT=$(cd "$OUT" && pwd)
binary=$home/tsdfpp_fuzz
if [ -d "$home/lib" ]; then export LD_LIBRARY_PATH=$home/lib${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}; fi
if [ -z "$targets" ]; then
  for folder in "$home"/corpus/*/; do targets="$targets $(basename "$folder")"; done
fi
# What a run that ends at a find leaves in memory goes at the end.
scratch=/dev/shm
if [ ! -w "$scratch" ]; then scratch=${TMPDIR:-/tmp}; fi
TSDFPP_FUZZ_SCRATCH=$(mktemp -d "$scratch/tsdfpp-fuzz-XXXXXX")
export TSDFPP_FUZZ_SCRATCH
trap 'rm -rf "$TSDFPP_FUZZ_SCRATCH"' EXIT
# Leaks are not looked for (it takes a debugger's rights); memory that is asked for without reason is a find.
export ASAN_OPTIONS=detect_leaks=0:abort_on_error=1:allocator_may_return_null=0:handle_abort=1
export UBSAN_OPTIONS=print_stacktrace=1
symbolizer=$(command -v llvm-symbolizer-14 || command -v llvm-symbolizer || true)
if [ -n "$symbolizer" ]; then export ASAN_SYMBOLIZER_PATH=$symbolizer; fi

# How libFuzzer ends when it is told to, by SIGINT or SIGTERM; and after an input that took too long.
interrupted=72
too_long=70
limits="-timeout=20 -rss_limit_mb=2048 -malloc_limit_mb=512"

# Inputs that took long, of a target whose program stood still meanwhile, as it does where the machine is suspended: by
# themselves they are done within the ten seconds from which on libFuzzer calls an input slow, and are no finds.
forget_interruptions() {
  local file
  for file in "$1/crashes"/timeout-* "$1/crashes"/slow-unit-*; do
    if [ -f "$file" ] && "$binary" $limits -timeout=10 "$file" >"$1/again.txt" 2>&1; then rm "$file"; fi
  done
  rm -f "$1/again.txt"
}

# Bytes of an input: sets of files are larger than single ones.
most_bytes() {
  local largest=0 size file
  for file in "$home/corpus/$1"/* "$OUT/$1/crashes"/*; do
    if [ ! -f "$file" ]; then continue; fi
    size=$(wc -c <"$file")
    if [ "$size" -gt "$largest" ]; then largest=$size; fi
  done
  echo $((largest * 2 > 8192 ? largest * 2 : 8192))
}

fuzz() {
  local target=$1 now left wall log status executions line used find cpu=0 waited=0 tries=0 TIMEFORMAT='%U %S'
  local to=$OUT/$target
  mkdir -p "$to/corpus" "$to/crashes"
  export TSDFPP_FUZZ_TARGET=$target
  # After a find it goes on, until there are so many that they want a look first.
  while [ $tries -lt 20 ]; do
    now=$(date +%s)
    left=$((seconds - cpu))
    # Each run reads the whole corpus again, so a short one does nothing else.
    if [ $left -lt 1 ] || [ $((8 * left)) -lt "$seconds" ]; then break; fi
    # libFuzzer's limit is of time that goes by: longer where the machine was busy so far, though it may be no more.
    wall=$left
    if [ $cpu -gt 0 ] && [ $waited -gt $cpu ]; then
      wall=$((waited < 2 * cpu ? left * waited / cpu : 2 * left))
    fi
    log=$to/log-$now-$tries.txt
    status=0
    { time "$binary" "$to/corpus" "$home/corpus/$target" -max_total_time="$wall" -max_len="$(most_bytes "$target")" \
      $limits -use_value_profile=1 -reload=0 -print_final_stats=1 \
      -artifact_prefix="$to/crashes/" >"$log" 2>&1; } 2>"$to/time.txt" || status=$?
    # The last line: before it bash says of a program that a signal ended which one it was.
    used=$(tail -1 "$to/time.txt" | awk '{print int($1 + $2 + 0.5)}')
    cpu=$((cpu + used))
    waited=$((waited + $(date +%s) - now))
    executions=$(sed -n 's/^stat::number_of_executed_units: *//p' "$log" | tail -1)
    line=$(grep -a ' cov: ' "$log" | tail -1 || true)
    edges=$(sed -n 's/.* cov: \([0-9]*\).*/\1/p' <<<"$line")
    features=$(sed -n 's/.* ft: \([0-9]*\).*/\1/p' <<<"$line")
    forget_interruptions "$to"
    find=$((status != 0 && status != interrupted))
    if [ $status = $too_long ] && [ -z "$(find "$to/crashes" -name 'timeout-*')" ]; then find=0; fi
    printf '%s\t%s\t%s\t%s\t%s\t%s\n' "$now" "$used" "${executions:-0}" "${edges:-0}" \
      "${features:-0}" "$find" >>"$to/runs.tsv"
    # Only logs of finds are worth their place.
    if [ $find = 0 ]; then rm "$log"; else
      tries=$((tries + 1))
      echo "$target: a find, $log: $(grep -aE '^(complaint|SUMMARY|==[0-9]*== *ERROR)|runtime error' "$log" | head -1)"
    fi
    # Who ends a run wants no other. One that took no time at all would be repeated for ever.
    if [ "$used" = 0 ] || [ $status = $interrupted ]; then break; fi
  done
  rm -f "$to/time.txt"
  echo "$target: $(awk '{s += $2; e += $3} END {print s " s, " e " executions"}' "$to/runs.tsv"), $(find "$to/corpus" -type f | wc -l) inputs, $(find "$to/crashes" -type f | wc -l) finds"
}

if [ ! -x "$binary" ]; then
  echo "run.sh: there is no $binary" >&2
  exit 2
fi
for target in $targets; do
  if [ ! -d "$home/corpus/$target" ]; then
    echo "run.sh: there is no target '$target' in $home/corpus" >&2
    exit 2
  fi
  if [ -z "$(find "$home/corpus/$target" -type f)" ]; then
    echo "run.sh: there is no input to begin with in $home/corpus/$target" >&2
    exit 2
  fi
done
running=0
for target in $targets; do
  if [ "$running" -ge "$jobs" ]; then
    wait -n || true
    running=$((running - 1))
  fi
  fuzz "$target" &
  running=$((running + 1))
done
wait
# Any find of these targets fails the run.
status=0
for target in $targets; do
  if [ -n "$(ls -A "$OUT/$target/crashes")" ]; then status=1; fi
done
exit $status
