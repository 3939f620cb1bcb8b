"""Types of the package as its users' checkers read them: the modules in Python and the stub of the compiled one."""

import subprocess
import sys
from pathlib import Path

import pytest

import fork1s

pytest.importorskip("mypy", reason="pip install mypy")


@pytest.fixture
def copied(tmp_path):
    """A copy of the package, since mypy tells no faults of what is installed."""
    package, copy = Path(fork1s.__file__).parent, tmp_path / "fork1s"
    copy.mkdir()
    for file in [*package.glob("*.py"), *package.glob("*.pyi"), package / "py.typed"]:
        (copy / file.name).write_bytes(file.read_bytes())


def test_the_package_passes_mypy_strict(scenes, copied, tmp_path):
    settings = scenes.parent / "pyproject.toml"
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "mypy",
            "--strict",
            "--config-file",
            str(settings),
            "--cache-dir",
            "cache",
            "-p",
            "fork1s",
        ],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, done.stdout + done.stderr


PROGRAM = """
import pickle

import fork1s

model = fork1s.load("model.xml")
sim: fork1s.Simulation = pickle.loads(pickle.dumps(fork1s.Simulation(model)))
low, high = fork1s.Batch.usual_ranges["mass"]
first: slice = sim.joints["left"]["qpos"]
count: int = sim.step().refreshes_by_cause["loop_gap"]["count"]
reveal_type(low)
wrong: int = sim.time
"""


def test_a_program_is_checked(copied, tmp_path):
    (tmp_path / "program.py").write_text(PROGRAM)
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "mypy",
            "--strict",
            "--cache-dir",
            "cache",
            "--follow-imports",
            "silent",
            "program.py",
        ],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=600,
    )
    lines = done.stdout.splitlines()
    assert 'note: Revealed type is "' in lines[0] and "float" in lines[0], done.stdout
    assert 'expression has type "float", variable has type "int"' in lines[1] and len(lines) == 3, done.stdout
