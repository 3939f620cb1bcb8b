// The end of a step as a minimum, where one linear solve does not find it: springs of a million times their
// gain behind a loop that bends.
//
//     φ(x) = ½ (x - u)ᵀ M (x - u) + U(z⁺) + ½ h ẇᵀ D ẇ - pᵀ x,   z⁺ = z + h ẇ,  ẇ = w⁺
// All forces act at the end of the step; p are the impulses of contact, which stay. Newton with the springs'
// own stiffness of the pose and a line search: φ falls in every iteration, and with it what the step may
// gain.
#include <fork1s/dynamics/mechanism_dynamics.hpp>

#include <algorithm>
#include <cmath>
#include <limits>

namespace fork1s {

// -∂U/∂z and U at configuration_, the base where the forces of the middle found it.
double MechanismDynamics::EndForces(VectorX& f_z) {
  const Mechanism& m = mechanism();
  F_.setZero();
  AddGravityWrenches(m, configuration_.kinematics, state_.reduced.X_WR.rotation().transpose() * gravity_W_,
                     F_);
  tau_.setZero();
  AccumulateGeneralizedForce(m, configuration_.kinematics.S, F_, tau_);
  if (state_.controls.size() > 0) AddControlForce(m, configuration_.kinematics, state_.controls, tau_);
  SpringForce(m, configuration_.kinematics, configuration_.q, g_);
  g_ += tau_;
  for (const Mechanism::ForceLimit& limit : m.force_limits()) {
    const double f = UnboundedForce(limit), excess = f - std::clamp(f, limit.lower, limit.upper);
    AddLengthForce(limit.length, -excess, g_);
  }
  if (has_followers_) AddFollowerForce(-1, g_);  // the merit has them as they stood at the middle
  f_z.noalias() = Q_now().transpose() * g_;
  pose_energy_.valid = false;
  return PotentialEnergyOn(state_.reduced.X_WR, gravity_W_);
}

double MechanismDynamics::MinimiseAtEnd(double h) {
  constexpr int kMost = 50;
  constexpr double kRounding = 1e-13;  // potentials are sums of a hundred terms
  constexpr int kHalvings = 40;
  const int r = model().size();
  minimum_found_ = false;
  // Of first order: what the turning does to the velocity is taken along, as ActAtEnd has it.
  w_start_ = u_.tail(r);
  const MatrixX& D = model().D;
  MatrixX K;
  VectorX f(r), f_next(r), gradient(num_velocities()), step, x = x_, x_next, w(r);
  // From where nothing has bent yet.
  x.tail(r).setZero();
  auto merit = [&](const VectorX& at, VectorX& force) {
    w = at.tail(r);
    state_.reduced.z = z_before_ + h * w;
    Configure(model(), state_.reduced, configuration_);
    const double U = EndForces(force);
    const VectorX moved = at - u_;
    double value = 0.5 * moved.dot(M_full_ * moved) + U + 0.5 * h * w.dot(D * w) - impulse_.dot(at) -
                   h * f_wrench_.dot(at.tail(r));
    if (base_size_ > 0) value -= h * base_force_.dot(at.head<6>());
    return value;
  };
  double value = merit(x, f);
  for (newton_steps_ = 1; newton_steps_ <= kMost; ++newton_steps_) {
    gradient = M_full_ * (x - u_) - impulse_;
    gradient.tail(r) += h * (D * x.tail(r) - f - f_wrench_);
    if (base_size_ > 0) gradient.head<6>() -= h * base_force_;
    K = Q_now().transpose() *
        StiffnessMatrix(mechanism(), configuration_.kinematics, configuration_.q) * Q_now();
    A_ = M_full_;
    A_.bottomRightCorner(r, r) += h * D + h * h * K;
    factor_.Compute(A_);
    step = -gradient;
    factor_.SolveInPlace(step);
    const double slope = gradient.dot(step);
    if (!std::isfinite(slope)) break;
    // Below the digits of φ, or of any number.
    const double size = std::abs(value) + std::abs(potential_start_) + 0.5 * x.dot(M_full_ * x);
    if (!(slope < -kRounding * size - std::numeric_limits<double>::min())) {
      minimum_found_ = true;
      break;
    }
    double s = 1, next = 0;
    int halvings = 0;
    for (; halvings < kHalvings; ++halvings, s *= 0.5) {
      x_next = x + s * step;
      next = merit(x_next, f_next);
      if (next <= value + 1e-4 * s * slope) break;
    }
    if (halvings == kHalvings) break;
    x = x_next;
    f = f_next;
    value = next;
  }
  x_ = x;
  w_mean_ = x.tail(r);
  // The end is posed anew from the middle.
  std::swap(configuration_, elsewhere_);
  // Along the chord, to second order.
  return h * w_mean_.dot(f) + 0.5 * h * h * w_mean_.dot(K * w_mean_);
}

}  // namespace fork1s
