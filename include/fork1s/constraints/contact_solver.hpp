// The Coulomb contact solver. It knows operators, not mechanisms.
//
// Unknown impulses λ act on velocities with symmetric positive definite implicit operators A = L Lᵀ, one
// block a mechanism or body, which the solver sees through Y = L⁻¹ Jᵀ of its ports (six-vectors) and rows:
//     v⁺ = v* + Yᵀ Σ Y p
// Contact c couples up to two ports. With w = Σ J v⁺ + bias (normal first, then two tangents), R its compliance
// and λ₀ its impulse in the last step,
//     λ_n = max(0, −w_n/R_n),   y = λ₀_t − w_t/R_t,   λ_t = y min(1, µ λ_n/|y|)
// so Coulomb's law holds on w + R (λ − λ₀). R makes the impulses of redundant points unique and distributes
// them as an elastic pad would. Moments m of a contact (torsional friction about the normal, rolling friction about
// the tangents) follow the same law with angular velocities, bounded by a radius times λ_n. Limits are single rows on one velocity, λ = clamp(λ₀ − w/R, lower, upper): a joint limit only pushes,
// dry friction pushes either way up to its force. docs/method.md, section 6.
#pragma once

#include <fork1s/base/types.hpp>
#include <limits>
#include <memory>
#include <vector>

namespace fork1s {

using Matrix36 = Eigen::Matrix<double, 3, 6>;

/// A decoupled block: `size` rows starting at `offset` of the stacked velocities.
struct VelocityBlock {
  int offset = 0;
  int size = 0;
  const double* Y = nullptr;  // freedoms x size, column-major, leading dimension `stride`; not owned
  int stride = 0;
  int freedoms = 0;
};

struct ContactConstraint {
  int port_a = -1;  // first row of a six-vector in the stacked velocities, -1: the still world
  int port_b = -1;  // u = J_a v[port_a] + J_b v[port_b] + bias; rows: normal, tangent 1, tangent 2
  Matrix36 J_a = Matrix36::Zero();
  Matrix36 J_b = Matrix36::Zero();
  /// m/s, added to u. Normal: gap and restitution (material.hpp); tangents: what a surface moves by within itself,
  /// as a belt does, of b less that of a.
  Vector3 bias = Vector3::Zero();
  double spin = 0;      // rad/s, added to the angular velocity about the normal, likewise
  double friction = 0;  // µ
  /// Coefficients along the tangents are these shares a_k of µ. Friction is bounded by the ellipse
  /// Σ (λ_k/(a_k µ))² <= λ_n² and opposes the slip w that dissipates most, λ_k = −µ λ_n a_k² w_k/|a w|.
  Vector2 friction_scale = Vector2::Ones();
  /// Least share of the larger of both coefficients: a tangent without friction has a row nevertheless.
  static constexpr double kMinFrictionScale = 1e-9;
  Vector3 impulse = Vector3::Zero();  // in: warm start; out: solution [N·s]
  double torsion = 0;                 // m: |moment about the normal| <= torsion λ_n
  double rolling = 0;                 // m: the same about either tangent
  Vector3 moment = Vector3::Zero();   // about normal and tangents; in: warm start; out: solution [N·m·s]
  /// R_n, R_t [m/s per N·s]; 0: hard, 1e-11 of the inverse mass. Contacts between the same two ports have
  /// the compliance of the stiffest of them. Along a tangent with a smaller a_k R_t is larger by (max a/a_k)².
  double compliance_normal = 0, compliance_tangent = 0;
  /// Beyond `hardening_speed` λ_n is proportional to this power of what it presses in by, so that a heavy load presses in
  /// little deeper and an interference bears a bounded load.
  static constexpr int kHardeningExponent = 8;
  /// m/s: R_n λ_n above which the material hardens, unless the contact gives way. R_n is that under the
  /// normal impulse of the last step.
  double hardening_speed = std::numeric_limits<double>::infinity();
  Vector3 previous_impulse = Vector3::Zero();  // λ₀, in this frame
  double previous_utilization = 0;             // of the last step
  double utilization = 0;                      // out: |y| as a share of µ λ_n: above 1 it slides
  /// Out: no force keeps it from closing, since what presses on it is driven or cannot part; it bears what its material
  /// gives.
  bool gives_way = false;
  Vector3 previous_moment = Vector3::Zero();
  bool may_be_deferred =
      false;  // it is likely to stay open, and takes part only where the others alone would close it

  /// Coefficient in the direction of a tangential impulse, which the ellipse bounds to this times λ_n; the larger one
  /// where it is 0.
  double FrictionAlong(const Vector2& tangential) const {
    const double largest = friction_scale.maxCoeff(), length = tangential.norm();
    if (!(length > 0) || friction_scale[0] == friction_scale[1]) return friction * largest;
    return friction * length /
           tangential.cwiseQuotient(friction_scale.cwiseMax(kMinFrictionScale * largest)).norm();
  }
  /// Whether a solve begins without it.
  bool IsDeferred() const { return may_be_deferred && impulse.isZero(0); }
  /// First row of w [m/s] at stacked velocities; below 0 it closes.
  double NormalSpeed(const Eigen::Ref<const VectorX>& velocities) const {
    double w = bias[0];
    if (port_a >= 0) w += J_a.row(0).dot(velocities.segment<6>(port_a));
    if (port_b >= 0) w += J_b.row(0).dot(velocities.segment<6>(port_b));
    return w;
  }
  /// Impulse on the port whose rows are J: the linear part of the rows are the axes.
  Vector6 ImpulseOn(const Matrix36& J) const {
    Vector6 p = J.transpose() * impulse;
    if (torsion > 0 || rolling > 0) p.head<3>() += J.rightCols<3>().transpose() * moment;
    return p;
  }
};

/// One row w = sign · v[row] + bias with an impulse λ along sign: w = 0 (but for R) where λ is within its
/// bounds, w ≥ 0 at the lower, w ≤ 0 at the upper. By default unilateral, as a joint limit.
struct LimitConstraint {
  int row = 0;
  double sign = 1;
  double bias = 0;
  double impulse = 0;  // in: warm start; out: solution
  double lower = 0;    // of the impulse
  double upper = std::numeric_limits<double>::infinity();
  double compliance = 0;        // R, as of contacts
  double previous_impulse = 0;  // impulse of the last step, of rows that must not creep
};

struct ContactSolverOptions {
  double tolerance = 1e-10;  // of the velocities that contact changes, all weighed by inertia
  int max_newton_iterations = 60;
  /// Upper bound of R as a share of the inverse mass at the contact, so that an impact within a step leaves at
  /// most this share of the approach speed, however soft the material.
  double max_relative_regularization = 1e-3;
};

struct ContactSolverReport {
  /// Factorizations of the whole problem. Low-rank updates between them are not counted.
  int newton_iterations = 0;
  /// Fallback that was used: 0 none; 1 continuation in the dilatancy; 2 Tresca iterations, with friction bounds held
  /// fixed; 3 those with increased compliance; 4 continuation in the friction coefficient.
  int fallback = 0;
  double residual = 0;          // of the velocities that contact changes, as `tolerance`
  double residual_impulse = 0;  // N·s: the same as an error of the largest contact impulse
  double residual_speed = 0;    // m/s: the same as an error of the largest change of a contact velocity
  int active = 0, sticking = 0, sliding = 0;  // contacts with an impulse, and of these
  bool converged = true;                      // residual <= tolerance
};

class ContactSolver {
 public:
  ContactSolver();
  ~ContactSolver();
  ContactSolver(ContactSolver&&) noexcept;
  ContactSolver& operator=(ContactSolver&&) noexcept;

  /// Reserves scratch so that solves up to this size do not allocate.
  /// `num_freedoms`: of the largest block that may have more of them than rows.
  void Reserve(int num_contacts, int num_limits, int num_velocities, int num_freedoms = 0);

  /// Solves for the impulses. In: `velocities` = v*, blocks covering every port and limit row, warm starts in
  /// the constraints. Out: impulses in the constraints, `velocities` = v⁺. A contact whose sides
  /// are both fixed, or whose columns of Y vanish, gets no impulse. Input that is not finite: no impulses,
  /// `velocities` unchanged, converged = false.
  ContactSolverReport Solve(const std::vector<VelocityBlock>& blocks,
                            std::vector<ContactConstraint>& contacts, std::vector<LimitConstraint>& limits,
                            Eigen::Ref<VectorX> velocities, const ContactSolverOptions& options = {});

 private:
  struct Workspace;
  std::unique_ptr<Workspace> work_;
};

}  // namespace fork1s
