"""Says in one line how many tests were skipped and what they need; nothing where none was.

    python3 scripts/skipped_tests.py REPORT SHARED

REPORT is what ctest --output-junit wrote. What a test needs is in its line "needs ..." (tests/needs.h).
Exit code 1, with the tests' names, where CI=true is in the environment and the folder SHARED exists.
"""
import collections
import os
import re
import sys
import xml.etree.ElementTree


def main(report, shared):
    cases = list(xml.etree.ElementTree.parse(report).iter("testcase"))
    needs = {}
    for case in cases:
        if case.find("skipped") is None:
            continue
        found = re.search(r"^needs (.+)$", case.findtext("system-out") or "", re.MULTILINE)
        needs[case.get("name")] = found[1].strip() if found else "something that they do not name"
    if not needs:
        return 0
    counts = sorted(collections.Counter(needs.values()).items(), key=lambda c: (-c[1], c[0]))
    parts = [f"{count} {'needs' if count == 1 else 'need'} {what}" for what, count in counts]
    print(f"skipped: {len(needs)} of {len(cases)} tests; {', '.join(parts)}")
    if os.environ.get("CI") != "true" or not os.path.isdir(shared):
        return 0
    print(f"skipped tests fail, as CI=true and {shared} is there: {', '.join(sorted(needs))}", file=sys.stderr)
    return 1


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("usage: python3 scripts/skipped_tests.py REPORT SHARED")
    sys.exit(main(*sys.argv[1:]))
