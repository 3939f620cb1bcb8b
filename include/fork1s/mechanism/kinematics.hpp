// Poses, Jacobians, closures and inertia of a mechanism at any q.
//
// Product of exponentials (docs/method.md, section 2): with P_j the product of Exp(S_i q_i) over the
// joints before and including j, X_RB(q) = P_last(B) X_RB0. The present screws
//     S_j(q) = Ad(P_previous(j)) dexp(S_j q_j) S_j
// are spatial, so the Jacobian of every body is the same matrix with the columns off its path zeroed.
#pragma once

#include <fork1s/mechanism/mechanism.hpp>
#include <vector>

namespace fork1s {

/// A path at a pose: its length and what every coordinate adds to it.
struct PathState {
  double length = 0;           // m, or rad of an angle
  Mechanism::LinearForm arms;  // coordinate, ∂length/∂q; the path's coordinates, in their order
};

/// Scratch and result of a pass over the mechanism at one q. Sized once, reused without allocation.
struct Kinematics {
  explicit Kinematics(const Mechanism& mechanism);

  std::vector<RigidTransform> P;     // per joint: prefix including the joint
  std::vector<RigidTransform> X_RB;  // per body
  Matrix6X S;                        // present screws, 6 x n
  std::vector<PathState> paths;      // per Mechanism::paths()
  std::vector<double> muscles;       // lengths, per Mechanism::muscles()
};

/// Fills prefixes, body poses, present screws, paths and lengths of muscles at q [n].
void ComputeKinematics(const Mechanism& mechanism, const VectorX& q, Kinematics& out);

/// f(coordinate, ∂length/∂q) for every term of a length, paths as `paths` has them.
template <class F>
void ForEachArm(const Mechanism::Length& length, const std::vector<PathState>& paths, F&& f) {
  for (const auto& [i, c] : length.terms) f(i, c);
  if (length.path < 0) return;
  for (const auto& [i, arm] : paths[static_cast<std::size_t>(length.path)].arms) f(i, length.gear * arm);
}
/// What a length is at q, counted from the reference; `kinematics` of the same q.
double LengthOf(const Mechanism& mechanism, const Mechanism::Length& length, const Kinematics& kinematics,
                const VectorX& q);

/// E(q) [3 x 3] with ω = E θ̇: the angular velocity of the joint's body relative to what the joint hangs on, by
/// components along the axes W of the joint, which move with the body; E = W⁻¹ J_r W with the right Jacobian J_r of
/// the exponential at W θ. With W the body's axes these are MuJoCo's velocities of a ball joint.
Matrix3 AngularVelocityMap(const Mechanism& mechanism, const Kinematics& kinematics,
                           const Mechanism::Rotation& rotation);
/// Eᵀ diag(weights) E with the three entries of `weights` (n) that belong to the rotation: its armature or damping in
/// the coordinates θ.
Matrix3 WeightedRotationBlock(const Mechanism& mechanism, const Kinematics& kinematics,
                              const Mechanism::Rotation& rotation, const VectorX& weights);
/// Joint velocities ν (n): ω for rotations, q̇ for all other coordinates. Dampers act by -d ν, kinetic energy of the
/// armature is ½ νᵀ a ν.
void ComputeJointVelocities(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q_dot,
                            VectorX& nu);
/// ν̇ (n) at joint accelerations q_ddot.
void ComputeJointAccelerations(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q,
                               const VectorX& q_dot, const VectorX& q_ddot, VectorX& nu_dot);
/// τ -= (∂ν/∂q̇)ᵀ a ν̇: inertial forces of the armature a at joint rates and accelerations.
void SubtractArmatureForces(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q,
                            const VectorX& q_dot, const VectorX& q_ddot, VectorX& tau);
/// f <- (∂ν/∂q̇)ᵀ f: forces on ν [n] as forces on q.
void ConvertToCoordinateForces(const Mechanism& mechanism, const Kinematics& kinematics, VectorX& f);

/// Jacobian of body b (6 x n): twist in R about R's origin per coordinate rate.
Matrix6X BodyJacobian(const Mechanism& mechanism, const Kinematics& kinematics, BodyIndex b);

/// τ += Σ_b J_bᵀ F_b for wrenches F (6 x bodies, in R about R's origin). `F` is used as scratch: on
/// return column b holds the wrench gathered over the subtree of b, column 0 the total.
void AccumulateGeneralizedForce(const Mechanism& mechanism, const Matrix6X& S, Matrix6X& F, VectorX& tau);

/// Wrench of a uniform gravity field g_R [m/s²] on every body (6 x bodies), added to F.
void AddGravityWrenches(const Mechanism& mechanism, const Kinematics& kinematics, const Vector3& g_R,
                        Matrix6X& F);

/// Residual c(q) of the rigid closures and couplings (num_constraints).
void ClosureResidual(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q, VectorX& c);
/// Jacobian A = ∂c/∂q (num_constraints x n).
void ClosureJacobian(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q, MatrixX& A);

/// Coordinates between the two bodies of a closure: on the way up from its body b, then from its body a, to
/// where the ways meet. No other moves its two frames against each other.
std::vector<int> ClosureCoordinates(const Mechanism& mechanism, const ClosureDef& closure);
/// Derivatives of rigid directions of a closure by those coordinates in that order: of the six errors those
/// `rows` that `components` names, from `stride` to `stride`, zeros between. The stride is a multiple of four, 8 at most.
void ClosureRows(const Mechanism& mechanism, const ClosureDef& closure, const Kinematics& kinematics,
                 const int* components, int rows, int stride, double* values);

/// Largest opening [m] of the rigid closures: distance of the joined points, and rotation error times the
/// mechanism's length scale.
double ClosureGap(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q);

/// Joint-space mass matrix at the present pose (n x n), armature included.
void MassMatrix(const Mechanism& mechanism, const Kinematics& kinematics, MatrixX& M);
/// Inertia of the whole mechanism about R's origin (6 x 6) and its coupling to the joints (6 x n).
void BaseInertia(const Mechanism& mechanism, const Kinematics& kinematics, Matrix6& M_00, Matrix6X& M_0q);
/// Subtracts from F the wrenches that keep every body on its present course: centrifugal and Coriolis forces
/// of the joint rates q_dot and of the base twist V_R at zero acceleration of ξ and joint accelerations
/// q_ddot (n). Joints of several freedoms bring the rate of their dexp. `V` (6 x bodies) and `A` are scratch.
void SubtractVelocityWrenches(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q,
                              const Vector6& V_R, const VectorX& q_dot, const VectorX& q_ddot, Matrix6X& V,
                              Matrix6X& A, Matrix6X& F);
/// Subtracts from F the wrenches I_b A_R + ξ x* (I_b ξ) that keep every body on the rigid motion of the base,
/// twist ξ and acceleration A_R of R in R: inertial, centrifugal and Coriolis forces as the frame R feels
/// them.
void SubtractRigidMotionWrenches(const Mechanism& mechanism, const Kinematics& kinematics, const Vector6& V_R,
                                 const Vector6& A_R, Matrix6X& F);
/// M x without forming M: O(n).
void ApplyMass(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& x, VectorX& Mx);

/// Force of all springs at rest-relative displacement: τ = f0 - K q, springy closures included.
void SpringForce(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q, VectorX& tau);
/// Stiffness matrix K_q (n x n) of joint springs, linear springs and springy closures at the present pose.
/// What a loaded path or closure adds by turning its arms is not in it: forces bring that by themselves.
MatrixX StiffnessMatrix(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q);
MatrixX DampingMatrix(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q);
/// Energy stored in all springs that have a potential [J].
double SpringEnergy(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q);
/// τ += control forces for inputs u (one per Mechanism::controls()), of muscles those of their activations at rest.
void AddControlForce(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& u,
                     VectorX& tau);

/// τ += what muscles give beyond AddControlForce at the joint rates q_dot.
void AddMuscleRateForce(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& activation,
                        const VectorX& q_dot, VectorX& tau);

/// Moves q onto the closures by Gauss-Newton in the metric H = max(k, 1e-3 k_max). Returns the gap left [m].
/// Used to repair an initial pose; `max_iterations` Newton steps at most.
double CloseLoops(const Mechanism& mechanism, VectorX& q, int max_iterations = 50);

}  // namespace fork1s
