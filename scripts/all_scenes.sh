#!/usr/bin/env bash
# Generates and verifies every scene of scenes/ whole; prints each certificate, fails where one does.
# Usage: bash scripts/all_scenes.sh [names of scenes; all by default]
set -euo pipefail
cd "$(dirname "$0")/.."
out=out/all-scenes
mkdir -p "$out"
names=("$@")
if [ ${#names[@]} -eq 0 ]; then
  for file in scenes/*.toml; do names+=("$(basename "$file" .toml)"); done
fi
failed=()
for name in "${names[@]}"; do
  build/release/tsdfpp generate "scenes/$name.toml" --overwrite --out "$out/$name" || failed+=("$name")
  rm -rf "${out:?}/$name"
done
if [ ${#failed[@]} -gt 0 ]; then
  echo "not generated or not sound: ${failed[*]}"
  exit 1
fi
echo "${#names[@]} scenes generated and verified"
