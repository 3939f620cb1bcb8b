"""Pages that are made of the sources, of the program and of the notebooks, when mkdocs builds the site."""

import html
import os
import re
import subprocess
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


def _rows(text: str, heading: str) -> list[list[str]]:
    """[name, description] of each line of the sections of a --help text whose headings begin so."""
    sections = re.findall(rf"^{heading}[^\n]*:\n((?:  .*\n)+)", text, flags=re.MULTILINE)
    return [re.split(r"  +", line.strip(), maxsplit=1) for part in sections for line in part.splitlines()]


def _plain(text: str) -> str:
    """Markdown that shows the text as it is."""
    return re.sub(r"([\\`*_\[\]])", r"\\\1", html.escape(text, quote=False))


def _command_line() -> str:
    """Commands and options, from the program in the package."""
    package = os.environ.get("FORK1S_PACKAGE", ROOT / "build" / "release" / "bindings" / "python")
    program = Path(package) / "fork1s" / "bin" / "fork1s"

    def ask(*words: str) -> str:
        return subprocess.run([program, *words, "--help"], check=True, capture_output=True, text=True).stdout

    commands = _rows(ask(), "Subcommands")
    said: dict[str, dict[str, list[str]]] = {}  # option -> description -> commands
    for command, _ in commands:
        for option, text in _rows(ask(command), "Options"):
            said.setdefault(option, {}).setdefault(text, []).append(command)
    out = ["## Commands\n", *(f"- `{name}`: {_plain(text)}" for name, text in commands), "\n## Options\n"]
    for option, texts in sorted(said.items()):
        name = re.sub(r"\W*[{ ].*", "", option).split(",")[-1]
        out.append(f"### {name}\n")
        for text, users in texts.items():
            of = "every command" if len(users) == len(commands) else ", ".join(f"`{u}`" for u in users)
            out.append(f"- `{option}` of {of}: {_plain(text)}")
        out.append("")
    return "\n".join(out)


def on_page_markdown(markdown: str, page, **_) -> str:
    if page.file.src_uri.startswith("api_"):
        page.meta["search"] = {"boost": 0.3}  # pages that explain are found before the reference
    if not page.file.src_uri.startswith("notebooks/"):
        # Pages lead to notebooks, which is what there is in the repository; on the site to what became of them.
        markdown = re.sub(r"(\]\((?:\.\./)?notebooks/[\w-]+)\.ipynb", r"\1.md", markdown)
    if page.file.src_uri == "command_line.md":
        page.meta["search"] = {"boost": 1.3}  # a command as it is typed has words of many pages in it
        return markdown.replace("<!-- commands -->", _command_line())
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
