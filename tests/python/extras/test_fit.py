"""Stiffnesses for a wanted compliance: found where they exist, and said where they do not."""

import re
import runpy
import subprocess
import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose

import fork1s

pytest.importorskip("scipy", reason="pip install 'fork1s[sweep]'")


@pytest.fixture(scope="module")
def arm(scenes):
    return fork1s.load(scenes / "two_link_arm.xml")


def test_response_is_the_gradient(scenes):
    model = fork1s.load(scenes / "fourbar_gripper.xml", q={"left_crank": 0.2})
    y = dict(zip(model.coordinates, model.response("left_jaw").T))
    for joint, k in model.stiffnesses.items():
        step = 1e-4 * k
        plus, minus = (model.with_stiffness({joint: k + s}).compliance("left_jaw") for s in (step, -step))
        assert_allclose(
            (plus - minus) / (2 * step),
            -np.outer(y[joint], y[joint]),
            atol=1e-6 * (y[joint] @ y[joint]) + 1e-12,
        )


def test_closed_form(arm):
    # The forearm's origin is the elbow, 1 m from the shoulder: it shifts by 1 / k_shoulder and turns by both.
    target = np.full((6, 6), np.nan)
    target[4, 4], target[2, 2] = 1 / 40, 1 / 40 + 1 / 300
    fit = arm.fit_stiffness(target)
    assert fit.reached and not fit.at_bound and fit.error < 1e-8
    assert_allclose([fit.stiffness["shoulder"], fit.stiffness["elbow"]], [40, 300], rtol=1e-6)
    assert_allclose(fit.model.compliance("forearm")[2, 2], target[2, 2], rtol=1e-8)
    assert_allclose(fit.missed["forearm"][2, 2], 0, atol=1e-9)


@pytest.mark.parametrize("factor", [1.3, 1.05, 2, 0.7])
def test_rounding_of_a_jaw_that_only_translates_is_no_target(scenes, factor):
    model = fork1s.load(scenes / "fourbar_gripper.xml")
    target = {"left_jaw": model.compliance("left_jaw") * factor}
    fit = model.fit_stiffness(target, ["left_crank"])
    assert fit.reached and fit.error < 1e-6
    # C = L² / (k_crank + k_rocker + k_jaw), of which 2.05 + 0.1 N·m/rad are there
    assert_allclose(fit.stiffness["left_crank"], 2.15 / factor - 0.1, rtol=1e-6)
    assert model.fit_stiffness(target).error < 1e-6


def test_a_body_that_only_turns(arm):
    fit = arm.fit_stiffness({"upper_arm": arm.compliance("upper_arm") * 1.3})
    assert fit.reached and fit.error < 1e-8 and fit.unfelt == ["elbow"]


def test_what_cannot_be_reached_is_said(arm):
    target = np.full((6, 6), np.nan)
    target[2, 2], target[4, 4] = 0.01, 0.02  # who shifts by 0.02 at 1 m turns by 0.02 at least
    fit = arm.fit_stiffness({"forearm": target})
    assert not fit.reached and fit.error > 0.1 and "NOT reached" in repr(fit)
    assert fit.missed["forearm"][2, 2] > 0 and fit.missed["forearm"][4, 4] < 0
    tight = arm.fit_stiffness({"forearm": _only(4, 4, 1e-3)}, bounds=(0.5, 2))
    assert not tight.reached and tight.at_bound == ["shoulder"] and tight.unfelt == []


def _only(row, column, value):
    target = np.full((6, 6), np.nan)
    target[row, column] = value
    return target


def test_a_hand_finds_its_own_stiffnesses(scenes):
    hand = fork1s.load(scenes / "hand.xml", keyframe="open")
    rng = np.random.default_rng(3)
    wanted = {name: k * rng.uniform(0.3, 3) for name, k in hand.stiffnesses.items() if k > 0}
    target = hand.with_stiffness(wanted).compliance("index_tip")
    fit = hand.fit_stiffness({"index_tip": target})
    assert fit.reached
    for name, k in fit.stiffness.items():
        assert name.startswith("index") and abs(k / wanted[name] - 1) < 1e-5
    assert "thumb_tip_flex" in fit.unfelt


def test_refusals(arm, scenes):
    for target, said in (
        ({"forearm": np.eye(4)}, r"\(6, 6\), or \(3, 3\)"),
        ({}, "names no body"),
        ({"forearm": np.full((6, 6), np.nan)}, "not all are open"),
        ({"forearm": np.arange(36.0).reshape(6, 6)}, "symmetric"),
    ):
        with pytest.raises(fork1s.UsageError, match=said):
            arm.fit_stiffness(target)
    with pytest.raises(
        fork1s.UnknownNameError, match="no joint coordinate, tendon or servo of a tendon 'knee'"
    ):
        arm.fit_stiffness(np.eye(6), ["knee"])
    with pytest.raises(fork1s.UnknownNameError, match="no body"):
        arm.fit_stiffness({"hand": np.eye(6)})
    with pytest.raises(fork1s.UsageError, match="smallest < largest"):
        arm.fit_stiffness(np.eye(6), bounds=(2, 1))
    with pytest.raises(fork1s.UsageError, match="finite and 0 or more"):
        arm.with_stiffness({"elbow": -1})


def test_servo_and_spring_go_together(scenes):
    model = fork1s.load(scenes / "fourbar_gripper.xml")
    twice = model.with_stiffness({name: 2 * k for name, k in model.stiffnesses.items()})
    scaled = fork1s.load(scenes / "fourbar_gripper.xml", stiffness_scale=2)
    sims = [fork1s.Simulation(m) for m in (twice, scaled)]
    for sim in sims:
        sim.controls["left_grip"] = 0.3
        sim.step(30)
    assert_allclose(sims[0].poses, sims[1].poses, atol=1e-12)


def test_the_worked_example(scenes):
    example = runpy.run_path(str(scenes.parent / "examples" / "peg_fit.py"))
    model = fork1s.load(scenes / "peg_gripper.xml")
    depth, _ = example["insert"](model)
    assert depth < 15  # jammed at the mouth
    soft = example["with_factors"](model, {"wrist": 0.3, "fingers": 0.02, "pad": 0.08})
    depth, force = example["insert"](soft)
    assert depth > example["DEEP"] and force < 5


def test_the_page_of_sweeps(scenes, tmp_path, monkeypatch):
    from pathlib import Path

    if not (Path(fork1s.__file__).parent / "scenes").exists():
        pytest.skip("the package has no scenes in a build folder")
    pytest.importorskip("pandas", reason="pip install 'fork1s[sweep]'")
    monkeypatch.chdir(tmp_path)
    blocks = re.findall(
        r"```python\n(.*?)```", (scenes.parent / "docs" / "sweeps.md").read_text(), flags=re.DOTALL
    )
    assert len(blocks) == 2
    # A program of its own, as a reader would have it: its workers read it again.
    page = {"__name__": "__main__"}
    exec(compile("\n".join(blocks), "docs/sweeps.md", "exec"), page)
    assert len(page["table"]) == 6 and page["table"]["error"].isna().all() and page["fit"].reached


def test_the_page_of_the_hand(scenes, tmp_path):
    """Its program prints the lines that the page shows; tests/cli/docs_test.cpp follows its other commands."""
    page = (scenes.parent / "docs" / "hand_stiffness.md").read_text()
    [program] = re.findall(r"```python\n(.*?)```", page, flags=re.DOTALL)
    [shown] = re.findall(r"\$ python3 tune.py\n(.*?)```", page, flags=re.DOTALL)
    (tmp_path / "tune.py").write_text(program)
    (tmp_path / "scenes").symlink_to(scenes)
    done = subprocess.run([sys.executable, "tune.py"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert done.stdout == shown


def test_the_servo_of_a_tendon_finds_its_stiffness():
    hand = fork1s.load(
        """<mujoco><worldbody><body name="a"><joint name="a" axis="0 1 0" stiffness="2"/><geom size=".1"/>
        <body name="tip" pos=".5 0 0"><joint name="b" axis="0 1 0" stiffness="3"/><geom size=".1"/></body></body></worldbody>
        <tendon><fixed name="t"><joint joint="a" coef="1"/><joint joint="b" coef="2"/></fixed></tendon>
        <actuator><position name="grip" tendon="t" kp="10"/></actuator></mujoco>""",
        interface="tip",
    )
    wanted = {"a": 3.0, "b": 2.0, "grip": 25.0}
    fit = hand.fit_stiffness(hand.with_stiffness(wanted).compliance("tip"), tolerance=1e-6)
    assert fit.reached
    assert fit.stiffness == pytest.approx(wanted, rel=1e-4)
