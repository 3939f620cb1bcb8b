// The rows of the contact solve: contacts, stops, dry friction and forces with bounds, and what they move.
#pragma once

#include <utility>
#include <vector>

#include "stops.hpp"
#include "world/island_solver.hpp"

namespace fork1s {

/// Ports, limits and dry frictions of one part of a mechanism, or (the last one) of groups that only follow
/// its driven base. Rows stand in this order: six a port, one a limit, a friction, a force with bounds.
struct PartRows {
  std::vector<int> groups;          // in port order
  std::vector<int> limits;          // 2 k + side of entries k of length_limits(), side 0 lower, 1 upper
  std::vector<int> frictions;       // of the mechanism, all that this part moves
  std::vector<int> bounded_forces;  // of the mechanism that are rows, in the order in which they came
  int offset = 0, size = 0;         // in the stacked velocities
  int room = 0;                     // rows beyond these that bounded forces may ask for
  MatrixX J_T;                      // velocities of the part x size
  MatrixX Y;                        // L⁻¹ J_T
  VectorX impulse;                  // size: N s, N m s

  Eigen::Index LimitRow(std::size_t k) const { return static_cast<Eigen::Index>(6 * groups.size() + k); }
  Eigen::Index FrictionRow(std::size_t k) const { return LimitRow(limits.size() + k); }
  Eigen::Index BoundedForceRow(std::size_t k) const { return FrictionRow(frictions.size() + k); }
};

struct MechanismRows {
  std::vector<PartRows> parts;
  std::size_t first_limit = 0;  // of its rows in ConstraintRows::limits
  VectorX impulse;              // num_velocities: Jᵀ times the impulses of all parts
};

/// Rows of a switched closure that acts (switched_closures.hpp): turns, then displacements, of b less those of a.
struct SwitchedRows {
  int closure = 0;
  int group = 0;                                         // of ConstraintRows::closure_groups
  int port_a = -1, port_b = -1;                          // as of ContactConstraint
  Matrix6 J_a = Matrix6::Zero(), J_b = Matrix6::Zero();  // rows of directions that it leaves free are 0
  Vector6 rate = Vector6::Zero();                        // rad/s, m/s: J v
  Vector6 impulse = Vector6::Zero();                     // N m s, N s, on b
  Matrix3 axes_W = Matrix3::Identity();                  // of these
  Vector3 point_W = Vector3::Zero();
};

/// Blocks of velocities that switched closures join, from `begin` to `end` of the stacked ones, and their elimination.
struct ClosureGroup {
  int begin = 0, end = 0;
  std::vector<int> units;                   // of AssignPorts
  MatrixX Y;                                // of all blocks; then of what the closures leave free
  std::vector<std::pair<int, int>> places;  // closure and its row, per column of G
  VectorX unit;                             // factor of each column
  MatrixX Q, R, C;                          // G = Q R by columns `pivots`; C = Qᵀ Y
  std::vector<int> pivots;
  VectorX r, y;  // J v* less what is asked for, in units of the columns; -R⁻ᵀ r
  VectorX p, lambda, scratch;
};

/// Of the contact solve at hand.
struct ConstraintRows {
  // Places in the stacked velocities, per collision body.
  std::vector<int> port_offset;             // -1: takes no part
  std::vector<int> port_part;               // PartRows of its mechanism
  std::vector<RigidTransform> port_frames;  // that twists of ports are given in and about

  std::vector<MechanismRows> mechanisms;
  std::vector<Matrix6> free_Y;              // per free body
  std::vector<VelocityBlock> blocks;        // of all that takes part
  std::vector<ContactConstraint> contacts;  // per contact point
  std::vector<LimitConstraint>
      limits;                // by mechanism and part: limits, then frictions; last the bounded forces
  VectorX velocities;        // m/s, rad/s: free ones, then those of the solution
  VectorX start_velocities;  // of a stage of backward Euler: at its start

  std::vector<double> pulls;  // N s, of adhesion, per contact point against its normal on b; empty: none acts
  VectorX pull_impulse, pull_scratch;
  double PullOf(std::size_t contact) const { return pulls.empty() ? 0 : pulls[contact]; }

  std::vector<SwitchedRows> closures;
  std::vector<ClosureGroup> closure_groups;

  // Forces with bounds that are rows, whose `limits` stand last, in this order.
  struct BoundedForce {
    std::size_t mechanism = 0, part = 0, row_in_part = 0, index = 0;
  };
  std::vector<BoundedForce> bounded_forces;
  LimitConstraint& LimitOfBoundedForce(std::size_t k) {
    return limits[limits.size() - bounded_forces.size() + k];
  }
  const LimitConstraint& LimitOfBoundedForce(std::size_t k) const {
    return limits[limits.size() - bounded_forces.size() + k];
  }

  // What the impulse of one contact does to the ports of both sides.
  struct Push {
    bool any = false;
    int body_a = -1, body_b = -1;
    int port_a = -1, port_b = -1;
    Vector6 on_a, on_b;
  };
  std::vector<Push> pushes;     // per contact
  std::vector<char> is_pushed;  // per collision body
};

/// Velocity of b less that of a in the frame of a contact.
inline Vector3 RelativeSpeed(const ContactConstraint& c, const VectorX& velocities) {
  Vector3 speed = Vector3::Zero();
  if (c.port_a >= 0) speed += c.J_a * velocities.segment<6>(c.port_a);
  if (c.port_b >= 0) speed += c.J_b * velocities.segment<6>(c.port_b);
  return speed;
}

}  // namespace fork1s
