#include <fork1s/dynamics/mechanism_dynamics.hpp>
#include <fork1s/sim/simulation.hpp>

#include <algorithm>
#include <cmath>
#include <fork1s/recovery/recover.hpp>

#include "integrator_fits.hpp"
#include "join.hpp"

namespace fork1s {
namespace {

// A name comes from a user as often as from a program: the answer is in those words.
[[noreturn]] void ThrowUnknown(const char* what, const std::string& name,
                               const std::vector<std::string>& known) {
  constexpr std::size_t kMost = 40;
  std::string list;
  for (std::size_t i = 0; i < known.size() && i < kMost; ++i) list += (i == 0 ? "'" : ", '") + known[i] + "'";
  if (known.size() > kMost) list += ", ...";
  throw std::invalid_argument("there is no " + std::string(what) + " '" + name + "'; there " +
                              (known.empty() ? "are none" : "are " + list));
}

}  // namespace

Expected<Simulation> Simulation::Create(Scene scene, const SimulationOptions& options) {
  Simulation s;
  s.options_ = options;
  s.dt_ = options.dt > 0 ? options.dt : scene.timestep;
  if (!(s.dt_ > 0) || !std::isfinite(s.dt_))
    return Fail(ErrorCode::kModel, "scene '" + scene.name + "'", "needs a time step above 0 s");
  s.step_options_ = options.step;
  s.step_options_.h = s.dt_;
  s.step_options_.gravity = scene.gravity;

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
  s.step_options_.integrator = internal::IntegratorBy(options.recovery, s.options_.step.integrator);
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
  s.base_rates_ = s.last_base_rates_ = VectorX::Constant(6 * driven, std::numeric_limits<double>::quiet_NaN());
  s.control_lower_ = to_vector(lower);
  s.control_upper_ = to_vector(upper);

  s.ListBodies();
  s.PassControls(false);
  return s;
}

StepReport Simulation::Step(bool controls_move) {
  PassControls(controls_move);
  CollectPointSprings();
  // HoldForces asks for them after the step, which forgets them.
  pushed_W_.clear();
  if (!holds_.empty())
    for (const MechanismDynamics& m : world_.mechanisms()) m.ComputeLoadWrenches_W(pushed_W_.emplace_back());
  const StepReport report = world_.Step(step_options_);
  last_controls_moved_ = controls_move;
  last_base_rates_ = base_rates_;
  base_rates_.setConstant(std::numeric_limits<double>::quiet_NaN());
  if (report.finite) {  // else the state is that before the step
    last_controls_ = controls_;
    ++steps_;
  }
  return report;
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
  return index >= static_cast<int>(control_names_.size()) - num_base_coordinates();
}

int Simulation::FindControl(const std::string& name) const {
  const auto at = std::find(control_names_.begin(), control_names_.end(), name);
  return at == control_names_.end() ? -1 : static_cast<int>(at - control_names_.begin());
}

void Simulation::SetControl(int index, double value) {
  FORK1S_REQUIRE(index >= 0 && index < controls_.size(), index);
  FORK1S_REQUIRE(std::isfinite(value), control_names_[static_cast<std::size_t>(index)], value);
  controls_(index) = std::clamp(value, control_lower_(index), control_upper_(index));
  if (DrivesBase(index))
    base_rates_(index - controls_.size() + base_rates_.size()) = std::numeric_limits<double>::quiet_NaN();
}

void Simulation::SetBaseRate(int index, double rate) {
  FORK1S_REQUIRE(index < controls_.size() && DrivesBase(index), index);
  FORK1S_REQUIRE(std::isfinite(rate), control_names_[static_cast<std::size_t>(index)], rate);
  base_rates_(index - controls_.size() + base_rates_.size()) = rate;
}

void Simulation::SetControl(const std::string& name, double value) {
  const int index = FindControl(name);
  if (index < 0) ThrowUnknown("control", name, control_names_);
  SetControl(index, value);
}

void Simulation::SetControls(const VectorX& values) {
  FORK1S_REQUIRE(values.size() == controls_.size(), values.size(), controls_.size());
  for (int i = 0; i < values.size(); ++i) SetControl(i, values(i));
}

void Simulation::StartFromControls() {
  FORK1S_REQUIRE(steps_ == 0, steps_);
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
  FORK1S_REQUIRE(body >= 0 && body < static_cast<int>(bodies_.size()), body);
  const SceneBody& b = bodies_[static_cast<std::size_t>(body)];
  if (b.mechanism < 0) return world_.free_bodies()[static_cast<std::size_t>(b.index)].pose();
  return world_.mechanisms()[static_cast<std::size_t>(b.mechanism)].BodyPose(BodyIndex(b.index));
}

RigidTransform Simulation::Pose(const std::string& body) const {
  const int index = FindBody(body);
  if (index < 0) {
    std::vector<std::string> names;
    for (const SceneBody& b : bodies_) names.push_back(b.name);
    ThrowUnknown("body", body, names);
  }
  return Pose(index);
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
  FORK1S_REQUIRE(body >= 0 && body < static_cast<int>(bodies_.size()), body);
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
  FORK1S_REQUIRE(body >= 0 && body < static_cast<int>(bodies_.size()), body);
  FORK1S_REQUIRE(force_W.allFinite() && moment_W.allFinite() && point_W.allFinite());
  const SceneBody& b = bodies_[static_cast<std::size_t>(body)];
  if (b.mechanism < 0)
    world_.free_bodies()[static_cast<std::size_t>(b.index)].AddWrench(force_W, moment_W, point_W);
  else
    world_.mechanisms()[static_cast<std::size_t>(b.mechanism)].AddWrench(BodyIndex(b.index), force_W,
                                                                         moment_W, point_W);
}

void Simulation::SetPointSpring(int body, const PointSpring& spring) {
  FORK1S_REQUIRE(body >= 0 && body < static_cast<int>(bodies_.size()), body);
  FORK1S_REQUIRE(spring.point_B.allFinite() && spring.target_start_W.allFinite() &&
                 spring.target_W.allFinite());
  FORK1S_REQUIRE(spring.stiffness >= 0 && std::isfinite(spring.stiffness), spring.stiffness);
  FORK1S_REQUIRE(spring.damping >= 0 && std::isfinite(spring.damping), spring.damping);
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
  last_point_springs_.clear();
  for (std::size_t i = 0; i < world_.free_bodies().size(); ++i)
    if (const PointSpring& spring = world_.free_bodies()[i].point_spring(); spring.IsActive())
      last_point_springs_.push_back({BodyOf(-1, static_cast<int>(i)), spring});
  for (std::size_t i = 0; i < world_.mechanisms().size(); ++i) {
    const MechanismDynamics& m = world_.mechanisms()[i];
    if (m.point_spring().IsActive())
      last_point_springs_.push_back(
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
