#include <fork1s/reduction/compliance.hpp>

#include "elastic_basis.hpp"
#include "free_motions.hpp"
#include "linalg/products.hpp"
#include "locked_basis.hpp"
#include "world_axes.hpp"

namespace fork1s {
InterfaceCompliance DenseCompliance(const Mechanism& mechanism, const VectorX& q,
                                    const std::vector<BodyIndex>& bodies, const std::vector<int>& locked) {
  const double L = mechanism.length_scale();
  const int n = mechanism.num_coordinates();
  Kinematics kinematics(mechanism);
  ComputeKinematics(mechanism, q, kinematics);
  const internal::ElasticBasis basis = internal::ComputeElasticBasis(mechanism, kinematics, q);
  const MatrixX J =
      internal::InLengths(internal::ScaledInterfaceJacobian(mechanism, kinematics, bodies, 1.0), L);
  const internal::LockedBasis motions = internal::LockCoordinates(basis, n, locked);
  const internal::FreeMotions free = internal::FreeMotionsOf(Times(J, motions.free));
  const MatrixX closed = internal::WithLocked(basis.DenseClosed(n), basis.scale, locked);
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
  const internal::LockedBasis motions = internal::LockCoordinates(basis, n, locked);
  const MatrixX felt = internal::FreeMotionsOf(Times(J, motions.free)).Without(Times(J, motions.elastic));
  // With Vᵀ K V = 1 the answer to joint forces g is q = V Vᵀ g.
  const MatrixX response = TimesTransposed(felt, motions.elastic);
  return Times(internal::WorldAxes(mechanism, bodies.size()), internal::FromLengths(response, L));
}

}  // namespace fork1s
