"""Files, text and MuJoCo's own objects to models."""

from __future__ import annotations

import copy
import copyreg
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, Union

import numpy.typing as npt

from . import _core, _mujoco_objects
from ._errors import UnknownNameError, UsageError

if TYPE_CHECKING:
    import mujoco

Source = Union[str, "os.PathLike[str]", "mujoco.MjModel", "mujoco.MjSpec"]
Gains = tuple[float, float]
# In their order: "stiffness" set or "factors" worked in, by name.
Changes = tuple[tuple[str, dict[str, float]], ...]
Recipe = tuple[Any, dict[str, Any], Changes]  # source, options, changes since


def scene(name: str) -> Path:
    """Path of a scene that comes with the package: 'hand', 'fourbar_gripper', 'peg_gripper', 'quadruped'. Raises UnknownNameError."""
    folder = Path(__file__).parent / "scenes"
    path = folder / f"{name}.xml"
    if not path.is_file():
        there = ", ".join(sorted(p.stem for p in folder.glob("*.xml")))
        if not there:
            raise UnknownNameError(
                f"there is no scene '{name}': {folder} has none, as in a build folder; install the package, or give load "
                "the path of a model"
            )
        raise UnknownNameError(f"there is no scene '{name}'; there are: {there}")
    return path


def load(
    source: Source,
    *,
    interface: str | Sequence[str] = (),
    switched: str | Sequence[str] = (),
    base: str | None = None,
    modes: int | Literal["auto"] | None = None,
    mode_choice: str | None = None,
    stiffness_scale: float = 1.0,
    pd: Gains | Mapping[str, Gains] | None = None,
    keyframe: str | None = None,
    base_pose: npt.ArrayLike | None = None,
    q: Mapping[str, float] | None = None,
    keep_start: bool = False,
    hold: bool = False,
    ground: bool | float = False,
    packages: Mapping[str, str | os.PathLike[str]] | None = None,
    in_process: bool = False,
    read_time: float = 60.0,
) -> _core.Model:
    """Reads a model: MJCF or URDF from a path or from text, or a `mujoco.MjModel` or `mujoco.MjSpec`.

    A path is read in a child process, which may take half of the memory of the machine: a file that crashes or stalls
    its reader raises ModelError. It takes some 20 ms.

    Args:
        source: a path; text that begins with `<`; or what MuJoCo has compiled or is about to. A MuJoCo model is only
            read, and what was changed in it since it was compiled counts. The package mujoco may be of another version
            than `fork1s.mujoco_version`: its models are then read from the XML that it writes, which it can do of a
            specification, with attached ones, and of the model that it read last. All others are refused.
        interface: names of the bodies that may touch the world; replaces what the file says.
        switched: names of welds and connects that the file starts active and a control of their name switches, 1 at
            the start; replaces what the file says.
        base: 'fixed', 'floating' or 'driven'; replaces what the file says.
        modes: fixed-interface modes to keep at most; 'auto' keeps all below 1/(6 dt) and at least 4, within 24
            coordinates or twice those of the interface. Default: what the file says, else 'auto'.
        mode_choice: 'lowest' in frequency, or those of largest 'contribution' to the motion of the interface.
        stiffness_scale: multiplies every joint spring; its damper by the square root.
        pd: gains (kp, kv) in N·m/rad and N·m·s/rad (N/m, N·s/m) that hold joints without a spring or position servo;
            where a mechanism has motors, only the joints that they drive: each motor gives way to a set-point in rad
            or m from the start, in place of its control. Or a mapping from joint names to gains on top of whatever
            holds them, motors included; the name 'all' stands for every joint that has no gains of its own.
        keyframe: name of the initial state; default: the file's reference pose.
        base_pose: where the base starts, world frame: (3,) m, (6,) with roll, pitch and yaw in rad as `--base-pose` of
            the command line has them, (7,) with a quaternion w x y z, or (4, 4).
        q: joint name to where it starts, rad or m.
        keep_start: joints that the file, `keyframe` or `q` starts outside their limits start there;
            default: at the nearest value inside.
        hold: position servos start with the set-points that hold where the joints start, in every keyframe, and not with
            those of the file; motors and other controls keep theirs, and a note names them.
        ground: True adds a level plane under the model (at z = 0 with `base_pose`), a number one at that height in m.
        packages: URDF: folders of ROS packages by name.
        in_process: True reads a path in this process, without the child, its limits and its time. Text and models of
            MuJoCo always are.
        read_time: end the child after this many seconds.

    Raises:
        FileError, FormatError, ModelError, UsageError: with file, place, cause and remedy.
    """
    given: dict[str, Any] = dict(
        interface=interface,
        switched=switched,
        base=base,
        modes=modes,
        mode_choice=mode_choice,
        stiffness_scale=stiffness_scale,
        pd=pd,
        keyframe=keyframe,
        base_pose=base_pose,
        q=q,
        keep_start=keep_start,
        hold=hold,
        ground=ground,
        packages=packages,
        in_process=in_process,
        read_time=read_time,
    )
    source = _mujoco_objects.readable(source)
    model = _read(source, _options(**given), in_process, read_time)
    # As it is now: a path wherever one stands, a model of MuJoCo's before its owner changes it.
    if _mujoco_objects.is_model(source):
        source = copy.copy(source)
    elif not (isinstance(source, str) and source.lstrip().startswith("<")):
        source = os.path.abspath(source)
    _note(model, (source, {name: v for name, v in given.items() if v is not _DEFAULTS[name]}, ()))
    return model


_DEFAULTS: dict[str, Any] = load.__kwdefaults__ or {}
# Reads a path on its own where it is asked to: ReadInChild.
_PROGRAM = str(Path(__file__).parent / "bin" / "fork1s")


def _options(
    *,
    interface: Any,
    switched: Any,
    stiffness_scale: Any,
    pd: Any,
    base_pose: Any,
    q: Any,
    ground: Any,
    packages: Any,
    in_process: bool,
    read_time: float,
    **others: Any,
) -> dict[str, Any]:
    for name, value in (("q", q), ("packages", packages)):
        if value is not None and not isinstance(value, Mapping):
            raise TypeError(f"{name} must be a mapping, not {value!r}")
    for name, value in (("interface", interface), ("switched", switched)):
        if not isinstance(value, (str, Sequence)):
            raise TypeError(f"{name} must be a name or a sequence of names, not {value!r}")
    if not isinstance(in_process, bool):
        raise TypeError(f"in_process must be True or False, not {in_process!r}")
    gains: dict[str, Gains] = {}
    everywhere: Gains | None = None
    if isinstance(pd, Mapping):
        gains = dict(pd)
    elif pd is not None:
        everywhere = pd
    return {
        **others,
        "interface": [interface] if isinstance(interface, str) else list(interface),
        "switched": [switched] if isinstance(switched, str) else list(switched),
        "stiffness_scale": stiffness_scale,
        "pd": everywhere,
        "joint_pd": gains,
        "base_pose": base_pose,
        "q": dict(q or {}),
        "ground": ground is not False,
        "ground_height": None if isinstance(ground, bool) else ground,
        "packages": {name: os.fsdecode(folder) for name, folder in (packages or {}).items()},
    }


def _read(source: Any, options: dict[str, Any], in_process: bool, read_time: float) -> _core.Model:
    if _mujoco_objects.is_model(source):
        return _core.load_mujoco(source._address, "MjModel", options)
    if isinstance(source, str) and source.lstrip().startswith("<"):
        return _core.load_text(source, "text", options)
    if isinstance(source, (str, os.PathLike)):
        path = os.fsdecode(source)
        if in_process:
            return _core.load_file(path, options)
        return _core.load_file_in_child(path, options, _PROGRAM, read_time)
    raise UsageError(
        f"load takes a path, text, a mujoco.MjModel or a mujoco.MjSpec, not {type(source).__name__}"
    )


def with_stiffness(model: _core.Model, stiffness: Mapping[str, float]) -> _core.Model:
    private: Any = model
    changed: _core.Model = private._with_stiffness(dict(stiffness))
    _note_change(changed, model, "stiffness", stiffness)
    return changed


def with_factors(model: _core.Model, factors: Mapping[str, float]) -> _core.Model:
    private: Any = model
    changed: _core.Model = private._with_factors(dict(factors))
    _note_change(changed, model, "factors", factors)
    return changed


def changed_again(model: _core.Model, changes: Changes) -> _core.Model:
    """The model with changes of a recipe worked in."""
    for kind, values in changes:
        model = (with_stiffness if kind == "stiffness" else with_factors)(model, values)
    return model


def joined(changes: Changes, kind: str, values: Mapping[str, float]) -> Changes:
    """Changes, and then another. Of stiffnesses one after the other the last ones count."""
    floats = {name: float(value) for name, value in values.items()}
    if kind == "stiffness" and changes and changes[-1][0] == kind:
        return (*changes[:-1], (kind, {**changes[-1][1], **floats}))
    return (*changes, (kind, floats))


def _note_change(changed: _core.Model, model: _core.Model, kind: str, values: Mapping[str, float]) -> None:
    source, options, before = recipe_of(model)
    _note(changed, (source, options, joined(before, kind, values)))


def _note(model: _core.Model, recipe: Recipe) -> None:
    private: Any = model  # an attribute of the object alone, which the stub does not have
    private._recipe = recipe


def recipe_of(model: _core.Model) -> Recipe:
    """What `load` was given, its options, and what was changed since."""
    private: Any = model
    recipe: Recipe = private._recipe
    return recipe


def _again(state: object, recipe: Recipe) -> _core.Model:
    model = _core.model_of_state(state)
    _note(model, recipe)
    return model


# A model goes to other processes as it was read, so that they need no file and get the same bits.
def _reduced(model: _core.Model) -> tuple[Any, tuple[object, Recipe]]:
    private: Any = model
    return _again, (private._state(), recipe_of(model))


copyreg.pickle(_core.Model, _reduced)
