"""Rows of a sweep, safe from the moment when they are there.

A Parquet file cannot be added to, so rows go to a journal beside it, a line of JSON each, which reaches the system with
every flush and outlives this process. At the end, and when a sweep is taken up again, the journal goes into the file.
Every row stands under the key of its point, so one that comes twice counts once.

Both begin with the names and the contents of the model and the metric (_sweep_identity.py). Rows of other names belong to
another sweep, and the file is refused. Rows of other contents are outdated, and are dropped.
"""

from __future__ import annotations

import fcntl
import hashlib
import json
import os
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ._errors import FileError, UsageError
from ._sweep_identity import Identity

if TYPE_CHECKING:
    import pandas

_POINT, _KEY, _SWEEP = "fork1s_points", "fork1s_key", b"fork1s_sweep"
Row = dict[str, Any]


def key_of(point: dict[str, Any]) -> str:
    """Names and values of a point as 32 hexadecimal digits, whatever their order."""
    return hashlib.sha256(json.dumps(point, sort_keys=True).encode()).hexdigest()[:32]


class Journal:
    """Rows by key. `with` holds the file against other sweeps; `rows` has those that were there before and still hold."""

    def __init__(self, path: str | os.PathLike[str] | None, sweep: Identity) -> None:
        self._path = None if path is None else Path(path).absolute()
        self._sweep = sweep
        self._lines: Any = None
        self.rows: dict[str, Row] = {}
        self.outdated = ""
        """A sentence where rows were dropped since the model or the metric has been edited."""
        self._has_table = False  # whether rows of the file count
        self._points: dict[str, Row] = {}  # of rows that the journal has and the file has not

    @property
    def _journal(self) -> Path:
        assert self._path is not None
        return self._path.with_name(self._path.name + ".journal")

    def __enter__(self) -> Journal:
        if self._path is None:
            return self
        if not self._path.parent.is_dir():
            raise FileError(f"{self._path}: its folder does not exist; make it first")
        try:
            self._lines = open(self._journal, "a+", encoding="ascii", errors="replace")
        except OSError as error:
            raise FileError(f"{self._journal}: {error.strerror}") from error
        try:
            fcntl.flock(self._lines, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # Whoever held it may have finished and removed it since it was opened.
            if not self._journal.exists() or not os.path.samestat(
                os.fstat(self._lines.fileno()), self._journal.stat()
            ):
                raise BlockingIOError
        except BlockingIOError:
            self._lines.close()
            raise UsageError(f"{self._path}: another sweep writes to it") from None
        try:
            self._read_table()
            self._read_journal()
        except BaseException:
            self.__exit__()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        if self._lines is not None:
            if self._journal.exists() and self._journal.stat().st_size == 0:
                self._journal.unlink()
            self._lines.close()
            self._lines = None

    def _read_table(self) -> None:
        import pyarrow.parquet

        assert self._path is not None
        if not self._path.exists():
            return
        try:
            table = pyarrow.parquet.read_table(self._path)
        except (OSError, pyarrow.ArrowInvalid) as error:
            raise UsageError(f"{self._path}: is no Parquet file; choose another path ({error})") from error
        known = (table.schema.metadata or {}).get(_SWEEP)
        if known is None:
            raise UsageError(f"{self._path}: was not written by a sweep; choose another path")
        if not self._holds(known.decode(), table.num_rows):
            return
        self._has_table = True
        for row in table.to_pylist():
            point = set(json.loads(row.pop(_POINT)))
            key = row.pop(_KEY)
            self.rows[key] = {
                n: v for n, v in row.items() if n not in point and not (v is None and n != "error")
            }

    def _holds(self, known: str, count: int) -> bool:
        """Whether rows under a header are of the model and the metric as they are now. Refuses those of another sweep."""
        try:
            names, contents = json.loads(known)
            changed = sorted(
                name for name, content in self._sweep.contents.items() if contents.get(name) != content
            )
        except (ValueError, TypeError, AttributeError):
            raise UsageError(
                f"{self._path}: was written by a version of fork1s that did not record what its rows were computed from; "
                "choose another path, or remove it with its journal"
            ) from None
        if names != self._sweep.names:
            raise UsageError(
                f"{self._path}: holds a sweep of another model or metric ({names['model']}, {names['metric']}; now "
                f"{self._sweep.names['model']}, {self._sweep.names['metric']}); choose another path, or remove it with its "
                "journal"
            )
        if changed and count:
            named = [f"the {name}" for name in changed]
            what = " and ".join(filter(None, [", ".join(named[:-1]), named[-1]]))
            self.outdated = (
                f"{self._path}: {what} {'have' if len(named) > 1 else 'has'} changed since its {count} rows were computed; "
                "they are dropped and computed again"
            )
        return not changed

    def _read_journal(self) -> None:
        self._lines.seek(0)
        whole, known = 0, ""
        rows: dict[str, tuple[Row, Row]] = {}
        for line in iter(self._lines.readline, ""):
            if not line.endswith("\n"):
                break  # the writer was killed in the middle of it
            whole = self._lines.tell()
            try:
                entry = json.loads(line)
                if "sweep" in entry:
                    known = entry["sweep"]
                else:
                    rows[entry["key"]] = entry["point"], entry["row"]
            except (ValueError, KeyError, TypeError):
                continue  # a line that no disk gives back as it was: its point is asked again
        if known and self._holds(known, len(rows)):
            for key, (point, row) in rows.items():
                self._points[key], self.rows[key] = point, row
            self._lines.seek(whole)
            self._lines.truncate()
        else:
            self._lines.seek(0)
            self._lines.truncate()
            self._write({"sweep": self._header})

    @property
    def _header(self) -> str:
        return json.dumps(list(self._sweep))

    def _write(self, entry: dict[str, Any]) -> None:
        self._lines.write(json.dumps(entry) + "\n")

    def add(self, key: str, point: Row, row: Row) -> None:
        """The row of a finished point. `flush` hands it to the system."""
        self.rows[key] = row
        if self._lines is not None:
            self._points[key] = point
            self._write({"key": key, "point": point, "row": row})

    def flush(self) -> None:
        if self._lines is None:
            return
        try:
            self._lines.flush()
        except OSError as error:
            raise FileError(f"{self._journal}: {error.strerror}; what it has stays") from error

    def finish(self, points: dict[str, Row]) -> pandas.DataFrame:
        """The table of these points in their order; the file gets it, with the rows of other points that it had."""
        if self._path is not None:
            self._write_table(points)
        return self._frame(points)

    def _frame(self, points: dict[str, Row]) -> pandas.DataFrame:
        import pandas

        results = pandas.DataFrame([self.rows[k] for k in points])
        last = ["error", "seconds", "worker"]
        results = results[[c for c in results if c not in last] + last]
        return pandas.concat([pandas.DataFrame(list(points.values())), results], axis=1)

    def _write_table(self, points: dict[str, Row]) -> None:
        import pandas
        import pyarrow
        import pyarrow.parquet

        points = {**points, **{k: p for k, p in self._points.items() if k not in points}}
        kept = self._frame(points)
        kept[_POINT] = [json.dumps(sorted(p)) for p in points.values()]
        kept[_KEY] = list(points)
        if self._has_table:
            before = pyarrow.parquet.read_table(self._path).to_pandas()
            before = before[~before[_KEY].isin(set(points))]
            if len(before):
                kept = pandas.concat([kept, before], ignore_index=True)
        assert self._path is not None
        beside = self._path.with_name(f".{self._path.name}.{os.getpid()}")
        try:
            written = pyarrow.Table.from_pandas(kept, preserve_index=False)
            written = written.replace_schema_metadata(
                {**(written.schema.metadata or {}), _SWEEP: self._header.encode()}
            )
            pyarrow.parquet.write_table(written, beside)
            os.replace(beside, self._path)
        except (pyarrow.ArrowInvalid, pyarrow.ArrowTypeError) as error:
            beside.unlink(missing_ok=True)
            raise UsageError(
                f"{self._path}: a column holds numbers and text, which Parquet has no room for; the rows stay in "
                f"{self._journal.name} ({error})"
            ) from error
        except OSError as error:
            beside.unlink(missing_ok=True)
            raise FileError(f"{self._path}: {error}; the rows stay in {self._journal.name}") from error
        self._lines.seek(0)
        self._lines.truncate()
