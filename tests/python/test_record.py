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


@pytest.fixture(scope="module")
def pushed_gripper(gripper, tmp_path_factory):
    """A run of 40 steps, and what the simulation told after each of them."""
    path = tmp_path_factory.mktemp("recording") / "run.h5"
    sim = fork1s.Simulation(gripper, dt=1 / 60)
    sim.record(path)
    told = []
    for k in range(40):
        sim.controls["left_grip"] = 0.01 * k
        if k >= 30:
            sim.push("cube", force=[0.1, 0, 0], torque=[0, 0, 1e-3], point=[0, 0, 0.02])
        sim.step()
        told.append(
            {
                "time": sim.time,
                "poses": sim.poses,
                "joints": sim.joint_displacements,
                "controls": sim.control_values,
                "sensors": sim.sensors,
                "kinetic": sim.kinetic_energy,
                "potential": sim.potential_energy,
                "contacts": sim.contacts,
                "gap": sim.joint_gap,
            }
        )
    sim.stop_recording()
    return path, sim, told


def test_a_recording_as_arrays_is_what_the_simulation_told(pushed_gripper):
    path, sim, told = pushed_gripper
    run = fork1s.read_recording(path)
    assert len(run) == 40 and run.finished and run.dt == sim.dt and run.bodies == sim.bodies
    assert repr(run) == f"<fork1s.Recording '{path}', 40 steps to 0.666667 s>"
    np.testing.assert_array_equal(run.steps, np.arange(40))
    np.testing.assert_array_equal(run.time, [t["time"] for t in told])
    np.testing.assert_array_equal(run.poses, [t["poses"] for t in told])
    np.testing.assert_array_equal(run.poses_of("cube"), run.poses[:, sim.bodies.index("cube")])
    np.testing.assert_array_equal(run.joint_displacements.array, [t["joints"] for t in told])
    assert list(run.joint_displacements) == sim.coordinates and list(run.controls) == list(sim.controls)
    np.testing.assert_array_equal(
        run.joint_displacements[sim.coordinates[2]], run.joint_displacements.array[:, 2]
    )
    np.testing.assert_array_equal(run.controls.array, [t["controls"] for t in told])
    assert run.controls["left_grip"][-1] == 0.39
    assert list(run.sensors) == list(sim.sensors)
    np.testing.assert_array_equal(run.sensors.array, [t["sensors"].array for t in told])
    np.testing.assert_array_equal(run.kinetic_energy, [t["kinetic"] for t in told])
    np.testing.assert_array_equal(run.potential_energy, [t["potential"] for t in told])
    assert (
        run.columns["closure_gap"] <= np.array([t["gap"] for t in told])
    ).all()  # of loops, not of all joints
    assert run.columns["converged"].dtype == bool and run.columns["converged"].all()
    assert run.columns["base_poses"].shape == (40, 1, 7) and run.columns["base_rates"].shape == (40, 0)


def test_contacts_and_pushes_of_a_recording_are_tables_with_their_steps(pushed_gripper):
    path, sim, told = pushed_gripper
    run = fork1s.read_recording(path)
    assert run.contacts.dtype == fork1s.RECORDED_CONTACT and len(run.contacts) > 40
    for k, t in enumerate(told):
        rows = run.contacts[run.contacts["step"] == k]
        for name in fork1s.RECORDED_CONTACT.names[1:]:
            np.testing.assert_allclose(rows[name], t["contacts"][name], rtol=1e-12, atol=1e-12)
    pairs = run.between("cube", "world")
    assert 0 < len(pairs) and np.array_equal(pairs, run.between("world", "cube"))
    cube = sim.bodies.index("cube")
    assert all(sorted(bodies) == [-1, cube] for bodies in pairs["bodies"].tolist())
    np.testing.assert_array_equal(run.wrenches["step"], np.arange(30, 40))
    np.testing.assert_array_equal(run.wrenches["force"], [[0.1, 0, 0]] * 10)
    np.testing.assert_array_equal(run.wrenches["torque"], [[0, 0, 1e-3]] * 10)
    assert set(run.wrenches["body"]) == {cube} and len(run.point_springs) == 0
    sizes = run.columns["reduced_sizes"]
    np.testing.assert_array_equal(np.bincount(run.reduced["step"]), sizes.sum(axis=1))


@pytest.mark.parametrize(
    "span",
    [dict(stride=7), dict(start=5, stop=21, stride=4), dict(start=39), dict(stop=0), dict(start=90)],
    ids=str,
)
@pytest.mark.parametrize("stretch", [1 << 10, 8 << 20])
def test_steps_of_a_recording_in_strides_are_those_of_the_whole(pushed_gripper, span, stretch, monkeypatch):
    monkeypatch.setattr("fork1s._recording.STRETCH_BYTES", stretch)
    path = pushed_gripper[0]
    whole = fork1s.read_recording(path)
    some = fork1s.read_recording(path, **span)
    wanted = np.arange(40)[span.get("start", 0) : span.get("stop") : span.get("stride", 1)]
    np.testing.assert_array_equal(some.steps, wanted)
    np.testing.assert_array_equal(some.poses, whole.poses[wanted])
    np.testing.assert_array_equal(some.controls["left_grip"], whole.controls["left_grip"][wanted])
    for key, values in whole.columns.items():
        np.testing.assert_array_equal(some.columns[key], values[wanted])
    for table in ("contacts", "wrenches", "reduced"):
        rows = getattr(whole, table)
        rows = rows[np.isin(rows["step"], wanted)]
        rows["step"] = np.searchsorted(wanted, rows["step"])
        np.testing.assert_array_equal(getattr(some, table), rows)


def test_a_recording_that_goes_on_is_read_up_to_what_reached_the_disk(gripper, tmp_path):
    sim = fork1s.Simulation(gripper)
    sim.record(tmp_path / "run.h5")
    sim._flush_recording()
    run = fork1s.read_recording(tmp_path / "run.h5")
    assert (
        len(run) == 0
        and run.poses.shape == (0, len(sim.bodies), 7)
        and run.controls["left_grip"].shape == (0,)
    )
    np.testing.assert_array_equal(run.initial_poses, sim.poses)
    assert len(run.contacts) == 0 and run.columns["base_poses"].shape == (0, 1, 7)
    sim.step(3)
    sim._flush_recording()
    run = fork1s.read_recording(tmp_path / "run.h5")
    assert len(run) == 3 and not run.finished and repr(run).endswith("NOT FINISHED>")
    sim.stop_recording()


def test_values_of_a_sensor_stand_beside_each_other(tmp_path):
    sim = fork1s.Simulation(
        fork1s.load(
            "<mujoco><worldbody><body pos='0 0 1'><freejoint/><geom size='.1'/><site name='s'/></body></worldbody>"
            "<sensor><accelerometer name='a' site='s'/><clock name='c'/></sensor></mujoco>"
        )
    )
    sim.record(tmp_path / "run.h5")
    sim.step(2)
    sim.stop_recording()
    run = fork1s.read_recording(tmp_path / "run.h5")
    assert {name: values.shape for name, values in run.sensors.items()} == {"a": (2, 3), "c": (2, 1)}
    np.testing.assert_array_equal(run.sensors["a"][-1], sim.sensors["a"])
    np.testing.assert_array_equal(run.sensors["c"][:, 0], run.time)
    assert len(run.joint_displacements) == len(run.controls) == 0 and run.columns["base_poses"].shape == (
        2,
        0,
        7,
    )


def test_recordings_that_cannot_be_read_are_refused(pushed_gripper, tmp_path):
    path = pushed_gripper[0]
    with pytest.raises(fork1s.FileError):
        fork1s.read_recording(tmp_path / "gone.h5")
    (tmp_path / "text.h5").write_text("hello")
    with pytest.raises(fork1s.Error):
        fork1s.read_recording(tmp_path / "text.h5")
    content = bytearray(path.read_bytes())
    time = content.index(np.array([1 / 60, 2 / 60]).tobytes())
    content[time + 3] ^= 1
    (tmp_path / "damaged.h5").write_bytes(content)
    with pytest.raises(fork1s.FormatError, match="damaged"):
        fork1s.read_recording(tmp_path / "damaged.h5")
    run = fork1s.read_recording(path)
    with pytest.raises(fork1s.UnknownNameError, match="there is no control 'grip'; there are: left_grip"):
        run.controls["grip"]
    with pytest.raises(fork1s.UnknownNameError, match="there is no body 'cup'"):
        run.poses_of("cup")
    with pytest.raises(fork1s.UnknownNameError, match="there is no body 'cup'"):
        run.between("cube", "cup")
    for wrong in (dict(start=-1), dict(stop=-1), dict(stride=0)):
        with pytest.raises(fork1s.UsageError, match="is below"):
            fork1s.read_recording(path, **wrong)
    with pytest.raises(TypeError, match="stride must be a whole number, not 1.5"):
        fork1s.read_recording(path, stride=1.5)
