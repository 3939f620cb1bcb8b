#include "equilibrium.hpp"
#include "linalg/select.hpp"

#include <algorithm>
#include <fork1s/reduction/frequencies.hpp>
#include <fork1s/reference/full_simulation.hpp>
#include <fork1s/sim/simulation.hpp>
#include <numbers>

namespace fork1s::internal {
namespace {

// s; h²K exceeds M by 1e7 and more for anything faster than a second. Longer steps cost digits in the
// reactions, whose equations are scaled by h too.
constexpr double kLongStep = 1e3;
constexpr double kShare = 1e-10;  // of its mass that a body keeps where only the load is to weigh

Scene HeldScene(const MechanismDef& definition) {
  Scene scene;
  scene.gravity.setZero();
  scene.mechanisms.push_back(definition);
  scene.mechanisms[0].base = BaseKind::kFixed;
  return scene;
}

// Dampers would still show beside the springs: by 2e-5 of them at a time constant of 0.02 s.
Scene UndampedScene(const MechanismDef& definition) {
  Scene scene = HeldScene(definition);
  MechanismDef& m = scene.mechanisms[0];
  for (JointDef& joint : m.joints)
    for (FreedomDef& freedom : joint.freedoms) freedom.damping = 0;
  for (ClosureDef& closure : m.closures) closure.damping.setZero();
  for (SpringDef& spring : m.springs) {
    spring.damping = 0;
    spring.higher_damping = {};
  }
  return scene;
}

Expected<FullSimulation> StartFull(Scene scene) {
  FullSimulationOptions options;
  options.dt = kLongStep;
  options.tolerance = 1e-13;
  return FullSimulation::Create(std::move(scene), options);
}

double LargestMove(const std::vector<RigidTransform>& a, const std::vector<RigidTransform>& b) {
  double largest = 0;
  for (std::size_t i = 0; i < a.size(); ++i)
    largest = std::max({largest, (a[i].translation() - b[i].translation()).norm(),
                        (a[i].rotation() - b[i].rotation()).norm()});
  return largest;
}

template <class Simulator>
std::vector<RigidTransform> PosesOf(const Simulator& simulation) {
  std::vector<RigidTransform> X_WB;
  for (std::size_t b = 0; b < simulation.bodies().size(); ++b)
    X_WB.push_back(simulation.Pose(static_cast<int>(b)));
  return X_WB;
}

}  // namespace

Expected<std::vector<RigidTransform>> RestOfFull(const MechanismDef& definition, const RestLoad& load) {
  // The load is raised in steps, each an equilibrium, so that Newton stays on the branch.
  constexpr int kLoadSteps = 40;
  Scene scene = UndampedScene(definition);
  Vector3 gravity = load.gravity_W;
  if (load.body) {
    // Gravity of one kilogramme at the body's origin is the force; nothing else weighs.
    for (BodyDef& body : scene.mechanisms[0].bodies) {
      body.gravity_compensation = 0;
      body.inertia.mass *= kShare;
      body.inertia.rotational *= kShare;
      if (body.name == *load.body) body.inertia = {1, Vector3::Zero(), body.inertia.rotational};
    }
    gravity = load.force_W;
  }
  // Gravity is the scene's for good, so every load step has a simulation of its own, begun where the last
  // came to rest.
  std::vector<RigidTransform> rest;
  VectorX q;
  for (int i = 1; i <= kLoadSteps; ++i) {
    scene.gravity = gravity * (static_cast<double>(i) / kLoadSteps);
    FullSimulationOptions options;
    options.dt = kLongStep;
    options.tolerance = 1e-13;
    if (q.size() > 0) {
      KeyframeDef key;
      key.mechanisms.emplace_back();
      key.mechanisms[0].q = q;
      key.mechanisms[0].q_dot = VectorX::Zero(q.size());
      key.mechanisms[0].X_WR = definition.X_WR;
      scene.keyframes = {key};
      options.initial_keyframe = 0;
    }
    auto simulation = FullSimulation::Create(scene, options);
    if (!simulation) return tl::unexpected(simulation.error());
    const FullStepReport report = simulation->Step();
    // Rounding of a long chain stays above the tolerance asked for; what counts is that nothing moves any
    // more.
    if (!report.finite || report.residual > 1e-9)
      return Fail(ErrorCode::kNumerics, definition.name, "the full simulator found no equilibrium");
    q = simulation->Displacements(0);
    rest = PosesOf(*simulation);
  }
  return rest;
}

Expected<std::vector<RigidTransform>> RestOfReduced(const MechanismDef& definition, const RestLoad& load) {
  Scene scene = HeldScene(definition);
  scene.gravity = load.gravity_W;
  auto mechanism = BuildMechanism(scene.mechanisms[0]);
  if (!mechanism) return tl::unexpected(mechanism.error());
  const auto hertz = FullFrequencies(*mechanism, VectorX::Zero(mechanism->num_coordinates()), 1);
  if (hertz.empty()) return Fail(ErrorCode::kUnderdetermined, definition.name, "no spring holds it");
  // Dampers of k τ, so that the slowest mode is damped critically and all others decay with exp(-t/τ). They
  // also outweigh, in steps this short, the load's own stiffness, which the reduced step takes from its
  // start.
  const double tau = 1 / (std::numbers::pi * hertz.front());
  constexpr int kStepsPerTau = 50, kRise = 10 * kStepsPerTau, kSteps = 60 * kStepsPerTau;
  for (JointDef& joint : scene.mechanisms[0].joints)
    for (FreedomDef& freedom : joint.freedoms) freedom.damping = tau * freedom.stiffness;
  SimulationOptions options;
  options.step.integrator = Integrator::kEuler;  // what loses most comes to rest first
  options.dt = tau / kStepsPerTau;
  auto simulation = Simulation::Create(std::move(scene), options);
  if (!simulation) return tl::unexpected(simulation.error());
  const int body = load.body ? simulation->FindBody(*load.body) : -1;
  std::vector<RigidTransform> before = PosesOf(*simulation);
  bool rests = false;
  for (int i = 1; i <= kSteps; ++i) {
    // Raised slowly, so that the motion stays on the branch that begins at the unloaded pose.
    const double share = std::min(1.0, static_cast<double>(i) / kRise);
    simulation->step_options().gravity = share * load.gravity_W;
    if (body >= 0)
      simulation->ApplyWrench(body, share * load.force_W, Vector3::Zero(),
                              simulation->Pose(body).translation());
    if (!simulation->Step().finite)
      return Fail(ErrorCode::kNumerics, definition.name, "the reduced simulator left the finite numbers");
    if (i < kRise || i % kStepsPerTau != 0) continue;
    std::vector<RigidTransform> now = PosesOf(*simulation);
    const double moved = LargestMove(before, now);
    before = std::move(now);
    if (moved < 1e-12) return before;
    rests = moved < 1e-8;
  }
  // Loops jitter by what their correction leaves, and so do poses.
  if (rests) return before;
  return Fail(ErrorCode::kNumerics, definition.name, "the reduced simulator did not come to rest");
}

Expected<MatrixX> ComplianceOfFull(const MechanismDef& definition, const MatrixX& scale, double step) {
  const auto& names = definition.interfaces;
  const auto n = static_cast<Eigen::Index>(6 * names.size());
  const Scene scene = UndampedScene(definition);
  MatrixX C(n, n);
  for (Eigen::Index k = 0; k < n; ++k) {
    const double felt = scale.col(k).cwiseAbs().maxCoeff(), largest = scale.cwiseAbs().maxCoeff();
    const double load = step / (felt > 1e-9 * largest ? felt : largest);
    MatrixX poses(n, 2);
    for (int side = 0; side < 2; ++side) {
      auto simulation = StartFull(scene);
      if (!simulation) return tl::unexpected(simulation.error());
      auto place = [&](std::size_t i) { return simulation->FindBody(names[i]); };
      std::vector<RigidTransform> X_ref;
      for (std::size_t i = 0; i < names.size(); ++i) X_ref.push_back(simulation->Pose(place(i)));
      Vector6 wrench = Vector6::Zero();
      wrench(k % 6) = side == 0 ? load : -load;
      const auto loaded = static_cast<std::size_t>(k / 6);
      simulation->ApplyWrench(place(loaded), wrench.tail<3>(), wrench.head<3>(), X_ref[loaded].translation());
      if (!simulation->Step().finite)
        return Fail(ErrorCode::kNumerics, definition.name, "the full simulator found no equilibrium");
      for (std::size_t i = 0; i < names.size(); ++i) {
        const RigidTransform X = simulation->Pose(place(i));
        poses.block<3, 1>(6 * static_cast<Eigen::Index>(i), side) =
            LogRotation(X.rotation() * X_ref[i].rotation().transpose());
        poses.block<3, 1>(6 * static_cast<Eigen::Index>(i) + 3, side) =
            X.translation() - X_ref[i].translation();
      }
    }
    C.col(k) = (poses.col(0) - poses.col(1)) / (2 * load);
  }
  return C;
}

Expected<MatrixX> ComplianceOfReduced(const ReducedModel& model) {
  const auto n = static_cast<Eigen::Index>(6 * model.interfaces.size());
  const Matrix3 R_WR = model.mechanism->definition().X_WR.rotation();
  MatrixX J(n, model.size());
  for (std::size_t i = 0; i < model.interfaces.size(); ++i) {
    // Twist about R's origin in R to velocities of the body's origin in world axes.
    const auto T = model.T_of(model.interfaces[i]);
    const Vector3 p = model.X_RB_ref[model.interfaces[i].u()].translation();
    const auto row = 6 * static_cast<Eigen::Index>(i);
    J.middleRows<3>(row) = R_WR * T.topRows<3>();
    J.middleRows<3>(row + 3) = R_WR * (T.bottomRows<3>() - Skew(p) * T.topRows<3>());
  }
  if (model.num_free > 0 && Columns(J, model.FreeColumns()).cwiseAbs().maxCoeff() > 1e-9)
    return Fail(ErrorCode::kUnderdetermined, model.mechanism->name(),
                "a spring-free motion moves an interface");
  const MatrixX elastic = Columns(J, model.SprungColumns());
  return MatrixX(elastic * elastic.transpose());
}

}  // namespace fork1s::internal
