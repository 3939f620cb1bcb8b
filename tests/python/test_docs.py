"""The code and the commands of the pages run."""

import re
import shlex
import subprocess
import sys
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


def test_the_program_of_the_readme(tmp_path):
    """As somebody copies it, in a folder of their own."""
    text = (DOCS.parent / "README.md").read_text()
    [block] = re.findall(
        r"\n((?:    .*\n)+)", text[text.index("## From Python") : text.index("[Sweeps and fits]")]
    )
    program = "\n".join(line[4:] for line in block.splitlines())
    import fork1s

    if not (Path(fork1s.__file__).parent / "scenes").exists():
        pytest.skip("the package has no scenes in a build folder")
    done = subprocess.run([sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0 and done.stderr == "" and "StepReport" in done.stdout, done.stderr


def run(command):
    """The program of the package beside this Python, in the folder of the repository."""
    program = Path(sys.executable).parent / "fork1s"
    if not program.exists():
        pytest.skip("the command is not installed beside this Python")
    return subprocess.run(
        [program, *shlex.split(command)[1:]], cwd=DOCS.parent, capture_output=True, text=True
    )


@pytest.mark.parametrize("page", ["legs_and_urdf.md", "vehicles.md"])
def test_commands_of_pages(page):
    commands = re.findall(
        r"^    (fork1s (?:inspect|run|reduce|statics) scenes/.*)$",
        (DOCS / page).read_text(),
        flags=re.MULTILINE,
    )
    assert commands
    for command in commands:
        done = run(re.sub(r"--time [0-9.]+", "--time 0.2", command))
        assert done.returncode == 0, f"{command}: {done.stderr}"


def test_the_error_figure_is_the_one_that_is_shown():
    [block] = re.findall(r"```console\n\$ (.*?)```", (DOCS / "error_figure.md").read_text(), flags=re.DOTALL)
    command, *shown = block.splitlines()
    printed = run(command).stdout.splitlines()
    for line in shown:
        assert line == "..." or line in printed, line


def test_the_example_in_cpp_is_the_one_that_is_shown():
    """The pages show a file that a test builds against the installed library, the README line by line."""
    assert '--8<-- "first_steps.cpp"' in (DOCS / "cpp.md").read_text()
    example = (DOCS.parent / "examples" / "first_steps.cpp").read_text()
    readme = (DOCS.parent / "README.md").read_text()
    assert all(line.strip() in readme for line in example.splitlines() if line.startswith("  "))
