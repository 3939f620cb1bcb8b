"""Deflections against closed forms."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

import fork1s


def test_linear_is_compliance_times_load(arm):
    answer = fork1s.statics(arm, "forearm", [0, 3, 0], torque=[0, 0, 2])
    moved = arm.compliance("forearm") @ [0, 0, 2, 0, 3, 0]
    assert_allclose(answer.linear.position - answer.reference, moved[3:], atol=1e-14)
    assert_allclose(answer.linear.rotation, moved[:3], atol=1e-14)


def test_nonlinear_under_a_dead_load(arm):
    # A force F along y on the elbow, 1 m from the shoulder: k θ = F cos θ.
    k, force = 100.0, 60.0
    turn = 0.0
    for _ in range(50):
        turn -= (k * turn - force * np.cos(turn)) / (k + force * np.sin(turn))
    answer = fork1s.statics(arm, "forearm", [0, force, 0])
    assert_allclose(answer.moved, [np.cos(turn) - 1, np.sin(turn), 0], atol=1e-10)
    assert_allclose(answer.nonlinear.rotation, [0, 0, turn], atol=1e-10)
    assert answer.stable and answer.nonlinear.max_joint_rotation == pytest.approx(turn)


def test_behind_a_free_joint():
    model = fork1s.load("""<mujoco><option gravity="0 0 0"/><worldbody>
      <body><joint name="a" axis="0 0 1" stiffness="20"/><geom size=".01" mass="1"/>
      <body pos=".1 0 0"><joint name="b" axis="0 0 1"/><geom size=".01" mass="1"/>
      <body name="tip" pos=".1 0 0"><joint name="c" axis="0 0 1" stiffness="50"/><geom size=".01" mass="1"/></body>
      </body></body></worldbody></mujoco>""")
    with pytest.raises(fork1s.UnderdeterminedError, match="joint 'b'"):
        fork1s.statics(model, "tip", [0, 40, 0])
    answer = fork1s.statics(model, "tip", [0, 40, 0], lock_free=True)
    assert answer.locked == ["b"]
    turn = 0.0  # with b locked an arm of 0.2 m on a: 20 θ = 40 · 0.2 cos θ
    for _ in range(50):
        turn -= (20 * turn - 8 * np.cos(turn)) / (20 + 8 * np.sin(turn))
    assert_allclose(answer.linear.position, [0.2, 0.2 * 8 / 20, 0], atol=1e-12)
    assert_allclose(answer.nonlinear.position, [0.2 * np.cos(turn), 0.2 * np.sin(turn), 0], atol=1e-10)
    assert answer.stable


def test_gravity_can_be_another(arm):
    # Gravity along x bends both joints; the arm's own weight turns the shoulder by the weight of the forearm's lever.
    down = fork1s.statics(arm, "forearm", gravity=[0, 0, -9.81])
    assert_allclose(down.moved, 0, atol=1e-12)  # the joints' axes are vertical
    along = fork1s.statics(arm, "forearm", gravity=[0, -1, 0])
    # Linear: moments of 1 N each at 0.5 m and 1 m about the shoulder, none about the elbow.
    assert_allclose(along.linear.rotation, [0, 0, -1.5 / 100], rtol=1e-9)


def test_refusals(arm, scenes):
    with pytest.raises(
        fork1s.ModelError, match=r"two_link_arm.xml: no mechanism has a body 'x'; there are: world"
    ):
        fork1s.statics(arm, "x")
    with pytest.raises(ValueError, match=r"force must be 3 numbers, not an array of shape \(2,\)"):
        fork1s.statics(arm, "forearm", [1, 2])
    with pytest.raises(ValueError, match="force must be finite, and entry 1 is"):
        fork1s.statics(arm, "forearm", [1, float("nan"), 2])
