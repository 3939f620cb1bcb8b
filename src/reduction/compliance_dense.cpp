#include <fork1s/linalg/products.hpp>
#include <fork1s/reduction/compliance.hpp>

#include "elastic_basis.hpp"
#include "free_motions.hpp"
#include "world_axes.hpp"

namespace fork1s {

InterfaceCompliance DenseCompliance(const Mechanism& mechanism, const VectorX& q,
                                    const std::vector<BodyIndex>& bodies) {
  const double L = mechanism.length_scale();
  const int n = mechanism.num_coordinates();
  Kinematics kinematics(mechanism);
  ComputeKinematics(mechanism, q, kinematics);
  const internal::ElasticBasis basis = internal::ComputeElasticBasis(mechanism, kinematics, q);
  const MatrixX J =
      internal::InLengths(internal::ScaledInterfaceJacobian(mechanism, kinematics, bodies, 1.0), L);
  const MatrixX moved = Times(J, ScaledRows(basis.scale, basis.FreeInOneUnit(n)));
  const internal::FreeMotions free = internal::FreeMotionsOf(moved);
  InterfaceCompliance out = internal::Assemble(mechanism, basis.TimesV(J), free, J * basis.DenseClosed(n));
  out.doubts = basis.doubts;
  return out;
}

MatrixX InterfaceResponse(const Mechanism& mechanism, const VectorX& q,
                          const std::vector<BodyIndex>& bodies) {
  const double L = mechanism.length_scale();
  const int n = mechanism.num_coordinates();
  Kinematics kinematics(mechanism);
  ComputeKinematics(mechanism, q, kinematics);
  const internal::ElasticBasis basis = internal::ComputeElasticBasis(mechanism, kinematics, q);
  const MatrixX J =
      internal::InLengths(internal::ScaledInterfaceJacobian(mechanism, kinematics, bodies, 1.0), L);
  const MatrixX moved = Times(J, ScaledRows(basis.scale, basis.FreeInOneUnit(n)));
  const MatrixX felt = internal::FreeMotionsOf(moved).Without(basis.TimesV(J));
  // With Vᵀ K V = 1 the answer to joint forces g is q = V Vᵀ g.
  const MatrixX response = TimesTransposed(felt, basis.TimesV(MatrixX::Identity(n, n)));
  return Times(internal::WorldAxes(mechanism, bodies.size()), internal::FromLengths(response, L));
}

}  // namespace fork1s
