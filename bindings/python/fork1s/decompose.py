"""Colliding meshes that are not convex, in convex pieces.

    fork1s.decompose.decompose_meshes("model.xml", "model_pieces.xml")
    python -m fork1s.decompose model.xml model_pieces.xml

Contact takes a mesh as its convex hull. docs/decompose.md says what is written. Needs `pip install 'fork1s[decompose]'`.
"""

from __future__ import annotations

import argparse
import os
import sys
import xml.etree.ElementTree as ElementTree
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from . import _mujoco_objects
from ._core import NewFile
from ._errors import Error, FileError, FormatError, ModelError, UnknownNameError, UsageError
from ._load import load
from ._mesh_pieces import Mesh, PieceStore, read_stl

__all__ = ["Decomposition", "decompose_meshes", "main"]

# First line of a file that is written here, by which a later call knows that it may replace it.
_BEGIN = "<!-- fork1s.decompose"
_VISUAL_GROUP = 3  # groups from here on are not drawn where their body has others
_USAGE, _REFUSED = 2, 3  # exit codes, as of the command fork1s
_GEOM_FIELDS = (
    "contype conaffinity condim priority friction solmix solref solimp margin gap rgba material".split()
)
# What the written model has as the original has it: all but geoms and what MuJoCo derives from them.
_CHECKED = (
    "body_parentid body_pos body_quat body_ipos body_iquat body_mass body_inertia body_gravcomp jnt_type jnt_pos jnt_axis "
    "jnt_range jnt_stiffness qpos0 qpos_spring dof_damping dof_armature dof_frictionloss tendon_range tendon_stiffness "
    "tendon_damping actuator_gear actuator_gainprm actuator_biasprm actuator_ctrlrange actuator_forcerange eq_data"
).split()
_PAIR_FIELDS = "condim friction solref solreffriction solimp margin gap".split()


@dataclass(frozen=True)
class Decomposition:
    """What was written. `meshes`: name to the paths of its pieces; `computed`: names of the meshes that no earlier call
    had decomposed; `notes`: sentences of what was left as it was."""

    meshes: dict[str, tuple[str, ...]]
    computed: tuple[str, ...]
    notes: tuple[str, ...]


def decompose_meshes(
    model: str | os.PathLike[str],
    out: str | os.PathLike[str],
    *,
    meshes: str | Sequence[str] = (),
    max_fill: float = 0.9,
    threshold: float = 0.05,
    max_pieces: int | None = None,
) -> Decomposition:
    """Writes an MJCF in which colliding meshes that are not convex collide as convex pieces.

    Each such geom stays as a shape that is drawn and has its mass, and no longer collides; its pieces have its pose,
    friction and other contact settings, and no mass. Pieces are STL files in the folder `OUT_pieces` beside `out`, by the
    content of the mesh and the options: a later call with the same ones decomposes nothing.

    Args:
        model: path of an MJCF.
        out: path to write to. A file that an earlier call wrote is replaced, no other.
        meshes: names of the meshes to decompose (open ones take many minutes); default: closed colliding meshes that
            fill less than `max_fill` of their hull.
        max_fill: share of the volume of the hull.
        threshold: concavity of a piece that CoACD accepts, a share of the half size of the mesh, 0.01 to 1.
        max_pieces: of a mesh at most; default: as many as `threshold` needs.

    Raises:
        FileError, FormatError, ModelError: the model cannot be read, has no such mesh, or a file cannot be written.
        UnknownNameError: a name of `meshes`. UsageError: an option makes no sense, or `out` is the model itself.
        ModuleNotFoundError: coacd or mujoco is missing (`pip install 'fork1s[decompose]'`).
    """
    if not 0 < max_fill <= 1:
        raise UsageError(f"decompose_meshes: max_fill {max_fill} is no share above 0 and up to 1")
    if not 0.01 <= threshold <= 1:  # CoACD's range
        raise UsageError(f"decompose_meshes: threshold {threshold} is not between 0.01 and 1")
    if max_pieces is not None and (int(max_pieces) != max_pieces or max_pieces < 1):
        raise UsageError(f"decompose_meshes: max_pieces {max_pieces} is no whole number above 0")
    mujoco = _mujoco()
    model, out = os.fspath(model), os.fspath(out)
    _require_mjcf(model)
    load(model)  # in a child process: refuses what cannot be read, with its sentence
    if Path(out).exists() and Path(out).samefile(model):
        raise UsageError(f"{out}: is the model itself; give another name to write to")
    file = NewFile(out, "a model of fork1s.decompose", _BEGIN)
    try:
        names = [meshes] if isinstance(meshes, str) else list(meshes)
        store = PieceStore(Path(out).with_name(Path(out).stem + "_pieces"), threshold, max_pieces)
        done, text = _Writer(mujoco, model, out, names, max_fill, store).write()
        Path(file.part).write_text(text, encoding="utf-8")
        file.keep()
    except OSError as error:
        if isinstance(error, Error):
            raise
        raise FileError(
            f"{error.filename or out}: cannot be written ({error.strerror or error}); check the folder, its permissions and "
            "the disk's room"
        ) from None
    finally:
        file.drop()
    return done


def _mujoco() -> Any:
    try:
        import coacd  # noqa: F401
        import mujoco
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            f"fork1s.decompose needs coacd and mujoco ({error.name} is missing): pip install 'fork1s[decompose]'",
            name=error.name,
        ) from None
    except (ImportError, OSError):
        return _mujoco_objects.needed()
    return mujoco


def _require_mjcf(path: str) -> None:
    """Refuses a URDF. Other files that are no MJCF are refused by `load`."""
    try:
        with open(path, "rb") as stream:
            for _, element in ElementTree.iterparse(stream, events=("start",)):
                root = element.tag
                break
    except OSError as error:
        raise FileError(
            f"{path}: cannot be read ({error.strerror or error}); check the path and its permissions"
        ) from None
    except ElementTree.ParseError:
        return
    if root == "robot":
        converted = Path(path).stem + ".xml"
        raise ModelError(
            f"{path}: is a URDF, and pieces are written as MJCF; convert it first: fork1s export {path} {converted}"
        )


class _Writer:
    """One model: which of its meshes, their pieces, and the text with them."""

    def __init__(
        self, mujoco: Any, path: str, out: str, names: list[str], max_fill: float, store: PieceStore
    ) -> None:
        self._mj, self._path, self._out, self._store = mujoco, path, out, store
        self._names, self._max_fill = names, max_fill
        self._notes: list[str] = []
        # MuJoCo keeps files that it has read, and tells a new one by a time of whole seconds.
        if hasattr(mujoco, "mj_clearCache"):
            mujoco.mj_clearCache(mujoco.mj_getCache())
        try:
            self._spec = mujoco.MjSpec.from_file(path)
            # Bodies and geoms of the compiled model are those of the file.
            self._kept = {
                name: getattr(self._spec.compiler, name) for name in ("fusestatic", "discardvisual")
            }
            for name in self._kept:
                setattr(self._spec.compiler, name, 0)
            self._model = self._spec.compile()
        except Exception as error:  # what mujoco raises is ValueError and its own FatalError
            raise FormatError(
                f"{path}: mujoco {mujoco.mj_versionString()} cannot read it ({error}); mend it, or install another version"
            ) from None

    def write(self) -> tuple[Decomposition, str]:
        colliding = self._colliding_geoms()
        chosen = self._choose(colliding)
        pieces: dict[str, tuple[str, ...]] = {}
        computed = []
        for name, mesh in chosen.items():
            found = self._store.find(mesh)
            if found is None:
                found = self._store.compute(mesh, f"{self._path}: mesh '{name}'")
                computed.append(name)
            pieces[name] = found
        self._taken = {g.name for g in self._spec.geoms} | {m.name for m in self._spec.meshes}
        self._files: dict[str, str] = {}  # name of a mesh in the written file to its path
        mesh_names = {name: self._add_meshes(name, paths) for name, paths in pieces.items()}
        replaced: dict[str, list[str]] = {}
        for geom, index in colliding:
            if geom.meshname in chosen:
                self._replace(geom, index, mesh_names[geom.meshname], replaced)
        self._replace_pairs(replaced)
        self._note_sensors(replaced)
        text = self._text()
        return Decomposition(pieces, tuple(computed), tuple(self._notes)), text

    def _colliding_geoms(self) -> list[tuple[Any, int]]:
        """With their places in the compiled model: `id` changes when others are added."""
        m = self._model
        in_pairs = set(m.pair_geom1) | set(m.pair_geom2)
        return [
            (g, int(g.id))
            for g in self._spec.geoms
            if m.geom_type[g.id] == self._mj.mjtGeom.mjGEOM_MESH
            and (m.geom_contype[g.id] or m.geom_conaffinity[g.id] or g.id in in_pairs)
        ]

    def _mesh(self, mesh: int) -> Mesh:
        """As compiled: scaled, in its principal axes, where `geom_pos` and `geom_quat` place it."""
        m = self._model
        first, face = m.mesh_vertadr[mesh], m.mesh_faceadr[mesh]
        vertices = m.mesh_vert[first : first + m.mesh_vertnum[mesh]].astype(float)
        faces = m.mesh_face[face : face + m.mesh_facenum[mesh]].astype(int)
        hull = np.zeros((0, 3), int)
        if m.mesh_graphadr[mesh] >= 0:
            # Counts of vertices and faces, two numbers a vertex, the edges, then the corners of the faces.
            graph = m.mesh_graph[m.mesh_graphadr[mesh] :]
            begin = 2 + 3 * graph[0] + 3 * graph[1]
            hull = graph[begin : begin + 3 * graph[1]].reshape(-1, 3).astype(int)
        return Mesh(vertices, faces, hull)

    def _choose(self, colliding: list[tuple[Any, int]]) -> dict[str, Mesh]:
        of = {g.meshname: int(self._model.geom_dataid[index]) for g, index in colliding}
        if not of:
            raise ModelError(
                f"{self._path}: has no mesh that collides, so nothing is to be decomposed; use the model as it is"
            )
        for name in self._names:
            if name not in of:
                raise UnknownNameError(
                    f"{self._path}: no mesh '{name}' collides; those that do are: {', '.join(sorted(of))}"
                )
        solids = {name: self._mesh(mesh) for name, mesh in of.items()}
        if self._names:
            return {name: solids[name] for name in dict.fromkeys(self._names)}
        chosen, fills = {}, []
        for name, mesh in solids.items():
            if not mesh.is_closed():
                self._notes.append(
                    f"mesh '{name}' has no closed surface and so no volume to judge it by; close it, or name it by --mesh, "
                    "which takes many minutes"
                )
                fills.append(f"'{name}' is not closed")
            elif mesh.fill() < self._max_fill:
                chosen[name] = mesh
            else:
                fills.append(f"'{name}' fills {mesh.fill():.3g}")
        if not chosen:
            raise ModelError(
                f"{self._path}: no colliding mesh fills less than {self._max_fill:g} of its convex hull ({', '.join(fills)}); "
                "use the model as it is, or name a mesh by --mesh"
            )
        return chosen

    def _free_name(self, name: str) -> str:
        while name in self._taken:
            name += "_"
        self._taken.add(name)
        return name

    def _add_meshes(self, name: str, paths: Sequence[str]) -> list[str]:
        names = []
        for i, path in enumerate(paths):
            vertices, faces = read_stl(path)
            piece = self._spec.add_mesh()
            piece.name = self._free_name(f"{name}_piece{i}")
            piece.uservert = vertices.ravel().tolist()
            piece.userface = faces.ravel().tolist()
            piece.inertia = self._mj.mjtMeshInertia.mjMESH_INERTIA_CONVEX
            self._files[piece.name] = path
            names.append(piece.name)
        return names

    def _replace(self, geom: Any, index: int, meshes: list[str], replaced: dict[str, list[str]]) -> None:
        m, body = self._model, geom.parent
        name = geom.name or geom.meshname
        names = []
        for i, mesh in enumerate(meshes):
            piece = body.add_geom(self._spec.default)
            piece.name = self._free_name(f"{name}_piece{i}" if geom.name else f"{name}_geom{index}_{i}")
            piece.type = self._mj.mjtGeom.mjGEOM_MESH
            piece.meshname = mesh
            # A piece has the axes of the compiled mesh; defaults and frames of the file are in these.
            piece.pos, piece.quat = m.geom_pos[index], m.geom_quat[index]
            for field in _GEOM_FIELDS:
                setattr(piece, field, getattr(geom, field))
            piece.mass, piece.density = 0, 0
            piece.group = max(geom.group, _VISUAL_GROUP)
            names.append(piece.name)
        if geom.name:
            replaced[geom.name] = names
        geom.contype = geom.conaffinity = 0

    def _replace_pairs(self, replaced: dict[str, list[str]]) -> None:
        for pair in list(self._spec.pairs):
            first, second = pair.geomname1, pair.geomname2
            if first not in replaced and second not in replaced:
                continue
            for a in replaced.get(first, [first]):
                for b in replaced.get(second, [second]):
                    copy = self._spec.add_pair()
                    copy.geomname1, copy.geomname2 = a, b
                    for field in _PAIR_FIELDS:
                        setattr(copy, field, getattr(pair, field))
            self._spec.delete(pair)

    def _note_sensors(self, replaced: dict[str, list[str]]) -> None:
        geom = self._mj.mjtObj.mjOBJ_GEOM
        for sensor in self._spec.sensors:
            ends = ((sensor.objtype, sensor.objname), (sensor.reftype, sensor.refname))
            for kind, name in ends:
                if kind == geom and name in replaced:
                    self._notes.append(
                        f"sensor '{sensor.name}' names geom '{name}', which no longer collides; its pieces are "
                        f"'{replaced[name][0]}' and on"
                    )

    def _text(self) -> str:
        """With the files of pieces in place of their numbers, and all files by their way from the folder of `out`."""
        folder = os.path.abspath(os.path.dirname(self._out) or ".")
        source = os.path.abspath(os.path.dirname(self._path) or ".")
        with _mujoco_objects._all_digits():
            self._spec.compile()
            root = ElementTree.fromstring(self._spec.to_xml())
        for compiler in root.iter("compiler"):
            for name, value in self._kept.items():
                if value:
                    compiler.set(name, "true")
        for element, key, directory in _mujoco_objects._files(root):
            path = os.path.normpath(os.path.join(source, directory, element.attrib[key]))
            if not os.path.exists(path):
                stripped = os.path.join(source, directory, os.path.basename(path))
                if not os.path.exists(stripped):
                    raise ModelError(
                        f"{self._path}: file '{element.attrib[key]}' of <{element.tag}> is not found from its folder, "
                        "so the written model could not name it; put it beside the model"
                    )
                path = stripped
            element.set(key, os.path.relpath(path, folder))
        for element in root.iter("mesh"):
            piece = self._files.get(element.get("name", ""))
            if piece is not None:
                for key in ("vertex", "face"):
                    element.attrib.pop(key, None)
                element.set("file", os.path.relpath(piece, folder))
        text = _mujoco_objects._without_folders(root)
        ElementTree.indent(root)
        text = ElementTree.tostring(root, encoding="unicode")
        self._check(text, folder)
        return f"{_BEGIN} of {os.path.basename(self._path).replace('--', '- -')} -->\n{text}\n"

    def _check(self, text: str, folder: str) -> None:
        """That MuJoCo reads from the text the bodies and joints of the original."""
        spec = self._mj.MjSpec.from_string(text)
        for name in self._kept:
            setattr(spec.compiler, name, 0)
        spec.modelfiledir = folder
        try:
            again = spec.compile()
        except ValueError as error:
            raise ModelError(
                f"{self._path}: the model with pieces cannot be read again ({error}); delete the folder "
                f"{self._store.folder}, and report it if it comes again"
            ) from None
        for name in _CHECKED:
            before, after = getattr(self._model, name), getattr(again, name)
            # Numbers that are read again are the same, but for the last digits of what the compiler derives.
            if before.shape != after.shape or not np.allclose(
                before, after, rtol=1e-9, atol=1e-9 * max(1e-9, np.abs(before).max(initial=0)), equal_nan=True
            ):
                raise ModelError(
                    f"{self._path}: mujoco {self._mj.mj_versionString()} does not write all that it has read ({name} "
                    "differs), so the model with pieces would be another; decompose a model that it has saved"
                )


def main(arguments: list[str] | None = None) -> int:
    """The command `python -m fork1s.decompose`. Returns its exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m fork1s.decompose",
        description="Writes an MJCF in which colliding meshes that are not convex collide as convex pieces.",
    )
    parser.add_argument("model", help="MJCF; a URDF is converted first: fork1s export MODEL.urdf MODEL.xml")
    parser.add_argument("out", help="MJCF to write; its pieces lie in the folder OUT_pieces beside it")
    parser.add_argument(
        "--mesh",
        action="append",
        default=[],
        metavar="NAME",
        help="decompose this mesh, and no others but those named; may be repeated (default: closed colliding meshes that "
        "fill less than --max-fill of their hull)",
    )
    parser.add_argument(
        "--max-fill", type=float, default=0.9, metavar="SHARE", help="of the hull's volume (default: 0.9)"
    )
    parser.add_argument(
        "--threshold",
        type=float,
        default=0.05,
        metavar="SHARE",
        help="concavity of a piece that CoACD accepts, 0.01 to 1 (default: 0.05); less gives more pieces",
    )
    parser.add_argument("--max-pieces", type=int, metavar="N", help="of a mesh at most (default: no bound)")
    given = parser.parse_args(arguments)
    try:
        done = decompose_meshes(
            given.model,
            given.out,
            meshes=given.mesh,
            max_fill=given.max_fill,
            threshold=given.threshold,
            max_pieces=given.max_pieces,
        )
    except (Error, ModuleNotFoundError, ImportError) as error:
        print(f"error: {error}", file=sys.stderr)
        return _USAGE if isinstance(error, UsageError) else _REFUSED
    for sentence in done.notes:
        print(f"note: {sentence}", file=sys.stderr)
    for name, paths in done.meshes.items():
        print(
            f"mesh '{name}': {len(paths)} piece{'s' if len(paths) > 1 else ''}"
            f"{'' if name in done.computed else ' of an earlier call'}"
        )
    print(f"wrote {given.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
