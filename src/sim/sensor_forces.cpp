// Sensors of accelerations and forces, as the mean over the last step.
#include <algorithm>
#include <cmath>
#include <fork1s/sim/sensors.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <variant>

#include "geometry/interval.hpp"
#include "sensor_momentum.hpp"

namespace fork1s {
namespace {

using internal::Momentum;
using internal::MomentumOf;

void PutVector(const Vector3& v, double* out) { std::copy_n(v.data(), 3, out); }

// Place of the body that a shape of a collision body is of; -1: the world.
int BodyOfGeometry(const Simulation& simulation, int collision_body, int geometry) {
  const CollisionBody& c = simulation.world().collision_bodies()[static_cast<std::size_t>(collision_body)];
  if (c.kind != CollisionBody::Kind::kGroup || geometry < 0)
    return simulation.BodyOfCollisionBody(collision_body);
  const MechanismDynamics& m = simulation.world().mechanisms()[static_cast<std::size_t>(c.index)];
  // A group has the colliding shapes of its bodies one after another (GroupGeometry).
  for (const BodyIndex b : m.groups()[static_cast<std::size_t>(c.group)].bodies) {
    const auto& shapes = m.mechanism().definition().bodies[b.u()].geometries;
    geometry -= static_cast<int>(
        std::count_if(shapes.begin(), shapes.end(), [](const GeometryDef& g) { return g.Collides(); }));
    if (geometry < 0) return simulation.BodyOf(c.index, b.value());
  }
  return simulation.BodyOfCollisionBody(collision_body);
}

// Where |p + t d| <= 1.
template <int size>
RayInterval InUnitBall(const Eigen::Matrix<double, size, 1>& p, const Eigen::Matrix<double, size, 1>& d) {
  const double a = d.squaredNorm(), b = p.dot(d), c = p.squaredNorm() - 1, square = b * b - a * c;
  if (a == 0) return c <= 0 ? RayInterval{} : kEmptyRayInterval;
  if (square < 0) return kEmptyRayInterval;
  return {std::max(0.0, (-b - std::sqrt(square)) / a), (-b + std::sqrt(square)) / a};
}

// Whether a ray begins in a shape or comes through it, both in the frame of the shape.
bool RayMeets(const Shape& shape, const Vector3& p, const Vector3& d) {
  using Vector2 = Eigen::Matrix<double, 2, 1>;
  const auto in_cylinder = [&](double radius, double half) {
    return Both(InSlab(p.z(), d.z(), half),
                InUnitBall<2>(Vector2(p.head<2>() / radius), Vector2(d.head<2>() / radius)));
  };
  const auto in_ball = [&](double radius, double z) {
    return InUnitBall<3>(Vector3((p - Vector3(0, 0, z)) / radius), Vector3(d / radius));
  };
  if (const auto* s = std::get_if<Sphere>(&shape)) return !in_ball(s->radius, 0).is_empty();
  if (const auto* s = std::get_if<Capsule>(&shape))
    return !in_cylinder(s->radius, s->half_length).is_empty() ||
           !in_ball(s->radius, s->half_length).is_empty() || !in_ball(s->radius, -s->half_length).is_empty();
  if (const auto* s = std::get_if<Cylinder>(&shape))
    return !in_cylinder(s->radius, s->half_length).is_empty();
  if (const auto* s = std::get_if<Ellipsoid>(&shape))
    return !InUnitBall<3>(Vector3(p.cwiseQuotient(s->radii)), Vector3(d.cwiseQuotient(s->radii))).is_empty();
  if (const auto* s = std::get_if<Box>(&shape)) return !InBox(p, d, s->half).is_empty();
  return false;
}

// Whether a shape has a point in it, both in the frame of the shape.
bool Contains(const Shape& shape, const Vector3& p) {
  if (const auto* s = std::get_if<Sphere>(&shape)) return p.norm() <= s->radius;
  if (const auto* s = std::get_if<Capsule>(&shape))
    return (p - Vector3(0, 0, std::clamp(p.z(), -s->half_length, s->half_length))).norm() <= s->radius;
  if (const auto* s = std::get_if<Cylinder>(&shape))
    return std::abs(p.z()) <= s->half_length && p.head<2>().norm() <= s->radius;
  if (const auto* s = std::get_if<Ellipsoid>(&shape)) return p.cwiseQuotient(s->radii).norm() <= 1;
  if (const auto* s = std::get_if<Box>(&shape)) return (p.cwiseAbs().array() <= s->half.array()).all();
  return false;
}

}  // namespace

bool Sensors::IsInside(const Simulation& simulation, const SensorDef& s) const {
  const RigidTransform X_WF = FrameOf(simulation, s.frame).X_WF, X_WG = FrameOf(simulation, s.reference).X_WF;
  return Contains(s.volume, X_WG.inverse() * X_WF.translation());
}

std::optional<Sensors::FrameInStep> Sensors::FrameInStepOf(const Simulation& simulation,
                                                           const SensorFrame& frame) const {
  if (simulation.last_step().start_motions.empty()) return std::nullopt;
  FrameInStep f;
  f.end = f.start = FrameOf(simulation, frame);
  if (const int body = BodyOf(frame.body); body >= 0) {
    const BodyMotion& motion = simulation.last_step().start_motions[static_cast<std::size_t>(body)];
    f.start.X_WF = motion.X_WB * frame.X_BF;
    f.start.omega_W = motion.V_W.head<3>();
    f.start.velocity_W =
        motion.V_W.tail<3>() + f.start.omega_W.cross(f.start.X_WF.translation() - motion.X_WB.translation());
  }
  const Matrix3& R = f.start.X_WF.rotation();
  const Vector3 turn = LogRotation(Matrix3(R.transpose() * f.end.X_WF.rotation()));
  f.X_WF_middle = RigidTransform(Matrix3(R * ExpRotation(Vector3(turn / 2))),
                                 Vector3((f.start.X_WF.translation() + f.end.X_WF.translation()) / 2));
  return f;
}

// The mean over the step, a = (v₁ - v₀)/h - g, is the value at its middle up to h²; so are the axes of the frame.
void Sensors::EvaluateAcceleration(const Simulation& simulation, const SensorDef& s, double* out) const {
  const auto f = FrameInStepOf(simulation, s.frame);
  if (!f) return;
  Vector3 mean;
  if (s.kind == SensorKind::kAngularAcceleration)
    mean = (f->end.omega_W - f->start.omega_W) / simulation.dt();
  else
    mean = (f->end.velocity_W - f->start.velocity_W) / simulation.dt() - simulation.step_options().gravity;
  PutVector(s.own_axes ? Vector3(f->X_WF_middle.rotation().transpose() * mean) : mean, out);
}

// Balance of the momentum p of the subtree over a step of length h:
//     F = Δp/h - Σ m g - Σ contact impulses/h - Σ loads
// and likewise of the angular momentum about the world's origin, then moved to the frame half way through the step.
void Sensors::EvaluateCut(const Simulation& simulation, const SensorDef& s, double* out) const {
  const auto f = FrameInStepOf(simulation, s.frame);
  if (!f || !simulation.last_step().exists) return;
  const double h = simulation.dt();
  const Scene& scene = simulation.scene();
  std::vector<bool> is_inside(simulation.bodies().size(), false);
  Vector3 force_W = Vector3::Zero(), moment_W = Vector3::Zero();  // about the world's origin
  const auto subtract = [&](const Vector3& force, const Vector3& point, const Vector3& moment) {
    moment_W -= moment + point.cross(force);
    force_W -= force;
  };
  for (const SensorBody& b : s.subtree) {
    const auto place = static_cast<std::size_t>(BodyOf(b));
    is_inside[place] = true;
    const BodyMotion& start = simulation.last_step().start_motions[place];
    const SpatialInertia& inertia = internal::InertiaOf(scene, b);
    const Momentum before = MomentumOf(inertia, start.X_WB, start.V_W);
    const Momentum after = MomentumOf(inertia, simulation.Pose(static_cast<int>(place)),
                                      simulation.Velocity(static_cast<int>(place)));
    force_W += (after.linear - before.linear) / h;
    moment_W += (after.AboutOrigin() - before.AboutOrigin()) / h;
    const Vector3 weight =
        (1 - internal::GravityCompensationOf(scene, b)) * inertia.mass * simulation.step_options().gravity;
    subtract(weight, (before.center_W + after.center_W) / 2, Vector3::Zero());
    subtract(start.load_W.tail<3>(), start.X_WB.translation(), start.load_W.head<3>());
  }
  const auto has = [&](int body) { return body >= 0 && is_inside[static_cast<std::size_t>(body)]; };
  // Its mean force over the step is not known.
  for (const Simulation::BodyPointSpring& spring : simulation.last_step().point_springs)
    if (has(spring.body)) return;
  for (const ContactRecord& c : simulation.world().contacts()) {
    const Matrix3 axes = c.point.frame.transpose();
    const Vector3 force = NetImpulse(c) / h, moment = axes * c.moment / h;
    if (has(BodyOfGeometry(simulation, c.point.body_b, c.point.geometry_b)))
      subtract(force, c.point.point, moment);
    if (has(BodyOfGeometry(simulation, c.point.body_a, c.point.geometry_a)))
      subtract(-force, c.point.point, -moment);
  }
  std::size_t closure = 0;
  for (const MechanismDef& m : simulation.present_scene().mechanisms)
    for (const SwitchedClosureDef& def : m.switched_closures) {
      const SwitchedClosureRecord& record = simulation.world().switched_closures()[closure++];
      const Vector3 force = record.impulse_W / h, moment = record.moment_W / h;
      if (has(simulation.FindBody(def.body_b))) subtract(force, record.point_W, moment);
      if (has(simulation.FindBody(def.body_a))) subtract(-force, record.point_W, -moment);
    }
  for (const FrozenContactForce& hold : simulation.FrozenContactForces()) {
    if (has(hold.held)) subtract(hold.force_W, hold.point_W, Vector3::Zero());
    if (has(hold.body)) subtract(-hold.force_W, hold.point_W, Vector3::Zero());
  }
  const RigidTransform& X_WF = f->X_WF_middle;
  const Vector3 about_frame = moment_W - X_WF.translation().cross(force_W);
  PutVector(Vector3(X_WF.rotation().transpose() * (s.kind == SensorKind::kForce ? force_W : about_frame)),
            out);
}

// As MuJoCo has it: contacts of the body whose point, or whose ray outwards along the normal, is in the volume.
double Sensors::TouchForce(const Simulation& simulation, const SensorDef& s) const {
  const int body = BodyOf(s.frame.body);
  const RigidTransform X_FW = FrameOf(simulation, s.frame).X_WF.inverse();
  double sum = 0;
  const auto add = [&](const Vector3& point_W, const Vector3& outwards_W, double force) {
    if (RayMeets(s.volume, X_FW * point_W, Vector3(X_FW.rotation() * outwards_W))) sum += force;
  };
  for (const ContactRecord& c : simulation.world().contacts()) {
    const Vector3 normal = c.point.frame.row(0).transpose();
    const double force = c.impulse.x() / simulation.dt();
    if (!(force > 0)) continue;
    if (BodyOfGeometry(simulation, c.point.body_a, c.point.geometry_a) == body)
      add(c.point.point, normal, force);
    else if (BodyOfGeometry(simulation, c.point.body_b, c.point.geometry_b) == body)
      add(c.point.point, -normal, force);
  }
  for (const FrozenContactForce& hold : simulation.FrozenContactForces()) {
    const double force = hold.force_W.dot(hold.normal_W);
    if (hold.body == body)
      add(hold.point_W, hold.normal_W, force);
    else if (hold.held == body)
      add(hold.point_W, -hold.normal_W, force);
  }
  return sum;
}

double Sensors::LimitForce(const Simulation& simulation, std::size_t sensor) const {
  const SensorDef& s = definitions_[sensor];
  if (s.mechanism < 0) return 0;  // the length does not change
  const MechanismPlace& place = simulation.place(s.mechanism);
  const MechanismDynamics& m = simulation.world().mechanisms()[static_cast<std::size_t>(place.mechanism)];
  const auto& limits = m.length_limits();
  const std::vector<double>& impulses = simulation.world().StopImpulses(place.mechanism);
  // Those of coordinates come first, then those of other lengths, which may have the same names.
  const std::size_t num_of_coordinates = limits.size() - m.mechanism().definition().length_limits.size();
  const bool is_of_joint = s.limit.empty();
  for (std::size_t k = is_of_joint ? 0 : num_of_coordinates;
       2 * k + 1 < impulses.size() && k < (is_of_joint ? num_of_coordinates : limits.size()); ++k) {
    const bool is_it = is_of_joint ? limits[k].length.terms[0].first ==
                                         place.first_coordinate + lengths_[sensor].terms[0].first
                                   : limits[k].name == s.limit;
    if (is_it) return (impulses[2 * k] + impulses[2 * k + 1]) / simulation.dt();
  }
  return 0;
}

double Sensors::ActuatorForce(const Simulation& simulation, const SensorActuator& actuator,
                              const Mechanism::Length& length) const {
  const auto [at, rate] = LengthOf(simulation, actuator.mechanism, length, actuator.at_reference);
  double force = actuator.bias - actuator.stiffness * at - actuator.damping * rate;
  Eigen::Index first = 0;  // control of the mechanism
  for (int m = 0; m < actuator.mechanism; ++m)
    first += static_cast<Eigen::Index>(simulation.given_mechanism(m).controls().size());
  const auto& controls = simulation.given_mechanism(actuator.mechanism).controls();
  const MechanismPlace& place = simulation.place(actuator.mechanism);
  const MechanismDynamics& dynamics =
      simulation.world().mechanisms()[static_cast<std::size_t>(place.mechanism)];
  const Mechanism& given = simulation.given_mechanism(actuator.mechanism);
  for (std::size_t k = 0; k < given.muscles().size() && !actuator.muscle.empty(); ++k) {
    const Mechanism::Muscle& muscle = given.muscles()[k];
    if (muscle.name != actuator.muscle) continue;
    const double counted = at - actuator.at_reference,  // passive and active part
        a = dynamics.ActivationOf(place.first_control + muscle.control);
    force += given.PassivePart(k).Force(counted) + a * muscle.Force(counted, rate);
  }
  for (const auto& [name, gain] : actuator.inputs)
    for (std::size_t k = 0; k < controls.size(); ++k) {
      if (controls[k].name != name) continue;
      const auto i = static_cast<Eigen::Index>(k);
      force += gain * (dynamics.HasDynamics(place.first_control + i)
                           ? dynamics.activation()(place.first_control + i)
                           : simulation.start_controls()(first + i));
    }
  return std::clamp(force, actuator.lower, actuator.upper);
}

double Sensors::JointActuatorForce(const Simulation& simulation, std::size_t sensor) const {
  const SensorDef& s = definitions_[sensor];
  const auto& kinematics = coordinates_[static_cast<std::size_t>(s.mechanism)].kinematics;
  double sum = 0;
  for (std::size_t k = 0; k < s.actuators.size(); ++k) {
    double arm = 0;
    ForEachArm(actuator_lengths_[sensor][k], kinematics->paths,
               [&](int i, double a) { arm += i == lengths_[sensor].terms[0].first ? a : 0; });
    sum += arm * ActuatorForce(simulation, s.actuators[k], actuator_lengths_[sensor][k]);
  }
  return std::clamp(sum, s.lower, s.upper);
}

double Sensors::TendonActuatorForce(const Simulation& simulation, std::size_t sensor) const {
  const SensorDef& s = definitions_[sensor];
  double sum = 0;
  for (std::size_t k = 0; k < s.actuators.size(); ++k)
    sum += ActuatorForce(simulation, s.actuators[k], actuator_lengths_[sensor][k]);
  return std::clamp(sum, s.lower, s.upper);
}

}  // namespace fork1s
