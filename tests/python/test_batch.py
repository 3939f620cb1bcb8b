"""Many simulations as one: the same as each alone, for any number of threads."""

import copy
import pickle
import subprocess
import sys

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

import fork1s
from fork1s._sweep_task import model_at


def test_every_member_is_as_alone(gripper):
    rng = np.random.default_rng(1)
    controls = rng.uniform(-0.5, 0.5, (6, 2))
    batch = fork1s.Batch(gripper, 6, dt=1 / 100)
    assert len(batch) == 6 and batch.controls == ["left_grip", "right_grip"]
    for _ in range(3):
        report = batch.step(controls, steps=10)
    assert report.finite.all() and report.contacts.shape == (6,) and report.residual.dtype == np.float64
    for i in range(6):
        sim = fork1s.Simulation(gripper, dt=1 / 100)
        sim.control_values = controls[i]
        sim.step(30)
        assert batch.hashes()[i] == sim.hash()
        assert_array_equal(batch.poses()[i], sim.poses)
        assert_array_equal(batch.velocities()[i], sim.velocities)
        assert_array_equal(batch.qpos[i], sim.qpos)
        assert_array_equal(batch.qvel[i], sim.qvel)
        assert_array_equal(batch.control_values[i], sim.control_values)
    cube = sim.bodies.index("cube")
    assert_array_equal(batch.poses("cube", "left_jaw")[:, 0], batch.poses()[:, cube])
    assert_allclose(batch.time, 0.3)


def test_threads_do_not_change_a_bit(hand):
    rng = np.random.default_rng(2)
    factors = {name: rng.uniform(0.5, 1.5, 9) for name in ("stiffness", "friction", "mass")}
    hashes = []
    for threads in (1, 2, 3, 0):
        batch = fork1s.Batch(hand, 9, threads=threads, **factors)
        batch.step(steps=40)
        hashes.append(batch.hashes())
    assert all((h == hashes[0]).all() for h in hashes)
    assert len(set(hashes[0].tolist())) == 9


def test_threads_after_fewer_say_nothing(scenes):
    code = (
        "import fork1s, sys; model = fork1s.load(sys.argv[1])\n"
        "for threads in 1, 64: fork1s.Batch(model, 4, threads=threads).step(steps=2)"
    )
    path = str(scenes / "fourbar_gripper.xml")
    done = subprocess.run([sys.executable, "-c", code, path], capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")


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


def test_names_and_step_are_those_of_a_simulation(gripper):
    batch, sim = fork1s.Batch(gripper, 2, dt=0.005), fork1s.Simulation(gripper, dt=0.005)
    assert (batch.bodies, batch.coordinates, batch.dt) == (sim.bodies, sim.coordinates, sim.dt)
    assert batch.poses().shape[1] == len(batch.bodies)
    assert batch.joint_displacements.shape[1] == len(batch.coordinates)


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


def test_reset_by_mask(gripper):
    batch = fork1s.Batch(gripper, 4)
    start = batch.hashes()
    batch.step([0.3, 0.3], steps=20)
    moved = batch.hashes()
    assert (start != moved).all()
    batch.reset([True, False, False, True])
    assert_array_equal(batch.hashes() == start, [True, False, False, True])
    assert_array_equal(batch.hashes() == moved, [False, True, True, False])
    assert_array_equal(batch.time == 0, [True, False, False, True])
    batch.reset(np.array([False, True, False, False]), mass=2.0)
    batch.step(steps=5)
    assert len(set(batch.hashes().tolist())) >= 3
    batch.reset()
    assert (batch.time == 0).all()


def test_seeds_draw_factors(hand):
    batch = fork1s.Batch(hand, 64, seeds=7)
    factors = batch.factors
    assert set(factors) == {"stiffness", "friction", "mass"} == set(fork1s.Batch.usual_ranges)
    for name, (low, high) in fork1s.Batch.usual_ranges.items():
        assert (
            len(set(factors[name])) == 64 and (factors[name] >= low).all() and (factors[name] <= high).all()
        )
        # Of equal likelihood in the logarithm: a quarter in each quarter, by four deviations of a binomial at most.
        quarter = np.histogram(np.log(factors[name]), bins=4, range=(np.log(low), np.log(high)))[0]
        assert abs(quarter - 16).max() < 4 * np.sqrt(64 * 0.25 * 0.75)
    batch.step(steps=20)
    # The same as with these factors given by hand, and as each alone.
    by_hand = fork1s.Batch(hand, 64, **factors)
    by_hand.step(steps=20)
    assert_array_equal(batch.hashes(), by_hand.hashes())
    one = fork1s.Batch(hand, 1, seeds=batch.seeds[5:6])
    one.step(steps=20)
    assert one.hashes()[0] == batch.hashes()[5]
    # From one seed fewer members are the first of more; another seed has none in common.
    assert_array_equal(fork1s.Batch(hand, 3, seeds=7, threads=1).seeds, batch.seeds[:3])
    assert not set(fork1s.Batch(hand, 64, seeds=8).seeds) & set(batch.seeds)


def test_reset_draws_anew_and_again_the_same(gripper):
    first, second = (fork1s.Batch(gripper, 4, seeds=[1, 2, 3, 2**64 - 1]) for _ in range(2))
    began = first.factors["mass"]
    first.reset([True, False, False, True])
    again = first.factors["mass"]
    assert_array_equal(again == began, [False, True, True, False])
    # What the others do meanwhile changes nothing.
    second.reset([True, True, False, False])
    second.step(steps=3)
    second.reset([False, True, True, True])
    assert_array_equal(second.factors["mass"] == again, [True, False, False, True])
    # A seed that is given draws its first.
    first.reset(seeds=[1, 2, 3, 2**64 - 1])
    assert_array_equal(first.factors["mass"], began)
    first.reset([False, True, False, False], mass=2)
    assert first.factors["mass"][1] == 2 and first.factors["stiffness"][1] != 1
    first.reset([False, True, False, False])
    assert first.factors["mass"][1] < 1.25


def test_seeds_draw_where_it_starts(scenes):
    arm = fork1s.load(scenes / "two_link_arm.xml")
    drawn = {"start:elbow": (-0.2, 0.1), "mass": (0.5, 2)}
    batch = fork1s.Batch(arm, 40, seeds=3, randomise=drawn)
    elbow = batch.factors["start:elbow"]
    assert elbow.min() < -0.15 and elbow.max() > 0.05 and (elbow >= -0.2).all() and (elbow <= 0.1).all()
    at = arm.mechanisms[0].coordinates.index("elbow")
    assert_allclose(batch.qpos[:, at], elbow, atol=1e-15)
    assert_allclose(np.delete(batch.qpos, at, axis=1), 0, atol=1e-15)
    assert (batch.factors["stiffness"] == 1).all() and (batch.factors["mass"] != 1).all()
    alone = fork1s.Simulation(fork1s.load(scenes / "two_link_arm.xml", q={"elbow": elbow[0]}))
    same = fork1s.Batch(arm, 40, seeds=3, randomise={"start:elbow": (-0.2, 0.1)})
    assert_array_equal(same.factors["start:elbow"], elbow)  # a range more or less changes no other number
    same.step(steps=30)
    alone.step(30)
    assert_allclose(same.qpos[0], alone.qpos, rtol=1e-9, atol=1e-12)


def test_bodies_start_elsewhere(gripper):
    batch = fork1s.Batch(
        gripper, 16, seeds=0, randomise={"start:cube.x": (-0.004, 0.004), "start:cube.rz": (-0.3, 0.3)}
    )
    x, turn = batch.factors["start:cube.x"], batch.factors["start:cube.rz"]
    poses = batch.poses("cube")[:, 0]
    assert_allclose(poses[:, 0], x, atol=1e-15)
    assert_allclose(2 * np.arctan2(poses[:, 6], poses[:, 3]), turn, atol=1e-12)
    batch.step([0.4, 0.4], steps=60)
    for i in range(2):
        sim = fork1s.Simulation(gripper)
        sim.set_state(poses={"cube": poses[i]})
        sim.control_values = [0.4, 0.4]
        sim.step(60)
        assert_allclose(batch.poses()[i], sim.poses, atol=1e-9)
    batch.reset()
    assert (batch.factors["start:cube.x"] != x).all()
    with pytest.raises(fork1s.UsageError, match="closed loops"):
        fork1s.Batch(gripper, 2, seeds=0, randomise={"start:left_crank": (0, 0.1)})
    with pytest.raises(fork1s.UsageError, match=r"is no coordinate; there are: .*cube.x to cube.rz"):
        fork1s.Batch(gripper, 2, seeds=0, randomise={"start:ball.x": (0, 0.1)})


def test_what_cannot_be_drawn(gripper):
    for randomise, said in (
        ({"colour": (1, 2)}, "'colour' is none of: stiffness, friction, mass, start:"),
        ({"mass": (0, 1)}, "0 < smallest <= largest, not 0.0 and 1.0"),
        ({"start:cube.x": (1, -1)}, "smallest <= largest"),
    ):
        with pytest.raises(fork1s.UsageError, match=said):
            fork1s.Batch(gripper, 2, seeds=1, randomise=randomise)
    with pytest.raises(fork1s.UsageError, match="nothing is drawn without seeds"):
        fork1s.Batch(gripper, 2, randomise={"mass": (1, 2)})
    with pytest.raises(fork1s.UsageError, match="made without seeds"):
        fork1s.Batch(gripper, 2).reset(seeds=1)
    for seeds in (-1, 0.5, [1, 2, 3], [1, -2], "seven"):
        with pytest.raises(ValueError, match="seeds must be a whole number from 0 to 2"):
            fork1s.Batch(gripper, 2, seeds=seeds)


def test_a_reset_that_fails_leaves_all_members_as_they_were(gripper):
    batch, other = fork1s.Batch(gripper, 9, seeds=4), fork1s.Batch(gripper, 9, seeds=4)
    for b in (batch, other):
        b.step([0.3, 0.3], steps=20)
    before, factors = batch.hashes(), batch.factors
    for at in (0, 4, 8):  # members before and after it are replaced first
        mass = np.full(9, 1.5)
        mass[at] = 1e-320  # rounds to no mass
        with pytest.raises(fork1s.ModelError, match="needs mass"):
            batch.reset(mass=mass)
        assert_array_equal(batch.hashes(), before)
        for name, values in factors.items():
            assert_array_equal(batch.factors[name], values)
    for b in (batch, other):
        b.step(steps=20)
    assert_array_equal(batch.hashes(), other.hashes())


def test_refusals(gripper):
    batch = fork1s.Batch(gripper, 3)
    with pytest.raises(ValueError, match=r"controls must have shape \(3, 2\) or \(2,\)"):
        batch.step(np.zeros((2, 3)))
    with pytest.raises(ValueError, match="controls must be finite"):
        batch.step([np.nan, 0])
    with pytest.raises(ValueError, match="mask must be 3 numbers"):
        batch.reset([True])
    with pytest.raises(ValueError, match="mass must be finite and above 0"):
        fork1s.Batch(gripper, 2, mass=[1, 0])
    with pytest.raises(ValueError, match="count: must be a whole number from 1"):
        fork1s.Batch(gripper, 0)
    with pytest.raises(fork1s.UnknownNameError, match="there is no body 'thumb'"):
        batch.poses("thumb")


def test_members_go_back_to_a_moment(hand):
    batch = fork1s.Batch(hand, 5, seeds=3)
    batch.step(steps=10)
    moment = batch.save()
    assert len(moment) == 5
    there = batch.hashes()
    batch.step(steps=5)
    later = batch.hashes()
    batch.restore(moment)
    assert_array_equal(batch.hashes(), there)
    batch.step(steps=5)
    assert_array_equal(batch.hashes(), later)
    batch.restore(moment, [0, 1, 0, 0, 1])
    assert_array_equal(batch.hashes() == there, [False, True, False, False, True])
    # Resampled: each takes another's moment with its factors.
    batch.restore(moment, members=[2, 2, 2, 0, 4])
    assert_array_equal(batch.hashes(), there[[2, 2, 2, 0, 4]])
    assert len(set(batch.factors["friction"][:3].tolist())) == 1
    batch.step(steps=5)
    assert_array_equal(batch.hashes(), later[[2, 2, 2, 0, 4]])
    # A reset draws other factors; a moment brings those of then.
    batch.reset()
    batch.restore(moment)
    batch.step(steps=5)
    assert_array_equal(batch.hashes(), later)


def test_all_start_from_the_moment_of_a_simulation(gripper):
    sim = fork1s.Simulation(gripper, dt=1 / 60)
    sim.controls["left_grip"] = 0.3
    sim.step(20)
    batch = fork1s.Batch(gripper, 3, dt=1 / 60)
    batch.restore(sim.save())
    assert (batch.hashes() == sim.hash()).all()
    rows = np.array([[0.3, 0.0], [0.1, 0.2], [0.4, 0.4]])
    batch.step(rows, steps=10)
    there = sim.save()
    for i in range(3):
        sim.restore(there)
        sim.control_values = rows[i]
        sim.step(10)
        assert batch.hashes()[i] == sim.hash()
    with pytest.raises(fork1s.UsageError, match="member 1 has factors"):
        fork1s.Batch(gripper, 2, dt=1 / 60, friction=[1, 2]).restore(there)
    with pytest.raises(fork1s.UsageError, match="dt"):
        fork1s.Batch(gripper, 2, dt=1 / 100).restore(there)
    with pytest.raises(fork1s.UsageError, match="another stiffness"):
        other = fork1s.Simulation(gripper, dt=1 / 60)
        other.set_stiffness({"left_crank": 7.0})
        batch.restore(other.save())
    with pytest.raises(fork1s.UsageError, match="3 members"):
        fork1s.Batch(gripper, 2, dt=1 / 60).restore(batch.save())
    with pytest.raises(ValueError, match="0 to 2"):
        batch.restore(batch.save(), members=[0, 1, 3])
    with pytest.raises(TypeError, match="moment"):
        batch.restore(7)


def test_states_pushes_and_contacts_of_members(gripper):
    batch = fork1s.Batch(gripper, 4, dt=1 / 60)
    qpos, qvel = batch.qpos, batch.qvel
    sim = fork1s.Simulation(gripper, dt=1 / 60)
    qvel[:, -4] = [0, 0.01, 0.02, 0.03]  # of the cube, upwards
    batch.set_state(qpos, qvel, mask=[1, 1, 0, 1])
    assert_allclose(batch.qvel[:, -4], [0, 0.01, 0, 0.03], atol=1e-12)
    sim.set_state(qpos=qpos[1], qvel=qvel[1])
    batch.step(steps=5)
    sim.step(5)
    assert batch.hashes()[1] == sim.hash()
    assert_array_equal(copy.deepcopy(batch).hashes(), batch.hashes())

    forces = np.outer([0.0, 0.1, 0.2, 0.3], [0, 0, 1])
    batch = fork1s.Batch(gripper, 4, dt=1 / 60)
    batch.step(steps=6, push={"cube": forces})
    sim = fork1s.Simulation(gripper, dt=1 / 60)
    sim.push("cube", force=forces[2])
    sim.step(6)
    assert batch.hashes()[2] == sim.hash()
    assert_array_equal(batch.poses()[2], sim.poses)
    contacts = batch.contacts
    assert contacts.dtype == fork1s.BATCH_CONTACT
    of_two = contacts[contacts["member"] == 2]
    for name in fork1s.CONTACT.names:
        assert_array_equal(of_two[name], sim.contacts[name])
    batch.step(push={"cube": [0, 0, 0.001, 0, 0, 0.1], "left_jaw": [0, 0, 0.1]})
    with pytest.raises(fork1s.UnknownNameError, match="'cub'"):
        batch.step(push={"cub": [0, 0, 1]})
    with pytest.raises(ValueError, match="push"):
        batch.step(push={"cube": [0, 1]})


def test_moment_with_pushes_is_refused(gripper):
    sim = fork1s.Simulation(gripper, dt=1 / 60)
    sim.push("cube", force=[0.5, 0, 0])
    batch = fork1s.Batch(gripper, 2, dt=1 / 60)
    before = batch.hashes()
    with pytest.raises(fork1s.UsageError, match="pushes for the next call"):
        batch.restore(sim.save())
    assert_array_equal(batch.hashes(), before)
