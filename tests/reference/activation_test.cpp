// Controls with dynamics of first order: closed forms, the reduced and the full simulator, MuJoCo.
#include <mujoco/mujoco.h>

#include <cmath>
#include <draws.hpp>
#include <fork1s/importer/importer.hpp>
#include <fork1s/mechanism/builder.hpp>
#include <fork1s/sim/simulation.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <fstream>
#include <memory>
#include <random_mechanism.hpp>
#include <string>

#include "support.hpp"

namespace fork1s::reference_test::activation {
namespace {

constexpr double kMass = 2;    // kg
constexpr double kGain = 5;    // N per unit of the activation
constexpr double kLag = 0.12;  // s

/// A motor on a slide of kMass; its activation follows the input with kLag.
MechanismDef MotorOnSlide() {
  MechanismBuilder builder("slider");
  BodyDef body;
  body.name = "mass";
  body.parent = builder.base();
  body.inertia.mass = kMass;
  body.inertia.rotational = Vector3::Constant(1e-3).asDiagonal();
  const BodyIndex b = builder.AddBody(body);
  const JointIndex slide = builder.AddJoint(JointDef::Slide("slide", b, Vector3::UnitX()));
  ControlDef motor;
  motor.name = "motor";
  motor.terms.emplace_back(FreedomRef{slide, 0}, 1.0);
  motor.gain = kGain;
  motor.dynamics = ControlDynamics::kLag;
  motor.time_constant = kLag;
  builder.AddControl(motor);
  builder.SetInterfaces({"mass"});
  return builder.definition();
}

Simulation MustCreate(const Scene& scene, double h, Integrator integrator = Integrator::kTwoStage,
                      bool controls_move = false) {
  SimulationOptions options;
  options.dt = h;
  options.step.integrator = integrator;
  options.step.controls_move = controls_move;
  options.initial_keyframe = scene.keyframes.empty() ? -1 : 0;
  options.reduction.promote_hidden = true;
  options.reduction.modes = 100;
  auto simulation = Simulation::Create(scene, options);
  if (!simulation) throw std::runtime_error(simulation.error().Text());
  return std::move(*simulation);
}

double Activation(const Simulation& simulation, int control = 0) {
  return simulation.world().mechanisms()[0].activation()(control);
}

double Place(const Simulation& simulation) { return simulation.JointCoordinates(0)(0); }
double Place(const FullSimulation& simulation) { return simulation.Displacements(0)(0); }

/// Where the slide is after half a second in which the input is input(t) at the ends of steps.
template <class Simulator, class Input>
double Position(Simulator simulation, const Input& input) {
  const int steps = static_cast<int>(std::lround(0.5 / simulation.dt()));
  for (int i = 1; i <= steps; ++i) {
    simulation.SetControl(0, input(i * simulation.dt()));
    simulation.Step();
  }
  return Place(simulation);
}

template <class Input>
void ExpectOrders(double exact, bool controls_move, const Input& input) {
  double last[4] = {};
  for (const double h : {1.0 / 60, 1.0 / 120, 1.0 / 240}) {
    const Scene scene = Of(MotorOnSlide());
    const double errors[] = {
        Position(MustCreate(scene, h, Integrator::kTwoStage, controls_move), input) - exact,
        Position(Start(scene, h, FullIntegrator::kTwoStages, controls_move), input) - exact,
        Position(MustCreate(scene, h, Integrator::kEuler, controls_move), input) - exact,
        Position(Start(scene, h, FullIntegrator::kEuler, controls_move), input) - exact};
    // Two codes of one rule differ by rounding and the tolerance of a stage.
    EXPECT_NEAR(errors[0], errors[1], 1e-9);
    EXPECT_NEAR(errors[2], errors[3], 1e-9);
    for (int i = 0; i < 4 && last[i] != 0; ++i) {
      // Halved steps: a quarter of the error in second order, half in first, up to a share of h/T = 0.03 and more.
      const double ratio = errors[i] / last[i], expected = i < 2 ? 0.25 : 0.5;
      EXPECT_NEAR(ratio, expected, 0.15 * expected) << i << " at " << h;
    }
    std::copy(errors, errors + 4, last);
  }
  // h²/T² at 1/240 s is 1.2e-3.
  EXPECT_LT(std::abs(last[0]), 1.2e-3 * exact);
}

TEST(Activation, OfALaggedMotorMovesASlideAsTheClosedForm) {
  const double t = 0.5, e = 1 - std::exp(-t / kLag);
  ExpectOrders(kGain / kMass * (t * t / 2 - kLag * t + kLag * kLag * e), false, [](double) { return 1.0; });
}

TEST(Activation, FollowsAnInputThatMovesWithinTheStep) {
  const double t = 0.5, e = 1 - std::exp(-t / kLag);
  const double exact = kGain / kMass * (t * t * t / 6 - kLag * t * t / 2 + kLag * kLag * (t - kLag * e));
  ExpectOrders(exact, true, [](double now) { return now; });
}

TEST(Activation, IsTheSolutionAtTheEndOfEveryStep) {
  for (const Integrator integrator : {Integrator::kEuler, Integrator::kTwoStage}) {
    Simulation simulation = MustCreate(Of(MotorOnSlide()), 1.0 / 60, integrator);
    simulation.SetControl(0, 0.7);
    for (int i = 1; i <= 30; ++i) {
      simulation.Step();
      EXPECT_NEAR(Activation(simulation), 0.7 * (1 - std::exp(-i / 60.0 / kLag)), 1e-14);
    }
  }
}

TEST(Activation, IsTheSameWhereAStepIsHalvedByAnImpact) {
  MechanismDef def = MotorOnSlide();
  def.joints[0].freedoms[0].upper = 0.02;
  Simulation simulation = MustCreate(Of(def), 1.0 / 60);
  simulation.SetControl(0, 1);
  int most_parts = 0;
  for (int i = 1; i <= 30; ++i) {
    most_parts = std::max(most_parts, simulation.Step().parts);
    EXPECT_NEAR(Activation(simulation), 1 - std::exp(-i / 60.0 / kLag), 1e-14);
  }
  EXPECT_GT(most_parts, 1);
}

TEST(Activation, OfALagMuchShorterThanTheStepActsAsTheInput) {
  // A stiff servo, which the jump of a control without lag may not overshoot either.
  for (const double rate : {1.0, 30.0, 300.0, 3000.0}) {  // rad/s
    MechanismDef def = MotorOnSlide();
    def.joints[0].freedoms[0].stiffness = def.controls[0].gain = kMass * rate * rate;
    def.joints[0].freedoms[0].damping = 0.8 * kMass * rate;
    def.controls[0].is_setpoint = true;
    def.controls[0].time_constant = 1e-6;
    MechanismDef without = def;
    without.controls[0].dynamics = ControlDynamics::kNone;
    Simulation lag = MustCreate(Of(def), 1.0 / 60), none = MustCreate(Of(without), 1.0 / 60);
    lag.Step(), none.Step();
    lag.SetControl(0, 0.1), none.SetControl(0, 0.1);
    for (int i = 0; i < 20; ++i) {
      lag.Step(), none.Step();
      // c of the jump is γ = 0.29 at least with a lag; without, it is 0.21 at least.
      EXPECT_NEAR(lag.JointCoordinates(0)(0), none.JointCoordinates(0)(0), 1e-3) << rate << " step " << i;
    }
  }
}

TEST(Activation, SavedIsRestoredWithAllItsBits) {
  for (const Integrator integrator : {Integrator::kEuler, Integrator::kTwoStage}) {
    Simulation simulation = MustCreate(Of(MotorOnSlide()), 1.0 / 60, integrator);
    simulation.SetControl(0, 1);
    for (int i = 0; i < 5; ++i) simulation.Step();
    const Simulation::Snapshot then = simulation.Save();
    const std::uint64_t hash = simulation.HashState();
    for (int i = 0; i < 5; ++i) simulation.Step();
    const std::uint64_t end = simulation.HashState();
    ASSERT_TRUE(simulation.Restore(then));
    EXPECT_EQ(simulation.HashState(), hash);
    for (int i = 0; i < 5; ++i) simulation.Step();
    EXPECT_EQ(simulation.HashState(), end);
    // It is part of the state.
    Simulation::Snapshot other = then;
    other.world.mechanisms[0].activation(0) += 1e-9;
    ASSERT_TRUE(simulation.Restore(other));
    EXPECT_NE(simulation.HashState(), hash);
  }
}

TEST(Activation, GoesOnInAnotherLevelOfDetailAndFromAKeyframe) {
  Scene scene = Of(MotorOnSlide());
  scene.mechanisms[0].controls[0].initial_activation = 0.25;
  Simulation simulation = MustCreate(scene, 1.0 / 60);
  EXPECT_EQ(Activation(simulation), 0.25);
  simulation.SetControl(0, 1);
  simulation.Step();
  const double before = Activation(simulation);
  KeyframeDef key = simulation.State();
  ASSERT_EQ(key.mechanisms[0].activation.size(), 1);
  EXPECT_EQ(key.mechanisms[0].activation(0), before);
  ASSERT_TRUE(simulation.SetFidelity({DetailLevel::kAll, 0, Recovery::kExact}));
  EXPECT_EQ(Activation(simulation), before);
  scene.keyframes = {key};
  Simulation again = MustCreate(scene, 1.0 / 60);
  EXPECT_EQ(Activation(again), before);
  FullSimulation full = Start(scene, 1.0 / 60, FullIntegrator::kTwoStages);
  simulation.Step(), full.Step();
  EXPECT_NEAR(Place(full), Place(simulation), 1e-10);
}

TEST(Activation, RandomMechanismsGoTheWayOfTheFullModel) {
  for (const bool moves : {false, true})
    for (unsigned seed = 1; seed <= testing::Seeds(1, 3); ++seed) {
      testing::RandomMechanismOptions options;
      options.controls = 3;
      options.bounded_servos = 1;
      MechanismDef def = testing::RandomMechanismDef(seed, options);
      ASSERT_GE(def.controls.size(), 4u);
      for (std::size_t k = 0; k < 3; ++k) {
        ControlDef& c = def.controls[k];
        c.dynamics = k == 1 ? ControlDynamics::kIntegrator : ControlDynamics::kLag;
        c.time_constant = k == 0 ? 0.05 : 0.003;
        c.activation_lower = -0.05;
        c.activation_upper = 0.06;
        c.lower = -1, c.upper = 1;
      }
      def.controls[3].dynamics = ControlDynamics::kLag;  // of a servo with a bound of its force
      def.controls[3].time_constant = 0.02;
      Scene scene = Of(def, Vector3(1, -2, -9));
      const int n = testing::Share(def)->num_coordinates();
      testing::RandomSource random(seed + 50);
      StartAt(scene, VectorX::Zero(n), random.Vector(n, 1));
      const auto apart = [&](double h) {
        Simulation reduced = MustCreate(scene, h, Integrator::kTwoStage, moves);
        FullSimulation full = Start(scene, h, FullIntegrator::kTwoStages, moves);
        for (int i = 1; i * h < 0.25 + 1e-9; ++i) {
          for (int k = 0; k < 4; ++k) {
            const double u = 0.3 * std::sin(25.0 * i * h + k);
            reduced.SetControl(k, u), full.SetControl(k, u);
          }
          EXPECT_TRUE(reduced.Step().finite);
          EXPECT_TRUE(full.Step().converged);
        }
        double most = 0;
        for (std::size_t b = 0; b < full.bodies().size(); ++b)
          most = std::max(most, (full.Pose(static_cast<int>(b)).translation() -
                                 reduced.Pose(full.bodies()[b].name).translation())
                                    .norm());
        return most;
      };
      // As of mechanisms without controls (two_stages_roads_test.cpp).
      EXPECT_LT(apart(1.0 / 480), 4e-5) << seed << moves;
      EXPECT_LT(apart(1.0 / 960), 1e-5) << seed << moves;
    }
}

// Motors and servos on an arm of three joints with filters, an integrator that meets its bound, and a keyframe.
constexpr const char* kArm = R"(<mujoco><option gravity="0 0 -3" timestep="1e-4" integrator="implicitfast"/>
  <worldbody><body name="a"><joint name="ja" axis="0 1 0" damping=".2"/>
    <geom type="capsule" fromto="0 0 0 .3 0 0" size=".03" mass="1" contype="0" conaffinity="0"/>
    <body name="b" pos=".3 0 0"><joint name="jb" axis="0 1 0"/>
      <geom type="capsule" fromto="0 0 0 .3 0 0" size=".03" mass=".6" contype="0" conaffinity="0"/>
      <body name="c" pos=".3 0 0"><joint name="jc" axis="1 0 0" damping=".01"/>
        <geom type="box" size=".05 .04 .03" pos="0 .02 0" mass=".3" contype="0" conaffinity="0"/></body></body></body></worldbody>
  <actuator><general name="motor" joint="ja" dyntype="filter" dynprm=".05" gainprm="3" gear="2"/>
    <general name="servo" joint="jb" dyntype="filterexact" dynprm=".02" gainprm="20" biastype="affine" biasprm="0 -20 -1"/>
    <intvelocity name="integrated" joint="jc" kp="2" kv=".05" actrange="-.2 .15"/></actuator>
  <keyframe><key name="k" qpos=".1 -.2 .05" qvel="0 .5 -1" act=".3 .1 -.1" ctrl="-.4 .6 .9"/></keyframe></mujoco>)";

TEST(Activation, OfFiltersAndIntegratorsIsMuJoCosAtSmallSteps) {
  const std::string path = ::testing::TempDir() + "fork1s_activation.xml";
  std::ofstream(path) << kArm;
  char error[500] = "";
  const std::unique_ptr<mjModel, void (*)(mjModel*)> model(mj_loadXML(path.c_str(), nullptr, error, 500),
                                                           mj_deleteModel);
  ASSERT_NE(model, nullptr) << error;
  ImportOptions options;
  options.keyframe = "k";
  const auto imported = LoadMechanism(path, options);
  ASSERT_TRUE(imported) << imported.error().Text();
  for (const ImportNote& note : imported->report.notes)
    EXPECT_NE(note.kind, ImportNote::Kind::kDropped) << note.where << ": " << note.message;
  constexpr double kTime = 0.5;  // s
  const auto of_mujoco = [&](double h) {
    const std::unique_ptr<mjData, void (*)(mjData*)> data(mj_makeData(model.get()), mj_deleteData);
    model->opt.timestep = h;
    mj_resetDataKeyframe(model.get(), data.get(), 0);
    for (int i = 0; i < std::lround(kTime / h); ++i) mj_step(model.get(), data.get());
    VectorX all(6);
    all << Eigen::Map<const Vector3>(data->qpos), Eigen::Map<const Vector3>(data->act);
    return all;
  };
  const auto of_reduced = [&](double h) {
    Simulation s = MustCreate(imported->scene, h);
    for (int i = 0; i < std::lround(kTime / h); ++i) s.Step();
    VectorX all(6);
    all << s.JointCoordinates(0), s.world().mechanisms()[0].activation();
    return all;
  };
  // Steps of first order in MuJoCo, of second order here, each with the leading term of its error removed.
  const VectorX theirs = 2 * of_mujoco(1e-5) - of_mujoco(2e-5),
                ours = (4 * of_reduced(1.0 / 960) - of_reduced(1.0 / 480)) / 3;
  EXPECT_LT((theirs.head<3>() - ours.head<3>()).cwiseAbs().maxCoeff(), 1e-5);
  EXPECT_LT((theirs.tail<3>() - ours.tail<3>()).cwiseAbs().maxCoeff(), 1e-6);
  EXPECT_EQ(ours(5), 0.15);  // the integrator stands at its bound
}

}  // namespace
}  // namespace fork1s::reference_test::activation
