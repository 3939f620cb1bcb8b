// The pose of reduced coordinates, loops closed along constant directions: docs/method.md, section 2.
#include <fork1s/reduction/reduced_model.hpp>

#include <algorithm>
#include <cmath>

namespace fork1s {

void FillLoopDirections(ReducedModel& model) {
  const Mechanism& mechanism = *model.mechanism;
  const int m = model.loop_rank(), n = model.num_coordinates();
  model.B.resize(n, m);
  if (m == 0) return;
  Kinematics kinematics(mechanism);
  ComputeKinematics(mechanism, model.q_ref, kinematics);
  MatrixX A;
  ClosureJacobian(mechanism, kinematics, model.q_ref, A);
  for (int i = 0; i < m; ++i)
    model.B.col(i) =
        model.h_inverse.cwiseProduct(A.row(model.loop_rows[static_cast<std::size_t>(i)]).transpose());
}

Configuration::Configuration(const ReducedModel& model)
    : q(model.q_ref), kinematics(*model.mechanism), Q_now(model.Q) {
  const int m = model.loop_rank();
  if (m == 0) return;
  const int n = model.num_coordinates();
  const int rows = model.mechanism->num_constraints();
  mu.setZero(m);
  c_all.resize(rows);
  c.resize(m);
  d.resize(m);
  z_of_mu.setZero(model.size());
  q_bar.resize(n);
  A_all.resize(rows, n);
  A.resize(m, n);
  AB.resize(m, m);
  W.setZero(m, model.size());
}

namespace {

void FactorLoops(const ReducedModel& model, Configuration& out) {
  ClosureJacobian(*model.mechanism, out.kinematics, out.q, out.A_all);
  for (int i = 0; i < model.loop_rank(); ++i)
    out.A.row(i) = out.A_all.row(model.loop_rows[static_cast<std::size_t>(i)]);
  out.AB.noalias() = out.A * model.B;
  out.factor.Compute(out.AB);
  out.has_factor = true;
}

// Pose and residual at the µ at hand.
void Place(const ReducedModel& model, Configuration& out) {
  out.q = out.q_bar;
  out.q.noalias() -= model.B * out.mu;
  ComputeKinematics(*model.mechanism, out.q, out.kinematics);
  ClosureResidual(*model.mechanism, out.kinematics, out.q, out.c_all);
  for (int k = 0; k < model.loop_rank(); ++k)
    out.c(k) = out.c_all(model.loop_rows[static_cast<std::size_t>(k)]);
  out.loop_residual = out.c_all.cwiseAbs().maxCoeff();
}

// What closing does not change. False where there is nothing to close: then the pose is done.
bool Start(const ReducedModel& model, const ReducedState& state, Configuration& out) {
  const bool loops = model.loop_rank() > 0;
  VectorX& q_bar = loops ? out.q_bar : out.q;
  q_bar = model.q_ref;
  if (model.size() > 0) q_bar.noalias() += model.Q * state.z;
  if (state.q_perp.size() > 0) q_bar += state.q_perp;
  out.corrections = 0;
  if (!loops) ComputeKinematics(*model.mechanism, out.q, out.kinematics);
  return loops;
}

// Factor, tangent and derivative at the pose that µ gives.
void Finish(const ReducedModel& model, const ReducedState& state, Configuration& out) {
  FactorLoops(model, out);
  out.pivot_ratio = out.factor.PivotRatio();
  out.z_of_mu = state.z;
  out.W.noalias() = out.A * model.Q;
  out.factor.SolveInPlace(out.W);
  out.Q_now = model.Q;
  out.Q_now.noalias() -= model.B * out.W;
}

}  // namespace

void Configuration::TakeLoops(const Configuration& other) {
  if (other.mu.size() == 0) return;
  mu = other.mu;
  z_of_mu = other.z_of_mu;
  W = other.W;
  factor = other.factor;
  has_factor = other.has_factor;
}

void ConfigureClosed(const ReducedModel& model, const ReducedState& state, Configuration& out) {
  if (!Start(model, state, out)) return;
  Place(model, out);
  Finish(model, state, out);
}

void Configure(const ReducedModel& model, const ReducedState& state, Configuration& out,
               int max_corrections) {
  if (!Start(model, state, out)) return;
  if (max_corrections == 0 || !out.mu.allFinite()) {
    out.mu.setZero();
  } else if (model.size() > 0) {  // along the tangent of the last pose
    out.mu.noalias() += out.W * state.z;
    out.mu.noalias() -= out.W * out.z_of_mu;
  }
  Place(model, out);
  // A chord that gains less than this costs more than a new factor.
  constexpr double kGain = 0.3;
  // A linearised closure means nothing beyond half a radian, or half a length of the mechanism.
  constexpr double kFarthest = 0.5;
  double residual = out.c.cwiseAbs().maxCoeff();
  bool stale = !out.has_factor;
  for (; out.corrections < max_corrections && residual >= out.closed; ++out.corrections) {
    if (stale) FactorLoops(model, out);
    out.d = out.c;
    out.factor.SolveInPlace(out.d);
    out.q.noalias() = model.B * out.d;
    const double step = std::sqrt((out.q.array().square() / model.h_inverse.array()).maxCoeff());
    if (step > kFarthest) out.d *= kFarthest / step;
    out.mu += out.d;
    Place(model, out);
    const double before = residual;
    residual = out.c.cwiseAbs().maxCoeff();
    stale = !(residual < kGain * before);
  }
  Finish(model, state, out);
}

void ProjectOnLoops(const ReducedModel& model, Configuration& c, VectorX& g) {
  if (model.loop_rank() == 0) return;
  c.d.noalias() = model.B.transpose() * g;
  c.factor.SolveTransposedInPlace(c.d);
  g.noalias() -= c.A.transpose() * c.d;
}

}  // namespace fork1s
