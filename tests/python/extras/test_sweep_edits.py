"""Rows of an edited model or metric are computed again, and failures are told."""

import functools
import importlib
import os
import subprocess
import sys
import warnings
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from numpy.testing import assert_array_equal

import fork1s

pandas = pytest.importorskip("pandas", reason="pip install 'fork1s[sweep]'")
pytest.importorskip("pyarrow", reason="pip install 'fork1s[sweep]'")
pytest.importorskip("cloudpickle", reason="functions without a name need it")

from fork1s._sweep_identity import identity_of  # noqa: E402

BODY = '<body name="b"><joint name="j" stiffness="1"/><geom size=".1" mass="{mass}"/></body>'
TETRAHEDRON = "v 0 0 0\nv {size} 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"


def mass(model, point):
    return model.mechanisms[0].mass


class Sweeps:
    """Sweeps of this process over x = 0, 1, 2, by the file of one path. `asked` counts the points that were computed."""

    def __init__(self, folder):
        self.path = folder / "t.parquet"

    def __call__(self, model, metric, points=(0, 1, 2)):
        done = []
        with ThreadPoolExecutor(1) as executor:
            table = fork1s.sweep(
                model,
                {"x": points},
                metric,
                executor,
                path=self.path,
                progress=lambda count, total: done.append(count),
            )
        self.asked = len(done)
        return table


@pytest.fixture
def sweeps(tmp_path):
    with warnings.catch_warnings():
        warnings.simplefilter("error", fork1s.SweepWarning)
        yield Sweeps(tmp_path)


@pytest.fixture
def module(tmp_path, monkeypatch):
    """Writes modules, and imports them as a new process would."""
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.setattr(sys, "dont_write_bytecode", True)
    written = {}

    def write(**sources):
        written.update(sources)
        for name, text in sources.items():
            (tmp_path / f"{name}.py").write_text(text)
        for name in written:
            sys.modules.pop(name, None)
        importlib.invalidate_caches()
        return importlib.import_module(next(iter(written)))

    yield write
    for name in written:
        sys.modules.pop(name, None)


def write_model(folder, mass=1.0):
    (folder / "part.xml").write_text(f"<mujocoinclude>{BODY.format(mass=mass)}</mujocoinclude>")
    (folder / "model.xml").write_text('<mujoco><worldbody><include file="part.xml"/></worldbody></mujoco>')
    return folder / "model.xml"


def test_an_unchanged_sweep_computes_nothing_again(sweeps, tmp_path):
    model = write_model(tmp_path)
    before = sweeps(model, mass)
    assert sweeps.asked == 3
    pandas.testing.assert_frame_equal(before, sweeps(model, mass))
    assert sweeps.asked == 0
    sweeps(model, mass, (1, 2, 3, 4))
    assert sweeps.asked == 2


def test_an_edited_model_is_computed_again(sweeps, tmp_path):
    model = tmp_path / "model.xml"
    for value in (1.0, 2.0):
        model.write_text(f"<mujoco><worldbody>{BODY.format(mass=value)}</worldbody></mujoco>")
        if value == 2.0:
            with pytest.warns(
                fork1s.SweepWarning, match=r"t\.parquet: the model has changed since its 3 rows were computed"
            ):
                table = sweeps(model, mass)
        else:
            table = sweeps(model, mass)
        assert sweeps.asked == 3
        assert_array_equal(table["metric"], [value] * 3)
    # Rows of points that are not in this call are dropped as well: the file holds those of one model.
    model.write_text(f"<mujoco><worldbody>{BODY.format(mass=3)}</worldbody></mujoco>")
    with pytest.warns(fork1s.SweepWarning, match="the model has changed"):
        sweeps(model, mass, (0,))
    assert_array_equal(pandas.read_parquet(sweeps.path)["metric"], [3])


def test_an_edited_included_file_is_computed_again(sweeps, tmp_path):
    sweeps(write_model(tmp_path, 1.0), mass)
    with pytest.warns(fork1s.SweepWarning, match="the model has changed"):
        table = sweeps(write_model(tmp_path, 2.0), mass)
    assert_array_equal(table["metric"], [2] * 3)
    # And where the model was loaded before it was handed over.
    with pytest.warns(fork1s.SweepWarning, match="the model has changed"):
        table = sweeps(fork1s.load(write_model(tmp_path, 3.0), modes=0), mass)
    assert_array_equal(table["metric"], [3] * 3)


@pytest.mark.parametrize("where", ["", "meshes"])
def test_an_edited_mesh_is_computed_again(sweeps, tmp_path, where):
    (tmp_path / "meshes").mkdir()
    mesh, model = tmp_path / where / "part.obj", tmp_path / "model.xml"
    # The folder of the meshes is said in a file of its own.
    (tmp_path / "settings.xml").write_text(f'<mujocoinclude><compiler meshdir="{where}"/></mujocoinclude>')
    model.write_text(
        '<mujoco><include file="settings.xml"/><asset><mesh name="m" file="part.obj"/></asset><worldbody>'
        '<body name="b"><joint stiffness="1"/><geom type="mesh" mesh="m"/></body></worldbody></mujoco>'
    )
    mesh.write_text(TETRAHEDRON.format(size=1))
    before = sweeps(model, mass)["metric"][0]
    mesh.write_text(TETRAHEDRON.format(size=2))
    os.utime(mesh, (0, 0))  # MuJoCo caches meshes of a process by name and second
    with pytest.warns(fork1s.SweepWarning, match="the model has changed"):
        after = sweeps(model, mass)["metric"][0]
    assert after == pytest.approx(2 * before)


def test_an_edited_mesh_of_a_urdf_counts(tmp_path, monkeypatch):
    monkeypatch.delenv("ROS_PACKAGE_PATH", raising=False)
    package = tmp_path / "robot"
    for folder in ("urdf", "meshes"):
        (package / folder).mkdir(parents=True)
    urdf, mesh = package / "urdf" / "robot.urdf", package / "meshes" / "arm.obj"
    urdf.write_text(
        '<robot name="r"><link name="a"><collision><geometry><mesh filename="package://robot/meshes/arm.obj"/>'
        "</geometry></collision></link></robot>"
    )
    digests = set()
    for size in (1, 2, 2):
        mesh.write_text(TETRAHEDRON.format(size=size))
        digests.add(identity_of(urdf, mass).contents["model"])
    assert len(digests) == 2


def test_an_edited_metric_is_computed_again(sweeps, module, tmp_path):
    model = write_model(tmp_path)
    body = 'def metric(model, point):\n    """{doc}"""\n    # {comment}\n    return point["x"] * {factor}\n'
    sweeps(model, module(mine=body.format(doc="A", comment="b", factor=2)).metric)
    sweeps(model, module(mine=body.format(doc="Other", comment="words", factor=2)).metric)
    assert sweeps.asked == 0
    with pytest.warns(fork1s.SweepWarning, match="the metric has changed"):
        table = sweeps(model, module(mine=body.format(doc="A", comment="b", factor=3)).metric)
    assert_array_equal(table["metric"], [0, 3, 6])


@pytest.mark.parametrize(
    "metric, helper",
    [
        (
            "from helper import f\ndef metric(model, point):\n    return f(point['x'])\n",
            "def f(x):\n    return {} * x\n",
        ),
        (
            "import helper\ndef metric(model, point):\n    return helper.f(point['x'])\n",
            "def f(x):\n    return {} * x\n",
        ),
        (
            "def metric(model, point):\n    from helper import f\n    return f(point['x'])\n",
            "def f(x):\n    return {} * x\n",
        ),
        (
            "import helper\ndef metric(model, point):\n    return [helper.f(point['x']) for _ in '1'][0]\n",
            "FACTOR = {}\ndef g(x):\n    return FACTOR * x\ndef f(x):\n    return g(x)\n",
        ),
        (
            "from helper import Law\nlaw = Law()\ndef metric(model, point):\n    return law(point['x'])\n",
            "class Base:\n    def f(self, x):\n        return {} * x\nclass Law(Base):\n    def __call__(self, x):\n"
            "        return self.f(x)\n",
        ),
        (
            "from helper import table\ndef metric(model, point):\n    return table[point['x']]\n",
            "import numpy\ntable = {} * numpy.arange(3.0)\n",
        ),
    ],
    ids=["from import", "module", "import inside", "comprehension and global", "method of a base", "array"],
)
def test_an_edited_helper_of_the_metric_is_computed_again(sweeps, module, tmp_path, metric, helper):
    model = write_model(tmp_path)
    sweeps(model, module(mine=metric, helper=helper.format(2)).metric)
    sweeps(model, module(mine=metric, helper=helper.format(2)).metric)
    assert sweeps.asked == 0
    with pytest.warns(fork1s.SweepWarning, match="the metric has changed"):
        table = sweeps(model, module(mine=metric, helper=helper.format(3)).metric)
    assert_array_equal(table["metric"], [0, 3, 6])


@pytest.mark.parametrize(
    "make",
    [
        lambda factor: lambda model, point: factor * point["x"],
        lambda factor: lambda model, point, factor=factor: factor * point["x"],
        lambda factor: functools.partial(lambda factor, model, point: factor * point["x"], factor),
    ],
    ids=["closure", "default", "partial"],
)
def test_a_changed_value_of_the_metric_is_computed_again(sweeps, tmp_path, make):
    model = write_model(tmp_path)
    sweeps(model, make(2))
    sweeps(model, make(2))
    assert sweeps.asked == 0
    with pytest.warns(fork1s.SweepWarning, match="the metric has changed"):
        table = sweeps(model, make(3))
    assert_array_equal(table["metric"], [0, 3, 6])


def test_a_function_as_the_model_counts_with_its_files(sweeps, tmp_path):
    path = write_model(tmp_path, 1.0)
    sweeps(lambda x: path, mass)
    sweeps(lambda x: path, mass)
    assert sweeps.asked == 0
    write_model(tmp_path, 2.0)
    with pytest.warns(fork1s.SweepWarning, match="the model has changed"):
        assert_array_equal(sweeps(lambda x: path, mass)["metric"], [2] * 3)


def test_rows_of_an_edited_metric_in_the_journal_are_dropped(sweeps, tmp_path):
    model = write_model(tmp_path)

    def metric_of(factor):
        return lambda model, point: factor * point["x"]

    class Stop(Exception):
        pass

    def stop(done, total):
        raise Stop

    with ThreadPoolExecutor(1) as executor, pytest.raises(Stop):
        fork1s.sweep(
            model, {"x": [0, 1, 2]}, metric_of(2), executor, path=sweeps.path, progress=stop, in_flight=1
        )
    with pytest.warns(fork1s.SweepWarning, match="the metric has changed since its 1 rows"):
        table = sweeps(model, metric_of(3))
    assert_array_equal(table["metric"], [0, 3, 6])


def test_digests_are_the_same_in_every_process(tmp_path):
    program = tmp_path / "program.py"
    program.write_text(f"""
import dataclasses, enum, sys
import mujoco, numpy as np
import fork1s
from fork1s._sweep_identity import identity_of
class Kind(enum.Enum):
    A = 1
@dataclasses.dataclass
class Options:
    names: set = dataclasses.field(default_factory=lambda: {{"a", "b", "c"}})
    table: np.ndarray = dataclasses.field(default_factory=lambda: np.arange(3))
    kind: Kind = Kind.A
options = Options()
def metric(model, point):
    return point["x"] in {{"a", "b", "c", "d"}} and options.table[0] and np.linalg.norm(np.cos(options.table))
scene = {str(write_model(tmp_path))!r}
model = mujoco.MjModel.from_xml_path(scene)
for source in (scene, fork1s.load(scene), model, fork1s.load(model), mujoco.MjSpec.from_file(scene)):
    print(identity_of(source, metric))
""")
    said = {
        subprocess.run(
            [sys.executable, program],
            env={**os.environ, "PYTHONHASHSEED": seed},
            capture_output=True,
            text=True,
            check=True,
        ).stdout
        for seed in ("1", "2")
    }
    assert len(said) == 1


def test_failures_are_told_and_asked_again(sweeps, tmp_path):
    model, works = write_model(tmp_path), tmp_path / "works"

    def metric(model, point):
        if point["x"] > 0 and not Path(point["file"]).exists():
            raise ValueError(f"no file for {point['x']}")
        return 1.0

    def ask():
        done = []
        with ThreadPoolExecutor(1) as executor:
            table = fork1s.sweep(
                model,
                {"x": [0, 1, 2], "file": [str(works)]},
                metric,
                executor,
                path=sweeps.path,
                progress=lambda count, total: done.append(count),
            )
        return table, len(done)

    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        table, asked = ask()
    assert asked == 3 and list(table["error"].notna()) == [False, True, True]
    first, last = (str(w.message) for w in said)
    assert "the point x = 1, file =" in first and "ValueError: no file for 1" in first
    assert "2 of 3 points failed" in last
    assert all(w.category is fork1s.SweepWarning and w.filename == __file__ for w in said)
    works.touch()
    table, asked = ask()
    assert asked == 2 and table["error"].isna().all()
    assert ask()[1] == 0


def test_a_sweep_of_which_all_fail_is_an_error(sweeps, tmp_path):
    model = write_model(tmp_path)

    def metric(model, point):
        raise ValueError(f"x is {point['x']}")

    with (
        pytest.warns(fork1s.SweepWarning, match="the point x = 0 failed: ValueError: x is 0"),
        pytest.raises(
            fork1s.SweepError, match="all of 3 points failed, the first with: ValueError: x is 0"
        ) as raised,
    ):
        sweeps(model, metric)
    assert len(raised.value.table) == 3 and len(pandas.read_parquet(sweeps.path)) == 3


@pytest.mark.parametrize("works_from, told_at", [(49, 5), (4, None), (5, 5)], ids=["all", "four", "five"])
def test_failures_of_all_first_points_are_told_before_the_others_are_asked(tmp_path, works_from, told_at):
    def metric(model, point):
        if point["x"] < works_from:
            raise ValueError(f"x is {point['x']}")
        return 1.0

    done_when_told = []
    with warnings.catch_warnings(record=True) as said, ThreadPoolExecutor(1) as executor:
        warnings.simplefilter("always")

        def count(done, total):
            if not done_when_told and any("all of the first 5 points failed" in str(w.message) for w in said):
                done_when_told.append(done)

        ask = lambda: fork1s.sweep(  # noqa: E731
            write_model(tmp_path), {"x": range(49)}, metric, executor, progress=count, in_flight=1
        )
        if works_from < 49:
            ask()
        else:
            with pytest.raises(fork1s.SweepError, match="all of 49 points failed"):
                ask()
    assert done_when_told == ([] if told_at is None else [told_at])
    assert not done_when_told or "the last with: ValueError: x is 4" in str(said[1].message)


def test_a_file_of_another_sweep_is_refused(sweeps, tmp_path):
    model = write_model(tmp_path)
    sweeps(model, mass)
    with pytest.raises(
        fork1s.UsageError, match=r"holds a sweep of another model or metric \(model.xml, mass; now model.xml"
    ):
        sweeps(model, lambda model, point: 1)
