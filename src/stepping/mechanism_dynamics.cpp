#include <fork1s/stepping/mechanism_dynamics.hpp>

#include "linalg/cholesky.hpp"
#include "mechanism/activation.hpp"
#include "mechanism_detail.hpp"

namespace fork1s {

MechanismDynamics::MechanismDynamics(MechanismState state, std::unique_ptr<MechanismWorkspace> work)
    : state_(std::move(state)), work_(std::move(work)) {}

MechanismDynamics::~MechanismDynamics() = default;
MechanismDynamics::MechanismDynamics(MechanismDynamics&&) noexcept = default;
MechanismDynamics& MechanismDynamics::operator=(MechanismDynamics&&) noexcept = default;

MechanismDynamics::MechanismDynamics(const MechanismDynamics& other)
    : state_(other.state_), work_(std::make_unique<MechanismWorkspace>(*other.work_)) {}

MechanismDynamics& MechanismDynamics::operator=(const MechanismDynamics& other) {
  return *this = MechanismDynamics(other);
}

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
  MechanismState start;
  start.reduced.X_WR = X_WR;
  start.reduced.V_R = mechanism->base() == BaseKind::kFixed ? Vector6(Vector6::Zero()) : V_R;
  start.driven_next = X_WR;
  start.controls.resize(static_cast<Eigen::Index>(mechanism->controls().size()));
  for (std::size_t i = 0; i < mechanism->controls().size(); ++i)
    start.controls(static_cast<Eigen::Index>(i)) = mechanism->controls()[i].initial;
  ReductionLoads loads = LoadsOf(options, start, {}, {});
  start.activation = internal::InitialActivation(mechanism->definition());
  for (Eigen::Index k = 0; k < start.activation.size(); ++k)
    if (mechanism->definition().controls[static_cast<std::size_t>(k)].dynamics != ControlDynamics::kNone)
      loads.controls(k) = start.activation(k);
  auto reduced = Reduce(mechanism, q, options.reduction, &loads);
  if (!reduced) return tl::unexpected(reduced.error());
  if (options.recovery == Recovery::kCurved) reduced->curvature = LoopCurvature(*reduced);
  start.model = std::make_shared<const ReducedModel>(std::move(*reduced));
  const auto model = std::make_shared<const MechanismModel>(start.model, options);
  start.step_model = model;
  const int r = model->size();
  start.reduced.z = VectorX::Zero(r);
  start.reduced.w = VectorX::Zero(r);
  start.controls_from = start.controls;
  start.loads.resize(static_cast<std::size_t>(mechanism->num_bodies()));
  start.at_bound.resize(mechanism->force_limits().size(), 0);

  StartAtReference(*model, start);
  MechanismDynamics dynamics(std::move(start), std::make_unique<MechanismWorkspace>(*model));
  const StepContext ctx = dynamics;
  Size(ctx);
  if (q_dot0.size() > 0 && !q_dot0.isZero(0)) {
    VectorX Mq;
    Kinematics kinematics(*mechanism);
    ComputeKinematics(*mechanism, q, kinematics);
    ApplyMass(*mechanism, kinematics, q_dot0, Mq);
    ctx.state.reduced.w = SolveSymmetric(model->reduced->M, model->reduced->Q.transpose() * Mq);
    ctx.work.x.tail(r) = ctx.state.reduced.w;
  }
  UpdateConfiguration(ctx);
  ctx.state.mu = ctx.work.configuration.mu;
  StartExpansions(ctx);
  return dynamics;
}

MechanismDynamics::operator StepContext() { return {*state_.step_model, state_, *work_}; }
MechanismDynamics::operator ConstStepContext() const { return {*state_.step_model, state_, *work_}; }

const Configuration& MechanismDynamics::configuration() const { return ConfigurationOf(*this); }
const std::vector<ContactGroup>& MechanismDynamics::groups() const { return step_model().groups; }
Recovery MechanismDynamics::recovery() const { return step_model().options.recovery; }
bool MechanismDynamics::is_expanded() const { return work_->expansion.in_use; }
bool MechanismDynamics::went_by_expansion() const { return work_->start.by_expansion; }
int MechanismDynamics::num_velocities() const { return step_model().num_velocities(); }
const std::vector<Mechanism::LengthLimit>& MechanismDynamics::length_limits() const {
  return mechanism().length_limits();
}
const std::vector<std::string>& MechanismDynamics::warnings() const { return step_model().warnings; }

void MechanismDynamics::AddWrench(BodyIndex body, const Vector3& force_W, const Vector3& moment_W,
                                  const Vector3& point_W) {
  fork1s::AddWrench(*this, body, force_W, moment_W, point_W);
}
void MechanismDynamics::SetPointSpring(BodyIndex body, const PointSpring& spring) {
  fork1s::SetPointSpring(*this, body, spring);
}
LinearizationDrift MechanismDynamics::ComputeLinearizationDrift() const {
  return fork1s::ComputeLinearizationDrift(*this);
}
bool MechanismDynamics::Refresh() { return fork1s::Refresh(state_, *work_); }
void MechanismDynamics::Restore(const MechanismState& saved) { fork1s::Restore(state_, *work_, saved); }

void MechanismDynamics::SetClosingTolerance(double tolerance) {
  work_->configuration.closing_tolerance = tolerance;
}

void MechanismDynamics::SetActivation(const VectorX& activation) {
  FORK1S_REQUIRE(activation.size() == state_.controls.size(), activation.size(), state_.controls.size());
  const auto& controls = mechanism().definition().controls;
  for (Eigen::Index k = 0; k < state_.activation.size(); ++k)
    if (controls[static_cast<std::size_t>(k)].dynamics != ControlDynamics::kNone)
      state_.activation(k) = activation(k);
}

int MechanismDynamics::NumForcesAtBound() const { return fork1s::NumForcesAtBound(state_); }
double MechanismDynamics::Length(const Mechanism::Length& length) const {
  return fork1s::Length(*this, length);
}
void MechanismDynamics::AddLengthForce(const Mechanism::Length& length, double force, VectorX& tau) const {
  fork1s::AddLengthForce(*this, length, force, tau);
}
double MechanismDynamics::KineticEnergy() const { return fork1s::KineticEnergy(*this); }
double MechanismDynamics::PotentialEnergy(const Vector3& gravity_W) const {
  return fork1s::PotentialEnergy(*this, gravity_W);
}
double MechanismDynamics::ClosureGapNow() const { return fork1s::ClosureGapNow(*this); }
RigidTransform MechanismDynamics::BodyPose(BodyIndex b) const { return fork1s::BodyPose(*this, b); }
void MechanismDynamics::BodyPoses(std::vector<RigidTransform>& X_RB) const { fork1s::BodyPoses(*this, X_RB); }
Vector6 MechanismDynamics::BodyVelocity(BodyIndex b) const { return fork1s::BodyVelocity(*this, b); }

void MechanismDynamics::ComputeLoadWrenches_W(Matrix6X& F) const {
  F.setZero(6, mechanism().num_bodies());
  AddLoadWrenches(*this, F);
  const RigidTransform X_RW = state_.reduced.X_WR.inverse();
  for (Eigen::Index b = 0; b < F.cols(); ++b)
    if (!F.col(b).isZero(0)) F.col(b) = AdjointTransposeApply(X_RW, F.col(b));
}

}  // namespace fork1s
