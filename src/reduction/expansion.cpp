#include "reduction/expansion.hpp"

#include "closure_curvature.hpp"
#include "joint_curvature.hpp"
#include "linalg/outer_products.hpp"
#include "mechanism/rigid_parts.hpp"
#include "spatial/twist_exponential.hpp"

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

// Row t of twists -> row (t x* f).
Matrix6 CrossForceMap(const Vector6& f) {
  Matrix6 out = Matrix6::Zero();
  out.topLeftCorner<3, 3>() = Skew(f.head<3>());
  out.bottomLeftCorner<3, 3>() = Skew(f.tail<3>());
  out.topRightCorner<3, 3>() = Skew(f.tail<3>());
  return out;
}

class ExpansionBuilder {
 public:
  ExpansionBuilder(const ReducedModel& model, const Configuration& at, Expansion& out)
      : model_(model),
        m_(*model.mechanism),
        at_(at),
        out_(out),
        r_(model.size()),
        n_(model.num_coordinates()) {}

  void Expand() {
    joints_ = internal::JointCurvatures(m_, at_.kinematics, at_.q);
    ComputeTwists();
    CurveLoops();
    SumCarried();
    AddInertia();
    AddDampers();
    AddSprings();
    AddWeight();
  }

 private:
  auto T(int coordinate) { return out_.T.middleCols((coordinate + 1) * r_, r_); }
  auto Before(int coordinate) const { return internal::TwistsBefore(m_, out_, coordinate); }

  void ComputeTwists() {
    out_.T.resize(6, (n_ + 1) * r_);
    out_.T.leftCols(r_).setZero();
    out_.C.resize(6, n_ * r_);
    for (int j = 0; j < n_; ++j) {
      T(j) = Before(j);
      T(j).noalias() += out_.S.col(j) * out_.Q.row(j);
      out_.C.middleCols(j * r_, r_).noalias() = -SmallAdjoint(out_.S.col(j)) * Before(j);
    }
    for (const internal::JointCurvature& joint : joints_)
      out_.C.middleCols(joint.b * r_, r_).noalias() +=
          (joint.a < joint.b ? 2.0 : 1.0) * joint.second * out_.Q.row(joint.a);
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

  void SumCarried() {
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

  void AddInertia() {
    const int r2 = r_ * r_;
    // A coordinate a column: twice Y, and beneath twice -X before it is made symmetric.
    MatrixX YX(2 * r2, n_);
    RowMatrixX Z(n_, r_), H(n_, r_);  // P_k·S_j and the armature, of q''_j; M = Hᵀ Q + Qᵀ H
    // Of one coordinate, over z: twice Y is left rightᵀ, of which the first seven columns make twice -X.
    using Six = Eigen::Matrix<double, Eigen::Dynamic, 6>;
    Six before(r_, 6);
    Eigen::Matrix<double, Eigen::Dynamic, 19> left(r_, 19), right(r_, 19);
    const auto six = [&](auto& columns, int at) { return columns.data() + at * r_; };
    for (int l = 0; l < n_; ++l) {
      const Carried& carried = CarriedBy(l);
      const Vector6 s = out_.S.col(l), f = carried.I * s;
      before = Before(l).transpose();
      const Matrix6 minus_ad = -SmallAdjoint(s), turn = CrossForceMap(f).transpose();
      OuterProducts<6>(before.data(), minus_ad.data(), r_, 6, six(left, 0));    // c
      OuterProducts<6>(before.data(), carried.I.data(), r_, 6, six(right, 0));  // momenta
      OuterProducts<6>(before.data(), turn.data(), r_, 6, six(right, 7));
      OuterProducts<6>(left.data(), f.data(), r_, 1, six(left, 6));  // e
      right.col(6) = out_.Q.row(l).transpose();
      left.middleCols<6>(7) = before;
      left.rightCols<6>() = carried.P.transpose();
      right.rightCols<6>() = out_.C.middleCols(l * r_, r_).transpose();
      OuterProducts<19>(left.data(), right.data(), r_, r_, &YX(0, l));
      OuterProducts<7>(left.data(), right.data(), r_, r_, &YX(r2, l));
      OuterProducts<6>(six(left, 13), s.data(), r_, 1, &Z(l, 0));
      OuterProducts<6>(before.data(), f.data(), r_, 1, &H(l, 0));
      H.row(l) += 0.5 * s.dot(f) * out_.Q.row(l);
    }
    const MatrixX half = H.transpose() * out_.Q;
    out_.M = half + half.transpose();
    const MatrixX YXQ = 0.5 * (YX * out_.Q);
    out_.G.resize(r2, r_);
    for (int i = 0; i < r_; ++i)
      for (int j = 0; j < r_; ++j)
        for (int k = 0; k < r_; ++k)
          out_.G(k + r_ * j, i) =
              YXQ(k + r_ * j, i) + YXQ(k + r_ * i, j) - YXQ(r2 + i + r_ * j, k) - YXQ(r2 + j + r_ * i, k);
    AddJointVelocities(m_.armature(), out_.M, out_.G, Z);
    AddLoopsCurvature(Z, out_.G);
  }

  // Of joint velocities ν = E q̇: Jᵀ diag(weights) J, J = ∂ν/∂w, onto M, Jᵀ diag(weights) ∂J/∂z onto G, but
  // for q'', of which Z has the factors.
  void AddJointVelocities(VectorX weights, MatrixX& M, MatrixX& G, RowMatrixX& Z) const {
    if (weights.isZero(0)) return;
    const auto rotations = static_cast<Eigen::Index>(m_.rotations().size());
    MatrixX turned(r_ * r_, 3 * rotations), turns(3 * rotations, r_), square(r_, r_);
    Eigen::Index at_turn = 0;
    using Three = Eigen::Matrix<double, Eigen::Dynamic, 3>;
    Three Q(r_, 3), J(r_, 3), wJ(r_, 3);
    for (const Mechanism::Rotation& rotation : m_.rotations()) {
      Vector3 own;
      for (int i = 0; i < 3; ++i) {
        const int at = rotation.coordinates[static_cast<std::size_t>(i)];
        own(i) = weights(at);
        weights(at) = 0;
        Q.col(i) = out_.Q.row(at).transpose();
      }
      if (own.isZero(0)) continue;
      const Matrix3 E = AngularVelocityMap(m_, at_.kinematics, rotation), wE = own.asDiagonal() * E,
                    EwE = E.transpose() * wE;
      OuterProducts<3>(Q.data(), EwE.data(), r_, 3, J.data());
      OuterProducts<3>(Q.data(), J.data(), r_, r_, square.data());
      M += square;
      for (int i = 0; i < 3; ++i)
        Z.row(rotation.coordinates[static_cast<std::size_t>(i)]) += J.col(i).transpose();
      OuterProducts<3>(Q.data(), wE.data(), r_, 3, wJ.data());
      for (int c = 0; c < 3; ++c, ++at_turn) {
        const Matrix3 turn = internal::TurnOfVelocityMap(rotation, at_.q, c);
        OuterProducts<3>(Q.data(), turn.data(), r_, 3, J.data());
        OuterProducts<3>(wJ.data(), J.data(), r_, r_, turned.col(at_turn).data());  // k, j
        turns.row(at_turn) = Q.col(c).transpose();
      }
    }
    if (at_turn > 0) G.noalias() += turned.leftCols(at_turn) * turns.topRows(at_turn);
    const RowMatrixX weighted = weights.asDiagonal() * out_.Q;
    Z += weighted;
    M.noalias() += weighted.transpose() * out_.Q;
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

  // [N m; N] about R's origin.
  static Vector6 WeightOf(const Carried& carried, const Vector3& g) {
    Vector6 F;
    F << carried.weighed_moment.cross(g), carried.weighed_mass * g;
    return F;
  }

  // Of a unit of gravity along each axis.
  void AddWeight() {
    out_.weight_slope.resize(r_ * r_, 3);
    RowMatrixX H(n_, 3 * r_);  // F = Hᵀ Q + Qᵀ H, axis by axis
    MatrixX tau(n_, 3);
    for (int l = 0; l < n_; ++l) {
      const Carried& carried = CarriedBy(l);
      const Vector3 w = out_.S.col(l).head<3>(), v = out_.S.col(l).tail<3>();
      const Vector3 rate = w.cross(carried.weighed_moment) + carried.weighed_mass * v;
      const auto before = Before(l);
      for (int axis = 0; axis < 3; ++axis) {
        const Vector3 g = Vector3::Unit(axis), y = rate.cross(g);
        tau(l, axis) = out_.S.col(l).dot(WeightOf(carried, g));
        H.row(l).segment(axis * r_, r_).noalias() =
            y.transpose() * before.topRows<3>() + 0.5 * w.dot(y) * out_.Q.row(l);
      }
    }
    for (const internal::JointCurvature& joint : joints_)
      for (int axis = 0; axis < 3; ++axis)
        H.row(joint.b).segment(axis * r_, r_) +=
            (joint.a < joint.b ? 1.0 : 0.5) *
            joint.second.dot(WeightOf(CarriedBy(joint.a), Vector3::Unit(axis))) * out_.Q.row(joint.a);
    const MatrixX half = H.transpose() * out_.Q;
    out_.weight_force = out_.Q.transpose() * tau;
    for (int axis = 0; axis < 3; ++axis) {
      const auto own = half.middleRows(axis * r_, r_);
      const MatrixX slope = own + own.transpose() + SecondDerivative(model_, out_, tau.col(axis));
      out_.weight_slope.col(axis) = Eigen::Map<const VectorX>(slope.data(), r_ * r_);
    }
  }

  const ReducedModel& model_;
  const Mechanism& m_;
  const Configuration& at_;
  Expansion& out_;
  const int r_, n_;
  std::vector<internal::JointCurvature> joints_;
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
  ExpansionBuilder(model, c, out).Expand();
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
  out.T = internal::TwistsBehind(m, expansion, last);
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
