"""Digests of the model and the metric of a sweep, by which its file recognizes rows of an edited one.

A model counts by the content of its files: the file itself, what it includes, its meshes, textures and height fields. A
function counts by its bytecode and constants, its defaults, the values of its closure and of the globals that it reads,
and in the same way by the functions, classes and modules of the user that these refer to. Installed packages and the
standard library count by name. The digests are the same in every process of one version of Python.
"""

from __future__ import annotations

import dis
import functools
import hashlib
import importlib
import os
import pickle
import site
import sys
import sysconfig
import types
import xml.etree.ElementTree as ElementTree
from collections.abc import Mapping
from pathlib import Path
from typing import Any, NamedTuple

from . import _core, _mujoco_objects
from ._load import recipe_of


class Identity(NamedTuple):
    """Names and contents of the model and the metric. Another name is another sweep, another content an edited one."""

    names: dict[str, str]
    contents: dict[str, str]


def identity_of(model: Any, metric: Any) -> Identity:
    """Of a sweep. Reads the model's files as they are now."""
    return Identity(
        {"model": _model_name(model), "metric": _name(metric)},
        {
            "model": _digest(model, as_model=True),
            "metric": _digest(metric),
            "version of fork1s": _core.version,
        },
    )


def _name(value: Any) -> str:
    return getattr(value, "__qualname__", type(value).__qualname__)


def _is_text(source: Any) -> bool:
    return isinstance(source, str) and source.lstrip().startswith("<")


def _model_name(model: Any) -> str:
    source = recipe_of(model)[0] if isinstance(model, _core.Model) else model
    if _is_text(source):
        return "text"
    return Path(source).name if isinstance(source, (str, os.PathLike)) else _name(source)


def _digest(value: Any, as_model: bool = False) -> str:
    walk = _Walk()
    if as_model:
        walk.add_model(value)
    else:
        walk.add(value)
    return walk.digest.hexdigest()


# Members of every class that say nothing of what it computes.
_NOT_OF_A_CLASS = (
    "__dict__",
    "__weakref__",
    "__doc__",
    "__module__",
    "__annotations__",
    "__firstlineno__",
    "__static_attributes__",
)


class _Walk:
    """Hashes a value and all that it refers to. An object that comes again is hashed as a reference to the first."""

    def __init__(self) -> None:
        self.digest = hashlib.sha256()
        self._seen: dict[int, int] = {}
        self._alive: list[Any] = []  # so that no id is used again
        self._members: set[tuple[int, frozenset[str]]] = (
            set()
        )  # modules and the names read of them, which are hashed
        self._files_of_paths = False

    def _put(self, kind: str, content: bytes | str = b"") -> None:
        content = content.encode(errors="surrogatepass") if isinstance(content, str) else content
        self.digest.update(f"{kind}:{len(content)}:".encode())
        self.digest.update(content)

    def add_model(self, model: Any) -> None:
        if isinstance(model, _core.Model):
            self._add_recipe(model)
        elif isinstance(model, (str, os.PathLike)):
            self._add_source(model, {})
        else:
            # A function that opens a file with a fixed name has that name among its values.
            self._files_of_paths = callable(model)
            self.add(model)

    def _add_recipe(self, model: _core.Model) -> None:
        source, options, changes = recipe_of(model)
        if isinstance(source, (str, os.PathLike)):
            self._add_source(source, options.get("packages") or {})
        else:
            self.add(source)
        self.add([options, changes])

    def _add_source(self, source: Any, packages: Mapping[str, Any]) -> None:
        if _is_text(source):
            source = _mujoco_objects.without_stored_folders(source)
            self._put("text", source)
            files = _files_named(source.encode(errors="surrogatepass"), Path.cwd(), packages)
        else:
            files = {Path(source).absolute()} | _files_below(Path(source).absolute(), packages)
        # Where a folder of models lies does not matter, only what is in it.
        contents = sorted(
            (file.name, hashlib.sha256(file.read_bytes()).digest()) for file in files if file.is_file()
        )
        for name, content in contents:
            self._put("file", name)
            self._put("content", content)

    def add(self, value: Any) -> None:
        if (
            value is None
            or value is Ellipsis
            or value is NotImplemented
            or isinstance(value, (bool, int, float, complex))
        ):
            self._put(type(value).__name__, repr(value))
        elif isinstance(value, (str, bytes)):
            self._put(type(value).__name__, value)
            self._add_file(value)
        elif isinstance(value, os.PathLike):
            self._put("path", os.fspath(value))
            self._add_file(value)
        elif id(value) in self._seen:
            self._put("again", str(self._seen[id(value)]))
        else:
            self._seen[id(value)] = len(self._seen)
            self._alive.append(value)
            self._add_object(value)

    def _add_file(self, value: Any) -> None:
        if self._files_of_paths and not _is_text(value) and not isinstance(value, bytes):
            try:
                is_file = Path(value).is_file()
            except (OSError, ValueError):  # a text that is no path
                return
            if is_file:
                self._add_source(value, {})

    def _add_object(self, value: Any) -> None:
        if isinstance(value, (list, tuple)):
            self._put(type(value).__name__, str(len(value)))
            for item in value:
                self.add(item)
        elif isinstance(value, (dict, types.MappingProxyType)):
            self._put("mapping", str(len(value)))
            for key in sorted(value, key=_digest):
                self.add(key)
                self.add(value[key])
        elif isinstance(value, (set, frozenset)):
            self._put("set", ",".join(sorted(map(_digest, value))))
        elif isinstance(value, types.CodeType):
            self._add_code(value, None)
        elif isinstance(value, types.FunctionType):
            self._add_function(value)
        elif isinstance(value, types.MethodType):
            self._put("method")
            self.add(value.__func__)
            self.add(value.__self__)
        elif isinstance(value, functools.partial):
            self._put("partial")
            self.add([value.func, value.args, value.keywords])
        elif isinstance(value, (classmethod, staticmethod)):
            self._put("wrapper", type(value).__name__)
            self.add(value.__func__)
        elif isinstance(value, property):
            self._put("property")
            self.add([value.fget, value.fset, value.fdel])
        elif isinstance(value, types.ModuleType):
            self._put("module", value.__name__)
        elif isinstance(value, type):
            self._add_class(value)
        elif isinstance(value, _core.Model):
            self._put("model")
            self._add_recipe(value)
        elif _mujoco_objects.is_spec(value):
            self._put("MjSpec", pickle.dumps(value.compile()))
        elif _mujoco_objects.is_model(value):
            self._put("MjModel", pickle.dumps(value))
        elif hasattr(value, "tobytes") and hasattr(value, "dtype"):
            self._put("array", f"{value.dtype} {value.shape}")
            if value.dtype.hasobject:
                self.add(value.tolist())
            else:
                self._put("values", value.tobytes())
        elif callable(value) and hasattr(value, "__wrapped__"):  # functools.lru_cache
            self._put("wrapper", type(value).__name__)
            self.add(value.__wrapped__)
        elif isinstance(value, types.BuiltinFunctionType):
            self._put("builtin", f"{value.__module__}.{value.__qualname__}")
        else:
            self._add_instance(value)

    def _add_function(self, function: types.FunctionType) -> None:
        installed = _is_installed(function.__module__)
        if installed:
            self._put("function", f"{function.__module__}.{function.__qualname__}")
        else:
            self._put("function")
            self._add_code(function.__code__, function.__doc__)
        self.add([function.__defaults__, function.__kwdefaults__])
        for cell in function.__closure__ or ():
            try:
                self.add(cell.cell_contents)
            except ValueError:  # a name that nothing was assigned to yet
                self._put("empty")
        if installed:
            return
        read, imported, attributes = _names_read(function.__code__)
        for name in sorted(read):
            if name in function.__globals__:
                self._put("global", name)
                self._add_global(function.__globals__[name], attributes)
        for name, level in sorted(imported):
            self._put("import", name)
            try:
                module = importlib.import_module(
                    "." * level + name, function.__globals__.get("__package__") or None
                )
            except Exception:
                continue
            self._add_global(module, attributes)

    def _add_global(self, value: Any, attributes: set[str]) -> None:
        self.add(value)
        if not isinstance(value, types.ModuleType) or _is_installed(value.__name__):
            return
        if (id(value), frozenset(attributes)) in self._members:
            return
        self._members.add((id(value), frozenset(attributes)))
        for name in sorted(attributes & set(dir(value))):
            self._put("member", name)
            self._add_global(getattr(value, name), attributes)

    def _add_code(self, code: types.CodeType, doc: str | None) -> None:
        self._put("code", code.co_code)
        constants = code.co_consts[1:] if doc is not None and code.co_consts[:1] == (doc,) else code.co_consts
        self.add([constants, code.co_names, code.co_freevars, code.co_argcount, code.co_flags])
        self.add(getattr(code, "co_exceptiontable", None))  # from Python 3.11 on: where exceptions are caught

    def _add_class(self, kind: type) -> None:
        self._put("class", f"{kind.__qualname__}")
        if _is_installed(kind.__module__):
            self._put("of", kind.__module__)
            return
        self.add(list(kind.__bases__))
        for name, member in sorted(vars(kind).items()):
            if name not in _NOT_OF_A_CLASS:
                self._put("member", name)
                self.add(member)

    def _add_instance(self, value: Any) -> None:
        self._put("instance")
        self.add(type(value))
        state = [vars(value)] if hasattr(value, "__dict__") else []
        for kind in type(value).__mro__:
            names = vars(kind).get("__slots__", ())
            for name in (names,) if isinstance(names, str) else names:
                state.append([name, getattr(value, name, None)])
        if state and (callable(value) or not _is_installed(type(value).__module__)):
            self.add(state)
            return
        # A pickle leaves out what an object of a package caches. Without one, as for a lock, the type is all.
        try:
            self._put("pickle", pickle.dumps(value))
        except Exception:
            pass


def _names_read(code: types.CodeType) -> tuple[set[str], set[tuple[str, int]], set[str]]:
    """Globals that code reads, (module, level) that it imports, and attributes that it asks for, functions inside included."""
    read, imported, attributes = set(), set(), set()
    level: Any = 0
    before: list[Any] = [None, None]
    for step in dis.get_instructions(code):
        if step.opname in ("LOAD_GLOBAL", "LOAD_NAME", "LOAD_FROM_DICT_OR_GLOBALS"):
            read.add(step.argval)
        elif step.opname == "IMPORT_NAME":
            level = before[0]
            imported.add((step.argval, level if isinstance(level, int) else 0))
        elif step.opname in ("LOAD_ATTR", "LOAD_METHOD", "IMPORT_FROM"):
            attributes.add(step.argval)
        before = [before[1], step.argval]
    for inner in code.co_consts:
        if isinstance(inner, types.CodeType):
            of_inner = _names_read(inner)
            read |= of_inner[0]
            imported |= of_inner[1]
            attributes |= of_inner[2]
    return read, imported, attributes


_INSTALLED = tuple(
    os.path.realpath(folder) + os.sep
    for folder in (
        *(sysconfig.get_path(kind) for kind in ("stdlib", "platstdlib", "purelib", "platlib")),
        *site.getsitepackages(),
        site.getusersitepackages(),
    )
)


@functools.cache
def _is_installed(module: str | None) -> bool:
    """Whether a module is of the standard library or of an installed package, fork1s among them."""
    top = (module or "").partition(".")[0]
    if top == "__main__":
        return False
    if top in ("fork1s", "builtins") or top in sys.stdlib_module_names:
        return True
    file = getattr(sys.modules.get(module or ""), "__file__", None)
    return file is not None and os.path.realpath(file).startswith(_INSTALLED)


def _files_below(file: Path, packages: Mapping[str, Any]) -> set[Path]:
    try:
        content = file.read_bytes()
    except OSError:
        return set()
    return _files_named(content, file.parent, packages)


_LEVELS = 6  # of folders above a URDF in which it looks for files of packages


def _files_named(content: bytes, root: Path, packages: Mapping[str, Any]) -> set[Path]:
    """Files that an XML text names, and those that these name. Names are relative to `root`, the folder of the outermost.

    What MuJoCo and the URDF importer would read is among these. A file of the same name elsewhere may be too, which costs
    a computation where it changes.
    """
    found: set[Path] = set()
    names: set[str] = set()
    folders, subfolders = [root], [""]
    texts = [content]
    while texts:
        for text in texts:
            try:
                elements = list(ElementTree.fromstring(text).iter())
            except (ElementTree.ParseError, ValueError):
                continue
            for element in elements:
                for key, value in element.attrib.items():
                    if key.startswith("file") and value:
                        names.add(value)
                    elif element.tag == "compiler" and key in ("meshdir", "texturedir", "assetdir"):
                        subfolders.append(value)
        bases = [folder / subfolder for folder in folders for subfolder in subfolders]
        new = {f for name in names for f in _places(name, bases, packages) if f not in found and f.is_file()}
        found |= new
        xml = [file for file in sorted(new) if file.suffix.lower() in (".xml", ".mjcf", ".urdf")]
        folders += [file.parent for file in xml if file.parent not in folders]
        texts = [file.read_bytes() for file in xml]
    return found


def _places(name: str, folders: list[Path], packages: Mapping[str, Any]) -> list[Path]:
    scheme, found, rest = name.partition("://")
    if not found or scheme == "file":
        rest = rest if found else name
        above = list(folders[0].parents)[:_LEVELS]
        return [Path(os.path.normpath(folder / rest)) for folder in (*folders, *above)]
    package, _, inner = rest.partition("/")
    entries = [Path(e) for v in ("ROS_PACKAGE_PATH",) for e in os.environ.get(v, "").split(os.pathsep) if e]
    shared = [Path(e) / "share" for e in os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep) if e]
    above = [folders[0], *list(folders[0].parents)[:_LEVELS]]
    bases = [Path(packages[package])] if package in packages else []
    bases += [base for entry in (*entries, *shared, *above) for base in (entry / package, entry)]
    return [Path(os.path.normpath(base / inner)) for base in bases]
