#!/usr/bin/env bash
# clang-tidy over the sources: all, those named, or those that changed. It cannot read what GCC precompiled and takes files
# one by one: the commands are those of a plain build, in build/plain, which is only configured; without OpenMP, whose
# header clang has not.
# Usage: bash scripts/tidy.sh [FILES]
#        bash scripts/tidy.sh --since REVISION [--seconds S]     those that changed since, uncommitted ones too,
#                                                                 and for each header that did a source that includes it
# After S seconds no other file is begun; those that were left out are named. A file takes some twenty seconds of a core.
set -euo pipefail
cd "$(dirname "$0")/.."
since= seconds=
while [[ ${1:-} == --* ]]; do
  if [ $# -lt 2 ]; then
    echo "tidy.sh: '$1' lacks its value" >&2
    exit 2
  fi
  case "$1" in
  --since) since=$2 ;;
  --seconds) seconds=$2 ;;
  *)
    echo "tidy.sh: '$1' is no option" >&2
    exit 2
    ;;
  esac
  shift 2
done
if [ -n "$since" ]; then
  if ! git rev-parse --quiet --verify "$since^{commit}" >/dev/null; then
    echo "tidy.sh: '$since' is no revision here" >&2
    exit 2
  fi
  mapfile -t files < <(git diff --name-only --diff-filter=d "$since" -- '*.cc')
  # A header is looked at with a source that includes it: its own, one of its folder, or any.
  while read -r header; do
    include="#include \"$header\""
    if [ ${#files[@]} -gt 0 ] && grep -qF "$include" -- "${files[@]}"; then continue; fi
    reader=$(for where in "${header%.h}.cc" "${header%/*}/*.cc" '*.cc'; do git grep -lF "$include" -- "$where" || true; done |
      sed -n 1p)
    if [ -n "$reader" ]; then files+=("$reader"); fi
  done < <(git diff --name-only --diff-filter=d "$since" -- '*.h')
elif [ $# -eq 0 ]; then
  mapfile -t files < <(git ls-files '*.cc')
else
  files=("$@")
fi
if [ ${#files[@]} -eq 0 ]; then
  echo "tidy: no file to look at"
  exit
fi
cmake --preset release -B build/plain -DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON -DCMAKE_UNITY_BUILD=OFF >/dev/null
left_out=$(mktemp)
trap 'rm -f "$left_out"' EXIT
export LEFT_OUT=$left_out DEADLINE=$(($(date +%s) + ${seconds:-1000000}))
printf '%s\0' "${files[@]}" | xargs -0 -n 1 -P "$(nproc)" bash -c '
  if [ "$(date +%s)" -ge "$DEADLINE" ]; then echo "$0" >>"$LEFT_OUT"; exit; fi
  clang-tidy -p build/plain --quiet --extra-arg=-fno-openmp "$0" 2> >(grep -v "warnings generated" >&2)'
count=$(wc -l <"$left_out")
echo "tidy: $((${#files[@]} - count)) files are clean"
if [ "$count" -gt 0 ]; then
  echo "tidy: no time was left for $count:"
  sed 's/^/  /' "$left_out"
fi
