#!/usr/bin/env python3
"""Lists words of src and include that are neither English, nor in the glossary, nor allowed; for who names things there.

    tools/words.py            # unknown words with their counts, and functions that start with a verb to avoid
    tools/words.py --check    # exit 1 if there are any; names file and line

Words have three letters or more and come from comments and from identifiers, split at underscores and capitals. Names after ".",
"->" and "::", names in capitals and those that begin as MuJoCo's, HDF5's and FMI's do are not read: ours are declared elsewhere. English is
Debian's wamerican and wbritish with the inflections that they list. The glossary is docs/glossary.md, whose terms are bold. Other
words stand in tools/words.txt. Exit code 77: the lists of English words are not installed.
"""

import re
import sys
from collections import defaultdict
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
ENGLISH = [Path("/usr/share/dict/american-english"), Path("/usr/share/dict/british-english")]
AVOIDED = ["Take", "Give", "Keep", "Leave", "Meet", "Bear", "Hear", "Feel", "Look", "Tell", "Settle", "Pay"]
# Strings, numbers, includes and names of libraries match without a group, and are dropped.
TOKEN = re.compile(
    r"//(?P<line>[^\n]*)|/\*(?P<block>.*?)\*/"
    r'|R"(?P<raw>\w*)\(.*?\)(?P=raw)"|"(?:\\.|[^"\\\n])*"' + r"|'(?:\\.|[^'\\\n])+'"
    r"|^\s*#[^\n]*|(?:\.|->|::)\s*~?[A-Za-z_]\w*|(?<!\w)\d[\w.']*|\b[A-Z][A-Z0-9_]+\b|\b(?:mj|H5|fmi[23])\w*"
    r"|(?P<name>[A-Za-z_]\w*)(?P<call>\()?",
    re.DOTALL | re.MULTILINE,
)
WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-z]+")
VERB = re.compile(rf"(?:{'|'.join(AVOIDED)})s?(?:[A-Z]\w*)?\Z|\w*Anew\Z")


def split(text: str) -> list[str]:
    """Words of three letters or more of an identifier or a comment, in lower case.

    >>> split("SolveContactRows"), split("max_iterations_2d"), split("kEuler")
    (['solve', 'contact', 'rows'], ['max', 'iterations'], ['euler'])
    >>> split("the LDLTFactor of MuJoCo's A_ref")
    ['the', 'ldlt', 'factor', 'mujoco', 'ref']
    """
    text = re.sub(r"\b's\b", "", text.replace("MuJoCo", "Mujoco"))
    return [word.lower() for word in WORD.findall(text) if len(word) > 2]


def read(source: str) -> tuple[list[tuple[int, str]], list[tuple[int, str]]]:
    """Words of comments and names in C++, and functions with a verb to avoid, each with its line.

    >>> read('int a_row = model->dof_num;  // the column\\nTakeRows(std::move(a), "num");')
    ([(1, 'int'), (1, 'row'), (1, 'model'), (1, 'the'), (1, 'column'), (2, 'take'), (2, 'rows'), (2, 'std')], [(2, 'TakeRows')])
    """
    found, verbs = [], []
    for match in TOKEN.finditer(source):
        text = match["line"] or match["block"] or match["name"] or ""
        line = 1 + source.count("\n", 0, match.start())
        found += [(line + n, word) for n, part in enumerate(text.split("\n")) for word in split(part)]
        if match["call"] and VERB.match(match["name"]):
            verbs.append((line, match["name"]))
    return found, verbs


def known() -> set[str]:
    """English words, terms of the glossary and allowed words."""
    glossary = re.findall(r"\*\*(.+?)\*\*", (ROOT / "docs" / "glossary.md").read_text(encoding="utf-8"))
    allowed = re.sub(r"#.*", "", (ROOT / "tools" / "words.txt").read_text(encoding="utf-8"))
    english = "\n".join(path.read_text(encoding="utf-8") for path in ENGLISH)
    return {word.lower() for word in re.findall(r"[A-Za-z]+", english + allowed + "\n".join(glossary))}


def main() -> int:
    missing = [str(path) for path in ENGLISH if not path.exists()]
    if missing:
        print(f"words: skipped: there is no {' and no '.join(missing)}; apt-get install wamerican wbritish")
        return 77
    vocabulary = known()
    places: dict[str, list[str]] = defaultdict(list)
    verbs: dict[str, str] = {}
    for folder in ("include", "src"):
        for path in sorted(p for p in (ROOT / folder).rglob("*") if p.suffix in {".cpp", ".hpp", ".h"}):
            found, functions = read(path.read_text(encoding="utf-8"))
            for line, word in found:
                if word not in vocabulary:
                    places[word].append(f"{path.relative_to(ROOT)}:{line}")
            for line, name in functions:
                verbs.setdefault(name, f"{path.relative_to(ROOT)}:{line}")
    if "--check" in sys.argv[1:]:
        for word, where in sorted(places.items()):
            print("\n".join(f"{place}: '{word}' is no known word" for place in where), file=sys.stderr)
        for name, place in sorted(verbs.items()):
            print(f"{place}: '{name}' starts with a verb to avoid", file=sys.stderr)
        if places:
            print(
                "words: use the field's word, or add it to tools/words.txt or docs/glossary.md",
                file=sys.stderr,
            )
        if verbs:
            print(
                "words: name a function by what it does: Compute, Update, Find, Store, ...", file=sys.stderr
            )
        return 1 if places or verbs else 0
    for word, where in sorted(places.items()):
        print(f"{len(where):6d}  {word}  {where[0]}")
    for name, place in sorted(verbs.items()):
        print(f"{place}: {name}")
    print(f"words: {len(places)} unknown words; {len(verbs)} names of functions start with a verb to avoid")
    return 0


if __name__ == "__main__":
    sys.exit(main())
