"""Factors of the members of a batch, of models, draws and sweeps: the same as files written with them."""

import pickle

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import fork1s
from fork1s._sweep_task import model_at


def test_factors_are_those_of_a_file(scenes):
    stiff = fork1s.Batch(fork1s.load(scenes / "two_link_arm.xml", q={"elbow": 0.3}), 2, stiffness=[1, 4])
    alone = fork1s.Simulation(fork1s.load(scenes / "two_link_arm.xml", q={"elbow": 0.3}, stiffness_scale=4))
    stiff.step(steps=7)
    alone.step(7)
    assert_allclose(stiff.qpos[1], alone.qpos, rtol=1e-12)


CRATE = """<mujoco><option gravity="0 0 {gravity}"/><worldbody>
  <geom name="floor" type="plane" size="1 1 1" friction=".3"/><site name="top" pos="1.2 0 1"/>
  <body name="crate" pos="0 0 .05"><freejoint/><geom type="box" size=".1 .1 .05" mass="{mass}" friction="{friction}"/></body>
  <body name="post" pos="1 0 .5"><joint name="swing" axis="0 1 0" stiffness="{stiffness}" damping="{damping}"
    frictionloss="{loss}"/><site name="tip" pos=".3 0 0"/>
    <geom size=".05" pos=".2 0 0" mass="{weight}" contype="0" conaffinity="0"/></body></worldbody>
  <tendon><spatial name="rope" stiffness="{rope}"><site site="top"/><site site="tip"/></spatial></tendon>
  <actuator><position name="turn" joint="swing" kp="{kp}"/></actuator>
  <sensor><actuatorfrc name="force" actuator="turn"/><e_potential name="potential"/></sensor></mujoco>"""
PLAIN = dict(
    mass=2.0, friction=0.5, stiffness=3.0, damping=0.2, loss=0.1, weight=1.0, rope=20.0, kp=4.0, gravity=-10
)


def crate(**changed):
    return fork1s.load(CRATE.format(**{**PLAIN, **changed}))


@pytest.mark.parametrize(
    "factors, written",
    [
        ({"mass:crate": 2.5}, {"mass": 5.0}),
        ({"mass:crate": 2.5, "mass": 2}, {"mass": 10.0, "weight": 2.0}),
        ({"friction:crate": 2}, {"friction": 1.0}),
        ({"friction:crate": 0.2}, {"friction": 0.1}),  # the floor's counts
        ({"damping:swing": 3}, {"damping": 0.6}),
        ({"frictionloss:swing": 0.5}, {"loss": 0.05}),
        ({"stiffness:swing": 4}, {"stiffness": 12.0, "kp": 16.0, "damping": 0.4}),  # the damper by the root
    ],
)
def test_factors_of_one_element_are_those_of_a_file(factors, written):
    batch = fork1s.Batch(crate(), 2, factors={name: [1, value] for name, value in factors.items()}, dt=0.01)
    changed = crate().with_factors(factors)
    sims = [fork1s.Simulation(model, dt=0.01) for model in (crate(), crate(**written), changed)]
    push = {"crate": [12, 0, 0], "post": [0, 0, 2]}
    for _ in range(40):
        batch.step([0.2], push=push)
        for sim in sims:
            sim.controls["turn"] = 0.2
            for name, force in push.items():
                sim.push(name, force)
            sim.step()
    assert batch.hashes()[0] == sims[0].hash() != sims[1].hash()
    assert_allclose(batch.qpos[1], sims[1].qpos, rtol=1e-9, atol=1e-12)
    assert_allclose(batch.qvel[1], sims[1].qvel, rtol=1e-8, atol=1e-10)
    assert batch.hashes()[1] == sims[2].hash()
    force = [sim.sensors["force"] for sim in sims]
    assert_allclose(batch.sensors["force"], force[:2], rtol=1e-8)
    assert_allclose(sims[2].actuator_forces["turn"], sims[1].actuator_forces["turn"], rtol=1e-8)


CHAIN = """<mujoco><worldbody><body name="a" pos="0 0 1"><joint name="ball" type="ball" stiffness="{ball}" damping="{ball_d}"/>
    <geom size=".05" pos=".2 0 0" mass="1"/><body name="fixed" pos=".3 0 0"><geom size=".02" mass="{mass}"/>
    <body name="e" pos=".1 0 0"><joint name="bent" axis="0 1 0" stiffness="{bent}" damping="{bent_d}"/>
      <geom size=".03" pos=".1 0 0" mass=".5"/></body></body></body>
  <body name="post" pos="0 1 1"><joint name="q" axis="0 1 0" stiffness="{q}"/><geom size=".03" pos=".1 0 0" mass=".5"/>
    <body name="tip" pos=".2 0 0"><joint name="r" axis="0 1 0"/><geom size=".03" pos=".1 0 0" mass=".5"/></body></body>
  <body name="table" pos="2 0 0"><geom size=".1"/></body></worldbody>
  <tendon><fixed name="t"><joint joint="q" coef="1"/><joint joint="r" coef="1"/></fixed></tendon>
  <actuator><position name="servo" tendon="t" kp="{kp}" kv="{kv}"/></actuator>
  <sensor><actuatorfrc name="force" actuator="servo"/><e_potential name="potential"/></sensor></mujoco>"""


@pytest.mark.parametrize(
    "factors, written",
    [
        ({"stiffness:ball": 4}, {"ball": 20, "ball_d": 0.2}),  # all its freedoms
        ({"damping:ball": 2}, {"ball_d": 0.2}),
        ({"mass:fixed": 2}, {"mass": 0.6}),
        ({"stiffness:bent": 4}, {"bent": "12 8 4", "bent_d": ".4 .2"}),  # powers of the stretch
        ({"damping:bent": 2}, {"bent_d": ".4 .2"}),
        ({"stiffness:servo": 4}, {"kp": 40, "kv": 1.0}),
        ({"damping:servo": 2}, {"kv": 1.0}),
        ({"damping": 2}, {"ball_d": 0.2, "bent_d": ".4 .2", "kv": 1.0}),
        (
            {"stiffness:bent": 4, "stiffness": 9},
            {
                "ball": 45,
                "ball_d": 0.3,
                "bent": "108 72 36",
                "bent_d": "1.2 .6",
                "kp": 90,
                "kv": 1.5,
                "q": 18,
            },
        ),
    ],
)
def test_factors_of_springs_and_dampers_of_every_kind(factors, written):
    plain = dict(ball=5, ball_d=0.1, mass=0.3, bent="3 2 1", bent_d=".2 .1", kp=10, kv=0.5, q=2)

    def after(model):
        sim = fork1s.Simulation(model, dt=0.005)
        sim.controls["servo"] = 0.3
        sim.step(60)
        return np.hstack([sim.qpos, sim.qvel, *(sim.sensors[name] for name in ("force", "potential"))])

    model = fork1s.load(CHAIN.format(**plain))
    changed = after(model.with_factors(factors))
    assert_allclose(changed, after(fork1s.load(CHAIN.format(**{**plain, **written}))), rtol=1e-9, atol=1e-12)
    assert np.abs(changed - after(model)).max() > 0.1
    with pytest.raises(fork1s.UsageError, match="'table'.*what stands still is 'world'"):
        model.with_factors({"friction:table": 2})


def test_factors_of_tendons_and_of_gravity():
    batch = fork1s.Batch(crate(), 2, factors={"stiffness:rope": 4, "gravity": [1, 0.5]}, dt=0.01)
    sims = [fork1s.Simulation(crate(rope=80.0, gravity=gravity), dt=0.01) for gravity in (-10, -5)]
    batch.step(steps=20)
    for i, sim in enumerate(sims):
        sim.step(20)
        assert_allclose(batch.qpos[i], sim.qpos, rtol=1e-9, atol=1e-12)
        assert_allclose(batch.sensors["potential"][i], sim.sensors["potential"], rtol=1e-9)
    assert abs(batch.qpos[0, -1] - batch.qpos[1, -1]) > 1e-3
    assert crate().with_factors({"stiffness:rope": 4}).stiffnesses["rope"] == 80
    written = fork1s.Simulation(crate(rope=80.0))
    for changed in (crate().with_factors({"stiffness:rope": 4}), crate().with_stiffness({"rope": 80})):
        assert_allclose(
            fork1s.Simulation(changed).sensors["potential"], written.sensors["potential"], rtol=1e-12
        )
    sim = fork1s.Simulation(crate())
    sim.set_stiffness({"rope": 80})
    assert_allclose(sim.sensors["potential"], written.sensors["potential"], rtol=1e-12)


BANDS = """<mujoco><worldbody><body name="a" pos="0 0 1"><joint name="q" axis="0 1 0" stiffness="{q}"/>
    <geom size=".05" pos=".2 0 0" mass="1"/><body name="b" pos=".3 0 0"><joint name="r" axis="0 1 0" stiffness="{r}"/>
      <geom size=".05" pos=".2 0 0" mass="1"/></body></body></worldbody>
  <tendon><fixed name="{band}" stiffness="{k}" damping="{d}" springlength="{slack}"><joint joint="q" coef="2"/></fixed>
    <fixed name="pair"><joint joint="q" coef="1"/><joint joint="r" coef="1"/></fixed></tendon>
  <actuator><position name="{servo}" tendon="pair" kp="{kp}" kv="{kv}"/></actuator>
  <sensor><actuatorfrc name="force" actuator="{servo}"/><e_potential name="potential"/></sensor></mujoco>"""


@pytest.mark.parametrize(
    "plain, factor, written",
    [
        # A tendon along one joint, slack at first, is no spring of that joint.
        ({}, "q", {"q": 8}),
        ({}, "band", {"k": 80, "d": 0.4}),
        # Without a linear stiffness.
        ({"k": "0 2 3"}, "band", {"k": "0 8 12", "d": 0.4}),
        # Tendons and servos with the name of a joint.
        ({"band": "q"}, "q", {"q": 8, "k": 80, "d": 0.4}),
        ({"band": "r"}, "r", {"r": 12, "k": 80, "d": 0.4}),
        ({"servo": "r"}, "r", {"r": 12, "kp": 40, "kv": 1}),
        ({"servo": "r", "r": "3 2 1"}, "r", {"r": "12 8 4", "kp": 40, "kv": 1}),
    ],
)
def test_stiffness_factors_scale_all_of_their_name_and_no_other(plain, factor, written):
    usual = dict(q=2, r=3, band="band", servo="servo", k=20, d=0.2, slack="-.1 .1", kp=10, kv=0.5)

    def after(model):
        sim = fork1s.Simulation(model, dt=0.005)
        sim.control_values = [0.3]
        sim.step(60)
        return np.hstack([sim.qpos, sim.qvel, *(sim.sensors[name] for name in ("force", "potential"))])

    model = fork1s.load(BANDS.format(**{**usual, **plain}))
    changed = after(model.with_factors({f"stiffness:{factor}": 4}))
    by_hand = after(fork1s.load(BANDS.format(**{**usual, **plain, **written})))
    assert_allclose(changed, by_hand, rtol=1e-9, atol=1e-12)
    assert np.abs(changed - after(model)).max() > 1e-3


SPEEDS = """<mujoco><worldbody><body name="a" pos="0 0 1"><joint name="q" axis="0 0 1" damping="{d}"/>
    <geom size=".05" pos=".2 0 0" mass="1"/><body name="b" pos=".3 0 0"><joint name="r" axis="0 0 1" damping="{d}"/>
      <geom size=".05" pos=".2 0 0" mass="1"/></body></body></worldbody>
  <tendon><fixed name="pair"><joint joint="q" coef="1"/><joint joint="r" coef="1"/></fixed></tendon>
  <actuator><velocity name="turn" joint="q" kv="{kv}" gear="2"/>
    <velocity name="bounded" joint="r" kv="{kv}" forcerange="-.2 .2"/>
    <velocity name="both" tendon="pair" kv="{tendon}"/></actuator>
  <sensor><actuatorfrc name="force" actuator="turn"/></sensor></mujoco>"""


@pytest.mark.parametrize(
    "factor, written",
    [
        ({"damping": 2}, {"d": 0.02, "kv": 1, "tendon": 0.4}),
        ({"damping:q": 2, "damping:r": 2}, {"d": 0.02, "kv": 1}),
        ({"damping:both": 2}, {"tendon": 0.4}),
    ],
)
def test_factors_of_damping_leave_the_speed_that_a_servo_reaches(factor, written):
    def after(model):
        sim = fork1s.Simulation(model, dt=0.005)
        sim.control_values = [0.8, -0.7, 0.3]
        sim.step(60)
        return np.hstack([sim.qpos, sim.qvel, sim.sensors["force"], sim.actuator_forces["turn"]])

    # The force of `bounded` is at its bound, or not.
    plain = dict(d=0.01, kv=0.5, tendon=0.2)
    model = fork1s.load(SPEEDS.format(**plain))
    changed = after(model.with_factors(factor))
    by_hand = after(fork1s.load(SPEEDS.format(**{**plain, **written})))
    assert_allclose(changed, by_hand, rtol=1e-9, atol=1e-12)
    assert np.abs(changed - after(model)).max() > 1e-3


def test_named_factors_are_drawn_by_themselves(gripper):
    ranges = {
        "mass:cube": (0.5, 2),
        "mass": (0.8, 1.25),
        "stiffness:left_crank": (0.7, 1.4),
        "start:cube.x": (0, 1e-3),
    }
    batches = [fork1s.Batch(gripper, 8, seeds=7, randomise=ranges, threads=threads) for threads in (1, 2, 3)]
    assert set(batches[0].factors) == {"stiffness", "friction", *ranges}
    for batch in batches:
        batch.step([0.3, 0.3], steps=20)
        batch.reset(np.arange(8) % 2 == 0)
        batch.step([0.3, 0.3], steps=20)
        assert_array_equal(batch.hashes(), batches[0].hashes())
    first = batches[0]
    drawn = first.factors["mass:cube"]
    assert len(set(drawn.tolist())) == 8 and (drawn >= 0.5).all() and (drawn <= 2).all()
    fewer = fork1s.Batch(gripper, 8, seeds=7, randomise={"mass:cube": (0.5, 2)})
    fewer.reset(np.arange(8) % 2 == 0)
    assert_array_equal(fewer.factors["mass:cube"], drawn)
    # Moments and pickles have them.
    moment = first.save()
    after = {name: values.copy() for name, values in first.factors.items()}
    copied, moment_again = pickle.loads(pickle.dumps(first)), pickle.loads(pickle.dumps(moment))
    first.step(steps=15)
    ended = first.hashes()
    first.reset()
    assert (first.factors["mass:cube"] != drawn).all()
    for other, then in ((first, moment), (first, moment_again), (copied, moment)):
        other.restore(then)
        for name, values in after.items():
            assert_array_equal(other.factors[name], values)
        other.step(steps=15)
        assert_array_equal(other.hashes(), ended)
    copied.reset()
    fresh = pickle.loads(pickle.dumps(first))
    fresh.restore(moment)
    fresh.reset()
    for name in ranges:
        assert len(set(copied.factors[name].tolist())) == 8


def test_sweeps_have_the_same_factors(scenes):
    path = scenes / "fourbar_gripper.xml"
    ends = []
    for model in (
        model_at(path, {"factor:mass:cube": 2.0, "stiffness:left_crank": 3.0}),
        model_at(fork1s.load(path).with_factors({"mass:cube": 2}), {"stiffness:left_crank": 3.0}),
        # Read again, as options of load ask for it.
        model_at(fork1s.load(path).with_factors({"mass:cube": 2}), {"stiffness:left_crank": 3.0, "modes": 4}),
        model_at(
            pickle.loads(pickle.dumps(fork1s.load(path).with_stiffness({"left_crank": 3}))),
            {"factor:mass:cube": 2},
        ),
    ):
        sim = fork1s.Simulation(model)
        sim.control_values = [0.3, 0.3]
        sim.step(60)
        ends.append(sim.hash())
    assert ends == ends[:1] * 4
    plain = fork1s.Simulation(fork1s.load(path).with_stiffness({"left_crank": 3}))
    plain.control_values = [0.3, 0.3]
    plain.step(60)
    assert plain.hash() != ends[0]


def test_factors_given_at_a_reset(gripper):
    batch = fork1s.Batch(gripper, 3)
    batch.reset([False, True, True], factors={"mass:cube": [9, 2, 3], "friction": 0.5})
    assert_array_equal(batch.factors["mass:cube"], [1, 2, 3])
    assert_array_equal(batch.factors["friction"], [1, 0.5, 0.5])
    batch.reset(factors={"gravity": 0.5})  # without seeds, what is not given stays
    assert_array_equal(batch.factors["mass:cube"], [1, 2, 3])
    drawn = fork1s.Batch(gripper, 3, seeds=1)
    drawn.reset(factors={"mass:cube": 2, "mass": 1})
    assert_array_equal(drawn.factors["mass:cube"] * drawn.factors["mass"], [2, 2, 2])
    drawn.reset()
    assert "mass:cube" not in drawn.factors


def test_factors_that_name_nothing(gripper):
    for make in (
        lambda name: fork1s.Batch(gripper, 2, factors={name: 2}),
        lambda name: fork1s.Batch(gripper, 2, seeds=1, randomise={name: (1, 2)}),
        lambda name: fork1s.Batch(gripper, 2).reset(factors={name: 2}),
        lambda name: gripper.with_factors({name: 2}),
    ):
        for name, said in (
            ("mass:cubes", "no body with mass 'cubes'; near names are 'cube'"),
            ("stiffness:left_cranc", "'left_crank'"),
            ("colour:cube", "none of: stiffness, friction, mass"),
        ):
            with pytest.raises(fork1s.UsageError, match=said):
                make(name)
    with pytest.raises(ValueError, match="mass:cube.*above 0"):
        fork1s.Batch(gripper, 2, factors={"mass:cube": 0})
    with pytest.raises(fork1s.UsageError, match="above 0"):
        gripper.with_factors({"mass:cube": 0})
    with pytest.raises(fork1s.UsageError, match="'mass' is given as an argument"):
        fork1s.Batch(gripper, 2, mass=2, factors={"mass": 2})


def test_mass_weighs():
    model = fork1s.load("""<mujoco><worldbody><geom type="plane" size="1 1 1"/>
      <body name="box" pos="0 0 .05"><freejoint/><geom type="box" size=".1 .1 .05" mass="2"/></body>
      <body name="post" pos="1 0 0"><joint type="slide" axis="0 0 1" stiffness="1000" damping="200"/>
      <geom size=".01" mass="1" contype="0" conaffinity="0"/></body></worldbody></mujoco>""")
    batch = fork1s.Batch(model, 2, mass=[1, 3])
    batch.step(steps=200)
    assert_allclose(batch.joint_displacements[:, 0], [-9.81 / 1000, -3 * 9.81 / 1000], rtol=1e-6)


def test_friction_holds_or_not():
    slope = np.deg2rad(30)
    gravity = f"{9.81 * np.sin(slope)} 0 {-9.81 * np.cos(slope)}"
    model = fork1s.load(f"""<mujoco><option gravity="{gravity}"/><worldbody>
      <geom type="plane" size="1 1 1" friction="1"/>
      <body name="box" pos="0 0 .05"><freejoint/><geom type="box" size=".1 .1 .05" mass="2" friction="1"/></body>
      </worldbody></mujoco>""")
    # tan 30 degrees = 0.577
    batch = fork1s.Batch(model, 2, friction=[0.5, 0.65])
    batch.step(steps=60)
    slid = batch.poses("box")[:, 0, 0]
    t = 1.0
    assert_allclose(slid[0], 9.81 * (np.sin(slope) - 0.5 * np.cos(slope)) * t**2 / 2, rtol=0.03)
    assert abs(slid[1]) < 1e-3
