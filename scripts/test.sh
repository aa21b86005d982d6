#!/usr/bin/env bash
# From a bare Debian 12 to all tests passed.
set -euo pipefail
cd "$(dirname "$0")/.."
bash scripts/setup.sh
bash scripts/build.sh
# One more than there are cores: some wait for what they have killed.
bash scripts/run_tests.sh build/release -j "$(($(nproc) + 1))"
