// Mass matrix, Jacobians and forces of a simulation at its present state, in the velocities of its file.
//
// Natural velocities w: of each mechanism the twist of a floating base in its axes about its origin, then q̇; of each free
// body its twist in world axes about its origin. With the velocities of the file v = T w, a matrix M and forces f in w are
// T⁻ᵀ M T⁻¹ and T⁻ᵀ f in v.
#pragma once

#include <fork1s/importer/file_state.hpp>
#include <fork1s/mechanism/kinematics.hpp>
#include <fork1s/sim/simulation.hpp>
#include <string>
#include <vector>

namespace fork1s {

/// Controls that hold a state at rest, as nearly as least squares find.
struct HoldingControls {
  // Of the mechanisms, in the order of Simulation::control_names(), within their limits; of those with dynamics the
  // activation.
  VectorX controls;
  VectorX residual;  // N or N·m on each velocity of the file, what no control and no loop balances
};

class FileDynamics {
 public:
  /// `joints`: those that move (MovingJoints), of the file that the scene of `simulation` was read from, which must
  /// outlive this.
  FileDynamics(const Simulation& simulation, const std::vector<FileJoint>& joints);

  /// n x n, kg, kg·m and kg·m²: kinetic energy is ½ vᵀ M v. Armature included; loops open, as in MuJoCo.
  MatrixX ComputeMassMatrix() const;
  /// 6 x n: angular velocity of a body, by its place in Simulation::bodies(), and velocity of its point `point_B`,
  /// world axes.
  MatrixX ComputeJacobian(int body, const Vector3& point_B) const;
  /// n, N and N·m: of gravity on all bodies, less what is compensated.
  VectorX ComputeGravityForce() const;
  /// n: of springs and of what servos hold: the stiffness of joints and tendons, and controls at their set-points, or
  /// activations where they have dynamics, within their bounds of force; without dampers.
  VectorX ComputeSpringAndControlForce() const;
  /// Which controls make the forces of springs, controls and gravity vanish in the present pose, with rigid loops as they
  /// are closed and without contact.
  HoldingControls ComputeHoldingControls() const;

  int size() const { return static_cast<int>(to_natural_.cols()); }

 private:
  struct Part {
    const Mechanism* mechanism = nullptr;
    Kinematics kinematics;
    VectorX q;
    VectorX controls;  // of those with dynamics their activations
    RigidTransform X_WR;
    bool floats = false;
    Eigen::Index first = 0;  // natural velocity
    Eigen::Index size() const { return q.size() + (floats ? 6 : 0); }
    Eigen::Index first_joint() const { return first + (floats ? 6 : 0); }
  };
  void AddSpringAndControlForce(const Part& part, const VectorX& controls, VectorX& f) const;

  const Simulation& simulation_;
  std::vector<Part> parts_;           // per mechanism of the scene
  Eigen::Index first_free_body_ = 0;  // natural velocity
  std::vector<RigidTransform> X_WF_;  // per free body
  MatrixX to_natural_;                // T⁻¹
};

}  // namespace fork1s
