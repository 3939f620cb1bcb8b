"""The code of docs/python.md runs, from top to bottom as one program."""

import re
from pathlib import Path

import pytest

DOCS = Path(__file__).resolve().parents[2] / "docs"


def test_python_page(tmp_path, monkeypatch):
    import fork1s

    if not (Path(fork1s.__file__).parent / "scenes").exists():
        pytest.skip("the package has no scenes in a build folder")
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(r"```python\n(.*?)```", (DOCS / "python.md").read_text(), flags=re.DOTALL)
    assert len(blocks) >= 6
    exec(compile("\n".join(blocks), "docs/python.md", "exec"), {})
