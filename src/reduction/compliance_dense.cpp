#include <fork1s/linalg/null_space.hpp>
#include <fork1s/linalg/products.hpp>
#include <fork1s/linalg/select.hpp>
#include <fork1s/linalg/solve.hpp>
#include <fork1s/reduction/compliance.hpp>

#include "elastic_basis.hpp"
#include "free_motions.hpp"
#include "world_axes.hpp"

namespace fork1s {
namespace {

// Elastic and free motions with coordinates locked. Let N be the free motions (q = N a) and p the locked
// coordinates. Under joint forces g the springs give q = V Vᵀ g up to N a; the forces r that lock p make
// Nᵀ(g + r) = 0, and a makes q_p = 0. Hence q = Π V (Π V)ᵀ g with Π V = V − N (N_p)⁺ V_p.
struct LockedBasis {
  MatrixX elastic;  // n x elastic: Π V
  MatrixX free;     // n x what is left of the free motions
};

LockedBasis LockCoordinates(const internal::ElasticBasis& basis, int n, const std::vector<int>& locked) {
  const MatrixX V = basis.TimesV(MatrixX::Identity(n, n)), N_x = basis.FreeInOneUnit(n);
  if (locked.empty()) return {V, ScaledRows(basis.scale, N_x)};
  const MatrixX N_p = Rows(N_x, locked);
  const NullSpace held = ComputeNullSpace(N_p);
  const MatrixX V_p = ScaledRows(Entries(basis.scale, locked).cwiseInverse(), Rows(V, locked));
  const MatrixX taken = Times(Times(N_x, held.seen), SolveSquare(Times(N_p, held.seen), V_p));
  return {V - ScaledRows(basis.scale, taken), ScaledRows(basis.scale, Times(N_x, held.unseen))};
}

}  // namespace

InterfaceCompliance DenseCompliance(const Mechanism& mechanism, const VectorX& q,
                                    const std::vector<BodyIndex>& bodies, const std::vector<int>& locked) {
  const double L = mechanism.length_scale();
  const int n = mechanism.num_coordinates();
  Kinematics kinematics(mechanism);
  ComputeKinematics(mechanism, q, kinematics);
  const internal::ElasticBasis basis = internal::ComputeElasticBasis(mechanism, kinematics, q);
  const MatrixX J =
      internal::InLengths(internal::ScaledInterfaceJacobian(mechanism, kinematics, bodies, 1.0), L);
  const LockedBasis motions = LockCoordinates(basis, n, locked);
  const internal::FreeMotions free = internal::FreeMotionsOf(Times(J, motions.free));
  MatrixX closed = basis.DenseClosed(n);
  if (!locked.empty()) {
    const VectorX to_one_unit = Entries(basis.scale, locked).cwiseInverse();
    closed = Times(closed, ComputeNullSpace(ScaledRows(to_one_unit, Rows(closed, locked))).unseen);
  }
  InterfaceCompliance out = internal::Assemble(mechanism, Times(J, motions.elastic), free, J * closed);
  out.locked = locked;
  out.doubts = basis.doubts;
  return out;
}

MatrixX InterfaceResponse(const Mechanism& mechanism, const VectorX& q, const std::vector<BodyIndex>& bodies,
                          const std::vector<int>& locked) {
  const double L = mechanism.length_scale();
  const int n = mechanism.num_coordinates();
  Kinematics kinematics(mechanism);
  ComputeKinematics(mechanism, q, kinematics);
  const internal::ElasticBasis basis = internal::ComputeElasticBasis(mechanism, kinematics, q);
  const MatrixX J =
      internal::InLengths(internal::ScaledInterfaceJacobian(mechanism, kinematics, bodies, 1.0), L);
  const LockedBasis motions = LockCoordinates(basis, n, locked);
  const MatrixX felt =
      internal::FreeMotionsOf(Times(J, motions.free)).Without(Times(J, motions.elastic));
  // With Vᵀ K V = 1 the answer to joint forces g is q = V Vᵀ g.
  const MatrixX response = TimesTransposed(felt, motions.elastic);
  return Times(internal::WorldAxes(mechanism, bodies.size()), internal::FromLengths(response, L));
}

}  // namespace fork1s
