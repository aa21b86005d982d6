#!/usr/bin/env bash
# Configures and builds the release preset into build/release; arguments are passed to the build.
set -euo pipefail
cd "$(dirname "$0")/.."
log=build/configure.log
mkdir -p build
if ! cmake --preset release >"$log" 2>&1; then
  cat "$log" >&2
  exit 1
fi
cmake --build --preset release "$@"
