"""Runs the notebooks of docs/ and makes pages of them, for tools/docs.sh, which calls this with its own Python.

    python tools/notebooks.py FOLDER      # NAME.md, NAME_files/*.png and *.html for every docs/notebooks/NAME.ipynb

They stand in the repository without outputs, which would be megabytes that change whenever anything does: the site has
them, of today's code. A cell that fails ends this with its message.
"""

import html
import re
import sys
import time
from pathlib import Path

import nbformat
from nbclient import NotebookClient
from nbclient.exceptions import CellExecutionError
from nbconvert import MarkdownExporter

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = ROOT / "docs" / "notebooks"
REPLAY = re.compile(r'<iframe srcdoc="(?P<page>[^"]*)"(?P<rest>.*)', re.DOTALL)


def read(path: Path) -> nbformat.NotebookNode:
    notebook = nbformat.read(path, as_version=4)
    nbformat.validate(notebook)
    for cell in notebook.cells:
        if cell.get("outputs") or cell.get("execution_count"):
            raise SystemExit(
                f"notebooks: {path.name} holds outputs; clear them (jupyter nbconvert --clear-output --inplace "
                f"{path.relative_to(ROOT)}), the site makes its own"
            )
    return notebook


def execute(notebook: nbformat.NotebookNode, path: Path) -> None:
    client = NotebookClient(notebook, timeout=120, resources={"metadata": {"path": str(path.parent)}})
    client.extra_arguments = [
        "--IPKernelApp.log_level=ERROR"
    ]  # else it says of each that this machine's own users hear it
    try:
        client.execute()
    except CellExecutionError as error:
        plain = re.sub(r"\x1b\[[0-9;]*m", "", str(error))
        raise SystemExit(f"notebooks: {path.name}: a cell failed\n{plain}") from None
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            if output.output_type == "stream" and output.name == "stderr":
                raise SystemExit(f"notebooks: {path.name} warns:\n{output.text}")


def replays_to_files(notebook: nbformat.NotebookNode, folder: Path) -> None:
    """A recording that plays is a page of its own beside the page, so that the page stays small."""
    for cell in notebook.cells:
        for output in cell.get("outputs", []):
            found = REPLAY.match(output.get("data", {}).get("text/html", ""))
            if not found:
                continue
            name = f"replay_{len(list(folder.glob('replay_*.html')))}.html"
            (folder / name).write_text(html.unescape(found["page"]), encoding="utf-8")
            output.data = {"text/html": f'<iframe src="{folder.name}/{name}" loading="lazy"{found["rest"]}'}


def main() -> None:
    out = Path(sys.argv[1])
    out.mkdir(parents=True, exist_ok=True)
    for path in sorted(NOTEBOOKS.glob("*.ipynb")):
        began = time.perf_counter()
        notebook = read(path)
        execute(notebook, path)
        files = out / f"{path.stem}_files"
        files.mkdir()
        replays_to_files(notebook, files)
        text, resources = MarkdownExporter().from_notebook_node(
            notebook, {"output_files_dir": files.name, "unique_key": path.stem}
        )
        for name, data in resources["outputs"].items():
            (out / name).write_bytes(data)
        title, rest = text.split("\n", 1)
        note = f"*[This page as a notebook]({path.name}), to run and to change.*"
        (out / f"{path.stem}.md").write_text(f"{title}\n\n{note}\n{rest}", encoding="utf-8")
        print(f"notebooks: {path.name}, {time.perf_counter() - began:.1f} s")


if __name__ == "__main__":
    main()
