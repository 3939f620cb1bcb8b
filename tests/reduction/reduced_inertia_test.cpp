// The inertia of a moved pose, by composite bodies, against the sum over bodies by their own Jacobians.
#include <gtest/gtest.h>
#include <limits>
#include <random>
#include <random_mechanism.hpp>

#include "reduction/reduced_jacobian.hpp"

namespace fork1s {
namespace {

using testing::RandomMechanismOptions;

// Poses away from the reference; loops need not close for an inertia to be one.
void ExpectInertiaOfBodies(const RandomMechanismOptions& options, unsigned seed) {
  const auto m = std::make_shared<const Mechanism>(testing::RandomMechanism(seed, options));
  ReductionOptions reduction;
  reduction.promote_hidden = true;
  const auto model = Reduce(m, VectorX::Zero(m->num_coordinates()), reduction);
  ASSERT_TRUE(model.has_value()) << model.error().Text();
  const int r = model->size();
  ReducedState state;
  std::mt19937 engine(seed);
  std::uniform_real_distribution<double> uniform(-0.3, 0.3);
  state.z = VectorX::NullaryExpr(r, [&] { return uniform(engine); });
  state.w = VectorX::Zero(r);
  Configuration c(*model);
  Configure(*model, state, c);

  MatrixX M_zz(r, r);
  Matrix6X M_0z(6, r);
  Matrix6 M_00;
  ReducedJacobian jacobian(*model);
  jacobian.Compute(*model, c);
  // Between them the two write all of it.
  M_zz.setConstant(std::numeric_limits<double>::quiet_NaN());
  ReducedInertia inertia(*model);
  ReducedInertia::ClearApart(jacobian, M_zz);
  inertia.Compute(*model, RigidParts(*m), c, jacobian, M_zz, M_0z, M_00);

  const MatrixX map = testing::JointVelocityMap(*m, c.q) * c.Q_now;
  MatrixX expected = map.transpose() * m->armature().asDiagonal() * map;
  Matrix6X coupled = Matrix6X::Zero(6, r);
  Matrix6 whole = Matrix6::Zero();
  for (int b = 0; b < m->num_bodies(); ++b) {
    const Matrix6 I = Transform(c.kinematics.X_RB[static_cast<std::size_t>(b)],
                                m->bodies()[static_cast<std::size_t>(b)].inertia_B)
                          .Matrix();
    const Matrix6X T = BodyJacobian(*m, c.kinematics, BodyIndex(b)) * c.Q_now;
    expected += T.transpose() * I * T;
    coupled += I * T;
    whole += I;
  }
  // Sums of some ten bodies in two orders.
  EXPECT_LT((M_zz - expected).norm(), 1e-13 * expected.norm());
  if (m->base() != BaseKind::kFixed) {
    EXPECT_LT((M_0z - coupled).norm(), 1e-13 * coupled.norm());
  }
  EXPECT_LT((M_00 - whole).norm(), 1e-13 * whole.norm());
}

TEST(ReducedInertia, IsThatOfTheBodies) {
  for (unsigned seed = 0; seed < 30; ++seed) {
    SCOPED_TRACE(seed);
    RandomMechanismOptions options;
    options.base = seed % 2 == 0 ? BaseKind::kFixed : BaseKind::kFloating;
    options.bodies = 3 + static_cast<int>(seed % 9);
    ExpectInertiaOfBodies(options, seed);
    options.rigid_closures = 1;
    options.couplings = 1;
    ExpectInertiaOfBodies(options, seed);
  }
}

}  // namespace
}  // namespace fork1s
