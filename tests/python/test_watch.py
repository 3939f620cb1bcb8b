"""Warnings of a simulation that watches its steps: those of `fork1s run`."""

import copy
import json
import pickle
import subprocess
from pathlib import Path

import fork1s

# A drawer of 200 mm that is 0.5 mm too high for its shelf.
DRAWER = """<mujoco model="shelf"><option timestep="0.01"/><worldbody>
  <geom name="floor" type="box" pos="0 0 -.01" size=".3 .2 .01"/>
  <geom name="ceiling" type="box" pos="0 0 .1095" size=".3 .2 .01"/>
  <body name="drawer" pos="0 0 .05"><joint name="slide" type="slide" axis="1 0 0" damping="1"/>
    <geom type="box" size=".2 .1 .05" mass="1"/></body>
</worldbody><actuator><motor name="push" joint="slide"/></actuator></mujoco>"""

# The lower link is no interface body and swings through the wall.
SWING = """<mujoco><worldbody>
  <geom name="wall" type="box" pos=".25 0 .55" size=".1 .3 .08"/>
  <body name="upper" pos="0 0 1"><joint name="shoulder" axis="0 1 0" stiffness=".1"/>
    <geom type="capsule" fromto="0 0 0 .3 0 0" size=".02" mass=".1"/>
    <body name="lower" pos=".3 0 0"><joint name="elbow" axis="0 1 0" stiffness="1"/>
      <geom type="capsule" fromto=".04 0 0 .3 0 0" size=".02" mass=".1"/>
      <body name="tip" pos=".3 0 0"><joint name="wrist" axis="0 1 0" stiffness="1"/>
        <geom type="sphere" pos=".1 0 0" size=".02" mass=".01"/></body>
    </body>
  </body>
</worldbody></mujoco>"""


def program_warnings(model, tmp_path, *arguments):
    (tmp_path / "model.xml").write_text(model)
    program = Path(fork1s.__file__).parent / "bin" / "fork1s"
    done = subprocess.run(
        [program, "run", tmp_path / "model.xml", "--json", *map(str, arguments)],
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)["warnings"]


def test_a_wedged_drawer_is_told_in_the_sentences_of_the_program(tmp_path):
    model = fork1s.load(DRAWER)
    sim = fork1s.Simulation(model, watch=True)
    before = sim.warnings
    for _ in range(100):
        sim.push("drawer", force=[50, 0, 0])
        sim.step()
    told = [text for text in sim.warnings if text not in before]
    shelf = ("the world (shape 'floor')", "the world (shape 'ceiling')")
    assert any(f"{side} and 'drawer' are wedged" in text for text in told for side in shelf)
    pushed = ("--time", 1, "--push", "drawer:50,0,0")
    assert program_warnings(DRAWER, tmp_path, *pushed) == sim.warnings
    other = fork1s.Simulation(model)
    other.push("drawer", force=[50, 0, 0])
    other.step(100)
    assert other.warnings == before and other.hash() == sim.hash()


def test_a_body_that_passes_through_another_is_told(tmp_path):
    sim = fork1s.Simulation(fork1s.load(SWING, interface="tip"), watch=True)
    sim.step(60)
    [sentence] = [text for text in sim.warnings if "it touches nothing" in text]
    assert "'lower' is no interface body" in sentence and "'world'" in sentence
    told, remedy = sentence.split("; ")
    assert remedy == "add it to interface= of load, or let all bodies touch by detail='all'"
    told_by_program = program_warnings(SWING, tmp_path, "--time", 1, "--interface", "tip")
    assert f"{told}; add it to --interface, or let all bodies touch by --detail all" in told_by_program
    sim.set_detail("parents")
    assert sentence in sim.warnings
    sim.set_state(qpos=[0, 0, 0])
    assert sentence not in sim.warnings


def test_a_quiet_scene_has_none(gripper):
    sim = fork1s.Simulation(gripper, watch=True)
    sim.controls.update({"left_grip": 0.3, "right_grip": 0.3})
    sim.step(60)
    sim.pull("cube", None, [0, 0, 0.03], 50)  # which lifts it, and whose energy comes from outside
    sim.step(60)
    sim.release()
    sim.step(30)
    assert sim.warnings == fork1s.Simulation(gripper).warnings


def test_warnings_are_those_of_the_moment_that_a_simulation_went_back_to():
    sim = fork1s.Simulation(fork1s.load(DRAWER), watch=True)
    none = sim.warnings
    start = sim.save()
    sim.controls["push"] = 50
    sim.step(50)
    told = sim.warnings
    assert len(told) > len(none)
    wedged = sim.save()
    sim.restore(start)
    assert sim.warnings == none
    sim.restore(wedged)
    assert sim.warnings == none  # known of the steps that follow
    sim.step(5)
    for copied in (copy.copy(sim), pickle.loads(pickle.dumps(sim))):
        copied.step(50)
        assert any("wedged" in text for text in copied.warnings)


def test_undone_steps_are_counted():
    sim = fork1s.Simulation(fork1s.load(DRAWER), watch=True)
    before = sim.warnings
    what = "the step from 0 s was undone: mechanism 'drawer' could not be solved even in parts of 1/64 of the step"
    remedy = "; try a smaller time step, or softer gains, pushes and springs"
    for others in ("", "; 1 more step was undone", "; 2 more steps were undone"):
        sim.push("drawer", force=[1e300, 0, 0])
        assert not sim.step().finite
        [sentence] = [text for text in sim.warnings if text not in before]
        assert sentence == what + others + remedy
