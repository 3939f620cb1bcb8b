"""Simulations shared by Python threads, calls ended by a signal, and threads that still step when Python exits.

Each case runs in a process of its own: without the guarantees it would stand still for good or abort.
"""

import subprocess
import sys
import textwrap

import pytest

# s; a case takes about one, most of it imports. Reached only where something stands still.
STANDSTILL = 120

PRELUDE = """
import os, signal, sys, threading, time
import fork1s
BOXES = '<mujoco><worldbody><geom type="plane" size="1 1 1"/>' + ''.join(
    f'<body name="box{i}" pos="{i} 0 .05"><freejoint/><geom type="box" size=".1 .1 .05" mass="2"/></body>'
    for i in range(4)) + '</worldbody></mujoco>'
model = fork1s.load(BOXES)

def interrupt_after(seconds):
    def send():
        time.sleep(seconds)
        os.kill(os.getpid(), signal.SIGINT)
    threading.Thread(target=send, daemon=True).start()
"""


def run(script: str) -> str:
    done = subprocess.run(
        [sys.executable, "-W", "ignore::DeprecationWarning", "-c", PRELUDE + textwrap.dedent(script)], capture_output=True, text=True, timeout=STANDSTILL
    )
    assert done.returncode == 0, done.stderr
    assert done.stderr == ""
    return done.stdout


def test_threads_read_all_properties_of_a_simulation_that_steps():
    assert "done" in run("""
        sim = fork1s.Simulation(model)
        sim.step(20)
        stop = threading.Event()
        reads = [lambda: sim.contacts, lambda: sim.poses, lambda: sim.velocities, lambda: sim.qpos, lambda: sim.qvel,
                 lambda: sim.time, lambda: sim.save(), lambda: list(sim.controls.items()), lambda: sim.control_values,
                 lambda: sim.coordinates, lambda: sim.warnings, lambda: sim.hash(), lambda: sim.ray([0, 0, 1], [0, 0, -1])]
        def repeat(read):
            while not stop.is_set():
                read()
        threads = [threading.Thread(target=repeat, args=(read,)) for read in reads]
        sys.setswitchinterval(1e-5)
        for t in threads:
            t.start()
        for _ in range(50):
            sim.step(2)
        stop.set()
        for t in threads:
            t.join()
        print("done")
    """)


def test_other_threads_get_their_turn_between_the_steps_of_one_call():
    assert "seen 20" in run("""
        sim = fork1s.Simulation(model)
        threading.Thread(target=sim.step, args=(10**9,), daemon=True).start()
        times = set()
        while len(times) < 20:
            times.add(sim.time)
        print("seen", len(times))
    """)


@pytest.mark.parametrize(
    "call",
    [
        "fork1s.Simulation(model).step(10**9)",
        "fork1s.Batch(model, 8).step(steps=10**9)",
        "fork1s.compare(model, time=1e5)",
    ],
)
def test_an_interrupt_ends_a_long_call(call):
    assert "interrupted" in run(f"""
        interrupt_after(0.3)
        try:
            {call}
        except KeyboardInterrupt:
            print("interrupted")
    """)


def test_an_interrupted_simulation_goes_on():
    assert "same" in run("""
        sim = fork1s.Simulation(model)
        interrupt_after(0.3)
        try:
            sim.step(10**9)
        except KeyboardInterrupt:
            pass
        steps = sim.steps
        other = fork1s.Simulation(model)
        other.step(steps)
        assert steps > 0 and sim.hash() == other.hash()
        print("same")
    """)


def test_a_signal_handler_may_read_a_simulation_and_is_told_to_leave_a_batch_alone():
    assert "box0 UsageError" in run("""
        sim, batch = fork1s.Simulation(model), fork1s.Batch(model, 2)
        heard = []
        def on_signal(*_):
            heard.append(sim.bodies[0] if not heard else None)
            sim.poses
            raise KeyboardInterrupt
        signal.signal(signal.SIGINT, on_signal)
        interrupt_after(0.3)
        try:
            sim.step(10**9)
        except KeyboardInterrupt:
            pass
        def on_signal_in_batch(*_):
            batch.time
        signal.signal(signal.SIGINT, on_signal_in_batch)
        interrupt_after(0.3)
        try:
            batch.step(steps=10**9)
        except fork1s.UsageError as error:
            heard[1:] = [type(error).__name__]
        print(*heard)
    """)


@pytest.mark.parametrize("call", ["sim.step(10**9)", "sim.step(1)", "batch.step(steps=10**9)", "batch.time"])
def test_python_exits_while_daemon_threads_step(call):
    assert "leaving" in run(f"""
        sim, batch = fork1s.Simulation(model), fork1s.Batch(model, 4)
        def repeat():
            while True:
                {call}
        for _ in range(4):
            threading.Thread(target=repeat, daemon=True).start()
        time.sleep(0.2)
        print("leaving")
    """)


def test_a_forked_child_exits():
    assert "child left" in run("""
        sim = fork1s.Simulation(model)
        threading.Thread(target=sim.step, args=(10**9,), daemon=True).start()
        time.sleep(0.1)
        child = os.fork()
        if child == 0:
            sys.exit(0)
        assert os.waitpid(child, 0)[1] == 0
        print("child left")
    """)
