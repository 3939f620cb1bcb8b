"""Whoever erred is told with the sentence that the command line prints."""

import pathlib
import subprocess
import sys

import pytest

import fork1s


def printed(*arguments):
    """What the command line says; None where the package has no program (in a build folder)."""
    if not (pathlib.Path(fork1s.__file__).parent / "bin" / "fork1s").exists():
        return None
    call = [sys.executable, "-c", "from fork1s._command import main; main()", *map(str, arguments)]
    return subprocess.run(call, capture_output=True, text=True)


@pytest.mark.parametrize(
    "text, kind",
    [
        (None, fork1s.FileError),
        ("<mujoco><worldbody><body></mujoco>", fork1s.FormatError),
        ("<svg/>", fork1s.FormatError),
        (
            '<mujoco><worldbody><body><joint/><geom size=".1" density="-1"/></body></worldbody></mujoco>',
            fork1s.ModelError,
        ),
        ("<mujoco><worldbody/></mujoco>", fork1s.ModelError),
    ],
)
def test_same_sentence_as_the_command_line(tmp_path, text, kind):
    path = tmp_path / "model.xml"
    if text is not None:
        path.write_text(text)
    with pytest.raises(kind) as caught:
        fork1s.load(path)
    error = caught.value
    assert isinstance(error, fork1s.Error)
    assert str(error) == f"{error.where}: {error.message}" and str(path) in error.where
    done = printed("inspect", path)
    if done is not None:
        assert done.returncode == 3
        assert done.stderr.strip().splitlines()[-1] == f"fork1s: {error}"


def test_a_joint_that_nothing_holds(tmp_path):
    path = tmp_path / "loose.xml"
    path.write_text("""<mujoco><worldbody><body name="a"><joint name="held" stiffness="1" axis="0 0 1"/>
      <geom size=".1" mass="1"/><body name="b" pos="1 0 0"><joint name="loose" axis="0 0 1"/>
      <geom size=".1" mass="1"/></body></body></worldbody>
      <custom><text name="fork1s_interface" data="a"/></custom></mujoco>""")
    model = fork1s.load(path)
    with pytest.raises(fork1s.UnderdeterminedError, match="loose") as caught:
        fork1s.Simulation(model)
    done = printed("run", path, "--time", "0.1")
    if done is not None:
        assert done.stderr.strip().splitlines()[-1] == f"fork1s: {caught.value}"


def test_unknown_names(hand, gripper):
    sim = fork1s.Simulation(gripper)
    for reach in (
        lambda: sim.controls["thumb"],
        lambda: sim.controls.update({"thumb": 1.0}),
        lambda: sim.push("thumb"),
        lambda: sim.pose("thumb"),
        lambda: gripper.compliance("thumb"),
        lambda: gripper.compliance("left_jaw", "thumb"),
    ):
        with pytest.raises(fork1s.UnknownNameError, match="^there is no .* 'thumb'; there are: ") as caught:
            reach()
        assert isinstance(caught.value, KeyError)
    with pytest.raises(fork1s.UsageError, match="thumb"):
        fork1s.load(fork1s.scene("hand"), interface="thumb")


def test_unusable_arguments(arm):
    sim = fork1s.Simulation(arm)
    with pytest.raises(fork1s.UsageError, match="dt: -1.* is no time step above 0 s"):
        fork1s.Simulation(arm, dt=-1)
    with pytest.raises(fork1s.UsageError, match="'most' is none of: object, interface, parents, all"):
        fork1s.Simulation(arm, detail="most")
    with pytest.raises(fork1s.UsageError, match="recovery"):
        fork1s.Simulation(arm, recovery="half")
    with pytest.raises(fork1s.UsageError, match="'loose' is none of: fixed, floating, driven"):
        fork1s.load(arm.path, base="loose")
    with pytest.raises(fork1s.UsageError, match="gains must be 0 or more"):
        fork1s.load(arm.path, pd=(-1, 0))
    with pytest.raises(fork1s.UsageError, match="not int"):
        fork1s.load(3)
    with pytest.raises(ValueError, match="steps: must be a whole number from 0 to 2147483647, not -1"):
        sim.step(-1)
    with pytest.raises(ValueError, match=r"base_pose must be 3 numbers .* not an array of shape \(5,\)"):
        fork1s.load(arm.path, base_pose=[1, 2, 3, 4, 5])
    with pytest.raises(ValueError, match="control_values"):
        sim.control_values = [1.0]
    with pytest.raises(TypeError):
        sim.step("x")


def test_several_mechanisms_are_asked_one_by_one():
    arms = "".join(
        f'<body name="b{i}" pos="{i} 0 0"><joint name="j{i}" stiffness="{i + 1}"/><geom size=".1" mass="1"/></body>'
        for i in range(2)
    )
    model = fork1s.load(f"<mujoco><worldbody>{arms}</worldbody></mujoco>")
    if len(model.mechanisms) == 1:
        pytest.skip("both arms became one mechanism")
    with pytest.raises(fork1s.ModelError, match="holds 2 mechanisms; ask one of them"):
        model.frequencies
    assert model.compliance("b1")[2, 2] == pytest.approx(0.5)
