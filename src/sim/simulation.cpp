#include <fork1s/sim/simulation.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>

#include <algorithm>
#include <cmath>
#include <fork1s/recovery/recover.hpp>
#include <fork1s/sim/queries.hpp>

#include "join.hpp"
#include "sensor_needs.hpp"

namespace fork1s {
Expected<Simulation> Simulation::Create(Scene scene, const SimulationOptions& options) {
  FORK1S_REQUIRE(options.dt >= 0 && std::isfinite(options.dt), "a time step of", options.dt,
                 "s; give seconds above 0, or 0 for the time step of the scene");
  FORK1S_REQUIRE(options.refresh_angle >= 0, "a refresh_angle of", options.refresh_angle,
                 "rad; give an angle of 0 or more");
  FORK1S_REQUIRE(options.reduction.rank_tolerance >= 0 && options.reduction.rank_tolerance < 1,
                 "a rank_tolerance of", options.reduction.rank_tolerance, "; give a share from 0 to below 1");
  FORK1S_REQUIRE(options.initial_keyframe < static_cast<int>(scene.keyframes.size()), "initial_keyframe",
                 options.initial_keyframe, "of a scene with", scene.keyframes.size(),
                 "keyframes; give an index, or -1");
  FORK1S_REQUIRE(options.reserved_contacts >= 0, "reserved_contacts of", options.reserved_contacts,
                 "; give a number of 0 or more");
  FORK1S_REQUIRE(options.collision.margin >= 0 && std::isfinite(options.collision.margin), "a margin of",
                 options.collision.margin, "m; give a length of 0 or more");
  Simulation s;
  s.options_ = options;
  s.dt_ = options.dt > 0 ? options.dt : scene.timestep;
  if (!(s.dt_ > 0) || !std::isfinite(s.dt_))
    return Fail(ErrorCode::kModel, "scene '" + scene.name + "'", "needs a time step above 0 s");
  s.options_.step.h = s.dt_;
  s.options_.step.gravity = scene.gravity;

  if (options.detail == DetailLevel::kObject)
    return Fail(
        ErrorCode::kUsage, "detail 'object'",
        "needs contacts that hold a body, and there are none before the first step; switch to it later");
  s.fidelity_ = {options.detail, options.reduction.modes, options.recovery};
  World::Options o = s.WorldOptions(s.fidelity_);
  o.initial_keyframe = options.initial_keyframe;
  s.world_keyframe_ = o.initial_keyframe;
  s.present_scene_ = std::make_shared<const Scene>(RefineInterfaces(scene, options.detail));
  auto world = World::Create(*s.present_scene_, o);
  if (!world) return tl::unexpected(world.error());
  s.world_ = std::move(*world);
  s.scene_ = std::move(scene);
  for (const MechanismDynamics& m : s.world_.mechanisms()) s.given_.push_back(m.model().mechanism);
  s.places_ = *internal::PlacesOf(s.given_, {});

  std::vector<double> values, lower, upper;
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (const MechanismDynamics& m : s.world_.mechanisms())
    for (std::size_t k = 0; k < m.mechanism().controls().size(); ++k) {
      const auto& control = m.mechanism().controls()[k];
      s.control_names_.push_back(control.name);
      values.push_back(m.controls()(static_cast<Eigen::Index>(k)));
      lower.push_back(control.lower);
      upper.push_back(control.upper);
    }
  for (const MechanismDynamics& m : s.world_.mechanisms()) {
    s.base_start_.push_back(m.state().X_WR);
    if (m.mechanism().base() != BaseKind::kDriven) continue;
    for (const char* axis : {".x", ".y", ".z", ".rx", ".ry", ".rz"}) {
      s.control_names_.push_back(m.mechanism().body(BodyIndex(0)).name + axis);
      values.push_back(0);
      lower.push_back(-kInfinity);
      upper.push_back(kInfinity);
    }
  }
  auto to_vector = [](const std::vector<double>& v) {
    return VectorX(Eigen::Map<const VectorX>(v.data(), static_cast<Eigen::Index>(v.size())));
  };
  s.controls_ = s.last_controls_ = to_vector(values);
  const auto driven = std::count_if(s.given_.begin(), s.given_.end(),
                                    [](const auto& m) { return m->base() == BaseKind::kDriven; });
  s.base_rates_ = s.last_step_.base_rates =
      VectorX::Constant(6 * driven, std::numeric_limits<double>::quiet_NaN());
  s.control_lower_ = to_vector(lower);
  s.control_upper_ = to_vector(upper);

  s.ListBodies();
  s.records_start_motions_ =
      std::any_of(s.scene_.sensors.begin(), s.scene_.sensors.end(), internal::NeedsStartMotions);
  s.PassControls(false);
  return s;
}

StepReport Simulation::Step(bool controls_move) {
  FORK1S_REQUIRE(options_.step.h == dt_, "step_options() with h of", options_.step.h, "s beside dt() of", dt_,
                 "s, which stays; make a simulation of another dt");
  FORK1S_REQUIRE(options_.step.gravity.allFinite(), "step_options() with the gravity",
                 options_.step.gravity.transpose(), "m/s²; give finite numbers");
  FORK1S_REQUIRE(options_.step.newton_tolerance > 0, "step_options() with newton_tolerance",
                 options_.step.newton_tolerance, "; give a number above 0");
  PassControls(controls_move);
  CollectPointSprings();
  // FrozenContactForces asks for them after the step, which forgets them.
  last_step_.wrenches_W.clear();
  if (!frozen_grasps_.empty())
    for (const MechanismDynamics& m : world_.mechanisms())
      m.ComputeLoadWrenches_W(last_step_.wrenches_W.emplace_back());
  RecordStartMotions();
  const StepReport report = world_.Step(options_.step);
  last_step_.controls_moved = controls_move;
  last_step_.base_rates = base_rates_;
  base_rates_.setConstant(std::numeric_limits<double>::quiet_NaN());
  if (report.finite) {  // else the state is that before the step
    last_controls_ = controls_;
    last_step_.exists = true;
    ++steps_;
  } else {
    last_step_.start_motions.clear();
  }
  return report;
}

void Simulation::RecordStartMotions() {
  if (!records_start_motions_) return;
  last_step_.start_motions.resize(bodies_.size());
  for (std::size_t i = 0; i < bodies_.size(); ++i) {
    BodyMotion& motion = last_step_.start_motions[i];
    motion = {Pose(static_cast<int>(i)), Velocity(static_cast<int>(i)), Vector6::Zero()};
    const SceneBody& b = bodies_[i];
    if (b.mechanism < 0) {
      const FreeBody& body = world_.free_bodies()[static_cast<std::size_t>(b.index)];
      const Vector3 arm = body.center_W() - motion.X_WB.translation(), force = body.load().force_W;
      motion.load_W << body.load().MomentAt(motion.X_WB.rotation()) + arm.cross(force), force;
      continue;
    }
    const AppliedForces& load =
        world_.mechanisms()[static_cast<std::size_t>(b.mechanism)].loads()[static_cast<std::size_t>(b.index)];
    motion.load_W << load.MomentAt(motion.X_WB.rotation()), load.force_W;
  }
}

void Simulation::PassControls(bool controls_move) {
  Eigen::Index next = 0;
  for (std::size_t i = 0; i < given_.size(); ++i) {
    const auto count = static_cast<Eigen::Index>(given_[i]->controls().size());
    MechanismDynamics& m = world_.mechanisms()[static_cast<std::size_t>(places_[i].mechanism)];
    m.controls().segment(places_[i].first_control, count) = controls_.segment(next, count);
    m.StartControlsFrom(places_[i].first_control, last_controls_.segment(next, count));
    next += count;
  }
  if (controls_move && last_controls_.head(next) != controls_.head(next))
    for (const auto& place : places_)
      world_.mechanisms()[static_cast<std::size_t>(place.mechanism)].MoveControls();
  for (std::size_t i = 0; i < given_.size(); ++i) {
    if (given_[i]->base() != BaseKind::kDriven) continue;
    const Vector3 shift = controls_.segment<3>(next), turn = controls_.segment<3>(next + 3);
    const RigidTransform X_WR(Matrix3(ExpRotation(turn) * base_start_[i].rotation()),
                              Vector3(base_start_[i].translation() + shift));
    const auto rate = BaseRateOf(controls_.segment<6>(next), last_controls_.segment<6>(next),
                                 base_rates_.segment<6>(next - (controls_.size() - base_rates_.size())));
    next += 6;
    MechanismDynamics& m = world_.mechanisms()[static_cast<std::size_t>(places_[i].mechanism)];
    if (rate)
      m.DriveBase(X_WR, *rate);
    else
      m.DriveBase(X_WR);
  }
}

bool Simulation::DrivesBase(int index) const {
  internal::RequireIndex("control", index, controls_.size());
  return index >= static_cast<int>(control_names_.size()) - num_base_coordinates();
}

int Simulation::FindControl(const std::string& name) const {
  const auto at = std::find(control_names_.begin(), control_names_.end(), name);
  return at == control_names_.end() ? -1 : static_cast<int>(at - control_names_.begin());
}

void Simulation::SetControl(int index, double value) {
  internal::RequireIndex("control", index, controls_.size());
  FORK1S_REQUIRE(std::isfinite(value), "control '" + control_names_[static_cast<std::size_t>(index)] + "' to",
                 value, "; give a finite number");
  controls_(index) = std::clamp(value, control_lower_(index), control_upper_(index));
  if (DrivesBase(index))
    base_rates_(index - controls_.size() + base_rates_.size()) = std::numeric_limits<double>::quiet_NaN();
}

void Simulation::SetBaseRate(int index, double rate) {
  internal::RequireIndex("control", index, controls_.size());
  const std::string& name = control_names_[static_cast<std::size_t>(index)];
  FORK1S_REQUIRE(DrivesBase(index),
                 "control '" + name + "' is no coordinate of a driven base, which alone have rates");
  FORK1S_REQUIRE(std::isfinite(rate), "the rate of '" + name + "' to", rate, "; give a finite number");
  base_rates_(index - controls_.size() + base_rates_.size()) = rate;
}

void Simulation::SetControl(const std::string& name, double value) {
  const Expected<int> control = ControlNamed(*this, name);
  if (!control) internal::ThrowMisuse(std::source_location::current(), control.error().message);
  SetControl(*control, value);
}

void Simulation::SetControls(const VectorX& values) {
  FORK1S_REQUIRE(values.size() == controls_.size(), values.size(), "values for", controls_.size(),
                 "controls; give one for each of control_names()");
  for (int i = 0; i < values.size(); ++i)
    FORK1S_REQUIRE(std::isfinite(values(i)),
                   "control '" + control_names_[static_cast<std::size_t>(i)] + "' to", values(i),
                   "; give a finite number");
  for (int i = 0; i < values.size(); ++i) SetControl(i, values(i));
}

void Simulation::StartFromControls() {
  FORK1S_REQUIRE(steps_ == 0, "after", steps_, "steps; call it before the first");
  const Eigen::Index count = controls_.size() - base_rates_.size();
  last_controls_.head(count) = controls_.head(count);
  base_rates_.setConstant(std::numeric_limits<double>::quiet_NaN());
}

int Simulation::FindBody(const std::string& name) const {
  for (std::size_t i = 0; i < bodies_.size(); ++i)
    if (bodies_[i].name == name) return static_cast<int>(i);
  return -1;
}

RigidTransform Simulation::Pose(int body) const {
  internal::RequireIndex("body", body, bodies_.size());
  const SceneBody& b = bodies_[static_cast<std::size_t>(body)];
  if (b.mechanism < 0) return world_.free_bodies()[static_cast<std::size_t>(b.index)].pose();
  return world_.mechanisms()[static_cast<std::size_t>(b.mechanism)].BodyPose(BodyIndex(b.index));
}

RigidTransform Simulation::Pose(const std::string& body) const {
  const Expected<int> index = BodyNamed(*this, body);
  if (!index) internal::ThrowMisuse(std::source_location::current(), index.error().message);
  return Pose(*index);
}

void Simulation::Poses(std::vector<RigidTransform>& X_WB) const {
  X_WB.clear();
  std::vector<RigidTransform> X_RB;
  int of = -1;  // whose poses those are
  for (const SceneBody& b : bodies_) {
    if (b.mechanism < 0) {
      X_WB.push_back(world_.free_bodies()[static_cast<std::size_t>(b.index)].pose());
      continue;
    }
    const MechanismDynamics& m = world_.mechanisms()[static_cast<std::size_t>(b.mechanism)];
    if (b.mechanism != of) m.BodyPoses(X_RB);
    of = b.mechanism;
    X_WB.push_back(m.state().X_WR * X_RB[static_cast<std::size_t>(b.index)]);
  }
}

Vector6 Simulation::Velocity(int body) const {
  internal::RequireIndex("body", body, bodies_.size());
  const SceneBody& b = bodies_[static_cast<std::size_t>(body)];
  Vector6 V;
  if (b.mechanism < 0) {
    const FreeBody& f = world_.free_bodies()[static_cast<std::size_t>(b.index)];
    V << f.omega_W(), f.velocity_of_center() - f.omega_W().cross(f.center_W() - f.pose().translation());
    return V;
  }
  const MechanismDynamics& m = world_.mechanisms()[static_cast<std::size_t>(b.mechanism)];
  return m.BodyVelocity(BodyIndex(b.index));
}

void Simulation::ApplyWrench(int body, const Vector3& force_W, const Vector3& moment_W,
                             const Vector3& point_W) {
  internal::RequireIndex("body", body, bodies_.size());
  FORK1S_REQUIRE(force_W.allFinite() && moment_W.allFinite() && point_W.allFinite(),
                 "on '" + bodies_[static_cast<std::size_t>(body)].name + "' the force", force_W.transpose(),
                 "N and the moment", moment_W.transpose(), "N m at", point_W.transpose(),
                 "m; give finite numbers");
  const SceneBody& b = bodies_[static_cast<std::size_t>(body)];
  if (b.mechanism < 0)
    world_.free_bodies()[static_cast<std::size_t>(b.index)].AddWrench(force_W, moment_W, point_W);
  else
    world_.mechanisms()[static_cast<std::size_t>(b.mechanism)].AddWrench(BodyIndex(b.index), force_W,
                                                                         moment_W, point_W);
}

void Simulation::SetPointSpring(int body, const PointSpring& spring) {
  internal::RequireIndex("body", body, bodies_.size());
  FORK1S_REQUIRE(
      spring.point_B.allFinite() && spring.target_start_W.allFinite() && spring.target_W.allFinite(),
      "a point or target that is not finite; give finite lengths");
  FORK1S_REQUIRE(spring.stiffness >= 0 && std::isfinite(spring.stiffness), "a stiffness of", spring.stiffness,
                 "N/m; give 0 or more");
  FORK1S_REQUIRE(spring.damping >= 0 && std::isfinite(spring.damping), "a damping of", spring.damping,
                 "N s/m; give 0 or more");
  const SceneBody& b = bodies_[static_cast<std::size_t>(body)];
  if (b.mechanism < 0)
    world_.free_bodies()[static_cast<std::size_t>(b.index)].SetPointSpring(spring);
  else
    world_.mechanisms()[static_cast<std::size_t>(b.mechanism)].SetPointSpring(BodyIndex(b.index), spring);
}

void Simulation::ClearPointSprings() {
  for (MechanismDynamics& m : world_.mechanisms()) m.ClearPointSpring();
  for (FreeBody& b : world_.free_bodies()) b.ClearPointSpring();
}

void Simulation::CollectPointSprings() {
  last_step_.point_springs.clear();
  for (std::size_t i = 0; i < world_.free_bodies().size(); ++i)
    if (const PointSpring& spring = world_.free_bodies()[i].point_spring(); spring.IsActive())
      last_step_.point_springs.push_back({BodyOf(-1, static_cast<int>(i)), spring});
  for (std::size_t i = 0; i < world_.mechanisms().size(); ++i) {
    const MechanismDynamics& m = world_.mechanisms()[i];
    if (m.point_spring().IsActive())
      last_step_.point_springs.push_back(
          {BodyOf(static_cast<int>(i), m.point_spring_body().value()), m.point_spring()});
  }
}

double Simulation::JointGap() const {
  double largest = ClosureGap();
  std::vector<RigidTransform> X_RB;
  for (const MechanismDynamics& m : world_.mechanisms()) {
    m.BodyPoses(X_RB);
    if (const auto gaps = MeasureJointGaps(m.mechanism(), X_RB); !gaps.empty())
      largest = std::max(largest, gaps.front().gap);
  }
  return largest;
}

double Simulation::ClosureGap() const {
  double gap = 0;
  for (const MechanismDynamics& m : world_.mechanisms()) gap = std::max(gap, m.ClosureGapNow());
  return gap;
}

}  // namespace fork1s
