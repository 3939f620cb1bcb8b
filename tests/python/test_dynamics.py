"""Mass matrix, Jacobians and forces in the velocities of the file, beside MuJoCo's at random states."""

import mujoco
import numpy as np
import pytest
from conftest import SCENES
from numpy.testing import assert_allclose
from test_file_state import EVERYTHING, data_at, random_state

import fork1s

ACTUATED = EVERYTHING.replace(
    "</worldbody>",
    """</worldbody><actuator>
      <motor name="swing" joint="swing" gear="2" ctrlrange="-30 30"/>
      <position name="lift" joint="lift" kp="200" kv="3" forcerange="-40 40"/>
      <general name="hip" joint="hip" gainprm="4" biastype="affine" biasprm="0.5 -6 -0.1"/>
    </actuator>""",
)


@pytest.fixture(scope="module")
def theirs():
    return mujoco.MjModel.from_xml_string(ACTUATED)


@pytest.fixture
def sim():
    return fork1s.Simulation(fork1s.load(ACTUATED))


def full_mass_matrix(model, data):
    """MuJoCo's, column by column."""
    M = np.zeros((model.nv, model.nv))
    column = np.zeros(model.nv)
    for i in range(model.nv):
        mujoco.mj_mulM(model, data, column, np.eye(model.nv)[i])
        M[:, i] = column
    return M


@pytest.mark.parametrize("seed", range(5))
def test_the_mass_matrix_is_that_of_mujoco(sim, theirs, seed):
    qpos, qvel = random_state(theirs, seed)
    sim.set_state(qpos, qvel)
    data = data_at(theirs, qpos, qvel)
    M = sim.mass_matrix
    assert_allclose(M, full_mass_matrix(theirs, data), atol=1e-9)
    assert_allclose(qvel @ M @ qvel / 2, sim.kinetic_energy, rtol=1e-9)
    assert len(sim.velocity_names) == theirs.nv
    assert sim.velocity_names[:6] == ["swing", "lift", "wrist.rx", "wrist.ry", "wrist.rz", "cube.x"]
    assert sim.velocity_names[8:13] == ["cube.rx", "cube.ry", "cube.rz", "root.x", "root.y"]


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("body", ["arm", "wrist", "cube", "trunk", "foot"])
def test_jacobians_are_those_of_mujoco(sim, theirs, seed, body):
    qpos, qvel = random_state(theirs, seed)
    sim.set_state(qpos, qvel)
    data = data_at(theirs, qpos, qvel)
    point = np.random.default_rng(seed).normal(size=3)
    index = theirs.body(body).id
    turn, move = np.zeros((3, theirs.nv)), np.zeros((3, theirs.nv))
    mujoco.mj_jac(theirs, data, move, turn, data.xpos[index] + data.xmat[index].reshape(3, 3) @ point, index)
    J = sim.jacobian(body, point)
    assert_allclose(J, np.vstack([turn, move]), atol=1e-9)
    assert_allclose(sim.jacobian(body) @ qvel, sim.velocities[sim.bodies.index(body)], atol=1e-9)


@pytest.mark.parametrize("seed", range(3))
def test_forces_are_those_of_mujoco(sim, theirs, seed):
    qpos, _ = random_state(theirs, seed)
    sim.set_state(qpos, np.zeros(theirs.nv))
    controls = {"swing": 3.0, "lift": 0.05, "hip": -0.4}
    sim.controls.update(controls)
    data = mujoco.MjData(theirs)
    data.qpos[:] = qpos
    for name, value in controls.items():
        data.ctrl[theirs.actuator(name).id] = value
    mujoco.mj_forward(theirs, data)
    assert_allclose(sim.gravity_forces, -data.qfrc_bias, atol=1e-9)
    assert_allclose(sim.spring_and_control_forces, data.qfrc_spring + data.qfrc_actuator, atol=1e-9)


def test_actuator_forces_are_those_of_mujoco(sim, theirs):
    qpos, qvel = random_state(theirs, 6)
    sim.set_state(qpos, qvel)
    data = data_at(theirs, qpos, qvel)
    forces = sim.actuator_forces
    assert list(forces) == ["swing", "lift", "hip"]
    assert_allclose([float(forces[name]) for name in forces], data.actuator_force, atol=1e-9)
    assert [float(force) for force in forces.values()] == [float(f) for _, f in forces.items()]
    assert forces["hip"].shape == () and forces["hip"] == forces.array[2]
    with pytest.raises(fork1s.UnknownNameError, match="there is no actuator 'hop'"):
        forces["hop"]
    model = fork1s.load(ACTUATED)
    softer = fork1s.Simulation(model.with_stiffness({"hip": 22}))  # twice the spring and the servo, 5 + 6
    softer.set_state(qpos, qvel * 0)
    at = data.qpos[softer.joints["hip"]["qpos"]][0]
    assert softer.actuator_forces["hip"] == pytest.approx(2 * (0.5 - 6 * at), rel=1e-9)


ARM = """<mujoco><worldbody><body name="upper" pos="0 0 1"><joint name="a" axis="0 1 0" stiffness="2" springref="10"/>
  <geom type="capsule" fromto="0 0 0 0.4 0 0" size="0.02" mass="1"/><body name="lower" pos="0.4 0 0">
    <joint name="b" axis="0 1 0"/><geom type="capsule" fromto="0 0 0 0.3 0 0" size="0.02" mass="0.5"/></body></body>
  </worldbody><actuator><motor name="a" joint="a" gear="3" ctrlrange="-5 5"/><position name="b" joint="b" kp="20"/></actuator></mujoco>"""


def test_controls_hold_a_posture():
    sim = fork1s.Simulation(fork1s.load(ARM), dt=1e-3)
    sim.set_state([-0.7, 1.1])
    held, residual = sim.holding_controls()
    assert_allclose(residual, 0, atol=1e-9)
    # Inverse dynamics of MuJoCo at rest: the torque that the joints need, less their springs.
    model = mujoco.MjModel.from_xml_string(ARM)
    data = mujoco.MjData(model)
    data.qpos[:] = [-0.7, 1.1]
    mujoco.mj_inverse(model, data)
    assert held["a"] == pytest.approx(data.qfrc_inverse[0] / 3, rel=1e-9)
    assert held["b"] == pytest.approx(1.1 + data.qfrc_inverse[1] / 20, rel=1e-9)
    sim.controls.update(held)
    sim.step(500)
    assert_allclose(sim.qpos, [-0.7, 1.1], atol=1e-6)


def test_what_cannot_be_held_is_said():
    sim = fork1s.Simulation(fork1s.load(ARM.replace("-5 5", "-0.1 0.1")))
    held, residual = sim.holding_controls()
    assert abs(held["a"]) == 0.1
    # At the reference: weights at 0.2 m, and 0.55 m of the joint, the spring turned by -10°.
    needed = 9.81 * (1 * 0.2 + 0.5 * 0.55) + 2 * np.radians(10)
    assert_allclose(residual, [needed - 0.3, 0], atol=1e-9)


def test_loops_carry_what_they_can(gripper):
    sim = fork1s.Simulation(gripper)
    sim.set_state(joints={"left_crank": 0.2, "right_crank": 0.3})
    held, residual = sim.holding_controls()
    of_cube = np.zeros(len(residual), dtype=bool)
    of_cube[-6:] = True  # the free joint of the cube comes last
    assert_allclose(residual[~of_cube], 0, atol=1e-9)
    before = sim.qpos[: residual.size - 6]
    sim.set_state(poses={"cube": [5, 5, 5]})
    sim.controls.update(held)
    sim.step(60)
    assert_allclose(sim.qpos[: residual.size - 6], before, atol=1e-6)


def test_controls_with_dynamics_push_by_their_activations():
    xml = ARM.replace('<motor name="a"', '<general name="a" dyntype="filterexact" dynprm="0.2" gainprm="1"')
    sim = fork1s.Simulation(fork1s.load(xml))
    assert sim.activations == {"a": 0.0}
    sim.controls["a"] = 2.0
    sim.step(6)
    assert sim.activations["a"] == pytest.approx(2 * (1 - np.exp(-6 * sim.dt / 0.2)), rel=1e-12)
    model = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(model)
    data.qpos[:] = sim.qpos
    data.ctrl[:] = list(sim.controls.values())
    data.act[:] = sim.activations["a"]
    mujoco.mj_forward(model, data)
    assert_allclose(sim.spring_and_control_forces, data.qfrc_actuator + data.qfrc_spring, rtol=1e-9)


def test_misuse_is_refused(sim):
    with pytest.raises(fork1s.UnknownNameError, match="no body 'hand'; there are: world, arm"):
        sim.jacobian("hand")
    with pytest.raises(ValueError, match="point must be 3 numbers"):
        sim.jacobian("arm", [1, 2])


@pytest.mark.parametrize("name", sorted(path.stem for path in SCENES.glob("*.xml")))
def test_scenes_are_those_of_mujoco(name):
    """Robots with loops, tendons and mocap bases, where they start."""
    model = mujoco.MjModel.from_xml_path(str(SCENES / f"{name}.xml"))
    sim = fork1s.Simulation(fork1s.load(SCENES / f"{name}.xml"))
    data = mujoco.MjData(model)
    data.qpos[:] = sim.qpos
    mujoco.mj_forward(model, data)
    M = full_mass_matrix(model, data)
    assert_allclose(sim.mass_matrix, M, atol=1e-9 * np.abs(M).max())
    for body in sim.bodies[1:]:
        index = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, body)
        turn, move = np.zeros((3, model.nv)), np.zeros((3, model.nv))
        mujoco.mj_jacBody(model, data, move, turn, index)
        assert_allclose(sim.jacobian(body), np.vstack([turn, move]), atol=1e-9)
    assert_allclose(
        sim.gravity_forces, data.qfrc_gravcomp - data.qfrc_bias, atol=1e-9 * np.abs(M).max() * 9.81
    )
