#!/usr/bin/env bash
# clang-tidy over the sources (or those named); slow, so not part of .ci/run. It cannot read what GCC precompiled and
# takes files one by one: the commands are those of a plain build, in build/plain, which is only configured.
set -euo pipefail
cd "$(dirname "$0")/.."
if [ $# -eq 0 ]; then
  mapfile -t files < <(git ls-files '*.cc')
else
  files=("$@")
fi
cmake --preset release -B build/plain -DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON -DCMAKE_UNITY_BUILD=OFF >/dev/null
printf '%s\0' "${files[@]}" | xargs -0 -n 1 -P "$(nproc)" clang-tidy -p build/plain --quiet
