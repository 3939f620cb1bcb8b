#include <fork1s/dynamics/mechanism_dynamics.hpp>

#include <algorithm>
#include <cmath>

#include <Eigen/Cholesky>

namespace fork1s {
namespace {

// Rigid groups that may touch something: one per interface body, and the base.
std::vector<ContactGroup> MakeGroups(const ReducedModel& model) {
  const Mechanism& mechanism = *model.mechanism;
  std::vector<ContactGroup> groups;
  auto add = [&](BodyIndex body) {
    const int joint = mechanism.body(body).last_joint;
    for (const ContactGroup& g : groups)
      if (g.last_joint == joint) return;
    ContactGroup group;
    group.last_joint = joint;
    group.body = body;
    for (int b = 0; b < mechanism.num_bodies(); ++b)
      if (mechanism.bodies()[static_cast<std::size_t>(b)].last_joint == joint) group.bodies.emplace_back(b);
    groups.push_back(std::move(group));
  };
  add(BodyIndex(0));
  for (BodyIndex b : model.interfaces) add(b);
  return groups;
}

}  // namespace

MechanismDynamics::MechanismDynamics(ReducedModel model)
    : model_(std::move(model)), configuration_(model_), groups_(MakeGroups(model_)) {}

Expected<MechanismDynamics> MechanismDynamics::Create(std::shared_ptr<const Mechanism> mechanism,
                                                      const VectorX& q0, const VectorX& q_dot0,
                                                      const RigidTransform& X_WR, const Vector6& V_R,
                                                      const Options& options) {
  VectorX q = q0;
  const double gap = CloseLoops(*mechanism, q);
  // A loop that cannot be closed to a micrometre is no loop of rigid parts.
  if (gap > 1e-6)
    return Fail(ErrorCode::kModel, "mechanism '" + mechanism->name() + "'",
                "has loops that stay open by " + std::to_string(gap) +
                    " m at the initial pose; correct the closure frames or choose another keyframe");
  auto model = Reduce(mechanism, q, options.reduction);
  if (!model) return tl::unexpected(model.error());
  MechanismDynamics dynamics(std::move(*model));
  dynamics.options_ = options;
  // The interfaces that Reduce settled on are those of every later refresh.
  dynamics.options_.reduction.interfaces = dynamics.model_.interfaces;
  dynamics.options_.reduction.promote_hidden = false;
  dynamics.base_size_ = mechanism->base() == BaseKind::kFloating ? 6 : 0;
  const int r = dynamics.model_.size();
  dynamics.state_.z = VectorX::Zero(r);
  dynamics.state_.w = VectorX::Zero(r);
  dynamics.state_.X_WR = X_WR;
  dynamics.state_.V_R = mechanism->base() == BaseKind::kFixed ? Vector6(Vector6::Zero()) : V_R;
  dynamics.driven_next_ = X_WR;
  dynamics.controls_.resize(static_cast<Eigen::Index>(mechanism->controls().size()));
  for (std::size_t i = 0; i < mechanism->controls().size(); ++i)
    dynamics.controls_(static_cast<Eigen::Index>(i)) = mechanism->controls()[i].initial;
  // A pose outside the limits may be what springs and loops hold; pushing it inside would fight them for
  // ever.
  dynamics.lower_ = mechanism->lower().cwiseMin(q);
  dynamics.upper_ = mechanism->upper().cwiseMax(q);
  dynamics.warnings_ = dynamics.model_.warnings;
  for (int i = 0; i < mechanism->num_coordinates(); ++i) {
    if (std::isfinite(dynamics.lower_(i)) || std::isfinite(dynamics.upper_(i)))
      dynamics.limited_.push_back(i);
    const double outside = std::max(mechanism->lower()(i) - q(i), q(i) - mechanism->upper()(i));
    if (outside > 1e-3)
      dynamics.warnings_.push_back("joint '" + mechanism->CoordinateName(i) +
                                   "' starts outside its limits by " + std::to_string(outside) +
                                   " (rad or m); the limit was moved to the initial pose");
  }
  dynamics.wrenches_W_ = Matrix6X::Zero(6, mechanism->num_bodies());
  dynamics.Size();
  if (q_dot0.size() > 0 && !q_dot0.isZero(0)) {
    VectorX Mq;
    Kinematics kinematics(*mechanism);
    ComputeKinematics(*mechanism, q, kinematics);
    ApplyMass(*mechanism, kinematics, q_dot0, Mq);
    dynamics.state_.w = dynamics.model_.M.ldlt().solve(dynamics.model_.Q.transpose() * Mq);
    dynamics.x_.tail(r) = dynamics.state_.w;
  }
  dynamics.UpdateConfiguration();
  return dynamics;
}

void MechanismDynamics::Size() {
  const Mechanism& m = mechanism();
  const int r = model_.size(), n = model_.num_coordinates(), nx = num_velocities();
  A_.resize(nx, nx);
  M_full_.resize(nx, nx);
  if (base_size_ > 0) {
    M_full_.topLeftCorner<6, 6>() = model_.M_00;
    M_full_.topRightCorner(6, r) = model_.M_0z;
    M_full_.bottomLeftCorner(r, 6) = model_.M_0z.transpose();
  }
  M_full_.bottomRightCorner(r, r) = model_.M;
  factor_ = Eigen::LLT<MatrixX>(nx);
  factored_h_ = -1;
  x_.resize(nx);
  if (base_size_ > 0) x_.head<6>() = state_.V_R;
  x_.tail(r) = state_.w;
  rhs_.resize(nx);
  solved_.resize(nx);
  A_inverse_.resize(nx, nx);
  momentum_.resize(nx);
  f_z_.resize(r);
  g_.resize(n);
  tau_.resize(n);
  F_.resize(6, m.num_bodies());
  M_00_ = model_.M_00;
  M_0z_ = model_.M_0z;
  M_0q_.resize(6, n);
  if (base_size_ > 0) {
    M_q_.resize(n, n);
    M_Q_.resize(n, r);
    body_V_.resize(6, m.num_bodies());
    body_A_.resize(6, m.num_bodies());
    q_dot_.resize(n);
  }
  composite_.resize(static_cast<std::size_t>(m.num_bodies()));
  if (model_.has_complement) {
    state_.q_perp = VectorX::Zero(n);
    q_perp_offset_.setZero(0);
  } else {
    state_.q_perp.resize(0);
  }
  FindParts();
  TakeReferenceForces();
}

void MechanismDynamics::TakeReferenceForces() {
  const Mechanism& m = mechanism();
  Kinematics kinematics(m);
  ComputeKinematics(m, model_.q_ref, kinematics);
  g_ref_.resize(model_.num_coordinates());
  SpringForce(m, kinematics, model_.q_ref, g_ref_);
  if (options_.recovery != Recovery::kTwist) return;
  const int r = model_.size();
  f_ref_ = model_.Q.transpose() * g_ref_;
  gravity_map_.resize(r, 3);
  base_gravity_map_.resize(6, 3);
  for (int axis = 0; axis < 3; ++axis) {
    F_.setZero();
    tau_.setZero();
    AddGravityWrenches(m, kinematics, Vector3::Unit(axis), F_);
    AccumulateGeneralizedForce(m, kinematics.S, F_, tau_);
    gravity_map_.col(axis) = model_.Q.transpose() * tau_;
    base_gravity_map_.col(axis) = F_.col(0);
  }
  const auto controls = m.controls().size();
  if (base_moves()) {
    // ξ x* (I ξ) is quadratic in ξ: its symmetric coefficients by polarisation.
    auto force = [&](const Vector6& V) {
      F_.setZero();
      tau_.setZero();
      SubtractRigidMotionWrenches(m, kinematics, V, Vector6::Zero(), F_);
      AccumulateGeneralizedForce(m, kinematics.S, F_, tau_);
      return VectorX(model_.Q.transpose() * tau_);
    };
    rigid_motion_map_.resize(r, 36);
    for (int i = 0; i < 6; ++i)
      for (int j = 0; j < 6; ++j)
        rigid_motion_map_.col(6 * i + j) = 0.5 * (force(Vector6::Unit(i) + Vector6::Unit(j)) -
                                                  force(Vector6::Unit(i)) - force(Vector6::Unit(j)));
  }
  control_map_.resize(r, static_cast<Eigen::Index>(controls));
  for (std::size_t i = 0; i < controls; ++i) {
    tau_.setZero();
    AddControlForce(m, VectorX::Unit(static_cast<Eigen::Index>(controls), static_cast<Eigen::Index>(i)),
                    tau_);
    control_map_.col(static_cast<Eigen::Index>(i)) = model_.Q.transpose() * tau_;
  }
}

void MechanismDynamics::UpdateBaseInertia() {
  if (base_size_ == 0 || options_.recovery == Recovery::kTwist) return;
  const Kinematics& kinematics = configuration_.kinematics;
  const int r = model_.size();
  FloatingMassMatrix(mechanism(), kinematics, composite_, M_q_, M_00_, M_0q_);
  M_0z_.noalias() = M_0q_ * Q_now();
  M_Q_.noalias() = M_q_ * Q_now();
  M_full_.topLeftCorner<6, 6>() = M_00_;
  M_full_.topRightCorner(6, r) = M_0z_;
  M_full_.bottomLeftCorner(r, 6) = M_0z_.transpose();
  M_full_.bottomRightCorner(r, r).noalias() = Q_now().transpose() * M_Q_;
  factored_h_ = -1;
}

void MechanismDynamics::UpdateConfiguration() {
  if (options_.recovery == Recovery::kExact) {
    Configure(model_, state_, configuration_);
    UpdateBaseInertia();
    return;
  }
  configuration_.q = model_.q_ref;
  configuration_.q.noalias() += model_.Q * state_.z;
}

void MechanismDynamics::AddWrench(BodyIndex body, const Vector3& force_W, const Vector3& moment_W,
                                  const Vector3& point_W) {
  FORK1S_REQUIRE(body.valid() && body.value() < mechanism().num_bodies(), body.value());
  wrenches_W_.col(body.value()).head<3>() += moment_W + point_W.cross(force_W);
  wrenches_W_.col(body.value()).tail<3>() += force_W;
  has_wrenches_ = true;
}

void MechanismDynamics::Factor(double h) {
  A_ = M_full_;
  A_.bottomRightCorner(model_.size(), model_.size()) += h * model_.D;
  A_.diagonal().tail(model_.size()) += h * h * model_.K_r;
  factor_.compute(A_);
  // A dense product costs less than two triangular solves; a floating base's A changes too often to invert.
  if (base_size_ == 0) {
    A_inverse_.setIdentity();
    factor_.solveInPlace(A_inverse_);
  }
  factored_h_ = h;
}

void MechanismDynamics::Solve(VectorX& x) {
  if (base_size_ > 0) {
    factor_.solveInPlace(x);
    return;
  }
  solved_.noalias() = A_inverse_ * x;
  x.swap(solved_);
}

// f_z_ and base_force_ at the present pose; q_perp follows the loads of this pose.
void MechanismDynamics::LoadForces(const Vector3& gravity_R, const Vector6& A_R) {
  const Mechanism& m = mechanism();
  if (options_.recovery == Recovery::kTwist) {
    f_z_ = f_ref_;
    f_z_ -= model_.K_r.cwiseProduct(state_.z);
    f_z_.noalias() += gravity_map_ * gravity_R;
    if (controls_.size() > 0) f_z_.noalias() += control_map_ * controls_;
    base_force_.noalias() = base_gravity_map_ * gravity_R;
    if (base_moves()) {
      f_z_.noalias() -= model_.M_0z.transpose() * A_R;
      const Matrix6 VV = state_.V_R * state_.V_R.transpose();
      f_z_.noalias() += rigid_motion_map_ * Eigen::Map<const Eigen::Matrix<double, 36, 1>>(VV.data());
    }
    if (has_wrenches_)
      for (int b = 0; b < m.num_bodies(); ++b) {
        const Vector6 F = AdjointTransposeApply(state_.X_WR, wrenches_W_.col(b));
        f_z_.noalias() += model_.T_of(BodyIndex(b)).transpose() * F;
        base_force_ += F;
      }
    return;
  }
  F_.setZero();
  if (!gravity_R.isZero(0)) AddGravityWrenches(m, configuration_.kinematics, gravity_R, F_);
  if (has_wrenches_)
    for (int b = 0; b < m.num_bodies(); ++b)
      F_.col(b) += AdjointTransposeApply(state_.X_WR, wrenches_W_.col(b));
  tau_.setZero();
  if (base_moves()) {
    // The base's own rows get the same by carrying its momentum along.
    base_force_ = F_.rowwise().sum();
    if (base_size_ > 0) {
      q_dot_.noalias() = configuration_.Q_now * state_.w;
      SubtractVelocityWrenches(m, configuration_.kinematics, state_.V_R, q_dot_, body_V_, body_A_, F_);
    } else if (!A_R.isZero(0) || !state_.V_R.isZero(0)) {
      SubtractRigidMotionWrenches(m, configuration_.kinematics, state_.V_R, A_R, F_);
    }
  }
  AccumulateGeneralizedForce(m, configuration_.kinematics.S, F_, tau_);
  if (controls_.size() > 0) AddControlForce(m, controls_, tau_);
  if (model_.has_complement) {
    g_ = g_ref_ + tau_;
    ApplyComplement(model_, g_, state_.q_perp);
    if (q_perp_offset_.size() == 0) {
      // First loads after a refresh: what they ask for at once is kept back and fades, so that nothing jumps.
      q_perp_offset_ = state_.q_perp;
    }
    state_.q_perp -= q_perp_offset_;
  }
  SpringForce(m, configuration_.kinematics, configuration_.q, g_);
  g_ += tau_;
  f_z_.noalias() = configuration_.Q_now.transpose() * g_;
}

void MechanismDynamics::Predict(double h, const Vector3& gravity_W) {
  if (h != factored_h_) Factor(h);
  const int r = model_.size();
  V_R_before_ = state_.V_R;
  gravity_W_ = gravity_W;
  guard_ = mechanism().base() != BaseKind::kDriven && options_.recovery == Recovery::kExact && !has_wrenches_;
  if (guard_) energy_budget_ = KineticEnergy() + PotentialEnergy(gravity_W);
  Vector6 A_R = Vector6::Zero();
  Vector6 V_next = state_.V_R;
  if (mechanism().base() == BaseKind::kDriven) {
    // Twist that takes the base to its next pose; its change pushes the interior by inertia.
    V_next = Log(state_.X_WR.inverse() * driven_next_) / h;
    A_R = (V_next - state_.V_R) / h;
  }
  if (base_size_ > 0) {
    // The step is taken in a frame that keeps up with the centre of mass. Left in, its velocity v enters as forces
    // m ω × v on bodies and base that cancel only at the end of an implicit step, and feed rotation once h v nears
    // the size of the mechanism.
    momentum_.noalias() = M_full_ * x_;
    drift_R_ = momentum_.segment<3>(3) / M_00_(5, 5);
    state_.V_R.tail<3>() -= drift_R_;
    V_next = state_.V_R;
  }
  LoadForces(state_.X_WR.rotation().transpose() * gravity_W, A_R);
  if (q_perp_offset_.size() > 0) q_perp_offset_ *= std::exp(-h / options_.complement_relaxation);

  if (base_size_ == 0) {
    state_.V_R = V_next;
    x_.noalias() = model_.M * state_.w;
    x_ += h * f_z_;
    Solve(x_);
  } else {
    // Base momentum is carried along by the midpoint rule; ξ⁺ enters it and is found by a short iteration.
    momentum_.noalias() -= M_full_.middleCols<3>(3) * drift_R_;
    const Vector6 p = momentum_.head<6>();
    const Vector6 V = state_.V_R;
    // Every round gains about h |V|: two or three digits at walking speed, less in a fast spin.
    constexpr int kTransportRounds = 24;
    for (int i = 0; i < kTransportRounds; ++i) {
      const RigidTransform half = Exp(0.5 * h * (V + V_next));
      rhs_.head<6>() = AdjointTransposeApply(half, p) + h * base_force_;
      rhs_.tail(r) = momentum_.tail(r) + h * f_z_;
      x_ = rhs_;
      factor_.solveInPlace(x_);
      const double change = (x_.head<6>() - V_next).cwiseAbs().maxCoeff();
      V_next = x_.head<6>();
      if (change < 1e-12 * (1 + V_next.cwiseAbs().maxCoeff())) break;
    }
    x_.segment<3>(3) += drift_R_;
    state_.V_R = V_R_before_;
  }
  if (has_wrenches_) {
    wrenches_W_.setZero();
    has_wrenches_ = false;
  }
}

// Parts are runs of velocities: with fingers on a held palm the coordinates of each stand together.
void MechanismDynamics::FindParts() {
  const int r = model_.size(), nx = num_velocities();
  std::vector<int> reach(static_cast<std::size_t>(std::max(nx, 1)));
  for (std::size_t i = 0; i < reach.size(); ++i) reach[i] = static_cast<int>(i);
  auto join = [&](int first, int last) {
    if (first <= last)
      reach[static_cast<std::size_t>(first)] = std::max(reach[static_cast<std::size_t>(first)], last);
  };
  // Zeros are exact where paths do not meet: they come from sums without terms.
  auto support = [&](auto is_zero) {
    Part run;
    int last = -1;
    for (int i = 0; i < r; ++i)
      if (!is_zero(i)) {
        if (last < 0) run.begin = i;
        last = i;
      }
    run.size = last < 0 ? 0 : last + 1 - run.begin;
    return run;
  };
  std::vector<Part> of_group, of_limited;
  for (const ContactGroup& g : groups_) {
    const auto T = model_.T_of(g.body);
    of_group.push_back(support([&](int i) { return (T.col(i).array() == 0).all(); }));
  }
  for (int k : limited_) of_limited.push_back(support([&](int i) { return model_.Q(k, i) == 0; }));
  if (base_size_ > 0 || model_.loop_rank() > 0) {
    join(0, nx - 1);
  } else {
    for (int i = 0; i < r; ++i)
      for (int j = r - 1; j > i; --j)
        if (model_.M(i, j) != 0 || model_.D(i, j) != 0) {
          join(i, j);
          break;
        }
    for (const auto* runs : {&of_group, &of_limited})
      for (const Part& run : *runs) join(run.begin, run.begin + run.size - 1);
  }
  parts_.clear();
  std::vector<int> part_of(static_cast<std::size_t>(nx), 0);
  for (int i = 0; i < nx;) {
    int last = reach[static_cast<std::size_t>(i)];
    for (int j = i; j <= last; ++j) last = std::max(last, reach[static_cast<std::size_t>(j)]);
    for (int j = i; j <= last; ++j) part_of[static_cast<std::size_t>(j)] = static_cast<int>(parts_.size());
    parts_.push_back({i, last + 1 - i});
    i = last + 1;
  }
  auto part_of_run = [&](const Part& run) {
    if (base_size_ > 0 || (model_.loop_rank() > 0 && run.size > 0)) return 0;
    return run.size == 0 ? -1 : part_of[static_cast<std::size_t>(run.begin)];
  };
  part_of_group_.clear();
  part_of_limited_.clear();
  for (const Part& run : of_group) part_of_group_.push_back(part_of_run(run));
  for (const Part& run : of_limited) part_of_limited_.push_back(std::max(0, part_of_run(run)));
}

void MechanismDynamics::GroupJacobian(int g, Eigen::Ref<Matrix6X> J) const {
  const int index = PartOfGroup(g);
  if (index < 0) return;
  const ContactGroup& group = groups_[static_cast<std::size_t>(g)];
  const Part& part = parts_[static_cast<std::size_t>(index)];
  J.setZero();
  if (base_size_ > 0) J.leftCols<6>().setIdentity();
  // Reduced coordinates of the part.
  const int first = part.begin, count = part.size - base_size_;
  auto T = J.rightCols(count);
  if (options_.recovery == Recovery::kTwist) {
    const auto T_ref = model_.T_of(group.body);
    T.noalias() = Dexp(T_ref * state_.z) * T_ref.middleCols(first, count);
    return;
  }
  const Matrix6X& S = configuration_.kinematics.S;
  for (int j = group.last_joint; j >= 0; j = mechanism().joint(JointIndex(j)).previous) {
    const auto& joint = mechanism().joint(JointIndex(j));
    for (int i = joint.offset; i < joint.offset + joint.size; ++i)
      for (int k = 0; k < count; ++k)
        if (const double q = Q_now()(i, first + k); q != 0) T.col(k) += q * S.col(i);
  }
}

Vector6 MechanismDynamics::GroupTwist(int g, const Eigen::Ref<const MatrixX>& J_T) const {
  const int index = PartOfGroup(g);
  Vector6 V = Vector6::Zero();
  if (index >= 0) {
    const Part& part = parts_[static_cast<std::size_t>(index)];
    for (int k = 0; k < part.size; ++k) V += x_(part.begin + k) * J_T.row(k).transpose();
  }
  if (mechanism().base() == BaseKind::kDriven) V += state_.V_R;
  return V;
}

RigidTransform MechanismDynamics::GroupPose(int g) const {
  return BodyPose(groups_[static_cast<std::size_t>(g)].body);
}

RigidTransform MechanismDynamics::BodyPose(BodyIndex b) const {
  if (options_.recovery == Recovery::kExact) return state_.X_WR * configuration_.kinematics.X_RB[b.u()];
  return state_.X_WR * (Exp(model_.T_of(b) * state_.z) * model_.X_RB_ref[b.u()]);
}

Vector6 MechanismDynamics::BodyVelocity(BodyIndex b) const {
  Vector6 V = state_.V_R;
  if (options_.recovery == Recovery::kTwist) {
    V += Dexp(model_.T_of(b) * state_.z) * (model_.T_of(b) * state_.w);
  } else {
    for (int j = mechanism().body(b).last_joint; j >= 0; j = mechanism().joint(JointIndex(j)).previous) {
      const auto& joint = mechanism().joint(JointIndex(j));
      for (int i = joint.offset; i < joint.offset + joint.size; ++i)
        V += configuration_.kinematics.S.col(i) * Q_now().row(i).dot(state_.w);
    }
  }
  const RigidTransform X_WB = BodyPose(b);
  const Vector6 V_W = AdjointApply(state_.X_WR, V);
  Vector6 out;
  out << V_W.head<3>(), V_W.tail<3>() + V_W.head<3>().cross(X_WB.translation());
  return out;
}

void MechanismDynamics::HalfSolve(const Part& part, Eigen::Ref<MatrixX> Jt) const {
  factor_.matrixLLT()
      .block(part.begin, part.begin, part.size, part.size)
      .triangularView<Eigen::Lower>()
      .solveInPlace(Jt);
}

void MechanismDynamics::ApplyImpulse(const VectorX& p) {
  rhs_ = p;
  Solve(rhs_);
  x_ += rhs_;
  if (guard_) energy_budget_ += std::max(0.0, p.dot(x_));
}

void MechanismDynamics::CoordinateRow(int i, const Part& part, Eigen::Ref<VectorX> row) const {
  row.setZero();
  const int count = part.size - base_size_;
  row.tail(count) = Q_now().row(i).segment(part.begin, count).transpose();
}

void MechanismDynamics::Revert() {
  state_.V_R = V_R_before_;
  if (base_size_ > 0) x_.head<6>() = V_R_before_;
  x_.tail(model_.size()) = state_.w;
}

void MechanismDynamics::Integrate(double h) {
  state_.w = x_.tail(model_.size());
  state_.z += h * state_.w;
  if (base_size_ > 0) {
    // As in Predict, beside the drift of the centre of mass, which only moves the base along.
    x_.segment<3>(3) -= drift_R_;
    Vector6 V = state_.V_R;
    V.tail<3>() -= drift_R_;
    const Vector3 drift_W = state_.X_WR.rotation() * drift_R_;
    state_.X_WR = state_.X_WR * Exp(0.5 * h * (V + x_.head<6>()));
    state_.X_WR.translation() += h * drift_W;
    state_.X_WR.Orthonormalize();
    momentum_.noalias() = M_full_ * x_;
    const Vector6 p = momentum_.head<6>();
    UpdateConfiguration();
    // The pose changed under the base: its momentum stays, its twist follows.
    if (options_.recovery == Recovery::kExact) x_.head<6>() = M_00_.llt().solve(p - M_0z_ * state_.w);
    x_.segment<3>(3).noalias() += state_.X_WR.rotation().transpose() * drift_W;
    state_.V_R = x_.head<6>();
    if (guard_) GuardEnergy();
    return;
  }
  if (mechanism().base() == BaseKind::kDriven) {
    state_.X_WR = driven_next_;
  }
  UpdateConfiguration();
  if (guard_) GuardEnergy();
}

// Velocity forces are explicit and, on a fixed base, M is that of the reference: fast motion could feed on
// either. What a step gained beyond what contact put in is taken from the motion relative to the locked
// mechanism, which leaves the momentum of a floating base as it is.
void MechanismDynamics::GuardEnergy() {
  const double excess = KineticEnergy() + PotentialEnergy(gravity_W_) - energy_budget_;
  if (!(excess > 0)) return;
  momentum_.noalias() = M_full_ * x_;
  double relative = 0.5 * x_.dot(momentum_);
  Vector6 locked = Vector6::Zero();
  if (base_size_ > 0) {
    // KE = KE_locked + s² KE_relative, without a mixed term, since the relative motion carries no base
    // momentum.
    locked = M_00_.llt().solve(momentum_.head<6>());
    relative -= 0.5 * locked.dot(M_00_ * locked);
  }
  if (!(relative > 0)) return;
  const double s = std::sqrt(std::max(0.0, 1 - excess / relative));
  x_.tail(model_.size()) *= s;
  state_.w = x_.tail(model_.size());
  if (base_size_ == 0) return;
  x_.head<6>() = locked + s * (x_.head<6>() - locked);
  state_.V_R = x_.head<6>();
}

double MechanismDynamics::Staleness() const {
  double largest = 0;
  const Mechanism& m = mechanism();
  for (int i = 0; i < model_.num_coordinates(); ++i) {
    const double moved = std::abs(configuration_.q(i) - model_.q_ref(i));
    const bool turns = m.screws().col(i).head<3>().squaredNorm() > 1e-18;
    largest = std::max(largest, turns ? moved : moved / m.length_scale());
  }
  return largest / options_.refresh_angle;
}

bool MechanismDynamics::Refresh() {
  const Mechanism& m = mechanism();
  VectorX q = configuration_.q;
  // In twist mode, and where loops were corrected in few steps, the joints get their exact closed pose first.
  if (m.num_constraints() > 0) CloseLoops(m, q);
  VectorX q_dot = configuration_.Q_now * state_.w;

  // Unsprung balls may turn for ever: their rotation vector is kept below half a turn.
  for (const Mechanism::Joint& joint : m.joints()) {
    if (joint.kind != JointKind::kBall || m.stiffness()(joint.offset) > 0) continue;
    const Vector3 v = q.segment<3>(joint.offset);
    const double angle = v.norm();
    if (angle <= M_PI) continue;
    const Vector3 wrapped = v * (1 - 2 * M_PI / angle);
    q_dot.segment<3>(joint.offset) =
        DexpInverseRotation(wrapped) * (DexpRotation(v) * q_dot.segment<3>(joint.offset));
    q.segment<3>(joint.offset) = wrapped;
  }

  auto reduced = Reduce(model_.mechanism, q, options_.reduction);
  if (!reduced) return false;

  const double energy_before = KineticEnergy();
  const Vector6 p_0 = base_size_ > 0 ? Vector6(M_full_.topRows<6>() * x_) : Vector6(Vector6::Zero());

  // Velocity by momentum: joints keep M(q) q̇ as the new coordinates see it, the base keeps its own.
  Kinematics kinematics(m);
  ComputeKinematics(m, q, kinematics);
  VectorX Mq;
  ApplyMass(m, kinematics, q_dot, Mq);
  model_ = std::move(*reduced);
  const int r = model_.size();
  VectorX p = VectorX::Zero(base_size_ + r);
  p.tail(r) = model_.Q.transpose() * Mq;
  if (base_size_ > 0) {
    p.head<6>() = p_0;
    p.tail(r) += model_.M_0z.transpose() * state_.V_R;
  }
  state_.z = VectorX::Zero(r);
  state_.w = VectorX::Zero(r);
  configuration_ = Configuration(model_);
  Size();
  VectorX x = M_full_.ldlt().solve(p);
  if (!x.allFinite()) x.setZero();
  auto energy = [&](const VectorX& v) { return 0.5 * v.dot(M_full_ * v); };
  if (energy(x) > energy_before) {
    // The stale mass matrix of the old reference may have held less: give no energy away for nothing. Rates
    // are scaled towards those at which the interior is locked, which is the least energy with this base
    // momentum.
    VectorX locked = VectorX::Zero(base_size_ + r);
    if (base_size_ > 0) locked.head<6>() = model_.M_00.ldlt().solve(p_0);
    const VectorX d = x - locked;
    const double a = 0.5 * d.dot(M_full_ * d), b = d.dot(M_full_ * locked),
                 c = energy(locked) - energy_before;
    double s = 0;
    if (c < 0 && a > 0)
      s = std::clamp((-b + std::sqrt(std::max(0.0, b * b - 4 * a * c))) / (2 * a), 0.0, 1.0);
    x = locked + s * d;
    if (base_size_ > 0)  // the base takes what momentum the slower interior left
      x.head<6>() = model_.M_00.ldlt().solve(p_0 - model_.M_0z * x.tail(r));
  }
  x_ = x;
  state_.w = x.tail(r);
  if (base_size_ > 0) state_.V_R = x.head<6>();
  UpdateConfiguration();
  return true;
}

double MechanismDynamics::KineticEnergy() const {
  double energy = 0.5 * x_.dot(M_full_ * x_);
  if (mechanism().base() == BaseKind::kDriven) {
    Matrix6 M_00 = model_.M_00;
    Matrix6X M_0z = model_.M_0z;
    if (options_.recovery == Recovery::kExact) {
      BaseInertia(mechanism(), configuration_.kinematics, M_00, M_0z);
      M_0z = (M_0z * Q_now()).eval();
    }
    energy += state_.V_R.dot(M_0z * state_.w) + 0.5 * state_.V_R.dot(M_00 * state_.V_R);
  }
  return energy;
}

double MechanismDynamics::PotentialEnergy(const Vector3& gravity_W) const {
  const Mechanism& m = mechanism();
  double energy = 0;
  if (options_.recovery == Recovery::kTwist) {
    // Springs in the coordinates that the twist mode integrates.
    energy = 0.5 * state_.z.dot(model_.K_r.cwiseProduct(state_.z)) - f_ref_.dot(state_.z);
  } else {
    energy = SpringEnergy(m, configuration_.kinematics, configuration_.q);
  }
  for (std::size_t i = 0; i < m.controls().size(); ++i) {
    const auto& control = m.controls()[i];
    const double u = controls_(static_cast<Eigen::Index>(i));
    for (const auto& [k, c] : control.terms) energy -= control.gain * u * c * configuration_.q(k);
    if (m.definition().controls[i].is_setpoint) energy += 0.5 * control.gain * u * u;
  }
  for (int b = 0; b < m.num_bodies(); ++b) {
    const SpatialInertia& I = m.bodies()[static_cast<std::size_t>(b)].inertia_B;
    if (I.mass > 0) energy -= I.mass * gravity_W.dot(BodyPose(BodyIndex(b)) * I.center);
  }
  return energy;
}

double MechanismDynamics::ClosureGapNow() const {
  if (mechanism().num_constraints() == 0) return 0;
  if (options_.recovery == Recovery::kExact)
    return ClosureGap(mechanism(), configuration_.kinematics, configuration_.q);
  Kinematics kinematics(mechanism());
  for (int b = 0; b < mechanism().num_bodies(); ++b)
    kinematics.X_RB[static_cast<std::size_t>(b)] =
        Exp(model_.T_of(BodyIndex(b)) * state_.z) * model_.X_RB_ref[static_cast<std::size_t>(b)];
  return ClosureGap(mechanism(), kinematics, configuration_.q);
}

}  // namespace fork1s
