#include "full_mechanism.hpp"

#include <algorithm>
#include <cmath>

#include "mechanism/limits_at_start.hpp"

namespace fork1s::internal {

Expected<FullMechanism> FullMechanism::Create(std::shared_ptr<const Mechanism> mechanism, const VectorX& q0,
                                              const VectorX& q_dot0, const RigidTransform& X_WR,
                                              const Vector6& V_R) {
  const Mechanism& def = *mechanism;
  auto refuse = [&](std::string message) {
    return Fail(ErrorCode::kModel, "mechanism '" + def.name() + "'", std::move(message));
  };
  if (q0.size() != def.num_coordinates() || (q_dot0.size() > 0 && q_dot0.size() != def.num_coordinates()))
    return refuse("has a keyframe with " + std::to_string(q0.size()) + " coordinates instead of " +
                  std::to_string(def.num_coordinates()));
  FullMechanism m;
  m.mechanism_ = std::move(mechanism);
  m.LayOut();
  m.q_ = q0;
  const double gap = CloseLoops(def, m.q_);
  // A loop that cannot be closed to a micrometre is no loop of rigid parts.
  if (!(gap <= 1e-6))
    return refuse("has loops that stay open by " + std::to_string(gap) +
                  " m at the initial pose; correct the closure frames or choose another keyframe");
  m.driven_next = X_WR;
  m.X_.assign(static_cast<std::size_t>(def.num_bodies()), X_WR);
  for (int b = 1; b < def.num_bodies(); ++b) {
    // Bodies that are welded to a still base have no link.
    const auto i = static_cast<std::size_t>(b);
    const auto link =
        std::find_if(m.links_.begin(), m.links_.end(), [&](const Link& l) { return l.body == b; });
    m.X_[i] = m.X_[def.bodies()[i].parent.u()] *
              (link == m.links_.end() ? def.definition().bodies[i].X_PB : m.LinkPose(*link, m.q_));
  }
  m.Project(m.X_, m.q_);

  m.controls.resize(static_cast<Eigen::Index>(def.controls().size()));
  for (std::size_t i = 0; i < def.controls().size(); ++i)
    m.controls(static_cast<Eigen::Index>(i)) = def.controls()[i].initial;
  // ContactSet brings such a length inside.
  m.warnings_ = DescribeStopsPassedAtStart(def, m.q_);
  m.StartMotion(q_dot0, V_R);
  return m;
}

const Kinematics& FullMechanism::At(const VectorX& q) const {
  if (!posed_.empty() && (mechanism_->paths().empty() || posed_at_ == q)) return posed_[0];
  if (posed_.empty()) posed_.emplace_back(*mechanism_);
  posed_at_ = q;
  ComputeKinematics(*mechanism_, q, posed_[0]);
  return posed_[0];
}

void FullMechanism::LayOut() {
  const Mechanism& m = *mechanism_;
  const int bodies = m.num_bodies();
  column_.assign(static_cast<std::size_t>(bodies), -1);
  if (m.base() == BaseKind::kFloating) {
    column_[0] = 0;
    num_body_columns_ = 6;
  }
  int joint = 0, constraints = 0;
  for (int b = 0; b < bodies; ++b) {
    const auto i = static_cast<std::size_t>(b);
    const Mechanism::Body& body = m.bodies()[i];
    inertia_.push_back(body.inertia_B.Matrix());
    if (b == 0) continue;
    Link link;
    link.body = b;
    link.parent = body.parent.value();
    link.first_joint = joint;
    link.offset = joint < m.num_joints() ? m.joint(JointIndex(joint)).offset : 0;
    for (; joint < m.num_joints() && m.joint(JointIndex(joint)).body.value() == b; ++joint) {
      ++link.num_joints;
      link.size += m.joint(JointIndex(joint)).size;
    }
    if (body.last_joint < 0 && m.base() == BaseKind::kFixed) continue;  // part of the still world
    link.row = constraints;
    constraints += 6;
    column_[i] = num_body_columns_;
    num_body_columns_ += 6;
    links_.push_back(link);
  }
  first_loop_row_ = constraints;
  num_rows_ = constraints + m.num_constraints();
  num_velocities_ = num_body_columns_ + m.num_coordinates();
  wrenches_W_ = Matrix6X::Zero(6, bodies);
  V_ = Matrix6X::Zero(6, bodies);
  q_dot_ = VectorX::Zero(m.num_coordinates());
  nu_ = reactions_ = VectorX::Zero(num_rows_);
}

// Twists of the joint rates; where loops forbid them, the nearest in the metric of inertia that all rows
// allow.
void FullMechanism::StartMotion(const VectorX& q_dot0, const Vector6& V_R) {
  if (mechanism_->base() != BaseKind::kFixed) V_.col(0) = V_R;
  if (q_dot0.size() > 0) q_dot_ = q_dot0;
  for (const Link& link : links_) {
    const LinkRows rows = RowsOf(link, X_, q_);
    V_.col(link.body) =
        -rows.on_parent * V_.col(link.parent) - rows.on_rates * q_dot_.segment(link.offset, link.size);
  }
  if (num_rows_ == first_loop_row_ || (V_.isZero(0) && q_dot_.isZero(0))) return;
  dynamics_.Begin(num_unknowns());
  MatrixX x = MatrixX::Zero(num_unknowns(), 1);
  for (const Link& link : links_) {
    const int at = column_[static_cast<std::size_t>(link.body)];
    dynamics_.AddBlock(at, at, inertia_[static_cast<std::size_t>(link.body)]);
    x.block<6, 1>(at, 0) = inertia_[static_cast<std::size_t>(link.body)] * V_.col(link.body);
  }
  if (column_[0] >= 0) {
    dynamics_.AddBlock(0, 0, inertia_[0]);
    x.topRows<6>() = inertia_[0] * V_.col(0);
  }
  const MatrixX rotors = OnCoordinates(q_, mechanism_->armature());
  for (int i = 0; i < mechanism_->num_coordinates(); ++i)
    for (int j = 0; j < mechanism_->num_coordinates(); ++j)
      if (i == j || rotors(i, j) != 0)
        dynamics_.Add(ColumnOfCoordinate(i), ColumnOfCoordinate(j), rotors(i, j));
  x.block(num_body_columns_, 0, mechanism_->num_coordinates(), 1) = rotors * q_dot_;
  AddConstraints(X_, q_, true, 1e-9 / std::max(mechanism_->total_mass(), 1e-9), dynamics_);
  x.bottomRows(num_rows_) -= GivenVelocities(X_, q_, V_);
  if (!dynamics_.Factor() || !dynamics_.Solve(x)) return;
  for (std::size_t b = 0; b < X_.size(); ++b)
    if (column_[b] >= 0) V_.col(static_cast<Eigen::Index>(b)) = x.block<6, 1>(column_[b], 0);
  q_dot_ = x.block(num_body_columns_, 0, mechanism_->num_coordinates(), 1);
}

void FullMechanism::AddWrench(int body, const Vector3& force_W, const Vector3& moment_W,
                              const Vector3& point_W) {
  wrenches_W_.col(body).head<3>() += moment_W + point_W.cross(force_W);
  wrenches_W_.col(body).tail<3>() += force_W;
  has_wrenches_ = true;
  loads_.push_back({body, force_W, moment_W, X_[static_cast<std::size_t>(body)].inverse() * point_W});
}

void FullMechanism::ClearLoads() {
  wrenches_W_.setZero();
  has_wrenches_ = false;
  loads_.clear();
}

}  // namespace fork1s::internal
