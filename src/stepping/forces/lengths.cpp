// Lengths that springs, dampers, stops and motors act on, at the pose at hand.
#include <cmath>

#include "forces.hpp"
#include "linalg/rank.hpp"

namespace fork1s {

void LengthRow(const ConstStepContext& ctx, const Mechanism::Length& length, const VelocityRange& part,
               Eigen::Ref<VectorX> row) {
  const auto& [model, state, ws] = ctx;
  row.setZero();
  const int count = part.size - model.base_size;
  double unit = 0;
  ForEachArm(length, ws.paths(), [&](int i, double c) {
    row.tail(count) += c * ws.Q_now().row(i).segment(part.begin, count).transpose();
    unit += std::abs(c) * std::sqrt(model.reduced->h_inverse(i));
  });
  // Where loops hold a joint its row is the rounding of their closing. Nothing moves it, and a stop or dry
  // friction that pushed with such a lever would push with the inverse of rounding.
  const auto reach = model.coordinate_reach.segment(part.begin, count).array();
  if (!(row.tail(count).array().abs() > kRankThreshold * unit * reach).any()) row.setZero();
}

double RatePerImpulse(const StepContext& ctx, const Mechanism::Length& length) {
  const auto& [model, state, ws] = ctx;
  ReducedRow(length, ws.paths(), ws.Q_now(), ws.scratch.length_row);
  ws.scratch.rhs.setZero(model.num_velocities());
  ws.scratch.rhs.tail(model.size()) = ws.scratch.length_row;
  ws.scratch.solved = ws.scratch.rhs;
  SolveOrFail(ws.mass.factor, ws.mass.M, ws.scratch.solved);
  return ws.scratch.solved.dot(ws.scratch.rhs);
}

double LengthRateBy(const ConstStepContext& ctx, const Mechanism::Length& length, const VectorX& x) {
  const auto& [model, state, ws] = ctx;
  double rate = 0;
  ForEachArm(length, ws.paths(),
             [&](int i, double c) { rate += c * ws.Q_now().row(i).dot(x.tail(model.size())); });
  return rate;
}

double LengthRate(const ConstStepContext& ctx, const Mechanism::Length& length) {
  return LengthRateBy(ctx, length, ctx.work.x);
}

double Length(const ConstStepContext& ctx, const Mechanism::Length& length) {
  const auto& [model, state, ws] = ctx;
  return LengthOf(model.mechanism(), length, ws.configuration.kinematics, ws.q());
}

void AddLengthForce(const ConstStepContext& ctx, const Mechanism::Length& length, double force,
                    VectorX& tau) {
  const auto& [model, state, ws] = ctx;
  ForEachArm(length, ws.paths(), [&](int i, double c) { tau(i) += c * force; });
}

void AddStopForces(const ConstStepContext& ctx, double h, const std::vector<double>& limit_impulses,
                   const std::vector<double>& friction_impulses, VectorX& tau) {
  const Mechanism& m = ctx.model.mechanism();
  const auto add = [&](const Mechanism::Length& length, double impulse) {
    if (impulse != 0) AddLengthForce(ctx, length, impulse / h, tau);
  };
  for (std::size_t k = 0; k < m.length_limits().size(); ++k)
    add(m.length_limits()[k].length, limit_impulses[2 * k] - limit_impulses[2 * k + 1]);
  for (std::size_t k = 0; k < m.frictions().size(); ++k) add(m.frictions()[k].length, friction_impulses[k]);
}

// out = Qᵀ ∂ℓ/∂q
void ReducedRow(const Mechanism::Length& length, const std::vector<PathState>& paths, const RowMatrixX& Q,
                VectorX& out) {
  out.setZero();
  ForEachArm(length, paths, [&](int i, double c) { out.noalias() += c * Q.row(i).transpose(); });
}

}  // namespace fork1s
