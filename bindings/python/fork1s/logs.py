"""Recordings as files of log viewers: MCAP for Foxglove and tools of ROS 2, and Rerun.

    fork1s.logs.export_mcap("run.h5", "run.mcap")
    fork1s.logs.export_rerun("run.h5", "run.rrd")
    python -m fork1s.logs run.h5 run.mcap

docs/logs.md lists what is written. Needs `pip install 'fork1s[logs]'`.
"""

from __future__ import annotations

import argparse
import os
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from ._core import NewFile
from ._errors import Error, FileError, NumericsError, UsageError
from ._log_source import Source

__all__ = ["Export", "export_mcap", "export_rerun", "main"]

# First bytes of a file; surrogates stand for bytes that are no text (PEP 383).
_MCAP_BEGIN = "\udc89MCAP0\r\n"
_RERUN_BEGIN = "RRF"  # then the version of the format
_USAGE, _REFUSED, _NUMERICS = 2, 3, 4  # exit codes, as of the command fork1s


@dataclass(frozen=True)
class Export:
    """What was written. `steps`: of the recording; `left_out`: sentences of what the file does not show."""

    steps: int
    left_out: tuple[str, ...]


def export_mcap(
    recording: str | os.PathLike[str], out: str | os.PathLike[str], *, force_scale: float | None = None
) -> Export:
    """Writes a recording as MCAP: transforms, shapes, joints, contacts, sensors, controls and step reports.

    The recording is read a stretch of steps after the other, whatever its length. The file takes its place once it is
    whole; another MCAP file there is replaced, a file of another kind is not.

    Args:
        recording: HDF5 file of `Simulation.record` or of `fork1s run --record`.
        force_scale: m of an arrow per N of a contact force; default: the weight of all bodies is as long as the model is
            wide at the start.

    Raises:
        FileError: a file cannot be read or written. FormatError: the recording is damaged. UsageError: `force_scale` is
        no number above 0, or both files are the same. ModuleNotFoundError: mcap or foxglove-schemas-protobuf is missing
        (`pip install 'fork1s[logs]'`).
    """
    try:
        from ._log_mcap import McapLog
    except ModuleNotFoundError as error:
        raise _missing("export_mcap", "mcap and foxglove-schemas-protobuf", error) from None

    def write(source: Source, path: str) -> int:
        with open(path, "wb") as stream:
            return McapLog(source, stream).write()

    return _export("export_mcap", recording, out, force_scale, ("an MCAP file", _MCAP_BEGIN), write)


def export_rerun(
    recording: str | os.PathLike[str], out: str | os.PathLike[str], *, force_scale: float | None = None
) -> Export:
    """Writes a recording as a file of Rerun (.rrd): poses, shapes, forces, joints, sensors, controls, step reports.

    Arguments, replacing and errors are those of `export_mcap`, but for the package: rerun-sdk.
    """
    try:
        from ._log_rerun import RerunLog
    except ModuleNotFoundError as error:
        raise _missing("export_rerun", "rerun-sdk", error) from None
    kind = ("a recording of Rerun", _RERUN_BEGIN)
    return _export(
        "export_rerun", recording, out, force_scale, kind, lambda source, path: RerunLog(source, path).write()
    )


def _missing(function: str, packages: str, error: ModuleNotFoundError) -> ModuleNotFoundError:
    if error.name is None or error.name.partition(".")[0] == "fork1s":
        return error
    return ModuleNotFoundError(
        f"{function} needs {packages} ({error.name} is missing): pip install 'fork1s[logs]'", name=error.name
    )


def _export(
    function: str,
    recording: str | os.PathLike[str],
    out: str | os.PathLike[str],
    force_scale: float | None,
    kind: tuple[str, str],
    write: Callable[[Source, str], int],
) -> Export:
    if force_scale is not None and not 0 < force_scale < float("inf"):
        raise UsageError(f"{function}: force_scale {force_scale} is no number of m/N above 0")
    recording, out = os.fspath(recording), os.fspath(out)
    source = Source(recording)
    if Path(out).exists() and Path(out).samefile(recording):
        raise UsageError(f"{out}: is the recording itself; give another name to write to")
    if force_scale is not None:
        source.force_scale = float(force_scale)
    file = NewFile(out, *kind)
    try:
        steps = write(source, file.part)
        file.keep()
    except OSError as error:
        if isinstance(error, Error):
            raise
        raise FileError(
            f"{out}: cannot be written ({error.strerror or error}); check the folder, its permissions and the disk's "
            "room"
        ) from None
    finally:
        file.drop()
    notes = list(source.left_out)
    if not source.reader.finished:
        notes.append(f"steps after {steps}: the recording was not finished, or goes on")
    return Export(steps, tuple(notes))


def main(arguments: list[str] | None = None) -> int:
    """The command `python -m fork1s.logs`. Returns its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m fork1s.logs", description="Writes a recording as a file of log viewers."
    )
    parser.add_argument("recording", help="HDF5 file of 'fork1s run --record'")
    parser.add_argument("out", help="FILE.mcap: for Foxglove and tools of ROS 2; FILE.rrd: for Rerun")
    parser.add_argument(
        "--force-scale",
        type=float,
        metavar="M_PER_N",
        help="length of an arrow per N of a contact force (default: the weight of all bodies is as long as the model "
        "is wide)",
    )
    given = parser.parse_args(arguments)
    exports = {".mcap": export_mcap, ".rrd": export_rerun}
    try:
        export = exports.get(Path(given.out).suffix)
        if export is None:
            raise UsageError(
                f"{given.out}: its ending names no format; known are {' and '.join(sorted(exports))}"
            )
        done = export(given.recording, given.out, force_scale=given.force_scale)
    except (Error, ModuleNotFoundError) as error:
        print(f"error: {error}", file=sys.stderr)
        if isinstance(error, UsageError):
            return _USAGE
        return _NUMERICS if isinstance(error, NumericsError) else _REFUSED
    for sentence in done.left_out:
        print(f"left out: {sentence}", file=sys.stderr)
    size = Path(given.out).stat().st_size * 1e-6
    print(f"wrote {done.steps} steps to {given.out} ({size:.2f} MB)")
    return 0


if __name__ == "__main__":
    sys.exit(main())
