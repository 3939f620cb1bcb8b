"""The C interface, called by ctypes as any language with a C interface would, beside Python's own simulation."""

import ctypes
import os
from ctypes import POINTER, byref, c_char_p, c_double, c_int32, c_size_t, c_uint64, c_void_p
from pathlib import Path
from threading import Thread

import numpy as np
import pytest

import fork1s

BUILT = Path(__file__).resolve().parents[2] / "build" / "release" / "src" / "c" / "libfork1s_c.so"
LIBRARY = Path(os.environ.get("FORK1S_C_LIBRARY", BUILT))
pytestmark = pytest.mark.skipif(not LIBRARY.exists(), reason=f"no {LIBRARY}: build the target fork1s_c")

HOLD, MOVE = 0, 1
USAGE = 6


class CError(RuntimeError):
    """A call that failed, with its status."""

    def __init__(self, status: int, message: str) -> None:
        super().__init__(message)
        self.status = status


class Library:
    """Functions of libfork1s_c without their prefix; a status other than 0 raises CError."""

    def __init__(self) -> None:
        self._library = ctypes.CDLL(str(LIBRARY))
        self._library.fork1s_last_error.restype = c_char_p

    def __getattr__(self, name: str):
        function = getattr(self._library, "fork1s_" + name)

        def call(*arguments):
            status = function(*arguments)
            if status != 0:
                raise CError(status, self._library.fork1s_last_error().decode())

        return call


@pytest.fixture(scope="module")
def c() -> Library:
    return Library()


class Simulation:
    """A simulation in C of a scene of the repository."""

    def __init__(self, c: Library, path: Path, load: bytes | None = None, run: bytes | None = None) -> None:
        self.c, self.handle = c, c_void_p()
        model = c_void_p()
        c.model_load(os.fsencode(path), load, byref(model))
        c.simulation_create(model, run, byref(self.handle))
        c._library.fork1s_model_free(model)

    def __del__(self) -> None:
        if self.handle:
            self.c._library.fork1s_simulation_free(self.handle)

    def number(self, name: str, kind=c_int32):
        value = kind()
        getattr(self.c, "simulation_" + name)(self.handle, byref(value))
        return value.value

    def array(self, name: str, length: int) -> np.ndarray:
        values = np.full(length, np.nan)
        getattr(self.c, "simulation_" + name)(
            self.handle, values.ctypes.data_as(POINTER(c_double)), c_size_t(length)
        )
        return values

    def set_controls(self, values: np.ndarray) -> None:
        self.c.simulation_set_controls(
            self.handle, values.ctypes.data_as(POINTER(c_double)), c_size_t(len(values))
        )

    def step(self, steps: int, controls: int = HOLD) -> None:
        self.c.simulation_step(self.handle, c_int32(steps), c_int32(controls), None)

    @property
    def hash(self) -> int:
        return self.number("hash", c_uint64)


def test_hand_steps_as_in_python(c: Library, scenes: Path) -> None:
    sim = fork1s.Simulation(fork1s.load(scenes / "hand.xml", keyframe="open"), dt=0.01)
    in_c = Simulation(c, scenes / "hand.xml", b'{"keyframe": "open"}', b'{"dt": 0.01}')
    assert in_c.number("num_controls") == len(sim.control_values)
    assert in_c.number("num_bodies") == len(sim.bodies)
    for k in range(6):
        target = sim.control_values + 0.05 * (k + 1)
        sim.control_values = target
        in_c.set_controls(target)
        move = k % 2 == 1
        sim.step(5, move=move)
        in_c.step(5, MOVE if move else HOLD)
        assert in_c.hash == sim.hash()
    np.testing.assert_array_equal(in_c.array("poses", 7 * len(sim.bodies)), sim.poses.ravel())
    np.testing.assert_array_equal(in_c.array("velocities", 6 * len(sim.bodies)), sim.velocities.ravel())
    np.testing.assert_array_equal(in_c.array("controls", len(sim.control_values)), sim.control_values)
    assert in_c.number("time", c_double) == sim.time


def test_joint_state_and_reset_as_in_python(c: Library, scenes: Path) -> None:
    sim = fork1s.Simulation(fork1s.load(scenes / "fourbar_gripper.xml"))
    in_c = Simulation(c, scenes / "fourbar_gripper.xml")
    start = in_c.hash
    nq, nv = len(sim.qpos), len(sim.qvel)
    assert (in_c.number("num_joint_positions"), in_c.number("num_joint_velocities")) == (nq, nv)
    qpos, qvel = sim.qpos, sim.qvel
    qpos[sim.joints["left_crank"]["qpos"]] += 0.05
    qvel[-1] = 0.2
    sim.set_state(qpos, qvel)
    c.simulation_set_joint_state(
        in_c.handle,
        qpos.ctypes.data_as(POINTER(c_double)),
        c_size_t(nq),
        qvel.ctypes.data_as(POINTER(c_double)),
        c_size_t(nv),
    )
    assert in_c.number("state_change", c_double) == sim.state_change > 0
    sim.step(10)
    in_c.step(10)
    assert in_c.hash == sim.hash()
    np.testing.assert_array_equal(in_c.array("joint_positions", nq), sim.qpos)
    np.testing.assert_array_equal(in_c.array("joint_velocities", nv), sim.qvel)
    assert in_c.number("num_contacts") == len(sim.contacts)
    c.simulation_reset(in_c.handle)
    assert in_c.hash == start


def test_friction_uses_as_in_python(c: Library, scenes: Path) -> None:
    sim = fork1s.Simulation(fork1s.load(scenes / "fourbar_gripper.xml"))
    in_c = Simulation(c, scenes / "fourbar_gripper.xml")
    sim.control_values = np.full(2, 0.4)
    in_c.set_controls(np.full(2, 0.4))
    sim.step(60)
    in_c.step(60)
    uses = in_c.array("friction_uses", in_c.number("num_contacts"))
    assert len(uses) > 0
    assert uses.max() > 0
    np.testing.assert_array_equal(uses, sim.contacts["friction_use"])
    with pytest.raises(CError, match=f"uses has length 0 and needs {len(uses)}"):
        in_c.array("friction_uses", 0)


class RayHit(ctypes.Structure):
    """fork1s_ray_hit."""

    _fields_ = (
        ("body", c_int32),
        ("distance", c_double),
        ("point", c_double * 3),
        ("normal", c_double * 3),
    )


def test_rays_meet_bodies_as_in_python(c: Library, scenes: Path) -> None:
    sim = fork1s.Simulation(fork1s.load(scenes / "fourbar_gripper.xml"))
    in_c = Simulation(c, scenes / "fourbar_gripper.xml")

    def ray(origin: list[float], direction: list[float], reach: float) -> RayHit | None:
        found, hit = c_int32(-1), RayHit()
        triple = c_double * 3
        c.simulation_ray(
            in_c.handle, triple(*origin), triple(*direction), c_double(reach), byref(found), byref(hit)
        )
        return hit if found.value else None

    for origin, direction, body in (
        ([0, 0, 0.05], [0, 0, -3], "cube"),
        ([0.2, 0, 0.5], [0, 0, -1], "world"),
        ([-1, 0, 0.1], [1, 0, 0], "left_"),
    ):
        ours, theirs = sim.ray(origin, direction), ray(origin, direction, np.inf)
        assert ours is not None
        assert theirs is not None
        assert ours.body.startswith(body)
        assert ours.body == ("world" if theirs.body < 0 else sim.bodies[theirs.body])
        assert theirs.distance == ours.distance
        np.testing.assert_array_equal(theirs.point, ours.point)
        np.testing.assert_array_equal(theirs.normal, ours.normal)
    assert ray([0, 0, 0.05], [0, 0, -1], 0.01) is None
    with pytest.raises(CError, match="direction must not be zero"):
        ray([0, 0, 0], [0, 0, 0], 1)


def test_two_threads_step_two_simulations(c: Library, scenes: Path) -> None:
    sims = [Simulation(c, scenes / "fourbar_gripper.xml") for _ in range(3)]

    def grasp(sim: Simulation) -> None:
        sim.set_controls(np.array([0.4, 0.4]))
        for _ in range(30):
            sim.step(2)

    threads = [Thread(target=grasp, args=(sim,)) for sim in sims[:2]]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    grasp(sims[2])
    assert sims[0].hash == sims[1].hash == sims[2].hash


def test_errors_are_those_of_python(c: Library, scenes: Path, tmp_path: Path) -> None:
    bad = tmp_path / "bad.xml"
    bad.write_text("<mujoco><worldbody><body></worldbody></mujoco>")
    for path in (bad, tmp_path / "none.xml"):
        with pytest.raises(fork1s.Error) as ours:
            fork1s.load(path, in_process=True)
        with pytest.raises(CError) as theirs:
            Simulation(c, path)
        assert str(theirs.value) == "fork1s_model_load: " + str(ours.value)
    sim = Simulation(c, scenes / "two_link_arm.xml")
    with pytest.raises(CError, match="poses has length 3 and needs") as error:
        sim.array("poses", 3)
    assert error.value.status == USAGE


def test_reader_of_its_own_reads_the_same(c: Library, scenes: Path) -> None:
    program = Path(fork1s.__file__).parent / "bin" / "fork1s"
    options = b'{"reader": "%s"}' % os.fsencode(program)
    assert Simulation(c, scenes / "hand.xml", options).hash == Simulation(c, scenes / "hand.xml").hash
    with pytest.raises(CError, match=r"was not read within 1e-06 s; .* \(option 'read_time'\)"):
        Simulation(c, scenes / "hand.xml", options[:-1] + b', "read_time": 1e-6}')
