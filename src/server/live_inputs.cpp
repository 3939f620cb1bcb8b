// What acts on a live simulation in a step: set-points, pulls and pushes.
#include <algorithm>
#include <fork1s/stepping/mechanism_dynamics.hpp>

#include "server/live_simulation.hpp"
#include "server/pull_spring.hpp"

namespace fork1s {

void LiveSimulation::Play(ControlTrack controls, PushTrack pushes) {
  table_ = played_ = std::move(controls);
  table_pushes_ = std::move(pushes);
  StartTargets();
}

// Controls that move do so from where they stand at the first step of a simulation.
void LiveSimulation::StartTargets() {
  if (!simulation_.step_options().controls_move) return;
  FollowTable(time_offset_);
  ApplyTargets();
  simulation_.StartFromControls();
}

// Sets controls, rates of bases included, and the targets that sliders show.
void LiveSimulation::FollowTable(double time) {
  played_.Apply(time, simulation_);
  for (const std::string& name : played_.names)
    if (const int k = simulation_.FindControl(name); k >= 0) {
      targets_moved_ |= targets_(k) != simulation_.controls()(k);
      targets_(k) = simulation_.controls()(k);
    }
  constexpr std::int64_t kSettingsEvery = 6;  // steps
  if (!targets_moved_ || simulation_.steps() % kSettingsEvery != 0) return;
  targets_moved_ = false;
  PublishSettings();
}

void LiveSimulation::RemoveFromTable(Eigen::Index control) {
  for (std::string& name : played_.names)
    if (simulation_.FindControl(name) == control) name.clear();
}

// A driven base goes to where its sliders stand at a bounded speed; a jump would be a blow of any size.
void LiveSimulation::ApplyTargets() {
  constexpr double kSpeed = 1, kTurn = 3, kHaste = 10;  // m/s, rad/s, 1/s
  const double h = simulation_.dt();
  Eigen::Index next = 0;
  for (std::size_t i = 0; i < base_start_.size(); ++i)
    for (std::size_t k = simulation_.given_mechanism(static_cast<int>(i)).controls().size(); k > 0;
         --k, ++next)
      simulation_.SetControl(static_cast<int>(next), targets_(next));
  Eigen::Index base = 0;
  for (std::size_t i = 0; i < base_start_.size(); ++i) {
    if (simulation_.given_mechanism(static_cast<int>(i)).base() != BaseKind::kDriven) continue;
    const bool is_played =
        std::any_of(played_.names.begin(), played_.names.end(), [&](const std::string& name) {
          const int k = simulation_.FindControl(name);
          return k >= next && k < next + 6;
        });
    const VectorX rates = simulation_.base_rates();  // of the table, of coordinates from base_origin_
    const RigidTransform now = simulation_.BasePose(static_cast<int>(i));
    const Matrix3 R_goal = ExpRotation(targets_.segment<3>(next + 3)) * base_origin_[i].rotation();
    Vector3 move = base_origin_[i].translation() + targets_.segment<3>(next) - now.translation();
    Vector3 turn = LogRotation(R_goal * now.rotation().transpose());
    if (!is_played) move *= std::min({1.0, kHaste * h, kSpeed * h / std::max(move.norm(), 1e-12)});
    if (!is_played) turn *= std::min({1.0, kHaste * h, kTurn * h / std::max(turn.norm(), 1e-12)});
    const Vector3 shift = now.translation() + move - base_start_[i].translation();
    const Vector3 rotation =
        LogRotation(ExpRotation(turn) * now.rotation() * base_start_[i].rotation().transpose());
    for (int k = 0; k < 3; ++k) {
      simulation_.SetControl(static_cast<int>(next) + k, shift(k));
      simulation_.SetControl(static_cast<int>(next) + 3 + k, rotation(k));
    }
    if (is_played) {
      const bool same_axes = base_start_[i].rotation() == base_origin_[i].rotation();
      for (int k = 0; k < (same_axes ? 6 : 3); ++k)
        if (const double rate = rates(base + k); std::isfinite(rate))
          simulation_.SetBaseRate(static_cast<int>(next) + k, rate);
    }
    next += 6;
    base += 6;
  }
}

// A servo F = gain u + bias - stiffness (at_reference + l) is at rest at the present l.
std::optional<Refusal> LiveSimulation::HandleHold() {
  bool holds = false;
  Eigen::Index first = 0;
  for (int i = 0; i < static_cast<int>(base_start_.size()); ++i) {
    const auto& given = simulation_.given_mechanism(i);
    const MechanismDynamics& m =
        simulation_.world().mechanisms()[static_cast<std::size_t>(simulation_.place(i).mechanism)];
    for (std::size_t k = 0; k < given.controls().size(); ++k) {
      const std::string& name = given.controls()[k].name;
      const auto servo = std::find_if(servos_.begin(), servos_.end(), [&](const ServoShare& s) {
        return s.mechanism == i && s.control == name && s.stiffness > 0;
      });
      const auto& controls = m.mechanism().controls();
      const auto control =
          std::find_if(controls.begin(), controls.end(), [&](const auto& c) { return c.name == name; });
      if (servo == servos_.end() || control == controls.end() || control->gain == 0) continue;
      const auto place = static_cast<std::size_t>(control - controls.begin());
      const bool integrates =
          m.mechanism().definition().controls[place].dynamics == ControlDynamics::kIntegrator;
      // An integrator holds its set-point where its input, the rate, is 0.
      const double set_point =
          integrates ? 0 : servo->stiffness * (m.Length(control->length) - servo->Rest()) / control->gain;
      RemoveFromTable(first + static_cast<Eigen::Index>(k));
      targets_(first + static_cast<Eigen::Index>(k)) = std::clamp(set_point, control->lower, control->upper);
      holds = true;
    }
    first += static_cast<Eigen::Index>(given.controls().size());
  }
  if (!holds) return Refusal{"the model has no position servo that could hold its posture"};
  PublishSettings();
  return {};
}

void LiveSimulation::ApplyPulls() {
  shown_.clear();
  loads_.clear();
  simulation_.ClearPointSprings();
  if (pull_) {
    Pull& p = *pull_;
    simulation_.SetPointSpring(p.body, PullSpring(simulation_, p.body, p.point_B, p.reached_W, p.target_W,
                                                  settings_.pull_stiffness));
    p.reached_W = p.target_W;
  }
  const double end = time_offset_ + static_cast<double>(simulation_.steps() + 1) * simulation_.dt();
  for (const PushNow& p : table_pushes_.Over(end, simulation_.dt(), simulation_)) {
    simulation_.ApplyWrench(p.body, p.force_W, p.moment_W, p.point_W);
    loads_.push_back({p.body, p.point_B, p.force_W, p.moment_W});
    shown_.push_back({p.body, p.point_W, p.point_W, p.force_W});
  }
  for (Push& p : pushes_) {
    const Vector3 point = simulation_.Pose(p.body) * p.point_B;
    simulation_.ApplyWrench(p.body, p.force_W, Vector3::Zero(), point);
    loads_.push_back({p.body, p.point_B, p.force_W});
    shown_.push_back({p.body, point, point, p.force_W});
    --p.steps_left;
  }
  std::erase_if(pushes_, [](const Push& p) { return p.steps_left <= 0; });
}

// After a step: its force at the end.
void LiveSimulation::ShowPull() {
  if (!pull_) return;
  for (const auto& [body, spring] : simulation_.last_step().point_springs) {
    const RigidTransform X_WB = simulation_.Pose(body);
    const Vector3 force_W = spring.Force(X_WB, simulation_.Velocity(body));
    loads_.push_back({body, spring.point_B, force_W});
    shown_.push_back({body, X_WB * spring.point_B, spring.target_W, force_W});
  }
}

}  // namespace fork1s
