// The Coulomb contact solver. It knows operators, not mechanisms.
//
// Unknown impulses λ act on stacked velocities v through symmetric positive semidefinite operators W
// (the interface's inverse effective mass, implicit stiffness included), one block a mechanism or body:
//     v⁺ = v* + W Jᵀ λ
// Contact c couples up to two six-vector ports. With u = Σ J v⁺ + bias (normal first, then two tangents):
//     0 ≤ λ_n ⊥ u_n ≥ 0,   |λ_t| ≤ µ λ_n,   λ_t opposes u_t where it slides
// Where a contact bears moments m too (torsional friction about the normal, rolling friction about the
// tangents), each stays within its radius times λ_n and opposes the relative turning about its axis where
// that turns. Limits are single rows on one stacked velocity whose impulse has bounds: a joint limit only
// pushes, dry friction pushes either way up to its force.
#pragma once

#include <fork1s/base/types.hpp>
#include <limits>
#include <memory>
#include <vector>

namespace fork1s {

using Matrix36 = Eigen::Matrix<double, 3, 6>;

/// A diagonal block of W: `size` rows starting at `offset` of the stacked velocities.
struct VelocityBlock {
  int offset = 0;
  int size = 0;
  const double* W = nullptr;  // size x size, column-major, leading dimension `stride`; not owned
  int stride = 0;
};

struct ContactConstraint {
  int port_a = -1;  // first row of a six-vector in the stacked velocities, -1: the still world
  int port_b = -1;  // u = J_a v[port_a] + J_b v[port_b] + bias; rows: normal, tangent 1, tangent 2
  Matrix36 J_a = Matrix36::Zero();
  Matrix36 J_b = Matrix36::Zero();
  Vector3 bias = Vector3::Zero();     // m/s, added to u
  double friction = 0;                // µ
  Vector3 impulse = Vector3::Zero();  // in: warm start; out: solution [N·s]
  double torsion = 0;                 // m: |moment about the normal| <= torsion λ_n
  double rolling = 0;                 // m: the same about either tangent
  Vector3 moment = Vector3::Zero();   // about normal and tangents; in: warm start; out: solution [N·m·s]

  /// Impulse on the port whose rows are J: the linear part of the rows are the axes.
  Vector6 ImpulseOn(const Matrix36& J) const {
    Vector6 p = J.transpose() * impulse;
    if (torsion > 0 || rolling > 0) p.head<3>() += J.rightCols<3>().transpose() * moment;
    return p;
  }
};

/// One row u = sign · v[row] + bias with an impulse λ along sign: u = 0 where λ is within its bounds, u ≥ 0
/// at the lower, u ≤ 0 at the upper. By default unilateral, as a joint limit: 0 ≤ λ ⊥ u ≥ 0.
struct LimitConstraint {
  int row = 0;
  double sign = 1;
  double bias = 0;
  double impulse = 0;  // in: warm start; out: solution
  double lower = 0;    // of the impulse
  double upper = std::numeric_limits<double>::infinity();
};

struct ContactSolverOptions {
  int max_sweeps = 50;
  double tolerance = 1e-4;  // residual above which Newton takes over
  int max_newton_iterations = 30;
  int max_splitting_iterations = 300;  // of the method that helps Newton over a stall
  int max_newton_rows = 450;  // 3 a contact, 1 a limit: Newton is dense, so larger problems only sweep
};

struct ContactSolverReport {
  int sweeps = 0;
  int newton_iterations = 0;
  int splitting_iterations = 0;
  double residual = 0;    // natural-map residual, relative to impulses and to speeds
  bool fallback = false;  // a grossly failed solve was replaced by one that only takes energy
  bool converged = true;  // residual <= tolerance, without fallback
};

class ContactSolver {
 public:
  ContactSolver();
  ~ContactSolver();
  ContactSolver(ContactSolver&&) noexcept;
  ContactSolver& operator=(ContactSolver&&) noexcept;

  /// Reserves scratch so that solves up to this size do not allocate.
  /// `num_moments`: 1 a contact with torsional friction, 3 with rolling friction too.
  void Reserve(int num_contacts, int num_limits, int num_velocities, int num_moments = 0);

  /// Solves for the impulses. In: `velocities` = v*, blocks covering every port and limit row, warm starts in
  /// the constraints. Out: impulses in the constraints, `velocities` = v⁺. A contact that nothing can move
  /// (both sides still, or rows of W that vanish) gets no impulse and does not count in the residual. Input
  /// that is not finite: no impulses, `velocities` as they were, converged = false.
  ContactSolverReport Solve(const std::vector<VelocityBlock>& blocks,
                            std::vector<ContactConstraint>& contacts, std::vector<LimitConstraint>& limits,
                            Eigen::Ref<VectorX> velocities, const ContactSolverOptions& options = {});

 private:
  struct Workspace;
  std::unique_ptr<Workspace> work_;
};

}  // namespace fork1s
