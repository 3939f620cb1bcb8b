// Linear couplings of several joints: a differential, and random trees by both simulators.
#include <fmt/format.h>

#include <cmath>
#include <draws.hpp>
#include <fork1s/importer/importer.hpp>
#include <fork1s/sim/simulation.hpp>
#include <numeric>
#include <random_mechanism.hpp>

#include "support.hpp"

namespace fork1s::reference_test {
namespace {

// Rotors m1, m2 drive pitch = (m1 + m2)/2 and roll = (m1 - m2)/2 by equalities of fixed tendons. The roll body is
// round about its axis, so that its inertia about the pitch axis is the same at every roll.
constexpr double kRotor = 0.01, kPitch = 0.03, kRound = 0.004, kAcross = 0.007;  // kg m²
constexpr double kServo = 5;                                                     // N m/rad, of each rotor

std::string Differential(double damping) {
  return fmt::format(R"(<mujoco><compiler angle="radian"/><option gravity="0 0 0"/>
    <default><geom contype="0" conaffinity="0"/></default><worldbody>
    <body name="r1" pos="0 .3 0"><joint name="m1" axis="0 1 0"/><inertial pos="0 0 0" mass=".1" diaginertia="{0} {0} {0}"/></body>
    <body name="r2" pos="0 -.3 0"><joint name="m2" axis="0 1 0"/><inertial pos="0 0 0" mass=".1" diaginertia="{0} {0} {0}"/></body>
    <body name="pitchb"><joint name="pitch" axis="0 1 0"/><inertial pos="0 0 0" mass="1" diaginertia="{1} {1} {1}"/>
      <body name="rollb"><joint name="roll" axis="1 0 0"/>
        <inertial pos="0 0 0" mass=".5" diaginertia="{2} {3} {3}"/></body></body></worldbody>
    <tendon>
      <fixed name="tp"><joint joint="m1" coef=".5"/><joint joint="m2" coef=".5"/><joint joint="pitch" coef="-1"/></fixed>
      <fixed name="tr"><joint joint="m1" coef=".5"/><joint joint="m2" coef="-.5"/><joint joint="roll" coef="-1"/></fixed>
    </tendon>
    <equality><tendon tendon1="tp"/><tendon tendon1="tr"/></equality>
    <actuator><position name="p1" joint="m1" kp="{4}" kv="{5}"/><position name="p2" joint="m2" kp="{4}" kv="{5}"/></actuator>
    </mujoco>)",
                     kRotor, kPitch, kRound, kAcross, kServo, damping);
}

Scene ImportDifferential(double damping) {
  ImportOptions options;
  options.interfaces = {"r1", "r2", "rollb"};
  auto imported = LoadMechanismFromString(Differential(damping), "differential.xml", options);
  if (!imported) throw std::runtime_error(imported.error().Text());
  return std::move(imported->scene);
}

// m1 = pitch + roll and m2 = pitch - roll, so each of pitch and roll is an oscillator with twice the inertia and the
// servos of a rotor, which starts at rest away from its set-point.
double OscillatorAt(double t, double inertia, double damping, double set_point) {
  const double I = 2 * kRotor + inertia, half = damping / I, w = std::sqrt(2 * kServo / I - half * half);
  return set_point * (1 - std::exp(-half * t) * (std::cos(w * t) + half / w * std::sin(w * t)));
}

// Displacements at the end: of joints named in order.
Vector4 EndOf(const Scene& scene, double seconds, double h, bool reduced, double u1, double u2) {
  const char* const names[] = {"m1", "m2", "pitch", "roll"};
  VectorX q;
  const auto mechanism = testing::Share(scene.mechanisms[0]);
  if (reduced) {
    SimulationOptions options;
    options.dt = h;
    options.step.integrator = Integrator::kTwoStage;
    auto simulation = Simulation::Create(scene, options);
    if (!simulation) throw std::runtime_error(simulation.error().Text());
    simulation->SetControl("p1", u1);
    simulation->SetControl("p2", u2);
    for (int i = 0; i < static_cast<int>(std::lround(seconds / h)); ++i) simulation->Step();
    q = simulation->JointCoordinates(0);
  } else {
    FullSimulation full = Start(scene, h, FullIntegrator::kTwoStages);
    full.SetControl(full.FindControl("p1"), u1);
    full.SetControl(full.FindControl("p2"), u2);
    Advance(full, seconds);
    q = full.Displacements(0);
  }
  Vector4 out;
  for (int i = 0; i < 4; ++i)
    for (const auto& joint : mechanism->joints())
      if (joint.name == names[i]) out(i) = q(joint.offset);
  return out;
}

TEST(Couplings, Differential_FollowsItsClosedForm) {
  constexpr double kDamping = 0.05, kSeconds = 0.5, kU1 = 0.8, kU2 = 0.2;  // N m s/rad, s, rad
  const double pitch = OscillatorAt(kSeconds, kPitch + kAcross, kDamping, (kU1 + kU2) / 2),
               roll = OscillatorAt(kSeconds, kRound, kDamping, (kU1 - kU2) / 2);
  const Vector4 expected(pitch + roll, pitch - roll, pitch, roll);
  const Scene scene = ImportDifferential(kDamping);
  ASSERT_EQ(scene.mechanisms.size(), 1u);
  for (const bool reduced : {true, false}) {
    SCOPED_TRACE(reduced ? "reduced" : "full");
    const double coarse = (EndOf(scene, kSeconds, 1.0 / 480, reduced, kU1, kU2) - expected).norm(),
                 fine = (EndOf(scene, kSeconds, 1.0 / 960, reduced, kU1, kU2) - expected).norm();
    // Of second order with an error of about (ω h)² of a swing: ω is 20 rad/s, so 2e-3 at the longer step.
    EXPECT_LT(coarse, 2e-3);
    EXPECT_GT(coarse / fine, 3.4);
  }
}

TEST(Couplings, Differential_RestsWhereItsServosPutIt) {
  const Scene scene = ImportDifferential(0.3);
  for (const bool reduced : {true, false}) {
    const Vector4 end = EndOf(scene, 5, 1.0 / 60, reduced, 0.8, 0.2);
    // exp(-0.3 t / I) of the slower one, 1e-11 after 5 s, and rounding.
    EXPECT_LT((end - Vector4(0.8, 0.2, 0.5, 0.3)).cwiseAbs().maxCoeff(), 1e-8) << end.transpose();
  }
}

// Trees of hinges with two linear couplings of three to five joints each.
MechanismDef RandomCoupled(unsigned seed) {
  testing::RandomMechanismOptions options;
  options.damping_ratio = 0;
  options.hinges_only = true;
  MechanismDef def = testing::RandomMechanismDef(seed, options);
  testing::RandomSource random(seed + 500);
  const int n = static_cast<int>(def.joints.size());
  std::vector<int> free(static_cast<std::size_t>(n));
  std::iota(free.begin(), free.end(), 0);
  for (int k = 0; k < 2; ++k) {
    CouplingDef c;
    c.name = "coupling" + std::to_string(k);
    std::fill(std::begin(c.polynomial), std::end(c.polynomial), 0.0);
    const auto draw = [&] {
      const auto at = free.begin() + random.Below(static_cast<int>(free.size()));
      const FreedomRef ref{JointIndex(*at), 0};
      free.erase(at);
      return ref;
    };
    const int joints = 3 + static_cast<int>((seed + static_cast<unsigned>(k)) % 3);
    if (static_cast<int>(free.size()) < joints) break;
    c.a = draw();
    for (int i = 1; i < joints; ++i) c.terms.emplace_back(draw(), random.Uniform(-1.5, 1.5));
    def.couplings.push_back(c);
  }
  def.modes = 100;
  return def;
}

// How far couplings of the definition are from holding, by its own terms.
double WorstCoupling(const MechanismDef& def, const VectorX& q) {
  double worst = 0;
  for (const CouplingDef& c : def.couplings) {
    double sum = q(c.a.joint.value());
    for (const auto& [ref, coefficient] : c.terms) sum -= coefficient * q(ref.joint.value());
    worst = std::max(worst, std::abs(sum));
  }
  return worst;
}

TEST(Couplings, OfRandomTrees_HoldAfterEachStep_KeepEnergy_InBothSimulators) {
  for (unsigned seed = 0; seed < testing::Seeds(4, 12); ++seed) {
    SCOPED_TRACE(seed);
    const auto mechanism = testing::Share(RandomCoupled(seed));
    const MechanismDef& def = mechanism->definition();
    if (def.couplings.empty()) continue;
    const int n = mechanism->num_coordinates();
    ASSERT_EQ(n, static_cast<int>(def.joints.size()));
    testing::RandomSource random(seed + 900);
    Scene scene = Of(def);
    VectorX q_dot = random.Vector(n, 1);  // that the couplings allow
    for (const CouplingDef& c : def.couplings) {
      q_dot(c.a.joint.value()) = 0;
      for (const auto& [ref, coefficient] : c.terms)
        q_dot(c.a.joint.value()) += coefficient * q_dot(ref.joint.value());
    }
    StartAt(scene, VectorX::Zero(n), q_dot);
    double apart[2], off[2] = {}, off_full[2] = {};  // of energies at the start
    for (const int halved : {0, 1}) {
      const double h = 1.0 / (480 << halved);
      FullSimulation full = Start(scene, h, FullIntegrator::kTwoStages);
      SimulationOptions options;
      options.dt = h;
      options.initial_keyframe = 0;
      options.step.newton_tolerance = 1e-12;
      options.step.integrator = Integrator::kTwoStage;
      auto simulation = Simulation::Create(scene, options);
      ASSERT_TRUE(simulation) << simulation.error().Text();
      const double start = simulation->Energy(), start_full = full.Energy();
      for (int i = 0; i < 60 << halved; ++i) {
        ASSERT_TRUE(full.Step().converged);
        simulation->Step();
        ASSERT_LT(WorstCoupling(def, full.Displacements(0)), 1e-12) << i;  // rounding
        ASSERT_LT(WorstCoupling(def, simulation->JointCoordinates(0)), 1e-12) << i;
        off[halved] = std::max(off[halved], std::abs(simulation->Energy() / start - 1));
        off_full[halved] = std::max(off_full[halved], std::abs(full.Energy() / start_full - 1));
      }
      EXPECT_NEAR(start, start_full, 1e-12 * start);
      apart[halved] = (full.Displacements(0) - simulation->JointCoordinates(0)).norm();
    }
    // Both take the same scheme, and solve it: what is left is what the full one leaves of its stages.
    EXPECT_LT(apart[0], 2e-8);
    EXPECT_LT(apart[1], 2e-8);
    // Nothing damps or drives: what is lost or gained is the step's error.
    EXPECT_LT(off[1], 0.3 * off[0] + 1e-12) << off[0];
    EXPECT_LT(off_full[1], 0.3 * off_full[0] + 1e-12) << off_full[0];
  }
}

}  // namespace
}  // namespace fork1s::reference_test
