// The end of a step as a minimum, where one linear solve does not find it: springs of a million times their
// gain behind a loop that bends.
//
//     φ(x) = ½ (x - u)ᵀ M (x - u) + U(z⁺) + ½ h ẇᵀ D ẇ - pᵀ x,   z⁺ = z + h ẇ,  ẇ = w⁺
// All forces act at the end of the step; p are the impulses of contact, which stay. Newton with the springs'
// own stiffness of the pose and a line search: φ falls in every iteration, and with it what the step may
// gain.
//
// A servo's damper sees (ℓ⁺ - ℓ)/h, so that its force, bounds and all, hangs on ℓ⁺ alone: a spring k + d/h that
// gives way at its bounds is part of U, and of D no more.
#include <algorithm>
#include <cmath>
#include <limits>

#include "mechanism_detail.hpp"

namespace fork1s {

namespace {

// A servo at a length: its force without and within its bounds, and its stiffness to a step.
struct ServoAtEnd {
  double unbounded = 0, force = 0, stiffness = 0, way = 0;

  ServoAtEnd(const MechanismView& here, std::size_t k, double h) {
    const Mechanism::ForceLimit& limit = here.model.mechanism().force_limits()[k];
    way = Length(here, limit.length) - here.work.limits_start[k].second;
    stiffness = limit.stiffness + limit.damping / h;
    unbounded = UnboundedForce(here, limit) - limit.damping / h * way;
    force = std::clamp(unbounded, limit.lower, limit.upper);
  }
  signed char side() const { return unbounded > force ? 1 : unbounded < force ? -1 : 0; }
};

// -∂U/∂z and U at configuration, the base where the forces of the middle found it.
double EndForces(const MechanismStep& here, double h, VectorX& f_z) {
  const auto& [model, state, ws] = here;
  const Mechanism& m = model.mechanism();
  ws.F.setZero();
  AddGravityWrenches(m, ws.configuration.kinematics, state.reduced.X_WR.rotation().transpose() * ws.gravity_W,
                     ws.F);
  ws.tau.setZero();
  AccumulateGeneralizedForce(m, ws.configuration.kinematics.S, ws.F, ws.tau);
  if (state.controls.size() > 0) AddControlForce(m, ws.configuration.kinematics, state.controls, ws.tau);
  SpringForce(m, ws.configuration.kinematics, ws.configuration.q, ws.g);
  ws.g += ws.tau;
  double of_servos = 0;  // beyond their springs
  for (std::size_t k = 0; k < m.force_limits().size(); ++k) {
    const Mechanism::ForceLimit& limit = m.force_limits()[k];
    const ServoAtEnd servo(here, k, h);
    AddLengthForce(here, limit.length, servo.force - UnboundedForce(here, limit), ws.g);
    of_servos += 0.5 * limit.damping / h * servo.way * servo.way;
    const double excess = servo.unbounded - servo.force;
    if (excess != 0)
      of_servos += servo.stiffness > 0 ? -excess * excess / (2 * servo.stiffness)
                                       : excess * Length(here, limit.length);
  }
  if (model.has_followers)
    AddFollowerForce(here, -1, ws.g);  // the merit has them as they stood at the middle
  f_z.noalias() = ws.Q_now().transpose() * ws.g;
  ws.pose_energy.valid = false;
  return PotentialOfSprings(here, state.reduced.X_WR, ws.gravity_W).energy + of_servos;
}

// Of all joints at configuration, as the step knows it.
MatrixX StiffnessAtEnd(const MechanismStep& here, double h) {
  const auto& [model, state, ws] = here;
  const Mechanism& m = model.mechanism();
  MatrixX K = StiffnessMatrix(m, ws.configuration.kinematics, ws.configuration.q);
  VectorX arm(m.num_coordinates());
  for (std::size_t k = 0; k < m.force_limits().size(); ++k) {
    const Mechanism::ForceLimit& limit = m.force_limits()[k];
    const double more = ServoAtEnd(here, k, h).side() == 0 ? limit.damping / h : -limit.stiffness;
    arm.setZero();
    AddLengthForce(here, limit.length, 1, arm);
    K.noalias() += more * arm * arm.transpose();
  }
  return K;
}

// D of the reference without that of servos, which are part of U.
MatrixX DampingBesideServos(const MechanismStep& here) {
  const auto& [model, state, ws] = here;
  MatrixX D = model.reduced->D;
  for (const Mechanism::ForceLimit& limit : model.mechanism().force_limits()) {
    ReducedRow(limit.length, model.paths_ref, model.reduced->Q_rows, ws.limit_row);
    D.noalias() -= limit.damping * ws.limit_row * ws.limit_row.transpose();
  }
  return D;
}

// The sides that servos end with, in what is known of the energy too.
void TakeSides(const MechanismStep& here, double h) {
  const auto& [model, state, ws] = here;
  if (state.at_bound.empty()) return;
  ws.potential_start += BeyondBoundsAtStart(here);
  for (std::size_t k = 0; k < state.at_bound.size(); ++k)
    state.at_bound[k] = ServoAtEnd(here, k, h).side();
  ws.potential_start -= BeyondBoundsAtStart(here);
  ws.factored_h = -1;
}

// Work of springs, weight, controls and servos at their bounds along the chord, to second order, from the forces of
// its end.
double WorkFromEnd(const MechanismStep& here, double h, VectorX& f, MatrixX& K) {
  const auto& [model, state, ws] = here;
  for (std::size_t k = 0; k < state.at_bound.size(); ++k) {
    if (state.at_bound[k] != 0) continue;
    const Mechanism::ForceLimit& limit = model.mechanism().force_limits()[k];
    ReducedRow(limit.length, ws.paths(), ws.Q_now(), ws.limit_row);
    const double spring = IsCaught(here, k) ? 1 : 0;
    f += (limit.damping / h * ServoAtEnd(here, k, h).way - spring * UnboundedForce(here, limit)) * ws.limit_row;
    K.noalias() -= (limit.damping / h + spring * limit.stiffness) * ws.limit_row * ws.limit_row.transpose();
  }
  return h * ws.w_mean.dot(f) + 0.5 * h * h * ws.w_mean.dot(K * ws.w_mean);
}

// What the potential at hand cannot know: joints are sums of four terms, which where they cancel leave more of
// their rounding than of the sum. K is that of all joints.
double PotentialOfRounding(const MechanismStep& here, const MatrixX& K) {
  const auto& [model, state, ws] = here;
  constexpr double kDigits = 4 * std::numeric_limits<double>::epsilon();
  VectorX size = model.reduced->q_ref.cwiseAbs() + ws.configuration.q.cwiseAbs();
  size.noalias() += model.reduced->Q.cwiseAbs() * state.reduced.z.cwiseAbs();
  if (model.reduced->has_complement) size += state.reduced.q_perp.cwiseAbs();
  size *= kDigits;
  return size.dot(ws.g.cwiseAbs()) + 0.5 * size.dot(K.cwiseAbs() * size);
}

}  // namespace

double MinimiseAtEnd(const MechanismStep& here, double h) {
  const auto& [model, state, ws] = here;
  constexpr int kMost = 50;
  constexpr int kHalvings = 40;
  // Then a place along a step is known to the last digit of the whole.
  constexpr int kBisections = std::numeric_limits<double>::digits;
  const int r = model.size();
  ws.minimum_found = false;
  // Of first order: what the turning does to the velocity is taken along, as ActAtEnd has it.
  ws.w_start = ws.u.tail(r);
  const MatrixX D = DampingBesideServos(here);
  MatrixX K, K_joints;
  VectorX f(r), f_next(r), gradient(model.num_velocities()), step, x = ws.x, x_next, w(r);
  // From where nothing has bent yet.
  x.tail(r).setZero();
  auto merit = [&](const VectorX& at, VectorX& force) {
    w = at.tail(r);
    state.reduced.z = ws.z_before + h * w;
    Configure(*model.reduced, state.reduced, ws.configuration);
    const double U = EndForces(here, h, force);
    const VectorX moved = at - ws.u;
    double value = 0.5 * moved.dot(ws.M_full * moved) + U + 0.5 * h * w.dot(D * w) - ws.impulse.dot(at) -
                   h * ws.f_wrench.dot(at.tail(r));
    if (model.base_size > 0) value -= h * ws.base_force.dot(at.head<6>());
    return value;
  };
  auto take_gradient = [&](const VectorX& at, const VectorX& force) {
    gradient = ws.M_full * (at - ws.u) - ws.impulse;
    gradient.tail(r) += h * (D * at.tail(r) - force - ws.f_wrench);
    if (model.base_size > 0) gradient.head<6>() -= h * ws.base_force;
  };
  double value = merit(x, f);
  for (ws.newton_steps = 1; ws.newton_steps <= kMost; ++ws.newton_steps) {
    take_gradient(x, f);
    K_joints = StiffnessAtEnd(here, h);
    K = ws.Q_now().transpose() * K_joints * ws.Q_now();
    ws.A = ws.M_full;
    ws.A.bottomRightCorner(r, r) += h * D + h * h * K;
    ws.factor.Compute(ws.A);
    step = -gradient;
    ws.factor.SolveInPlace(step);
    const double slope = gradient.dot(step);
    if (!std::isfinite(slope)) break;
    // Below the digits of φ, of the pose, or of any number.
    const double size = std::abs(value) + std::abs(ws.potential_start) + 0.5 * x.dot(ws.M_full * x);
    if (!(slope < -kPotentialRounding * size - PotentialOfRounding(here, K_joints) -
                      std::numeric_limits<double>::min())) {
      ws.minimum_found = true;
      break;
    }
    double s = 1, next = 0;
    int halvings = 0;
    for (; halvings < kHalvings; ++halvings, s *= 0.5) {
      x_next = x + s * step;
      next = merit(x_next, f_next);
      if (next <= value + 1e-4 * s * slope) break;
    }
    if (halvings > 0) {
      // A servo of 1e8 N m/rad goes from bound to bound within 1e-7 rad, and there the stiffness is another: steps that only
      // make φ fall enough go to and fro between two of them. The one that ends where φ ends to fall meets such a place,
      // and its slope tells where that is when φ has no more digits for it.
      const double enough = halvings < kHalvings ? next : value + kPotentialRounding * size, s_enough = s;
      double falls = 0, rises = std::min(1.0, 2 * s), along = slope;
      for (int i = 0; i < kBisections && !(std::abs(along) < -1e-3 * slope); ++i) {
        s = 0.5 * (falls + rises);
        x_next = x + s * step;
        next = merit(x_next, f_next);
        take_gradient(x_next, f_next);
        along = gradient.dot(step);
        (along < 0 ? falls : rises) = s;
      }
      if (!(next <= enough)) {
        if (halvings == kHalvings) break;
        x_next = x + s_enough * step;
        next = merit(x_next, f_next);
      }
    }
    x = x_next;
    f = f_next;
    value = next;
  }
  ws.x = x;
  ws.w_mean = x.tail(r);
  // Configuration and K are of the last that was tried.
  merit(x, f);
  TakeSides(here, h);
  K = ws.Q_now().transpose() * StiffnessAtEnd(here, h) * ws.Q_now();
  const double work = WorkFromEnd(here, h, f, K);
  // The end is posed anew from the middle.
  std::swap(ws.configuration, ws.elsewhere);
  return work;
}

}  // namespace fork1s
