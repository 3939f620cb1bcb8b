"""Meshes, and the convex pieces of them on disk.

Pieces lie in a folder KEY, by the content of the mesh and the options: STL files, and pieces.json, which says how many
there are and what they were made from.
"""

from __future__ import annotations

import hashlib
import json
import os
import shutil
import tempfile
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

import numpy as np
import numpy.typing as npt

from ._errors import ModelError

_STL = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


@dataclass(frozen=True)
class Mesh:
    """Triangles of a mesh and of its convex hull, (n, 3) indices of `vertices`, (k, 3) m. No hull: (0, 3)."""

    vertices: npt.NDArray[np.float64]
    faces: npt.NDArray[np.int64]
    hull: npt.NDArray[np.int64]

    def fill(self) -> float:
        """Share of the volume of the hull; 1 where there is no hull or it is flat."""
        hull = volume(self.vertices, self.hull)
        return volume(self.vertices, self.faces) / hull if hull > 0 else 1.0

    def is_closed(self) -> bool:
        """Whether every edge has one triangle on either side, in opposite directions. Vertices at one place are one."""
        places = np.unique(self.vertices, axis=0, return_inverse=True)[1].reshape(-1)
        corners = places[self.faces]
        edges = [tuple(edge) for k in range(3) for edge in corners[:, [k, (k + 1) % 3]].tolist()]
        once = set(edges)
        return len(once) == len(edges) and all((b, a) in once for a, b in once)


def volume(vertices: npt.NDArray[np.float64], faces: npt.NDArray[np.int64]) -> float:
    """|1/6 Σ a · (b × c)|, m³: that of the solid where the triangles close a surface and face outwards."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    return abs(float(np.einsum("ij,ij", a, np.cross(b, c)))) / 6


def read_stl(path: str) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.int64]]:
    """Vertices, each once, and triangles of a binary STL."""
    corners = np.fromfile(path, _STL, offset=84)["corners"].reshape(-1, 3)
    vertices, faces = np.unique(corners, axis=0, return_inverse=True)
    return vertices.astype(float), faces.reshape(-1, 3)


def _write_stl(path: Path, vertices: npt.NDArray[np.float64], faces: npt.NDArray[np.int64]) -> None:
    triangles = np.zeros(len(faces), _STL)
    triangles["corners"] = vertices[faces]
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    normals = np.cross(b - a, c - a)
    length = np.linalg.norm(normals, axis=1, keepdims=True)
    triangles["normal"] = np.divide(normals, length, out=np.zeros_like(normals), where=length > 0)
    with open(path, "wb") as stream:
        stream.write(b"convex piece".ljust(80) + np.uint32(len(faces)).tobytes())
        stream.write(triangles.tobytes())


class PieceStore:
    """The folder that has the pieces of meshes."""

    def __init__(self, folder: Path, threshold: float, max_pieces: int | None) -> None:
        self.folder = folder
        self._options = {
            "coacd": metadata.version("coacd"),
            "threshold": float(threshold),
            "max_pieces": -1 if max_pieces is None else int(max_pieces),
        }

    def _of(self, mesh: Mesh) -> Path:
        key = hashlib.sha256(json.dumps(self._options, sort_keys=True).encode())
        for part in (mesh.vertices.astype("<f4"), mesh.faces.astype("<i4")):
            key.update(np.int64(len(part)).tobytes() + part.tobytes())
        return self.folder / key.hexdigest()[:16]

    def find(self, mesh: Mesh) -> tuple[str, ...] | None:
        """Paths of the pieces of a mesh that was decomposed before by these options; None without."""
        folder = self._of(mesh)
        try:
            count = int(json.loads((folder / "pieces.json").read_text())["pieces"])
        except (OSError, ValueError, KeyError, TypeError):
            return None
        paths = [folder / f"{i}.stl" for i in range(count)]
        whole = count > 0 and all(p.is_file() and p.stat().st_size > 84 for p in paths)
        return tuple(map(str, paths)) if whole else None

    def compute(self, mesh: Mesh, where: str) -> tuple[str, ...]:
        """Decomposes a mesh and writes its pieces. `where`: file and mesh, for errors."""
        import coacd

        coacd.set_log_level("error")
        options = self._options
        try:
            pieces = coacd.run_coacd(
                coacd.Mesh(mesh.vertices, mesh.faces),
                threshold=options["threshold"],
                max_convex_hull=options["max_pieces"],
                seed=0,
            )
        except Exception as error:  # of whatever kind CoACD's library gives
            raise ModelError(f"{where}: CoACD cannot decompose it ({error}); mend the mesh") from None
        solids = [(np.asarray(v, float), np.asarray(f, int)) for v, f in pieces]
        # A sliver of a millionth of the volume is below what float32 vertices resolve, and has no hull.
        least = 1e-6 * sum(volume(v, f) for v, f in solids)
        solids = [(v, f) for v, f in solids if volume(v, f) > least]
        if not solids:
            raise ModelError(f"{where}: CoACD finds no piece that has a volume; mend the mesh")
        self.folder.mkdir(parents=True, exist_ok=True)
        folder = self._of(mesh)
        part = Path(tempfile.mkdtemp(prefix=".part-", dir=self.folder))
        try:
            os.chmod(part, 0o777 & ~_umask())
            for i, (vertices, faces) in enumerate(solids):
                _write_stl(part / f"{i}.stl", vertices, faces)
            (part / "pieces.json").write_text(json.dumps({**options, "pieces": len(solids)}) + "\n")
            if folder.exists():  # of a call that was damaged since
                shutil.rmtree(folder)
            os.rename(part, folder)
        finally:
            shutil.rmtree(part, ignore_errors=True)
        return tuple(str(folder / f"{i}.stl") for i in range(len(solids)))


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
