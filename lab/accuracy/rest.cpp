// Where simulations come to rest by default options, beside the equilibrium of all joints.
#include <algorithm>
#include <cmath>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <lab/accuracy.hpp>
#include <numbers>

#include <fmt/format.h>

#include "equilibrium.hpp"

namespace fork1s {
namespace {

// World axes; oblique, so that every joint takes part.
const Vector3 kWeight = Vector3(0.3, -0.5, -1).normalized(), kPull = Vector3(0.4, -1, 0.6).normalized();

// Of the unit load, per control.
VectorX SetPoints(const RestCase& c) {
  const Mechanism& m = *c.mechanism;
  VectorX u = VectorX::Zero(static_cast<Eigen::Index>(m.controls().size()));
  const std::vector<BodyIndex> interfaces = [&] {
    std::vector<BodyIndex> bodies;
    for (const std::string& name : m.definition().interfaces) bodies.push_back(m.FindBody(name));
    return bodies;
  }();
  int inside = 0;
  for (Eigen::Index i = 0; i < u.size(); ++i) {
    const ControlDef& control = m.definition().controls[static_cast<std::size_t>(i)];
    const bool interior = std::any_of(control.terms.begin(), control.terms.end(), [&](const auto& term) {
      const BodyIndex body = m.definition().joints[term.first.joint.u()].body;
      return std::find(interfaces.begin(), interfaces.end(), body) == interfaces.end();
    });
    // Every third one; each that moves has a load column.
    if (control.is_setpoint && interior && inside++ % 3 == 0) u(i) = inside % 2 == 1 ? 1 : -1;
  }
  return u;
}

// A load of unit size, and the point of the body on which its force acts.
struct UnitLoad {
  Vector3 gravity_W = Vector3::Zero();
  VectorX controls;
  BodyIndex body;  // invalid: no force
  Vector3 force_W = Vector3::Zero(), point_B = Vector3::Zero();
};

UnitLoad MakeUnitLoad(const RestCase& c, DeflectionLoad load) {
  UnitLoad unit;
  unit.controls = VectorX::Zero(static_cast<Eigen::Index>(c.mechanism->controls().size()));
  switch (load) {
    case DeflectionLoad::kWeight:
      unit.gravity_W = kWeight;
      break;
    case DeflectionLoad::kInterfacePull:
    case DeflectionLoad::kInteriorPull:
      unit.body = load == DeflectionLoad::kInterfacePull ? c.interface : c.interior;
      unit.force_W = kPull;
      unit.point_B = c.mechanism->body(unit.body).inertia_B.center;
      break;
    case DeflectionLoad::kSetPoints:
      unit.controls = SetPoints(c);
      break;
  }
  return unit;
}

// Centres of mass in the frame of the base.
std::vector<Vector3> CentersOf(const Mechanism& m, const VectorX& q) {
  Kinematics kinematics(m);
  ComputeKinematics(m, q, kinematics);
  std::vector<Vector3> centers;
  for (int b = 0; b < m.num_bodies(); ++b)
    centers.push_back(kinematics.X_RB[static_cast<std::size_t>(b)] * m.body(BodyIndex(b)).inertia_B.center);
  return centers;
}

// Diagonal of the box around them [m].
double SizeOf(const std::vector<Vector3>& centers) {
  Vector3 low = centers[0], high = centers[0];
  for (const Vector3& p : centers) {
    low = low.cwiseMin(p);
    high = high.cwiseMax(p);
  }
  return (high - low).norm();
}

// The state of rest by default options under `size` times the load, from the unloaded reference on.
Expected<RestCurve::Point> ComeToRest(const RestCase& c, const UnitLoad& unit, double size, VectorX& q) {
  constexpr double kStep = 1.0 / 60, kLongest = 20;  // s
  constexpr int kLoading = 90;
  Scene scene;
  scene.mechanisms = {c.mechanism->definition()};
  scene.gravity = unit.gravity_W;  // its direction is what load columns are made for
  World::Options options;
  options.reduction.step = kStep;
  auto world = World::Create(scene, options);
  if (!world) return tl::unexpected(world.error());
  MechanismDynamics& m = world->mechanisms()[0];
  const VectorX controls = m.controls();
  RestCurve::Point point;
  StepOptions step;
  step.integrator = Integrator::kEuler;
  step.h = kStep;
  for (int i = 1; step.h < kLongest; ++i) {
    const double now = size * std::min(1.0, static_cast<double>(i) / kLoading);
    step.gravity = now * unit.gravity_W;
    m.controls() = controls + now * unit.controls;
    m.MoveControls();
    if (unit.body.valid())
      m.AddWrench(unit.body, now * unit.force_W, Vector3::Zero(), m.BodyPose(unit.body) * unit.point_B);
    const StepReport report = world->Step(step);
    point.refreshes += report.refreshes;
    if (i > 2 * kLoading) step.h *= 1.04;
  }
  q = m.configuration().q;
  point.size = m.model().size();
  point.load = size;
  point.speed = VectorX(m.configuration().Q_now * m.state().w).cwiseAbs().maxCoeff();
  return point;
}

}  // namespace

const char* Name(DeflectionLoad load) {
  switch (load) {
    case DeflectionLoad::kWeight:
      return "weight";
    case DeflectionLoad::kInterfacePull:
      return "pull on an interface body";
    case DeflectionLoad::kInteriorPull:
      return "pull inside";
    case DeflectionLoad::kSetPoints:
      return "set-points inside";
  }
  return "";
}

Expected<RestCurve> MeasureRest(const RestCase& c, DeflectionLoad load,
                                const std::vector<double>& angles_deg) {
  const Mechanism& m = *c.mechanism;
  const UnitLoad unit = MakeUnitLoad(c, load);
  RestCurve curve{c.name, load, 0, {}, {}};
  if (load == DeflectionLoad::kSetPoints && unit.controls.isZero(0)) {
    curve.end = "it has no servo inside";
    return curve;
  }
  const Matrix3 R_RW = m.definition().X_WR.rotation().transpose();
  VectorX start = VectorX::Zero(m.num_coordinates());
  CloseLoops(m, start);
  ReductionOptions all;
  all.modes = m.num_coordinates();
  auto unreduced = Reduce(c.mechanism, start, all);
  if (!unreduced) return tl::unexpected(unreduced.error());
  curve.coordinates = unreduced->size();
  VectorX initial(unit.controls.size());
  for (Eigen::Index i = 0; i < initial.size(); ++i)
    initial(i) = m.definition().controls[static_cast<std::size_t>(i)].initial;
  const auto solve = [&](double size) {
    StaticsOptions options;
    options.gravity_R = R_RW * (size * unit.gravity_W);
    options.controls = initial + size * unit.controls;
    std::vector<DeadLoad> loads;
    if (unit.body.valid())
      loads.push_back({unit.body, R_RW * (size * unit.force_W), Vector3::Zero(), unit.point_B});
    return internal::SolveFull(m, start, loads, options);
  };
  // A load that bends it a little, by powers of ten.
  double size = 1e-3;
  for (int i = 0; i < 9 && !(solve(size).angle_deg > 0.5); ++i) size *= 10;
  const std::vector<Vector3> before = CentersOf(m, start);
  for (const double angle : angles_deg) {
    internal::FullEquilibrium full;
    if (!internal::RaiseToAngle(solve, angle, size, full)) {
      curve.end = fmt::format("no load bends it stably by {:g} degrees", angle);
      break;
    }
    VectorX q;
    auto point = ComeToRest(c, unit, size, q);
    if (!point) return tl::unexpected(point.error());
    const std::vector<Vector3> exact = CentersOf(m, full.result.q), rest = CentersOf(m, q);
    double moved = 0, error = 0, inside = 0;
    for (std::size_t b = 0; b < exact.size(); ++b) {
      const auto& names = m.definition().interfaces;
      const double off = (rest[b] - exact[b]).norm();
      inside = std::max(inside, off);
      if (std::find(names.begin(), names.end(), m.definition().bodies[b].name) == names.end()) continue;
      error = std::max(error, off);
      moved = std::max(moved, (exact[b] - before[b]).norm());
    }
    point->angle_deg = full.angle_deg;
    point->interface_percent = 100 * error / moved;
    point->inside = inside / SizeOf(exact);
    curve.points.push_back(*point);
  }
  return curve;
}

}  // namespace fork1s
