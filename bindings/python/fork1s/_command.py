"""The command line, as pip installs it: hands over to the program in the package."""

import os
import sys
from pathlib import Path

import mujoco


def main() -> None:
    program = Path(__file__).parent / "bin" / "fork1s"
    # Where mujoco and fork1s are not installed side by side, the program's own search path leads nowhere.
    folder = str(Path(mujoco.__file__).parent)
    known = os.environ.get("LD_LIBRARY_PATH")
    environment = {**os.environ, "LD_LIBRARY_PATH": f"{folder}:{known}" if known else folder}
    os.execve(program, [sys.argv[0], *sys.argv[1:]], environment)
