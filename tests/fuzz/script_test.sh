#!/usr/bin/env bash
# scripts/fuzz.sh and fuzz.py in a tree of their own, where what they build and ask are stand-ins: what is imported and
# recorded counts once and is not lost, finds fail, and what is no number or no folder is refused.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
tree=$folder/tree
mkdir -p "$tree/scripts" "$tree/tests/fuzz/corpus/toy" "$tree/build/fuzz" "$folder/bin"
cp "$here/../../scripts/fuzz.sh" "$here/../../scripts/fuzz.py" "$tree/scripts/"
cp "$here/run.sh" "$here/gather.sh" "$tree/tests/fuzz/"
echo seed >"$tree/tests/fuzz/corpus/toy/seed"
touch "$tree/toy.cc"

# stand_in FILE: a program of what is on stdin.
stand_in() {
  { echo '#!/usr/bin/env bash' && cat; } >"$1"
  chmod +x "$1"
}
stand_in "$tree/scripts/setup.sh" </dev/null
stand_in "$folder/bin/cmake" </dev/null
stand_in "$folder/bin/llvm-profdata-14" </dev/null
stand_in "$folder/bin/llvm-cov-14" <<EOF
echo '{"data": [{"files": [{"filename": "$tree/toy.cc", "summary": {"lines": {"covered": 1, "count": 2}}}]}]}'
EOF
lines_program() {
  stand_in "$tree/build/fuzz/tsdfpp_fuzz_lines" <<EOF
if [ "\$1" = --sources ]; then echo "toy toy.cc"; exit; fi
exit $1
EOF
}
lines_program 0
export PATH=$folder/bin:$PATH
export PYTHONDONTWRITEBYTECODE=1

fail() {
  echo "fuzz.sh $1" >&2
  cat "$folder/said" >&2
  exit 1
}
# expect RC OPTIONS...: how fuzz.sh ends, called from elsewhere.
expect() {
  local rc=0 expected=$1
  shift
  (cd "$folder" && bash tree/scripts/fuzz.sh "$@") >"$folder/said" 2>&1 || rc=$?
  if [ $rc != "$expected" ]; then fail "$*: exit status $rc, expected $expected"; fi
}
# recorded SECONDS FINDS: what the record says.
recorded() {
  local found
  found=$(/usr/bin/python3 -c 'import json, sys; toy = json.load(open(sys.argv[1]))["targets"]["toy"]
print(toy["seconds"], toy["finds"])' "$tree/results/fuzz.json")
  if [ "$found" != "$1 $2" ]; then fail "recorded $found seconds and finds, expected $1 $2"; fi
}

for minutes in x 1e 0.01 -1 . '' 1x; do
  expect 2 --minutes "$minutes"
  if ! grep -qF -- "--minutes '$minutes'" "$folder/said"; then fail "--minutes '$minutes': no word of it"; fi
done
mkdir "$folder/empty"
for none in /nonexistent empty; do
  expect 2 --import "$none"
  if ! grep -qF "$none': expected the folder" "$folder/said"; then fail "--import $none: no word of it"; fi
done
expect 0 --minutes 0
recorded 0 0

# Another machine's runs, named as seen from where the script is called; the same ones once more; and one more.
mkdir -p "$folder/left/toy/corpus" "$folder/left/toy/crashes"
echo new >"$folder/left/toy/corpus/new"
printf '100\t60\t3\t5\t7\t0\n200\t30\t3\t5\t7\t0\n' >"$folder/left/toy/runs.tsv"
expect 0 --import left
recorded 90 0
if [ ! -f "$tree/out/fuzz/toy/corpus/new" ]; then fail "--import left out an input"; fi
expect 0 --import left
recorded 90 0
printf '300\t5\t3\t5\t7\t0\n' >>"$folder/left/toy/runs.tsv"
expect 0 --import left
recorded 95 0

# An input that ends the program that counts lines: the runs are recorded when it is mended.
printf '400\t2\t3\t5\t7\t0\n' >>"$folder/left/toy/runs.tsv"
lines_program 1
expect 1 --import left
recorded 95 0
expect 1 --import left
lines_program 0
expect 0 --minutes 0
recorded 97 0
if [ -e "$tree/out/fuzz/toy/runs.tsv" ]; then fail "did not take what it recorded"; fi

# A find of another machine fails, and is recorded all the same.
echo find >"$folder/left/toy/crashes/crash-1"
printf '500\t1\t3\t5\t7\t1\n' >>"$folder/left/toy/runs.tsv"
expect 1 --import left
recorded 98 1
expect 1 --minutes 0
rm "$tree/out/fuzz/toy/crashes/crash-1"
expect 0 --minutes 0
