"""Pictures of environments: where bodies are drawn, by MuJoCo's own kinematics and by the projection of a camera."""

import os
import subprocess
import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose

import fork1s

pytest.importorskip("gymnasium", reason="pip install 'fork1s[learn]'")
mujoco = pytest.importorskip("mujoco", reason="pip install 'fork1s[mujoco]'")

import fork1s.learn as learn  # noqa: E402

# A camera at (0, -2, 0) that looks along y, z up, on a red ball at the end of a lever of 0.5 m, with a site and a second
# body that is welded to the first.
LEVER = """<mujoco><visual><headlight ambient="1 1 1" diffuse="0 0 0" specular="0 0 0"/></visual><worldbody>
  <camera name="front" pos="0 -2 0" xyaxes="1 0 0 0 0 1" fovy="45"/><light pos="0 0 3"/>
  <body name="lever" pos="0 0 .1"><joint name="j" axis="0 1 0" stiffness="2" damping=".1"/>
    <geom name="ball" size=".04" mass=".2" pos=".5 0 0" rgba="1 0 0 1"/><site name="s" pos=".2 0 .1" euler="10 20 30"/>
    <body name="welded" pos=".1 0 0" euler="0 30 0"><geom type="box" size=".01 .01 .01" pos="0 0 .1" rgba="0 0 1 1" mass=".01"/>
      <camera name="mounted" pos="0 .1 0" euler="90 0 0"/></body></body></worldbody>
  <actuator><position name="p" joint="j" kp="5"/></actuator></mujoco>"""


class Swing(learn.Task):
    """A lever that is told where to turn to."""

    name = "Swing"
    actions = 1
    observations = 1

    def act(self, action):
        return action

    def observe(self, now):
        return now.joint_displacements[:, :1]

    def judge(self, before, now, action):
        never = np.zeros(self.count, dtype=bool)
        return np.zeros(self.count), never, never


class Screen:
    """In place of MuJoCo's renderer, where there is no OpenGL."""

    def __init__(self, model, height, width):
        self.size = (height, width)

    def update_scene(self, data, camera):
        self.camera = camera

    def render(self):
        return np.zeros((*self.size, 3), dtype=np.uint8)

    def close(self):
        pass


@pytest.mark.parametrize("source", ["lever", "hand.xml", "fourbar_gripper.xml", "quadruped.xml"])
def test_everything_is_drawn_where_mujoco_has_it(source, scenes, monkeypatch):
    monkeypatch.setattr(mujoco, "Renderer", Screen)
    model = fork1s.load(LEVER if source == "lever" else scenes / source)
    sim = fork1s.Simulation(model)
    for name in sim.controls:
        if "." not in name:  # a driven base moves here alone: a body of the world has no joint in MuJoCo
            sim.controls[name] += 0.2
    sim.step(20)
    renderer = fork1s.learn.Renderer(model, 24, 32, None)
    drawn = renderer.set_poses(sim.poses)
    data = mujoco.MjData(renderer._mj)
    data.qpos[:] = sim.qpos
    mujoco.mj_kinematics(renderer._mj, data)
    mujoco.mj_comPos(renderer._mj, data)
    mujoco.mj_camlight(renderer._mj, data)
    for name in (
        "xpos",
        "xmat",
        "xipos",
        "geom_xpos",
        "geom_xmat",
        "site_xpos",
        "site_xmat",
        "cam_xpos",
        "light_xpos",
    ):
        # Loops are closed to 1e-10 rad or m, which a chain of ten bodies of 0.1 m adds up.
        assert_allclose(getattr(drawn, name), getattr(data, name), atol=1e-8, err_msg=name)
    assert renderer.draw(sim.poses).shape == (24, 32, 3)


def test_sizes_and_modes(monkeypatch):
    monkeypatch.setattr(mujoco, "Renderer", Screen)
    picture = learn.Picture(height=24, width=32, camera="front")
    one = learn.Environment(Swing, randomise=False, model=LEVER, render_mode="rgb_array", picture=picture)
    one.reset(seed=1)
    assert one.render().shape == (24, 32, 3) and one.render().dtype == np.uint8
    assert one.members.renderer._renderer.camera == 0 and one.metadata["render_fps"] == 30
    many = learn.VectorEnvironment(
        3, Swing, randomise=False, model=LEVER, render_mode="rgb_array", picture=picture
    )
    many.reset(seed=1)
    assert [frame.shape for frame in many.render()] == [(24, 32, 3)] * 3
    assert "autoreset_mode" in many.metadata
    many.close()
    assert many.members.renderer is None
    assert learn.Environment(Swing, randomise=False, model=LEVER).render() is None
    with pytest.raises(fork1s.UsageError, match="render_mode is 'human'; give 'rgb_array' or None"):
        learn.Environment(Swing, randomise=False, model=LEVER, render_mode="human")
    with pytest.raises(fork1s.UnknownNameError, match="there is no camera 'side'; there are: front, mounted"):
        learn.Environment(
            Swing, randomise=False, model=LEVER, render_mode="rgb_array", picture=learn.Picture(camera="side")
        )


def test_without_opengl_a_sentence(monkeypatch):
    def none(*_):
        raise ImportError("no OpenGL")

    monkeypatch.setattr(mujoco, "Renderer", none)
    with pytest.raises(fork1s.UsageError, match=r"cannot use OpenGL here \(no OpenGL\); .*MUJOCO_GL=egl"):
        learn.Environment(Swing, randomise=False, model=LEVER, render_mode="rgb_array")


def test_without_mujoco_a_sentence(monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    with pytest.raises(
        ModuleNotFoundError, match=r"this needs the package mujoco.*pip install 'fork1s\[mujoco\]'"
    ):
        learn.Environment(Swing, randomise=False, model=LEVER, render_mode="rgb_array")


PICTURES = """
import os, sys
import gymnasium, numpy as np
sys.path.insert(0, os.path.dirname({file!r}))
import fork1s, fork1s.learn as learn
from test_learn_render import LEVER, Swing
make = lambda: learn.Environment(Swing, randomise=False, model=LEVER, render_mode="rgb_array",
    picture=learn.Picture(240, 320, "front"))
try:
    env = make()
except fork1s.UsageError as error:
    print("skip:", error)
    raise SystemExit
env.reset(seed=1)
for action in (0.0, 0.8, -0.8):
    for _ in range(60):
        env.step([action])
    frame = env.render().astype(int)
    red = (frame[..., 0] > 100) & (frame[..., 1] < 60) & (frame[..., 2] < 60)
    rows, columns = np.nonzero(red)
    angle = env.members.batch.qpos[0, 0]
    x, z = 0.5 * np.cos(angle), 0.1 - 0.5 * np.sin(angle)  # of the ball, in the plane y = 0, 2 m before the camera
    focal = 120 / np.tan(np.radians(22.5))  # pixels
    expected = np.array([119.5 - focal * z / 2, 159.5 + focal * x / 2])
    found = np.array([rows.mean(), columns.mean()])
    # The ball of 0.04 m is 12 pixels wide: its centroid is found to a pixel, and its outline is centred 0.04 % beside it.
    assert len(rows) > 50 and np.abs(found - expected).max() < 1, (found, expected)
env.close()
try:
    import moviepy
except ImportError:
    print("pictures")
    raise SystemExit
env = gymnasium.wrappers.RecordVideo(make(), {folder!r}, episode_trigger=lambda n: True, disable_logger=True)
env.reset(seed=1)
for _ in range(5):
    env.step([0.5])
env.close()
print("pictures and", *os.listdir({folder!r}))
"""


@pytest.mark.parametrize("gl", ["egl", "osmesa"])
def test_pictures_by_a_camera(gl, tmp_path):
    script = PICTURES.format(file=__file__, folder=str(tmp_path / "videos"))
    done = subprocess.run(
        [sys.executable, "-c", script],
        env={**os.environ, "MUJOCO_GL": gl},
        capture_output=True,
        text=True,
        timeout=300,
    )
    if done.stdout.startswith("skip:") or "OpenGL" in done.stderr:
        pytest.skip(f"this machine draws nothing with MUJOCO_GL={gl}: {(done.stdout + done.stderr)[-200:]}")
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.strip() == "pictures" or ".mp4" in done.stdout
