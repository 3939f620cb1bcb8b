"""Models and specifications of Python's package mujoco, of whatever version it is.

The package fork1s has a MuJoCo library of its own. A compiled model of the same version is read where it is in memory; one
of another version has another layout, and one with plugins counts those of the other library. These are read from the XML
that their own version writes.
"""

from __future__ import annotations

import atexit
import ctypes
import hashlib
import os
import re
import shutil
import sys
import tempfile
import threading
import warnings
import xml.etree.ElementTree as ElementTree
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from . import _core
from ._errors import UsageError


def is_model(value: Any) -> bool:
    """Whether a value is a `mujoco.MjModel`. Does not import mujoco: who has one has imported it."""
    return isinstance(value, getattr(sys.modules.get("mujoco"), "MjModel", ()))


def is_spec(value: Any) -> bool:
    """Whether a value is a `mujoco.MjSpec`."""
    return isinstance(value, getattr(sys.modules.get("mujoco"), "MjSpec", ()))


def needed() -> Any:
    """The package mujoco, for what cannot do without it."""
    try:
        import mujoco
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            "this needs the package mujoco, of any version from 3.2 on: pip install 'fork1s[mujoco]'",
            name=error.name,
        ) from None
    except (ImportError, OSError) as error:
        raise ImportError(
            f"the package mujoco is there and cannot be imported ({error}). The packages mujoco 3 and mujoco-core install "
            "into the same folder, and each breaks the other: pip uninstall mujoco mujoco-core, then pip install one of them"
        ) from error
    return mujoco


def _same_version() -> str:
    """The remedy where the version of MuJoCo is another than that of fork1s."""
    # Up to 3.17 the package mujoco has the files that mujoco-core has since 4.0, in the same folder.
    return f"pip uninstall mujoco mujoco-core, then pip install mujoco-core=={_core.mujoco_version}"


def readable(source: Any) -> Any:
    """A source as fork1s reads it: an `MjModel` of the same version and without plugins, or MJCF text."""
    if is_spec(source):
        model = source.compile()
        return model if _same_layout(model) else _text_of_spec(source, model)
    if is_model(source) and not _same_layout(source):
        return _text_of_model(source)
    return source


def _version() -> str:
    return str(sys.modules["mujoco"].mj_versionString())


def _same_layout(model: Any) -> bool:
    return _version() == _core.mujoco_version and model.nplugin == 0


@contextmanager
def _all_digits() -> Iterator[None]:
    """MuJoCo writes six digits of a number unless its library is told otherwise, which those of 3.2 to 4.0 can be."""
    folder = Path(sys.modules["mujoco"].__file__ or "").parent
    with _WRITING:
        for file in folder.glob("libmujoco.so*"):
            try:
                library = ctypes.CDLL(os.fspath(file), mode=os.RTLD_NOLOAD | os.RTLD_LOCAL | os.RTLD_NOW)
            except OSError:  # not the library that is loaded
                continue
            get = getattr(library, "_mjPRIVATE__get_xml_precision", None)
            put = getattr(library, "_mjPRIVATE__set_xml_precision", None)
            if get is not None and put is not None:
                before = get()
                put(17)
                try:
                    yield
                finally:
                    put(before)
                return
        yield


_WRITING = threading.Lock()


def _text_of_spec(spec: Any, model: Any) -> str:
    mujoco = sys.modules["mujoco"]
    with _all_digits():
        text = spec.to_xml()
    root = ElementTree.fromstring(text)
    base = Path(spec.modelfiledir or ".").absolute()
    for element, key, folder in _files(root):
        name = element.attrib[key]
        # As found when it was compiled: attached models have files in other folders, of which the XML says nothing.
        found = _recorded_path(mujoco, model, element) if key == "file" else None
        content = _content(spec.assets, found or os.path.join(folder, name))
        if content is not None:
            element.set(key, _stored(os.path.basename(name), content))
        else:
            element.set(key, os.path.abspath(found or base / folder / name))
    _replace_lost_sides(root)
    return _without_folders(root)


def _content(assets: Any, path: str) -> bytes | None:
    """The content of a file among assets in memory, which MuJoCo finds by path or by the last part of it.

    Either goes before a file on the disk. Of several keys with that last part MuJoCo takes the last, whatever their folders.
    """
    keys = [path] if path in assets else [k for k in assets if os.path.basename(k) == os.path.basename(path)]
    contents = {c.encode() if isinstance(c, str) else bytes(c) for c in (assets[key] for key in keys)}
    if len(contents) > 1:
        raise UsageError(
            f"MjSpec: the file '{path}' is none of its assets, of which {' and '.join(map(repr, keys))} have its name and "
            "different contents; name the assets by the path, with meshdir or texturedir"
        )
    return next(iter(contents), None)


# Process and folder of assets that were in memory. The folder goes with the process.
_STORED: list[tuple[int, str]] = []
_PREFIX = "fork1s_assets_"
_STORING = threading.Lock()


def without_stored_folders(text: str) -> str:
    """A text whose stored assets are named by their content alone, not by the folder of the process that stored them."""
    return re.sub(rf'(?<=")[^"]*/{_PREFIX}[^/"]*(?=/[0-9a-f]{{64}}/)', "", text)


def _stored(name: str, content: bytes) -> str:
    with _STORING:
        if not _STORED or _STORED[-1][0] != os.getpid():
            _STORED.append((os.getpid(), tempfile.mkdtemp(prefix=_PREFIX)))
            atexit.register(_remove, *_STORED[-1])
        folder = Path(_STORED[-1][1]) / hashlib.sha256(content).hexdigest()
        if not (folder / name).exists():
            folder.mkdir(exist_ok=True)
            (folder / name).write_bytes(content)
        return os.fspath(folder / name)


def _remove(process: int, folder: str) -> None:
    if process == os.getpid():  # not in a fork, which inherits it
        shutil.rmtree(folder, ignore_errors=True)


def _replace_lost_sides(root: ElementTree.Element) -> None:
    """Grey, with a warning, in place of files for the sides of a cube in other folders, which MuJoCo does not record."""
    for texture in root.iter("texture"):
        lost = [texture.attrib[key] for key in _SIDE_KEYS if not os.path.exists(texture.get(key) or "/")]
        if not lost:
            continue
        for key in (*_SIDE_KEYS, "gridsize", "gridlayout", "content_type"):
            texture.attrib.pop(key, None)
        texture.attrib.update(builtin="flat", rgb1="0.5 0.5 0.5", width="8", height="48")
        warnings.warn(
            f"texture '{texture.get('name')}' is grey: MuJoCo does not record where the files of a cube's sides lie, and "
            f"there is no {' and no '.join(sorted(set(lost)))}; put them into the folder of the model, or their contents "
            "among the assets of its MjSpec (spec.assets)",
            stacklevel=5,  # whoever called load
        )


def _text_of_model(model: Any) -> str:
    mujoco = sys.modules["mujoco"]
    refusal = (
        f"MjModel of mujoco {_version()}: fork1s reads by MuJoCo {_core.mujoco_version}, and a model of another version, or "
        "one with plugins, from the XML that its own version writes. {why}. Load the path or the text of the model; of one that "
        "a program has put together, load the MjSpec that it was compiled from, with what was changed in the MjModel since set "
        f"in the MjSpec. Or {_same_version()}"
    )
    with tempfile.TemporaryDirectory() as folder:
        file = os.path.join(folder, "model.xml")
        try:
            with _all_digits():
                mujoco.mj_saveLastXML(file, model)
        except Exception as error:
            raise UsageError(
                refusal.format(why=f"It writes that of the model that it read last alone ({error})")
            ) from error
        root = ElementTree.parse(file).getroot()
    try:
        # Of the sides of a cube nothing is recorded: they lie in the folder of the model, which recorded paths begin with.
        bases, sides = [], []
        for element, key, directory in _files(root):
            name = os.path.join(directory, element.attrib[key])
            found = _recorded_path(mujoco, model, element) if key == "file" else None
            if found is not None:
                element.set(key, os.path.abspath(found))
                if found.endswith("/" + name):
                    bases.append(Path(found[: -len(name)]))
            elif key in _SIDE_KEYS:
                sides.append((element, key, name))
        for element, key, name in sides:
            places = [os.path.abspath(base / name) for base in (*bases, Path())]
            element.set(key, next(filter(os.path.exists, places), places[0]))
        _replace_lost_sides(root)
        text = _without_folders(root)
        again = mujoco.MjModel.from_xml_string(text)
    except Exception as error:
        raise UsageError(refusal.format(why=f"That cannot be read again ({error})")) from error
    different = _difference(model, again)
    if different:
        # MuJoCo writes the XML that it read last, whichever model that was of.
        raise UsageError(
            refusal.format(
                why=f"That is of the model that it read last, which is another ({different} differs)"
            )
        )
    return text


_SIDE_KEYS = ("fileright", "fileleft", "fileup", "filedown", "filefront", "fileback")
_FILE_KEYS = ("file", *_SIDE_KEYS)


def _files(root: ElementTree.Element) -> Iterator[tuple[ElementTree.Element, str, str]]:
    """Elements of an XML model that name a file, by which attribute, and the folder of the compiler settings."""
    folders = {key: value for c in root.iter("compiler") for key, value in c.attrib.items()}
    mesh = folders.get("meshdir", folders.get("assetdir", ""))
    texture = folders.get("texturedir", folders.get("assetdir", ""))
    for element in root.iter():
        for key in _FILE_KEYS:
            if element.get(key):
                yield element, key, texture if element.tag == "texture" else mesh


def _without_folders(root: ElementTree.Element) -> str:
    for compiler in root.iter("compiler"):
        for key in ("meshdir", "texturedir", "assetdir", "strippath"):
            compiler.attrib.pop(key, None)
    return ElementTree.tostring(root, encoding="unicode")


def _recorded_path(mujoco: Any, model: Any, element: ElementTree.Element) -> str | None:
    """Where the file of an asset lies, as the compiled model has recorded it."""
    kinds = {"mesh": "MESH", "hfield": "HFIELD", "texture": "TEXTURE", "skin": "SKIN"}
    addresses = {
        "mesh": "mesh_pathadr",
        "hfield": "hfield_pathadr",
        "texture": "tex_pathadr",
        "skin": "skin_pathadr",
    }
    if element.tag not in kinds:
        return None
    name = element.get("name") or Path(element.attrib["file"]).stem
    index = mujoco.mj_name2id(model, getattr(mujoco.mjtObj, "mjOBJ_" + kinds[element.tag]), name)
    address = int(getattr(model, addresses[element.tag])[index]) if index >= 0 else -1
    if address < 0:
        return None
    return bytes(model.paths)[address:].split(b"\0", 1)[0].decode()


# Of a compiled model, what the importer reads: not what MuJoCo derives for its own solver, and not what is drawn.
_READ = re.compile(
    r"(body|jnt|dof|geom|mesh|hfield|tendon|wrap|eq|actuator|pair|exclude|key|site)_|qpos0$|qpos_spring$|names$|n[a-z]+$"
)
_DERIVED = re.compile(
    r".*(invweight0|_M0|length0|acc0|lengthrange|subtreemass|rbound|aabb|bvh.*|pathadr|rgba|matid|plane|user|_oct.*|signature)$"
    r"|n(paths|buffer|B|M|D|C|text.*|skin.*|tex.*|mat|cam|light|narena|user.*|bvh.*|J.*|names_map)$"
)


def _difference(model: Any, other: Any) -> str:
    """The first property in which two models of one version differ, empty for none."""
    for name in dir(model):
        if not _READ.match(name) or _DERIVED.match(name):
            continue
        ours: Any = getattr(model, name)
        theirs: Any = getattr(other, name, None)
        if isinstance(ours, (int, bytes)) and ours != theirs:
            return name
        if isinstance(ours, np.ndarray):
            # Six digits, where the library writes no more.
            scale = 1e-5 * max(1e-9, float(np.abs(ours).max(initial=0)))
            if ours.shape != theirs.shape or not np.allclose(
                ours, theirs, rtol=1e-5, atol=scale, equal_nan=True
            ):
                return name
    return ""
