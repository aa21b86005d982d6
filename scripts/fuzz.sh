#!/usr/bin/env bash
# Fuzzes the readers of files (docs/fuzzing.md): builds the preset `fuzz`, runs each target for some minutes, from where the
# last run ended, and adds to the record. Any find in out/fuzz/<target>/crashes/ makes it fail.
# Usage: bash scripts/fuzz.sh [--minutes M] [--targets a,b] [--jobs N] [--record FILE]
#        bash scripts/fuzz.sh --bundle DIR     the program, its libraries and the corpora, to be run elsewhere: DIR/run.sh
#        bash scripts/fuzz.sh --import DIR     adds what DIR/run.sh left in its $OUT
# M is minutes of a core, 1 by default, and may be a fraction, N the number of cores, FILE results/fuzz.json. With 0
# minutes the record alone is made anew: the lines that the corpora reach.
set -euo pipefail
cd "$(dirname "$0")/.."
minutes=1
jobs=$(nproc)
record=results/fuzz.json
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
  --record) record=$2 ;;
  --bundle) bundle=$2 ;;
  --import) import=$2 ;;
  *)
    echo "fuzz.sh: '$1' is no option" >&2
    exit 2
    ;;
  esac
  shift 2
done
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
      if [ -d "$folder/$kind" ]; then find "$folder/$kind" -type f -exec cp -t "$out/$target/$kind" {} +; fi
    done
    cat "$folder/runs.tsv" >>"$out/$target/runs.tsv"
  done
  minutes=0
fi

status=0
seconds=$(awk -v minutes="$minutes" 'BEGIN {print int(60 * minutes)}')
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
exit $status
