"""Motion against closed forms; what the arrays mean."""

import collections.abc

import numpy as np
import pytest
from numpy.testing import assert_allclose

import fork1s

BALL = """<mujoco><worldbody>
  <body name="ball" pos="0 0 5"><freejoint/><geom size=".1" mass="2"/></body>
</worldbody></mujoco>"""

BOX = """<mujoco><worldbody>
  <geom type="plane" size="1 1 1"/>
  <body name="box" pos="0 0 .05"><freejoint/><geom type="box" size=".1 .1 .05" mass="2"/></body>
</worldbody></mujoco>"""

SLIDER = """<mujoco><option gravity="0 0 0"/><worldbody>
  <body name="cart"><joint name="slide" type="slide" axis="1 0 0" stiffness="50" damping="3"/>
  <geom size=".1" mass="2" contype="0" conaffinity="0"/></body>
</worldbody></mujoco>"""


def test_free_fall():
    sim = fork1s.Simulation(fork1s.load(BALL), dt=0.01)
    report = sim.step(50)
    assert report.steps == 50 and report.finite and report.contacts == 0
    # A free body's origin moves by the mean of the velocities before and after a step: the parabola itself.
    assert_allclose(sim.poses[0], [0, 0, 5 - 9.81 * 0.5**2 / 2, 1, 0, 0, 0], atol=1e-12)
    assert_allclose(sim.velocities[0], [0, 0, 0, 0, 0, -9.81 * 0.5], atol=1e-12)
    assert sim.time == pytest.approx(0.5) and sim.steps == 50 and sim.dt == 0.01
    assert_allclose(sim.pose("ball"), [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, sim.poses[0, 2]], [0, 0, 0, 1]])


def test_implicit_spring_and_push():
    sim = fork1s.Simulation(fork1s.load(SLIDER, interface="cart"), dt=0.02, integrator="euler")
    x = v = 0.0
    for n in range(40):
        force = 7.0 if n < 25 else 0.0
        if n == 0:
            sim.push("cart", force=[7, 0, 0])
            sim.step(25)
        elif n >= 25:
            sim.step()
        # (m + h c + h² k) v⁺ = m v + h (f - k x)
        v = (2 * v + 0.02 * (force - 50 * x)) / (2 + 0.02 * 3 + 0.02**2 * 50)
        x += 0.02 * v
    assert_allclose(sim.qpos, [x], rtol=1e-10)
    assert_allclose(sim.qvel, [v], rtol=1e-10)
    assert sim.coordinates == ["slide"]
    assert sim.kinetic_energy == pytest.approx(v * v) and sim.potential_energy == pytest.approx(25 * x * x)


def test_push_at_a_point_moves_with_the_body():
    sim = fork1s.Simulation(fork1s.load(BALL), dt=0.001)
    sim.push("ball", force=[0, 0, 2 * 9.81], torque=[0, 0, 0])
    sim.push("ball", force=[0, 0, 0.01], point=[0.1, 0, 5])
    sim.step()
    inertia = 0.4 * 2 * 0.1**2
    assert_allclose(sim.velocities[0], [0, -0.001 * 0.01 * 0.1 / inertia, 0, 0, 0, 0.001 * 0.005], atol=1e-12)
    before = sim.velocities[0].copy()
    sim.step()  # a push is for one call
    assert_allclose(sim.velocities[0] - before, [0, 0, 0, 0, 0, -0.00981], atol=1e-9)


def test_contacts_carry_the_weight():
    sim = fork1s.Simulation(fork1s.load(BOX))
    report = sim.step(120)
    contacts = sim.contacts
    assert contacts.dtype == fork1s.CONTACT and len(contacts) == report.contacts == 4
    weight = contacts["force"].sum(axis=0)
    assert_allclose(weight, [0, 0, 2 * 9.81], atol=19.62e-4)  # the contact solver's tolerance
    box = sim.bodies.index("box")
    assert_allclose(contacts["bodies"], [[-1, box]] * 4)
    assert_allclose(contacts["normal"], [[0, 0, 1]] * 4, atol=1e-6)
    assert_allclose(np.abs(contacts["point"][:, :2]), 0.1, atol=1e-6)
    moment = np.cross(contacts["point"] - sim.poses[box, :3], contacts["force"]).sum(axis=0)
    assert_allclose(moment, 0, atol=1e-4)


def test_no_contacts_are_an_empty_array(arm):
    contacts = fork1s.Simulation(arm).contacts
    assert contacts.dtype == fork1s.CONTACT and contacts.shape == (0,)
    assert contacts["force"].shape == (0, 3)


def test_controls_are_a_mapping(gripper):
    sim = fork1s.Simulation(gripper)
    assert list(sim.controls) == ["left_grip", "right_grip"] == list(sim.controls.keys())
    sim.controls["left_grip"] = 0.25
    assert sim.controls["left_grip"] == 0.25 and "left_grip" in sim.controls and "x" not in sim.controls
    sim.controls["right_grip"] = 9.0
    assert sim.controls["right_grip"] == 0.5  # its limit
    sim.controls.update({"left_grip": 0.1, "right_grip": -0.1})
    assert dict(sim.controls.items()) == {"left_grip": 0.1, "right_grip": -0.1}
    assert list(sim.controls.values()) == [0.1, -0.1]
    assert sim.controls.get("left_grip") == 0.1
    assert sim.controls.get("thumb") is None and sim.controls.get("thumb", 2) == 2
    assert_allclose(sim.control_values, [0.1, -0.1])
    sim.control_values = [0.2, 0.3]
    assert_allclose(sim.control_values, [0.2, 0.3])
    assert len(sim.controls) == 2 and isinstance(sim.controls, collections.abc.Mapping)


def test_a_gripper_holds(gripper):
    sim = fork1s.Simulation(gripper)
    sim.controls.update({"left_grip": 0.5, "right_grip": 0.5})
    sim.step(60)
    cube = sim.bodies.index("cube")
    pads = [c for c in sim.contacts if cube in c["bodies"] and -1 not in c["bodies"]]
    assert len(pads) >= 2
    assert sim.joint_gap < 1e-4


def test_driven_base(hand):
    sim = fork1s.Simulation(hand)
    start = sim.pose("palm")[:3, 3]
    for step in range(60):
        sim.controls["palm.z"] = 0.05 * (step + 1) / 60
        sim.step()
    assert_allclose(sim.pose("palm")[:3, 3] - start, [0, 0, 0.05], atol=1e-9)


def test_arrays_are_of_the_moment():
    sim = fork1s.Simulation(fork1s.load(BALL))
    before = sim.poses
    kept = before.copy()
    sim.step(10)
    assert_allclose(before, kept)
    before[:] = 0  # the caller's own
    assert sim.poses[0, 2] > 4


def test_detail_while_it_runs(gripper):
    sim = fork1s.Simulation(gripper)
    sim.step(5)
    before = sim.poses
    sim.set_detail("all", modes=0)
    assert_allclose(sim.poses, before, atol=1e-9)
    sim.step(5)
    with pytest.raises(fork1s.ModelError, match="holds nothing at present"):
        fork1s.Simulation(gripper).set_detail("object")


def test_recovery(scenes):
    """A sheet that catches a load, loops closed and closed to second order; summed screws are for drawing alone."""
    ends = {}
    for recovery in ("exact", "curved", "twist"):
        sim = fork1s.Simulation(fork1s.load(scenes / "firemen.xml"), dt=1 / 60, recovery=recovery)
        sim.step(60)
        ends[recovery] = sim.pose("sheet")[:3, 3]
    off = {r: np.linalg.norm(ends[r] - ends["exact"]) for r in ends}
    assert 0 < off["curved"] < 1e-3
    assert off["twist"] < 1e-6


def test_keyframe(scenes):
    model = fork1s.load(scenes / "hand.xml")
    opened = fork1s.Simulation(model, keyframe="open")
    assert_allclose(opened.qpos[1], 0.9076)
    with pytest.raises(fork1s.UnknownNameError, match="there is no keyframe 'shut'; there are: open"):
        fork1s.Simulation(model, keyframe="shut")


def test_same_bits_again(hand):
    hashes = set()
    for _ in range(2):
        sim = fork1s.Simulation(hand)
        sim.step(100)
        hashes.add(sim.hash())
    assert len(hashes) == 1


def test_rays_meet_bodies(gripper):
    sim = fork1s.Simulation(gripper)
    hit = sim.ray([0, 0, 0.05], [0, 0, -3])
    assert hit.body == "cube"
    assert_allclose([hit.distance, *hit.point, *hit.normal], [0.05 - 0.024, 0, 0, 0.024, 0, 0, 1], atol=1e-9)
    assert sim.ray([0.2, 0, 0.5], [0, 0, -1]).body == "world"
    # A bar touches nothing and is seen all the same.
    assert sim.ray([-1, 0, 0.1], [1, 0, 0]).body.startswith("left_")
    assert sim.ray([0, 0, 0.05], [0, 0, -1], reach=0.01) is None and sim.ray([0, 0, 1], [0, 0, 1]) is None
    with pytest.raises(ValueError, match="direction must not be zero"):
        sim.ray([0, 0, 0], [0, 0, 0])


def test_gains_change_while_it_runs(gripper):
    sim = fork1s.Simulation(gripper, dt=1 / 60)
    sim.controls.update({"left_grip": 0.4, "right_grip": 0.4})
    sim.step(60)

    def pressed():
        return np.abs(sim.contacts["force"][:, 0]).max()

    before, pose, time = pressed(), sim.pose("cube"), sim.time
    sim.set_stiffness(
        {
            "left_crank": 2 * gripper.stiffnesses["left_crank"],
            "right_crank": 2 * gripper.stiffnesses["right_crank"],
        }
    )
    assert_allclose(sim.pose("cube"), pose, atol=1e-9)
    assert sim.time == time and sim.controls["left_grip"] == 0.4
    sim.step(60)
    assert (
        1.6 < pressed() / before < 2.1
    )  # the servos press twice as hard, flexures of the rockers do not help
    sim.set_state(poses={"cube": [0.2, 0, 0.012]})
    sim.step(1)
    with pytest.raises(
        fork1s.UnknownNameError, match="no joint coordinate, tendon or servo of a tendon 'knee'"
    ):
        sim.set_stiffness({"knee": 1})


def test_contacts_have_their_friction_use():
    """A block that is pulled at half the friction cone, then slides."""
    block = """<mujoco><worldbody><geom type="plane" size="1 1 1" friction="0.5"/>
      <body name="block" pos="0 0 0.1"><freejoint/><geom type="box" size="0.1 0.1 0.1" mass="2" friction="0.5"/></body>
      </worldbody></mujoco>"""
    sim = fork1s.Simulation(fork1s.load(block))
    for force, share in [(2 * 9.81 * 0.25, 0.5), (2 * 9.81, 1.0)]:
        for _ in range(20):
            sim.push("block", force=[force, 0, 0], point=[*sim.pose("block")[:2, 3], 0])
            sim.step()
        contacts = sim.contacts
        along = contacts["force"] @ [0, 0, 1]
        tangential = np.linalg.norm(contacts["force"][:, :2], axis=1)
        assert_allclose(contacts["friction_use"], tangential / (0.5 * np.abs(along)), rtol=1e-12)
        weighted = np.average(contacts["friction_use"], weights=np.abs(along))
        assert weighted == pytest.approx(share, rel=1e-3)  # the solver's tolerance of the force


def test_heavy_load_on_a_light_stack_is_held():
    # 100 kg on five boxes of 1 g: each contact tells a part of what presses on it.
    boxes = "".join(
        f'<body pos="0 0 {0.02 + 0.04 * i}"><freejoint/><geom type="box" size=".02 .02 .02" mass=".001"/></body>'
        for i in range(5)
    )
    model = fork1s.load(f"""<mujoco><worldbody><geom type="plane" size="5 5 .1"/>{boxes}
      <body name="load" pos="0 0 .3"><joint type="slide" axis="0 0 1"/>
      <geom type="box" size=".1 .1 .1" mass="100"/></body></worldbody></mujoco>""")
    for dt in (1 / 60, 1 / 500):
        sim = fork1s.Simulation(model, dt=dt)
        start = sim.pose("load")[2, 3]
        sim.step(round(0.2 / dt))
        assert (
            start - sim.pose("load")[2, 3] < 0.2e-3
        )  # m: six contacts of 10 um, and what they give until the load is known


@pytest.mark.parametrize("steps", [1, 2, 4])
def test_plates_that_jump_hold_a_ball(steps):
    plate = '<geom mass="{}" type="box" size=".001 .15 .15"/>'
    sim = fork1s.Simulation(
        fork1s.load(f"""<mujoco><option gravity="0 0 0"/><worldbody>
          <body name="left" pos="-.1 0 0"><joint name="l" type="slide" axis="1 0 0" damping="1e4"/>{plate.format(0.02)}</body>
          <body name="right" pos=".1 0 0"><joint name="r" type="slide" axis="1 0 0" damping="1e4"/>{plate.format(0.05)}</body>
          <body name="ball" pos=".013 0 0"><freejoint/><geom mass=".01" type="sphere" size=".004"/></body></worldbody>
          <actuator><position name="left" joint="l" kp="1e6"/><position name="right" joint="r" kp="1e6"/></actuator>
          </mujoco>"""),
        dt=1 / 30 / steps,
    )
    sim.controls.update({"left": 0.3, "right": -0.5})
    sim.step(steps)
    left, ball, right = (sim.pose(name)[0, 3] for name in ("left", "ball", "right"))
    assert left < ball < right


def test_stiffness_of_a_tendons_servo_is_that_of_the_file():
    def finger(kp, kv):
        return fork1s.load(
            f"""<mujoco><compiler angle="radian"/><option gravity="0 0 0"/><worldbody><body><joint name="a" axis="0 1 0"/>
            <geom size=".1" contype="0"/><body pos=".5 0 0"><joint name="b" axis="0 1 0" stiffness="1" damping="1"/>
            <geom size=".1" contype="0"/></body></body></worldbody>
            <tendon><fixed name="t"><joint joint="a" coef="1"/><joint joint="b" coef="2"/></fixed></tendon>
            <actuator><position name="grip" tendon="t" kp="{kp}" kv="{kv}" forcerange="-3 3"/></actuator></mujoco>"""
        )

    soft, stiff = finger(10, 0.5), finger(40, 1)
    assert soft.stiffnesses["grip"] == 10
    set_while_it_runs = fork1s.Simulation(soft)
    set_while_it_runs.set_stiffness({"grip": 40})
    runs = [
        set_while_it_runs,
        fork1s.Simulation(soft.with_stiffness({"grip": 40})),
        fork1s.Simulation(stiff),
    ]
    for sim in runs:
        sim.controls["grip"] = 0.5
        sim.step(30)
        assert_allclose(sim.qpos, runs[0].qpos, rtol=0, atol=1e-12)
    with pytest.raises(fork1s.UsageError, match="above 0"):
        runs[0].set_stiffness({"grip": 0})
    with pytest.raises(fork1s.UnknownNameError, match="a, b, grip"):
        runs[0].set_stiffness({"gripper": 1})
