"""Equations of motion to first order: closed forms, statics, energy, and files that NumPy reads."""

import json
import os
import subprocess
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import fork1s

SIX = ["rx", "ry", "rz", "x", "y", "z"]
SIX_OF_MOTION = ["rad"] * 3 + ["m"] * 3
SIX_OF_WRENCH = ["N m"] * 3 + ["N"] * 3
# A base turned in space, of two legs with springs; its own keyframe turns it otherwise.
FLOATING = """
<mujoco>
  <option gravity="0 0 0"/>
  <custom><text name="fork1s_interface" data="foot"/></custom>
  <worldbody>
    <body name="trunk" pos="0.1 0.2 0.5" quat="0.8 0.2 -0.4 0.4">
      <freejoint/>
      <geom type="box" size="0.1 0.06 0.04" mass="2" contype="0" conaffinity="0"/>
      <body name="leg" pos="0.1 0.02 0">
        <joint name="hip" axis="0 1 0" stiffness="3"/>
        <geom type="capsule" fromto="0 0 0 0.02 0 -0.2" size="0.02" mass="0.4" contype="0" conaffinity="0"/>
        <body name="foot" pos="0.02 0 -0.2">
          <joint name="knee" type="slide" axis="0 0 1" stiffness="400"/>
          <geom type="box" size="0.02 0.03 0.02" mass="0.2"/>
        </body>
      </body>
    </body>
  </worldbody>
  <keyframe><key name="over" qpos="0 0 1 0.5 0.5 -0.5 0.5 0 0"/></keyframe>
</mujoco>
"""


def program():
    return Path(fork1s.__file__).parent / "bin" / "fork1s"


def reduce(*arguments):
    return subprocess.run([program(), "reduce", *map(str, arguments)], capture_output=True, text=True)


def check_names_and_shapes(mechanism):
    linear = mechanism.linear_model()
    s, bodies = linear.M.shape[0], linear.interfaces
    base = [f"{mechanism.bodies[0]}.{i}" for i in SIX] if mechanism.base == "floating" else []
    assert bodies == mechanism.interfaces and linear.joints == mechanism.coordinates
    assert linear.coordinates == [*mechanism.matrices.column_names, *base]
    assert linear.coordinate_units == ["1"] * (s - len(base)) + SIX_OF_MOTION[: len(base)]
    of_bodies = [f"{body}.{i}" for body in bodies for i in SIX]
    assert linear.inputs[-len(of_bodies) :] == of_bodies
    assert set(linear.inputs[: -len(of_bodies)]) == set(mechanism.controls)
    assert linear.input_units[-len(of_bodies) :] == SIX_OF_WRENCH * len(bodies)
    assert linear.outputs == of_bodies + linear.joints
    assert linear.output_units == SIX_OF_MOTION * len(bodies) + linear.joint_units
    m, l = len(linear.inputs), len(linear.outputs)
    assert len(linear.input_units) == m and len(linear.output_units) == l
    assert linear.M.shape == linear.D.shape == linear.K.shape == (s, s)
    assert linear.B.shape == (s, m) and linear.C.shape == (l, s)
    assert (
        linear.f.shape == (s,) and linear.u_ref.shape == (m,) and linear.q_ref.shape == (len(linear.joints),)
    )
    assert linear.X_WB_ref.shape == (len(bodies), 4, 4)
    assert_allclose(linear.M, linear.M.T, rtol=0, atol=1e-14 * np.abs(linear.M).max())
    space = mechanism.state_space()
    assert space.states == [*linear.coordinates, *("rate of " + name for name in linear.coordinates)]
    assert space.state_units == [*linear.coordinate_units, *(unit + "/s" for unit in linear.coordinate_units)]
    assert (space.inputs, space.outputs) == (linear.inputs, linear.outputs)
    assert (space.input_units, space.output_units) == (linear.input_units, linear.output_units)
    assert space.A.shape == (2 * s, 2 * s) and space.B.shape == (2 * s, m)
    assert space.C.shape == (l, 2 * s) and space.D.shape == (l, m) and not space.D.any()
    # What is solved there, put in again.
    accelerations = space.A @ np.eye(2 * s)[:, : s + 1]
    assert_allclose(linear.M @ accelerations[s:, :s], -linear.K, atol=1e-9 * max(1, np.abs(linear.K).max()))
    assert_allclose(linear.M @ space.c[s:], linear.f, atol=1e-9 * max(1e-9, np.abs(linear.f).max()))


@pytest.mark.parametrize("name", ["two_link_arm", "fourbar_gripper", "quadruped", "hand", "beam_walkers"])
def test_names_units_and_shapes(scenes, name):
    for mechanism in fork1s.load(scenes / f"{name}.xml").mechanisms:
        check_names_and_shapes(mechanism)


def frequencies_of(M, K):
    """Of the undamped motion, those of motions that nothing resists left out."""
    squares = np.sort(np.linalg.eigvals(np.linalg.solve(M, K)).real)
    # Rounding leaves 1e-15 of the largest.
    return np.sqrt(squares[squares > 1e-9 * squares[-1]]) / (2 * np.pi)


@pytest.mark.parametrize("name", ["two_link_arm", "fourbar_gripper", "quadruped"])
def test_frequencies_are_those_of_the_reduced_model(scenes, name):
    model = fork1s.load(scenes / f"{name}.xml")
    linear = model.linear_model()
    count = len(model.reduced_frequencies)
    assert_allclose(frequencies_of(linear.M, linear.K)[:count], model.reduced_frequencies, rtol=1e-9)


def test_two_link_arm_in_closed_form(arm):
    """scenes/two_link_arm.xml: 7.5693 and 19.8168 rad/s without the dampers; the masses by hand."""
    linear = arm.linear_model()
    assert_allclose(2 * np.pi * frequencies_of(linear.M, linear.K), [7.5693, 19.8168], rtol=1e-5)
    # In joint angles, elbow at a right angle: 1/3 + (1 + 1/3) and 1/3, both coupled by 1/3.
    J = linear.C[6:]
    inverse = np.linalg.inv(J)
    assert_allclose(inverse.T @ linear.M @ inverse, [[5 / 3, 1 / 3], [1 / 3, 1 / 3]], rtol=1e-12)
    assert_allclose(inverse.T @ linear.K @ inverse, np.diag([100, 100]), atol=1e-9)
    assert_allclose(inverse.T @ linear.D @ inverse, np.eye(2), atol=1e-11)
    assert_allclose(linear.X_WB_ref[0][:3, 3], [1, 0, 0.5], atol=1e-12)
    # A force along y on the elbow turns the shoulder by 1 m, one along x by nothing.
    y = linear.inputs.index("forearm.y")
    assert_allclose(inverse.T @ linear.B[:, y], [1, 0], atol=1e-12)
    assert_allclose(linear.B[:, linear.inputs.index("forearm.x")], 0, atol=1e-12)
    assert_allclose(linear.f, 0, atol=1e-12)  # weight is across the axes


@pytest.mark.parametrize("name", ["two_link_arm", "fourbar_gripper"])
def test_static_gain_is_the_compliance(scenes, name):
    model = fork1s.load(scenes / f"{name}.xml")
    space = model.state_space()
    gain = space.C @ np.linalg.solve(-space.A, space.B)
    size = 6 * len(model.interfaces)
    C = model.compliance()
    assert_allclose(gain[:size, -size:], C, rtol=0, atol=1e-9 * np.abs(C).max())
    at = model.point_stiffness(model.interfaces[0]).springs.compliance
    assert_allclose(gain[:6, -size:][:, :6], at, rtol=0, atol=1e-9 * np.abs(at).max())


def test_static_gain_of_controls():
    """A servo of 2 N·m/rad beside a spring of 3: two fifths of the set-point; a motor of gear 4 against both."""
    model = fork1s.load("""<mujoco><option gravity="0 0 -9.81"/>
      <custom><text name="fork1s_interface" data="arm"/></custom><worldbody>
      <body name="arm"><joint name="a" axis="0 1 0" stiffness="3"/><geom type="sphere" size="0.05" pos="0.3 0 0" mass="0.5"/>
      </body></worldbody><actuator><position name="servo" joint="a" kp="2"/><motor name="motor" joint="a" gear="4"/>
      </actuator></mujoco>""")
    linear, space = model.linear_model(), model.state_space()
    assert space.inputs[:2] == ["servo", "motor"] and space.input_units[:2] == ["rad", "unit of the actuator"]
    gain = space.C @ np.linalg.solve(-space.A, space.B)
    assert_allclose(gain[space.outputs.index("a"), :2], [2 / 5, 4 / 5], rtol=1e-12)
    # Weight: 0.5 kg at 0.3 m turns it by 9.81 · 0.15 / 5.
    rest = space.C @ np.linalg.solve(-space.A, space.c)
    assert_allclose(rest[space.outputs.index("a")], 9.81 * 0.15 / 5, rtol=1e-12)
    assert_allclose(linear.C @ np.linalg.solve(linear.K, linear.f), rest, atol=1e-12)


def test_static_gain_of_servos_through_loops(gripper):
    """Servos of 2 N·m/rad on the cranks: what `response` has per moment there."""
    space = gripper.state_space()
    gain = space.C @ np.linalg.solve(-space.A, space.B)
    response = gripper.response()
    for side in ["left", "right"]:
        per_moment = response[:, gripper.coordinates.index(f"{side}_crank")]
        expected = 2 * per_moment
        assert_allclose(
            gain[:12, space.inputs.index(f"{side}_grip")], expected, atol=1e-9 * np.abs(expected).max()
        )


def test_several_mechanisms_are_asked_one_by_one(scenes):
    walkers = fork1s.load(scenes / "beam_walkers.xml")
    for ask in (walkers.linear_model, walkers.state_space):
        with pytest.raises(fork1s.ModelError, match="mechanisms; ask one of them"):
            ask()


@pytest.mark.parametrize("keyframe", [None, "over"])
def test_floating_base_obeys_newton_in_world_axes(keyframe):
    model = fork1s.load(FLOATING.replace('gravity="0 0 0"', 'gravity="1 2 -9.81"'), keyframe=keyframe)
    linear = model.linear_model()
    r = linear.M.shape[0] - 6
    mass = 2.6
    # Moved as a whole: kinetic energy of the whole mass, and no spring feels it.
    assert_allclose(linear.M[-3:, -3:], mass * np.eye(3), atol=1e-12)
    assert not linear.K[r:].any() and not linear.D[r:].any()
    assert_allclose(linear.f[-3:], mass * np.array([1, 2, -9.81]), rtol=1e-12)
    # A rotation about the trunk's origin moves the foot as the cross product with its arm.
    sim = fork1s.Simulation(model)
    assert_allclose(linear.X_WB_ref[0], sim.pose("foot"), atol=1e-12)
    arm = sim.pose("foot")[:3, 3] - sim.pose("trunk")[:3, 3]
    assert_allclose(linear.C[3:6, r : r + 3], np.cross(np.eye(3), arm).T, atol=1e-12)
    assert_allclose(linear.C[:3, r : r + 3], np.eye(3), atol=1e-15)
    # Free fall: what weight does to the whole, the springs do not feel.
    acceleration = np.linalg.solve(linear.M, linear.f)
    assert_allclose(acceleration[-3:], [1, 2, -9.81], rtol=1e-9)
    assert_allclose(acceleration[:-3], 0, atol=1e-9)


def step_response(space, inputs, times):
    """Outputs of a system at rest under constant inputs, by the exponential of its augmented matrix."""
    n = space.A.shape[0]
    whole = np.zeros((n + 1, n + 1))
    whole[:n, :n], whole[:n, n] = space.A, space.B @ inputs
    h = times[1] - times[0]
    # Taylor series of a 64th of the step, to rounding, squared six times.
    term, one = np.eye(n + 1), np.eye(n + 1)
    for k in range(1, 20):
        term = term @ whole * (h / 64 / k)
        one = one + term
    for _ in range(6):
        one = one @ one
    x, outputs = np.eye(n + 1)[n], []
    for _ in times:
        outputs.append(space.C @ x[:n])
        x = one @ x
    return np.array(outputs)


def rotation_vector(R):
    """Of a small rotation, to third order."""
    return 0.5 * np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])


@pytest.mark.parametrize("which", ["two_link_arm", "fourbar_gripper", "floating"])
def test_step_response_is_that_of_the_simulation(scenes, which):
    if which == "floating":
        model, body = fork1s.load(FLOATING), "foot"
    else:
        text = (scenes / f"{which}.xml").read_text().replace("0 0 -9.81", "0 0 0")
        model = fork1s.load(text)
        body = model.interfaces[0]
    space, dt, steps = model.state_space(), 1 / 960, 240
    push = {"two_link_arm": [0, 0.02, 0], "fourbar_gripper": [0.002, 0, 0], "floating": [0.02, 0.01, 0.03]}[
        which
    ]
    sim = fork1s.Simulation(model, dt=dt)
    before = sim.pose(body)
    u = np.zeros(len(space.inputs))
    u[[space.inputs.index(f"{body}.{i}") for i in "xyz"]] = push
    told = step_response(space, u, dt * np.arange(steps + 1))
    rows = [space.outputs.index(f"{body}.{i}") for i in SIX]
    for i in range(1, steps + 1):
        sim.push(body, force=push)
        sim.step()
        if i % 20:
            continue
        X = sim.pose(body)
        moved = np.concatenate([rotation_vector(X[:3, :3] @ before[:3, :3].T), X[:3, 3] - before[:3, 3]])
        for part in (slice(0, 3), slice(3, 6)):
            size = np.abs(told[:, rows][: i + 1, part]).max()
            assert_allclose(moved[part], told[i, rows][part], rtol=0, atol=0.01 * size, err_msg=f"step {i}")


@pytest.mark.parametrize("name", ["two_link_arm", "fourbar_gripper", "quadruped"])
def test_npz_has_what_python_has(scenes, tmp_path, name):
    file = tmp_path / "model.npz"
    done = reduce("--json", "--out", file, scenes / f"{name}.xml")
    assert done.returncode == 0, done.stderr
    model = fork1s.load(scenes / f"{name}.xml")
    linear = model.linear_model()
    with np.load(file) as read:  # without pickles
        for matrix in ["M", "D", "K", "B", "C", "f", "u_ref", "q_ref", "X_WB_ref"]:
            np.testing.assert_array_equal(read[matrix], getattr(linear, matrix), err_msg=matrix)
        for signals in ["coordinate", "input", "output", "joint"]:
            assert list(read[f"{signals}_names"]) == getattr(linear, f"{signals}s")
            assert list(read[f"{signals}_units"]) == getattr(linear, f"{signals}_units")
        assert list(read["interfaces"]) == linear.interfaces
        assert list(read["mechanism"]) == [model.mechanisms[0].name]
        printed = json.loads(done.stdout)["frequencies_hz"]["reduced"]
        assert_allclose(frequencies_of(read["M"], read["K"])[: len(printed)], printed, rtol=1e-9)
    first = file.read_bytes()
    assert reduce("--out", file, scenes / f"{name}.xml").returncode == 0  # over its own file
    assert file.read_bytes() == first


def test_further_mechanisms_have_files_of_their_own(scenes, tmp_path):
    for ending in ["npz", "mat", "h5"]:
        assert reduce("--out", tmp_path / f"walkers.{ending}", scenes / "beam_walkers.xml").returncode == 0
        count = len(fork1s.load(scenes / "beam_walkers.xml").mechanisms)
        assert count > 1
        names = [f"walkers.{ending}", *(f"walkers.{i}.{ending}" for i in range(2, count + 1))]
        assert sorted(path.name for path in tmp_path.glob(f"*.{ending}")) == sorted(names)


def test_names_outside_of_ascii(tmp_path):
    model = tmp_path / "finger.xml"
    model.write_text(
        """<mujoco model="Greifer"><worldbody><body name="Ärmel 腕 𝛼"><joint name="größe" axis="0 1 0" stiffness="1"/>
        <geom type="sphere" size="0.1"/></body></worldbody></mujoco>""",
        encoding="utf-8",
    )
    assert reduce("--out", tmp_path / "a.npz", model).returncode == 0
    with np.load(tmp_path / "a.npz") as read:
        assert list(read["interfaces"]) == ["Ärmel 腕 𝛼"] and list(read["joint_names"]) == ["größe"]


@pytest.mark.parametrize("ending", ["npz", "mat"])
def test_what_cannot_be_written_is_refused(scenes, tmp_path, ending):
    arm = scenes / "two_link_arm.xml"
    nowhere = tmp_path / "no" / f"model.{ending}"
    done = reduce("--out", nowhere, arm)
    assert done.returncode == 3 and str(nowhere) in done.stderr
    assert "cannot be written (No such file or directory); check the folder" in done.stderr
    other = tmp_path / f"notes.{ending}"
    other.write_text("remember the milk\n")
    done = reduce("--out", other, arm)
    assert done.returncode == 3 and str(other) in done.stderr and "choose another name" in done.stderr
    assert other.read_text() == "remember the milk\n"
    folder = tmp_path / f"folder.{ending}"
    folder.mkdir()
    done = reduce("--out", folder, arm)
    assert done.returncode == 3 and "is a folder; name a file in it" in done.stderr
    if Path("/dev/full").exists():
        link = tmp_path / f"full.{ending}"
        os.symlink("/dev/full", link)
        done = reduce("--out", link, arm)
        assert done.returncode == 3 and "No space left on device" in done.stderr


def test_unknown_endings_are_refused(scenes, tmp_path):
    file = tmp_path / "model.csv"
    done = reduce("--out", file, scenes / "two_link_arm.xml")
    assert done.returncode == 3 and str(file) in done.stderr
    assert all(ending in done.stderr for ending in [".csv", ".h5", ".hdf5", ".mat", ".npz"])
    assert not file.exists()
