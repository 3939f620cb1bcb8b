#!/usr/bin/env python3
"""Holds include/ to what users include: prints its headers, and exits with 1 where one

- is reached from none of those that docs/api_cpp.md names, or, in C, is not named by docs/c.md,
- or includes what is not installed.
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
INCLUDE = ROOT / "include"


def main() -> int:
    failed = []
    named = re.findall(r"fork1s/[\w/]+\.hpp", (ROOT / "docs" / "api_cpp.md").read_text(encoding="utf-8"))
    named += re.findall(r"fork1s/[\w/]+\.h\b", (ROOT / "docs" / "c.md").read_text(encoding="utf-8"))
    reached, waiting = set(), list(named)
    while waiting:
        header = waiting.pop()
        if header in reached:
            continue
        reached.add(header)
        if not (INCLUDE / header).is_file():
            failed.append(f"{header} is named or included by public headers and is not in include/")
            continue
        text = (INCLUDE / header).read_text(encoding="utf-8")
        failed += [
            f"{header} includes {inner!r}, which is not installed"
            for inner in re.findall(r'#include "(.*)"', text)
        ]
        waiting += re.findall(r"#include <(fork1s/.*)>", text)
    public = {path.relative_to(INCLUDE).as_posix() for path in INCLUDE.rglob("*") if path.is_file()}
    failed += [
        f"{header} is reached from no header that docs/api_cpp.md or docs/c.md names: move it to src/, or name it there"
        for header in sorted(public - reached)
    ]
    if failed:
        print("\n".join("public_headers: " + line for line in failed), file=sys.stderr)
        return 1
    print("\n".join(sorted(public)))
    return 0


if __name__ == "__main__":
    sys.exit(main())
