"""Stiffness at points of bodies, without and under load, against closed forms and differences of statics."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import fork1s

G = 9.81


def mast(k, mass, height, aside=0.0):
    """A point mass on a massless mast, hinged about y."""
    return fork1s.load(f"""<mujoco><option gravity="{aside} 0 {-G}"/>
      <custom><text name="fork1s_interface" data="mast"/></custom><worldbody>
      <body name="mast"><joint name="foot" axis="0 1 0" stiffness="{k}"/>
        <inertial pos="0 0 {height}" mass="{mass}" diaginertia="1e-3 1e-3 1e-3"/></body>
      </worldbody></mujoco>""")


def lean(ratio, aside):
    """ratio θ = sin θ + aside/g cos θ by bisection: one root between 0 and π."""
    low, high = 0.0, np.pi
    for _ in range(100):
        turn = 0.5 * (low + high)
        if ratio * turn < np.sin(turn) + aside / G * np.cos(turn):
            low = turn
        else:
            high = turn
    return low


@pytest.mark.parametrize("top", [0.5, 1.0, 1.6])
def test_mast_has_that_of_its_spring_less_that_of_its_weight(top):
    k, mass, height = 40.0, 2.4, 1.0
    model = mast(k, mass, height)
    for ask in (model.point_stiffness, model.mechanisms[0].point_stiffness):
        answer = ask("mast", [0, 0, top])
        softened = k - mass * G * height
        assert answer.springs.along([1, 0, 0]) == pytest.approx(k / top**2, rel=1e-9)
        assert answer.loaded.along([-2, 0, 0]) == pytest.approx(softened / top**2, rel=1e-7)
        assert answer.loaded.along([1, 0, 1]) == pytest.approx(2 * softened / top**2, rel=1e-7)
        assert_allclose(answer.loaded.along_axes, [softened / top**2, np.inf, np.inf], rtol=1e-7)
        assert_allclose(answer.springs.compliance[3, 3], top**2 / k, rtol=1e-9)
        assert answer.springs.stiffness is None  # rigid along y
        assert answer.springs.free == answer.loaded.free == answer.locked == []
        inertia = 1e-3 + mass * height**2
        assert_allclose(answer.springs.frequencies, [np.sqrt(k / inertia) / (2 * np.pi)], rtol=1e-9)
        assert_allclose(answer.loaded.frequencies, [np.sqrt(softened / inertia) / (2 * np.pi)], rtol=1e-7)
        assert answer.loaded.stable
        assert (answer.body, list(answer.point), list(answer.reference)) == ("mast", [0, 0, top], [0, 0, top])
    without = model.point_stiffness("mast", [0, 0, top], gravity=[0, 0, 0])
    assert without.loaded.along([1, 0, 0]) == pytest.approx(k / top**2, rel=1e-7)
    assert np.isinf(model.point_stiffness("mast").springs.along([1, 0, 0]))  # the foot


@pytest.mark.parametrize("aside", [0.05, -0.05, 1.0])
def test_mast_past_its_buckling_load_has_that_of_its_leaning_pose(aside):
    mass, height, ratio = 1.0, 0.5, 0.9
    mgl = mass * G * height
    turn = lean(ratio, abs(aside))
    left = mgl * (ratio - np.cos(turn) + abs(aside) / G * np.sin(turn))
    model = mast(ratio * mgl, mass, height, aside)
    answer = model.point_stiffness("mast", [0, 0, height])
    assert answer.loaded.stable
    lever = height * np.cos(turn)
    assert answer.loaded.along([1, 0, 0]) == pytest.approx(left / lever**2, rel=1e-6)
    still = fork1s.statics(model, "mast", point=[0, 0, height])
    assert still.stable and still.limit_shares.size == 0
    assert_allclose(
        still.nonlinear.position,
        height * np.array([np.copysign(np.sin(turn), aside), 0, np.cos(turn)]),
        atol=1e-9,
    )
    [loaded] = still.points
    assert loaded.loaded.along([1, 0, 0]) == pytest.approx(answer.loaded.along([1, 0, 0]), rel=1e-6)
    assert_allclose(still.frequencies, answer.loaded.frequencies, rtol=1e-7)
    assert_allclose(still.spring_frequencies, model.frequencies, rtol=1e-12)


def test_cantilever_chain():
    links, length, k = 7, 0.1, 3.0
    body = ""
    for i in reversed(range(links)):
        at = 0 if i == 0 else length
        body = f"""<body name="link{i + 1}" pos="{at} 0 0"><joint name="j{i + 1}" axis="0 0 1" stiffness="{k}"/>
          <geom type="capsule" fromto="0 0 0 {length} 0 0" size=".005" mass=".05"/>{body}</body>"""
    model = fork1s.load(f"""<mujoco><option gravity="0 0 0"/>
      <custom><text name="fork1s_interface" data="link{links}"/></custom>
      <worldbody>{body}</worldbody></mujoco>""")
    tip = (f"link{links}", [length, 0, 0])
    inside = ("link3", [0.02, 0.01, 0])
    answer = model.point_stiffness(*tip)
    levers = length * np.arange(1, links + 1)
    assert answer.springs.along([0, 1, 0]) == pytest.approx(k / np.sum(levers**2), rel=1e-9)
    assert answer.loaded.along([0, 1, 0]) == pytest.approx(k / np.sum(levers**2), rel=1e-6)
    assert np.isinf(answer.springs.along([1, 0, 0])) and np.isinf(answer.springs.along([0, 0, 1]))

    # Under load: by differences of the position that statics finds.
    force = np.array([0.0, 8.0, 0.0])
    bent = fork1s.statics(model, tip[0], force, point=tip[1], points=[inside])
    assert bent.nonlinear.max_joint_rotation > 0.5
    assert [(p.body, list(p.point)) for p in bent.points] == [(b, list(p)) for b, p in (tip, inside)]
    h = 1e-4
    slope = np.empty((3, 2))
    for column, direction in enumerate(np.eye(3)[:2]):
        ahead, behind = (
            fork1s.statics(model, tip[0], force + sign * h * direction, point=tip[1]).nonlinear.position
            for sign in (1, -1)
        )
        slope[:, column] = (ahead - behind) / (2 * h)
    C = bent.points[0].loaded.compliance
    assert_allclose(C[3:, 3:5], slope, atol=1e-6 * np.abs(slope).max())
    assert bent.points[0].loaded.along([0, 2, 0]) == pytest.approx(1 / slope[1, 1], rel=1e-5)
    x = np.array([0.02, 0.12, 0.22])  # levers of link3's point on the first three joints, along y
    assert bent.points[1].springs.along([0, 1, 0]) == pytest.approx(k / np.sum(x**2), rel=1e-9)


def test_a_taut_bead_is_held_across_its_cables_by_their_tension_alone():
    k, tension, half = 2000.0, 200.0, 0.5
    rest = half - tension / k
    cables = "".join(
        f'<spatial name="{side}" stiffness="{k}" springlength="{rest}">'
        f'<site site="{side}"/><site site="bead"/></spatial>'
        for side in ("left", "right")
    )
    model = fork1s.load(f"""<mujoco><option gravity="0 0 0"/>
      <custom><text name="fork1s_interface" data="bead"/></custom><worldbody>
      <site name="left" pos="{-half} 0 0"/><site name="right" pos="{half} 0 0"/>
      <body name="bead"><joint name="x" type="slide" axis="1 0 0"/><joint name="z" type="slide" axis="0 0 1"/>
        <site name="bead"/><geom size=".02" mass=".5"/></body></worldbody>
      <tendon>{cables}</tendon></mujoco>""")
    answer = model.point_stiffness("bead")
    assert answer.springs.along([1, 0, 0]) == pytest.approx(2 * k, rel=1e-9)
    assert answer.springs.along([0, 0, 1]) == 0
    assert "'z'" in " ".join(answer.springs.free) and answer.springs.compliance is None
    assert answer.loaded.along([1, 0, 0]) == pytest.approx(2 * k, rel=1e-6)
    assert answer.loaded.along([0, 0, 1]) == pytest.approx(2 * tension / half, rel=1e-6)
    assert answer.loaded.free == []
    across = np.sqrt(2 * tension / half / 0.5) / (2 * np.pi)
    assert_allclose(answer.loaded.frequencies, [across, np.sqrt(2 * k / 0.5) / (2 * np.pi)], rtol=1e-6)


WHEEL = """<mujoco><option gravity="0 0 {g}"/>
  <custom><text name="fork1s_interface" data="wheel"/></custom><worldbody>
  <body name="strut"><joint name="travel" type="slide" axis="0 0 1" stiffness="50"/><geom size=".1" mass="1"/>
  <body name="wheel"><joint name="axle" axis="0 0 1"/><geom size=".1" mass="1"/></body></body></worldbody></mujoco>"""


def test_behind_a_free_joint_the_point_is_free_and_the_joint_named():
    model = fork1s.load(WHEEL.format(g=0))
    with pytest.raises(fork1s.UnderdeterminedError, match="'axle'"):
        model.compliance("wheel")
    rim = model.point_stiffness("wheel", [0.2, 0, 0.1])
    for stiffness in (rim.springs, rim.loaded):
        assert_allclose(stiffness.along_axes, [np.inf, 0, 50], rtol=1e-7)
        assert stiffness.compliance is None
        assert "'axle'" in " ".join(stiffness.free)
    hub = model.point_stiffness("wheel")
    assert hub.springs.free == [] and hub.springs.along([0, 0, 1]) == pytest.approx(50)
    locked = model.point_stiffness("wheel", [0.2, 0, 0.1], lock_free=True)
    assert locked.locked == ["axle"] and locked.springs.free == locked.loaded.free == []
    for stiffness in (locked.springs, locked.loaded):
        assert_allclose(stiffness.along_axes, [np.inf, np.inf, 50], rtol=1e-7)
        assert_allclose(stiffness.compliance[5, 5], 1 / 50, rtol=1e-7)


def test_no_equilibrium_is_said_where_it_is_asked_for():
    falling = fork1s.load("""<mujoco><custom><text name="fork1s_interface" data="b"/></custom><worldbody>
      <body name="a"><joint name="j" axis="0 0 1" stiffness="2"/><geom size=".1" mass="1"/>
      <body name="b" pos=".1 0 0"><joint name="fall" type="slide" axis="0 0 1"/><geom size=".1" mass="1"/></body></body>
      </worldbody></mujoco>""")
    answer = falling.point_stiffness("b")
    assert answer.springs.along([0, 1, 0]) == pytest.approx(2 / 0.1**2)
    with pytest.raises(fork1s.NumericsError, match="no equilibrium under gravity"):
        answer.loaded


def test_refusals(arm):
    with pytest.raises(fork1s.UnknownNameError, match="'x'; there are: .*forearm"):
        arm.point_stiffness("x")
    with pytest.raises(fork1s.UnknownNameError, match="'x'; there are: .*forearm"):
        arm.mechanisms[0].point_stiffness("x")
    with pytest.raises(ValueError, match="point must be 3 numbers"):
        arm.point_stiffness("forearm", [1, 2])
    with pytest.raises(ValueError, match="gravity must be finite"):
        arm.point_stiffness("forearm", gravity=[0, 0, float("nan")])
    with pytest.raises(fork1s.UsageError, match="direction: .*length is 0"):
        arm.point_stiffness("forearm").springs.along([0, 0, 0])
    with pytest.raises(fork1s.ModelError, match="body 'y' is not of mechanism"):
        fork1s.statics(arm, "forearm", points=[("y", [0, 0, 0])])
    with pytest.raises(TypeError, match=r"points must be a sequence of pairs \(body, point\)"):
        fork1s.statics(arm, "forearm", points=3)
