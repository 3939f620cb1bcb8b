"""Environments: Gymnasium's own checker, one and many alike, and that each can be done."""

import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import fork1s

gymnasium = pytest.importorskip("gymnasium", reason="pip install 'fork1s[learn]'")

import fork1s.learn as learn  # noqa: E402

NAMES = [f"fork1s/{task.name}-v0" for task in learn.TASKS]


@pytest.fixture(autouse=True)
def scenes_of_the_repository(scenes, monkeypatch):
    monkeypatch.setattr(learn, "scene", lambda name: scenes / f"{name}.xml")


@pytest.mark.parametrize("name", NAMES)
def test_gymnasiums_checker(name):
    from gymnasium.utils.env_checker import check_env

    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gymnasium.make(name).unwrapped, skip_render_check=True)  # test_learn_render.py


@pytest.mark.parametrize("name", NAMES)
def test_many_are_as_one(name):
    one, many = gymnasium.make(name, randomise=False), gymnasium.make_vec(name, num_envs=3, randomise=False)
    assert isinstance(many.unwrapped, learn.VectorEnvironment)
    seen, _ = one.reset(seed=5)
    all_seen, info = many.reset(seed=5)
    assert all_seen.shape == (3, *one.observation_space.shape) and set(info) == {
        "stiffness",
        "friction",
        "mass",
    }
    # The first of three draws what one alone draws only if its numbers come first, so give all the same.
    task, single = many.unwrapped.members.task, one.unwrapped.members.task
    for drawn in ("offset", "phase"):
        if hasattr(task, drawn):
            getattr(task, drawn)[:] = getattr(single, drawn)
    rng = np.random.default_rng(1)
    for _ in range(12):
        action = rng.uniform(-1, 1, one.action_space.shape)
        seen, reward, *ends, _ = one.step(action)
        all_seen, rewards, *all_ends, _ = many.step(np.tile(action, (3, 1)))
        for i in range(3):
            assert_array_equal(all_seen[i], seen)
            assert rewards[i] == reward
        assert not any(ends) and not np.any(all_ends)


def test_time_step_is_the_tasks():
    with pytest.raises(fork1s.UsageError, match=r"dt is the task's, 0.01667 s in 2 steps .*steps = 4"):
        gymnasium.make("fork1s/GraspLift-v0", dt=1 / 120)
    with pytest.raises(TypeError, match="no option 'tempo'"):
        gymnasium.make("fork1s/GraspLift-v0", tempo=3)

    class Finer(learn.GraspLift):
        dt, steps = learn.GraspLift.dt / 2, 2 * learn.GraspLift.steps

    finer = learn.Environment(Finer)
    finer.reset(seed=1)
    finer.step(finer.action_space.sample())
    assert finer.members.batch.time[0] == pytest.approx(learn.GraspLift.dt * learn.GraspLift.steps)


def test_factors_are_drawn_and_felt():
    many = gymnasium.make_vec("fork1s/Quadruped-v0", num_envs=8)
    _, info = many.reset(seed=2)
    for name, (low, high) in learn.Quadruped.randomise.items():
        assert len(set(info[name])) == 8 and (info[name] >= low).all() and (info[name] <= high).all()
    for _ in range(20):
        many.step(np.zeros((8, 12)))
    # The heavier it is for its servos, the deeper it stands.
    height = many.unwrapped.members.now.poses["trunk"][:, 2]
    assert np.corrcoef(info["mass"] / info["stiffness"], height)[0, 1] < -0.9
    _, again = many.reset(seed=2)
    for name in info:
        assert_array_equal(info[name], again[name])


def test_factors_by_name_are_drawn_and_given():
    ranges = {"mass:cube": (0.5, 2)}
    one = gymnasium.make("fork1s/GraspLift-v0", randomise=ranges)
    _, info = one.reset(seed=2)
    assert 0.5 <= info["mass:cube"] <= 2 and info["mass"] == 1
    _, given = one.reset(seed=2, options={"factors": {"mass:cube": 3}})
    assert given == {**info, "mass:cube": 3}
    _, again = one.reset(seed=2)
    assert again == info
    many = gymnasium.make_vec("fork1s/GraspLift-v0", num_envs=3, randomise=ranges)
    _, info = many.reset(seed=2, options={"factors": {"gravity": [1, 2, 3]}})
    assert len(set(info["mass:cube"])) == 3
    assert_array_equal(info["gravity"], [1, 2, 3])
    for env in (one, many):
        with pytest.raises(fork1s.UsageError, match="options of reset have 'mass:cube'; there are: factors"):
            env.reset(options={"mass:cube": 2})
    with pytest.raises(fork1s.UsageError, match="no body with mass 'cub'; near names are 'cube'"):
        gymnasium.make("fork1s/GraspLift-v0", randomise={"mass:cub": (1, 2)})


def test_factors_given_to_one_reset_are_gone_at_the_next():
    one = gymnasium.make("fork1s/GraspLift-v0", randomise=False)
    many = gymnasium.make_vec("fork1s/GraspLift-v0", num_envs=2, randomise=False)
    one.reset(seed=2, options={"factors": {"mass:cube": 3, "friction": 0.5}})
    many.reset(seed=2, options={"factors": {"mass:cube": [2, 3]}})
    for options, gravity in ((None, 1), ({"factors": {"gravity": 0.5}}, 0.5)):
        _, info = one.reset(seed=2, options=options)
        assert info["mass:cube"] == info["friction"] == 1 and info.get("gravity", 1) == gravity
        _, info = many.reset(seed=2, options=options)
        assert_array_equal(info["mass:cube"], [1, 1])


def test_who_is_done_begins_anew():
    many = gymnasium.make_vec("fork1s/GraspLift-v0", num_envs=2, randomise={"mass": (1, 1)})
    seen, _ = many.reset(seed=3)
    lifting = np.array([[1.0, -1.0], [-1.0, -1.0]])
    for step in range(200):
        lifting[0, 1] = 1.0 if step > 15 else -1.0
        _, reward, terminated, truncated, info = many.step(lifting)
        if terminated[0]:
            break
    assert terminated[0] and info["success"][0] and reward[0] > 0.9 and not terminated[1]
    cube = many.unwrapped.members.now.poses["cube"][:, 2]
    assert cube[0] > 0.06 and cube[1] < 0.02
    seen, reward, terminated, _, _ = many.step(lifting)
    assert reward[0] == 0 and not terminated[0]
    now = many.unwrapped.members.now
    assert now.time[0] == 0 and now.time[1] > 0.5 and now.poses["cube"][0, 2] < 0.02
    for _ in range(200):
        _, _, _, truncated, _ = many.step(lifting)
        if truncated[1]:
            break
    assert truncated[1] and now.time[1] < learn.GraspLift.seconds


def test_one_that_learns_a_little():
    """Cross-entropy on two numbers, when to lift and how tightly to hold: from none to most in a few rounds."""
    many = gymnasium.make_vec("fork1s/GraspLift-v0", num_envs=32)
    rng = np.random.default_rng(0)
    middle, spread = np.array([0.0, -0.5]), np.array([0.5, 0.5])
    rates = []
    for generation in range(4):
        tried = middle + spread * rng.standard_normal((32, 2))
        many.reset(seed=generation)
        done, total = np.zeros(32, dtype=bool), np.zeros(32)
        for step in range(100):
            action = np.stack([tried[:, 0], np.where(step > 20, tried[:, 1], -1)], axis=1)
            _, reward, _, _, info = many.step(action)
            total += np.where(done, 0, reward)
            done |= info["success"]
        best = np.argsort(-total)[:8]
        middle, spread = tried[best].mean(axis=0), tried[best].std(axis=0) + 0.05
        rates.append(done.mean())
    assert rates[0] < 0.2 and rates[-1] > 0.6


def test_refusals():
    with pytest.raises(fork1s.UsageError, match="none of: stiffness, friction, mass"):
        gymnasium.make(NAMES[0], randomise={"colour": (1, 2)})
    with pytest.raises(fork1s.UsageError, match="smallest <= largest"):
        gymnasium.make(NAMES[0], randomise={"mass": (2, 1)})
    many = gymnasium.make_vec(NAMES[0], num_envs=2)
    many.reset(seed=1)
    with pytest.raises(fork1s.UsageError, match="finite"):
        many.step(np.full((2, 2), np.nan))


def test_world_vectors_in_the_axes_of_bodies():
    q = np.array([[np.sqrt(0.5), 0, 0, np.sqrt(0.5)]])  # a quarter turn about z
    assert_allclose(fork1s._tasks.turned_back(q, np.array([[1.0, 0, 0]])), [[0, -1, 0]], atol=1e-15)


def run_page(docs, page, blocks):
    import re

    code = re.findall(r"```python\n(.*?)```", (docs / page).read_text(), flags=re.DOTALL)
    assert len(code) == blocks
    names = {}
    exec(compile("\n".join(code), page, "exec"), names)
    return names


def test_the_pages(scenes):
    from pathlib import Path

    if not (Path(fork1s.__file__).parent / "scenes").exists():
        pytest.skip("the package has no scenes in a build folder")
    assert run_page(scenes.parent / "docs", "learning.md", 1)["done"].all()
    assert run_page(scenes.parent / "docs", "legs_and_urdf.md", 1)["sim"].pose("trunk")[2, 3] > 0.25


def test_what_was_learnt_still_walks(scenes):
    import json
    import runpy

    pytest.importorskip("cma", reason="pip install 'fork1s[learn]'")
    example = runpy.run_path(str(scenes.parent / "examples" / "learn_quadruped.py"))
    numbers = np.array(json.loads((scenes.parent / "docs" / "learning" / "quadruped.json").read_text()))
    many = gymnasium.make_vec("fork1s/Quadruped-v0", num_envs=8)
    _, reached = example["episode"](many, np.tile(numbers, (8, 1)), seed=77)
    _, stood = example["episode"](many, np.zeros((8, 18)), seed=77)
    assert np.median(reached) > 2.5 and np.abs(stood).max() < 0.1


def test_feeding_straight_down_is_not_enough():
    many = gymnasium.make_vec("fork1s/PegInsertion-v0", num_envs=16)
    many.reset(seed=1)
    done = np.zeros(16, dtype=bool)
    for _ in range(80):
        done |= many.step(np.tile([0, 0, 0, 0, 1.0], (16, 1)))[4]["success"]
    assert not done.any()


class Hold(learn.Task):
    """A lever with a servo; what the task reads of a sensor is what is observed of it."""

    name = "Hold"
    steps = 1
    bodies = ("lever",)
    sensors = ("angle",)
    actions = 1
    observations = 1

    def act(self, action):
        return action

    def observe(self, now):
        return now.sensors["angle"]

    def judge(self, before, now, action):
        never = np.zeros(self.count, dtype=bool)
        return np.zeros(self.count), never, never


LEVER = """<mujoco><worldbody><body name="lever"><joint name="j" axis="0 1 0" damping=".1"/>
  <geom size=".05" mass=".2" pos=".1 0 0"/><site name="s" pos=".1 0 0"/></body></worldbody>
  <actuator><position name="p" joint="j" kp="2"/></actuator>
  <sensor><jointpos name="angle" joint="j"/><accelerometer name="acc" site="s"/><gyro name="gyro" site="s"/>
  <user name="own" dim="1"/></sensor></mujoco>"""


@pytest.mark.parametrize("count", [0, 3])
def test_sensors_are_observed(count):
    observe = ["sensor:acc", "sensor:gyro"]
    if count:
        env = learn.VectorEnvironment(count, Hold, randomise=False, model=LEVER, observe=observe)
    else:
        env = learn.Environment(Hold, randomise=False, model=LEVER, observe=observe)
    seen, _ = env.reset(seed=1)
    assert seen.shape == env.observation_space.shape == ((count, 7) if count else (7,))
    assert_array_equal(seen, np.zeros(seen.shape))  # means over a step have no value yet
    seen, *_ = env.step(np.full(env.action_space.shape, 0.5))
    assert env.observation_space.contains(seen)
    sensors = env.members.batch.sensors
    expected = np.hstack([sensors[name] for name in ("angle", "acc", "gyro")])
    assert_allclose(seen.reshape(-1, 7), np.clip(expected, -10, 10), rtol=1e-6)  # float32
    assert abs(seen.reshape(-1, 7)[0, 5]) > 0.01  # it turns about y


def test_sensors_that_cannot_be_observed_are_refused():
    make = {"randomise": False, "model": LEVER}
    with pytest.raises(fork1s.UnknownNameError, match="there is no sensor 'gyr'"):
        learn.Environment(Hold, observe=["sensor:gyr"], **make)
    with pytest.raises(fork1s.UsageError, match="a program of the user computes it"):
        learn.Environment(Hold, observe=["sensor:own"], **make)
    with pytest.raises(fork1s.UsageError, match="'sensor:NAME'"):
        learn.Environment(Hold, observe=["gyro"], **make)
    with pytest.raises(fork1s.UsageError, match="give a list"):
        learn.Environment(Hold, observe="sensor:gyro", **make)


def test_step_before_reset_is_refused():
    for env in (
        learn.Environment(Hold, randomise=False, model=LEVER),
        learn.VectorEnvironment(2, Hold, randomise=False, model=LEVER),
    ):
        with pytest.raises(fork1s.UsageError, match="step was called before reset; call reset first"):
            env.step(np.zeros(env.action_space.shape))
        env.reset()
        env.step(np.zeros(env.action_space.shape))
    many = learn.VectorEnvironment(2, Hold, randomise=False, model=LEVER)
    with pytest.raises(fork1s.UsageError, match="members out that have not begun"):
        many.reset(options={"reset_mask": np.array([True, False])})


@pytest.mark.parametrize("name", NAMES)
def test_members_with_seeds_of_their_own_do_what_each_does_alone(name):
    seeds = [3, 8, 3]
    many = gymnasium.make_vec(name, num_envs=3, max_episode_steps=6)
    ones = [gymnasium.make(name, max_episode_steps=6).unwrapped for _ in seeds]
    for one in ones:
        one.members.max_steps = 6  # gymnasium.make counts in a wrapper
    all_seen, all_info = many.reset(seed=seeds)
    for i, (one, seed) in enumerate(zip(ones, seeds)):
        seen, info = one.reset(seed=seed)
        assert_array_equal(all_seen[i], seen)
        assert all(all_info[factor][i] == info[factor] for factor in info)
    assert all_info["mass"][0] == all_info["mass"][2] != all_info["mass"][1]
    rng = np.random.default_rng(2)
    for step in range(14):  # two episodes, each drawn by the member's own generator
        action = rng.uniform(-1, 1, ones[0].action_space.shape)
        begins = step in (6, 13)
        all_seen, rewards, _, all_truncated, _ = many.step(np.tile(action, (3, 1)))
        for i, one in enumerate(ones):
            if begins:
                seen, _ = one.reset()
                assert rewards[i] == 0 and not all_truncated[i]
            else:
                seen, reward, _, truncated, _ = one.step(action)
                assert rewards[i] == reward and all_truncated[i] == truncated == (step in (5, 12))
            assert_array_equal(all_seen[i], seen)


def test_seeds_that_make_no_sense_are_refused():
    many = learn.VectorEnvironment(2, Hold, model=LEVER)
    with pytest.raises(fork1s.UsageError, match="seed is a list of 3; give one number or 2"):
        many.reset(seed=[1, 2, 3])
    for bad in (-1, 1.5, "a", True):
        with pytest.raises(fork1s.UsageError, match="for member 1; give whole numbers from 0 on, or None"):
            many.reset(seed=[1, bad])
    _, first = many.reset(seed=[4, None])
    _, second = many.reset(seed=np.array([4, 5]))
    assert first["mass"][0] == second["mass"][0]


@pytest.mark.parametrize("steps", [0, -1, 1.5, True, "3"])
def test_max_episode_steps_is_a_whole_number(steps):
    with pytest.raises(fork1s.UsageError, match="max_episode_steps is .*; give a whole number from 1 on"):
        learn.VectorEnvironment(2, Hold, model=LEVER, max_episode_steps=steps)


def returning(**methods):
    """A task whose methods return what is given for them."""
    return type(
        "Wrong",
        (Hold,),
        {"name": "Wrong", **{name: (lambda self, *_, v=v: v) for name, v in methods.items()}},
    )


@pytest.mark.parametrize(
    "methods, what",
    [
        (
            {"observe": np.zeros((2, 3))},
            r"observe returned an array of shape \(2, 3\); \(2, 1\) is expected, .*observations = 1",
        ),
        ({"observe": np.zeros(2)}, r"observe returned an array of shape \(2,\); \(2, 1\) is expected"),
        (
            {"observe": np.array([["a"], ["b"]])},
            "observe returned an array of dtype <U1; return real numbers",
        ),
        ({"observe": np.zeros((2, 1), dtype=complex)}, "observe returned an array of dtype complex128"),
        ({"observe": None}, "observe returned an array of dtype object"),
        ({"observe": [[1.0], [1.0, 2.0]]}, "observe returned no array"),
        (
            {"observe": np.array([[0.0], [np.nan]])},
            "observe returned nan for member 1, entry 0; return finite numbers",
        ),
    ],
)
def test_wrong_observations_are_told_with_the_task(methods, what):
    many = learn.VectorEnvironment(2, returning(**methods), randomise=False, model=LEVER)
    with pytest.raises(fork1s.UsageError, match=f"task 'Wrong': {what}"):
        many.reset(seed=1)


def test_wrong_rewards_are_told_with_the_task():
    for judged, what in (
        (
            (np.zeros(3), np.zeros(2), np.zeros(2)),
            r"judge, reward, returned an array of shape \(3,\); \(2,\) is expected",
        ),
        ((np.full(2, np.inf), np.zeros(2), np.zeros(2)), "judge, reward, returned inf for member 0; "),
        (np.zeros(2), "judge must return reward, whether done"),
    ):
        many = learn.VectorEnvironment(2, returning(judge=judged), randomise=False, model=LEVER)
        many.reset(seed=1)
        with pytest.raises(fork1s.UsageError, match=what):
            many.step(np.zeros((2, 1)))


def test_integrator_is_that_of_the_batch():
    seen = {}
    for integrator in (None, "two-stage", "euler"):
        env = learn.Environment(Hold, model=LEVER, integrator=integrator, randomise=False)
        env.reset(seed=1)
        seen[integrator] = np.array([env.step(np.ones(1))[0] for _ in range(10)])
    assert_array_equal(seen[None], seen["two-stage"])
    assert (seen["euler"] != seen["two-stage"]).any()
    with pytest.raises(fork1s.UsageError, match="verlet"):
        learn.Environment(Hold, model=LEVER, integrator="verlet")
