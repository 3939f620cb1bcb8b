"""Linearisation of a step: a regulator through contact, closed forms, refusals."""

import re
from pathlib import Path

import numpy as np
import pytest

import fork1s

PAGE = Path(__file__).resolve().parents[2] / "docs" / "linearize.md"
SPRING = """
<mujoco>
  <option gravity="0 0 0" timestep="0.01"/>
  <worldbody>
    <body name="mass">
      <joint name="x" type="slide" axis="1 0 0" stiffness="50" damping="0.4"/>
      <geom type="sphere" size="0.1" mass="2"/>
    </body>
  </worldbody>
  <actuator><motor name="push" joint="x" gear="3"/></actuator>
</mujoco>
"""


def test_page_holds_the_pole_and_the_cube():
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(), flags=re.DOTALL)
    page = {}
    exec(compile("\n".join(blocks), str(PAGE), "exec"), page)
    # Without the regulator a tenth of a second of 2 N ends it within a second.
    assert abs(page["angle"]) < 1e-3
    assert page["sim"].pose("cube")[2, 3] == pytest.approx(0.5, abs=2e-3)
    assert np.abs(np.linalg.eigvals(page["step"].A)).max() > 1.05  # the pole alone falls
    assert page["step"].switches == []
    # Rail of 100 N/m, pole of 5 N·m/rad with an arm of 0.45 m, servo of 2000 N/m.
    assert page["gain"][page["moved"], page["push"]] == pytest.approx(
        1 / 100 + 0.45**2 / 5 + 1 / 2000, rel=1e-9
    )


def test_of_a_spring_is_the_matrix_of_the_scheme():
    sim = fork1s.Simulation(fork1s.load(SPRING), dt=0.01)
    step = sim.linearize(outputs=["mass"])
    assert step.coordinates == ["x"] and step.inputs == ["push"] and step.dt == 0.01
    gamma = 1 - np.sqrt(0.5)
    Z = 0.01 * np.array([[0, 1, 0], [-25, -0.2, 1.5], [0, 0, 0]])
    one = np.eye(3)
    stage = np.linalg.inv(one - gamma * Z)
    whole = stage @ stage @ (one + (1 - 2 * gamma) * Z)
    # Changes of 1e-6, of which rounding leaves 1e-15 of a length, in rates over a stage of 0.3 of the step.
    units = np.array([1, 0.01])
    scaled = (step.A - whole[:2, :2]) * units[:, None] / units
    assert np.abs(scaled).max() < 1e-6
    assert np.abs((step.B - whole[:2, 2:]) * units[:, None]).max() < 1e-6
    assert step.C.shape == (6, 2)
    np.testing.assert_allclose(step.C[:, 0], [0, 0, 0, 1, 0, 0], atol=1e-9)
    assert step.outputs[3] == "mass.x"
    before = sim.hash()
    sim.linearize()
    assert sim.hash() == before
    sim.set_state(qpos=[0.02], qvel=[-0.3])
    np.testing.assert_allclose(step.deviation(sim), [0.02, -0.3], atol=1e-12)


def test_what_is_refused_says_why():
    sim = fork1s.Simulation(fork1s.load(SPRING))
    with pytest.raises(fork1s.UnknownNameError, match="mas"):
        sim.linearize(outputs=["mas"])
    with pytest.raises(fork1s.UsageError, match="change = 0"):
        sim.linearize(change=0)
    with pytest.raises(TypeError, match="outputs"):
        sim.linearize(outputs=3)
    step = sim.linearize()
    body = '<body pos="1 0 0"><joint name="y" type="slide" axis="0 1 0"/><geom size="0.1"/></body>'
    other = fork1s.Simulation(fork1s.load(SPRING.replace("<worldbody>", "<worldbody>" + body)))
    with pytest.raises(fork1s.UsageError, match="another model"):
        step.deviation(other)
