"""Pictures of members of a batch, drawn by MuJoCo's renderer at the poses of fork1s."""

from __future__ import annotations

import copy
from typing import Any

import numpy as np
import numpy.typing as npt

from . import _core, _mujoco_objects
from ._errors import UnknownNameError, UsageError
from ._load import recipe_of

Floats = npt.NDArray[np.float64]


class Renderer:
    """Draws a model at poses of its bodies. The free camera looks at the whole, `camera` at what it names.

    Raises:
        ModuleNotFoundError: without the package mujoco.
        UsageError: without OpenGL, and for models that MuJoCo does not read by itself.
        UnknownNameError: there is no such camera.
    """

    def __init__(self, model: _core.Model, height: int, width: int, camera: str | None) -> None:
        mujoco = _mujoco_objects.needed()
        self._mujoco = mujoco
        self._mj = _compiled(model, mujoco)
        screen = self._mj.vis.global_
        screen.offheight, screen.offwidth = max(screen.offheight, height), max(screen.offwidth, width)
        self._data = mujoco.MjData(self._mj)
        mujoco.mj_forward(self._mj, self._data)
        self._camera = -1 if camera is None else _camera(self._mj, camera, mujoco)
        self._places = self._places_of(list(model.bodies))
        try:
            self._renderer = mujoco.Renderer(self._mj, height, width)
        except Exception as error:  # of whichever OpenGL package it has found, or of none
            raise UsageError(
                f"render_mode 'rgb_array' draws with MuJoCo's renderer, which cannot use OpenGL here ({error}); without a "
                "display set MUJOCO_GL=egl or MUJOCO_GL=osmesa before Python starts, and pip install pyopengl"
            ) from error

    def _places_of(self, names: list[str]) -> list[int]:
        """Of every body of MuJoCo its place among ours; -1: it moves with its parent."""
        known = {name: place for place, name in reversed(list(enumerate(names)))}
        return [-1, *(known.get(self._mj.body(i).name, -1) for i in range(1, self._mj.nbody))]

    def set_poses(self, poses: Floats) -> Any:
        """Fills `MjData` with where everything is drawn that moves with bodies. poses: (k, 7), as of `Simulation.poses`."""
        mujoco, m, d = self._mujoco, self._mj, self._data
        for i in range(1, m.nbody):
            parent, place = m.body_parentid[i], self._places[i]
            if place >= 0:
                d.xpos[i], d.xquat[i] = poses[place, :3], poses[place, 3:]
            else:
                d.xpos[i] = d.xpos[parent] + d.xmat[parent].reshape(3, 3) @ m.body_pos[i]
                mujoco.mju_mulQuat(d.xquat[i], d.xquat[parent], m.body_quat[i])
            mujoco.mju_quat2Mat(d.xmat[i], d.xquat[i])
            d.xipos[i] = d.xpos[i] + d.xmat[i].reshape(3, 3) @ m.body_ipos[i]
            _turn(mujoco, d.xquat[i], m.body_iquat[i], d.ximat[i])
        for of, position, quaternion, at, turned in (
            (m.geom_bodyid, m.geom_pos, m.geom_quat, d.geom_xpos, d.geom_xmat),
            (m.site_bodyid, m.site_pos, m.site_quat, d.site_xpos, d.site_xmat),
            (m.cam_bodyid, m.cam_pos, m.cam_quat, d.cam_xpos, d.cam_xmat),
        ):
            for k, body in enumerate(of):
                at[k] = d.xpos[body] + d.xmat[body].reshape(3, 3) @ position[k]
                _turn(mujoco, d.xquat[body], quaternion[k], turned[k])
        for k, body in enumerate(m.light_bodyid):
            d.light_xpos[k] = d.xpos[body] + d.xmat[body].reshape(3, 3) @ m.light_pos[k]
            d.light_xdir[k] = d.xmat[body].reshape(3, 3) @ m.light_dir[k]
        return d

    def draw(self, poses: Floats) -> npt.NDArray[np.uint8]:
        """(height, width, 3), RGB."""
        self._renderer.update_scene(self.set_poses(poses), camera=self._camera)
        return np.array(self._renderer.render(), dtype=np.uint8)

    def close(self) -> None:
        self._renderer.close()


def _turn(mujoco: Any, quaternion: Floats, local: Floats, out: Floats) -> None:
    product = np.zeros(4)
    mujoco.mju_mulQuat(product, quaternion, local)
    mujoco.mju_quat2Mat(out, product)


def _compiled(model: _core.Model, mujoco: Any) -> Any:
    source = recipe_of(model)[0]
    if _mujoco_objects.is_model(source):
        return copy.copy(source)  # its screen is enlarged
    try:
        if isinstance(source, str) and source.lstrip().startswith("<"):
            return mujoco.MjModel.from_xml_string(source)
        return mujoco.MjModel.from_xml_path(str(source))
    except ValueError as error:
        raise UsageError(
            f"render_mode 'rgb_array' draws with MuJoCo's renderer, and MuJoCo does not read '{model.path}' by itself "
            f"({error}); use a model that it reads"
        ) from error


def _camera(mj: Any, name: str, mujoco: Any) -> int:
    place = int(mujoco.mj_name2id(mj, mujoco.mjtObj.mjOBJ_CAMERA, name))
    if place < 0:
        known = ", ".join(mj.camera(i).name for i in range(mj.ncam)) or "none"
        raise UnknownNameError(f"there is no camera '{name}'; there are: {known}")
    return place
