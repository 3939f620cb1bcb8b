"""qpos and qvel in the order and by the conventions of the file: MuJoCo's own kinematics finds the same bodies there."""

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import fork1s

# Every kind of joint; displacements count from a reference that is not 0; free bodies stand between the trees.
EVERYTHING = """<mujoco>
  <compiler angle="radian"/>
  <worldbody>
    <body name="arm" pos="0 0 1" quat="0.8 0.6 0 0">
      <joint name="swing" axis="0 1 1" pos="0.1 0 0" ref="0.4" stiffness="3"/>
      <joint name="lift" type="slide" axis="1 2 0" ref="-0.1" stiffness="50"/>
      <geom size="0.1 0.05 0.02" type="box" mass="1.3" contype="0" conaffinity="0"/>
      <body name="wrist" pos="0.3 0 0" quat="0.6 0 0.8 0">
        <joint name="wrist" type="ball" pos="0 0.02 0" stiffness="2"/>
        <geom size="0.05 0.1 0.07" type="box" pos="0.1 0 0" mass="0.7" contype="0" conaffinity="0"/>
      </body>
    </body>
    <body name="cube" pos="3 0 1" quat="0 1 0 0">
      <freejoint name="cube"/>
      <geom size="0.1 0.2 0.3" type="box" pos="0.02 0 0" mass="0.4" contype="0" conaffinity="0"/>
    </body>
    <body name="trunk" pos="0 4 1" quat="0.5 0.5 0.5 0.5">
      <freejoint name="root"/>
      <geom size="0.3 0.2 0.1" type="box" mass="4" contype="0" conaffinity="0"/>
      <body name="leg" pos="0.3 0 0">
        <joint name="hip" axis="0 1 0" ref="0.2" stiffness="5" armature="0.01"/>
        <geom size="0.03 0.03 0.2" type="box" pos="0 0 -0.2" mass="0.5" contype="0" conaffinity="0"/>
        <body name="foot" pos="0 0 -0.4">
          <joint name="ankle" type="ball" stiffness="1" armature="0.002"/>
          <geom size="0.08 0.04 0.02" type="box" pos="0.03 0 0" mass="0.2" contype="0" conaffinity="0"/>
        </body>
      </body>
    </body>
  </worldbody>
</mujoco>"""


@pytest.fixture(scope="module")
def theirs():
    return mujoco.MjModel.from_xml_string(EVERYTHING)


@pytest.fixture
def sim():
    return fork1s.Simulation(fork1s.load(EVERYTHING))


def random_state(model, seed):
    """Positions with rotations of up to 1.5 rad, velocities of about 1."""
    rng = np.random.default_rng(seed)
    qpos = model.qpos0.copy()
    mujoco.mj_integratePos(model, qpos, rng.uniform(-0.8, 0.8, model.nv), 1)
    return qpos, rng.normal(size=model.nv)


def data_at(model, qpos, qvel):
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:] = qpos, qvel
    mujoco.mj_forward(model, data)
    return data


def same_rotations(qpos, model):
    """With the quaternion of each joint that has w >= 0."""
    qpos = qpos.copy()
    for joint in range(model.njnt):
        first = model.jnt_qposadr[joint] + {0: 3, 1: 0}.get(int(model.jnt_type[joint]), -1)
        if model.jnt_type[joint] <= 1 and qpos[first] < 0:
            qpos[first : first + 4] *= -1
    return qpos


def assert_at(sim, model, data):
    for name, pose, velocity in zip(sim.bodies, sim.poses, sim.velocities):
        body = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
        twist = np.zeros(6)
        mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_XBODY, body, twist, 0)
        assert_allclose(pose[:3], data.xpos[body], atol=1e-9)
        assert_allclose(pose[3:] * np.sign(pose[3:] @ data.xquat[body]), data.xquat[body], atol=1e-9)
        assert_allclose(velocity, twist, atol=1e-9)


@pytest.mark.parametrize("seed", range(5))
def test_bodies_are_where_mujoco_has_them(sim, theirs, seed):
    qpos, qvel = random_state(theirs, seed)
    sim.qpos = qpos
    sim.qvel = qvel
    assert_at(sim, theirs, data_at(theirs, qpos, qvel))
    assert_allclose(sim.qpos, same_rotations(qpos, theirs), atol=1e-9)
    assert_allclose(sim.qvel, qvel, atol=1e-9)
    assert sim.state_change < 1e-12 and sim.time == 0


def test_the_reference_is_that_of_the_file(sim, theirs):
    assert_allclose(sim.qpos, same_rotations(theirs.qpos0, theirs), atol=1e-12)
    assert_array_equal(sim.qvel, np.zeros(theirs.nv))
    assert_array_equal(sim.joint_displacements, np.zeros(len(sim.coordinates)))


def test_a_file_is_read_in_another_process(tmp_path, theirs):
    file = tmp_path / "everything.xml"
    file.write_text(EVERYTHING)
    sim = fork1s.Simulation(fork1s.load(file))
    qpos, _ = random_state(theirs, 9)
    sim.qpos = qpos
    assert_allclose(sim.qpos, same_rotations(qpos, theirs), atol=1e-9)


def test_keyframes_are_states(theirs):
    qpos, qvel = random_state(theirs, 3)
    numbers = " ".join(map(repr, map(float, qpos))), " ".join(map(repr, map(float, qvel)))
    key = f'<keyframe><key name="k" qpos="{numbers[0]}" qvel="{numbers[1]}"/></keyframe></mujoco>'
    sim = fork1s.Simulation(fork1s.load(EVERYTHING.replace("</mujoco>", key), keyframe="k"))
    assert_allclose(sim.qpos, same_rotations(qpos, theirs), atol=1e-9)
    assert_allclose(sim.qvel, qvel, atol=1e-9)


def test_joints_have_slices(sim, theirs):
    assert list(sim.joints) == [theirs.joint(i).name for i in range(theirs.njnt)]
    assert [j["kind"] for j in sim.joints.values()] == [
        "hinge", "slide", "ball", "free", "free", "hinge", "ball",
    ]  # fmt: skip
    for name, joint in sim.joints.items():
        at = theirs.joint(name)
        assert joint["qpos"] == slice(at.qposadr[0], at.qposadr[0] + len(at.qpos0))
        assert joint["qvel"].start == at.dofadr[0]
    assert sim.joints["ankle"]["qvel"].stop == theirs.nv


def test_joints_are_set_by_name(sim, theirs):
    qpos, qvel = random_state(theirs, 1)
    sim.set_state(qpos, qvel)
    turn = np.array([0.8, 0, 0, -0.6])
    free = [0.1, 0.2, 2, 0.6, 0, 0.8, 0]
    sim.set_state(
        joints={
            "swing": 0.7,
            "ankle": turn,
            "root": free,
            "cube": 2 * np.array([1.0, 1, 1, 0.5, 0.5, 0.5, 0.5]),
        },
        joint_velocities={"hip": -2, "ankle": [1, 2, 3], "root": [1, 0, 0, 0, 0, 1]},
    )
    for name, value in {"swing": 0.7, "ankle": turn, "root": free}.items():
        qpos[sim.joints[name]["qpos"]] = value
    qpos[sim.joints["cube"]["qpos"]] = [2, 2, 2, 0.5, 0.5, 0.5, 0.5]
    for name, value in {"hip": -2, "ankle": [1, 2, 3], "root": [1, 0, 0, 0, 0, 1]}.items():
        qvel[sim.joints[name]["qvel"]] = value
    assert_allclose(sim.qpos, same_rotations(qpos, theirs), atol=1e-9)
    assert_allclose(sim.qvel, qvel, atol=1e-9)
    assert_at(sim, theirs, data_at(theirs, qpos, qvel))


def test_what_is_not_given_stays(sim, theirs):
    qpos, qvel = random_state(theirs, 2)
    sim.set_state(qpos, qvel)
    sim.qpos = theirs.qpos0
    assert_allclose(sim.qvel, qvel, atol=1e-9)  # the numbers, as MuJoCo's
    sim.set_state(theirs.qpos0, poses={"trunk": [5, 6, 7]})
    assert_allclose(sim.pose("trunk")[:3, 3], [5, 6, 7])
    assert_allclose(sim.qpos[sim.joints["hip"]["qpos"]], 0.2)


def test_it_steps_on_from_there(sim, theirs):
    qpos, qvel = random_state(theirs, 4)
    sim.qpos = qpos
    sim.qvel = qvel
    cube = sim.joints["cube"]["qpos"]
    sim.step(6)
    assert sim.time == pytest.approx(0.1)
    # Its centre of mass falls freely, and is 0.02 m from the origin of the body.
    assert_allclose(
        sim.qpos[cube][2], qpos[cube][2] + 0.1 * qvel[sim.joints["cube"]["qvel"]][2] - 0.04905, atol=0.01
    )


def test_numbers_that_cannot_be_are_refused(sim):
    before = sim.hash()
    for qpos, error, message in [
        ([0, 1], ValueError, "qpos must be 25 numbers"),
        ("abc", TypeError, "qpos must be an array of real numbers"),
        (np.zeros(25), fork1s.UsageError, "qpos of joint 'wrist': has a quaternion of length 0"),
        (np.full(25, np.nan), ValueError, "qpos must be finite"),
    ]:
        with pytest.raises(error, match=message):
            sim.qpos = qpos
    with pytest.raises(fork1s.UnknownNameError, match="no joint that moves 'hop'; there are: swing, lift"):
        sim.set_state(joints={"hop": 1})
    with pytest.raises(ValueError, match=r"joints\['wrist'\] must be 4 numbers"):
        sim.set_state(joints={"wrist": [1, 0, 0]})
    with pytest.raises(TypeError, match="joints must be a mapping"):
        sim.set_state(joints=[1])
    assert sim.hash() == before


def test_a_base_that_an_option_fixes_has_no_numbers():
    sim = fork1s.Simulation(fork1s.load(EVERYTHING, base="fixed"))
    assert list(sim.joints) == ["swing", "lift", "wrist", "cube", "hip", "ankle"]
    with pytest.raises(fork1s.UnknownNameError, match="no joint that moves 'root'"):
        sim.set_state(joints={"root": [0, 0, 0, 1, 0, 0, 0]})


def test_a_floating_urdf_has_a_base():
    urdf = """<robot name="r"><link name="trunk"><inertial><mass value="2"/>
        <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
      <link name="leg"><inertial><mass value="1"/>
        <inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial></link>
      <joint name="hip" type="continuous"><parent link="trunk"/><child link="leg"/><axis xyz="0 1 0"/></joint></robot>"""
    sim = fork1s.Simulation(fork1s.load(urdf, base="floating", base_pose=[0, 0, 2], pd=(1, 0.1)))
    base, hip = sim.joints
    assert hip == "hip" and sim.joints[base]["kind"] == "free"
    assert_allclose(sim.qpos, [0, 0, 2, 1, 0, 0, 0, 0], atol=1e-12)
    sim.qpos = [1, 2, 3, 0, 1, 0, 0, 0.3]
    assert_allclose(sim.pose("trunk")[:3], [[1, 0, 0, 1], [0, -1, 0, 2], [0, 0, -1, 3]], atol=1e-12)


def test_loops_are_closed(gripper):
    sim = fork1s.Simulation(gripper)
    crank = sim.joints["left_crank"]["qpos"]
    sim.set_state(joints={"left_crank": 0.3})
    assert sim.joint_gap < 1e-9 and sim.qpos[crank] == pytest.approx(0.3, abs=1e-9)
    assert sim.state_change < 1e-6
    closed = sim.qpos
    opened = closed.copy()
    opened[crank] += 0.05
    sim.qpos = opened
    assert sim.joint_gap < 1e-9
    changed = np.abs(sim.qpos - opened)
    assert sim.state_change == pytest.approx(changed.max(), abs=1e-9) and 0.01 < sim.state_change < 0.05
    cranks = [name for name in sim.joints if name.startswith("left")]
    with pytest.raises(fork1s.UsageError, match="the loops and couplings of mechanism .* stay open"):
        sim.set_state(joints={name: 0.8 * (i + 1) for i, name in enumerate(cranks)})


def test_members_of_a_batch_have_them(theirs):
    model = fork1s.load(EVERYTHING)
    batch = fork1s.Batch(model, 3, stiffness=[1, 2, 3])
    batch.step(steps=3)
    alone = fork1s.Simulation(model)
    alone.step(3)
    assert batch.qpos.shape == (3, theirs.nq) and batch.qvel.shape == (3, theirs.nv)
    assert_array_equal(batch.qpos[0], alone.qpos)
    assert_array_equal(batch.qvel[0], alone.qvel)
    assert_array_equal(batch.joint_displacements[0], alone.joint_displacements)
    assert_array_equal(batch.joint_rates[0], alone.joint_rates)
