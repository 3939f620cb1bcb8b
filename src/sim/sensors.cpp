// Values of sensors from poses and velocities of a simulation.
//
// A frame F on body B: p_WF = p_WB + R_WB p_BF, v_F = v_B + ω × (R_WB p_BF). Relative to a frame G, in axes of G:
//     position  R_WGᵀ (p_WF - p_WG)
//     velocity  R_WGᵀ (v_F - v_G - ω_G × (p_WF - p_WG))
#include <fork1s/sim/sensors.hpp>

#include <algorithm>
#include <cmath>

#include "base/near_names.hpp"
#include "ray_bodies.hpp"
#include "sensor_momentum.hpp"

namespace fork1s {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

void Put(const Vector3& v, double* out) { std::copy_n(v.data(), 3, out); }

void Put(const Quaternion& q, double* out) { out[0] = q.w(), out[1] = q.x(), out[2] = q.y(), out[3] = q.z(); }

}  // namespace

Sensors::Sensors(const Simulation& simulation) : Sensors(simulation, simulation.scene().sensors) {}

Sensors::Sensors(const Simulation& simulation, std::vector<SensorDef> definitions)
    : definitions_(std::move(definitions)) {
  const Scene& scene = simulation.scene();
  int next = 0;
  for (std::size_t m = 0; m < scene.mechanisms.size(); ++m) {
    // In the order of Simulation::bodies(): mechanism by mechanism, then free bodies.
    std::vector<int>& places = body_of_.emplace_back();
    for (const BodyDef& body : scene.mechanisms[m].bodies)
      places.push_back(next + simulation.given_mechanism(static_cast<int>(m)).FindBody(body.name).value());
    next += simulation.given_mechanism(static_cast<int>(m)).num_bodies();
  }
  for (std::size_t f = 0; f < scene.free_bodies.size(); ++f) free_body_of_.push_back(next++);
  coordinates_.resize(scene.mechanisms.size());
  int size = 0;
  for (const SensorDef& s : definitions_) {
    first_.push_back(size);
    size += s.size;
    lengths_.push_back(LengthFrom(simulation, s.mechanism, s.terms, s.along));
    auto& of_actuators = actuator_lengths_.emplace_back();
    for (const SensorActuator& a : s.actuators)
      of_actuators.push_back(LengthFrom(simulation, a.mechanism, a.terms, a.along));
    auto& of_springs = spring_lengths_.emplace_back();
    for (const auto& [mechanism, spring] : s.springs)
      of_springs.push_back(LengthFrom(simulation, mechanism, spring.terms, spring.along));
  }
  first_.push_back(size);
  values_.setConstant(size, kNaN);
  const auto casts_ray = [](const SensorDef& s) { return s.kind == SensorKind::kDistance; };
  if (std::any_of(definitions_.begin(), definitions_.end(), casts_ray)) {
    auto rays = RayWorld::Create(internal::RayBodies(scene));
    if (rays) rays_ = std::move(*rays);
    for (SensorDef& s : definitions_)
      if (!rays && casts_ray(s)) s.reason = rays.error().Text();
  }
  Update(simulation);
}

void Sensors::Update(const Simulation& simulation) {
  for (std::size_t m = 0; m < coordinates_.size(); ++m) {
    Coordinates& c = coordinates_[m];
    if (!c.kinematics) continue;
    c.q = simulation.JointCoordinates(static_cast<int>(m));
    c.q_dot = simulation.JointRates(static_cast<int>(m));
    const Mechanism& mechanism = simulation.given_mechanism(static_cast<int>(m));
    ComputeKinematics(mechanism, c.q, *c.kinematics);
    c.rates = c.q_dot;
    for (const Mechanism::Rotation& rotation : mechanism.rotations()) {
      const Vector3 theta_dot = c.q_dot(rotation.coordinates);
      c.rates(rotation.coordinates) = AngularVelocityMap(mechanism, *c.kinematics, rotation) * theta_dot;
    }
  }
  if (rays_) {
    std::vector<RigidTransform> X_WB;
    simulation.Poses(X_WB);
    for (std::size_t b = 0; b < X_WB.size(); ++b) rays_->SetPose(static_cast<int>(b), X_WB[b]);
  }
  for (std::size_t i = 0; i < definitions_.size(); ++i) {
    const SensorDef& s = definitions_[i];
    double* out = values_.data() + first_[i];
    std::fill_n(out, s.size, kNaN);
    Evaluate(simulation, i, out);
    // NaN stays NaN.
    for (int k = 0; k < s.size; ++k) out[k] = std::clamp(out[k], s.clip_lower, s.clip_upper);
  }
}

const SensorDef& Sensors::definition(int sensor) const {
  internal::RequireIndex("sensor", sensor, definitions_.size());
  return definitions_[static_cast<std::size_t>(sensor)];
}

std::span<const double> Sensors::operator[](int sensor) const {
  return {values_.data() + first_[static_cast<std::size_t>(sensor)],
          static_cast<std::size_t>(definition(sensor).size)};
}

std::span<const double> Sensors::operator[](const std::string& name) const {
  for (std::size_t i = 0; i < definitions_.size(); ++i)
    if (definitions_[i].name == name) return (*this)[static_cast<int>(i)];
  std::vector<std::string> names;
  for (const SensorDef& s : definitions_) names.push_back(s.name);
  internal::ThrowMisuse(std::source_location::current(),
                        "there is no sensor '" + name + "'" +
                            (names.empty() ? ": the scene has none" : Suggestion(name, names)));
}

int Sensors::BodyOf(const SensorBody& body) const {
  if (body.is_world()) return -1;
  if (body.mechanism < 0) return free_body_of_[static_cast<std::size_t>(body.free_body)];
  return body_of_[static_cast<std::size_t>(body.mechanism)][body.body.u()];
}

Sensors::Frame Sensors::FrameOf(const Simulation& simulation, const SensorFrame& frame) const {
  Frame f;
  const int body = BodyOf(frame.body);
  if (body < 0) {
    f.X_WF = frame.X_BF;
    return f;
  }
  const RigidTransform X_WB = simulation.Pose(body);
  const Vector6 V = simulation.Velocity(body);
  f.X_WF = X_WB * frame.X_BF;
  f.omega_W = V.head<3>();
  f.velocity_W = V.tail<3>() + f.omega_W.cross(f.X_WF.translation() - X_WB.translation());
  return f;
}

Mechanism::Length Sensors::LengthFrom(const Simulation& simulation, int mechanism,
                                      const std::vector<std::pair<FreedomRef, double>>& terms,
                                      const PathRef& along) {
  Mechanism::Length length;
  if (mechanism < 0) return length;
  const Mechanism& built = simulation.given_mechanism(mechanism);
  const MechanismDef& given = simulation.scene().mechanisms[static_cast<std::size_t>(mechanism)];
  Coordinates& c = coordinates_[static_cast<std::size_t>(mechanism)];
  if (!c.kinematics) c.kinematics.emplace(built);
  for (const auto& [ref, coefficient] : terms) {
    const JointIndex joint = built.definition().FindJoint(given.joints[ref.joint.u()].name);
    length.terms.emplace_back(built.joint(joint).offset + ref.freedom, coefficient);
  }
  length.path = along.path;
  length.gear = along.gear;
  return length;
}

Sensors::Scalar Sensors::LengthOf(const Simulation& simulation, int mechanism,
                                  const Mechanism::Length& length, double at_reference) const {
  Scalar scalar{at_reference, 0};
  if (mechanism < 0) return scalar;
  const Coordinates& c = coordinates_[static_cast<std::size_t>(mechanism)];
  scalar.length += fork1s::LengthOf(simulation.given_mechanism(mechanism), length, *c.kinematics, c.q);
  for (const auto& [i, coefficient] : length.terms) scalar.rate += coefficient * c.rates(i);
  if (length.path < 0) return scalar;
  for (const auto& [i, arm] : c.kinematics->paths[static_cast<std::size_t>(length.path)].arms)
    scalar.rate += length.gear * arm * c.q_dot(i);
  return scalar;
}

Sensors::Scalar Sensors::LengthOf(const Simulation& simulation, std::size_t sensor) const {
  const SensorDef& s = definitions_[sensor];
  return LengthOf(simulation, s.mechanism, lengths_[sensor], s.at_reference);
}

void Sensors::Evaluate(const Simulation& simulation, std::size_t sensor, double* out) {
  const SensorDef& s = definitions_[sensor];
  switch (s.kind) {
    case SensorKind::kTime:
      out[0] = simulation.time();
      return;
    case SensorKind::kKineticEnergy:
      out[0] = simulation.KineticEnergy();
      return;
    case SensorKind::kPotentialEnergy:
      out[0] = PotentialEnergy(simulation, sensor);
      return;
    case SensorKind::kLength:
      out[0] = LengthOf(simulation, sensor).length;
      return;
    case SensorKind::kLengthRate:
      out[0] = LengthOf(simulation, sensor).rate;
      return;
    case SensorKind::kLimitDistance:
    case SensorKind::kLimitRate: {
      const auto [length, rate] = LengthOf(simulation, sensor);
      const bool is_below = length<s.lower, is_above = length> s.upper;
      out[0] = 0;
      if (s.kind == SensorKind::kLimitDistance)
        out[0] = is_below ? length - s.lower : is_above ? s.upper - length : 0;
      else
        out[0] = is_below ? rate : is_above ? -rate : 0;
      return;
    }
    case SensorKind::kBallRotation:
    case SensorKind::kBallAngularVelocity:
      EvaluateBall(simulation, s, out);
      return;
    case SensorKind::kPosition:
    case SensorKind::kRotation:
    case SensorKind::kXAxis:
    case SensorKind::kYAxis:
    case SensorKind::kZAxis:
    case SensorKind::kVelocity:
    case SensorKind::kAngularVelocity:
    case SensorKind::kMagneticField:
      EvaluateFrame(simulation, s, out);
      return;
    case SensorKind::kSubtreeCenter:
    case SensorKind::kSubtreeVelocity:
    case SensorKind::kSubtreeAngularMomentum:
      EvaluateSubtree(simulation, s, out);
      return;
    case SensorKind::kAcceleration:
    case SensorKind::kAngularAcceleration:
      EvaluateAcceleration(simulation, s, out);
      return;
    case SensorKind::kForce:
    case SensorKind::kTorque:
      EvaluateCut(simulation, s, out);
      return;
    case SensorKind::kTouch:
      if (simulation.last_step().exists) out[0] = TouchForce(simulation, s);
      return;
    case SensorKind::kLimitForce:
      if (simulation.last_step().exists) out[0] = LimitForce(simulation, sensor);
      return;
    case SensorKind::kActuatorForce:
      out[0] = ActuatorForce(simulation, s.actuators[0], actuator_lengths_[sensor][0]);
      return;
    case SensorKind::kJointActuatorForce:
      out[0] = JointActuatorForce(simulation, sensor);
      return;
    case SensorKind::kTendonActuatorForce:
      out[0] = TendonActuatorForce(simulation, sensor);
      return;
    case SensorKind::kDistance:
      if (rays_) out[0] = DistanceAlongRay(simulation, s);
      return;
    case SensorKind::kInside:
      out[0] = IsInside(simulation, s) ? 1 : 0;
      return;
    case SensorKind::kUnknown:
      return;
  }
}

void Sensors::EvaluateBall(const Simulation& simulation, const SensorDef& s, double* out) const {
  const Mechanism& mechanism = simulation.given_mechanism(s.mechanism);
  const Coordinates& c = coordinates_[static_cast<std::size_t>(s.mechanism)];
  const std::string& name = simulation.scene()
                                .mechanisms[static_cast<std::size_t>(s.mechanism)]
                                .joints[s.terms[0].first.joint.u()]
                                .name;
  const Mechanism::Joint& joint = mechanism.joint(mechanism.definition().FindJoint(name));
  if (s.kind == SensorKind::kBallRotation) {
    Put(Quaternion(ExpRotation(c.q.segment<3>(joint.offset))), out);
    return;
  }
  Put(Vector3(c.rates.segment<3>(joint.offset)), out);
}

void Sensors::EvaluateFrame(const Simulation& simulation, const SensorDef& s, double* out) const {
  const Frame f = FrameOf(simulation, s.frame), g = FrameOf(simulation, s.reference);
  const Matrix3& R_WF = f.X_WF.rotation();
  const Matrix3 R_GW = g.X_WF.rotation().transpose();
  const Vector3 p_W = f.X_WF.translation() - g.X_WF.translation();
  const Matrix3 to_axes = s.own_axes ? Matrix3(R_WF.transpose()) : R_GW;
  switch (s.kind) {
    case SensorKind::kPosition:
      Put(Vector3(R_GW * p_W), out);
      return;
    case SensorKind::kRotation:
      Put(Quaternion(Matrix3(R_GW * R_WF)), out);
      return;
    case SensorKind::kXAxis:
    case SensorKind::kYAxis:
    case SensorKind::kZAxis:
      Put(Vector3(R_GW * R_WF.col(static_cast<int>(s.kind) - static_cast<int>(SensorKind::kXAxis))), out);
      return;
    case SensorKind::kVelocity:
      Put(Vector3(to_axes * (f.velocity_W - g.velocity_W - g.omega_W.cross(p_W))), out);
      return;
    case SensorKind::kAngularVelocity:
      Put(Vector3(to_axes * (f.omega_W - g.omega_W)), out);
      return;
    default:
      Put(Vector3(R_WF.transpose() * s.field_W), out);
      return;
  }
}

void Sensors::EvaluateSubtree(const Simulation& simulation, const SensorDef& s, double* out) const {
  double mass = 0;
  Vector3 moment = Vector3::Zero(), linear = Vector3::Zero(), about_origin = Vector3::Zero();
  for (const SensorBody& b : s.subtree) {
    const int place = BodyOf(b);
    const internal::Momentum m = internal::MomentumOf(internal::InertiaOf(simulation.scene(), b),
                                                      simulation.Pose(place), simulation.Velocity(place));
    mass += m.mass;
    moment += m.mass * m.center_W;
    linear += m.linear;
    about_origin += m.AboutOrigin();
  }
  const Vector3 center = moment / mass;  // massless: NaN, it has none
  if (s.kind == SensorKind::kSubtreeCenter)
    Put(center, out);
  else if (s.kind == SensorKind::kSubtreeVelocity)
    Put(Vector3(linear / mass), out);
  else
    Put(Vector3(about_origin - center.cross(linear)), out);
}

double Sensors::DistanceAlongRay(const Simulation& simulation, const SensorDef& s) {
  const RigidTransform X_WF = FrameOf(simulation, s.frame).X_WF;
  const int body = BodyOf(s.frame.body);
  // The world comes last (RayBodies).
  const int place = body >= 0 ? body : static_cast<int>(simulation.bodies().size());
  const auto hit = rays_->Cast(X_WF.translation(), X_WF.rotation().col(2),
                               std::numeric_limits<double>::infinity(), place, s.unseen);
  return hit ? hit->distance : -1;
}

// Of weight -m g·c, and of springs k s²/2 + k₂ s³/3 + k₃ s⁴/4 of the stretch s.
double Sensors::PotentialEnergy(const Simulation& simulation, std::size_t sensor) const {
  const SensorDef& s = definitions_[sensor];
  double energy = s.at_reference;
  for (const SensorBody& b : s.subtree) {
    const SpatialInertia& inertia = internal::InertiaOf(simulation.scene(), b);
    const Vector3 center_W = simulation.Pose(BodyOf(b)) * inertia.center;
    energy -= inertia.mass * simulation.step_options().gravity.dot(center_W);
  }
  for (std::size_t k = 0; k < s.springs.size(); ++k) {
    const auto& [mechanism, spring] = s.springs[k];
    const double beyond = LengthOf(simulation, mechanism, spring_lengths_[sensor][k], -spring.rest).length;
    const double stretch = beyond - std::clamp(beyond, 0.0, spring.slack);
    const auto& higher = spring.higher_stiffness;
    energy +=
        stretch * stretch * (spring.stiffness / 2 + stretch * (higher[0] / 3 + stretch * higher[1] / 4));
  }
  return energy;
}

}  // namespace fork1s
