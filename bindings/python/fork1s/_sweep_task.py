"""What a worker of a sweep does: a point's model, the metric, a row. Needs no pandas."""

from __future__ import annotations

import inspect
import json
import os
import pickle
import socket
import time
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import TYPE_CHECKING, Any, NamedTuple

from . import _core, _mujoco_objects
from ._errors import UnknownNameError, UsageError
from ._load import Changes, changed_again, joined, load, recipe_of

if TYPE_CHECKING:
    import mujoco

LOAD_OPTIONS = tuple(p.name for p in inspect.signature(load).parameters.values() if p.kind is p.KEYWORD_ONLY)


class Task(NamedTuple):
    """What all points share, as it is sent to workers."""

    model: Any
    metric: Callable[[_core.Model, dict[str, Any]], Any]
    contents: dict[str, str]
    """Digests of the two (_sweep_identity.py), so that a worker that lives on reads an edited model again."""


def packed(task: Task) -> bytes:
    """The task as bytes. Functions that have no name a worker could find them by need the package cloudpickle."""
    task = task._replace(model=_mujoco_objects.readable(task.model))
    try:
        # Functions of the caller's own program have a name there alone: cloudpickle takes their code along.
        import cloudpickle

        code: bytes = cloudpickle.dumps(task)
        return code
    except ModuleNotFoundError:
        pass
    try:
        return pickle.dumps(task)
    except (pickle.PicklingError, AttributeError, TypeError) as error:
        raise UsageError(
            f"the metric cannot be sent to another process ({error}): make it a function of a module, or "
            "pip install cloudpickle"
        ) from error


@lru_cache(maxsize=4)
def _unpacked(task: bytes) -> Task:
    unpacked: Task = pickle.loads(task)
    return unpacked


def answer(
    task: bytes, points: list[tuple[str, dict[str, Any]]], attempt: int = 0
) -> list[tuple[str, dict[str, Any]]]:
    """Rows of points, by their keys. Nothing that a point does raises from here."""
    return [(key, _row(task, point)) for key, point in points]


def _row(task: bytes, point: dict[str, Any]) -> dict[str, Any]:
    start = time.perf_counter()
    row: dict[str, Any] = {}
    error = None
    try:
        model, metric, _ = _unpacked(task)
        row = _columns(metric(_kept_model(task, model, point), dict(point)), point)
    except Exception as problem:
        error = f"{type(problem).__name__}: {problem}"
    return {
        **row,
        "error": error,
        "seconds": time.perf_counter() - start,
        "worker": f"{socket.gethostname()}:{os.getpid()}",
    }


_kept: dict[tuple[Any, ...], _core.Model] = {}


def _kept_model(task: bytes, model: Any, point: dict[str, Any]) -> _core.Model:
    """The model of a point, read again only where a parameter changes it."""
    names = point if callable(model) else [n for n in point if n in LOAD_OPTIONS or ":" in n]
    key = (hash(task), json.dumps({n: point[n] for n in names}, sort_keys=True))
    found = _kept.get(key)
    if found is None:
        found = model_at(model, point)
        while len(_kept) >= 8:
            del _kept[next(iter(_kept))]
        _kept[key] = found
    return found


def _columns(result: Any, point: dict[str, Any]) -> dict[str, Any]:
    if not isinstance(result, Mapping):
        result = {"metric": result}
    columns = {}
    for name, value in result.items():
        if hasattr(value, "item") and getattr(value, "size", 1) == 1:
            value = value.item()
        if name in point or name in ("error", "seconds", "worker"):
            raise UsageError(f"the metric returns '{name}', which is a column of the table already")
        if value is not None and not isinstance(value, (bool, int, float, str)):
            raise UsageError(
                f"the metric returns {type(value).__name__} as '{name}'; a column holds numbers or text"
            )
        columns[str(name)] = value
    return columns


def model_at(model: Any, point: Mapping[str, Any]) -> _core.Model:
    """The model of a point: options of load, fields of the file's elements and stiffnesses worked in."""
    options = {name: value for name, value in point.items() if name in LOAD_OPTIONS}
    fields = {
        name: value
        for name, value in point.items()
        if ":" in name and not name.startswith(("stiffness:", "factor:"))
    }
    changes: Changes = ()
    if callable(model):
        model, options = model(**point), {}
    if isinstance(model, _core.Model):
        if not options and not fields:
            return changed_again(model, _changes(point))
        source, before, changes = recipe_of(model)
        options = {**before, **options}
    else:
        source = model
    if fields:
        source = _with_fields(source, fields)
        options.pop("packages", None)
    loaded = load(source, **options)
    for kind, values in _changes(point):
        changes = joined(changes, kind, values)
    return changed_again(loaded, changes)


def _changes(point: Mapping[str, Any]) -> Changes:
    """Stiffnesses, then factors of a point."""
    found: Changes = ()
    for prefix, kind in (("stiffness:", "stiffness"), ("factor:", "factors")):
        values = {name[len(prefix) :]: value for name, value in point.items() if name.startswith(prefix)}
        if values:
            found = joined(found, kind, values)
    return found


def _with_fields(source: Any, fields: Mapping[str, Any]) -> mujoco.MjSpec:
    mujoco = _mujoco_objects.needed()
    if _mujoco_objects.is_spec(source):
        spec = source
    elif isinstance(source, str) and source.lstrip().startswith("<"):
        spec = mujoco.MjSpec.from_string(source)
    elif isinstance(source, (str, os.PathLike)):
        spec = mujoco.MjSpec.from_file(os.fspath(source))
    else:
        raise UsageError(
            "parameters 'KIND:NAME.FIELD' need a model that is a file or text, not a compiled one"
        )
    for name, value in fields.items():
        kind, _, rest = name.partition(":")
        element_name, _, field = rest.rpartition(".")
        find = getattr(spec, kind, None) if element_name and not kind.startswith("_") else None
        if not callable(find):
            raise UsageError(f"parameter '{name}': write KIND:NAME.FIELD, such as 'geom:cube.mass'")
        try:
            element = find(element_name)
        except Exception:
            element = None
        if element is None:
            raise UnknownNameError(f"parameter '{name}': the model has no {kind} '{element_name}'")
        if field.startswith("_") or not hasattr(element, field):
            raise UnknownNameError(f"parameter '{name}': a {kind} has no field '{field}'")
        before = getattr(element, field)
        try:
            if hasattr(before, "__setitem__") and not isinstance(value, (list, tuple, str)):
                before[0] = value  # of friction the sliding one, of a polynomial the linear one
            else:
                setattr(element, field, value)
        except TypeError as error:
            raise UsageError(
                f"parameter '{name}': {value!r} does not fit, which is now {before!r}"
            ) from error
    return spec
