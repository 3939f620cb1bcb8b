#include <fork1s/reduction/reduced_model.hpp>

namespace fork1s {

Configuration::Configuration(const ReducedModel& model)
    : q(model.q_ref), kinematics(*model.mechanism), Q_now(model.Q) {
  const int m = model.loop_rank();
  if (m == 0) return;
  const int n = model.num_coordinates();
  const int rows = model.mechanism->num_constraints();
  c_all.resize(rows);
  c.resize(m);
  lambda.resize(m);
  x.resize(n);
  A_all.resize(rows, n);
  A.resize(m, n);
  HA.resize(n, m);
  AHA.resize(m, m);
  AQ.resize(m, model.size());
  factor.Compute(MatrixX::Identity(m, m));
}

namespace {

// A, H⁻¹Aᵀ and the factor of A H⁻¹Aᵀ at the present pose.
void FactorLoops(const ReducedModel& model, Configuration& out) {
  ClosureJacobian(*model.mechanism, out.kinematics, out.q, out.A_all);
  for (int i = 0; i < model.loop_rank(); ++i)
    out.A.row(i) = out.A_all.row(model.loop_rows[static_cast<std::size_t>(i)]);
  out.HA.noalias() = model.h_inverse.asDiagonal() * out.A.transpose();
  out.AHA.noalias() = out.A * out.HA;
  out.factor.Compute(out.AHA);
}

}  // namespace

void Configure(const ReducedModel& model, const ReducedState& state, Configuration& out,
               int max_corrections) {
  const Mechanism& mechanism = *model.mechanism;
  out.q = model.q_ref;
  if (model.size() > 0) out.q.noalias() += model.Q * state.z;
  if (state.q_perp.size() > 0) out.q += state.q_perp;
  ComputeKinematics(mechanism, out.q, out.kinematics);
  if (model.loop_rank() == 0) return;

  // Residuals mix radians and metres; below this both are far under the 0.01 mm that users see.
  constexpr double kClosed = 1e-10;
  for (int i = 0;; ++i) {
    ClosureResidual(mechanism, out.kinematics, out.q, out.c_all);
    for (int k = 0; k < model.loop_rank(); ++k)
      out.c(k) = out.c_all(model.loop_rows[static_cast<std::size_t>(k)]);
    out.loop_residual = out.c_all.cwiseAbs().maxCoeff();
    FactorLoops(model, out);
    if (i == max_corrections || out.c.cwiseAbs().maxCoeff() < kClosed) break;
    out.lambda = out.c;
    out.factor.SolveInPlace(out.lambda);
    out.q.noalias() -= out.HA * out.lambda;
    ComputeKinematics(mechanism, out.q, out.kinematics);
  }
  out.AQ.noalias() = out.A * model.Q;
  out.factor.SolveInPlace(out.AQ);
  out.Q_now = model.Q;
  out.Q_now.noalias() -= out.HA * out.AQ;
}

void ProjectOnLoops(const ReducedModel& model, Configuration& c, VectorX& g) {
  if (model.loop_rank() == 0) return;
  c.lambda.noalias() = c.HA.transpose() * g;
  c.factor.SolveInPlace(c.lambda);
  g.noalias() -= c.A.transpose() * c.lambda;
}

}  // namespace fork1s
