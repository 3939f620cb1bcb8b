"""Sweeps: every point once, whatever ends on the way."""

import concurrent.futures
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import fork1s

pandas = pytest.importorskip("pandas", reason="pip install 'fork1s[sweep]'")
pytest.importorskip("pyarrow", reason="pip install 'fork1s[sweep]'")

import asked  # noqa: E402


# y of the forearm's origin, the elbow, 1 m along x from the shoulder: 1 N turns the shoulder alone.
def expected(k):
    return 1 / np.asarray(k)


@pytest.fixture
def arm(scenes):
    return scenes / "two_link_arm.xml"


def test_rows_in_order_and_right(arm):
    told = []
    table = fork1s.sweep(
        arm,
        {"stiffness:shoulder": [50, 100, 200], "stiffness_scale": [1.0, 2.0]},
        asked.deflection,
        progress=lambda done, total: told.append((done, total)),
    )
    assert list(table.columns) == [
        "stiffness:shoulder",
        "stiffness_scale",
        "moved",
        "stable",
        "error",
        "seconds",
        "worker",
    ]
    assert_array_equal(table["stiffness:shoulder"], [50, 50, 100, 100, 200, 200])
    # What a joint is held by is set after the scale.
    assert_allclose(table["moved"], expected(table["stiffness:shoulder"]), rtol=1e-9)
    assert table["error"].isna().all() and told[-1] == (6, 6)
    assert all(w.split(":")[1] != str(os.getpid()) for w in table["worker"])


def test_workers_end_without_a_word(arm, capfd):
    fork1s.sweep(
        fork1s.load(arm), {"stiffness:shoulder": [50, 100, 200, 300]}, asked.deflection, progress=False
    )
    told = capfd.readouterr()
    assert told.err == "" and told.out == ""


def test_what_a_parameter_may_be(scenes):
    gripper = fork1s.load(scenes / "fourbar_gripper.xml", interface="left_jaw")
    metric = lambda model, point: {  # noqa: E731 - it goes to another process as it is
        "mass": model.mechanisms[0].mass,
        "interfaces": len(model.interfaces),
        "twice": point["grip"] * 2,
    }
    pytest.importorskip("cloudpickle", reason="functions without a name need it")
    table = fork1s.sweep(
        gripper,
        [{"geom:left_pad_front.mass": 0.1, "grip": 1}, {"geom:left_pad_front.mass": 0.2, "grip": 2}],
        metric,
        progress=False,
    )
    assert_allclose(np.diff(table["mass"]), 0.1)
    assert_array_equal(table["interfaces"], [1, 1])
    assert_array_equal(table["twice"], [2, 4])


def test_a_point_that_fails_is_a_row(arm):
    points = [
        {"geom:none.mass": 1.0},
        {"joint:elbow.damping": 2.0},
        {"joint:elbow.softness": 2.0},
        {"stiffness:knee": 1.0},
        {"stiffness_scale": -1.0},
    ]
    table = fork1s.sweep(arm, points, asked.deflection, progress=False)
    said = table["error"]
    assert said[1] is None or pandas.isna(said[1])
    assert "the model has no geom 'none'" in said[0] and "a joint has no field 'softness'" in said[2]
    assert "there is no joint coordinate, tendon or servo of a tendon 'knee'" in said[3] and said[4]
    assert_allclose(table["moved"][1], expected(100))


def test_a_point_that_ends_its_process_is_a_row(arm, tmp_path):
    table = fork1s.sweep(arm, {"seed": range(20)}, asked.deadly, path=tmp_path / "t.parquet", progress=False)
    assert "ended" in table["error"][3] and "ValueError: five is refused" == table["error"][5]
    assert table["error"].notna().sum() == 2
    assert_allclose(table["moved"].drop([3, 5]), expected(100))
    kept = pandas.read_parquet(tmp_path / "t.parquet")
    assert list(kept.index[kept["error"].notna()]) == [3, 5]


class Stop(Exception):
    pass


def test_goes_on_where_it_stopped_and_asks_nothing_twice(arm, tmp_path):
    log, path = tmp_path / "log", tmp_path / "t.parquet"
    points = {"seed": range(60), "log": [str(log)]}

    def stop(done, total):
        if done >= 20:
            raise Stop

    with pytest.raises(Stop):
        fork1s.sweep(arm, points, asked.logged, path=path, progress=stop, in_flight=4)
    assert not path.exists() and (tmp_path / "t.parquet.journal").exists()
    before = len(log.read_text().split())
    assert 20 <= before < 40
    # A line that was cut off counts for nothing.
    with open(tmp_path / "t.parquet.journal", "a") as journal:
        journal.write('{"key": "abc", "po')
    first = []
    table = fork1s.sweep(
        arm, points, asked.logged, path=path, progress=lambda done, total: first.append(done)
    )
    assert first[0] > 20 and first[-1] == 60
    counts = np.bincount([int(n) for n in log.read_text().split()], minlength=60)
    # What was out when it stopped may have been asked again, since nobody heard the answer; all else once.
    assert (counts >= 1).all() and (counts > 1).sum() <= 4
    assert len(table) == 60 and not (tmp_path / "t.parquet.journal").exists()
    kept = pandas.read_parquet(path)
    assert sorted(kept["seed"]) == list(range(60))
    # More points of the same sweep join the file; those that it has are not asked.
    fork1s.sweep(arm, {"seed": range(50, 70), "log": [str(log)]}, asked.logged, path=path, progress=False)
    assert sorted(pandas.read_parquet(path)["seed"]) == list(range(70))
    assert len(log.read_text().split()) == counts.sum() + 10


def _runs(process):
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def _gone(processes):
    for _ in range(3000):
        if not any(map(_runs, processes)):
            return True
        time.sleep(0.01)
    return False


def test_a_sweep_that_is_killed_loses_nothing(arm, tmp_path):
    program = tmp_path / "program.py"
    program.write_text(f"""
import os, signal, sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
import asked, fork1s
def end(done, total):
    if done == 25:
        os.kill(os.getpid(), signal.SIGKILL)
if __name__ == "__main__":
    fork1s.sweep({str(arm)!r}, {{"seed": range(50), "log": ["log"]}}, asked.logged, path="t.parquet",
                 progress=end, in_flight=2)
""")
    assert subprocess.run([sys.executable, program], cwd=tmp_path).returncode == -signal.SIGKILL
    rows = [json.loads(line) for line in (tmp_path / "t.parquet.journal").read_text().splitlines()[1:-1]]
    workers = {int(row["row"]["worker"].split(":")[1]) for row in rows}
    assert workers and _gone(workers), "workers outlive the sweep that was killed"
    with pytest.raises(fork1s.UsageError, match="another model or metric"):
        fork1s.sweep(arm, {"seed": [1]}, asked.deflection, path=tmp_path / "t.parquet", progress=False)
    os.chdir(tmp_path)
    table = fork1s.sweep(
        arm, {"seed": range(50), "log": ["log"]}, asked.logged, path="t.parquet", progress=False
    )
    assert len(table) == 50 and table["error"].isna().all()
    counts = np.bincount([int(n) for n in (tmp_path / "log").read_text().split()], minlength=50)
    # What was answered before the kill is not asked again: two may have been out, one was being written.
    assert (counts >= 1).all() and (counts > 1).sum() <= 4


def test_an_interrupt_ends_a_sweep_and_its_workers(tmp_path):
    program = tmp_path / "program.py"
    program.write_text(f"""
import os, signal, threading, time
import fork1s

def metric(model, point):
    if point["x"] == 0:
        return 1.0
    open(os.path.join({str(tmp_path)!r}, "worker"), "w").write(str(os.getpid()))
    time.sleep(3600)

def interrupt():
    while not os.path.exists(os.path.join({str(tmp_path)!r}, "worker")):
        time.sleep(0.05)
    os.kill(os.getpid(), signal.SIGINT)

if __name__ == "__main__":
    threading.Thread(target=interrupt, daemon=True).start()
    try:
        fork1s.sweep(fork1s.load(fork1s.scene("hand")), {{"x": [0, 1]}}, metric,
                     path=os.path.join({str(tmp_path)!r}, "t.parquet"))
    except KeyboardInterrupt:
        print("interrupted")
""")
    done = subprocess.run(
        [sys.executable, program], capture_output=True, text=True, timeout=300
    )  # far below the hour
    assert done.stdout == "interrupted\n", done.stderr
    worker = int((tmp_path / "worker").read_text())
    with pytest.raises(ProcessLookupError):
        os.kill(worker, 0)


def test_a_program_without_its_guard_is_told(arm, tmp_path):
    program = tmp_path / "program.py"
    program.write_text(
        f"import fork1s\nfork1s.sweep({str(arm)!r}, {{'seed': [1, 2]}}, lambda m, p: 0, progress=False)\n"
    )
    done = subprocess.run([sys.executable, program], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode != 0 and "`if __name__ == '__main__':`" in done.stderr


def test_dask_and_a_killed_worker(scenes, tmp_path):
    distributed = pytest.importorskip("distributed", reason="pip install distributed, for Dask")
    points = {"grip": np.linspace(0, 0.5, 25), "push": np.linspace(0, 0.1, 40)}
    killed = []
    with (
        distributed.LocalCluster(
            2, threads_per_worker=1, processes=True, dashboard_address=":0", silence_logs=50
        ) as cluster,
        distributed.Client(cluster) as client,
    ):

        def kill_one(done, total):
            if done >= 300 and not killed:
                assert done < total
                victim = next(iter(cluster.workers.values())).process.process.pid
                os.kill(victim, signal.SIGKILL)
                killed.append(victim)

        client.run(sys.path.insert, 0, str(Path(__file__).parent))
        table = fork1s.sweep(
            scenes / "fourbar_gripper.xml",
            points,
            asked.slid,
            client.get_executor(),
            path=tmp_path / "t.parquet",
            progress=kill_one,
        )
    said = table["error"].dropna()
    assert said.empty, said.value_counts().to_string()
    assert killed and len(table) == 1000
    kept = pandas.read_parquet(tmp_path / "t.parquet")
    assert len(kept) == 1000 and kept[["grip", "push"]].drop_duplicates().shape[0] == 1000
    # And what they answered is what this process computes.
    model = fork1s.load(scenes / "fourbar_gripper.xml")
    for i in (0, 40, 555, 999):
        assert asked.slid(model, dict(table.loc[i, ["grip", "push"]])) == table["metric"][i]
    assert table["metric"].nunique() > 500


def test_dask_and_a_worker_that_dies_as_its_answer_comes(arm, tmp_path, monkeypatch):
    """The scheduler's word that a result is lost comes between the result and who waits for it."""
    distributed = pytest.importorskip("distributed", reason="pip install distributed, for Dask")
    gather, lost = distributed.Client._gather, []

    async def gather_and_lose(client, futures, **how):
        answers = await gather(client, futures, **how)
        if len(lost) < 3:
            lost.append(futures[0].key)
            client._handle_lost_data(key=futures[0].key)
        return answers

    monkeypatch.setattr(distributed.Client, "_gather", gather_and_lose)
    with (
        distributed.LocalCluster(
            1, threads_per_worker=1, processes=False, dashboard_address=":0", silence_logs=50
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        log = tmp_path / "log"
        table = fork1s.sweep(
            arm, {"seed": range(20), "log": [str(log)]}, asked.logged, client.get_executor(), progress=False
        )
    assert len(lost) == 3 and table["error"].isna().all(), table["error"].dropna().value_counts().to_string()
    assert_allclose(table["moved"], expected(100))
    counts = np.bincount([int(n) for n in log.read_text().split()], minlength=20)
    assert sorted(counts)[-4:] == [1, 2, 2, 2]  # the lost ones once more, nothing else


def test_a_point_that_an_executor_fails_is_asked_once_more(arm):
    class Failing(concurrent.futures.ThreadPoolExecutor):
        """Fails the tasks that hold one of some seeds, some of them every time."""

        def __init__(self, once, always):
            super().__init__(2)
            self.asked, self._once, self._always = [], set(once), set(always)

        def submit(self, function, task, points, *rest):
            seeds = {values["seed"] for _, values in points}
            self.asked.append(seeds)
            if seeds & self._always or seeds & self._once:
                self._once -= seeds
                return super().submit(divmod, 1, 0)
            return super().submit(function, task, points, *rest)

    for chunk in (1, 4):
        executor = Failing(once={2, 9}, always={5})
        table = fork1s.sweep(
            arm, {"seed": range(12)}, asked.deflection, executor, progress=False, chunk=chunk
        )
        assert list(table.index[table["error"].notna()]) == [5] and "ZeroDivisionError" in table["error"][5]
        assert_allclose(table["moved"].drop(5), expected(100))
        assert executor.asked.count({5}) == (2 if chunk == 1 else 1)


def test_mpi(scenes, tmp_path):
    pytest.importorskip(
        "mpi4py", reason="pip install mpi4py, and an MPI (Debian's openmpi-bin, or pip install mpich)"
    )
    import shutil

    mpiexec = shutil.which("mpiexec", path=f"{Path(sys.executable).parent}:{os.environ['PATH']}")
    if mpiexec is None:
        pytest.skip("no mpiexec: install an MPI (Debian's openmpi-bin, or pip install mpich)")
    (tmp_path / "program.py").write_text(f"""
import sys
sys.path.insert(0, {str(Path(__file__).parent)!r})
import asked, fork1s
from mpi4py.futures import MPIPoolExecutor
if __name__ == "__main__":
    with MPIPoolExecutor() as pool:
        fork1s.sweep({str(scenes / "two_link_arm.xml")!r}, {{"stiffness:shoulder": range(50, 150)}}, asked.deflection, pool,
                     path="t.parquet", progress=False)
""")
    done = subprocess.run(
        [mpiexec, "-n", "3", sys.executable, "-m", "mpi4py.futures", "program.py"],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
        env={
            **os.environ,
            "OMPI_ALLOW_RUN_AS_ROOT": "1",
            "OMPI_ALLOW_RUN_AS_ROOT_CONFIRM": "1",
            "OMPI_MCA_rmaps_base_oversubscribe": "1",
            "PRTE_MCA_rmaps_default_mapping_policy": ":oversubscribe",
        },
    )
    assert done.returncode == 0, done.stderr
    table = pandas.read_parquet(tmp_path / "t.parquet")
    assert_allclose(table["moved"], expected(table["stiffness:shoulder"]), rtol=1e-9)
    assert len(table) == 100 and 1 <= table["worker"].nunique() <= 2


def test_models_go_to_other_processes(scenes):
    import pickle

    import mujoco

    for source in (
        scenes / "fourbar_gripper.xml",
        mujoco.MjModel.from_xml_path(str(scenes / "fourbar_gripper.xml")),
    ):
        model = fork1s.load(source, interface="left_jaw").with_stiffness({"left_crank": 3.0})
        again = pickle.loads(pickle.dumps(model))
        assert again.stiffnesses == model.stiffnesses and again.interfaces == ["left_jaw"]
        a, b = fork1s.Simulation(model), fork1s.Simulation(again)
        a.step(10), b.step(10)
        assert a.hash() == b.hash()


def test_refusals(arm, tmp_path):
    ask = lambda parameters, **more: fork1s.sweep(arm, parameters, asked.deflection, progress=False, **more)  # noqa: E731
    with pytest.raises(fork1s.UsageError, match="did you mean 'stiffness_scale'"):
        ask({"stifness_scale": [1]})
    with pytest.raises(fork1s.UsageError, match="comes twice"):
        ask([{"a": 1}, {"a": 1}])
    with pytest.raises(fork1s.UsageError, match="no point"):
        ask({"a": []})
    with pytest.raises(fork1s.UsageError, match="give a list"):
        ask({"a": "abc"})
    with pytest.raises(fork1s.UsageError, match="two kinds, float and str"):
        ask([{"a": 1}, {"a": "b"}])
    with pytest.raises(fork1s.UsageError, match="has a column of this name"):
        ask({"error": [1]})
    with pytest.raises(fork1s.FileError, match="folder does not exist"):
        ask({"a": [1]}, path=tmp_path / "none" / "t.parquet")
    (tmp_path / "text").write_text("hello")
    with pytest.raises(fork1s.UsageError, match="is no Parquet file"):
        ask({"a": [1]}, path=tmp_path / "text")
    pandas.DataFrame({"a": [1]}).to_parquet(tmp_path / "other.parquet")
    with pytest.raises(fork1s.UsageError, match="not written by a sweep"):
        ask({"a": [1]}, path=tmp_path / "other.parquet")
