"""The command line, as pip installs it: hands over to the program in the package."""

import os
import sys
from pathlib import Path


def main() -> None:
    os.execv(Path(__file__).parent / "bin" / "fork1s", sys.argv)
