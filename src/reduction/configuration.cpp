// The pose of reduced coordinates, loops closed along constant directions: docs/method.md, section 2.
#include <fork1s/reduction/reduced_model.hpp>

#include <algorithm>
#include <cmath>
#include <fork1s/base/quad.hpp>
#include <limits>

namespace fork1s {

namespace {

// Columns that may move each coordinate, whatever the pose: loops let what moves one coordinate of a group
// move all.
std::vector<ReducedModel::Run> RunsOf(const ReducedModel& model) {
  const int n = model.num_coordinates(), r = model.size();
  std::vector<ReducedModel::Run> runs(static_cast<std::size_t>(n));
  const auto join = [](ReducedModel::Run& a, const ReducedModel::Run& b) {
    if (b.size == 0) return;
    if (a.size == 0) {
      a = b;
      return;
    }
    const int end = std::max(a.begin + a.size, b.begin + b.size);
    a.begin = std::min(a.begin, b.begin);
    a.size = end - a.begin;
  };
  for (int i = 0; i < n; ++i)
    for (int k = 0; k < r; ++k)
      if (model.Q(i, k) != 0) join(runs[static_cast<std::size_t>(i)], {k, 1});
  for (const std::vector<int>& group : model.loops.GroupCoordinates()) {
    ReducedModel::Run all;
    for (const int i : group) join(all, runs[static_cast<std::size_t>(i)]);
    for (const int i : group) runs[static_cast<std::size_t>(i)] = all;
  }
  return runs;
}

}  // namespace

double ClosedToRounding(const Mechanism& mechanism) {
  constexpr double kUnits = 45;  // in the last place: 1e-14 of a metre
  return kUnits * std::numeric_limits<double>::epsilon() * std::max(1.0, mechanism.length_scale());
}

void FillDerived(ReducedModel& model) {
  const Mechanism& mechanism = *model.mechanism;
  model.Q_rows = model.Q;
  if (model.loops.size() != model.loop_rank()) model.loops = LoopRows(mechanism, model.loop_rows);
  model.runs = RunsOf(model);
  model.B.resize(model.loops.num_values());
  if (model.loop_rank() == 0) return;
  Kinematics kinematics(mechanism);  // of it loops see poses and screws
  kinematics.S = model.S_ref;
  kinematics.X_RB = model.X_RB_ref;
  model.loops.Fill(mechanism, kinematics, model.q_ref, model.B);
  model.loops.ScaleCoordinates(model.h_inverse, model.B);
}

namespace {

bool IsSame(const ReducedModel::Run& a, const ReducedModel::Run& b) {
  return a.begin == b.begin && a.size == b.size;
}

// Rows from i on, at most four, that reach the same columns: 4, 2 or 1.
int CountAlike(const ReducedModel& model, Eigen::Index i, Eigen::Index n) {
  const ReducedModel::Run* run = model.runs.data() + i;
  if (i + 1 >= n || !IsSame(run[0], run[1])) return 1;
  return i + 3 < n && IsSame(run[0], run[2]) && IsSame(run[0], run[3]) ? 4 : 2;
}

// q [4] += four rows of Q, `stride` apart, times z.
void AddFourProducts(const double* row, std::ptrdiff_t stride, const double* z, int size, double* q) {
  Quad sum[4];
  for (Quad& s : sum) s.setZero();
  ByFours(size, [&](const auto& at) {
    constexpr int kSize = decltype(at(row))::RowsAtCompileTime;
    for (int i = 0; i < 4; ++i) sum[i].head<kSize>() += at(row + i * stride).cwiseProduct(at(z));
  });
  for (int i = 0; i < 4; ++i) q[i] += sum[i].sum();
}

}  // namespace

// Rows four by four where they reach the same columns, at least four: shorter ones cost less than to compare them.
void AddMotion(const ReducedModel& model, const RowMatrixX& Q, const VectorX& z, VectorX& q) {
  const auto n = Q.rows(), r = Q.cols();
  for (Eigen::Index i = 0; i < n; ++i) {
    const ReducedModel::Run run = model.runs[static_cast<std::size_t>(i)];
    const double *row = Q.data() + i * r + run.begin, *rates = z.data() + run.begin;
    if (run.size >= 4 && CountAlike(model, i, n) == 4) {
      AddFourProducts(row, r, rates, run.size, q.data() + i);
      i += 3;
      continue;
    }
    Quad sum = Quad::Zero();
    ByFours(run.size, [&](const auto& at) {
      constexpr int kSize = decltype(at(row))::RowsAtCompileTime;
      sum.head<kSize>() += at(row).cwiseProduct(at(rates));
    });
    q(i) += sum.sum();
  }
}

// Rows four by four or two by two.
void ReduceForce(const ReducedModel& model, const RowMatrixX& Q, const VectorX& g, VectorX& f) {
  const auto n = Q.rows(), r = Q.cols();
  f.setZero(r);
  for (Eigen::Index i = 0; i < n;) {
    const ReducedModel::Run run = model.runs[static_cast<std::size_t>(i)];
    const double *row = Q.data() + i * r + run.begin, *force = g.data() + i;
    double* out = f.data() + run.begin;
    const int alike = CountAlike(model, i, n);
    i += alike;
    if (alike == 4) {
      const double f0 = force[0], f1 = force[1], f2 = force[2], f3 = force[3];
      ByFours(run.size, [&](const auto& at) {
        typename decltype(at(out))::PlainObject sum = at(out);
        sum += f0 * at(row) + f1 * at(row + r);
        sum += f2 * at(row + 2 * r) + f3 * at(row + 3 * r);
        at(out) = sum;
      });
    } else if (alike == 2) {
      const double f0 = force[0], f1 = force[1];
      ByFours(run.size, [&](const auto& at) { at(out) += f0 * at(row) + f1 * at(row + r); });
    } else {
      const double f0 = force[0];
      ByFours(run.size, [&](const auto& at) { at(out) += f0 * at(row); });
    }
  }
}

Configuration::Configuration(const ReducedModel& model)
    : q(model.q_ref), kinematics(*model.mechanism), Q_now(model.Q_rows) {
  const int m = model.loop_rank();
  if (m == 0) return;
  const int n = model.num_coordinates(), rows = model.mechanism->num_constraints();
  mu.setZero(m);
  c_all.resize(rows);
  c.resize(m);
  d.resize(m);
  q_bar.resize(n);
  q_bar_before.resize(n);
  mu_before.resize(m);
  q_move.resize(n);
  A.resize(model.loops.num_values());
  W.setZero(m, (model.size() + 3) / 4 * 4);
  factor = LoopFactor(model.loops);
}

namespace {

void FactorLoops(const ReducedModel& model, Configuration& out) {
  model.loops.Fill(*model.mechanism, out.kinematics, out.q, out.A);
  out.factor.Compute(model.loops, out.A, model.B);
}

// Pose and residual at the µ at hand.
void Place(const ReducedModel& model, Configuration& out) {
  out.q = out.q_bar;
  model.loops.SubtractTransposed(model.B, out.mu, out.q);
  ComputeKinematics(*model.mechanism, out.q, out.kinematics);
  ClosureResidual(*model.mechanism, out.kinematics, out.q, out.c_all);
  for (int k = 0; k < model.loop_rank(); ++k) out.c(k) = out.c_all(model.loops.row(k));
  out.loop_residual = out.c_all.cwiseAbs().maxCoeff();
}

// What closing does not change. False where there is nothing to close: then the pose is done.
bool Start(const ReducedModel& model, const ReducedState& state, Configuration& out) {
  const bool loops = model.loop_rank() > 0;
  VectorX& q_bar = loops ? out.q_bar : out.q;
  q_bar = model.q_ref;
  AddMotion(model, model.Q_rows, state.z, q_bar);
  out.corrections = 0;
  if (!loops) ComputeKinematics(*model.mechanism, out.q, out.kinematics);
  return loops;
}

// µ along the tangent of a pose before, closed and factored: A (Δq_bar - B Δµ) = 0. Its second derivative
// would save a chord in a step, and costs as much.
void PredictByTangent(const ReducedModel& model, Configuration& out) {
  out.q_move = out.q_bar - out.q_bar_before;
  model.loops.Apply(out.A, out.q_move, out.d);
  out.factor.SolveInPlace(out.d);
  out.mu = out.mu_before + out.d;
}

// The pose at hand is the one that later ones are foreseen from.
void SetTangentPredictor(Configuration& out) {
  out.q_bar_before = out.q_bar;
  out.mu_before = out.mu;
  out.has_tangent_predictor = out.factor.ok();
}

// Factor and derivative at the pose that µ gives.
void Finish(const ReducedModel& model, Configuration& out) {
  FactorLoops(model, out);
  SetTangentPredictor(out);
  model.loops.Apply(out.A, model.Q_rows, out.W);
  out.factor.SolveInPlace(out.W);
  out.Q_now = model.Q_rows;
  model.loops.SubtractTransposed(model.B, out.W, out.Q_now);
}

// Loops by their curvature: µ and both derivatives are those of z alone, whatever the last pose was.
void Curve(const ReducedModel& model, const ReducedState& state, Configuration& out) {
  model.curvature.Apply(state.z, out.W);
  out.mu.noalias() = 0.5 * out.W.leftCols(model.size()) * state.z;
  Place(model, out);
  out.Q_now = model.Q_rows;
  model.loops.SubtractTransposed(model.B, out.W, out.Q_now);
}

}  // namespace

void ConfigureClosed(const ReducedModel& model, const ReducedState& state, Configuration& out) {
  if (!Start(model, state, out)) return;
  if (model.curvature.exists()) return Curve(model, state, out);
  Place(model, out);
  Finish(model, out);
}

namespace {

// µ from where it is or is foreseen, by chords. True where they took a new factor.
bool Close(const ReducedModel& model, int max_corrections, Configuration& out) {
  if (max_corrections == 0 || !out.mu.allFinite())
    out.mu.setZero();
  else if (out.has_tangent_predictor)
    PredictByTangent(model, out);
  Place(model, out);
  // A chord that gains less than this costs more than a new factor.
  constexpr double kGain = 0.3;
  // A linearized closure means nothing beyond half a radian, or half a length of the mechanism.
  constexpr double kFarthest = 0.5;
  double residual = out.c.cwiseAbs().maxCoeff();
  bool stale = !out.has_tangent_predictor, factored = false;
  for (; out.corrections < max_corrections && residual >= out.closing_tolerance; ++out.corrections) {
    if (stale) FactorLoops(model, out);
    factored = factored || stale;
    out.d = out.c;
    out.factor.SolveInPlace(out.d);
    out.q_move.setZero();
    model.loops.SubtractTransposed(model.B, out.d, out.q_move);
    const double step = std::sqrt((out.q_move.array().square() / model.h_inverse.array()).maxCoeff());
    if (step > kFarthest) out.d *= kFarthest / step;
    out.mu += out.d;
    Place(model, out);
    const double before = residual;
    residual = out.c.cwiseAbs().maxCoeff();
    stale = !(residual < kGain * before);
  }
  return factored;
}

}  // namespace

void Configure(const ReducedModel& model, const ReducedState& state, Configuration& out,
               int max_corrections) {
  if (!Start(model, state, out)) return;
  if (model.curvature.exists()) return Curve(model, state, out);
  Close(model, max_corrections, out);
  Finish(model, out);
}

void ConfigurePose(const ReducedModel& model, const ReducedState& state, Configuration& out) {
  if (!Start(model, state, out)) return;
  if (model.curvature.exists()) return Curve(model, state, out);
  if (Close(model, kMostCorrections, out)) SetTangentPredictor(out);
}

void RemoveConstraintReactions(const ReducedModel& model, Configuration& c, VectorX& g) {
  if (model.loop_rank() == 0 || model.curvature.exists()) return;
  model.loops.Apply(model.B, g, c.d);
  c.factor.SolveTransposedInPlace(c.d);
  model.loops.SubtractTransposed(c.A, c.d, g);
}

}  // namespace fork1s
