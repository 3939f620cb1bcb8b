// Lengths that springs, stops and motors act on: what they are and how they change at the present pose.
#include <algorithm>
#include <cmath>
#include <fork1s/dynamics/mechanism_dynamics.hpp>
#include <fork1s/linalg/rank.hpp>

namespace fork1s {

void MechanismDynamics::LengthRow(const Mechanism::Length& length, const Part& part,
                                  Eigen::Ref<VectorX> row) const {
  row.setZero();
  const int count = part.size - base_size_;
  double unit = 0;
  ForEachArm(length, Paths(), [&](int i, double c) {
    row.tail(count) += c * Q_now().row(i).segment(part.begin, count).transpose();
    unit += std::abs(c) * std::sqrt(model().h_inverse(i));
  });
  // Where loops hold a joint its row is the rounding of their closing. Nothing moves it, and a stop or dry
  // friction that pushed with such a lever would push with the inverse of rounding.
  const auto reach = coordinate_reach_.segment(part.begin, count).array();
  if (!(row.tail(count).array().abs() > kRankThreshold * unit * reach).any()) row.setZero();
}

double MechanismDynamics::LengthRate(const Mechanism::Length& length) const {
  double rate = 0;
  ForEachArm(length, Paths(),
             [&](int i, double c) { rate += c * Q_now().row(i).dot(x_.tail(model().size())); });
  return rate;
}

double MechanismDynamics::Length(const Mechanism::Length& length) const {
  double value = LengthOf(mechanism(), length, configuration_.kinematics, configuration_.q);
  // In twist mode paths are those of the reference, and lengths go on along their arms.
  if (length.path >= 0 && options_.recovery == Recovery::kTwist)
    for (const auto& [i, arm] : Paths()[static_cast<std::size_t>(length.path)].arms)
      value += length.gear * arm * (configuration_.q(i) - model().q_ref(i));
  return value;
}

void MechanismDynamics::AddLengthForce(const Mechanism::Length& length, double force, VectorX& tau) const {
  ForEachArm(length, Paths(), [&](int i, double c) { tau(i) += c * force; });
}

// out = Qᵀ ∂ℓ/∂q
void MechanismDynamics::ReducedRow(const Mechanism::Length& length, const std::vector<PathState>& paths,
                                   const RowMatrixX& Q, VectorX& out) const {
  out.setZero();
  ForEachArm(length, paths, [&](int i, double c) { out.noalias() += c * Q.row(i).transpose(); });
}

// A += weight e eᵀ, e the row that the spring of a length has in A: that of the pose for a path or a spring
// that is not linear in a step of implicit Euler, else that of the reference, as in K_r.
void MechanismDynamics::AddSpringOf(const Mechanism::Length& length, double weight, bool bends) {
  auto A_z = A_.bottomRightCorner(model().size(), model().size());
  if ((bends || length.path >= 0) && ActsAtPose())
    ReducedRow(length, Paths(), Q_now(), limit_row_);
  else
    ReducedRow(length, paths_ref_, model().Q_rows, limit_row_);
  A_z.noalias() += weight * limit_row_ * limit_row_.transpose();
}

// Springs and dampers of paths stand in K_r and D as they are at the reference. A thread's arms may double
// before the next refresh, and a stiff spring that A knows by half would swing up: in A they turn with the
// pose. A step of second order keeps the reference's, and looks for the end of a step anew where springs bend
// (theta_minimum.cpp); the dampers' arms are those of the last refresh there.
//
// Springs and dampers that are not linear likewise, by the stiffness and the damping of the pose and its
// rates.
void MechanismDynamics::TurnSprings(double h) {
  if (!has_bent_springs_) return;
  auto A_z = A_.bottomRightCorner(model().size(), model().size());
  const auto& springs = mechanism().springs();
  auto slack = slack_.begin();
  for (std::size_t k = 0; k < springs.size(); ++k) {
    const Mechanism::Spring& s = springs[k];
    if (s.length.path < 0 && s.is_linear()) continue;
    const double stiffness = s.slack > 0 ? SlackStiffness(*slack++) : s.StiffnessAt(Length(s.length));
    double rate = 0;
    ForEachArm(s.length, Paths(), [&](int i, double c) { rate += c * Q_now().row(i).dot(state_.reduced.w); });
    const double reference = h * (h * spring_stiffness_ref_[k] + order_ * s.DampingAt(0)),
                 now = h * (h * stiffness + order_ * s.DampingAt(rate));
    ReducedRow(s.length, paths_ref_, model().Q_rows, limit_row_);
    A_z.noalias() -= reference * limit_row_ * limit_row_.transpose();
    AddSpringOf(s.length, now, true);
  }
}

// Dampers of joints by the columns that move them, and what they are in D of the model.
void MechanismDynamics::FindDampers() {
  const VectorX& damping = mechanism().damping();
  dampers_.clear();
  for (int i = 0; i < damping.size(); ++i) {
    if (!(damping(i) > 0)) continue;
    const ReducedModel::Run run = model().runs[static_cast<std::size_t>(i)];
    auto at = std::find_if(dampers_.begin(), dampers_.end(), [&](const WeightedRows& rows) {
      return rows.begin == run.begin && rows.size == run.size;
    });
    if (at == dampers_.end()) at = dampers_.insert(at, {run.begin, run.size, {}, {}});
    at->rows.push_back(i);
    at->weights.push_back(damping(i));
  }
  joint_damping_ref_.setZero(model().size(), model().size());
  for (const WeightedRows& rows : dampers_) AddRowSquares(model().Q_rows, rows, 1, joint_damping_ref_);
}

// K_beyond_: what springs that bend, and servos that turn, are stiff by at this pose beyond what K_r has of them.
void MechanismDynamics::TakeStiffnessBeyond() {
  const auto& springs = mechanism().springs();
  K_beyond_.setZero(model().size(), model().size());
  if (ServosTurn())
    for (const Mechanism::ForceLimit& limit : mechanism().force_limits()) {
      if (!(limit.stiffness > 0)) continue;
      ReducedRow(limit.length, Paths(), Q_now(), limit_row_);
      K_beyond_.noalias() += limit.stiffness * limit_row_ * limit_row_.transpose();
      ReducedRow(limit.length, paths_ref_, model().Q_rows, limit_row_);
      K_beyond_.noalias() -= limit.stiffness * limit_row_ * limit_row_.transpose();
    }
  for (std::size_t k = 0; k < springs.size(); ++k) {
    const Mechanism::Spring& s = springs[k];
    if (s.length.path < 0 && s.is_linear()) continue;
    ReducedRow(s.length, Paths(), Q_now(), limit_row_);
    K_beyond_.noalias() += s.StiffnessAt(Length(s.length)) * limit_row_ * limit_row_.transpose();
    ReducedRow(s.length, paths_ref_, model().Q_rows, limit_row_);
    K_beyond_.noalias() -= spring_stiffness_ref_[k] * limit_row_ * limit_row_.transpose();
  }
}

// Loops turn Q as the pose moves, and with it what dampers of joints and of straight tendons are in reduced
// coordinates. Springs too, but their forces are those of the pose wherever A has its stiffness; a damper acts through
// A alone. Springy closures keep the damping of the reference.
bool MechanismDynamics::DampersTurn() const {
  return model().loop_rank() > 0 && options_.recovery != Recovery::kTwist;
}

// D += weight times what dampers are here beyond what D of the model has of them, those of springs that are
// not linear, where `bent`, at the rates of w.
void MechanismDynamics::AddDampersBeyond(double weight, bool bent, const VectorX& w, Eigen::Ref<MatrixX> D) {
  const Mechanism& m = mechanism();
  const bool turn = DampersTurn();
  if (turn) {
    D -= weight * joint_damping_ref_;
    for (const WeightedRows& rows : dampers_) AddRowSquares(Q_now(), rows, weight, D);
  }
  for (const Mechanism::Spring& s : m.springs()) {
    const bool bends = s.length.path >= 0 || !s.is_linear();
    if (bends ? !bent : !turn || s.damping == 0) continue;
    ReducedRow(s.length, Paths(), Q_now(), limit_row_);
    D.noalias() += weight * s.DampingAt(limit_row_.dot(w)) * limit_row_ * limit_row_.transpose();
    ReducedRow(s.length, paths_ref_, model().Q_rows, limit_row_);
    D.noalias() -= weight * s.DampingAt(0) * limit_row_ * limit_row_.transpose();
  }
}

void MechanismDynamics::TurnDampers(double h) {
  if (DampersTurn())
    AddDampersBeyond(order_ * h, false, state_.reduced.w,
                     A_.bottomRightCorner(model().size(), model().size()));
}

}  // namespace fork1s
