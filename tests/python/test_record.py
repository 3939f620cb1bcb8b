"""Recordings from Python: the same file that the command line writes and replays."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import fork1s


def fork1s_command(*arguments):
    program = Path(sys.executable).parent / "fork1s"
    if not program.exists():
        pytest.skip("the command is not installed beside this Python")
    return subprocess.run([program, *map(str, arguments)], capture_output=True, text=True)


def test_what_is_recorded_replays_bit_by_bit(gripper, tmp_path):
    sim = fork1s.Simulation(gripper, dt=1 / 60)
    sim.record(tmp_path / "run.h5")
    sim.controls["left_grip"] = 0.3
    sim.step(20)
    sim.push("cube", force=[0.1, 0, 0], point=[0, 0, 0.02])
    sim.step(10)
    for refused in (
        lambda: sim.set_stiffness({"left_crank": 3}),
        lambda: sim.set_state(qvel=np.zeros(12)),
        lambda: sim.restore(sim.save()),
        lambda: sim.record(tmp_path / "other.h5"),
    ):
        with pytest.raises(fork1s.UsageError, match="a recording goes on"):
            refused()
    sim.stop_recording()
    sim.stop_recording()
    sim.step(5)
    done = fork1s_command("replay", tmp_path / "run.h5")
    assert done.returncode == 0 and "30" in done.stdout, done.stdout + done.stderr


def test_program_of_the_package_replays_the_hand_bit_by_bit(hand, tmp_path):
    program = Path(fork1s.__file__).parent / "bin" / "fork1s"
    sim = fork1s.Simulation(hand, dt=1 / 60)
    sim.record(tmp_path / "run.h5")
    sim.control_values = sim.control_values + 0.1
    sim.step(20)
    sim.stop_recording()
    done = subprocess.run([program, "replay", tmp_path / "run.h5"], capture_output=True, text=True)
    assert done.returncode == 0 and f"{sim.hash():016x}" in done.stdout, done.stdout + done.stderr


def test_a_page_that_plays(gripper, tmp_path):
    sim = fork1s.Simulation(gripper)
    with pytest.raises(fork1s.UsageError, match="nothing was recorded"):
        sim.replay()
    sim.record(tmp_path / "run.h5")
    sim.step(10)
    try:
        short = sim.replay(height=300)  # while it goes on
    except fork1s.FileError as error:
        if "built without its page" in str(error):
            pytest.skip("the package was built without its page")
        raise
    sim.step(10)
    sim.stop_recording()
    page = fork1s.replay(tmp_path / "run.h5")
    assert len(page.page) > len(short.page) and page.page.lstrip().lower().startswith("<!doctype html")
    assert short._repr_html_().startswith("<iframe srcdoc=") and 'height="300"' in short._repr_html_()
    page.save(tmp_path / "run.html")
    assert (tmp_path / "run.html").read_text(encoding="utf-8") == page.page


def test_refusals(gripper, tmp_path):
    sim = fork1s.Simulation(gripper)
    with pytest.raises(fork1s.FileError):
        sim.record(tmp_path / "none" / "run.h5")
    with pytest.raises(fork1s.FileError):
        fork1s.replay(tmp_path / "gone.h5")
    (tmp_path / "text.h5").write_text("hello")
    with pytest.raises(fork1s.Error):
        fork1s.replay(tmp_path / "text.h5")
