// One Newton iteration of a step in full coordinates.
#include <algorithm>
#include <cmath>

#include "full_mechanism.hpp"

#include "linalg/products.hpp"
#include "mechanism/periodic_rotation.hpp"

namespace fork1s::internal {
namespace {

// A force whose direction stays in the world, seen from a body that turns by δ: F changes by (Rᵀf) x δ. The
// symmetric part on [δ; translation], with the arm at which it acts.
Matrix6 DeadForceStiffness(const Vector3& arm_B, const Vector3& force_B) {
  const Matrix3 f = Skew(force_B);
  const Matrix3 turn = Skew(arm_B) * f;
  Matrix6 K;
  K << 0.5 * (turn + turn.transpose()), 0.5 * f.transpose(), 0.5 * f, Matrix3::Zero();
  return K;
}

}  // namespace

double FullMechanism::ServoForce(const Mechanism::ForceLimit& limit, const VectorX& q) const {
  double force = limit.stiffness * (limit.rest - Length(limit.length, q));
  for (const auto& [i, share] : limit.inputs) force += share * controls(i);
  return force;
}

VectorX FullMechanism::Unknowns() const {
  VectorX u(num_unknowns());
  for (std::size_t b = 0; b < X_.size(); ++b)
    if (column_[b] >= 0) u.segment<6>(column_[b]) = V_next_.col(static_cast<Eigen::Index>(b));
  u.segment(num_body_columns_, mechanism_->num_coordinates()) = q_dot_next_;
  u.tail(num_rows_) = nu_next_;
  return u;
}

void FullMechanism::StartMomenta() {
  momentum_.resize(6, static_cast<Eigen::Index>(X_.size()));
  for (std::size_t b = 0; b < X_.size(); ++b)
    momentum_.col(static_cast<Eigen::Index>(b)) = inertia_[b] * V_.col(static_cast<Eigen::Index>(b));
  rates_start_ = JointVelocities(q_, q_dot_);
}

bool FullMechanism::Begin(double h, const Vector3& gravity_W) {
  h_ = h;
  gravity_W_ = gravity_W;
  stage_ = false;
  StartMomenta();
  V_next_ = V_;
  q_dot_next_ = q_dot_;
  nu_next_ = h_last_ > 0 ? VectorX(nu_ * (h / h_last_)) : nu_;
  X_next_ = X_;
  q_next_ = q_;
  if (mechanism_->base() == BaseKind::kDriven) V_next_.col(0) = Log(X_[0].inverse() * driven_next) / h;
  drift_W_.setZero();
  if (mechanism_->base() == BaseKind::kFloating) drift_W_ = Drift(X_, V_);
  AdvancePoses();
  return NextIsFinite();
}

void FullMechanism::AddBodies(const Matrix6X& on_bodies, bool stiffening, MatrixX& right) {
  const double h = h_, on = stiffening ? 1 : 0;
  for (int b = 0; b < mechanism_->num_bodies(); ++b) {
    if (!Moves(b)) continue;
    const auto i = static_cast<std::size_t>(b);
    const SpatialInertia& I = mechanism_->bodies()[i].inertia_B;
    const RigidTransform& X = X_next_[i];
    const Vector3 weight_B = X.rotation().transpose() * (mechanism_->bodies()[i].weighed_mass * gravity_W_);
    Vector6 impulse =
        stage_ ? CarriedMomentum(b, X) : AdjointTransposeApply(X_[i].inverse() * X, momentum_.col(b));
    impulse.head<3>() += h * I.center.cross(weight_B);
    impulse.tail<3>() += h * weight_B;
    if (has_wrenches_) impulse += h * (stage_ ? LoadsAt(b, X) : AdjointTransposeApply(X, wrenches_W_.col(b)));
    right.block<6, 1>(column_[i], 0) += impulse - inertia_[i] * V_next_.col(b);
    const Matrix6 tangent = inertia_[i] - on * h * DeadForceStiffness(I.center, h * weight_B) -
                            on * h * DeadForceStiffness(Vector3::Zero(), on_bodies.col(b).tail<3>());
    dynamics_.AddBlock(column_[i], column_[i], tangent);
  }
}

void FullMechanism::AddAlongLength(const Mechanism::Length& length, double pull, double stiffness,
                                   double damping, VectorX& tau) {
  ForEachArmAt(length, q_next_, [&](int i, double c) {
    tau(i) += c * pull;
    ForEachArmAt(length, q_next_, [&](int j, double d) {
      dynamics_.Add(ColumnOfCoordinate(i), ColumnOfCoordinate(j), c * d * h_ * (damping + h_ * stiffness));
    });
  });
}

// The active part: -a F0 F_L F_V with the two curves as pieces of parabolas, and as slopes of Newton's matrix central
// differences where they are of springs and dampers.
void FullMechanism::AddMuscle(const MuscleDef& muscle, VectorX& tau) {
  const Mechanism& m = *mechanism_;
  const auto& known = m.muscles();
  const auto at =
      std::find_if(known.begin(), known.end(), [&](const auto& k) { return k.name == muscle.name; });
  const double unit = (muscle.length_upper - muscle.length_lower) / (muscle.range_upper - muscle.range_lower);
  const double a = controls(at->control);
  const auto pull = [&](double length, double rate) {
    const double L = muscle.range_lower + (length - muscle.length_lower) / unit,
                 V = rate / unit / muscle.vmax;
    const auto square = [](double x) { return x * x; };
    const double left = 0.5 * (muscle.lmin + 1), right = 0.5 * (1 + muscle.lmax);
    double by_length = 0, by_rate = 0;
    if (L >= muscle.lmin && L <= left) by_length = 0.5 * square((L - muscle.lmin) / (left - muscle.lmin));
    if (L > left && L <= 1) by_length = 1 - 0.5 * square((1 - L) / (1 - left));
    if (L > 1 && L <= right) by_length = 1 - 0.5 * square((L - 1) / (right - 1));
    if (L > right && L <= muscle.lmax) by_length = 0.5 * square((muscle.lmax - L) / (muscle.lmax - right));
    const double most = muscle.fvmax - 1;
    if (V > -1 && V <= 0) by_rate = square(V + 1);
    if (V > 0) by_rate = V >= most ? muscle.fvmax : muscle.fvmax - square(most - V) / most;
    return -muscle.force * a * by_length * by_rate;
  };
  const double length = Length(at->length, q_next_), rate = LengthRate(at->length, q_next_, q_dot_next_);
  constexpr double kStep = 1e-6;  // of L and V: truncated and rounded to 1e-10
  const double dl = kStep * unit, dv = kStep * unit * muscle.vmax;
  const double stiffness = (pull(length - dl, rate) - pull(length + dl, rate)) / (2 * dl),
               damping = (pull(length, rate - dv) - pull(length, rate + dv)) / (2 * dv);
  AddAlongLength(at->length, pull(length, rate), std::max(0.0, stiffness), std::max(0.0, damping), tau);
}

void FullMechanism::AddJoints(MatrixX& right) {
  const Mechanism& m = *mechanism_;
  const double h = h_;
  const VectorX velocities = JointVelocities(q_next_, q_dot_next_);
  VectorX tau = m.stiffness().cwiseProduct(m.rest() - q_next_) -
                CoordinateForces(q_next_, m.damping().cwiseProduct(velocities));
  for (std::size_t k = 0; k < m.controls().size(); ++k) {
    const double force = m.controls()[k].gain * controls(static_cast<Eigen::Index>(k));
    ForEachArmAt(m.controls()[k].length, q_next_, [&](int i, double c) { tau(i) += c * force; });
  }
  const MatrixX inertia = OnCoordinates(q_next_, m.armature() + h * m.damping());
  for (int i = 0; i < m.num_coordinates(); ++i)
    for (int j = 0; j < m.num_coordinates(); ++j)
      if (const double value = inertia(i, j) + (i == j ? h * h * m.stiffness()(i) : 0); i == j || value != 0)
        dynamics_.Add(ColumnOfCoordinate(i), ColumnOfCoordinate(j), value);
  for (const Mechanism::Spring& s : m.springs()) {
    // Between two lengths it may be slack.
    const double length = Length(s.length, q_next_), end = std::clamp(length, s.rest, s.rest + s.slack),
                 stretch = length - end, rate = LengthRate(s.length, q_next_, q_dot_next_),
                 speed = std::abs(rate);
    if (s.toe > 0) {  // the passive part of a muscle
      const double x = std::max(0.0, length - s.rest) / s.toe;
      const double pull = -s.stiffness * s.toe * (x < 1 ? 0.5 * x * x : x - 0.5);
      AddAlongLength(s.length, pull, s.stiffness * std::min(x, 1.0), 0, tau);
      continue;
    }
    const auto& [k2, k3] = s.higher_stiffness;
    const auto& [d2, d3] = s.higher_damping;
    const double pull = -(s.stiffness * stretch + k2 * stretch * stretch + k3 * std::pow(stretch, 3)) -
                        (s.damping * rate + d2 * rate * speed + d3 * std::pow(rate, 3));
    // Newton's own, where the law does not fall.
    const bool slack = s.slack > 0 && stretch == 0;
    const double stiffness =
                     slack ? 0 : std::max(0.0, s.stiffness + 2 * k2 * stretch + 3 * k3 * stretch * stretch),
                 damping = std::max(0.0, s.damping + 2 * d2 * speed + 3 * d3 * speed * speed);
    AddAlongLength(s.length, pull, stiffness, damping, tau);
  }
  for (const MuscleDef& muscle : m.definition().muscles) AddMuscle(muscle, tau);
  // What a servo cannot give is taken back, and its stiffness with it.
  for (const Mechanism::ForceLimit& limit : m.force_limits()) {
    const double f =
        ServoForce(limit, q_next_) - limit.damping * LengthRate(limit.length, q_next_, q_dot_next_);
    const double excess = f - std::min(std::max(f, limit.lower), limit.upper);
    if (excess == 0) continue;
    ForEachArmAt(limit.length, q_next_, [&](int i, double c) {
      tau(i) -= c * excess;
      ForEachArmAt(limit.length, q_next_, [&](int j, double d) {
        dynamics_.Add(ColumnOfCoordinate(i), ColumnOfCoordinate(j),
                      -c * d * h * (limit.damping + h * limit.stiffness));
      });
    });
  }
  right.block(num_body_columns_, 0, m.num_coordinates(), 1) +=
      CoordinateForces(q_next_, m.armature().cwiseProduct(rates_start_ - velocities)) + h * tau;
}

// Springy directions push by k c + d ċ; rigid ones by their multipliers. Either turns with the bodies.
void FullMechanism::AddClosures(bool stiffening, MatrixX& right) {
  const double h = h_;
  int row = first_loop_row_;
  for (const ClosureDef& closure : mechanism_->closures()) {
    const int body[2] = {closure.body_a.value(), closure.body_b.value()};
    const RigidTransform X[2] = {X_next_[closure.body_a.u()], X_next_[closure.body_b.u()]};
    const auto rows = ClosureRows(closure, X[0], X[1]);
    Eigen::Matrix<double, 12, 1> V;
    V << V_next_.col(body[0]), V_next_.col(body[1]);
    const Vector6 c = ClosureError(closure, X_next_), rate = rows * V;
    const Vector6 spring = closure.stiffness.cwiseProduct(c) + closure.damping.cwiseProduct(rate);
    Vector6 pull, soft;
    for (int i = 0; i < 6; ++i) {
      pull(i) = closure.rigid(i) ? nu_next_(row++) : h * spring(i);
      soft(i) = closure.rigid(i) ? 0 : h * (closure.damping(i) + h * closure.stiffness(i));
    }
    Eigen::Matrix<double, 12, 12> tangent = DiagonalCongruence(soft, rows);
    if (stiffening && !pull.isZero(0)) {
      constexpr double kStep = 1e-6;  // central differences: 1e-12 of the pull is truncated, 1e-10 rounded
      Eigen::Matrix<double, 12, 12> turn;
      for (int i = 0; i < 12; ++i) {
        const int side = i / 6;
        RigidTransform ahead[2] = {X[0], X[1]}, back[2] = {X[0], X[1]};
        ahead[side] = X[side] * Exp(kStep * Vector6::Unit(i % 6));
        back[side] = X[side] * Exp(-kStep * Vector6::Unit(i % 6));
        turn.col(i) =
            (ClosureRows(closure, ahead[0], ahead[1]) - ClosureRows(closure, back[0], back[1])).transpose() *
            pull / (2 * kStep);
      }
      tangent += 0.5 * h * (turn + turn.transpose());
    }
    const Vector6 soft_pull = closure.rigid.select(Vector6::Zero(), pull);
    for (int s = 0; s < 2; ++s) {
      if (!Moves(body[s])) continue;
      const int at = column_[static_cast<std::size_t>(body[s])];
      right.block<6, 1>(at, 0) -= rows.middleCols<6>(6 * s).transpose() * soft_pull;
      for (int t = 0; t < 2; ++t)
        if (Moves(body[t]))
          dynamics_.AddBlock(at, column_[static_cast<std::size_t>(body[t])],
                             tangent.block<6, 6>(6 * s, 6 * t));
    }
  }
}

bool FullMechanism::Linearise(const Matrix6X& on_bodies, bool stiffening) {
  MatrixX right = MatrixX::Zero(num_unknowns(), 1);
  dynamics_.Begin(num_unknowns());
  AddBodies(on_bodies, stiffening, right);
  AddJoints(right);
  AddClosures(stiffening, right);
  for (const Link& link : links_)
    AddLinkStiffening(link, RowsOf(link, X_next_, q_next_), nu_next_.segment<6>(link.row),
                      stiffening ? h_ : 0);
  // Small beside 1/m, the size of the constraints' own responses.
  const double mass = mechanism_->total_mass() > 0 ? mechanism_->total_mass() : 1;
  AddConstraints(X_next_, q_next_, true, 1e-9 / mass, dynamics_);
  if (!dynamics_.Factor()) return false;

  // What is left of G_bᵀ ν and of G V: the matrix holds G on either side.
  const VectorX u = Unknowns();
  MatrixX part = u;
  part.topRows(num_velocities_).setZero();
  right.topRows(num_velocities_) -= dynamics_.Multiply(part).topRows(num_velocities_);
  part = u;
  part.bottomRows(num_rows_).setZero();
  right.bottomRows(num_rows_) -= dynamics_.Multiply(part).bottomRows(num_rows_);
  right.bottomRows(num_rows_) -= GivenVelocities(X_next_, q_next_, V_next_);
  if (!dynamics_.Solve(right)) return false;
  free_ = u + right;
  return true;
}

double FullMechanism::Accept(const MatrixX& unknowns) {
  for (std::size_t b = 0; b < X_.size(); ++b)
    if (column_[b] >= 0) V_next_.col(static_cast<Eigen::Index>(b)) = unknowns.block<6, 1>(column_[b], 0);
  q_dot_next_ = unknowns.block(num_body_columns_, 0, mechanism_->num_coordinates(), 1);
  nu_next_ = unknowns.bottomRows(num_rows_);
  return AdvancePoses();
}

bool FullMechanism::NextIsFinite() const {
  return V_next_.allFinite() && q_next_.allFinite() && q_dot_next_.allFinite() && std::isfinite(gap_) &&
         std::all_of(X_next_.begin(), X_next_.end(), [](const auto& X) { return X.IsFinite(); });
}

void FullMechanism::Commit() {
  X_ = X_next_;
  V_ = V_next_;
  q_ = q_next_;
  q_dot_ = q_dot_next_;
  nu_ = nu_next_;
  h_last_ = h_;
  reactions_ += nu_next_;
  reaction_time_ += h_;
  // A rotation vector that nothing acts on is kept below half a turn.
  for (const Mechanism::Joint& joint : mechanism_->joints()) {
    if (!IsPeriodic(*mechanism_, joint)) continue;
    const Vector3 v = q_.segment<3>(joint.offset);
    const double angle = v.norm();
    if (angle <= M_PI) continue;
    const Vector3 wrapped = v * (1 - 2 * M_PI / angle);
    q_dot_.segment<3>(joint.offset) =
        DexpInverseRotation(wrapped) * (DexpRotation(v) * q_dot_.segment<3>(joint.offset));
    q_.segment<3>(joint.offset) = wrapped;
  }
}

}  // namespace fork1s::internal
