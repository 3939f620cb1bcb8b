#!/usr/bin/env python3
"""Counts the tests that logs of ctest, GoogleTest, pytest and Vitest report as skipped, and prints their reasons.

    tools/skipped.py LOG...

Programs that ctest skips as a whole print a line with "skipped: REASON" or "skipped, REASON". A test that several logs name counts once in
each.
"""

import re
import sys
from collections import Counter
from pathlib import Path

# The reason stands between the place of GTEST_SKIP and the end of the test.
GOOGLE_TEST = re.compile(
    r"^\S+:\d+: Skipped\n(.*?)\n+\[  SKIPPED \] \S+ \(\d+ ms\)$", re.MULTILINE | re.DOTALL
)
PYTEST = re.compile(r"^SKIPPED \[(\d+)\] \S+?: (.*)$", re.MULTILINE)
VITEST = re.compile(r"^ *\S+ (\S+) \(\d+ tests? \| (\d+) skipped\)", re.MULTILINE)
PROGRAM = re.compile(r"^(?:\w+: )?skipped[:,] (.*)$", re.MULTILINE)


def reasons(log: str) -> Counter[str]:
    """Tests skipped in the text of a log, by reason.

    >>> google_test = "a.cpp:7: Skipped\\nno\\nvalgrind\\n\\n[  SKIPPED ] Cost.Counts (0 ms)\\n"
    >>> reasons("[ RUN      ] Cost.Counts\\n" + google_test + google_test)
    Counter({'no valgrind': 2})
    >>> reasons("a.cpp:7: Skipped\\n\\n[  SKIPPED ] A.B (0 ms)\\n[       OK ] A.C (1 ms)\\n[  SKIPPED ] A.B\\n")
    Counter({'no reason is given': 1})
    >>> reasons("SKIPPED [3] tests/python/test_show.py:19: no page: 'x'\\n1 passed, 3 skipped in 1.0s\\n")
    Counter({"no page: 'x'": 3})
    >>> reasons(" \\x1b[32m✓\\x1b[39m test/frames.test.ts (2 tests | 1 skipped) 6ms\\n")
    Counter({'no reason is given (test/frames.test.ts)': 1})
    >>> reasons("translate: skipped, there is no spirv-val\\n")
    Counter({'there is no spirv-val': 1})
    """
    log = re.sub(r"\x1b\[[0-9;]*m", "", log)
    found: Counter[str] = Counter()
    for reason in GOOGLE_TEST.findall(log):
        found[" ".join(reason.split()) or "no reason is given"] += 1
    for count, reason in PYTEST.findall(log):
        found[reason] += int(count)
    for file, count in VITEST.findall(log):
        found[f"no reason is given ({file})"] += int(count)
    for reason in PROGRAM.findall(log):
        found[reason] += 1
    return found


def main() -> None:
    found: Counter[str] = Counter()
    for path in sys.argv[1:]:
        found += reasons(Path(path).read_text(errors="replace"))
    print(f"check: {found.total()} tests were skipped{':' if found else ''}")
    for reason, count in found.most_common():
        print(f"  {count:4d}  {reason}")


if __name__ == "__main__":
    main()
