#include <fork1s/dynamics/mechanism_dynamics.hpp>

#include <algorithm>
#include <cmath>
#include <fork1s/linalg/cholesky.hpp>
#include <fork1s/recovery/recover.hpp>
#include <fork1s/reduction/whole_groups.hpp>

#include "spinning.hpp"

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

MechanismState StateOf(ReducedModel model) {
  MechanismState state;
  state.model = std::make_shared<const ReducedModel>(std::move(model));
  return state;
}

}  // namespace

MechanismDynamics::MechanismDynamics(ReducedModel model)
    : state_(StateOf(std::move(model))),
      configuration_(*state_.model),
      rigid_parts_(*state_.model->mechanism),
      jacobian_(*state_.model),
      inertia_(*state_.model),
      groups_(MakeGroups(*state_.model)),
      elsewhere_(*state_.model) {}

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
  if (options.recovery == Recovery::kCurved) model->curvature = LoopCurvature(*model);
  MechanismDynamics dynamics(std::move(*model));
  dynamics.options_ = options;
  // The interfaces that Reduce settled on are those of every later refresh.
  dynamics.options_.reduction.interfaces = dynamics.model().interfaces;
  dynamics.options_.reduction.promote_hidden = false;
  dynamics.base_size_ = mechanism->base() == BaseKind::kFloating ? 6 : 0;
  const int r = dynamics.model().size();
  dynamics.state_.reduced.z = VectorX::Zero(r);
  dynamics.state_.reduced.w = VectorX::Zero(r);
  dynamics.state_.reduced.X_WR = X_WR;
  dynamics.state_.reduced.V_R = mechanism->base() == BaseKind::kFixed ? Vector6(Vector6::Zero()) : V_R;
  dynamics.state_.driven_next = X_WR;
  dynamics.state_.controls.resize(static_cast<Eigen::Index>(mechanism->controls().size()));
  dynamics.state_.controls_from = dynamics.state_.controls;
  for (std::size_t i = 0; i < mechanism->controls().size(); ++i)
    dynamics.state_.controls(static_cast<Eigen::Index>(i)) = mechanism->controls()[i].initial;
  // A pose outside the limits may be what springs and loops hold; pushing it inside would fight them for
  // ever.
  dynamics.warnings_ = dynamics.model().warnings;
  dynamics.length_limits_ = mechanism->length_limits();
  Kinematics start(*mechanism);
  ComputeKinematics(*mechanism, q, start);
  for (Mechanism::LengthLimit& limit : dynamics.length_limits_) {
    const double length = LengthOf(*mechanism, limit.length, start, q);
    const double outside = std::max(limit.lower - length, length - limit.upper);
    limit.lower = std::min(limit.lower, length);
    limit.upper = std::max(limit.upper, length);
    if (outside > 1e-3)
      dynamics.warnings_.push_back(limit.WhatAndName() + " starts outside its limits by " +
                                   std::to_string(outside) +
                                   " (rad or m); the limit was moved to the initial pose");
  }
  dynamics.state_.wrenches_W = Matrix6X::Zero(6, mechanism->num_bodies());
  dynamics.spins_ = internal::FindSpinning(*mechanism, dynamics.rigid_parts_, dynamics.model().interfaces);
  dynamics.StartAtReference();
  dynamics.Size();
  if (q_dot0.size() > 0 && !q_dot0.isZero(0)) {
    VectorX Mq;
    Kinematics kinematics(*mechanism);
    ComputeKinematics(*mechanism, q, kinematics);
    ApplyMass(*mechanism, kinematics, q_dot0, Mq);
    dynamics.state_.reduced.w = SolveSymmetric(dynamics.model().M, dynamics.model().Q.transpose() * Mq);
    dynamics.x_.tail(r) = dynamics.state_.reduced.w;
  }
  dynamics.UpdateConfiguration();
  return dynamics;
}

// What a new reference makes of the interior's own displacement and of the last step.
void MechanismDynamics::StartAtReference() {
  const int n = model().num_coordinates();
  state_.mu.setZero(configuration_.mu.size());
  state_.q_perp_offset.resize(0);
  if (model().has_complement)
    state_.reduced.q_perp = VectorX::Zero(n);
  else
    state_.reduced.q_perp.resize(0);
}

void MechanismDynamics::Save(MechanismState& out) const {
  out = state_;
  out.mu = configuration_.mu;
}

void MechanismDynamics::Restore(const MechanismState& state) {
  const bool same_model = state.model == state_.model;
  state_ = state;
  if (!same_model) {
    configuration_ = elsewhere_ = Configuration(model());
    jacobian_ = ReducedJacobian(model());
    inertia_ = ReducedInertia(model());
    Size();
  }
  x_.tail(model().size()) = state_.reduced.w;
  if (base_size_ > 0) x_.head<6>() = state_.reduced.V_R;
  rule_ = StepRule::kEuler;
  factored_h_ = -1;
  configuration_.mu = state_.mu;
  UpdateConfiguration(true);
}

// Scratch of the sizes of the model.
void MechanismDynamics::Size() {
  const Mechanism& m = mechanism();
  const int r = model().size(), n = model().num_coordinates(), nx = num_velocities();
  A_.resize(nx, nx);
  M_full_.resize(nx, nx);
  if (base_size_ > 0) {
    M_full_.topLeftCorner<6, 6>() = model().M_00;
    M_full_.topRightCorner(6, r) = model().M_0z;
    M_full_.bottomLeftCorner(r, 6) = model().M_0z.transpose();
  }
  M_full_.bottomRightCorner(r, r) = model().M;
  factor_ = Cholesky();
  factor_.Compute(MatrixX::Identity(std::max(nx, 1), std::max(nx, 1)));
  factored_h_ = -1;
  x_.resize(nx);
  if (base_size_ > 0) x_.head<6>() = state_.reduced.V_R;
  x_.tail(r) = state_.reduced.w;
  rhs_.resize(nx);
  solved_.resize(nx);
  z_before_.resize(r);
  w_before_.resize(r);
  momentum_.resize(nx);
  f_z_.resize(r);
  g_.resize(n);
  tau_.resize(n);
  F_.resize(6, m.num_bodies());
  M_00_ = model().M_00;
  M_0z_ = model().M_0z;
  if (options_.recovery != Recovery::kTwist) q_dot_.resize(n);
  q_ddot_.setZero(n);
  coordinate_reach_.setZero(r);
  if (n > 0 && r > 0)
    coordinate_reach_ = (model().h_inverse.cwiseSqrt().cwiseInverse().asDiagonal() * model().Q)
                          .cwiseAbs()
                          .colwise()
                          .maxCoeff();
  FindDampers();
  whole_ = FindWhole(model());
  SizeForceLimits();
  FindParts();
  SizeTheta();
  TakeReferenceForces();
}

// M of the present pose: O(joints x coordinates that reach them).
void MechanismDynamics::UpdateInertia() {
  jacobian_.Compute(model(), configuration_);
  const int r = model().size();
  inertia_.Compute(model(), rigid_parts_, configuration_, jacobian_, M_full_.bottomRightCorner(r, r), M_0z_,
                   M_00_);
  if (base_size_ > 0) {
    M_full_.topLeftCorner<6, 6>() = M_00_;
    M_full_.topRightCorner(6, r) = M_0z_;
    M_full_.bottomLeftCorner(r, 6) = M_0z_.transpose();
  }
  factored_h_ = -1;
}

void MechanismDynamics::UpdateConfiguration(bool loops_are_closed) {
  pose_energy_.valid = false;
  if (options_.recovery != Recovery::kTwist) {
    if (loops_are_closed)
      ConfigureClosed(model(), state_.reduced, configuration_);
    else
      Configure(model(), state_.reduced, configuration_);
    UpdateInertia();
    return;
  }
  configuration_.q = model().q_ref;
  AddMotion(model(), model().Q_rows, state_.reduced.z, configuration_.q);
}

void MechanismDynamics::AddWrench(BodyIndex body, const Vector3& force_W, const Vector3& moment_W,
                                  const Vector3& point_W) {
  FORK1S_REQUIRE(body.valid() && body.value() < mechanism().num_bodies(), body.value());
  state_.wrenches_W.col(body.value()).head<3>() += moment_W + point_W.cross(force_W);
  state_.wrenches_W.col(body.value()).tail<3>() += force_W;
  state_.has_wrenches = true;
}

void MechanismDynamics::SetInputsWithin(const MechanismState& start, double share) {
  state_.wrenches_W = start.wrenches_W;
  state_.has_wrenches = start.has_wrenches;
  state_.driven_next = start.driven_next;
  state_.controls = start.controls;
  if (share >= 1) return;
  const RigidTransform& X = start.reduced.X_WR;
  state_.driven_next = X * Exp(share * Log(X.inverse() * start.driven_next));
  if (start.controls_move)
    state_.controls = start.controls_from + share * (start.controls - start.controls_from);
}

RigidTransform MechanismDynamics::GroupPose(int g) const {
  return BodyPose(groups_[static_cast<std::size_t>(g)].body);
}

RigidTransform MechanismDynamics::BodyPose(BodyIndex b) const {
  if (options_.recovery != Recovery::kTwist)
    return state_.reduced.X_WR * configuration_.kinematics.X_RB[b.u()];
  return state_.reduced.X_WR * RecoverPoseTwist(model(), state_.reduced, b);
}

void MechanismDynamics::BodyPoses(std::vector<RigidTransform>& X_RB) const {
  if (options_.recovery == Recovery::kTwist)
    RecoverPosesTwist(model(), state_.reduced, X_RB);
  else
    X_RB = configuration_.kinematics.X_RB;
}

Vector6 MechanismDynamics::BodyVelocity(BodyIndex b) const {
  Vector6 V = state_.reduced.V_R;
  if (options_.recovery == Recovery::kTwist) {
    V += Dexp(model().T_of(b) * state_.reduced.z) * (model().T_of(b) * state_.reduced.w);
  } else if (const int j = mechanism().body(b).last_joint; j >= 0) {
    const auto T = jacobian_.T(j);
    for (int k = 0; k < T.cols(); ++k) V += state_.reduced.w(jacobian_.begin(j) + k) * T.col(k);
  }
  const RigidTransform X_WB = BodyPose(b);
  const Vector6 V_W = AdjointApply(state_.reduced.X_WR, V);
  Vector6 out;
  out << V_W.head<3>(), V_W.tail<3>() + V_W.head<3>().cross(X_WB.translation());
  return out;
}

double MechanismDynamics::ClosureGapNow() const {
  if (mechanism().num_constraints() == 0) return 0;
  if (options_.recovery != Recovery::kTwist)
    return ClosureGap(mechanism(), configuration_.kinematics, configuration_.q);
  Kinematics kinematics(mechanism());
  BodyPoses(kinematics.X_RB);
  return ClosureGap(mechanism(), kinematics, configuration_.q);
}

}  // namespace fork1s
