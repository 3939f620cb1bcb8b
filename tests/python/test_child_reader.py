"""Files are read in a child process: one that crashes or stalls its reader is an exception."""

import signal
import threading

import numpy as np
import pytest
from test_threads import run

import fork1s

# MuJoCo's compiler aborts.
CRASHES = """<mujoco><asset><mesh name="m" builtin="supersphere" params="20000 1 1"/></asset><worldbody>
  <body pos="0 0 1"><joint type="slide" stiffness="10"/><geom type="mesh" mesh="m"/></body></worldbody></mujoco>"""


@pytest.fixture
def crashing(tmp_path):
    path = tmp_path / "sphere.xml"
    path.write_text(CRASHES)
    return path


@pytest.fixture
def slow(tmp_path):
    """Thousands of copies of a body that MuJoCo compiles for seconds."""
    path = tmp_path / "slow.xml"
    path.write_text("""<mujoco><asset><mesh name="m" builtin="sphere" params="4"/></asset><worldbody>
      <replicate count="100"><replicate count="900" offset="1 0 0"><body><joint type="slide" stiffness="1"/>
      <geom type="mesh" mesh="m"/></body></replicate></replicate></worldbody></mujoco>""")
    return path


def test_a_file_that_crashes_its_reader_is_a_model_error(crashing):
    with pytest.raises(fork1s.ModelError, match=r"sphere\.xml: brought its reader down \(") as caught:
        fork1s.load(crashing)
    assert caught.value.where == str(crashing)


def test_a_crash_is_told_where_children_are_ignored(crashing, scenes):
    before = signal.signal(signal.SIGCHLD, signal.SIG_IGN)
    try:
        with pytest.raises(fork1s.ModelError, match="brought its reader down"):
            fork1s.load(crashing)
        assert fork1s.load(scenes / "hand.xml").bodies
        missing = scenes / "none.xml"
        with pytest.raises(fork1s.FileError):
            fork1s.load(missing)
    finally:
        signal.signal(signal.SIGCHLD, before)


def test_reading_ends_after_read_time(slow):
    with pytest.raises(fork1s.ModelError, match=r"was not read within 0\.2 s; .*\(read_time\)"):
        fork1s.load(slow, read_time=0.2)
    with pytest.raises(fork1s.UsageError, match="read_time"):
        fork1s.load(slow, read_time=0)


def test_an_interrupt_ends_reading(slow):
    assert "interrupted" in run(f"""
        interrupt_after(0.3)
        try:
            fork1s.load({str(slow)!r})
        except KeyboardInterrupt:
            print("interrupted")
    """)


def test_a_fork_waits_for_no_reader(slow):
    assert "done" in run(f"""
        threading.Thread(target=fork1s.load, args=({str(slow)!r},), daemon=True).start()
        time.sleep(0.2)
        start = time.monotonic()
        child = os.fork()
        if child == 0:
            os._exit(0)
        assert os.waitpid(child, 0)[1] == 0 and time.monotonic() - start < 5
        print("done")
    """)


def test_threads_read_at_the_same_time(scenes):
    models = []
    threads = [
        threading.Thread(target=lambda: models.append(fork1s.load(scenes / "hand.xml"))) for _ in range(4)
    ]
    for t in threads:
        t.start()
    for t in threads:
        t.join()
    assert len({fork1s.Simulation(m).hash() for m in models}) == 1 and len(models) == 4


def test_every_option_and_the_same_bits_as_in_this_process(scenes):
    pose = np.eye(4)
    pose[:3, :3] = [[0.8, -0.6, 0], [0.6, 0.8, 0], [0, 0, 1]]
    pose[:3, 3] = [0.1, 1 / 3, 0.7]
    cases = [
        ("hand.xml", dict(keyframe="open", modes=3, mode_choice="contribution", stiffness_scale=1 / 3)),
        ("quadruped.xml", dict(base="floating", base_pose=pose, pd=(30.0, 1.0))),
        (
            "two_link_arm.xml",
            dict(q={"elbow": 0.1}, keep_start=True, ground=-0.1, pd={"elbow": (0.1, 1 / 7)}),
        ),
    ]
    for name, options in cases:
        models = [fork1s.load(scenes / name, in_process=here, **options) for here in (False, True)]
        hashes = []
        for model in models:
            sim = fork1s.Simulation(model)
            sim.step(3)
            hashes.append(sim.hash())
        assert hashes[0] == hashes[1], name
        assert models[0].notes == models[1].notes, name


def test_text_is_read_in_this_process(monkeypatch):
    monkeypatch.setattr(fork1s._load, "_PROGRAM", "/no/such/program")
    fork1s.load("<mujoco><worldbody><body><freejoint/><geom size='.1'/></body></worldbody></mujoco>")
    with pytest.raises(fork1s.ModelError, match="/no/such/program"):
        fork1s.load(fork1s.__file__)
