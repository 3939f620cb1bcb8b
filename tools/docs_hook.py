"""Pages that are made of the sources and of the notebooks, when mkdocs builds the site."""

import os
import re
from pathlib import Path

from mkdocs.structure.files import File

ROOT = Path(__file__).resolve().parents[1]
ROOMS = {
    "sim": "Simulation",
    "importer": "Models from files",
    "mechanism": "Mechanisms: bodies, joints, loops",
    "reduction": "Reduction and compliance",
    "recovery": "Poses of all bodies",
    "record": "Recordings",
    "study": "Comparison with others",
    "geometry": "Shapes and meshes",
    "spatial": "Rigid motions",
    "stepping": "Time stepping of a mechanism",
    "world": "Steps of a world in contact",
    "diagnostics": "Error estimate and load factor",
    "constraints": "Contact laws and solver",
    "collision": "Contact detection",
    "reference": "Full-coordinate simulator",
    "base": "Errors and indices",
    "linalg": "Linear algebra",
}


def _body(text: str) -> str:
    """A header without what is the same in all of them."""
    text = re.sub(r"^#(pragma once|include).*\n", "", text, flags=re.MULTILINE)
    text = re.sub(r"^(namespace fork1s \{|\}  // namespace fork1s)\n", "", text, flags=re.MULTILINE)
    return re.sub(r"\n{3,}", "\n\n", text).strip()


def on_files(files, config, **_):
    """What tools/notebooks.py has made, as if it lay in docs/notebooks."""
    made = Path(os.environ.get("FORK1S_NOTEBOOKS", ROOT / "build" / "docs" / "notebooks"))
    for path in sorted(made.rglob("*")):
        if path.is_file():
            files.append(
                File.generated(
                    config, f"notebooks/{path.relative_to(made).as_posix()}", abs_src_path=str(path)
                )
            )
    return files


def on_page_markdown(markdown: str, page, **_) -> str:
    if page.file.src_uri.startswith("api_"):
        page.meta["search"] = {"boost": 0.3}  # pages that explain are found before the reference
    if not page.file.src_uri.startswith("notebooks/"):
        # Pages lead to notebooks, which is what there is in the repository; on the site to what became of them.
        markdown = re.sub(r"(\]\((?:\.\./)?notebooks/[\w-]+)\.ipynb", r"\1.md", markdown)
    if page.file.src_uri != "api_cpp.md":
        return markdown
    out = []
    for room, name in ROOMS.items():
        out.append(f"## {name}\n")
        for header in sorted((ROOT / "include" / "fork1s" / room).glob("*.hpp")):
            text = header.read_text(encoding="utf-8")
            says = re.match(r"((?://.*\n)+)", text)
            title = " ".join(line.lstrip("/ ").strip() for line in says[1].splitlines()) if says else ""
            code = _body(text[says.end() :] if says else text)
            out.append(f"### fork1s/{room}/{header.name}\n\n{title}\n\n```cpp\n{code}\n```\n")
    folders = {p.name for p in (ROOT / "include" / "fork1s").iterdir() if p.is_dir()}
    if folders != ROOMS.keys():
        raise ValueError(
            f"tools/docs_hook.py has other rooms than include/fork1s: {sorted(folders ^ ROOMS.keys())}"
        )
    return markdown.replace("<!-- headers -->", "\n".join(out))
