#!/usr/bin/env bash
# Generates and verifies scenes/random.toml with many seeds at a quarter of its size; fails where one does.
# Usage: bash scripts/random_seeds.sh [seeds, 100 by default]
set -euo pipefail
cd "$(dirname "$0")/.."
seeds=${1:-100}
out=out/random-seeds
mkdir -p "$out"
one() {
  if build/release/tsdfpp generate scenes/random.toml --seed "$1" --scale 0.25 --jobs 1 --overwrite \
      --out "$2/$1" > "$2/$1.log" 2>&1; then
    rm -rf "${2:?}/$1" "$2/$1.log"
  else
    echo "seed $1 fails: $(tail -n 1 "$2/$1.log")"
    exit 1
  fi
}
export -f one
seq 1 "$seeds" | xargs -P "$(nproc)" -I{} bash -c "one {} $out"
echo "$seeds seeds generated and verified"
