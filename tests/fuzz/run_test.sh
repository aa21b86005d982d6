#!/usr/bin/env bash
# What tests/fuzz/run.sh writes down of a run, by how it ends: a run that was told to end (status 72) made no find, and is
# not followed by another; one that failed made one, and is followed by another while there is time.
set -euo pipefail
run=$(cd "$(dirname "$0")" && pwd)/run.sh
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
mkdir -p "$folder/corpus/toy"
echo seed >"$folder/corpus/toy/seed"

# expect STATUS ARTIFACT RUNS FINDS RC: how the fuzzer ends, whether it leaves a find, the lines of runs.tsv, those of
# finds, how run.sh ends.
expect() {
  rm -rf "$folder/out"
  cat >"$folder/tsdfpp_fuzz" <<EOF
#!/usr/bin/env bash
(ulimit -t 1; while :; do :; done) 2>/dev/null || true  # a second of a core
if [ $2 = yes ]; then touch "\$TO_CRASHES/crash-\$\$"; fi
echo '#2 DONE   cov: 5 ft: 7 corp: 1/4b'
echo 'stat::number_of_executed_units: 3'
exit $1
EOF
  chmod +x "$folder/tsdfpp_fuzz"
  local rc=0
  OUT=$folder/out FUZZ_HOME=$folder TO_CRASHES=$folder/out/toy/crashes bash "$run" --seconds 2 >"$folder/said" || rc=$?
  local runs finds
  runs=$(wc -l <"$folder/out/toy/runs.tsv")
  finds=$(awk '$6 == 1 && $3 == 3 && $4 == 5 && $5 == 7' "$folder/out/toy/runs.tsv" | wc -l)
  if [ "$runs $finds $rc" != "$3 $4 $5" ]; then
    echo "run.sh after status $1: $runs runs, $finds finds, exit status $rc; expected $3, $4, $5" >&2
    exit 1
  fi
}
expect 0 no 2 0 0
expect 72 no 1 0 0
expect 77 yes 2 2 1
