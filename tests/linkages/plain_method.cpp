#include "plain_method.hpp"

#include <cmath>

#include "jacobi.hpp"

namespace fork1s::linkages {
namespace {

using Vector3L = Eigen::Matrix<Real, 3, 1>;
using Matrix3L = Eigen::Matrix<Real, 3, 3>;

struct Pose {
  Matrix3L R = Matrix3L::Identity();
  Vector3L p = Vector3L::Zero();
};

Pose operator*(const Pose& a, const Pose& b) { return {a.R * b.R, a.R * b.p + a.p}; }
Pose Extended(const RigidTransform& X) { return {X.rotation().cast<Real>(), X.translation().cast<Real>()}; }

Matrix3L Cross(const Vector3L& v) {
  Matrix3L m;
  m << 0, -v.z(), v.y(), v.z(), 0, -v.x(), -v.y(), v.x(), 0;
  return m;
}

// Σ [x]^k / k!, summed until nothing is added: the definition of the exponential.
Pose Exponential(const Vector3L& w, const Vector3L& v) {
  const Matrix3L W = Cross(w);
  Pose X;
  Matrix3L power = Matrix3L::Identity(), V = Matrix3L::Identity();
  for (int k = 1; k < 40; ++k) {
    power = power * W / k;
    X.R += power;
    V += power / (k + 1);
    if (power.cwiseAbs().maxCoeff() < 1e-21L) break;
  }
  X.p = V * v;
  return X;
}

Vector3L Logarithm(const Matrix3L& R) {
  const Vector3L s = Vector3L(R(2, 1) - R(1, 2), R(0, 2) - R(2, 0), R(1, 0) - R(0, 1)) / 2;
  const Real sine = s.norm();
  if (sine < 1e-8L) return s * (1 + sine * sine / 6);
  return s * (std::asin(sine) / sine);
}

// Poses and closure residuals with coordinate `moved` at `value`, all others at the reference.
class Differences {
 public:
  explicit Differences(const Mechanism& mechanism) : def_(mechanism.definition()) {}

  std::vector<Pose> Poses(int moved, Real value) const {
    std::vector<Pose> X(def_.bodies.size());
    std::size_t j = 0;
    int offset = 0;
    for (std::size_t b = 1; b < X.size(); ++b) {
      X[b] = X[def_.bodies[b].parent.u()] * Extended(def_.bodies[b].X_PB);
      for (; j < def_.joints.size() && def_.joints[j].body.u() == b; ++j) {
        const auto& freedoms = def_.joints[j].freedoms;
        const int i = moved - offset;
        offset += static_cast<int>(freedoms.size());
        if (i < 0 || moved >= offset) continue;
        const Vector6& s = freedoms[static_cast<std::size_t>(i)].screw_B;
        X[b] = X[b] * Exponential(s.head<3>().cast<Real>() * value, s.tail<3>().cast<Real>() * value);
      }
    }
    return X;
  }

  // [log R_E; p_E] of every closure, all six rows, and of every body in `bodies` [turn from its reference;
  // place].
  VectorL Values(const std::vector<Pose>& X, const std::vector<Pose>& X_0,
                 const std::vector<BodyIndex>& bodies) const {
    VectorL y(6 * static_cast<Eigen::Index>(def_.closures.size() + bodies.size()));
    Eigen::Index row = 0;
    for (const ClosureDef& c : def_.closures) {
      const Pose A = X[c.body_a.u()] * Extended(c.X_AJ), B = X[c.body_b.u()] * Extended(c.X_BJ);
      y.segment<3>(row) = Logarithm(A.R.transpose() * B.R);
      y.segment<3>(row + 3) = A.R.transpose() * (B.p - A.p);
      row += 6;
    }
    for (BodyIndex b : bodies) {
      y.segment<3>(row) = Logarithm(X[b.u()].R * X_0[b.u()].R.transpose());
      y.segment<3>(row + 3) = X[b.u()].p;
      row += 6;
    }
    return y;
  }

  // Central differences of sixth order: at steps of 2e-3 rad both truncation, h⁶/140, and rounding stay below
  // what double precision leaves in the data.
  MatrixL Jacobian(const VectorL& unit, const std::vector<BodyIndex>& bodies) const {
    const std::vector<Pose> X_0 = Poses(-1, 0);
    const Eigen::Index rows = 6 * static_cast<Eigen::Index>(def_.closures.size() + bodies.size());
    MatrixL J(rows, unit.size());
    constexpr Real weight[] = {3.0L / 4, -3.0L / 20, 1.0L / 60}, h = 2e-3L;
    for (int i = 0; i < unit.size(); ++i) {
      J.col(i).setZero();
      for (int k = 1; k <= 3; ++k) {
        const Real step = k * h * unit(i);
        J.col(i) += (weight[k - 1] / h) *
                    (Values(Poses(i, step), X_0, bodies) - Values(Poses(i, -step), X_0, bodies));
      }
    }
    return J;
  }

 private:
  const MechanismDef& def_;
};

struct Ranks {
  Real kept = 1, dropped = 0;

  // Geometry of linkages spans few orders of magnitude, rounding of its data is 1e-16 times the distance from
  // R: any figure between 1e-4 and 1e-11 decides alike, and what has a value in between is not well posed.
  Eigen::Index Decide(const VectorL& sigma, Real largest) {
    Eigen::Index rank = 0;
    if (!(largest > 0)) return 0;
    while (rank < sigma.size() && sigma(rank) > 1e-8L * largest) ++rank;
    if (rank > 0) kept = std::min(kept, sigma(rank - 1) / largest);
    if (rank < sigma.size()) dropped = std::max(dropped, sigma(rank) / largest);
    return rank;
  }
};

// Kᵤ = LLᵀ in place, then Lᵀ-weighted columns: returns X with X Xᵀ = B K⁻¹ Bᵀ.
MatrixL TimesInverseRoot(const MatrixL& B, MatrixL K) {
  const Eigen::Index n = K.rows();
  MatrixL X = B;
  // Scaled to a unit diagonal first, so that six orders of stiffness cost no digits.
  VectorL d(n);
  for (Eigen::Index i = 0; i < n; ++i) d(i) = 1 / std::sqrt(K(i, i));
  K = d.asDiagonal() * K * d.asDiagonal();
  X = X * d.asDiagonal();
  for (Eigen::Index j = 0; j < n; ++j) {
    for (Eigen::Index k = 0; k < j; ++k) K.col(j).tail(n - j) -= K(j, k) * K.col(k).tail(n - j);
    const Real root = std::sqrt(K(j, j));
    K.col(j).tail(n - j) /= root;
    X.col(j) = (X.col(j) - X.leftCols(j) * K.row(j).head(j).transpose()) / root;
  }
  return X;
}

struct Rows {
  MatrixL rigid;      // of closures and couplings, lengths and slides in units of `length`
  MatrixL springs;    // of geometry, in the same units
  VectorL stiffness;  // of each spring row, N·m
};

Rows CollectRows(const Mechanism& mechanism, const MatrixL& closures, const VectorL& unit, Real length) {
  const Eigen::Index n = unit.size();
  std::vector<VectorL> rigid, springs;
  std::vector<Real> k;
  auto spring = [&](const VectorL& row, Real stiffness) {
    if (stiffness > 0) springs.push_back(row), k.push_back(stiffness);
  };
  for (Eigen::Index i = 0; i < n; ++i)
    spring(VectorL::Unit(n, i), static_cast<Real>(mechanism.stiffness()(i)) * unit(i) * unit(i));
  Eigen::Index row = 0;
  for (const ClosureDef& c : mechanism.closures())
    for (int i = 0; i < 6; ++i, ++row) {
      const Real in = i < 3 ? 1 : length;
      if (c.rigid(i))
        rigid.push_back(closures.row(row).transpose() / in);
      else
        spring(closures.row(row).transpose() / in, static_cast<Real>(c.stiffness(i)) * in * in);
    }
  for (const Mechanism::Spring& s : mechanism.springs()) {
    VectorL form = VectorL::Zero(n);
    for (const auto& [i, c] : s.length.terms) form(i) += static_cast<Real>(c) * unit(i);
    const Real size = form.norm();
    if (size > 0) spring(form / size, static_cast<Real>(s.stiffness) * size * size);
  }
  for (const Mechanism::Coupling& c : mechanism.couplings()) {
    VectorL form = VectorL::Zero(n);
    form(c.a) = unit(c.a);
    if (c.b >= 0) form(c.b) -= static_cast<Real>(c.polynomial[1]) * unit(c.b);
    for (const auto& [i, coefficient] : c.terms) form(i) -= static_cast<Real>(coefficient) * unit(i);
    rigid.push_back(form / form.norm());
  }
  Rows rows;
  rows.rigid.resize(static_cast<Eigen::Index>(rigid.size()), n);
  for (std::size_t i = 0; i < rigid.size(); ++i)
    rows.rigid.row(static_cast<Eigen::Index>(i)) = rigid[i].transpose();
  rows.springs.resize(static_cast<Eigen::Index>(springs.size()), n);
  rows.stiffness.resize(static_cast<Eigen::Index>(springs.size()));
  for (std::size_t i = 0; i < springs.size(); ++i) {
    rows.springs.row(static_cast<Eigen::Index>(i)) = springs[i].transpose();
    rows.stiffness(static_cast<Eigen::Index>(i)) = k[i];
  }
  return rows;
}

VectorL LengthScale(Eigen::Index rows, Real length) {
  VectorL scale(rows);
  for (Eigen::Index i = 0; i < rows; ++i) scale(i) = i % 6 < 3 ? length : 1;
  return scale;
}

}  // namespace

PlainAnswer PlainMethod(const Mechanism& mechanism, const std::vector<BodyIndex>& bodies, double length_in) {
  const Real length = static_cast<Real>(length_in);
  const Eigen::Index n = mechanism.num_coordinates();
  VectorL unit(n);
  for (Eigen::Index i = 0; i < n; ++i)
    unit(i) = mechanism.screws().col(i).head<3>().norm() > 1e-9 ? 1 : length;
  const MatrixL all = Differences(mechanism).Jacobian(unit, bodies);
  const Eigen::Index e6 = 6 * static_cast<Eigen::Index>(bodies.size());
  const Rows rows = CollectRows(mechanism, all.topRows(all.rows() - e6), unit, length);

  PlainAnswer out;
  Ranks ranks;
  // Z: loops closed.
  const Svd loops = JacobiSvd(rows.rigid);
  const Eigen::Index rank = ranks.Decide(loops.sigma, loops.sigma.size() > 0 ? loops.sigma(0) : 0);
  const MatrixL Z = loops.V.rightCols(n - rank);
  // N within Z: no spring row moves; W beside it: some does.
  const Svd sprung = JacobiSvd(rows.springs * Z);
  const Eigen::Index elastic = ranks.Decide(sprung.sigma, rows.springs.rows() > 0 ? Real(1) : Real(0));
  const MatrixL W = Z * sprung.V.leftCols(elastic), N = Z * sprung.V.rightCols(Z.cols() - elastic);

  // Interface displacements in lengths: J, lengths of the mechanism for turns.
  MatrixL J = all.bottomRows(e6);
  for (Eigen::Index i = 0; i < e6; ++i)
    if (i % 6 < 3) J.row(i) *= length;
  const Matrix3L R_WR = mechanism.definition().X_WR.rotation().cast<Real>();
  for (Eigen::Index i = 0; i < e6; i += 3) J.middleRows(i, 3) = (R_WR * J.middleRows(i, 3)).eval();
  J /= length;
  const Svd seen = JacobiSvd(J * N);
  const Eigen::Index f = ranks.Decide(seen.sigma, N.cols() > 0 ? Real(1) : Real(0));
  const MatrixL F = seen.U.leftCols(f);
  const MatrixL hidden = N * seen.V.rightCols(N.cols() - f);
  MatrixL JW = J * W;
  JW -= F * (F.transpose() * JW);
  const Svd felt = JacobiSvd(JW);
  const Eigen::Index r = ranks.Decide(felt.sigma, elastic > 0 ? Real(1) : Real(0));

  const MatrixL root = rows.stiffness.cwiseSqrt().asDiagonal() * (rows.springs * W);
  const MatrixL X = TimesInverseRoot(JW, root.transpose() * root) * length;
  VectorL back = LengthScale(e6, length).cwiseInverse();
  const MatrixL C = back.asDiagonal() * (X * X.transpose()) * back.asDiagonal();

  out.loop_rank = static_cast<int>(rank);
  out.free = static_cast<int>(N.cols());
  out.elastic = static_cast<int>(elastic);
  out.interface_free = static_cast<int>(f);
  out.interface_rank = static_cast<int>(r);
  out.C = C.cast<double>();
  out.free_d = (back.asDiagonal() * F).cast<double>();
  out.hidden_q = hidden.cast<double>();
  out.smallest_kept = static_cast<double>(ranks.kept);
  out.largest_dropped = static_cast<double>(ranks.dropped);

  // Data of a linkage at distance d from R carry 2⁻⁵³ d / length of rounding. A null space turns by that over
  // the smallest singular value kept, and a soft motion takes up energy of the stiffest spring with the root
  // of their ratio. Where the product is below 1e-10, two digits are left to every method's own rounding.
  Real distance = 1;
  for (const Mechanism::Body& b : mechanism.bodies())
    distance = std::max(distance, static_cast<Real>(b.X_RB0.translation().norm()) / length);
  Real ratio = 1;
  if (rows.stiffness.size() > 0) {
    ratio = rows.stiffness.maxCoeff() / rows.stiffness.minCoeff();
    out.open_compliance = static_cast<double>(1 / rows.stiffness.minCoeff());
  }
  out.expected_error = static_cast<double>(std::pow(2.0L, -53) * distance / ranks.kept * std::sqrt(ratio));
  out.well_posed = ranks.kept > 1e-4L && ranks.dropped < 1e-11L && out.expected_error < 1e-10;
  return out;
}

MatrixX ProjectOff(const MatrixX& free, double length) {
  const Eigen::Index n = free.rows();
  const VectorL scale = LengthScale(n, static_cast<Real>(length));
  MatrixL P = MatrixL::Identity(n, n);
  if (free.cols() > 0) {
    const Svd basis = JacobiSvd(scale.asDiagonal() * free.cast<Real>());
    P -= basis.U * basis.U.transpose();
    P = (scale.cwiseInverse().asDiagonal() * P * scale.asDiagonal()).eval();
  }
  return P.cast<double>();
}

double RelativeDifference(const MatrixX& A, const MatrixX& B, double length, double floor) {
  if (A.rows() != B.rows() || A.cols() != B.cols() || !A.allFinite()) return 2;
  const VectorX scale = LengthScale(A.rows(), static_cast<Real>(length)).cast<double>();
  const MatrixX difference = scale.asDiagonal() * (A - B) * scale.asDiagonal();
  const MatrixX size = scale.asDiagonal() * B * scale.asDiagonal();
  return difference.norm() / std::max({size.norm(), floor, 1e-300});
}

double SpanDistance(const MatrixX& A, const MatrixX& B, double length) {
  if (A.cols() != B.cols() || A.rows() != B.rows()) return 2;
  if (A.cols() == 0) return 0;
  const VectorL scale = LengthScale(A.rows(), static_cast<Real>(length));
  const Svd a = JacobiSvd(scale.asDiagonal() * A.cast<Real>()),
            b = JacobiSvd(scale.asDiagonal() * B.cast<Real>());
  return static_cast<double>((a.U - b.U * (b.U.transpose() * a.U)).norm());
}

}  // namespace fork1s::linkages
