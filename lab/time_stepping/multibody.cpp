#include <Eigen/Cholesky>
#include <cmath>
#include <fork1s/spatial/rigid_transform.hpp>

#include "linearization.hpp"

namespace fork1s::lab {

namespace {

Pose PoseOf(const std::vector<Pose>& poses, int body) {
  return body < 0 ? Pose{} : poses[static_cast<std::size_t>(body)];
}

Matrix3 WorldInertia(const Body& body, const Pose& X) {
  return X.R * body.inertia.asDiagonal() * X.R.transpose();
}

// Adds a linear relation between two points: force F on `a` at lever ra, −F on `b`, stiffness S of F along d.
struct TwoPoints {
  int a, b;
  Vector3 ra, rb, d;
  TwoPoints(const std::vector<Pose>& poses, int a_, int b_, const Vector3& pa, const Vector3& pb)
      : a(a_), b(b_) {
    const Pose A = PoseOf(poses, a), B = PoseOf(poses, b);
    ra = A.R * pa;
    rb = B.R * pb;
    d = A.x + ra - B.x - rb;
  }
  // rows * ∂d/∂x
  template <typename Rows>
  void AddRows(const Rows& rows, MatrixX& J, int at) const {
    if (a >= 0) {
      J.block(at, 6 * a, rows.rows(), 3) += -rows * Skew(ra);
      J.block(at, 6 * a + 3, rows.rows(), 3) += rows;
    }
    if (b >= 0) {
      J.block(at, 6 * b, rows.rows(), 3) += rows * Skew(rb);
      J.block(at, 6 * b + 3, rows.rows(), 3) -= rows;
    }
  }
  void AddForce(const Vector3& F, VectorX& f) const {
    if (a >= 0) {
      f.segment<3>(6 * a) += ra.cross(F);
      f.segment<3>(6 * a + 3) += F;
    }
    if (b >= 0) {
      f.segment<3>(6 * b) -= rb.cross(F);
      f.segment<3>(6 * b + 3) -= F;
    }
  }
  // −∂/∂x of the generalized force with ∂F/∂d = −S
  void AddStiffness(const Matrix3& S, const Vector3& F, MatrixX& K) const {
    MatrixX Jd = MatrixX::Zero(3, K.cols());
    AddRows(Matrix3::Identity(), Jd, 0);
    K += Jd.transpose() * S * Jd;
    if (a >= 0) K.block<3, 3>(6 * a, 6 * a) -= Skew(F) * Skew(ra);
    if (b >= 0) K.block<3, 3>(6 * b, 6 * b) += Skew(F) * Skew(rb);
  }
};

double AngleAbout(const Vector3& axis, const Matrix3& R) {
  const Vector3 twice_sine(R(2, 1) - R(1, 2), R(0, 2) - R(2, 0), R(1, 0) - R(0, 1));
  return std::atan2(0.5 * axis.dot(twice_sine), 0.5 * (R.trace() - 1));
}

}  // namespace

Linearization Linearize(const System& s, const std::vector<Pose>& poses, const VectorX& V,
                        const VectorX& lambda, double b, bool derivatives, bool geometric) {
  const int n = static_cast<int>(s.bodies.size()), m = s.num_rows();
  Linearization out;
  out.p = VectorX::Zero(6 * n);
  out.f = VectorX::Zero(6 * n);
  out.f_abs = VectorX::Zero(6 * n);
  out.c = VectorX::Zero(m);
  out.J = MatrixX::Zero(m, 6 * n);
  if (derivatives) {
    out.A_p = out.K = out.D = out.G = out.M = MatrixX::Zero(6 * n, 6 * n);
  }
  for (int i = 0; i < n; ++i) {
    const Body& body = s.bodies[static_cast<std::size_t>(i)];
    const Matrix3 I = WorldInertia(body, poses[static_cast<std::size_t>(i)]);
    const Vector3 omega = V.segment<3>(6 * i), L = I * omega;
    out.p.segment<3>(6 * i) = L;
    out.p.segment<3>(6 * i + 3) = body.mass * V.segment<3>(6 * i + 3);
    out.f.segment<3>(6 * i + 3) += body.mass * s.gravity;
    if (!derivatives) continue;
    out.M.block<3, 3>(6 * i, 6 * i) = I;
    out.M.block<3, 3>(6 * i + 3, 6 * i + 3) = body.mass * Matrix3::Identity();
    // δ(R I Rᵀ) ω = δθ × L − I (δθ × ω), δθ = b δω
    out.A_p.block<3, 3>(6 * i, 6 * i) = I + b * (-Skew(L) + I * Skew(omega));
    out.A_p.block<3, 3>(6 * i + 3, 6 * i + 3) = body.mass * Matrix3::Identity();
  }
  out.f_abs = out.f.cwiseAbs();
  const auto add = [&](const VectorX& term) {
    out.f += term;
    out.f_abs += term.cwiseAbs();
  };
  for (const PointSpring& e : s.springs) {
    const TwoPoints at(poses, e.a, e.b, e.point_a, e.point_b);
    const double length = at.d.norm();
    const bool is_point = e.rest_length == 0;
    const Vector3 u = length > 0 ? Vector3(at.d / length) : Vector3::UnitX();
    const Matrix3 uu = u * u.transpose();
    MatrixX Jd = MatrixX::Zero(3, 6 * n);
    at.AddRows(Matrix3::Identity(), Jd, 0);
    const Vector3 rate = Jd * V;
    Vector3 F =
        is_point ? Vector3(-e.stiffness * at.d) : Vector3(-e.stiffness * (length - e.rest_length) * u);
    F -= e.damping * (is_point ? rate : Vector3(uu * rate));
    VectorX term = VectorX::Zero(6 * n);
    at.AddForce(F, term);
    add(term);
    if (!derivatives) continue;
    Matrix3 S = e.stiffness * Matrix3::Identity();
    if (!is_point) S = e.stiffness * uu;
    if (!is_point && geometric)
      S += e.stiffness * (length - e.rest_length) / length * (Matrix3::Identity() - uu);
    at.AddStiffness(S, geometric ? F : Vector3(Vector3::Zero()), out.K);
    if (e.damping > 0)
      out.D += e.damping * Jd.transpose() * (is_point ? Matrix3(Matrix3::Identity()) : uu) * Jd;
  }
  for (const TorsionSpring& e : s.torsions) {
    const Pose A = PoseOf(poses, e.a), B = PoseOf(poses, e.b);
    const Vector3 axis = B.R * e.axis;
    const double angle = AngleAbout(e.axis, B.R.transpose() * A.R);
    VectorX Jt = VectorX::Zero(6 * n);
    if (e.a >= 0) Jt.segment<3>(6 * e.a) = axis;
    if (e.b >= 0) Jt.segment<3>(6 * e.b) = -axis;
    const double torque = -e.stiffness * (angle - e.target) - e.damping * Jt.dot(V);
    add(torque * Jt);
    if (!derivatives) continue;
    out.K += e.stiffness * Jt * Jt.transpose();
    out.D += e.damping * Jt * Jt.transpose();
    if (e.b >= 0 && geometric) {
      if (e.a >= 0) out.K.block<3, 3>(6 * e.a, 6 * e.b) += torque * Skew(axis);
      out.K.block<3, 3>(6 * e.b, 6 * e.b) -= torque * Skew(axis);
    }
  }
  int row = 0;
  for (const PointConstraint& e : s.points) {
    const TwoPoints at(poses, e.a, e.b, e.point_a, e.point_b);
    Vector3 F = Vector3::Zero();
    for (int k = 0; k < 3; ++k) {
      if (!e.directions[k]) continue;
      out.c(row) = at.d(k);
      at.AddRows(Eigen::RowVector3d(Vector3::Unit(k).transpose()), out.J, row);
      F(k) = lambda(row++);
    }
    if (derivatives) at.AddStiffness(Matrix3::Zero(), F, out.G);
  }
  for (const AxisConstraint& e : s.axes) {
    const Vector3 x = PoseOf(poses, e.a).R * e.axis_a, y = PoseOf(poses, e.b).R * e.axis_b, z = x.cross(y);
    out.c(row) = x.dot(y);
    if (e.a >= 0) out.J.block<1, 3>(row, 6 * e.a) = z.transpose();
    if (e.b >= 0) out.J.block<1, 3>(row, 6 * e.b) = -z.transpose();
    if (derivatives) {
      const Matrix3 by_a = lambda(row) * Skew(y) * Skew(x), by_b = -lambda(row) * Skew(x) * Skew(y);
      if (e.a >= 0) out.G.block<3, 3>(6 * e.a, 6 * e.a) -= by_a;
      if (e.b >= 0) out.G.block<3, 3>(6 * e.b, 6 * e.b) += by_b;
      if (e.a >= 0 && e.b >= 0) {
        out.G.block<3, 3>(6 * e.a, 6 * e.b) -= by_b;
        out.G.block<3, 3>(6 * e.b, 6 * e.a) += by_a;
      }
    }
    ++row;
  }
  for (const DistanceConstraint& e : s.distances) {
    const TwoPoints at(poses, e.a, e.b, e.point_a, e.point_b);
    const double length = at.d.norm();
    const Vector3 u = at.d / length;
    out.c(row) = length - e.length;
    at.AddRows(Eigen::RowVector3d(u.transpose()), out.J, row);
    if (derivatives)
      at.AddStiffness(-lambda(row) / length * (Matrix3::Identity() - u * u.transpose()), lambda(row) * u,
                      out.G);
    ++row;
  }
  return out;
}

std::vector<Pose> ComposeAll(const std::vector<Pose>& poses, const VectorX& displacement) {
  std::vector<Pose> out(poses.size());
  for (std::size_t i = 0; i < poses.size(); ++i)
    out[i] = Compose(poses[i], displacement.segment<6>(6 * static_cast<Eigen::Index>(i)));
  return out;
}

VectorX DifferenceAll(const std::vector<Pose>& to, const std::vector<Pose>& from) {
  VectorX out(6 * static_cast<Eigen::Index>(to.size()));
  for (std::size_t i = 0; i < to.size(); ++i)
    out.segment<6>(6 * static_cast<Eigen::Index>(i)) = Difference(to[i], from[i]);
  return out;
}

ContactGeometry ComputeContact(const ContactPair& c, const std::vector<Pose>& poses) {
  const Pose A = PoseOf(poses, c.a), B = PoseOf(poses, c.b);
  const Vector3 n = B.R * c.normal, center = A.x + A.R * c.center;
  ContactGeometry out;
  out.gap = n.dot(center - B.x - B.R * c.origin) - c.radius;
  const Vector3 point = center - c.radius * n;
  const Vector3 t1 =
      (std::abs(n.x()) < 0.7 ? n.cross(Vector3::UnitX()) : n.cross(Vector3::UnitY())).normalized();
  out.frame.row(0) = n.transpose();
  out.frame.row(1) = t1.transpose();
  out.frame.row(2) = n.cross(t1).transpose();
  out.J_a.leftCols<3>() = -out.frame * Skew(point - A.x);
  out.J_a.rightCols<3>() = out.frame;
  out.J_b.leftCols<3>() = out.frame * Skew(point - B.x);
  out.J_b.rightCols<3>() = -out.frame;
  return out;
}

int System::num_rows() const {
  int rows = static_cast<int>(axes.size() + distances.size());
  for (const PointConstraint& p : points) rows += p.directions[0] + p.directions[1] + p.directions[2];
  return rows;
}

void System::AddHinge(int a, int b, const Vector3& point_a, const Vector3& point_b, const Vector3& axis) {
  points.push_back({a, b, point_a, point_b, {true, true, true}});
  const Vector3 e =
      (std::abs(axis.x()) < 0.7 ? axis.cross(Vector3::UnitX()) : axis.cross(Vector3::UnitY())).normalized();
  axes.push_back({a, b, axis, e});
  axes.push_back({a, b, axis, axis.cross(e).normalized()});
}

void System::AddLockedRotation(int a, int b) {
  axes.push_back({a, b, Vector3::UnitX(), Vector3::UnitY()});
  axes.push_back({a, b, Vector3::UnitY(), Vector3::UnitZ()});
  axes.push_back({a, b, Vector3::UnitZ(), Vector3::UnitX()});
}

Pose Compose(const Pose& X, const Vector6& displacement) {
  return {X.x + displacement.tail<3>(), ExpRotation(displacement.head<3>()) * X.R};
}

Vector6 Difference(const Pose& X, const Pose& Y) {
  Vector6 d;
  d << LogRotation(X.R * Y.R.transpose()), X.x - Y.x;
  return d;
}

std::vector<Pose> Extrapolate(const std::vector<Pose>& from, const std::vector<Pose>& to, double s) {
  return ComposeAll(from, s * DifferenceAll(to, from));
}

std::vector<Pose> ProjectPoses(const System& system, std::vector<Pose> poses) {
  const int m = system.num_rows();
  if (m == 0) return poses;
  const VectorX none = VectorX::Zero(m), still = VectorX::Zero(6 * static_cast<Eigen::Index>(poses.size()));
  for (int i = 0; i < 12; ++i) {
    const Linearization at = Linearize(system, poses, still, none, 0, true);
    if (at.c.lpNorm<Eigen::Infinity>() < 1e-14) break;
    const MatrixX W = at.M.llt().solve(at.J.transpose());
    poses = ComposeAll(poses, -W * (at.J * W).ldlt().solve(at.c));
  }
  return poses;
}

VectorX ProjectVelocity(const System& system, const std::vector<Pose>& poses, const VectorX& V) {
  const int m = system.num_rows();
  if (m == 0) return V;
  const Linearization at = Linearize(system, poses, V, VectorX::Zero(m), 0, true);
  const MatrixX W = at.M.llt().solve(at.J.transpose());
  return V - W * (at.J * W).ldlt().solve(at.J * V);
}

State MakeState(const System& system, const std::vector<Pose>& poses, const VectorX& V) {
  State state;
  state.poses = ProjectPoses(system, poses);
  state.V = ProjectVelocity(system, state.poses, V);
  state.lambda = VectorX::Zero(system.num_rows());
  state.p = Linearize(system, state.poses, state.V, state.lambda, 0, false).p;
  state.p_rate = VectorX::Zero(state.p.size());
  const std::size_t contacts = system.contacts.size();
  state.xi.assign(contacts, Vector3::Zero());
  state.xi_rate = state.phi = state.xi;
  state.closed.assign(contacts, 0);
  for (std::size_t i = 0; i < contacts; ++i)
    state.closed[i] = ComputeContact(system.contacts[i], state.poses).gap < 1e-9 ? 1 : 0;
  return state;
}

ContactReading ReadContact(const System&, const ContactPair& contact, const State& state) {
  const ContactGeometry g = ComputeContact(contact, state.poses);
  ContactReading out{g.gap, Vector3::Zero()};
  if (contact.a >= 0) out.velocity += g.J_a * state.V.segment<6>(6 * contact.a);
  if (contact.b >= 0) out.velocity += g.J_b * state.V.segment<6>(6 * contact.b);
  return out;
}

VectorX AppliedForce(const System& system, const State& state) {
  return Linearize(system, state.poses, state.V, state.lambda, 0, false).f;
}

double PotentialEnergy(const System& s, const State& state) {
  double energy = 0;
  for (std::size_t i = 0; i < s.bodies.size(); ++i)
    energy -= s.bodies[i].mass * s.gravity.dot(state.poses[i].x);
  for (const PointSpring& e : s.springs) {
    const double stretch = TwoPoints(state.poses, e.a, e.b, e.point_a, e.point_b).d.norm() - e.rest_length;
    energy += 0.5 * e.stiffness * stretch * stretch;
  }
  for (const TorsionSpring& e : s.torsions) {
    const double turn = HingeAngle(e, state) - e.target;
    energy += 0.5 * e.stiffness * turn * turn;
  }
  for (std::size_t i = 0; i < s.contacts.size(); ++i) {
    const double depth = std::max(0., -ComputeContact(s.contacts[i], state.poses).gap);
    energy += 0.5 * s.contact_stiffness * (depth * depth + state.xi[i].squaredNorm());
  }
  return energy;
}

double KineticEnergy(const System& s, const State& state) {
  double energy = 0;
  for (std::size_t i = 0; i < s.bodies.size(); ++i) {
    const auto at = 6 * static_cast<Eigen::Index>(i);
    const Vector3 L = state.poses[i].R.transpose() * state.p.segment<3>(at);
    energy += 0.5 * L.cwiseAbs2().dot(s.bodies[i].inertia.cwiseInverse()) +
              0.5 * state.p.segment<3>(at + 3).squaredNorm() / s.bodies[i].mass;
  }
  return energy;
}

Vector3 AngularMomentum(const System& s, const State& state) {
  Vector3 L = Vector3::Zero();
  for (std::size_t i = 0; i < s.bodies.size(); ++i) {
    const auto at = 6 * static_cast<Eigen::Index>(i);
    L += state.p.segment<3>(at) + state.poses[i].x.cross(Vector3(state.p.segment<3>(at + 3)));
  }
  return L;
}

double HingeAngle(const TorsionSpring& e, const State& state) {
  return AngleAbout(e.axis, PoseOf(state.poses, e.b).R.transpose() * PoseOf(state.poses, e.a).R);
}

}  // namespace fork1s::lab
