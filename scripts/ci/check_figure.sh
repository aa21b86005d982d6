#!/usr/bin/env bash
# check_figure.sh FIGURE MIN MAX < JSON: is the number at the path FIGURE (such as .completeness.rmse_m) within the limits?
# A limit that is "-" is none. Exit code 0: yes; 1: no; 2: wrong arguments; 4: the figure is missing or undefined.
set -euo pipefail
[ $# -eq 3 ] || { echo "usage: check_figure.sh FIGURE MIN MAX < JSON" >&2; exit 2; }
exec python3 -c '
import json, math, sys
path, low, high = sys.argv[1:]
try:
    low = None if low == "-" else float(low)
    high = None if high == "-" else float(high)
except ValueError:
    print("check_figure.sh: MIN and MAX are numbers or -", file=sys.stderr)
    sys.exit(2)
if low is None and high is None:
    print("check_figure.sh: give MIN, MAX or both", file=sys.stderr)
    sys.exit(2)
try:
    value = json.load(sys.stdin)
    for key in path.strip(".").split("."):
        value = value[int(key)] if isinstance(value, list) else value[key]
except (ValueError, KeyError, IndexError, TypeError) as error:
    print(f"{path}: not in the JSON ({type(error).__name__}: {error})", file=sys.stderr)
    sys.exit(4)
if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
    print(f"{path}: undefined: {value}", file=sys.stderr)
    sys.exit(4)
good = (low is None or value >= low) and (high is None or value <= high)
word = "holds" if good else "fails"
print(f"{path} = {value:g}, expected {sys.argv[2]} to {sys.argv[3]}: {word}")
sys.exit(0 if good else 1)
' "$1" "$2" "$3"
