// The rigid parts of a mechanism, their velocities as material sees them, and the momentum of one pose as
// another pose feels it.
//
// A part is all that moves with one joint. Its motion in space is x = (R, c): axes and centre of mass, with
// the kinetic metric
//     <ẋ, ẏ> = m ċ·ċ' + tr(Ṙ Σ Ṙ'ᵀ),   Σ = ∫ p pᵀ dm about the centre at q = 0.
// In these coordinates inertia is constant, and bodies move straight on unless forced: velocity forces need
// no formula, they come from seeing the same ẋ from the next pose (docs/method.md, section 5).
#pragma once

#include <fork1s/mechanism/kinematics.hpp>
#include <vector>

namespace fork1s {

/// One entry per joint, after the base: part j + 1 is carried by joint j, part 0 is the base.
struct RigidParts {
  explicit RigidParts(const Mechanism& mechanism);

  struct Part {
    SpatialInertia inertia_R0;  // in R at q = 0; mass 0 where only another joint hangs on this one
    Matrix3 second_moment;      // Σ, axes of R at q = 0 [kg·m²]
  };
  std::vector<Part> parts;

  int size() const { return static_cast<int>(parts.size()); }
};

/// ẋ of every part: rates of centres and axes along the axes of R at the time they were taken.
struct MaterialVelocities {
  Matrix3X c_dot;  // 3 x parts [m/s]
  Matrix3X R_dot;  // 3 x (3 parts) [1/s]
  Matrix6X twist;  // 6 x parts, scratch
};

/// Velocities at joint rates q_dot [n] and base twist V_R. Does not allocate where `out` has its size.
void ComputeMaterialVelocities(const Mechanism& mechanism, const RigidParts& parts,
                               const Kinematics& kinematics, const VectorX& q_dot, const Vector6& V_R,
                               MaterialVelocities& out);

/// F [6 x parts] += factor times the momentum of velocities `x` as the parts of `kinematics` feel it: the
/// wrench p in R about R's origin with p·V = <x, velocity under V>. `R_now_then` turns the axes of R then to
/// those now.
void AddMomentum(const RigidParts& parts, const Kinematics& kinematics, const MaterialVelocities& x,
                 const Matrix3& R_now_then, double factor, Matrix6X& F);

/// Centre of mass of the whole in R.
Vector3 CenterOfParts(const RigidParts& parts, const Kinematics& kinematics);

/// τ += Σ J_partᵀ F_part. F is used as scratch: column 0 becomes the total.
void GatherFromParts(const Mechanism& mechanism, const Matrix6X& S, Matrix6X& F, VectorX& tau);

}  // namespace fork1s
