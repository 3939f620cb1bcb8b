#include <fork1s/reduction/expansion.hpp>

#include <fork1s/linalg/products.hpp>
#include <fork1s/mechanism/rigid_parts.hpp>
#include <fork1s/spatial/twist_exponential.hpp>

#include "closure_curvature.hpp"
#include "joint_curvature.hpp"

namespace fork1s {
namespace {

// Sums over all that a joint carries.
struct Carried {
  Matrix6 I = Matrix6::Zero();
  Matrix6X P;                                // 6 x r: momentum per rate of z
  Vector3 weighed_moment = Vector3::Zero();  // kg m, of what gravity acts on
  double weighed_mass = 0;                   // kg

  void Add(const Carried& other) {
    I += other.I;
    P += other.P;
    weighed_moment += other.weighed_moment;
    weighed_mass += other.weighed_mass;
  }
};

// Columns x*(f) of forces: t -> t x* f.
Vector6 CrossForce(const Vector6& t, const Vector6& f) {
  const Vector3 w = t.head<3>(), v = t.tail<3>();
  Vector6 out;
  out << w.cross(f.head<3>()) + v.cross(f.tail<3>()), w.cross(f.tail<3>());
  return out;
}

class Expander {
 public:
  Expander(const ReducedModel& model, const Configuration& at, Expansion& out)
      : model_(model),
        m_(*model.mechanism),
        at_(at),
        out_(out),
        r_(model.size()),
        n_(model.num_coordinates()) {}

  void Expand() {
    out_.joints = internal::JointCurvatures(m_, at_.kinematics, at_.q);
    TakeTwists();
    CurveLoops();
    TakeCarried();
    AddInertia();
    AddDampers();
    AddSprings();
    AddWeight();
  }

 private:
  auto T(int coordinate) { return out_.T.middleCols(coordinate * r_, r_); }
  Matrix6X Before(int coordinate) const { return internal::TwistsBefore(m_, out_, coordinate); }

  void TakeTwists() {
    out_.T.resize(6, n_ * r_);
    for (int j = 0; j < n_; ++j) T(j) = Before(j) + out_.S.col(j) * out_.Q.row(j);
  }

  void CurveLoops() {
    out_.N.setZero(model_.loop_rank(), r_ * r_);
    if (model_.loop_rank() == 0) return;
    const MatrixX curvature = internal::ClosureCurvature(model_, at_.kinematics, at_.q, out_);
    RowMatrixX rows(model_.loop_rank(), (r_ * r_ + 3) / 4 * 4);
    rows.setZero();
    for (int k = 0; k < model_.loop_rank(); ++k)
      rows.row(k).head(r_ * r_) = curvature.row(model_.loops.row(k));
    VectorX A;
    model_.loops.Fill(m_, at_.kinematics, at_.q, A);
    LoopFactor factor(model_.loops);
    factor.Compute(model_.loops, A, model_.B);
    factor.SolveInPlace(rows);
    out_.N = rows.leftCols(r_ * r_);
  }

  void TakeCarried() {
    const RigidParts parts(m_);
    carried_.resize(static_cast<std::size_t>(m_.num_joints()));
    for (Carried& c : carried_) c.P.setZero(6, r_);
    for (int j = 0; j < m_.num_joints(); ++j) {
      const SpatialInertia& own = parts.parts[static_cast<std::size_t>(j + 1)].inertia_R0;
      if (own.mass == 0) continue;
      Carried& c = carried_[static_cast<std::size_t>(j)];
      c.I = Transform(at_.kinematics.P[static_cast<std::size_t>(j)], own).Matrix();
      const Mechanism::Joint& joint = m_.joint(JointIndex(j));
      c.P = c.I * T(joint.offset + joint.size - 1);
    }
    for (int b = 0; b < m_.num_bodies(); ++b) {
      const Mechanism::Body& body = m_.bodies()[static_cast<std::size_t>(b)];
      if (body.last_joint < 0 || body.weighed_mass == 0) continue;
      Carried& c = carried_[static_cast<std::size_t>(body.last_joint)];
      c.weighed_mass += body.weighed_mass;
      c.weighed_moment +=
          body.weighed_mass * (at_.kinematics.X_RB[static_cast<std::size_t>(b)] * body.inertia_B.center);
    }
    for (std::size_t j = carried_.size(); j-- > 0;)
      if (const int up = m_.joints()[j].previous; up >= 0)
        carried_[static_cast<std::size_t>(up)].Add(carried_[j]);
  }

  const Carried& CarriedBy(int coordinate) const { return carried_[m_.CoordinateJoint(coordinate).u()]; }
  VectorX Row(int coordinate) const { return out_.Q.row(coordinate).transpose(); }
  static MatrixX Symmetric(const VectorX& a, const VectorX& b) {
    return a * b.transpose() + b * a.transpose();
  }

  // As G_kji and G_kij of Y.
  void AddBothWays(const MatrixX& Y_times_Q) {
    out_.G += Y_times_Q;
    for (int i = 0; i < r_; ++i)
      for (int j = 0; j < r_; ++j) out_.G.col(i).segment(r_ * j, r_) += Y_times_Q.col(j).segment(r_ * i, r_);
  }
  // G += weights_k curve_ij
  auto GByRows() { return Eigen::Map<MatrixX>(out_.G.data(), r_, r_ * r_); }
  void AddCurved(const VectorX& weights, const MatrixX& curve) {
    GByRows().noalias() += weights * Eigen::Map<const VectorX>(curve.data(), r_ * r_).transpose();
  }

  void AddInertia() {
    MatrixX half = MatrixX::Zero(r_, r_);
    MatrixX X(r_ * r_, n_), Y(r_ * r_, n_);
    RowMatrixX Z(n_, r_);  // P_k·S_j and the armature, of q''_j
    out_.G.setZero(r_ * r_, r_);
    for (int l = 0; l < n_; ++l) {
      const Carried& carried = CarriedBy(l);
      const Vector6 s = out_.S.col(l), f = carried.I * s;
      const VectorX q = Row(l);
      const Matrix6X before = Before(l), P = carried.I * before;
      Matrix6X c(6, r_), u(6, r_);
      for (int i = 0; i < r_; ++i) {
        c.col(i) = Bracket(before.col(i), s);
        u.col(i) = CrossForce(before.col(i), f);
      }
      const VectorX e = c.transpose() * f;
      const MatrixX cP = c.transpose() * P;
      Eigen::Map<MatrixX>(X.col(l).data(), r_, r_) = -0.5 * (cP + cP.transpose() + Symmetric(q, e));
      Eigen::Map<MatrixX>(Y.col(l).data(), r_, r_) =
          0.5 * (cP + before.transpose() * u + e * q.transpose() + carried.P.transpose() * c);
      Z.row(l) = s.transpose() * carried.P;
      half += (before.transpose() * f + 0.5 * s.dot(f) * q) * q.transpose();
    }
    out_.M = half + half.transpose();
    AddBothWays(Y * out_.Q);
    GByRows().noalias() += out_.Q.transpose() * X.transpose();
    for (const JointCurvature& joint : out_.joints)
      AddCurved(CarriedBy(joint.a).P.transpose() * joint.second, PairOf(joint));
    AddJointVelocities(m_.armature(), out_.M, out_.G, Z);
    AddLoopsCurvature(Z, out_.G);
  }

  MatrixX PairOf(const JointCurvature& joint) const {
    return joint.a == joint.b ? MatrixX(Row(joint.a) * Row(joint.a).transpose())
                              : Symmetric(Row(joint.a), Row(joint.b));
  }

  // Of joint velocities ν = E q̇: Jᵀ diag(weights) J, J = ∂ν/∂w, onto M, Jᵀ diag(weights) ∂J/∂z onto G, but
  // for q'', of which Z has the factors.
  void AddJointVelocities(VectorX weights, MatrixX& M, MatrixX& G, RowMatrixX& Z) const {
    for (const Mechanism::Rotation& rotation : m_.rotations()) {
      Vector3 own;
      MatrixX Q(3, r_);
      for (int i = 0; i < 3; ++i) {
        const int at = rotation.coordinates[static_cast<std::size_t>(i)];
        own(i) = weights(at);
        weights(at) = 0;
        Q.row(i) = out_.Q.row(at);
      }
      if (own.isZero(0)) continue;
      const Matrix3 E = AngularVelocityMap(m_, at_.kinematics, rotation);
      const MatrixX wJ = own.asDiagonal() * E * Q;  // 3 x r
      M.noalias() += (E * Q).transpose() * wJ;
      const MatrixX EwJ = E.transpose() * wJ;
      for (int i = 0; i < 3; ++i) Z.row(rotation.coordinates[static_cast<std::size_t>(i)]) += EwJ.row(i);
      for (int c = 0; c < 3; ++c) {
        const MatrixX turned = wJ.transpose() * internal::TurnOfVelocityMap(rotation, at_.q, c) * Q;  // k, j
        G.noalias() += Eigen::Map<const VectorX>(turned.data(), r_ * r_) * Q.row(c);
      }
    }
    for (int l = 0; l < n_; ++l) {
      if (weights(l) == 0) continue;
      Z.row(l) += weights(l) * out_.Q.row(l);
      M.noalias() += weights(l) * Row(l) * Row(l).transpose();
    }
  }

  // G_k(ij) += Σ_j Z_jk q''_j
  void AddLoopsCurvature(const RowMatrixX& Z, MatrixX& G) const {
    if (model_.loop_rank() == 0) return;
    RowMatrixX ZB;
    ApplyDirections(Z, ZB);
    Eigen::Map<MatrixX>(G.data(), r_, r_ * r_).noalias() -= ZB.leftCols(r_).transpose() * out_.N;
  }

  // B X, m x columns of X in whole fours.
  void ApplyDirections(const RowMatrixX& X, RowMatrixX& BX) const {
    BX.setZero(model_.loop_rank(), (X.cols() + 3) / 4 * 4);
    model_.loops.Apply(model_.B, X, BX);
  }

  // Springy closures are damped as they are at this pose.
  void AddDampers() {
    out_.D = out_.Q.transpose() * DampingMatrix(m_, at_.kinematics, at_.q) * out_.Q;
    out_.D_slope.setZero(r_ * r_, r_);
    MatrixX of_joints = MatrixX::Zero(r_, r_);
    RowMatrixX Z = RowMatrixX::Zero(n_, r_);
    AddJointVelocities(m_.damping(), of_joints, out_.D_slope, Z);
    for (const Mechanism::Spring& s : m_.springs()) {
      VectorX row = VectorX::Zero(r_);
      for (const auto& [i, c] : s.length.terms) row += c * Row(i);
      for (const auto& [i, c] : s.length.terms) Z.row(i) += c * s.damping * row.transpose();
    }
    AddLoopsCurvature(Z, out_.D_slope);
  }

  void AddSprings() {
    VectorX tau;
    SpringForce(m_, at_.kinematics, at_.q, tau);
    out_.spring_force = out_.Q.transpose() * tau;
    const MatrixX KQ = m_.has_diagonal_stiffness()
                           ? MatrixX(m_.stiffness().asDiagonal() * out_.Q)
                           : MatrixX(StiffnessMatrix(m_, at_.kinematics, at_.q) * out_.Q);
    out_.K = out_.Q.transpose() * KQ;
    out_.spring_slope = SecondDerivative(model_, out_, tau) - out_.K +
                        internal::SpringyClosureSlope(model_, at_.kinematics, out_);
  }

  // Of a unit of gravity along each axis.
  void AddWeight() {
    out_.weight_force.resize(r_, 3);
    out_.weight_slope.resize(r_ * r_, 3);
    for (int axis = 0; axis < 3; ++axis) {
      const Vector3 g = Vector3::Unit(axis);
      VectorX tau(n_);
      MatrixX half = MatrixX::Zero(r_, r_), slope = MatrixX::Zero(r_, r_);
      const auto wrench = [&](const Carried& c) {
        Vector6 F;
        F << c.weighed_moment.cross(g), c.weighed_mass * g;
        return F;
      };
      for (int l = 0; l < n_; ++l) {
        const Carried& carried = CarriedBy(l);
        const Vector3 w = out_.S.col(l).head<3>();
        const Vector3 y =
            (w.cross(carried.weighed_moment) + carried.weighed_mass * out_.S.col(l).tail<3>()).cross(g);
        tau(l) = out_.S.col(l).dot(wrench(carried));
        half += (Before(l).topRows<3>().transpose() * y + 0.5 * w.dot(y) * Row(l)) * out_.Q.row(l);
      }
      for (const JointCurvature& joint : out_.joints)
        slope += joint.second.dot(wrench(CarriedBy(joint.a))) * PairOf(joint);
      slope += half + half.transpose() + SecondDerivative(model_, out_, tau);
      out_.weight_force.col(axis) = out_.Q.transpose() * tau;
      out_.weight_slope.col(axis) = Eigen::Map<const VectorX>(slope.data(), r_ * r_);
    }
  }

  const ReducedModel& model_;
  const Mechanism& m_;
  const Configuration& at_;
  Expansion& out_;
  const int r_, n_;
  std::vector<Carried> carried_;  // per joint
};

}  // namespace

Expansion Expand(const ReducedModel& model, const VectorX& z, const Configuration& c) {
  Expansion out;
  out.z = z;
  out.q = c.q;
  out.Q = c.Q_now;
  out.S = c.kinematics.S;
  out.X_RB = c.kinematics.X_RB;
  Expander(model, c, out).Expand();
  return out;
}

MatrixX SecondDerivative(const ReducedModel& model, const Expansion& expansion, const VectorX& weights) {
  const int r = model.size();
  if (model.loop_rank() == 0) return MatrixX::Zero(r, r);
  VectorX Bw(model.loop_rank());
  model.loops.Apply(model.B, weights, Bw);
  const VectorX all = -expansion.N.transpose() * Bw;
  return Eigen::Map<const MatrixX>(all.data(), r, r);
}

BodyExpansion ExpandBody(const ReducedModel& model, const Expansion& expansion, BodyIndex body) {
  const Mechanism& m = *model.mechanism;
  const int r = model.size(), last = m.body(body).last_joint;
  BodyExpansion out;
  out.body = body;
  out.X_RB = expansion.X_RB[body.u()];
  out.T.setZero(6, r);
  if (last >= 0) out.T = internal::TwistsBehind(m, expansion, JointIndex(last));
  out.A = internal::OpenCurvature(model, expansion, body);
  if (model.loop_rank() == 0) return out;
  RowMatrixX S = RowMatrixX::Zero(model.num_coordinates(), 6), BS = RowMatrixX::Zero(model.loop_rank(), 8);
  for (int j = last; j >= 0; j = m.joint(JointIndex(j)).previous) {
    const Mechanism::Joint& joint = m.joint(JointIndex(j));
    S.middleRows(joint.offset, joint.size) = expansion.S.middleCols(joint.offset, joint.size).transpose();
  }
  model.loops.Apply(model.B, S, BS);
  Eigen::Map<MatrixX>(out.A.data(), 6, r * r).noalias() -= BS.leftCols<6>().transpose() * expansion.N;
  return out;
}

void EvaluateBody(const BodyExpansion& body, const VectorX& delta, RigidTransform& X_RB,
                  Eigen::Ref<Matrix6X> J) {
  const auto r = delta.size();
  Vector6 x = body.T * delta;
  for (Eigen::Index k = 0; k < r; ++k) {
    Vector6 turned = Vector6::Zero();
    for (Eigen::Index i = 0; i < r; ++i) turned += delta(i) * body.A.block<6, 1>(6 * k, i);
    J.col(k) = body.T.col(k) + turned;
    x += 0.5 * delta(k) * turned;
  }
  const TwistExponential motion(x);
  for (Eigen::Index k = 0; k < r; ++k) {
    const Vector6 own = J.col(k);
    Quad angular, linear;
    motion.Apply(own.data(), angular, linear);
    J.col(k) << angular.head<3>(), linear.head<3>();
  }
  RigidTransform moved;
  motion.SetTransform(moved);
  X_RB = moved * body.X_RB;
}

}  // namespace fork1s
