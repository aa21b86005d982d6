#!/usr/bin/env bash
# Fails where clang-format would change a tracked source.
set -euo pipefail
cd "$(dirname "$0")/.."
git ls-files -z '*.cc' '*.h' | xargs -0 -r clang-format --dry-run --Werror
echo "format: clean"
