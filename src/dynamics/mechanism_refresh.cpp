// Moving the reference to the present pose.
#include <fork1s/dynamics/mechanism_dynamics.hpp>

#include <algorithm>
#include <cmath>
#include <fork1s/linalg/cholesky.hpp>
#include <fork1s/reduction/reduce_again.hpp>

namespace fork1s {

namespace {

// q, which steps close to far below what is seen, closed to rounding, and its kinematics: by chords with the
// factor of this very pose, each of which squares what is open. False where that does not end, as where loops
// repeat each other but for the digits of a file.
bool CloseByChords(const ReducedModel& model, const Configuration& at, VectorX& q, Kinematics& kinematics) {
  const Mechanism& m = *model.mechanism;
  const bool all_rows = model.loop_rank() == m.num_constraints();
  VectorX c, d(model.loop_rank()), before;
  LoopFactor own;
  const LoopFactor* factor = &at.factor;
  if (model.curvature.exists()) {  // no step has factored A B
    VectorX A;
    model.loops.Fill(m, at.kinematics, at.q, A);
    own = LoopFactor(model.loops);
    own.Compute(model.loops, A, model.B);
    factor = &own;
  }
  q = at.q;
  kinematics = at.kinematics;
  for (int chords = 0;; ++chords) {
    if (ClosureGap(m, kinematics, q) < 1e-13 * m.length_scale()) return true;
    if (chords == 3) return false;
    ClosureResidual(m, kinematics, q, c);
    for (int k = 0; k < model.loop_rank(); ++k) d(k) = c(model.loops.row(k));
    factor->SolveInPlace(d);
    before = q;
    model.loops.SubtractTransposed(model.B, d, q);
    const double step = (q - before).cwiseAbs().maxCoeff();
    if (!std::isfinite(step)) return false;
    ComputeKinematics(m, q, kinematics);
    if (all_rows && step < 1e-15) return true;
  }
}

}  // namespace

// Of a coordinate since the reference, rad; of a slide in lengths of the mechanism.
double MechanismDynamics::Turn(int i) const {
  const double moved = std::abs(configuration_.q(i) - model().q_ref(i));
  const bool turns = mechanism().screws().col(i).head<3>().squaredNorm() > 1e-18;
  return turns ? moved : moved / mechanism().length_scale();
}

// By twists every joint counts: the one twist of a wheel is that of all joints on its path.
double MechanismDynamics::Staleness(bool second_order) const {
  const bool exact = options_.recovery != Recovery::kTwist;
  double largest = 0;
  for (int i = 0; i < model().num_coordinates(); ++i) {
    const auto at = static_cast<std::size_t>(i);
    const bool ages = !exact || !(spins_[at] || (whole_[at] && !second_order));
    if (ages) largest = std::max(largest, Turn(i));
  }
  largest /= options_.refresh_angle;
  if (model().curvature.exists()) largest = std::max(largest, ClosureGapNow() / options_.refresh_gap);
  return largest;
}

bool MechanismDynamics::Refresh() {
  const Mechanism& m = mechanism();
  VectorX q = configuration_.q;
  Kinematics kinematics(m);
  if (m.num_constraints() == 0) {
    ComputeKinematics(m, q, kinematics);
  } else if (options_.recovery == Recovery::kTwist ||
             !CloseByChords(model(), configuration_, q, kinematics)) {
    // In twist mode, and where loops were corrected in few steps, the joints get their exact closed pose
    // first.
    q = configuration_.q;
    CloseLoops(m, q);
    ComputeKinematics(m, q, kinematics);
  }
  VectorX q_dot = configuration_.Q_now * state_.reduced.w;
  const bool knows_past = state_.past.h > 0 && model().size() > 0;
  const VectorX q_moved = knows_past ? VectorX(configuration_.Q_now * state_.past.z_moved) : VectorX();

  // Unsprung balls may turn for ever: their rotation vector is kept below half a turn.
  bool rewritten = false;
  for (const Mechanism::Joint& joint : m.joints()) {
    if (joint.kind != JointKind::kBall || m.stiffness()(joint.offset) > 0) continue;
    const Vector3 v = q.segment<3>(joint.offset);
    const double angle = v.norm();
    if (angle <= M_PI) continue;
    const Vector3 wrapped = v * (1 - 2 * M_PI / angle);
    const Matrix3 rewrite = DexpInverseRotation(wrapped) * DexpRotation(v);
    q_dot.segment<3>(joint.offset) = rewrite * q_dot.segment<3>(joint.offset);
    q.segment<3>(joint.offset) = wrapped;
    rewritten = true;
  }
  if (rewritten) ComputeKinematics(m, q, kinematics);

  auto reduced = ReduceAgain(model(), q, kinematics, options_.reduction);
  if (!reduced) return false;
  if (options_.recovery == Recovery::kCurved) reduced->curvature = LoopCurvature(*reduced);

  MechanismState before;
  Save(before);
  const Vector6 p_0 = base_size_ > 0 ? Vector6(M_full_.topRows<6>() * x_) : Vector6(Vector6::Zero());

  // Velocity by momentum: joints keep M(q) q̇ as the new coordinates see it, the base keeps its own.
  VectorX Mq;
  ApplyMass(m, kinematics, q_dot, Mq);
  state_.model = std::make_shared<const ReducedModel>(std::move(*reduced));
  const int r = model().size();
  VectorX p = VectorX::Zero(base_size_ + r);
  p.tail(r) = model().Q.transpose() * Mq;
  if (base_size_ > 0) {
    p.head<6>() = p_0;
    p.tail(r) += model().M_0z.transpose() * state_.reduced.V_R;
  }
  state_.reduced.z = VectorX::Zero(r);
  state_.reduced.w = VectorX::Zero(r);
  configuration_ = elsewhere_ = Configuration(model());
  jacobian_ = ReducedJacobian(model());
  inertia_ = ReducedInertia(model());
  StartAtReference();
  Size();
  VectorX x = SolveSymmetric(M_full_, p);
  if (!x.allFinite()) {
    Restore(before);
    return false;
  }
  x_ = x;
  if (rewritten)
    state_.past.h = 0;
  else if (knows_past) {
    ApplyMass(m, kinematics, q_moved, Mq);
    state_.past.z_moved = SolveSymmetric(model().M, model().Q.transpose() * Mq);
  }
  state_.reduced.w = x.tail(r);
  if (base_size_ > 0) state_.reduced.V_R = x.head<6>();
  UpdateConfiguration();
  return true;
}

}  // namespace fork1s
