#include <algorithm>
#include <cmath>
#include <fork1s/reduction/statics.hpp>
#include <limits>

#include <fmt/format.h>

#include "elastic_basis.hpp"
#include "linalg/null_space.hpp"
#include "linalg/products.hpp"
#include "linalg/solve.hpp"
#include "linalg/spectrum.hpp"
#include "loaded_mechanism.hpp"
#include "locked_basis.hpp"
#include "reduction/tangent_stiffness.hpp"

namespace fork1s {
namespace {

using internal::LoadedMechanism;

// Whether forces g do work on any of the motions.
bool WorksOn(const MatrixX& motions, const VectorX& g) {
  return motions.cols() > 0 &&
         TransposedTimes(motions, g).cwiseAbs().maxCoeff() > 1e-9 * std::max(1e-300, g.cwiseAbs().maxCoeff());
}

// Of the equilibrium path g(q, λ, s) = 0, c(q) = 0; s is the share of the load.
struct PathPoint {
  VectorX q, lambda;
  double share = 0;
};

// Unit tangent of the path; joints in one unit, s as it is.
struct PathTangent {
  VectorX x;
  double share = 1;
  int num_negative = 0;  // eigenvalues of -∂g/∂q on the motions that keep loops closed
};

// Solutions [dq; dλ] of A dq = -c and g + K dq + Aᵀdλ = 0 for columns of g and c. Loops first, by their rank
// in one unit; then the motions that they leave, and the reactions of least norm: loops closed more often
// than needed share them.
// `motions`: columns that span the motions that closed loops leave, orthonormal in one unit.
// `drag`, where it is not 0: K is made less on its diagonal, by this and by as much as makes it definite [N·m].
MatrixX SolveClosed(const Mechanism& mechanism, const LoadedMechanism& loaded, const VectorX& q,
                    const MatrixX& K, const MatrixX& g, const MatrixX& c, const std::vector<int>& locked,
                    MatrixX* motions = nullptr, double drag = 0) {
  const CoordinateScaling here = ComputeCoordinateScaling(mechanism, loaded.kinematics());
  const VectorX& unit = here.coordinate;
  VectorX row;
  MatrixX A = ScaledClosureRows(mechanism, loaded.kinematics(), q, here, &row);
  for (const int i : locked) A.col(i).setZero();
  const MatrixX K_x = ScaledColumns(ScaledRows(unit, K), unit);
  const MatrixX g_x = ScaledRows(unit, g), c_x = ScaledRows(row, c);
  const NullSpace closed = ComputeNullSpace(A);
  const MatrixX& unseen = closed.unseen;
  if (motions) *motions = unseen;
  const MatrixX A_seen = Times(A, closed.seen);
  MatrixX x = -Times(closed.seen, LeastNormSolve(A_seen, c_x, kRankThreshold));
  MatrixX K_z = Congruence(K_x, unseen);
  if (drag > 0 && K_z.cols() > 0)
    K_z.diagonal().array() -= std::max(drag, 2 * EigenvaluesOf(0.5 * (K_z + K_z.transpose())).maxCoeff());
  // What neither springs nor loads hold stays where it is: differences give its stiffness as rounding.
  constexpr double kHeld = 1e-12;
  x -= Times(unseen, LeastNormSolve(K_z, TransposedTimes(unseen, g_x + Times(K_x, x)), kHeld));
  MatrixX step(x.rows() + c.rows(), g.cols());
  step << ScaledRows(unit, x),
      ScaledRows(row, -LeastNormSolve(A_seen.transpose(), TransposedTimes(closed.seen, g_x + Times(K_x, x)),
                                      kRankThreshold));
  return step;
}

// The path of equilibria as the load grows, by arc length (Crisfield, Non-linear Finite Element Analysis of
// Solids and Structures, chapter 9).
//
// Near a bifurcation another branch is close, and Newton's method from a long step may end on it. With N the
// number of negative eigenvalues of K = -∂g/∂q, N changes along a path only where K is singular: by one at a
// limit point, where ds changes sign as well, and by any number at a branch point, where ds keeps its sign
// (Seydel, Practical Bifurcation and Stability Analysis, chapter 5; Wriggers and Simo 1990). A step over which
// N and the sign of ds do not agree is halved: either it left the path, and a shorter one will not, or the
// path has a branch point, as perfect columns have, and steps of any length contain it.
class EquilibriumPath {
 public:
  EquilibriumPath(const Mechanism& mechanism, const VectorX& q0, const std::vector<DeadLoad>& loads,
                  const StaticsOptions& options)
      : mechanism_(mechanism), options_(options), loaded_(mechanism, q0, loads, options) {
    point_ = {q0, VectorX::Zero(mechanism.num_constraints()), 0};
    unloaded_ = options;
    unloaded_.gravity_R.setZero();
  }

  StaticsResult Solve() {
    const PathPoint start = point_;
    const bool starts = Start();
    result_.converged = starts && Follow();
    if (!starts || (!result_.converged && point_.share <= 1e-9)) {
      point_ = start;
      result_.converged = StartLoaded() && Follow();
    }
    result_.q = point_.q;
    result_.share = point_.share;
    return std::move(result_);
  }

 private:
  // At s = 0. There equilibria along motions of no stiffness are many, and the load, if it works on them,
  // chooses one: then at the first part of it.
  bool Start() {
    constexpr double kAnywhere = std::numeric_limits<double>::infinity();
    if (!Correct(point_, nullptr, kAnywhere)) return false;
    const MatrixX free = ComputeTangentStiffness(mechanism_, point_.q, {}, unloaded_).SingularMotions();
    loaded_.Pose(point_.q);
    const VectorX load = LoadRate();
    if (!WorksOn(free, load)) return true;
    point_.share = 1.0 / options_.load_steps;
    return Correct(point_, nullptr, kAnywhere);
  }

  // Where no path leaves the unloaded pose, as that of a body on cords which are slack there: at the first part
  // of the load, under which it moves until something holds it.
  bool StartLoaded() {
    point_.share = 1.0 / options_.load_steps;
    return Relax(point_) && Correct(point_, nullptr, std::numeric_limits<double>::infinity());
  }

  // At the share of p, follows dq/dt = g, whose stable rests are the stable equilibria, by implicit steps that
  // lengthen as g falls (pseudo-transient continuation, Kelley and Keyes 1998). False where it does not come
  // to rest.
  bool Relax(PathPoint& p) {
    constexpr int kMaxSteps = 1000;
    constexpr double kFirst = 0.1;  // length of a step where no stiffness limits it, in one unit
    constexpr double kRest = 1e-6;  // of the forces: from there Newton's method converges
    const Eigen::Index n = p.q.size(), m = p.lambda.size();
    const VectorX& unit = loaded_.unit().coordinate;
    VectorX c = VectorX::Zero(m);
    for (int i = 0; i < kMaxSteps; ++i) {
      ++result_.iterations;
      p.lambda = loaded_.Reactions(p.q, p.share);
      const VectorX g = loaded_.Residual(p.q, p.lambda, p.share);
      if (m > 0) ClosureResidual(mechanism_, loaded_.kinematics(), p.q, c);
      const double size = loaded_.Size(g);
      if (!std::isfinite(size)) return false;
      result_.residual = size / loaded_.Scale(p.q, p.share);
      if (result_.residual < kRest) return true;
      const MatrixX K = loaded_.Tangent(p.q, p.lambda, p.share);
      const VectorX step =
          SolveClosed(mechanism_, loaded_, p.q, K, g, c, options_.locked, nullptr, size / kFirst).topRows(n);
      if (!step.allFinite()) return false;
      const double largest = step.cwiseQuotient(unit).cwiseAbs().maxCoeff();
      p.q += (largest > 0.4 ? 0.4 / largest : 1.0) * step;
    }
    return false;
  }

  // Steps along the tangent, each corrected across it, until s = 1.
  bool Follow() {
    constexpr double kLongest = 0.5, kShortest = 1e-7;  // of rotations in rad, lengths and s
    // A branch point between the ends of a step of this length is one: a path that turned away beside it, as
    // that of an imperfect column, would turn over a longer one. It is passed by a step that is as much longer
    // as Newton's method needs, whose matrix is singular at the branch point.
    constexpr double kBranch = 1e-6, kPastBranch = 1e-3;
    constexpr int kMaxSteps = 500;
    constexpr double kStraight = 0.98;  // cosine between tangents above which a step is doubled
    if (point_.share >= 1) return true;
    PathTangent tangent = TangentAt(point_, nullptr);
    double length = 1 / (options_.load_steps * tangent.share), length_before_branch = 0;
    bool is_at_branch = false;
    for (int i = 0; i < kMaxSteps && length > kShortest; ++i) {
      const double to_end = (1 - point_.share) / tangent.share;
      const bool is_last = to_end > 0 && to_end <= 1.0001 * length;
      if (is_last) length = to_end;
      PathPoint next = Along(tangent, length);
      if (is_last) next.share = 1;
      if (!Correct(next, is_last ? nullptr : &tangent, 0.5 * length)) {
        length *= 0.5;
        continue;
      }
      const PathTangent there = TangentAt(next, &tangent);
      const bool passes_end = !is_last && (next.share - 1) * (point_.share - 1) < 0,
                 is_limit = there.share * tangent.share < 0;
      if (passes_end || (is_last && is_limit) || !IsSmooth(tangent, there, next)) {
        length *= 0.5;
        continue;
      }
      if (!is_at_branch && std::abs(there.num_negative - tangent.num_negative) != (is_limit ? 1 : 0)) {
        length_before_branch = std::max(length, length_before_branch);
        length *= 0.5;
        if (length < kBranch) {
          is_at_branch = true;
          length = std::min(kPastBranch, length_before_branch);
        }
        continue;
      }
      if (is_limit)  // extremum of the parabola with these slopes
        result_.limit_shares.push_back(point_.share + 0.5 * length * tangent.share * tangent.share /
                                                          (tangent.share - there.share));
      const double cosine = Cosine(tangent, there);
      point_ = next;
      tangent = there;
      if (is_last) return true;
      if (is_at_branch)
        length = length_before_branch;
      else if (cosine > kStraight)
        length = std::min(2 * length, std::max(kLongest, length));
      is_at_branch = false;
      length_before_branch = 0;
    }
    return false;
  }

  static double Cosine(const PathTangent& a, const PathTangent& b) {
    return a.x.dot(b.x) + a.share * b.share;
  }

  // Whether the step from point_ to `next` may be an arc with these tangents at its ends: they are less than
  // 37° apart, and so is the chord from either. Between parallel branches the tangents agree, and the chord
  // does not.
  bool IsSmooth(const PathTangent& tangent, const PathTangent& there, const PathPoint& next) const {
    constexpr double kTurn = 0.8;
    PathTangent chord{(next.q - point_.q).cwiseQuotient(loaded_.unit().coordinate),
                      next.share - point_.share};
    const double length = std::sqrt(Cosine(chord, chord));
    return Cosine(tangent, there) > kTurn && Cosine(chord, tangent) > kTurn * length &&
           Cosine(chord, there) > kTurn * length;
  }

  PathPoint Along(const PathTangent& tangent, double length) const {
    PathPoint p = point_;
    p.q += length * loaded_.unit().coordinate.cwiseProduct(tangent.x);
    p.share += length * tangent.share;
    return p;
  }

  // Continues `before`, or the growing load.
  PathTangent TangentAt(const PathPoint& p, const PathTangent* before) {
    const MatrixX K = loaded_.Tangent(p.q, p.lambda, p.share);
    MatrixX motions;
    const VectorX dq = SolveClosed(mechanism_, loaded_, p.q, K, LoadRate(), MatrixX::Zero(p.lambda.size(), 1),
                                   options_.locked, &motions)
                           .topRows(p.q.size());
    PathTangent t{dq.cwiseQuotient(loaded_.unit().coordinate), 1, CountNegative(K, motions, p)};
    double size = std::sqrt(Cosine(t, t));
    if (before && Cosine(t, *before) < 0) size = -size;
    t.x /= size;
    t.share /= size;
    return t;
  }

  // Negative eigenvalues of -K on motions that keep loops closed. Those of locked coordinates are 0.
  int CountNegative(MatrixX K, const MatrixX& motions, const PathPoint& p) {
    for (const int i : options_.locked) K(i, i) = 0;
    const VectorX& unit = loaded_.unit().coordinate;
    const MatrixX K_z = Congruence(ScaledColumns(ScaledRows(unit, K), unit), motions);
    TangentStiffness stiffness;
    stiffness.eigenvalues = EigenvaluesOf(-0.5 * (K_z + K_z.transpose()));
    if (stiffness.eigenvalues.size() > 0)
      stiffness.zero = internal::SingularStiffness(stiffness.eigenvalues, loaded_.Scale(p.q, p.share));
    return stiffness.num_negative();
  }

  // ∂g/∂s at the present pose.
  VectorX LoadRate() {
    VectorX g = loaded_.LoadForce(1);
    for (const int i : options_.locked) g(i) = 0;
    return g;
  }

  // Newton's method from p: at the share of p, or across a tangent. False where it does not converge within
  // `reach` of p.
  bool Correct(PathPoint& p, const PathTangent* across, double reach) {
    const Eigen::Index n = p.q.size(), m = p.lambda.size();
    const VectorX& unit = loaded_.unit().coordinate;
    const PathPoint start = p;
    VectorX c = VectorX::Zero(m);
    for (int i = 0; i < options_.max_iterations; ++i) {
      ++result_.iterations;
      MatrixX g(n, 2);
      g.col(0) = loaded_.Residual(p.q, p.lambda, p.share);
      if (m > 0) ClosureResidual(mechanism_, loaded_.kinematics(), p.q, c);
      const double scale = loaded_.Scale(p.q, p.share), error = n > 0 ? loaded_.Size(g.col(0)) / scale : 0;
      if (!std::isfinite(error)) return false;
      result_.residual = error;
      const bool is_closed = m == 0 || c.cwiseAbs().maxCoeff() < 1e-12;
      if (is_closed && (error < options_.tolerance || error * scale < loaded_.rounding())) return true;
      const MatrixX K = loaded_.Tangent(p.q, p.lambda, p.share);
      g.col(1) = LoadRate();
      MatrixX c_both = MatrixX::Zero(m, 2);
      c_both.col(0) = c;
      const MatrixX steps = SolveClosed(mechanism_, loaded_, p.q, K, g, c_both, options_.locked);
      VectorX step = steps.col(0);
      double d_share = 0;
      if (across) {
        const MatrixX x = ScaledRows(unit.cwiseInverse(), steps.topRows(n));
        d_share = -across->x.dot(x.col(0)) / (across->x.dot(x.col(1)) + across->share);
        step += d_share * steps.col(1);
      }
      if (!step.allFinite()) return false;
      const double largest = step.head(n).cwiseQuotient(unit).cwiseAbs().maxCoeff();
      const double damping = largest > 0.4 ? 0.4 / largest : 1.0;
      p.q += damping * step.head(n);
      p.lambda += damping * step.tail(m);
      p.share += damping * d_share;
      if ((p.q - start.q).cwiseQuotient(unit).norm() + std::abs(p.share - start.share) > reach) return false;
      // The residual is as small as the differences of the tangent resolve.
      if (largest < 1e-13 && error < 1e-8) return true;
    }
    return false;
  }

  const Mechanism& mechanism_;
  const StaticsOptions& options_;
  StaticsOptions unloaded_;
  LoadedMechanism loaded_;
  PathPoint point_;
  StaticsResult result_;
};

}  // namespace

StaticsResult SolveStatics(const Mechanism& mechanism, const VectorX& q0, const std::vector<DeadLoad>& loads,
                           const StaticsOptions& options) {
  StaticsResult result = EquilibriumPath(mechanism, q0, loads, options).Solve();
  if (result.converged) result.tangent = ComputeTangentStiffness(mechanism, result.q, loads, options);
  return result;
}

Expected<VectorX> LinearDeflection(const Mechanism& mechanism, const VectorX& q0,
                                   const std::vector<DeadLoad>& loads, const StaticsOptions& options) {
  LoadedMechanism loaded(mechanism, q0, loads, options);
  loaded.Pose(q0);
  const auto basis = internal::ComputeElasticBasis(mechanism, loaded.kinematics(), q0);
  const VectorX g = loaded.Residual(q0, VectorX(), 1);
  const int n = mechanism.num_coordinates();
  const internal::LockedBasis motions = internal::LockCoordinates(basis, n, options.locked);
  const MatrixX& N = motions.free;
  if (WorksOn(N, g)) {  // that only the preload of springs, controls and gravity may resist
    const TangentStiffness tangent = ComputeTangentStiffness(mechanism, q0, {}, options);
    const MatrixX free = tangent.SingularMotions();
    if (WorksOn(free, g)) {
      Eigen::Index direction, coordinate;
      VectorX(TransposedTimes(free, g)).cwiseAbs().maxCoeff(&direction);
      free.col(direction).cwiseAbs().maxCoeff(&coordinate);
      return Fail(
          ErrorCode::kUnderdetermined,
          fmt::format("joint '{}'",
                      mechanism.joint(mechanism.CoordinateJoint(static_cast<int>(coordinate))).name),
          "has no spring, nor preload or weight that resists it, and gives way to the load, so that no "
          "deflection balances it; give the joint a stiffness, hold it by PD control, or lock it");
    }
    return VectorX(q0 + tangent.Solve(g));
  }
  if (options.locked.empty()) return VectorX(q0 + basis.ApplyV(basis.ApplyVTransposed(g), n));
  return VectorX(q0 + Times(motions.elastic, TransposedTimes(motions.elastic, g)));
}

double MaxJointRotation(const Mechanism& mechanism, const VectorX& q0, const VectorX& q) {
  double largest = 0;
  for (const Mechanism::Joint& j : mechanism.joints()) {
    if (j.kind == JointKind::kHinge) largest = std::max(largest, std::abs(q(j.offset) - q0(j.offset)));
    if (j.kind == JointKind::kBall) {
      const Matrix3 before = ExpRotation(q0.segment<3>(j.offset)),
                    after = ExpRotation(q.segment<3>(j.offset));
      largest = std::max(largest, LogRotation(before.transpose() * after).norm());
    }
  }
  return largest;
}

}  // namespace fork1s
