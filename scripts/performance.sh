#!/usr/bin/env bash
# Measures mapping beside Open3D and puts the tables into docs/performance.md and README.md; some 21 minutes on two cores, which
# must have nothing else to do. Usage: bash scripts/performance.sh [--to OUT] [OPTIONS OF tsdfpp_bench side-by-side];
# with --to the tables are in OUT alone, which is what a trial is for (--runs 1 --cases 1cm --frames 16).
set -euo pipefail
cd "$(dirname "$0")/.."
if [ "${1:-}" != "--to" ]; then exec /usr/bin/python3 scripts/pages.py make performance -- "$@"; fi
out=$2
shift 2
bash scripts/build.sh --target tsdfpp_bench
build/release/tsdfpp_bench side-by-side --out "$out" "$@"

# Which build of Open3D that was: its package, what runs its loops in parallel, and whether it was compiled for wide vectors.
library=$(ldd build/release/tsdfpp_bench | awk '/libOpen3D/ { print $3 }')
file=$(basename "$(readlink -f "$library")")
package=$(dpkg-query --search "*/$file" 2>/dev/null | cut -d : -f 1 | head -n 1) || package=""
if [ -n "$package" ]; then
  from="Debian's $package $(dpkg-query --show --showformat='${Version}' "$package"), as it comes"
else
  from="not of a Debian package"
fi
parallel=$(ldd "$library" | grep -oE 'lib(gomp|omp|tbb)\.so[.0-9]*' | sort -u | paste -s -d '&' | sed 's/&/ and /g')
wide=$(objdump --disassemble --no-show-raw-insn "$library" | grep -cE '%[yz]mm') || true
cat >> "$out/measured.md" <<END
Its library is \`$file\`, $from: parallel by $parallel; $wide of its instructions are AVX ones (objdump), so it computes in
$([ "$wide" = 0 ] && echo "SSE2 alone" || echo "AVX where it has them"). Ours picks the widest vectors that the processor has when it runs.
END
