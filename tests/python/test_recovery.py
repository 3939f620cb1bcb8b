"""Buffers for engines, read by numpy as a shader would."""

import json

import numpy as np
import pytest

import fork1s

CHAIN = """<mujoco><option gravity="0 0 -9.81"/><worldbody>
  <body name="a" pos="0 0 1"><joint name="ja" axis="0 1 0" stiffness="20" damping="1"/>
    <geom type="capsule" fromto="0 0 0 .3 0 0" size=".02"/>
    <body name="b" pos=".3 0 0"><joint name="jb" axis="0 0 1" stiffness="10" damping="1"/>
      <geom type="capsule" fromto="0 0 0 .3 0 0" size=".02"/></body></body>
  <body name="ball" pos="0 0 3"><freejoint/><geom size=".03" mass=".1"/></body>
</worldbody></mujoco>"""


def times(a, b):
    w = a[3] * b[3] - a[:3] @ b[:3]
    return np.append(a[3] * b[:3] + b[3] * a[:3] + np.cross(a[:3], b[:3]), w)


def turn(q, v):
    return v + 2 * np.cross(q[:3], np.cross(q[:3], v) + q[3] * v)


def exponential(w, v):
    t = np.linalg.norm(w) + 1e-30
    wv = np.cross(w, v)
    q = np.append(np.sin(t / 2) * w / t, np.cos(t / 2))
    return q, v + (1 - np.cos(t)) / t**2 * wv + (t - np.sin(t)) / t**3 * np.cross(w, wv)


def poses_by_twist(tables, numbers, frame):
    """shaders/recover_twist.comp.glsl, in double precision."""
    for body in tables[tables[7] : tables[7] + 8 * tables[3]].reshape(-1, 8):
        root, _, z, count, twists, reference = body[:6]
        T = numbers[twists : twists + 6 * count].reshape(-1, 6)
        twist = frame[z : z + count] @ T
        q, p = exponential(twist[:3], twist[3:])
        p, q = (
            p + turn(q, numbers[reference + 4 : reference + 7]),
            times(q, numbers[reference : reference + 4]),
        )
        base = frame[8 * root : 8 * root + 8]
        p, q = base[4:7] + turn(base[:4], p), times(base[:4], q)
        yield np.concatenate([p, np.roll(q, 1) * np.sign(q[3])])


def test_numpy_poses_the_bodies(tmp_path):
    sim = fork1s.Simulation(fork1s.load(CHAIN, interface=["b"]), recovery="twist")
    sim.step(12)
    buffers = fork1s.RecoveryBuffers(sim)
    assert buffers.recovery == "twist" and buffers.scan_passes == 2
    assert buffers.tables.dtype == np.int32 and buffers.numbers.dtype == np.float32
    poses = np.array(
        list(poses_by_twist(buffers.tables, buffers.numbers.astype(float), buffers.frame().astype(float)))
    )
    assert np.abs(sim.poses[:, 3:] - [1, 0, 0, 0]).max() > 0.01
    np.testing.assert_allclose(poses, sim.poses, atol=1e-6)

    buffers.save(str(tmp_path / "buffers"))
    description = json.loads((tmp_path / "buffers" / "recovery.json").read_text())
    raw = (tmp_path / "buffers" / description["file"]).read_bytes()
    assert len(raw) == description["bytes"] and raw[:16] == b"fork1s recovery\n"
    assert int.from_bytes(raw[16:24], "little") == int(description["reference"], 16) == buffers.reference
    assert description["bodies"] == sim.bodies

    def section(name):
        s = description["sections"][name]
        assert s["offset"] % 256 == 0 and s["bytes"] == 4 * s["count"]
        return np.frombuffer(raw, s["type"], s["count"], s["offset"])

    np.testing.assert_array_equal(section("tables"), buffers.tables)
    np.testing.assert_array_equal(section("numbers"), buffers.numbers)
    np.testing.assert_array_equal(section("frame"), buffers.frame())
    trial = list(
        poses_by_twist(
            section("tables"), section("numbers").astype(float), section("trial_frame").astype(float)
        )
    )
    wanted = section("trial_poses").reshape(-1, 8)
    assert np.abs(wanted[:, 4:7] - sim.poses[:, :3]).max() > 0.01
    np.testing.assert_allclose(np.array(trial)[:, :3], wanted[:, 4:7], atol=1e-6)
    with pytest.raises(fork1s.FileError, match="cannot be made a folder"):
        buffers.save(str(tmp_path / "buffers" / "recovery.bin"))


def test_a_reference_that_moves():
    sim = fork1s.Simulation(fork1s.load(CHAIN, interface=["b"], stiffness_scale=0.05), recovery="twist")
    buffers = fork1s.RecoveryBuffers(sim)
    assert buffers.current
    report = sim.step(60)
    causes = report.refreshes_by_cause
    assert report.refreshes == sum(cause["count"] for cause in causes.values())
    assert causes["turned_joint"]["largest"] > 0.26 and causes["turned_joint"]["unit"] == "rad"
    assert causes["turned_joint"]["of"].startswith("joint '")
    assert report.refreshes > 0 and not buffers.current
    with pytest.raises(fork1s.UsageError, match="make them again"):
        buffers.frame()
    again = fork1s.RecoveryBuffers(sim)
    assert again.reference != buffers.reference and len(again.frame()) == again.tables[8]
