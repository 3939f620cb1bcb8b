// The rigid parts of a mechanism, their velocities as material sees them, and the momentum of one pose as
// another pose feels it.
//
// A part is all that moves with one joint. Its velocity is v = (ċ, ω): of the centre of mass, and the angular
// rate in the part's own axes, with the kinetic metric
//     <v, v'> = m ċ·ċ' + ω·I ω',   I about the centre.
// In these coordinates inertia is constant. Left alone the centre moves straight on and ω turns as that of a
// free body; both keep their energy. Velocity forces need no formula: they come from seeing the same v from
// the next pose (docs/method.md, section 5).
#pragma once

#include <fork1s/mechanism/kinematics.hpp>
#include <vector>

namespace fork1s {

/// One entry per joint, after the base: part j + 1 is carried by joint j, part 0 is the base.
struct RigidParts {
  explicit RigidParts(const Mechanism& mechanism);

  struct Part {
    SpatialInertia inertia_R0;  // in R at q = 0; mass 0 where only another joint hangs on this one
  };
  std::vector<Part> parts;

  /// Parts with an inertia to turn, four at a time; the last four may hold fewer, its first again in the others.
  struct Four {
    int count = 0;
    int part[4];
    Eigen::Array4d xx, xy, xz, yy, yz, zz;  // of rotational
  };
  std::vector<Four> turning;

  int size() const { return static_cast<int>(parts.size()); }
};

/// v of every part: centres along the axes of R at the time they were taken, turns in the part's axes.
struct MaterialVelocities {
  Matrix3X c_dot;  // 3 x parts [m/s]
  Matrix3X omega;  // 3 x parts [rad/s]
  Matrix6X twist;  // 6 x parts, scratch
};

/// Velocities at joint rates q_dot [n] and base twist V_R. Does not allocate where `out` has its size.
void ComputeMaterialVelocities(const Mechanism& mechanism, const RigidParts& parts,
                               const Kinematics& kinematics, const VectorX& q_dot, const Vector6& V_R,
                               MaterialVelocities& out);

/// ω of every part after it turned freely for a time t [s], as TurnFreely of one body has it.
void TurnFreely(const RigidParts& parts, double t, MaterialVelocities& v);

/// F [6 x parts] += factor times the momentum of velocities `v` as the parts of `kinematics` feel it: the
/// wrench p in R about R's origin with p·V = <v, velocity under V>. `R_now_then` turns the axes of R then to
/// those now.
void AddMomentum(const RigidParts& parts, const Kinematics& kinematics, const MaterialVelocities& v,
                 const Matrix3& R_now_then, double factor, Matrix6X& F);

/// Centre of mass of the whole in R.
Vector3 CenterOfParts(const RigidParts& parts, const Kinematics& kinematics);

/// τ += Σ J_partᵀ F_part. F is used as scratch: column 0 becomes the total.
void GatherFromParts(const Mechanism& mechanism, const Matrix6X& S, Matrix6X& F, VectorX& tau);

}  // namespace fork1s
