// Many servos with tight bounds at once, among contacts: which of them give all they can is found in every step.
#include <cmath>
#include <draws.hpp>
#include <random>
#include <string>

#include "constraints/contact_problem.hpp"
#include "support.hpp"

namespace fork1s {
namespace {

constexpr int kJoints = 6;
constexpr double kServoLink = 0.25, kServoTip = 0.03;

struct ServoDraw {
  double stiffness = 1;  // of every servo, times 0.1 to 10 [N·m/rad]
  BaseKind base = BaseKind::kFixed;
};

/// An arm of links along x, hinges about y and z in turn, each with a servo that gives a few newton metres.
MechanismDef ServoArm(std::mt19937& random, const ServoDraw& drawn) {
  std::uniform_real_distribution<double> unit(0, 1);
  MechanismBuilder builder("arm", drawn.base, testing::Ball(2, 0.1));
  BodyIndex parent = builder.base();
  std::vector<JointIndex> joints;
  std::vector<double> stiffness;
  for (int i = 0; i < kJoints; ++i) {
    BodyDef link;
    link.name = "link" + std::to_string(i);
    link.parent = parent;
    if (i > 0) link.X_PB = RigidTransform(Vector3(kServoLink, 0, 0));
    link.inertia = testing::Rod(0.3 + unit(random), kServoLink);
    link.geometries.push_back(
        testing::Geometry(link.name, Sphere{kServoTip}, 0.6, RigidTransform(Vector3(kServoLink, 0, 0))));
    parent = builder.AddBody(link);
    stiffness.push_back(drawn.stiffness * std::pow(10.0, 2 * unit(random) - 1));
    joints.push_back(builder.AddJoint(
        JointDef::Hinge("joint" + std::to_string(i), parent, i % 2 ? Vector3::UnitZ() : Vector3::UnitY())
            .WithSpring(stiffness.back(), 0.02 * stiffness.back())));
  }
  for (int i = 0; i < kJoints; ++i) {
    ControlDef servo;
    servo.name = "servo" + std::to_string(i);
    servo.terms.emplace_back(FreedomRef{joints[static_cast<std::size_t>(i)], 0}, 1.0);
    servo.gain = stiffness[static_cast<std::size_t>(i)];
    servo.is_setpoint = true;
    builder.AddControl(servo);
  }
  builder.SetInterfaces({"link3", "link5"});
  MechanismDef def = builder.definition();
  for (int i = 0; i < kJoints; ++i) {
    const auto at = static_cast<std::size_t>(i);
    ForceLimitDef bound;
    bound.name = "servo" + std::to_string(i);
    bound.terms = {{FreedomRef{joints[at], 0}, 1.0}};
    bound.inputs = {{bound.name, 1.0}};
    bound.stiffness = stiffness[at];
    bound.damping = 0.02 * stiffness[at];
    bound.upper = 0.3 + 10 * unit(random) * unit(random);
    bound.lower = -bound.upper;
    // Winches and cylinders that act one way only.
    if (i % 3 == 1) bound.lower = 0;
    if (i % 3 == 2) bound.upper = 0;
    def.force_limits.push_back(bound);
  }
  return def;
}

/// Arm, floor and three boxes that it pushes about.
Scene Drawn(unsigned seed, std::mt19937& random) {
  ServoDraw drawn;
  drawn.stiffness = std::pow(10.0, 2 + static_cast<double>(seed % 4) * 2);
  drawn.base = seed % 3 == 2 ? BaseKind::kFloating : BaseKind::kFixed;
  Scene scene;
  scene.mechanisms.push_back(ServoArm(random, drawn));
  scene.world.push_back(testing::Geometry("floor", Plane{}, 0.6, RigidTransform(Vector3(0, 0, -0.2))));
  for (int i = 0; i < 3; ++i)
    scene.free_bodies.push_back(testing::BoxBody("box" + std::to_string(i), 0.5, Vector3(0.06, 0.06, 0.06),
                                                 Vector3(0.4 + 0.35 * i, 0.03 * i, -0.13), 0.6));
  return scene;
}

std::vector<signed char> Sides(const World& world) {
  MechanismState state;
  world.mechanisms()[0].Save(state);
  return state.at_bound;
}

/// Steps worlds of the seeds from 0 on, with other set-points in every 15th step: before(world), step, after(world,
/// report, "seed s, step i").
template <class Before, class After>
void StepAll(unsigned seeds, int steps, const StepOptions& options, const Before& before,
             const After& after) {
  for (unsigned seed = 0; seed < seeds; ++seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> unit(-1, 1);
    World world = testing::MustCreate(Drawn(seed, random));
    for (int step = 0; step < steps; ++step) {
      if (step % 15 == 0)
        for (double& u : world.mechanisms()[0].controls()) u = 1.2 * unit(random);
      before(world);
      const StepReport report = world.Step(options);
      ASSERT_TRUE(report.finite) << "seed " << seed << ", step " << step;
      after(world, report, "seed " + std::to_string(seed) + ", step " + std::to_string(step));
    }
  }
}

class ManyServos : public ::testing::TestWithParam<Integrator> {};

// Some steps in a thousand are not solved, and say so.
TEST_P(ManyServos, EveryStepFindsWhichGiveAllTheyCan) {
  int turns = 0, steps = 0, unsolved = 0;
  StepOptions options;
  options.integrator = GetParam();
  std::vector<signed char> last;
  const auto after = [&](const World& world, const StepReport& report, const std::string& when) {
    ++steps;
    unsolved += report.IsSolved() && report.stages_converged ? 0 : 1;
    // Servos of at most 10 N m that turn by at most 2.4 rad, six of them every 15 steps, and falls of 0.2 m.
    EXPECT_LT(world.mechanisms()[0].KineticEnergy(), 200) << when;
    const std::vector<signed char> sides = Sides(world);
    for (std::size_t k = 0; k < sides.size(); ++k) turns += sides[k] != last[k];
  };
  StepAll(
      testing::Seeds(25, 100), 150, options, [&](const World& world) { last = Sides(world); }, after);
  EXPECT_GT(turns, steps / 20);
  EXPECT_LT(unsolved, steps / (GetParam() == Integrator::kEuler ? 200 : 500));
}

INSTANTIATE_TEST_SUITE_P(Integrators, ManyServos,
                         ::testing::Values(Integrator::kEuler, Integrator::kTwoStage));

// By backward Euler the way of a step is its end velocity times h, so lengths before and after tell the force
// that springs and dampers would have at its end: beyond the bound just where that is taken, and nowhere
// else.
TEST(ServoLaw, HoldsAtTheEndOfTheStep) {
  int at_bound = 0, between = 0;
  StepOptions options = testing::BackwardEuler(1.0 / 60, testing::kDown);
  options.refresh = false;
  std::vector<double> before;
  const auto measure = [&](const World& world) {
    before.clear();
    const MechanismDynamics& m = world.mechanisms()[0];
    for (const auto& limit : m.mechanism().force_limits()) before.push_back(m.Length(limit.length));
  };
  const auto after = [&](const World& world, const StepReport& report, const std::string& when) {
    if (report.parts > 1 || !report.stages_converged) return;
    const MechanismDynamics& m = world.mechanisms()[0];
    const auto& limits = m.mechanism().force_limits();
    const std::vector<signed char> sides = Sides(world);
    for (std::size_t k = 0; k < limits.size(); ++k) {
      const double length = m.Length(limits[k].length), rate = (length - before[k]) / options.h;
      const double f = limits[k].stiffness * (m.controls()(static_cast<Eigen::Index>(k)) - length) -
                       limits[k].damping * rate;
      // The lengths know 16 digits, and rates are their difference by h.
      const double digits =
          1e-14 * (1 + std::abs(length)) * (limits[k].stiffness + limits[k].damping / options.h) + 1e-6;
      const bool law = sides[k] > 0   ? f > limits[k].upper - digits
                       : sides[k] < 0 ? f < limits[k].lower + digits
                                      : f < limits[k].upper + digits && f > limits[k].lower - digits;
      EXPECT_TRUE(law) << when << ", servo " << k << ": " << f << " of " << limits[k].upper << ", side "
                       << int(sides[k]);
      ++(sides[k] == 0 ? between : at_bound);
    }
  };
  StepAll(60, 60, options, measure, after);
  EXPECT_GT(at_bound, 1000);
  EXPECT_GT(between, 1000);
}

// What is taken out of a step stands side by side, whatever room servos have between.
TEST(ServoLaw, TheProblemOfAStepHasItsRows) {
  int problems = 0;
  ContactSolver solver;
  const auto after = [&](const World& world, const StepReport& report, const std::string& when) {
    EXPECT_TRUE(report.solver.converged) << when;
    ContactProblem problem = world.LastContactProblem();
    if (problem.contacts.empty()) return;
    ++problems;
    VectorX velocity = problem.velocity;
    EXPECT_TRUE(solver.Solve(problem.Blocks(), problem.contacts, problem.limits, velocity).converged) << when;
    const double size = std::max(1e-3, velocity.norm());
    EXPECT_LT((problem.VelocityUnderImpulses() - velocity).norm(), 1e-7 * size) << when;
  };
  StepAll(
      12, 60, {}, [](const World&) {}, after);
  EXPECT_GT(problems, 300);
}

}  // namespace
}  // namespace fork1s
