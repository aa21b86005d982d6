#!/usr/bin/env bash
# What tests/fuzz/run.sh writes down of a run, by how it ends: a run that was told to end (status 72) made no find, and is
# not followed by another; one that failed made one, and is followed by another while there is time; an input that took
# too long is one if it does so by itself as well. And that it begins with inputs: gather.sh copies all seeds, finds and
# corpora, and without any a run is refused.
set -euo pipefail
here=$(cd "$(dirname "$0")" && pwd)
run=$here/run.sh
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
mkdir -p "$folder/corpus/toy"
echo seed >"$folder/corpus/toy/seed"

# expect END ARTIFACT RUNS FINDS RC [AGAIN]: how the fuzzer ends, what find it leaves ("no": none), the lines of runs.tsv,
# those of finds, how run.sh ends; how the fuzzer ends with the find alone.
expect() {
  rm -rf "$folder/out"
  cat >"$folder/tsdfpp_fuzz" <<EOF
#!/usr/bin/env bash
case "\${!#}" in */crashes/?*) exit ${6:-1} ;; esac
(ulimit -t 1; while :; do :; done) 2>/dev/null || true  # a second of a core
if [ $2 != no ]; then touch "\$TO_CRASHES/$2-\$\$"; fi
echo '#2 DONE   cov: 5 ft: 7 corp: 1/4b'
echo 'stat::number_of_executed_units: 3'
$1
EOF
  chmod +x "$folder/tsdfpp_fuzz"
  local rc=0
  OUT=$folder/out FUZZ_HOME=$folder TO_CRASHES=$folder/out/toy/crashes bash "$run" --seconds 2 >"$folder/said" || rc=$?
  local runs finds
  runs=$(wc -l <"$folder/out/toy/runs.tsv")
  finds=$(awk '$6 == 1 && $3 == 3 && $4 == 5 && $5 == 7' "$folder/out/toy/runs.tsv" | wc -l)
  if [ "$runs $finds $rc" != "$3 $4 $5" ]; then
    echo "run.sh after $1: $runs runs, $finds finds, exit status $rc; expected $3, $4, $5" >&2
    exit 1
  fi
}
expect "exit 0" no 2 0 0
expect "exit 72" no 1 0 0
expect "exit 77" crash 2 2 1
expect "kill -ABRT \$\$" crash 2 2 1
expect "exit 70" timeout 2 2 1 70
expect "exit 70" timeout 2 0 0 0
expect "exit 0" slow-unit 2 0 1 70
expect "exit 0" slow-unit 2 0 0 0

rm "$folder/corpus/toy/seed"
rc=0
OUT=$folder/out FUZZ_HOME=$folder bash "$run" --seconds 2 2>"$folder/said" || rc=$?
if [ $rc != 2 ] || ! grep -q "no input to begin with in $folder/corpus/toy" "$folder/said"; then
  echo "run.sh without seeds: exit status $rc, '$(cat "$folder/said")'; expected 2 and a word" >&2
  exit 1
fi

# Names of seeds and of finds differ, so what is gathered of a target is as many files as both have.
mkdir -p "$folder/left/map/corpus"
echo new >"$folder/left/map/corpus/of-a-run"
bash "$here/gather.sh" "$folder/gathered" "$folder/left"
for seeds in "$here"/corpus/*/; do
  target=$(basename "$seeds")
  expected=$(find "$seeds" -type f | wc -l)
  if [ -d "$here/crashes/$target" ]; then expected=$((expected + $(find "$here/crashes/$target" -type f | wc -l))); fi
  if [ "$target" = map ]; then expected=$((expected + 1)); fi
  gathered=$(find "$folder/gathered/$target" -type f | wc -l)
  if [ "$gathered" != "$expected" ] || [ "$gathered" = 0 ]; then
    echo "gather.sh, $target: $gathered files, expected $expected" >&2
    exit 1
  fi
done
if [ ! -f "$folder/gathered/map/of-a-run" ]; then
  echo "gather.sh left out what a run had left" >&2
  exit 1
fi
