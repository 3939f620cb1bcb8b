// A reduced mechanism to second order about a pose: what a step asks of it between two poses, without its
// joints.
//
// docs/method.md, section 2. With δ = z - z* from the pose at z*, loops closed,
//     X_B = Exp(T δ + ½ A[δ, δ]) X_B*                       pose of a body in R
//     M = M* + G(δ) + G(δ)ᵀ,   G(δ)_kj = Σ_i G_kji δ_i      inertia
//     f = f* + F δ                                          forces of springs and weight
//     D = D* + D'(δ) + D'(δ)ᵀ                               dampers
// G are the Christoffel symbols of the first kind, Σ Jᵀ m ∂J/∂z_i over all that has mass. Momenta of a pose
// z' as another pose z feels them, J(z)ᵀ m J(z') w', are M* w' + G(δ)ᵀ w' + G(δ') w'.
//
// Formulas by inertias of all that a joint carries (Featherstone, Rigid Body Dynamics Algorithms, 6.2), in R
// about R's origin. S_j are present screws, q_j rows of ∂q/∂z, T the twists per rate of z of what stands
// before a coordinate, I and P = Σ I T what it carries, x and x* the spatial cross product and its dual:
//     T_j = T + S_j q_j,   A_j = A + ½ sym(c_j q_j) + S_j q''_j,   c_j = T x S_j
//     G_k(ij) = Σ_j sym_ij [q_k X_ij / 2 + q_i Y_kj] + (P_k·S_j + a_j q_k) q''_ij
//     X_ij = -c_i·I T_j - q_i e_j,   Y_kj = ½ (c_k·I T_j + T_k·(T_j x* I S_j) + e_k q_j + P_k·c_j),   e = c·I
//     S_j
// and of loops q'' = -Bᵀ N with N = ∂²µ/∂z² = (A Bᵀ)⁻¹ D²c, D²c the second derivative of closure errors at
// fixed µ.
#pragma once

#include <fork1s/reduction/reduced_model.hpp>
#include <vector>

namespace fork1s {

/// Sizes: n joint coordinates, r reduced ones, m independent loop rows. Third-order arrays are matrices of
/// columns: those of r² rows have entry (k, j) of an r x r matrix in row k + r j.
struct Expansion {
  VectorX z;     // r
  VectorX q;     // n
  RowMatrixX Q;  // n x r, ∂q/∂z
  Matrix6X T;  // 6 x (n + 1) r: twists of what coordinate j moves in block j + 1 of r columns; block 0: none
  Matrix6X C;  // 6 x n r: c_j, with what joints of several freedoms add to T x S_j
  Matrix6X S;  // 6 x n, present screws
  MatrixX N;   // m x r², ∂²µ/∂z²
  MatrixX M;   // r x r
  MatrixX G;   // r² x r
  MatrixX D;   // r x r, damping
  MatrixX D_slope;       // r² x r: D + D'(δ) + D'(δ)ᵀ, as G; springs along paths stay as they are
  MatrixX K;             // r x r: stiffness of springs without what their loads are stiff by
  VectorX spring_force;  // r: f* of springs
  MatrixX spring_slope;  // r x r: F of springs
  MatrixX weight_force;  // r x 3: f* of weight, per unit of gravity along each axis of R
  MatrixX weight_slope;  // r² x 3: F of weight, likewise
  std::vector<RigidTransform> X_RB;  // per body
};

/// A body of an expansion.
struct BodyExpansion {
  BodyIndex body;
  RigidTransform X_RB;  // at z*
  Matrix6X T;           // 6 x r
  MatrixX
      A;  // 6r x r: entry (a, k) of the 6 x r matrix ∂T/∂z_i, its symmetric part, in row a + 6 k of column i
};

/// About the pose of `c`, which closes the loops exactly at z. O(n r³). Allocates.
Expansion Expand(const ReducedModel& model, const VectorX& z, const Configuration& c);
BodyExpansion ExpandBody(const ReducedModel& model, const Expansion& expansion, BodyIndex body);

/// ∂²/∂z² Σ weights_j q_j = Σ weights_j q''_j (r x r) by loops; 0 on trees. `weights` [n]
MatrixX SecondDerivative(const ReducedModel& model, const Expansion& expansion, const VectorX& weights);

/// Pose at δ [r], and J = dexp(ξ)(T + A[δ]) (6 x r), the twist in R about R's origin per rate of z. No
/// allocation where J has its size.
void EvaluateBody(const BodyExpansion& body, const VectorX& delta, RigidTransform& X_RB,
                  Eigen::Ref<Matrix6X> J);

}  // namespace fork1s
