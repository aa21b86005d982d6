#!/usr/bin/env bash
# Puts the inputs that a run begins with into TO/<target>/: the seeds, former finds and, where OUT is given, the corpora
# that runs left in OUT/<target>/corpus/.
# Usage: bash gather.sh TO [OUT]
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
to=$1
out=${2:-}
for folder in "$here"/corpus/*/; do
  target=$(basename "$folder")
  mkdir -p "$to/$target"
  for from in "$folder" "$here/crashes/$target" ${out:+"$out/$target/corpus"}; do
    if [ -d "$from" ]; then find "$from" -type f -exec cp -t "$to/$target" {} +; fi
  done
done
