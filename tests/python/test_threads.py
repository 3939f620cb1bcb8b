"""Simulations shared by Python threads, calls ended by a signal, threads that still step when Python exits, forks.

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
        [sys.executable, "-W", "ignore::DeprecationWarning", "-c", PRELUDE + textwrap.dedent(script)],
        capture_output=True,
        text=True,
        timeout=STANDSTILL,
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


# Calls of each class with the arguments that they need; properties are read, all of them.
CALLS = """
import itertools
ARM = '<mujoco><worldbody><body name="base"><geom size=".1" mass="1"/><body name="tip" pos="0 0 .5">' \\
    '<joint name="elbow" stiffness="5" damping=".1"/><geom size=".1" mass="1"/></body></body>' \\
    '<geom type="plane" size="1 1 1"/></worldbody><actuator><motor name="motor" joint="elbow"/></actuator>' \\
    '<sensor><jointpos name="angle" joint="elbow"/><touch name="touch" site="pad"/></sensor></mujoco>'
ARM = ARM.replace('<joint name="elbow"', '<site name="pad" size=".1"/><joint name="elbow"')
arm = fork1s.load(ARM)
sim, batch = fork1s.Simulation(arm, error=True, watch=True), fork1s.Batch(arm, 2, seeds=3)
moment, batch_moment = sim.save(), batch.save()

def or_refused(call):
    def guarded():
        try:
            return call()
        except (fork1s.Error, ModuleNotFoundError):
            pass  # as while another thread records, or without SciPy
    guarded.alone = call
    return guarded

def recorded(call):
    sim.record(path)
    try:
        call()
    finally:
        sim.stop_recording()

methods = {
    fork1s.Simulation: dict(
        hash=lambda: sim.hash(), holding_controls=or_refused(lambda: sim.holding_controls()),
        jacobian=lambda: sim.jacobian('tip'), linearize=or_refused(lambda: sim.linearize()),
        pose=lambda: sim.pose('tip'), push=lambda: sim.push('tip', [1, 0, 0]), pull=lambda: sim.pull('tip', None, [0, 0, 1], 5), release=lambda: sim.release(),
        ray=lambda: sim.ray([0, 0, 3], [0, 0, -1]),
        record=or_refused(lambda: recorded(lambda: sim.step(1))), replay=or_refused(lambda: sim.replay()),
        restore=or_refused(lambda: sim.restore(moment)), save=lambda: sim.save(),
        set_detail=or_refused(lambda: sim.set_detail('all')), set_state=or_refused(lambda: sim.set_state([.1])),
        set_stiffness=or_refused(lambda: sim.set_stiffness({'elbow': 5})),
        start_from_controls=or_refused(lambda: sim.start_from_controls()), step=lambda: sim.step(2),
        stop_recording=or_refused(lambda: sim.stop_recording()),
        # Beside those of the class.
        move=lambda: sim.step(2, move=True), set_control=lambda: sim.controls.update({'motor': .1}),
        read_controls=lambda: list(sim.controls.items()), set_qpos=or_refused(lambda: setattr(sim, 'qpos', [.1])),
        set_qvel=or_refused(lambda: setattr(sim, 'qvel', [.1])), read_sensors=lambda: sim.sensors['angle'],
        set_tolerance=or_refused(lambda: setattr(sim, 'newton_tolerance', 1e-6)),
        represent=lambda: repr(sim), buffers=lambda: fork1s.RecoveryBuffers(sim),
    ),
    fork1s.Batch: dict(
        hashes=lambda: batch.hashes(), poses=lambda: batch.poses(), reset=lambda: batch.reset(),
        step=lambda: batch.step(steps=2), usual_ranges=lambda: batch.usual_ranges, velocities=lambda: batch.velocities(),
        restore=lambda: batch.restore(batch_moment), save=lambda: batch.save(),
        set_state=lambda: batch.set_state([.1]), push=lambda: batch.step(push={'tip': [0, 0, 1]}),
        move=lambda: batch.step([.1], steps=2, move=True), read_sensors=lambda: batch.sensors['angle'],
        represent=lambda: repr(batch),
    ),
    fork1s.Model: dict(
        compliance=lambda: arm.compliance(), fit_stiffness=or_refused(lambda: arm.fit_stiffness({'tip': arm.compliance('tip')})),
        linear_model=or_refused(lambda: arm.linear_model()), point_stiffness=lambda: arm.point_stiffness('tip', [0, 0, 0]),
        response=or_refused(lambda: arm.response('tip')), state_space=or_refused(lambda: arm.state_space()),
        stiffness=lambda: arm.stiffness(), with_stiffness=lambda: arm.with_stiffness({'elbow': 5}),
        with_factors=lambda: arm.with_factors({'mass:tip': 2}),
        load=lambda: fork1s.load(ARM), compare=lambda: fork1s.compare(arm, time=.02),
        statics=or_refused(lambda: fork1s.statics(arm, 'tip', force=[0, 1, 0])),
    ),
}
calls = {}
for owner, those in ((sim, methods[fork1s.Simulation]), (batch, methods[fork1s.Batch]), (arm, methods[fork1s.Model])):
    kind = type(owner)
    for name in dir(kind):
        if name.startswith('_'):
            continue
        if callable(getattr(kind, name)):
            assert name in those, f'{kind.__name__}.{name} is called by no thread here'
        else:
            calls[kind, name] = or_refused(lambda owner=owner, name=name: getattr(owner, name))
    calls.update({(kind, name): call for name, call in those.items()})
"""


def test_no_two_calls_wait_for_each_other(tmp_path):
    assert "done" in run(
        f"path = {str(tmp_path / 'r.h5')!r}\n{CALLS}"
        + """
for key, call in calls.items():  # each does what it is for, where nothing else runs
    try:
        getattr(call, 'alone', call)()
    except ModuleNotFoundError as error:
        assert error.name == 'scipy', key
sys.setswitchinterval(1e-5)
for kind in methods:
    for pair in itertools.combinations_with_replacement([key for key in calls if key[0] is kind], 2):
        def repeat(call):
            for _ in range(3):
                call()
        threads = [threading.Thread(target=repeat, args=(calls[key],), daemon=True) for key in pair]
        for t in threads:
            t.start()
        for t in threads:
            t.join(timeout=30)
            if t.is_alive():
                print('stand still:', *pair, flush=True)
                os._exit(1)
print("done")
"""
    )


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


# In a child process a call that hangs is told as the signal that ends it.
FORKS = """
def fork_and(call):
    child = os.fork()
    if child == 0:
        signal.alarm(30)
        try:
            call()
        except fork1s.UsageError as error:
            print(str(error).split(';')[0], flush=True)
        os._exit(0)
    assert os.waitpid(child, 0)[1] == 0
"""
AT_WORK = {
    "load": "fork1s.load(BOXES)",
    "Simulation": "fork1s.Simulation(model)",
    "step": "sim.step(10**9)",
    "record": "sim.record(f'{path}{time.monotonic_ns()}'); sim.step(3); sim.stop_recording()",
    "Batch": "fork1s.Batch(model, 64)",
    "Batch.step": "batch.step(steps=10**9)",
    "Batch.reset": "batch.reset()",
    "compare": "fork1s.compare(model, time=1e5)",
    "compare with MuJoCo": "fork1s.compare(from_file, 'mujoco', time=1e5)",
}


@pytest.mark.parametrize("at_work", AT_WORK)
def test_a_child_forked_while_another_thread_works_is_free_to_work(at_work, tmp_path):
    assert "done" in run(
        FORKS
        + f"""
path, file = {str(tmp_path / "r.h5")!r}, {str(tmp_path / "boxes.xml")!r}
open(file, 'w').write(BOXES)
from_file = fork1s.load(file)
sim, batch = fork1s.Simulation(model), fork1s.Batch(model, 4)
def work():
    while True:
        {AT_WORK[at_work]}
threading.Thread(target=work, daemon=True).start()
time.sleep(0.2)
def in_child():
    fork1s.Simulation(fork1s.load(BOXES)).step(2)
    fork1s.Batch(model, 8).step(steps=2)
    fork1s.compare(model, time=0.02)
    if {not at_work.startswith("compare with")}:
        fork1s.compare(from_file, 'mujoco', time=0.02)
    before = sim.steps
    sim.step(2)
    assert sim.steps == before + 2 and sim.poses.shape == (4, 7)
    if {not at_work.startswith("Batch.")}:
        batch.step(steps=2)
for _ in range(5):
    time.sleep(0.03)
    fork_and(in_child)
print("done")
os._exit(0)
"""
    )


def test_a_child_is_told_that_a_batch_of_another_thread_was_at_work():
    assert "Batch: another thread was using it as this process was forked" in run(
        FORKS
        + """
batch = fork1s.Batch(model, 4)
threading.Thread(target=batch.step, kwargs=dict(steps=10**9), daemon=True).start()
time.sleep(0.2)
fork_and(lambda: batch.time)
os._exit(0)
"""
    )


def test_a_signal_handler_may_fork():
    assert run("""
        sim, batch = fork1s.Simulation(model), fork1s.Batch(model, 4)
        def on_signal(*_):
            child = os.fork()
            if child == 0:
                signal.alarm(30)
                sim.step(2)
                sys.exit(0)
            assert os.waitpid(child, 0)[1] == 0
            print("child left")
            raise KeyboardInterrupt
        signal.signal(signal.SIGINT, on_signal)
        for call in (lambda: sim.step(10**9), lambda: batch.step(steps=10**9)):
            interrupt_after(0.3)
            try:
                call()
            except KeyboardInterrupt:
                pass
    """).split("\n")[:2] == ["child left", "child left"]


def test_a_child_forked_beside_a_live_page_exits():
    assert "done" in run("""
        sim = fork1s.Simulation(model)
        page = fork1s._core.show(sim, 0)
        child = os.fork()
        if child == 0:
            signal.alarm(30)
            fork1s.load(BOXES)
            page.close()
            sys.exit(0)
        assert os.waitpid(child, 0)[1] == 0
        assert not page.closed
        page.close()
        print("done")
    """)


def test_a_child_does_not_write_into_the_recording_of_its_parent(tmp_path):
    assert "done" in run(
        FORKS
        + f"""
path = {str(tmp_path / "r.h5")!r}
sim = fork1s.Simulation(model)
sim.record(path)
sim.step(50)
sim._flush_recording()
before = open(path, 'rb').read()
def in_child():
    global sim
    sim.step(200)
    sim.stop_recording()
    assert open(path, 'rb').read() == before
    sim.record(path + 'of_child')
    sim.step(1)
    del sim
fork_and(in_child)
assert open(path, 'rb').read() == before
sim.step(50)
sim.stop_recording()
print("done")
"""
    )
