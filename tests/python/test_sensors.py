"""Sensors of the file by name."""

import collections.abc

import numpy as np
import pytest
from numpy.testing import assert_allclose

import fork1s

PENDULUM = """<mujoco><worldbody><body name="a"><joint name="j" axis="0 1 0"/>
  <geom size=".05" mass="2" pos=".3 0 0"/><site name="s" pos=".3 0 0"/></body></worldbody>
  <sensor><jointpos name="angle" joint="j"/><gyro name="gyro" site="s"/><accelerometer name="acc" site="s"/>
  <clock name="clock"/><user name="own" dim="2"/></sensor></mujoco>"""


def test_sensors_are_a_mapping_of_the_moment():
    sim = fork1s.Simulation(fork1s.load(PENDULUM), dt=0.01)
    before = sim.sensors
    assert isinstance(before, collections.abc.Mapping) and len(before) == 5
    assert list(before) == list(before.keys()) == ["angle", "gyro", "acc", "clock", "own"]
    assert "gyro" in before and "gyr" not in before and 3 not in before
    assert np.isnan(before["acc"]).all()  # before the first step
    sim.step(5)
    assert before["angle"] == 0  # of its moment
    now = sim.sensors
    assert_allclose(now["angle"], sim.qpos)
    assert_allclose(now["gyro"], [0, sim.qvel[0], 0], atol=1e-15)
    assert now["clock"] == sim.time
    assert_allclose(now.array, np.concatenate(now.values()))
    assert [name for name, _ in now.items()] == list(now)
    assert now.missing == {"own": "a program of the user computes it"}
    assert np.isnan(now["own"]).all() and now["own"].shape == (2,)
    with pytest.raises(fork1s.UnknownNameError, match="there is no sensor 'gyr'"):
        now["gyr"]


def test_clock_goes_on_through_a_state_that_is_set():
    sim = fork1s.Simulation(fork1s.load(PENDULUM), dt=0.01)
    sim.step(5)
    sim.set_state(qpos=[0.2])
    sim.step(5)
    assert sim.sensors["clock"] == pytest.approx(0.1) and sim.time == pytest.approx(0.1)


def test_members_of_a_batch_measure_what_each_alone_does():
    model = fork1s.load(PENDULUM)
    batch = fork1s.Batch(model, 3, dt=0.01, mass=[1, 2, 3], threads=2)
    assert np.isnan(batch.sensors["acc"]).all()
    batch.step(steps=5)
    measured = batch.sensors
    assert isinstance(measured, collections.abc.Mapping)
    assert measured["gyro"].shape == (3, 3) and measured["own"].shape == (3, 2)
    assert measured.array.shape == (3, 10)
    assert_allclose(measured.array, np.hstack(measured.values()))
    assert_allclose(measured["angle"][:, 0], batch.qpos[:, 0])
    assert_allclose(measured["clock"][:, 0], batch.time)
    assert measured.missing == {"own": "a program of the user computes it"}
    sim = fork1s.Simulation(model, dt=0.01)
    sim.step(5)
    np.testing.assert_array_equal(measured.array[0], sim.sensors.array)
    batch.reset([0, 1, 0])
    assert np.isnan(batch.sensors["acc"][1]).all() and not np.isnan(batch.sensors["acc"][[0, 2]]).any()
    with pytest.raises(fork1s.UnknownNameError, match="there is no sensor 'gyr'"):
        measured["gyr"]
