#!/usr/bin/env bash
# The mapper installs on its own: builds core and mapper alone, installs them to a prefix that is thrown away, builds
# examples/ and a file that includes every public header against that prefix, and runs the example.
# Usage: bash scripts/check_install.sh [BUILD]; with BUILD what is built there is installed, which saves three minutes.
set -euo pipefail
cd "$(dirname "$0")/.."
build=${1:-build/mapper-only}
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
run() { # its output only where it fails
  "$@" >"$work/log" 2>&1 || { cat "$work/log" >&2; exit 1; }
}
if [ $# = 0 ]; then
  run cmake -S . -B "$build" -G Ninja -DCMAKE_BUILD_TYPE=Release "-DTSDFPP_ROOMS=core;mapper"
  run cmake --build "$build"
fi
run cmake --install "$build" --prefix "$work/prefix"
mkdir "$work/headers"
sed -nE 's/^(mapper\/.*)$/#include "\1"/p' mapper/public_headers.txt >"$work/headers/all.cc"
cat >"$work/headers/CMakeLists.txt" <<'END'
cmake_minimum_required(VERSION 3.25)
project(headers LANGUAGES C CXX)
find_package(tsdfpp 0.1 REQUIRED)
add_library(headers OBJECT all.cc)
target_link_libraries(headers PRIVATE tsdfpp::mapper)
END
run cmake -S "$work/headers" -B "$work/headers/build" -G Ninja "-DCMAKE_PREFIX_PATH=$work/prefix"
run cmake --build "$work/headers/build"
run cmake -S examples -B "$work/example" -G Ninja -DCMAKE_BUILD_TYPE=Release "-DCMAKE_PREFIX_PATH=$work/prefix"
run cmake --build "$work/example"
(cd "$work" && example/move_a_ball)
[[ -s $work/ball.tsdfpp ]] || { echo "install: the example saved no map" >&2; exit 1; }
if ldd "$work/example/move_a_ball" | grep -iE 'mujoco|open3d'; then
  echo "install: the mapper needs one of these" >&2
  exit 1
fi
echo "install: the example builds and runs against the installed mapper"
