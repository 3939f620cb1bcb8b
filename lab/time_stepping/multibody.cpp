#include "multibody.hpp"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/QR>
#include <cmath>
#include <fork1s/constraints/contact_solver.hpp>
#include <fork1s/spatial/rigid_transform.hpp>

namespace fork1s::lab {

namespace {

using Matrix36X = Eigen::Matrix<double, 3, Eigen::Dynamic>;

Pose PoseOf(const std::vector<Pose>& poses, int body) {
  return body < 0 ? Pose{} : poses[static_cast<std::size_t>(body)];
}

// Everything of one pose and velocity that a Newton iteration needs.
struct Linearization {
  VectorX p, f, c;    // p(V, x), f(x, V), constraints
  VectorX f_abs;      // sum of the magnitudes of f's terms, the scale of its rounding
  MatrixX A_p, K, D;  // dp/dV for x = x̂ ⊕ b V, −∂f/∂x, −∂f/∂V
  MatrixX G, J;       // −∂(Jᵀλ)/∂x, ∂c/∂x
  MatrixX M;          // inertia in world axes
};

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

Linearization Linearize(const System& s, const std::vector<Pose>& poses, const VectorX& V,
                        const VectorX& lambda, double b, bool derivatives, bool geometric = true) {
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

struct ContactGeometry {
  double gap;
  Matrix3 frame;      // rows: normal, tangents
  Matrix36 J_a, J_b;  // of the relative velocity in that frame
};

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

double KineticNorm(const MatrixX& M, const VectorX& r) {
  return std::sqrt(std::max(0., r.dot(M.llt().solve(r))));
}

}  // namespace

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

void SolveStage(const System& system, const StageInput& input, const StageSettings& settings, State* state,
                Counts* counts) {
  const double b = input.b;
  const int m = system.num_rows();
  const Eigen::Index size = input.p.size();
  const std::size_t num_contacts = system.contacts.size();
  const bool from_start =
      settings.newton == Newton::kStart || settings.newton == Newton::kDisplacementFromStart;
  const bool by_rate = settings.form == ConstraintForm::kRate;
  const auto close = [&](const std::vector<Pose>& poses) {
    return by_rate ? ProjectPoses(system, poses) : poses;
  };

  const bool to_momentum =
      settings.newton == Newton::kMomentum || settings.newton == Newton::kExtrapolatedMomentum;
  const bool once = settings.newton == Newton::kStart || settings.newton == Newton::kPredicted ||
                    settings.newton == Newton::kExtrapolated;
  const VectorX V_last = state->V;
  VectorX V = V_last;
  if ((settings.newton == Newton::kExtrapolated || settings.newton == Newton::kExtrapolatedMomentum) &&
      state->V_before.size() > 0)
    V += input.advance / state->time_between * (V - state->V_before);
  std::vector<Pose> poses;
  if (from_start) {
    V = DifferenceAll(state->poses, input.poses) / b;
    poses = state->poses;
  } else {
    poses = close(ComposeAll(input.poses, b * V));
  }
  ++counts->stages;
  VectorX p = input.p, lambda = state->lambda;
  std::vector<Vector3> phi = state->phi, xi = input.xi;
  double before = 1e300, step_size = 1e300, V_size = 1;
  bool solved = false;
  // Line search: what the last solve asked for, and the share of it that is taken.
  VectorX V_from, V_step, lambda_from, lambda_step;
  double share = 1;
  Eigen::PartialPivLU<MatrixX> last_factor;
  static thread_local ContactSolver solver;
  // Where Newton has not converged after kPatience iterations it begins again without the stiffness that is
  // proportional to forces (Gauss-Newton), which far from the answer are not those of the answer.
  constexpr int kPatience = 15;
  bool gauss_newton = false;
  for (int iteration = 0;; ++iteration) {
    if ((settings.newton == Newton::kResidual || to_momentum) && iteration == kPatience) {
      gauss_newton = true;
      V = V_last;
      lambda = state->lambda;
      phi = state->phi;
      V_step = VectorX();
      poses = close(ComposeAll(input.poses, b * V));
    }
    const Linearization at = Linearize(system, poses, V, lambda, b, true, !gauss_newton);
    ++counts->evaluations;
    std::vector<ContactGeometry> geometry;
    VectorX contact_force = VectorX::Zero(size);
    for (std::size_t i = 0; i < num_contacts; ++i) {
      const ContactPair& c = system.contacts[i];
      geometry.push_back(ComputeContact(c, poses));
      const Vector3 local = geometry[i].frame * phi[i];
      if (c.a >= 0) contact_force.segment<6>(6 * c.a) += geometry[i].J_a.transpose() * local;
      if (c.b >= 0) contact_force.segment<6>(6 * c.b) += geometry[i].J_b.transpose() * local;
    }
    const VectorX reaction = at.J.transpose() * lambda;
    const VectorX r = at.p - input.p - b * (at.f + reaction + contact_force);
    const double merit = KineticNorm(at.M, r);
    const double scale =
        KineticNorm(at.M, at.p.cwiseAbs() + input.p.cwiseAbs() +
                              b * (at.f_abs + reaction.cwiseAbs() + contact_force.cwiseAbs()));
    // Natural monotonicity test (Deuflhard): the next correction by the last factor is no longer than the
    // last one was.
    if ((settings.newton == Newton::kResidual || to_momentum) && V_step.size() > 0 && share > 1. / 64 &&
        merit > 1e-6 * scale && iteration < settings.max_iterations) {
      VectorX next(size + m);
      next.head(size) = -r;
      next.tail(m) = by_rate ? VectorX(-at.J * V) : VectorX(-at.c / b);
      const VectorX correction = last_factor.solve(next).head(size);
      if (correction.dot(at.M * correction) > 2 * V_step.dot(at.M * V_step)) {
        share *= 0.5;
        V = V_from + share * V_step;
        lambda = lambda_from + share * lambda_step;
        poses = close(ComposeAll(input.poses, b * V));
        continue;
      }
    }
    share = 1;
    if (gauss_newton && merit < 1e-3 * scale) gauss_newton = false;
    if (settings.newton == Newton::kResidual && iteration > 0) {
      double residual = merit / std::max(scale, 1e-300);
      if (m > 0)
        residual =
            std::max(residual, (by_rate ? b * (at.J * V) : at.c).lpNorm<Eigen::Infinity>() / system.size);
      const double increment = step_size / std::max(V_size + b * system.gravity.norm(), 1e-12);
      const bool tight = iteration != kPatience && residual <= settings.residual_tolerance &&
                         (num_contacts == 0 || increment <= 1e-9);
      const bool stalled = iteration > 4 && residual < 1e-8 && increment < 1e-8 && residual > 0.5 * before;
      before = residual;
      if (tight || stalled || iteration >= settings.max_iterations) {
        solved = tight || stalled;
        counts->largest_residual = std::max(counts->largest_residual, residual);
        break;
      }
    }
    if (to_momentum && iteration > 0 && iteration != kPatience) {
      const double residual = merit / std::max(scale, 1e-300);
      if (residual <= settings.momentum_tolerance || iteration >= settings.max_iterations) {
        solved = residual <= settings.momentum_tolerance;
        break;
      }
    }
    // A δ − b Jᵀ λ = −r + b Jᵀ λ_old, and rows of the constraints
    const MatrixX A = at.A_p + b * at.D + b * b * (gauss_newton ? at.K : MatrixX(at.K + at.G));
    MatrixX kkt = MatrixX::Zero(size + m, size + m);
    kkt.topLeftCorner(size, size) = A;
    kkt.topRightCorner(size, m) = -at.J.transpose();
    kkt.bottomLeftCorner(m, size) = at.J;
    VectorX rhs(size + m);
    rhs.head(size) = -r - b * reaction;
    rhs.tail(m) = by_rate ? VectorX(-at.J * V) : VectorX(-at.c / b);
    last_factor.compute(kkt);
    const Eigen::PartialPivLU<MatrixX>& lu = last_factor;
    VectorX answer = lu.solve(rhs);
    VectorX contact_impulse = VectorX::Zero(size);
    if (num_contacts > 0) {
      // Response to impulses within what rigid constraints allow: Yᵀ Y = N (Nᵀ A N)⁻¹ Nᵀ
      MatrixX N = MatrixX::Identity(size, size);
      if (m > 0) {
        const Eigen::HouseholderQR<MatrixX> qr(at.J.transpose());
        N = (qr.householderQ() * MatrixX::Identity(size, size)).rightCols(size - m);
      }
      Eigen::LLT<MatrixX> root(N.transpose() * (0.5 * (A + A.transpose())) * N);
      if (root.info() != Eigen::Success)
        root.compute(N.transpose() *
                     (at.M + b * at.D + b * b * MatrixX(at.K.diagonal().cwiseMax(0.).asDiagonal())) * N);
      const MatrixX Y = root.matrixL().solve(MatrixX(N.transpose()));
      VectorX velocities = V + answer.head(size) - Y.transpose() * (Y * (b * contact_force));
      const VelocityBlock block{0, static_cast<int>(size), Y.data(), static_cast<int>(Y.rows()),
                                static_cast<int>(Y.rows())};
      std::vector<ContactConstraint> contacts(num_contacts);
      std::vector<LimitConstraint> limits;
      const double k = system.contact_stiffness;
      for (std::size_t i = 0; i < num_contacts; ++i) {
        const ContactPair& pair = system.contacts[i];
        const ContactGeometry& g = geometry[i];
        ContactConstraint& c = contacts[i];
        c.friction = pair.friction;
        double moved = 0;  // J_n V of the velocity that belongs to the pose at hand
        if (pair.a >= 0) {
          c.port_a = 6 * pair.a;
          c.J_a = g.J_a;
          moved += g.J_a.row(0).dot(V.segment<6>(6 * pair.a));
        }
        if (pair.b >= 0) {
          c.port_b = 6 * pair.b;
          c.J_b = g.J_b;
          moved += g.J_b.row(0).dot(V.segment<6>(6 * pair.b));
        }
        const double reach = b + system.contact_damping_time;
        c.compliance_normal = 1 / (b * reach * k);
        c.compliance_tangent = 1 / (b * b * k);
        c.held = -b * k * (g.frame * input.xi[i]);
        c.held.x() = 0;
        c.bias.x() = (g.gap - b * moved) / reach;
        if (input.restitution_speed.size() > 0 && input.restitution_speed(static_cast<Eigen::Index>(i)) > 0) {
          c.compliance_normal = c.compliance_tangent = 0;
          c.held.setZero();
          c.bias.x() = -input.restitution_speed(static_cast<Eigen::Index>(i));
        }
        c.impulse = b * (g.frame * phi[i]);
      }
      ContactSolverOptions options;
      options.tolerance = 1e-12;
      options.most_give = 1e12;
      solver.Solve({block}, contacts, limits, velocities, options);
      for (std::size_t i = 0; i < num_contacts; ++i) {
        const ContactPair& pair = system.contacts[i];
        const Vector3 local = contacts[i].impulse;
        if (pair.a >= 0) contact_impulse.segment<6>(6 * pair.a) += geometry[i].J_a.transpose() * local;
        if (pair.b >= 0) contact_impulse.segment<6>(6 * pair.b) += geometry[i].J_b.transpose() * local;
        const Vector3 impulse = geometry[i].frame.transpose() * local;
        const Vector3 normal = geometry[i].frame.row(0).transpose();
        phi[i] = impulse / b;
        xi[i] = -(impulse - normal * normal.dot(impulse)) / (b * k);
      }
      rhs.head(size) += contact_impulse - b * contact_force;
      answer = lu.solve(rhs);
    }
    ++counts->iterations;
    const VectorX delta = answer.head(size);
    V_from = V;
    V_step = delta;
    lambda_from = lambda;
    lambda_step = answer.tail(m) / b - lambda;
    lambda = answer.tail(m) / b;
    // Momentum by the impulses of this linear solve: internal ones cancel exactly.
    p = input.p + b * (at.f - at.D * delta - b * ((gauss_newton ? at.K : MatrixX(at.K + at.G)) * delta)) +
        at.J.transpose() * answer.tail(m) + contact_impulse;
    V += delta;
    step_size = delta.norm();
    V_size = V.norm();
    const std::vector<Pose> found = close(ComposeAll(input.poses, b * V));
    const VectorX moved = DifferenceAll(found, poses);
    poses = found;
    if (once) {
      solved = true;
      break;
    }
    if (settings.newton != Newton::kResidual && !to_momentum) {
      double largest = 0;
      for (Eigen::Index i = 0; i < size; i += 6)
        largest =
            std::max({largest, moved.segment<3>(i).norm(), moved.segment<3>(i + 3).norm() / system.size});
      if (largest <= settings.displacement_tolerance || iteration + 1 >= settings.max_iterations) {
        solved = largest <= settings.displacement_tolerance;
        break;
      }
    }
    if (!V.allFinite() && iteration >= kPatience) break;
    if (!V.allFinite()) iteration = kPatience - 1;
  }
  if (!solved) ++counts->unconverged;
  state->poses = poses;
  state->V_before = V_last;
  state->time_between = input.advance;
  state->V = V;
  state->p = p;
  state->p_rate = (p - input.p) / b;
  state->lambda = lambda;
  state->phi = phi;
  for (std::size_t i = 0; i < num_contacts; ++i) {
    // What opens has no rate: ξ = 0 is no motion of the surfaces.
    state->xi_rate[i] = phi[i].isZero(0) ? Vector3(Vector3::Zero()) : Vector3((xi[i] - input.xi[i]) / b);
  }
  state->xi = xi;
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

double ConstraintGap(const System& s, const State& state) {
  if (s.num_rows() == 0) return 0;
  return Linearize(s, state.poses, state.V, state.lambda, 0, false).c.lpNorm<Eigen::Infinity>();
}

double HingeAngle(const TorsionSpring& e, const State& state) {
  return AngleAbout(e.axis, PoseOf(state.poses, e.b).R.transpose() * PoseOf(state.poses, e.a).R);
}

}  // namespace fork1s::lab
