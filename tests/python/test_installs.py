"""The wheel beside the package mujoco, in fresh environments: neither breaks the other, whichever came first.

tools/wheel.sh runs these, with FORK1S_WHEEL, the wheel, and FORK1S_PIP, the pip that installs it.
"""

import json
import os
import subprocess
import sys
from pathlib import Path

import pytest

WHEEL, PIP = os.environ.get("FORK1S_WHEEL", ""), os.environ.get("FORK1S_PIP", "")
pytestmark = pytest.mark.skipif(
    not (WHEEL and PIP), reason="tools/wheel.sh says which wheel (FORK1S_WHEEL, FORK1S_PIP)"
)
# The last whose library is in the package mujoco, and the first that takes it from the package mujoco-core.
OTHERS = ("mujoco==3.17.0", "mujoco==4.0.0")
# Both orders of both versions where ./check --all sets this; otherwise each version and each order once.
ALL = "FORK1S_ALL_DRAWS" in os.environ

OURS = """
import fork1s
model = fork1s.load(fork1s.scene("fourbar_gripper"))
sim = fork1s.Simulation(model)
sim.step(5)
"""
THEIRS = f"""
import mujoco, numpy as np
assert mujoco.mj_versionString() == mujoco.__version__, "package and library are of two versions"
path = {str(Path(__file__).resolve().parents[2] / "scenes" / "fourbar_gripper.xml")!r}
mj_model = mujoco.MjModel.from_xml_path(path)
mujoco.mj_step(mj_model, mujoco.MjData(mj_model))
"""
BOTH = """
assert fork1s.mujoco_version != mujoco.__version__, "the test is of two versions"
def hash_of(source):
    sim = fork1s.Simulation(fork1s.load(source))
    sim.controls["left_grip"] = 0.3
    sim.step(30)
    return sim.hash()
expected = hash_of(path)
assert hash_of(mj_model) == expected, "MjModel"
assert hash_of(mujoco.MjSpec.from_file(path)) == expected, "MjSpec"
# What was changed in a compiled model counts.
arm = path.replace("fourbar_gripper", "two_link_arm")
changed = mujoco.MjModel.from_xml_path(arm)
changed.jnt_stiffness[:] *= 4
assert np.allclose(fork1s.load(changed).frequencies, 2 * fork1s.load(arm).frequencies, rtol=1e-9)
# MuJoCo writes the XML that it read last: another model is refused, not mistaken for it.
other = mujoco.MjModel.from_xml_string(open(path).read().replace("left_crank", "lever"))
for old in (changed, mj_model):
    try:
        fork1s.load(old)
        raise SystemExit("a model was mistaken for another")
    except fork1s.UsageError as error:
        assert mujoco.__version__ in str(error) and fork1s.mujoco_version in str(error), error
assert "lever" in fork1s.load(other).stiffnesses
# Meshes in another folder.
import os, tempfile
folder = tempfile.mkdtemp()
os.mkdir(folder + "/meshes")
with open(folder + "/meshes/part.obj", "w") as file:
    file.write("v 0 0 0\\nv 1 0 0\\nv 0 1 0\\nv 0 0 1\\nf 1 3 2\\nf 1 2 4\\nf 1 4 3\\nf 2 3 4\\n")
text = ('<mujoco><compiler meshdir="meshes"/><asset><mesh name="m" file="part.obj"/></asset><worldbody><body name="b">'
        '<joint stiffness="1"/><geom type="mesh" mesh="m"/></body></worldbody></mujoco>')
with open(folder + "/model.xml", "w") as file:
    file.write(text)
mass = fork1s.load(folder + "/model.xml").mechanisms[0].mass
for source in (mujoco.MjModel, mujoco.MjSpec):
    source = (source.from_xml_path if source is mujoco.MjModel else source.from_file)(folder + "/model.xml")
    assert np.isclose(fork1s.load(source).mechanisms[0].mass, mass, rtol=1e-9)
in_memory = mujoco.MjSpec.from_string(text, assets={"part.obj": open(folder + "/meshes/part.obj", "rb").read()})
assert np.isclose(fork1s.load(in_memory).mechanisms[0].mass, mass, rtol=1e-9), "assets in memory"
# And the step of fork1s in the loop of the other version.
import fork1s.mujoco
mj_model = mujoco.MjModel.from_xml_path(path)
data = mujoco.MjData(mj_model)
fork1s.mujoco.Stepper(mj_model, dt=1 / 60).step(data, 5)
assert np.isfinite(data.qpos).all()
"""


class Environment:
    """A fresh environment of Python with packages from the registry."""

    def __init__(self, folder):
        self.python = folder / "env" / "bin" / "python"
        subprocess.run([sys.executable, "-m", "venv", "--without-pip", folder / "env"], check=True)

    def install(self, *packages):
        done = subprocess.run(
            [
                PIP,
                "--python",
                self.python,
                "install",
                "--quiet",
                "--disable-pip-version-check",
                "--no-compile",
                "--retries",
                "1",
                "--timeout",
                "10",
                *packages,
            ],
            capture_output=True,
            text=True,
        )
        if done.returncode and any(
            said in done.stderr for said in ("NewConnectionError", "ConnectTimeout", "Connection")
        ):
            pytest.skip(f"Python's registry is not reached: {done.stderr.strip().splitlines()[-1]}")
        assert done.returncode == 0, done.stderr

    def run(self, *programs, **environment):
        names = ("PYTHONPATH", "LD_LIBRARY_PATH")
        done = subprocess.run(
            [self.python, "-c", "\n".join(programs)],
            capture_output=True,
            text=True,
            cwd=self.python.parent,
            env={**{k: v for k, v in os.environ.items() if k not in names}, **environment},
        )
        assert done.returncode == 0, done.stderr
        return done

    def check_both(self):
        self.run(OURS, THEIRS, BOTH)
        self.run(THEIRS, OURS, BOTH)
        # By the flag that makes the functions of a library known to all that come after it.
        everywhere = "import sys, os\nsys.setdlopenflags(os.RTLD_NOW | os.RTLD_GLOBAL)"
        self.run(everywhere, THEIRS, OURS, BOTH)
        self.run(everywhere, OURS, THEIRS, BOTH)


@pytest.fixture
def environment(tmp_path):
    return Environment(tmp_path)


def test_alone(environment):
    environment.install(WHEEL)
    environment.run(OURS)
    packages = environment.python.parents[1] / "lib" / f"python3.{sys.version_info.minor}" / "site-packages"
    assert not (packages / "mujoco").exists()
    assert {p.name.partition("-")[0].partition(".")[0] for p in packages.iterdir()} == {"fork1s", "numpy"}
    # The license of each library that the wheel carries: MuJoCo's, and those of Debian's packages.
    lib = packages / "fork1s" / "lib"
    assert len(list(lib.glob("LICENSE*"))) == 2
    assert {p.name for p in (lib / "licenses").iterdir()} == {"nanobind.txt", "robin_map.txt"}
    info = next(packages.glob("fork1s-*.dist-info"))
    carried = json.loads((info / "sboms" / "auditwheel.cdx.json").read_text())["components"]
    licenses = {p.stem for p in (info / "licenses").iterdir() if p.stat().st_size}
    assert {c["name"] for c in carried} - {"fork1s"} <= licenses - {"LICENSE"} and "libassimp5" in licenses
    # auditwheel does not know the package of every library, nor of headers.
    assert {"libcom-err2", "libkeyutils1", "libeigen3-dev"} <= {c["name"] for c in carried}
    # Without the package mujoco, what needs it says so; a plugin of MuJoCo's and the command do not need it.
    environment.run("""
import fork1s, os, subprocess, sys
try:
    fork1s.mujoco
    raise SystemExit("fork1s.mujoco without mujoco")
except ModuleNotFoundError as error:
    assert "pip install 'fork1s[mujoco]'" in str(error), error
fork1s.load('''<mujoco><extension><plugin plugin="mujoco.pid"><instance name="p"><config key="kp" value="5"/></instance>
  </plugin></extension><worldbody><body name="b"><joint name="j" stiffness="1"/><geom size=".1"/></body></worldbody>
  <actuator><plugin joint="j" plugin="mujoco.pid" instance="p"/></actuator></mujoco>''')
said = subprocess.run([os.path.join(os.path.dirname(sys.executable), "fork1s"), "--version"], capture_output=True, text=True)
assert said.returncode == 0 and fork1s.__version__ in said.stdout, said
""")


@pytest.mark.parametrize("other", OTHERS if ALL else OTHERS[:1])
def test_after_another_version_of_mujoco(environment, other):
    environment.install(other)
    environment.install(WHEEL)
    environment.check_both()


@pytest.mark.parametrize("other", OTHERS if ALL else OTHERS[1:])
def test_before_another_version_of_mujoco(environment, other):
    environment.install(WHEEL)
    environment.install(other)
    environment.check_both()


def test_a_mix_of_packages_of_mujoco(environment):
    """The packages mujoco 3 and mujoco-core share a folder, and import mujoco fails; fork1s has a library of its own."""
    environment.install(WHEEL, "mujoco==3.7.0")
    environment.run(OURS, THEIRS)
    environment.install("mujoco-core==4.0.1")
    environment.run(
        OURS,
        """
try:
    import mujoco
    raise SystemExit("the mix is imported: test another")
except OSError:
    pass
try:
    fork1s.mujoco
    raise SystemExit("fork1s.mujoco by a mix of packages")
except ImportError as error:
    assert "libmujoco.so.3.7.0" in str(error) and "pip uninstall mujoco mujoco-core" in str(error), error
""",
    )


def test_in_one_command_with_gymnasium(environment):
    environment.install(
        f"fork1s[learn] @ file://{Path(WHEEL).absolute()}", "gymnasium[mujoco]==1.4.0", "mujoco==4.0.0"
    )
    environment.check_both()
    environment.run("""
import gymnasium, fork1s.learn
for name in ("fork1s/GraspLift-v0", "HalfCheetah-v5"):
    env = gymnasium.make(name)
    env.reset(seed=1)
    env.step(env.action_space.sample())
""")
