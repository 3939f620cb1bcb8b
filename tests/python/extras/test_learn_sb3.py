"""The VecEnv of Stable-Baselines3: what it asks for, and members that do bit by bit what environments do alone.

Where that package is not installed a class with its documented interface stands for VecEnv.
"""

import importlib.util
import sys
import types
from abc import ABC, abstractmethod

import numpy as np
import pytest
from numpy.testing import assert_array_equal

import fork1s

pytest.importorskip("gymnasium", reason="pip install 'fork1s[learn]'")

import fork1s.learn as learn
from fork1s import _sb3

INSTALLED = importlib.util.find_spec("stable_baselines3") is not None


class VecEnv(ABC):
    """https://stable-baselines3.readthedocs.io/en/master/guide/vec_envs.html"""

    def __init__(self, num_envs, observation_space, action_space):
        self.num_envs, self.observation_space, self.action_space = num_envs, observation_space, action_space
        self.reset_infos = [{} for _ in range(num_envs)]
        self._seeds = [None] * num_envs
        self._options = [{} for _ in range(num_envs)]
        (self.render_mode,) = set(self.get_attr("render_mode"))

    def seed(self, seed=None):
        self._seeds = [seed + i for i in range(self.num_envs)]
        return self._seeds

    def set_options(self, options=None):
        self._options = [dict(options or {}) for _ in range(self.num_envs)]

    def step(self, actions):
        self.step_async(actions)
        return self.step_wait()

    @abstractmethod
    def reset(self): ...
    @abstractmethod
    def step_async(self, actions): ...
    @abstractmethod
    def step_wait(self): ...
    @abstractmethod
    def close(self): ...
    @abstractmethod
    def get_attr(self, attr_name, indices=None): ...
    @abstractmethod
    def set_attr(self, attr_name, value, indices=None): ...
    @abstractmethod
    def env_method(self, method_name, *method_args, indices=None, **method_kwargs): ...
    @abstractmethod
    def env_is_wrapped(self, wrapper_class, indices=None): ...


@pytest.fixture(autouse=True)
def vec_env(monkeypatch, scenes):
    monkeypatch.setattr(learn, "scene", lambda name: scenes / f"{name}.xml")
    _sb3.adapter_class.cache_clear()
    if INSTALLED:
        from stable_baselines3.common.vec_env import VecEnv as real

        yield real
    else:
        for name in ("stable_baselines3", "stable_baselines3.common", "stable_baselines3.common.vec_env"):
            monkeypatch.setitem(sys.modules, name, types.ModuleType(name))
        sys.modules["stable_baselines3.common.vec_env"].VecEnv = VecEnv
        yield VecEnv
    _sb3.adapter_class.cache_clear()


@pytest.mark.parametrize("task", learn.TASKS)
def test_members_do_what_environments_do_alone(task, vec_env):
    many = learn.sb3(task, 3, max_episode_steps=5)
    assert isinstance(many, vec_env) and many.num_envs == 3
    assert many.observation_space == learn.Environment(task).observation_space
    assert many.seed(7) == [7, 8, 9]
    ones = [learn.Environment(task, max_episode_steps=5) for _ in range(3)]
    all_seen = many.reset()
    assert all_seen.shape == (3, *many.observation_space.shape) and all_seen.dtype == np.float32
    for i, one in enumerate(ones):
        seen, info = one.reset(seed=7 + i)
        assert_array_equal(all_seen[i], seen)
        assert many.reset_infos[i] == info
    rng = np.random.default_rng(3)
    for step in range(12):
        actions = rng.uniform(-1, 1, (3, *many.action_space.shape))
        all_seen, rewards, dones, infos = many.step(actions)
        assert rewards.shape == dones.shape == (3,) and rewards.dtype == np.float32 and dones.dtype == bool
        assert isinstance(infos, list) and len(infos) == 3
        for i, one in enumerate(ones):
            seen, reward, terminated, truncated, info = one.step(actions[i])
            assert rewards[i] == np.float32(reward) and dones[i] == (terminated or truncated)
            assert infos[i]["TimeLimit.truncated"] == (truncated and not terminated)
            assert infos[i]["is_success"] == infos[i]["success"] == info["success"]
            assert dones[i] == (step in (4, 9)) == ("terminal_observation" in infos[i])
            if dones[i]:
                assert_array_equal(infos[i]["terminal_observation"], seen)
                seen, drawn = one.reset()
                assert many.reset_infos[i] == drawn
            assert_array_equal(all_seen[i], seen)
    # A seed holds for one reset: the next goes on with the generators, and the same seed begins again.
    many.reset()
    first = list(many.reset_infos)
    many.seed(7)
    again = many.reset()
    for i in range(3):
        seen, drawn = learn.Environment(task).reset(seed=7 + i)
        assert_array_equal(again[i], seen)
        assert many.reset_infos[i] == drawn != first[i]


def test_a_task_that_ends_is_not_truncated():
    many = learn.sb3(learn.GraspLift, 2, randomise=False)
    many.seed(3)
    many.reset()
    for step in range(200):
        _, _, dones, infos = many.step([[1.0, 1.0 if step > 15 else -1.0], [-1.0, -1.0]])
        if dones[0]:
            break
    assert dones.tolist() == [True, False] and infos[0]["is_success"] and not infos[0]["TimeLimit.truncated"]
    cube = infos[0]["terminal_observation"][3]  # height of the cube in lifts
    assert cube > 1 and many.members.now.poses["cube"][0, 2] < 0.02


def test_attributes_and_methods_of_members():
    many = learn.sb3(learn.GraspLift, 3)
    assert many.get_attr("name") == ["GraspLift"] * 3 and many.get_attr("height", [0, 2]) == [0.06] * 2
    assert many.get_attr("render_mode", 1) == [None]
    with pytest.raises(AttributeError):
        many.get_attr("nothing")
    many.set_attr("height", 0.05)
    assert many.get_attr("height") == [0.05] * 3
    with pytest.raises(fork1s.UsageError, match="all share one task; leave out indices"):
        many.set_attr("height", 0.05, indices=1)
    with pytest.raises(fork1s.UsageError, match="indices has 3; members are 0 to 2"):
        many.get_attr("height", 3)
    assert many.env_method("render") == [None] * 3 == many.get_images()
    with pytest.raises(fork1s.UsageError, match="env_method has 'walk'"):
        many.env_method("walk")
    assert many.env_is_wrapped(object) == [False] * 3
    many.close()


def test_refusals(monkeypatch):
    many = learn.sb3(learn.GraspLift, 2)
    with pytest.raises(fork1s.UsageError, match="step was called before reset"):
        many.step(np.zeros((2, 2)))
    many.reset()
    with pytest.raises(fork1s.UsageError, match="step_wait was called before step_async"):
        many.step_wait()
    with pytest.raises(fork1s.UsageError, match=r"actions have shape \(2,\); \(2, 2\) is expected"):
        many.step(np.zeros(2))
    many.set_options({"colour": 1})
    with pytest.raises(fork1s.UsageError, match="this adapter does not take"):
        many.reset()
    _sb3.adapter_class.cache_clear()
    monkeypatch.setitem(sys.modules, "stable_baselines3.common.vec_env", None)
    with pytest.raises(ModuleNotFoundError, match="needs stable-baselines3 .*pip install stable-baselines3"):
        learn.sb3(learn.GraspLift, 2)


@pytest.mark.skipif(not INSTALLED, reason="pip install stable-baselines3")
def test_a_policy_is_trained():
    sb3 = pytest.importorskip("stable_baselines3")
    policy = sb3.PPO(
        "MlpPolicy", learn.sb3(learn.GraspLift, 4), n_steps=16, batch_size=16, seed=1, device="cpu"
    )
    policy.learn(128)
    assert policy.num_timesteps >= 128
