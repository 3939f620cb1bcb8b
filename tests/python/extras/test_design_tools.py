"""Equations of motion to first order by SciPy: MAT-files, eigenvalues, step responses."""

import subprocess
from pathlib import Path

import numpy as np
import pytest
from numpy.testing import assert_allclose

import fork1s

pytest.importorskip("scipy", reason="pip install 'fork1s[sweep]'")

import scipy.io
import scipy.linalg
import scipy.signal


def write_mat(model, file):
    program = Path(fork1s.__file__).parent / "bin" / "fork1s"
    done = subprocess.run([program, "reduce", "--out", file, model], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return scipy.io.loadmat(file, chars_as_strings=True)


def texts(cells):
    """A column of cells, of which each is a text."""
    assert cells.shape[1] == 1
    return [str(cell[0]) if cell.size else "" for cell in cells[:, 0]]


@pytest.mark.parametrize("name", ["two_link_arm", "fourbar_gripper", "quadruped"])
def test_mat_file_has_what_python_has(scenes, tmp_path, name):
    read = write_mat(scenes / f"{name}.xml", tmp_path / "model.mat")
    model = fork1s.load(scenes / f"{name}.xml")
    linear = model.linear_model()
    for matrix in ["M", "D", "K", "B", "C", "X_WB_ref"]:
        np.testing.assert_array_equal(read[matrix], getattr(linear, matrix), err_msg=matrix)
    for vector in ["f", "u_ref", "q_ref"]:
        np.testing.assert_array_equal(read[vector], getattr(linear, vector)[:, None], err_msg=vector)
    for signals in ["coordinate", "input", "output", "joint"]:
        assert texts(read[f"{signals}_names"]) == getattr(linear, f"{signals}s")
        assert texts(read[f"{signals}_units"]) == getattr(linear, f"{signals}_units")
    assert texts(read["interfaces"]) == linear.interfaces
    assert texts(read["mechanism"]) == [model.mechanisms[0].name]
    squares = scipy.linalg.eigh(read["K"], read["M"], eigvals_only=True)
    elastic = np.sqrt(squares[squares > 1e-9 * squares[-1]]) / (2 * np.pi)
    count = len(model.reduced_frequencies)
    assert_allclose(elastic[:count], model.reduced_frequencies, rtol=1e-9)


def test_names_outside_of_ascii(tmp_path):
    model = tmp_path / "finger.xml"
    model.write_text(
        """<mujoco><worldbody><body name="Ärmel 腕 𝛼"><joint name="größe" axis="0 1 0" stiffness="1"/>
        <geom type="sphere" size="0.1"/></body></worldbody></mujoco>""",
        encoding="utf-8",
    )
    read = write_mat(model, tmp_path / "a.mat")
    assert texts(read["interfaces"]) == ["Ärmel 腕 𝛼"] and texts(read["joint_names"]) == ["größe"]


def test_eigenvalues_of_an_undamped_mechanism_are_its_frequencies(scenes):
    text = (scenes / "two_link_arm.xml").read_text().replace(' damping="1"', "")
    model = fork1s.load(text)
    eigenvalues = scipy.linalg.eigvals(model.state_space().A)
    upper = np.sort(eigenvalues.imag[eigenvalues.imag > 0]) / (2 * np.pi)
    assert_allclose(upper, model.reduced_frequencies, rtol=1e-9)
    assert_allclose(eigenvalues.real, 0, atol=1e-9 * np.abs(eigenvalues).max())


@pytest.mark.parametrize("name", ["two_link_arm", "fourbar_gripper"])
def test_step_response_is_that_of_the_simulation(scenes, name):
    model = fork1s.load((scenes / f"{name}.xml").read_text().replace("0 0 -9.81", "0 0 0"))
    body, space, dt, steps = model.interfaces[0], model.state_space(), 1 / 960, 480
    push = np.array([0.002, 0.002, 0])
    system = scipy.signal.StateSpace(space.A, space.B, space.C, space.D)
    times = dt * np.arange(steps + 1)
    u = np.zeros((steps + 1, len(space.inputs)))
    u[:, [space.inputs.index(f"{body}.{i}") for i in "xyz"]] = push
    _, told, _ = scipy.signal.lsim(system, u, times)
    told = told[:, [space.outputs.index(name) for name in model.coordinates]]
    sim = fork1s.Simulation(model, dt=dt)
    before = sim.joint_displacements.copy()
    # Of the largest motion of all: the first step, which the scheme takes through a jump of the force, misses 1.5 %.
    largest = np.abs(told).max()
    for i in range(1, steps + 1):
        sim.push(body, force=push)
        sim.step()
        assert_allclose(
            sim.joint_displacements - before, told[i], rtol=0, atol=0.01 * largest, err_msg=f"step {i}"
        )
