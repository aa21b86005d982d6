#!/usr/bin/env bash
# Fuzzes the readers of files (docs/fuzzing.md): builds the preset `fuzz`, runs each target for some minutes, from where the
# last run ended, and adds to the record. Any find in out/fuzz/<target>/crashes/ makes it fail.
# Usage: bash scripts/fuzz.sh [--minutes M] [--targets a,b] [--jobs N] [--record FILE]
#        bash scripts/fuzz.sh --bundle DIR     the program, its libraries and the corpora, to be run elsewhere: DIR/run.sh
#        bash scripts/fuzz.sh --import DIR     adds what DIR/run.sh left in its $OUT, each run once
# M is minutes of a core, 1 by default, and may be a fraction, N the number of cores, FILE results/fuzz.json. With 0
# minutes the record alone is made anew: the lines that the corpora reach.
set -euo pipefail
root=$(cd "$(dirname "$0")/.." && pwd)
minutes=1
jobs=$(nproc)
record=$root/results/fuzz.json
targets= bundle= import=
while [ $# -gt 0 ]; do
  if [ $# -lt 2 ]; then
    echo "fuzz.sh: '$1' lacks its value" >&2
    exit 2
  fi
  case "$1" in
  --minutes) minutes=$2 ;;
  --targets) targets=$2 ;;
  --jobs) jobs=$2 ;;
  --record) record=$(realpath -m "$2") ;;
  --bundle) bundle=$(realpath -m "$2") ;;
  --import) import=$(realpath -m "$2") ;;
  *)
    echo "fuzz.sh: '$1' is no option" >&2
    exit 2
    ;;
  esac
  shift 2
done
seconds=0
if [[ $minutes =~ ^([0-9]+\.?[0-9]*|\.[0-9]+)$ ]]; then
  seconds=$(awk -v minutes="$minutes" 'BEGIN {
    seconds = int(60 * minutes)
    printf "%d", (minutes > 0 && seconds < 1 ? -1 : seconds)
  }')
else
  seconds=-1
fi
if [ "$seconds" -lt 0 ]; then
  echo "fuzz.sh: --minutes '$minutes': expected a number, 0 or at least a second, as 0.5" >&2
  exit 2
fi
cd "$root"

# Whether a folder has one of a target at least.
is_a_run() {
  local folder
  for folder in tests/fuzz/corpus/*/; do
    if [ -d "$1/$(basename "$folder")" ]; then return 0; fi
  done
  return 1
}

if [ -n "$import" ] && ! is_a_run "$import"; then
  echo "fuzz.sh: --import '$import': expected the folder that run.sh filled, with a folder a target" >&2
  exit 2
fi
out=out/fuzz
bash scripts/setup.sh --fuzz
mkdir -p build
if ! cmake --preset fuzz >build/configure-fuzz.log 2>&1; then
  cat build/configure-fuzz.log >&2
  exit 1
fi
built=(--target tsdfpp_fuzz)
if [ -z "$bundle" ]; then built+=(tsdfpp_fuzz_lines); fi
cmake --build build/fuzz "${built[@]}"

if [ -n "$bundle" ]; then
  mkdir -p "$bundle/lib"
  cp build/fuzz/tsdfpp_fuzz tests/fuzz/run.sh "$bundle/"
  # The C library is the machine's own.
  ldd build/fuzz/tsdfpp_fuzz | awk '$3 ~ /^\// {print $3}' | grep -vE '/lib(c|m|dl|rt|pthread|resolv)\.so' |
    xargs -I{} cp -L {} "$bundle/lib/"
  bash tests/fuzz/gather.sh "$bundle/corpus" "$out"
  du -sh "$bundle"
  exit
fi

if [ -n "$import" ]; then
  for folder in "$import"/*/; do
    target=$(basename "$folder")
    if [ ! -d "tests/fuzz/corpus/$target" ]; then continue; fi
    mkdir -p "$out/$target/corpus" "$out/$target/crashes"
    for kind in corpus crashes; do
      if [ -d "$folder/$kind" ]; then find "$folder/$kind" -type f -exec cp -f -t "$out/$target/$kind" {} +; fi
    done
    # Runs that are known already were taken before: each begins at a time of its own.
    new=
    if [ -f "$folder/runs.tsv" ]; then
      known=$(cat "$out/$target/counted.tsv" "$out/$target/runs.tsv" 2>/dev/null || true)
      new=$(grep -Fxv -f <(printf '%s\n' "$known") "$folder/runs.tsv" || true)
    fi
    if [ -n "$new" ]; then printf '%s\n' "$new" >>"$out/$target/runs.tsv"; fi
  done
  seconds=0
fi

status=0
if [ "$seconds" -gt 0 ]; then
  # Former finds are where to go on from, as the seeds are.
  seeds=$(mktemp -d)
  trap 'rm -rf "$seeds"' EXIT
  ln -s "$PWD/build/fuzz/tsdfpp_fuzz" "$seeds/"
  bash tests/fuzz/gather.sh "$seeds/corpus"
  FUZZ_HOME=$seeds OUT=$out bash tests/fuzz/run.sh --seconds "$seconds" --jobs "$jobs" ${targets:+--targets "$targets"} ||
    status=$?
fi
/usr/bin/python3 scripts/fuzz.py record --build build/fuzz --out "$out" --record "$record" ${targets:+--targets "$targets"}
for folder in "$out"/*/crashes/; do
  target=$(basename "$(dirname "$folder")")
  if [ -n "$targets" ] && [[ ,$targets, != *,$target,* ]]; then continue; fi
  if [ -d "tests/fuzz/corpus/$target" ] && [ -n "$(ls -A "$folder")" ]; then
    echo "fuzz.sh: $target: there are finds in $folder" >&2
    status=1
  fi
done
exit $status
