#include <algorithm>
#include <cmath>
#include <fork1s/diagnostics/load_factor.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>

#include "linalg/null_space.hpp"
#include "linalg/products.hpp"
#include "linalg/solve.hpp"
#include "linalg/spectrum.hpp"
#include "world/contact_curvature.hpp"

namespace fork1s {
namespace {

// The coordinates x: of every mechanism that touches, base twist (where it floats, world axes about R's
// origin) and z; of every free body that touches, ω and the velocity of the centre of mass in world axes.
class Grasp {
  using Side = LoadedContact::Side;

 public:
  Grasp(const World& world, const std::vector<LoadedContact>& contacts) : world_(world) {
    const auto normal = [](const LoadedContact& c) { return c.force.dot(c.normal); };
    double largest = 0;
    for (const LoadedContact& c : contacts) largest = std::max(largest, normal(c));
    std::vector<int> holds(world.free_bodies().size(), 0);
    mechanism_at_.assign(world.mechanisms().size(), -1);
    free_at_.assign(world.free_bodies().size(), -1);
    for (const LoadedContact& c : contacts) {
      if (normal(c) <= 1e-9 * largest) continue;  // touches at most
      contacts_.push_back(c);
      for (const Side& side : {c.a, c.b}) {
        if (side.mechanism >= 0) mechanism_at_[static_cast<std::size_t>(side.mechanism)] = 0;
        if (side.free_body < 0) continue;
        const auto i = static_cast<std::size_t>(side.free_body);
        free_at_[i] = 0;
        holds_any_ |= ++holds[i] >= 2;
      }
    }
    for (std::size_t i = 0; i < mechanism_at_.size(); ++i)
      if (mechanism_at_[i] >= 0) {
        mechanism_at_[i] = size_;
        size_ += world.mechanisms()[i].num_velocities();
      }
    for (int& at : free_at_)
      if (at >= 0) {
        at = size_;
        size_ += 6;
      }
    for (std::size_t i = 0; i < mechanism_at_.size(); ++i) {
      configurations_.emplace_back(world.mechanisms()[i].model());
      states_.push_back(world.mechanisms()[i].state());
    }
  }

  bool holds_any() const { return holds_any_; }
  int num_contacts() const { return static_cast<int>(contacts_.size()); }
  int size() const { return size_; }

  VectorX Stiffness() const {
    VectorX K = VectorX::Zero(size_);
    for (std::size_t i = 0; i < mechanism_at_.size(); ++i)
      if (mechanism_at_[i] >= 0) {
        const VectorX& K_r = world_.mechanisms()[i].model().K_r;
        K.segment(mechanism_at_[i] + base_size(i), K_r.size()) = K_r;
      }
    return K;
  }

  // Puts everything at a displacement dx from the present state.
  void Displace(const VectorX& dx) {
    for (std::size_t i = 0; i < mechanism_at_.size(); ++i) {
      if (mechanism_at_[i] < 0) continue;
      const MechanismDynamics& m = world_.mechanisms()[i];
      states_[i] = m.state();
      const int base = base_size(i);
      if (base > 0) states_[i].X_WR = Moved(m.state().X_WR, dx.segment<6>(mechanism_at_[i]));
      states_[i].z += dx.segment(mechanism_at_[i] + base, m.model().size());
      Configure(m.model(), states_[i], configurations_[i]);
    }
    centers_.clear();
    for (std::size_t i = 0; i < free_at_.size(); ++i) {
      centers_.push_back(world_.free_bodies()[i].center_W());
      if (free_at_[i] >= 0) centers_[i] += dx.segment<3>(free_at_[i] + 3);
    }
  }

  // Twist of one side in world axes about the point p per unit of x, at the displaced state.
  Matrix6X Twist(const Side& side, const Vector3& p) const {
    Matrix6X J = Matrix6X::Zero(6, size_);
    if (side.free_body >= 0) {
      const auto i = static_cast<std::size_t>(side.free_body);
      J.middleCols<6>(free_at_[i]).setIdentity();
      J.block<3, 3>(3, free_at_[i]) = -Skew(p - centers_[i]);
      return J;
    }
    if (side.mechanism < 0) return J;
    const auto i = static_cast<std::size_t>(side.mechanism);
    const MechanismDynamics& m = world_.mechanisms()[i];
    const RigidTransform& X_WR = states_[i].X_WR;
    const Matrix3& R = X_WR.rotation();
    const int base = base_size(i), r = m.model().size();
    if (base > 0) {
      J.middleCols<6>(mechanism_at_[i]).setIdentity();
      J.block<3, 3>(3, mechanism_at_[i]) = -Skew(p - X_WR.translation());
    }
    auto T = J.middleCols(mechanism_at_[i] + base, r);
    int j = m.mechanism().body(side.body).last_joint;
    for (; j >= 0; j = m.mechanism().joint(JointIndex(j)).previous) {
      const auto& joint = m.mechanism().joint(JointIndex(j));
      T.noalias() += configurations_[i].kinematics.S.middleCols(joint.offset, joint.size) *
                     configurations_[i].Q_now.middleRows(joint.offset, joint.size);
    }
    // From R about its origin to world axes about p.
    T.topRows<3>() = R * T.topRows<3>();
    T.bottomRows<3>() = R * T.bottomRows<3>() - Skew(p - X_WR.translation()) * T.topRows<3>();
    return J;
  }

  MatrixX ContactJacobian() const {
    MatrixX J(3 * num_contacts(), size_);
    for (int k = 0; k < num_contacts(); ++k) {
      const LoadedContact& c = contacts_[static_cast<std::size_t>(k)];
      J.middleRows<3>(3 * k) = (Twist(c.b, c.point) - Twist(c.a, c.point)).bottomRows<3>();
    }
    return J;
  }

  // Velocity of every contact point when all contacts roll at x: that of the material, and the migration u
  // over both surfaces at which their normals stay opposite, (κ_a + κ_b) u = (ω_b - ω_a) × n.
  std::vector<Vector3> PointVelocities(const VectorX& x) const {
    std::vector<Vector3> velocities;
    for (const LoadedContact& c : contacts_) {
      const Vector6 a = Twist(c.a, c.point) * x, b = Twist(c.b, c.point) * x;
      const Vector3 turn = b.head<3>() - a.head<3>();
      velocities.push_back(a.tail<3>() + c.inverse_curvature * turn.cross(c.normal));
    }
    return velocities;
  }

  // J_cᵀλ at the displaced state with contact points moved by s times their velocities.
  VectorX ContactForce(double s, const std::vector<Vector3>& velocities) const {
    VectorX f = VectorX::Zero(size_);
    for (std::size_t k = 0; k < contacts_.size(); ++k) {
      const LoadedContact& c = contacts_[k];
      const Vector3 p = c.point + s * velocities[k];
      f += (Twist(c.b, p) - Twist(c.a, p)).bottomRows<3>().transpose() * (c.force + c.pull);
    }
    return f;
  }

  // Units in which a coordinate moves contacts by about a metre: for rank decisions.
  VectorX Scale(const MatrixX& J) const {
    VectorX scale = VectorX::Ones(size_);
    const auto unit = [&](int begin, int count) {
      const double largest = count > 0 ? J.middleCols(begin, count).colwise().norm().maxCoeff() : 0;
      if (largest > 0) scale.segment(begin, count).setConstant(1 / largest);
    };
    for (std::size_t i = 0; i < mechanism_at_.size(); ++i) {
      if (mechanism_at_[i] < 0) continue;
      const int base = base_size(i);
      if (base > 0) unit(mechanism_at_[i], 3);
      unit(mechanism_at_[i] + base, world_.mechanisms()[i].model().size());
    }
    for (int at : free_at_)
      if (at >= 0) unit(at, 3);
    return scale;
  }

  // Free body of the largest scaled motion.
  std::string LargestMover(const VectorX& scaled) const {
    std::string name;
    double largest = -1;
    for (std::size_t i = 0; i < free_at_.size(); ++i) {
      if (free_at_[i] < 0) continue;
      const double motion = scaled.segment<6>(free_at_[i]).norm();
      if (motion <= largest) continue;
      largest = motion;
      name = world_.free_bodies()[i].name();
    }
    return name;
  }

 private:
  int base_size(std::size_t i) const {
    return world_.mechanisms()[i].num_velocities() - world_.mechanisms()[i].model().size();
  }
  static RigidTransform Moved(const RigidTransform& X, const Vector6& dx) {
    const double angle = dx.head<3>().norm();
    const Vector3 axis = angle > 0 ? Vector3(dx.head<3>() / angle) : Vector3::UnitX();
    return RigidTransform(Eigen::AngleAxisd(angle, axis).toRotationMatrix() * X.rotation(),
                          X.translation() + dx.tail<3>());
  }

  const World& world_;
  std::vector<LoadedContact> contacts_;
  bool holds_any_ = false;
  int size_ = 0;
  std::vector<int> mechanism_at_, free_at_;  // first coordinate or -1
  std::vector<Configuration> configurations_;
  std::vector<ReducedState> states_;
  std::vector<Vector3> centers_;
};

// Largest real part of µ in -G v = µ K v, with its vector. Directions without spring follow the others.
double LargestShare(const MatrixX& K, const MatrixX& G, const NullSpace& springs, VectorX& direction) {
  const MatrixX& U = springs.unseen;
  const Eigen::Index u = U.cols(), s = springs.seen.cols();
  if (s == 0) return 0;
  const SymmetricSpectrum stiffness = SpectrumOf(Congruence(K, springs.seen));
  if (!(stiffness.values(0) > 0)) return 0;
  const MatrixX S =
      ScaledColumns(Times(springs.seen, stiffness.vectors), stiffness.values.cwiseSqrt().cwiseInverse());
  MatrixX B = -Congruence(G, S), follow = MatrixX::Zero(u, s);
  if (u > 0) {
    // What load neither holds nor drives, such as a ball's spin about the axis of its two contacts, is left
    // out: its entries are rounding of the difference quotient.
    const MatrixX block = Congruence(G, U), G_US = TransposedTimes(U, Times(G, S));
    const double noise = 1e-7 * G.norm();
    if (block.norm() > noise) {
      follow = -LeastNormSolve(block, G_US, noise / block.norm());
      B -= Times(TransposedTimes(S, Times(G, U)), follow);
    }
  }
  const GeneralSpectrum spectrum = GeneralSpectrumOf(B);
  Eigen::Index largest = 0;
  const double share = spectrum.values.real().maxCoeff(&largest);
  const VectorX y = spectrum.vectors.col(largest).real();
  direction = S * y + U * (follow * y);
  return share;
}

}  // namespace

std::vector<LoadedContact> LoadedContacts(const World& world, double h) {
  const auto side_of = [&](int number) -> LoadedContact::Side {
    const CollisionBody& c = world.collision_bodies()[static_cast<std::size_t>(number)];
    if (c.kind == CollisionBody::Kind::kWorld) return {};
    if (c.kind == CollisionBody::Kind::kFreeBody) return {.free_body = c.index};
    const MechanismDynamics& m = world.mechanisms()[static_cast<std::size_t>(c.index)];
    return {.mechanism = c.index, .body = m.groups()[static_cast<std::size_t>(c.group)].body};
  };
  std::vector<LoadedContact> out;
  for (const ContactRecord& c : world.contacts())
    out.push_back({side_of(c.point.body_a), side_of(c.point.body_b), c.point.point,
                   c.point.frame.transpose() * c.impulse / h, c.point.frame.row(0).transpose(),
                   ComputeInverseCurvature(world, c.point), c.point.frame.transpose() * c.pull / h});
  return out;
}

LoadFactor ComputeLoadFactor(const World& world, double h) {
  return ComputeLoadFactor(world, LoadedContacts(world, h));
}

LoadFactor ComputeLoadFactor(const World& world, const std::vector<LoadedContact>& contacts) {
  LoadFactor out;
  Grasp grasp(world, contacts);
  if (!grasp.holds_any()) return out;
  out.contacts = grasp.num_contacts();
  grasp.Displace(VectorX::Zero(grasp.size()));
  const MatrixX J = grasp.ContactJacobian();
  const VectorX scale = grasp.Scale(J);
  // Rows of contacts that share a flat face depend on each other up to rounding.
  const MatrixX rolling = ComputeNullSpace(ScaledColumns(J, scale)).unseen, N = ScaledRows(scale, rolling);
  const Eigen::Index free = N.cols();
  if (free == 0) return out;

  // Central differences: 1e-5 m beside radii of centimetres leaves a share of about 1e-7.
  constexpr double kStep = 1e-5;
  MatrixX G(free, free);
  std::vector<std::vector<Vector3>> velocities;
  for (Eigen::Index k = 0; k < free; ++k) velocities.push_back(grasp.PointVelocities(N.col(k)));
  for (Eigen::Index k = 0; k < free; ++k) {
    const auto& v = velocities[static_cast<std::size_t>(k)];
    grasp.Displace(kStep * N.col(k));
    VectorX change = grasp.ContactForce(kStep, v);
    grasp.Displace(-kStep * N.col(k));
    change -= grasp.ContactForce(-kStep, v);
    G.col(k) = -N.transpose() * change / (2 * kStep);
  }
  // Whether a motion has a spring is told by how far it moves coordinates that have one, not by its
  // stiffness: that of a heap which rolls in a bucket is rounding, and so was the largest that it was
  // compared with.
  const VectorX k = grasp.Stiffness();
  const NullSpace springs = ComputeNullSpace(ScaledRows((k.array() > 0).cast<double>(), rolling));
  const MatrixX K = DiagonalCongruence(k, N);
  if (!G.allFinite() || !K.allFinite()) return out;
  VectorX direction;
  const double share = LargestShare(K, G, springs, direction);
  if (!(share > 1e-9)) return out;  // no load within a thousand million times the present one
  out.factor = 1 / share;
  out.body = grasp.LargestMover((N * direction).cwiseQuotient(scale));
  return out;
}

}  // namespace fork1s
