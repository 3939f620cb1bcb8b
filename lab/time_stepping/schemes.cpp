#include "schemes.hpp"

#include <cmath>
#include <numbers>

namespace fork1s::lab {

namespace {

std::vector<Vector3> Line(const std::vector<Vector3>& from, const std::vector<Vector3>& to, double s) {
  std::vector<Vector3> out(from.size());
  for (std::size_t i = 0; i < from.size(); ++i) out[i] = from[i] + s * (to[i] - from[i]);
  return out;
}

bool InputsJumped(const System& now, const System& before) {
  for (std::size_t i = 0; i < now.torsions.size(); ++i)
    if (now.torsions[i].target != before.torsions[i].target) return true;
  return false;
}

}  // namespace

Stepper::Stepper(const System& system, const State& state, const StepSettings& settings)
    : system_(system), system_before_(system), state_(state), settings_(settings) {}

StageInput Stepper::BaseAtState(double b) const { return {state_.poses, state_.p, state_.xi, b, b, {}}; }

void Stepper::Solve(const StageInput& input) {
  SolveStage(system_, input, settings_.stage, &state_, &counts_);
  for (std::size_t i = 0; i < system_.contacts.size(); ++i) {
    if (!state_.phi[i].isZero(0)) loaded_[i] = 1;
    deepest_ = std::max(deepest_, -ReadContact(system_, system_.contacts[i], state_).gap);
  }
}

void Stepper::TakeEuler(double h, const VectorX& restitution_speed) {
  StageInput input = BaseAtState(h);
  input.restitution_speed = restitution_speed;
  Solve(input);
}

void Stepper::UpdateClosed() {
  for (std::size_t i = 0; i < system_.contacts.size(); ++i)
    state_.closed[i] = state_.phi[i].isZero(0) ? 0 : 1;
}

// x₁ = x₀ + g h f₁,  x⁺ = x₀ + s (x₁ − x₀) + g h f⁺
void Stepper::TakeSdirk2(double h) {
  const State start = state_;
  const double g = 1 - 1 / std::numbers::sqrt2, s = (1 - g) / g;
  TakeEuler(g * h);
  Solve({Extrapolate(start.poses, state_.poses, s),
         start.p + s * (state_.p - start.p),
         Line(start.xi, state_.xi, s),
         g * h,
         (1 - g) * h,
         {}});
}

void Stepper::TakeScheme(double h) {
  const State start = state_;
  switch (settings_.scheme) {
    case Scheme::kEuler:
      TakeEuler(h);
      return;
    case Scheme::kSdirk2:
      TakeSdirk2(h);
      return;
    case Scheme::kTrBdf2: {
      // x₁ = x₀ + ½ γ h (f₀ + f₁),  x⁺ = x₀ + (x₁ − x₀)/(γ (2 − γ)) + (1 − γ)/(2 − γ) h f⁺
      if (settings_.start_rate == StartRate::kRestart &&
          (!has_rate_ || InputsJumped(system_, system_before_))) {
        TakeSdirk2(h);
        has_rate_ = true;
        return;
      }
      const double gamma = 2 - std::numbers::sqrt2, half = 0.5 * gamma * h;
      if (!has_rate_) {  // the rate of momentum at the start, by a stage of a thousandth
        TakeEuler(1e-3 * h);
        const State probe = state_;
        state_ = start;
        state_.V_before = VectorX();
        state_.p_rate = probe.p_rate;
        state_.lambda = probe.lambda;
        state_.phi = probe.phi;
        for (Vector3& rate : state_.xi_rate) rate.setZero();
      }
      VectorX rate = state_.p_rate;
      if (settings_.start_rate == StartRate::kAppliedAnew) {
        // Forces of the start with present inputs: the difference that they make alone.
        rate += AppliedForce(system_, state_) - AppliedForce(system_before_, state_);
      }
      std::vector<Vector3> xi(state_.xi.size());
      for (std::size_t i = 0; i < xi.size(); ++i) xi[i] = state_.xi[i] + half * state_.xi_rate[i];
      std::vector<Pose> poses(state_.poses.size());
      for (std::size_t i = 0; i < poses.size(); ++i)
        poses[i] = Compose(state_.poses[i], half * state_.V.segment<6>(6 * static_cast<Eigen::Index>(i)));
      Solve({poses, state_.p + half * rate, xi, half, 2 * half, {}});
      const double onward = 1 / (gamma * (2 - gamma));
      Solve({Extrapolate(start.poses, state_.poses, onward),
             start.p + onward * (state_.p - start.p),
             Line(start.xi, state_.xi, onward),
             (1 - gamma) / (2 - gamma) * h,
             (1 - gamma) * h,
             {}});
      has_rate_ = true;
      return;
    }
    case Scheme::kBdf2: {
      if (has_previous_) {
        Solve({Extrapolate(previous_.poses, state_.poses, 4. / 3),
               previous_.p + 4. / 3 * (state_.p - previous_.p),
               Line(previous_.xi, state_.xi, 4. / 3),
               2. / 3 * h,
               h,
               {}});
      } else {
        TakeEuler(0.5 * h);
        TakeEuler(0.5 * h);
      }
      previous_ = start;
      has_previous_ = true;
      return;
    }
  }
}

void Stepper::Step(double h) {
  const State start = state_;
  const double deepest = deepest_;
  loaded_.assign(system_.contacts.size(), 0);
  ++counts_.steps;
  TakeScheme(h);
  // A step contains an impact if a contact that carried no load would close at more than g h/8.
  bool impact = false;
  for (std::size_t i = 0; i < system_.contacts.size(); ++i) {
    if (start.closed[i] || !loaded_[i]) continue;
    const double approach = -ReadContact(system_, system_.contacts[i], start).velocity.x();
    impact = impact || approach > system_.gravity.norm() * h / 8 + 1e-9;
  }
  if (impact && settings_.substep_impacts) {
    ++counts_.impacts;
    state_ = start;
    deepest_ = deepest;
    for (int quarter = 0; quarter < 4; ++quarter) {
      const State before = state_;
      const double deepest_before = deepest_;
      loaded_.assign(system_.contacts.size(), 0);
      TakeEuler(h / 4);
      VectorX speed = VectorX::Zero(static_cast<Eigen::Index>(system_.contacts.size()));
      for (std::size_t i = 0; i < system_.contacts.size(); ++i) {
        const double approach = -ReadContact(system_, system_.contacts[i], before).velocity.x();
        if (!before.closed[i] && loaded_[i] && approach > system_.gravity.norm() * h / 8)
          speed(static_cast<Eigen::Index>(i)) = system_.contacts[i].restitution * approach;
      }
      if (speed.size() > 0 && speed.maxCoeff() > 0) {
        state_ = before;
        deepest_ = deepest_before;
        TakeEuler(h / 4, speed);
        for (std::size_t i = 0; i < system_.contacts.size(); ++i)
          if (speed(static_cast<Eigen::Index>(i)) > 0) {
            state_.phi[i].setZero();
            state_.xi[i].setZero();
          }
      }
      UpdateClosed();
    }
    state_.V_before = VectorX();
    has_previous_ = false;
    has_rate_ = false;  // that of the last quarter may be the impact's own
    system_before_ = system_;
    return;
  }
  UpdateClosed();
  system_before_ = system_;
}

}  // namespace fork1s::lab
