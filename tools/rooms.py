#!/usr/bin/env python3
"""Writes the rooms of the library and their arrows into docs/architecture.md.

    tools/rooms.py            # writes the table between its markers
    tools/rooms.py --check    # exit 1 where the page says otherwise than src/*/CMakeLists.txt

A room is a folder of src; the arrows are those that its CMakeLists.txt states (ROOMS ...), less those that
others imply. Lines are those of src and include. What a room is for stands in the page and is kept.
"""

import re
import sys
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PAGE = ROOT / "docs" / "architecture.md"
BEGIN, END = "<!-- rooms: tools/rooms.py -->\n", "<!-- end of rooms -->\n"


def arrows() -> dict[str, set[str]]:
    """Rooms that each room may use, as stated."""
    out = {}
    for path in sorted(ROOT.glob("src/*/CMakeLists.txt")):
        found = re.search(r"\bROOMS ([a-z ]+)", " ".join(path.read_text(encoding="utf-8").split()))
        out[path.parent.name] = set(found[1].split()) if found else set()
    return out


def below(room: str, direct: dict[str, set[str]]) -> set[str]:
    """All rooms that `room` reaches."""
    out = set(direct[room])
    for other in direct[room]:
        out |= below(other, direct)
    return out


def table(text: str) -> str:
    """The rooms from the innermost outward, with what the table in `text` says they are for."""
    direct = arrows()
    purpose = dict(re.findall(r"^\| `(\w+)` \| (.*?) \|", text, flags=re.MULTILINE))
    depth = {}

    def level(room: str) -> int:
        if room not in depth:
            depth[room] = 1 + max((level(r) for r in direct[room]), default=0)
        return depth[room]

    lines = ["| room | what it does | uses |", "|---|---|---|"]
    for room in sorted(direct, key=lambda r: (level(r), r)):
        implied = set().union(*(below(r, direct) for r in direct[room])) if direct[room] else set()
        uses = ", ".join(sorted(direct[room] - implied)) or "-"
        lines.append(f"| `{room}` | {purpose.get(room, '')} | {uses} |")
    missing = [room for room in direct if not purpose.get(room)]
    if missing:
        raise SystemExit(
            f"tools/rooms.py: docs/architecture.md does not say what {', '.join(missing)} does: fill in the table"
        )
    return "\n".join(lines) + "\n"


def main() -> int:
    text = PAGE.read_text(encoding="utf-8")
    begin, end = text.index(BEGIN) + len(BEGIN), text.index(END)
    new = text[:begin] + table(text[begin:end]) + text[end:]
    if "--check" in sys.argv[1:]:
        if new == text:
            return 0
        print(
            "docs/architecture.md: the table of rooms is old; write it again by: tools/rooms.py",
            file=sys.stderr,
        )
        return 1
    PAGE.write_text(new, encoding="utf-8")
    return 0


if __name__ == "__main__":
    sys.exit(main())
