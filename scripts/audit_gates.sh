#!/usr/bin/env bash
# Makes the audit table of docs/gates.md again.
set -euo pipefail
cd "$(dirname "$0")/.."
exec /usr/bin/python3 scripts/pages.py make gates-audit
