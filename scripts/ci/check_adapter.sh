#!/usr/bin/env bash
# check_adapter.sh ADAPTER.toml LIMITS [SCENE] [OPTIONS OF compare]: maps SCENE (scenes/mini.toml) with the adapter's mapper and holds
# its figures to LIMITS: a line a figure, "FIGURE MIN MAX  # why", FIGURE as below .adapters.0.examined of summary.json.
# Leaves summary.json, pictures and the adapter's log in out/adapter. TSDFPP names the command where it is not built here.
# Exit code 0: all within; 1: one is not; 4: one is missing or undefined, as all are where the mapper fails.
set -euo pipefail
[ $# -ge 2 ] || { echo "usage: check_adapter.sh ADAPTER.toml LIMITS [SCENE] [OPTIONS OF compare]" >&2; exit 2; }
here=$(cd "$(dirname "$0")/../.." && pwd)
adapter=$1 limits=$2 scene=${3:-$here/scenes/mini.toml}
[ $# -le 3 ] && shift $# || shift 3
[ -r "$limits" ] || { echo "check_adapter.sh: there is no file $limits" >&2; exit 2; }
out=out/adapter
mkdir -p "$out"
"${TSDFPP:-$here/build/release/tsdfpp}" compare "$scene" --out "$out" --adapter "$adapter" --methods tsdf --profiles close \
  --every 1000000 "$@" >/dev/null
python3 -c '
import json, sys
failure = json.load(sys.stdin)["adapters"][0]["failure"]
if failure: print(failure)' <"$out/summary.json"
status=0
checked=0
while read -r figure low high; do
  code=0
  checked=$((checked + 1))
  bash "$here/scripts/ci/check_figure.sh" ".adapters.0.examined.$figure" "$low" "$high" <"$out/summary.json" || code=$?
  if [ "$code" = 2 ]; then exit 2; fi
  if [ "$code" = 1 ] || { [ "$code" != 0 ] && [ "$status" = 0 ]; }; then status=$code; fi
done < <(sed 's/#.*//' "$limits" | awk 'NF')
[ "$checked" -gt 0 ] || { echo "check_adapter.sh: $limits holds no figure" >&2; exit 2; }
exit "$status"
