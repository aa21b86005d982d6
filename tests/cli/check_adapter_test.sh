#!/usr/bin/env bash
# scripts/ci/check_adapter.sh: what comes out of limits that hold, are missed, or cannot be judged. A stand-in for the command
# writes a summary, for a comparison takes long and has tests of its own.
set -euo pipefail
script=$(cd "$(dirname "$0")/../.." && pwd)/scripts/ci/check_adapter.sh
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
cat >tsdfpp <<'EOF'
#!/usr/bin/env bash
printf '%s\n' "$@" >arguments
cp result.json out/adapter/summary.json
EOF
chmod +x tsdfpp
good='{"adapters": [{"failure": null, "examined": {"share": 0.9, "undefined": {"value": null}, "objects": [{"rmse_m": 0.002}]}}]}'
failed='{"adapters": [{"failure": "mine ended with exit code 3"}]}'

# expect CODE RESULT LIMITS WORDS: the exit code, and words of what is printed.
expect() {
  echo "$2" >result.json
  printf '%b' "$3" >limits.txt
  local code=0
  TSDFPP=./tsdfpp bash "$script" mine.toml limits.txt scene.toml --until 8 >printed 2>&1 || code=$?
  if [ "$code" != "$1" ] || ! grep -q -- "$4" printed; then
    echo "limits '$3': exit code $code, expected $1; printed, expected '$4':"
    cat printed
    exit 1
  fi
}
expect 0 "$good" '# all\n\nshare 0.5 - # why\nobjects.0.rmse_m - 0.01\n' 'rmse_m = 0.002'
expect 1 "$good" 'share 0.95 -\nobjects.0.rmse_m - 0.01\n' 'share = 0.9, expected 0.95 to -: fails'
expect 1 "$good" 'nothing 0 -\nshare 0.95 -\n' 'fails'
expect 4 "$good" 'share 0.5 -\nnothing 0 -\n' 'not in the JSON'
expect 4 "$good" 'undefined 0 -\n' 'undefined'
expect 4 "$failed" 'share 0.5 -\n' 'mine ended with exit code 3'
expect 2 "$good" 'share - -\n' 'give MIN, MAX or both'
expect 2 "$good" '# none\n' 'holds no figure'
grep -qx -- scene.toml arguments && grep -qx -- mine.toml arguments && grep -qx -- 8 arguments
echo "check_adapter.sh: 8 cases as expected"
