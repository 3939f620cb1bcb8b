"""Sites and cameras beside MuJoCo's."""

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose
from test_file_state import EVERYTHING, data_at, random_state

import fork1s

MARKED = (
    EVERYTHING.replace("<worldbody>", '<worldbody><site name="home" pos="1 2 3" quat="0.6 0 0 0.8"/>')
    .replace('<body name="foot"', '<camera name="eye" pos="0.1 0 0" quat="0.8 0 0.6 0"/><body name="foot"')
    .replace(
        '<joint name="ankle"', '<site name="sole" pos="0 0.1 -0.02" euler="0.3 0.2 0.1"/><joint name="ankle"'
    )
    .replace('<freejoint name="cube"/>', '<freejoint name="cube"/><site pos="0.1 0.2 0.3"/>')
    .replace('<joint name="swing"', '<camera name="tracker" mode="trackcom"/><joint name="swing"')
)


@pytest.mark.parametrize("seed", range(3))
def test_frames_are_where_mujoco_has_them(seed):
    model = mujoco.MjModel.from_xml_string(MARKED)
    sim = fork1s.Simulation(fork1s.load(MARKED))
    qpos, qvel = random_state(model, seed)
    sim.set_state(qpos, qvel)
    data = data_at(model, qpos, qvel)
    assert list(sim.site_poses) == ["home", "site1", "sole"]
    assert list(sim.camera_poses) == ["eye"]
    frames = [(pose, data.site_xpos[i], data.site_xmat[i]) for i, pose in enumerate(sim.site_poses.values())]
    eye = model.camera("eye").id
    frames.append((sim.camera_poses["eye"], data.cam_xpos[eye], data.cam_xmat[eye]))
    for pose, position, matrix in frames:
        turn = np.zeros(9)
        mujoco.mju_quat2Mat(turn, pose[3:])
        assert_allclose(pose[:3], position, atol=1e-9)
        assert_allclose(turn, np.ravel(matrix), atol=1e-9)


def test_a_free_body_that_an_option_places_takes_its_site_along():
    ball = """<mujoco><worldbody><body name="ball" pos="0 0 1"><freejoint/><geom size="0.1" mass="1"/>
      <site name="mark" pos="0.1 0 0"/></body></worldbody><sensor><framepos name="at" objtype="site" objname="mark"/></sensor>
      </mujoco>"""
    sim = fork1s.Simulation(fork1s.load(ball, base_pose=[5, 6, 7]))
    assert_allclose(sim.site_poses["mark"][:3], [5.1, 6, 7], atol=1e-12)
    assert_allclose(sim.sensors["at"], [5.1, 6, 7], atol=1e-12)
