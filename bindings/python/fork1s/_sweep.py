"""Many points of one question, on one machine or many, with nothing lost and nothing counted twice."""

from __future__ import annotations

import difflib
import itertools
import os
from collections.abc import Callable, Iterable, Mapping
from concurrent.futures import Executor
from pathlib import Path
from typing import TYPE_CHECKING, Any, Union

from . import _core
from ._errors import SweepError, UsageError
from ._load import Source
from ._sweep_identity import identity_of
from ._sweep_journal import Journal, key_of
from ._sweep_run import Progress, Sweeping, warn
from ._sweep_task import LOAD_OPTIONS, Task, packed

if TYPE_CHECKING:
    import pandas

Points = Union[Mapping[str, Iterable[Any]], Iterable[Mapping[str, Any]], "pandas.DataFrame"]
Metric = Callable[[_core.Model, dict[str, Any]], Any]


def sweep(
    model: Source | _core.Model | Callable[..., Any],
    parameters: Points,
    metric: Metric,
    executor: Executor | None = None,
    *,
    path: str | os.PathLike[str] | None = None,
    progress: bool | Callable[[int, int], None] = True,
    in_flight: int | None = None,
    chunk: int = 1,
) -> pandas.DataFrame:
    """Asks `metric` at every point of `parameters`: a table with a row for each, in their order.

    docs/sweeps.md explains it from the beginning.

    Args:
        model: what `load` takes, or a Model that it returned; or a function that is called with a point's values by
            name and returns one of these.
        parameters: a mapping from names to values, of which every combination is a point; or a point each: a sequence
            of mappings or a pandas frame. A name may be

            - an option of `load` ('stiffness_scale', 'modes', ...);
            - 'stiffness:JOINT', what holds a joint coordinate, N·m/rad or N/m (`Model.with_stiffness`);
            - 'factor:NAME', a factor of `Model.with_factors`: 'factor:mass:cube', 'factor:gravity';
            - 'KIND:NAME.FIELD', a field of an element of the MJCF file ('geom:cube.mass', 'joint:elbow.damping'), as
              `mujoco.MjSpec` has kinds and fields; a number sets the first entry of a field that has several;
            - any other, for `metric` and for a function as `model`.
        metric: called in another process with the Model of the point and the point's values. Returns a number, or a
            mapping from names of columns to numbers, text or truth values.
        executor: any concurrent.futures.Executor, such as Dask's `Client.get_executor()` or an
            `mpi4py.futures.MPIPoolExecutor`; it stays open. Default: a process for each core of this machine.
        path: a Parquet file that keeps the rows. Points that it has are not asked again: a sweep that was interrupted
            goes on where it stopped. Rows are safe as soon as they come, in a journal beside the file. Points that
            failed are asked again, and so are all where the model or the metric has been edited since (SweepWarning).
        progress: a bar on standard error (tqdm where it is installed, else a line), or a function of (done, total).
        in_flight: points handed out and not yet answered, at most; default: 8 tasks a process, 1000 of an executor given.
        chunk: points a task. More than one where a point takes a few ms only and a task of the executor 1 ms.

    Returns:
        A pandas frame: a column for each parameter, then for each result, then error, a sentence where the point
        failed and None else; seconds; worker, host and process. A point fails where its model or `metric` raises, or
        where it ends its process; the sweep goes on. A SweepWarning tells of the first failure as it comes, of the
        first five points if all of them failed, and of the number of failures at the end.

    Raises:
        SweepError: every point failed; its `table` has the rows, and `path` keeps them.
        UsageError: parameters that make no sense; a `path` of another sweep or in use; a metric that cannot be sent.
        FileError: `path` cannot be written. ModuleNotFoundError: pandas or pyarrow (`pip install 'fork1s[sweep]'`) is
        missing. concurrent.futures.BrokenExecutor: the executor given cannot go on; with a `path` no row is lost.
    """
    _need("pandas", "pyarrow")
    if chunk < 1 or (in_flight is not None and in_flight < 1):
        raise UsageError("chunk and in_flight are 1 or more")
    if isinstance(model, os.PathLike) or (isinstance(model, str) and not model.lstrip().startswith("<")):
        model = str(Path(model).absolute())  # workers may stand in another folder
    identity = identity_of(model, metric)
    task = Task(model, metric, identity.contents)
    points = _points(parameters, any_name=callable(model))
    with Journal(path, identity) as journal:
        if journal.outdated:
            warn(journal.outdated)
        waiting = [
            (key, point)
            for key, point in points.items()
            if key not in journal.rows or journal.rows[key].get("error") is not None
        ]
        with Progress(progress, len(points) - len(waiting), len(points)) as shown:
            if waiting:
                Sweeping(packed(task), waiting, executor, journal, shown, in_flight, chunk).run()
        table = journal.finish(points)
    failed = table["error"].notna()
    if failed.all():
        error = SweepError(
            f"sweep: all of {len(table)} points failed, the first with: {table['error'].iloc[0]}; mend the model, the metric "
            "or the parameters and call it again"
        )
        error.message, error.table = str(error), table
        raise error
    if failed.any():
        warn(
            f"sweep: {failed.sum()} of {len(table)} points failed; the column 'error' says why, and another call with the "
            "same path asks them again"
            if path is not None
            else f"sweep: {failed.sum()} of {len(table)} points failed; the column 'error' says why"
        )
    return table


def _need(*modules: str) -> None:
    missing = []
    for module in modules:
        try:
            __import__(module)
        except ModuleNotFoundError:
            missing.append(module)
    if missing:
        raise ModuleNotFoundError(
            f"fork1s.sweep needs {' and '.join(missing)}: pip install 'fork1s[sweep]'", name=missing[0]
        )


def _plain(value: Any, name: str) -> Any:
    """A value as JSON has it: numbers of numpy become Python's."""
    if hasattr(value, "tolist"):
        value = value.tolist()
    if value is None or isinstance(value, (bool, int, float, str)):
        return value
    if isinstance(value, os.PathLike):
        return os.fspath(value)
    if isinstance(value, (list, tuple)):
        return [_plain(v, name) for v in value]
    if isinstance(value, Mapping):
        return {str(k): _plain(v, name) for k, v in value.items()}
    raise UsageError(
        f"parameter '{name}': a value is a number, text, or a list or mapping of these, not {value!r}"
    )


def _rows(parameters: Points) -> Iterable[Mapping[str, Any]]:
    if hasattr(parameters, "to_dict") and hasattr(parameters, "columns"):
        records: list[dict[str, Any]] = parameters.to_dict("records")
        return records
    if not isinstance(parameters, Mapping):
        return parameters
    for name, values in parameters.items():
        if isinstance(values, (str, bytes)) or not isinstance(values, Iterable):
            raise UsageError(f"parameter '{name}': give a list of values, not {values!r}")
    return (dict(zip(parameters, row)) for row in itertools.product(*parameters.values()))


def _points(parameters: Points, any_name: bool) -> dict[str, dict[str, Any]]:
    points: dict[str, dict[str, Any]] = {}
    kinds: dict[str, type] = {}
    for number, row in enumerate(_rows(parameters)):
        point = {str(name): _plain(value, str(name)) for name, value in row.items()}
        for name, value in point.items():
            if name not in kinds and not any_name:
                _check_name(name)
            kind = float if type(value) is int else type(value)
            known = kinds.setdefault(name, kind)
            if type(None) in (kind, known):
                kinds[name] = known if kind is type(None) else kind
            elif kind is not known:
                raise UsageError(
                    f"parameter '{name}': values are of two kinds, {known.__name__} and {kind.__name__}"
                )
        key = key_of(point)
        if key in points:
            raise UsageError(
                f"point {number}, {point}, comes twice; where both are meant, tell them apart by a parameter, a seed say"
            )
        points[key] = point
    if not points:
        raise UsageError("parameters hold no point")
    for name in ("error", "seconds", "worker"):
        if name in kinds:
            raise UsageError(f"parameter '{name}': the table has a column of this name; choose another")
    return points


def _check_name(name: str) -> None:
    close = difflib.get_close_matches(name, LOAD_OPTIONS, n=1, cutoff=0.85)
    if close and name not in LOAD_OPTIONS:
        raise UsageError(f"parameter '{name}': did you mean '{close[0]}', an option of fork1s.load?")
