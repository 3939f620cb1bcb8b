// A reduced mechanism to second order about a pose, against differences of what it is at poses near by.
#include <gtest/gtest.h>
#include <random_mechanism.hpp>

#include "reduction/expansion.hpp"
#include "reduction/reduced_jacobian.hpp"

namespace fork1s {
namespace {

using testing::RandomMechanismOptions;
using testing::RandomSource;

constexpr double kTurnOfDifference =
    1e-5;  // of z that turns some joint by as much: differences are off by 1e-10 and rounding by 1e-11

// What is asked at a pose, by the exact routines.
struct ExactPose {
  ExactPose(const ReducedModel& model, const VectorX& z) : configuration(model) {
    ReducedState state;
    state.z = z;
    state.w = VectorX::Zero(model.size());
    configuration.closing_tolerance = 1e-14;
    Configure(model, state, configuration);
    Configure(model, state, configuration);
    const Mechanism& m = *model.mechanism;
    ReducedJacobian jacobian(model);
    jacobian.Compute(model, configuration);
    M.setZero(model.size(), model.size());
    Matrix6 M_00;
    Matrix6X M_0z(6, model.size());
    ReducedInertia(model).Compute(model, RigidParts(m), configuration, jacobian, M, M_0z, M_00);
    D = configuration.Q_now.transpose() * DampingMatrix(m, configuration.kinematics, configuration.q) *
        configuration.Q_now;
    VectorX tau;
    SpringForce(m, configuration.kinematics, configuration.q, tau);
    spring_force = configuration.Q_now.transpose() * tau;
    weight_force.resize(model.size(), 3);
    for (int axis = 0; axis < 3; ++axis) {
      Matrix6X F = Matrix6X::Zero(6, m.num_bodies());
      AddGravityWrenches(m, configuration.kinematics, Vector3::Unit(axis), F);
      tau.setZero();
      AccumulateGeneralizedForce(m, configuration.kinematics.S, F, tau);
      weight_force.col(axis) = configuration.Q_now.transpose() * tau;
    }
  }

  Matrix6X Twists(const ReducedModel& model, BodyIndex body) const {
    return BodyJacobian(*model.mechanism, configuration.kinematics, body) * configuration.Q_now;
  }
  MatrixX JointVelocities(const ReducedModel& model) const {
    return testing::JointVelocityMap(*model.mechanism, configuration.q) * configuration.Q_now;
  }

  Configuration configuration;
  MatrixX M, D;
  VectorX spring_force;
  MatrixX weight_force;
};

struct BentModel {
  std::shared_ptr<const Mechanism> mechanism;
  ReducedModel model;
  VectorX z;
};

BentModel BendAtRandom(const RandomMechanismOptions& options, unsigned seed) {
  const auto m = std::make_shared<const Mechanism>(testing::RandomMechanism(seed, options));
  ReductionOptions reduction;
  reduction.promote_hidden = true;
  auto model = Reduce(m, VectorX::Zero(m->num_coordinates()), reduction);
  if (!model) throw std::runtime_error(model.error().Text());
  BentModel out{m, *model, RandomSource(seed + 900).Vector(model->size(), 1)};
  out.z *= 0.3 / std::max(1e-9, (model->Q * out.z).cwiseAbs().maxCoeff());
  return out;
}

template <class Difference>
void ExpectSlope(const MatrixX& found, const Difference& expected, double scale, const char* what) {
  EXPECT_LT((found - expected).cwiseAbs().maxCoeff(), 1e-7 * scale) << what;
}

void ExpectExpansion(const RandomMechanismOptions& options, unsigned seed) {
  const BentModel drawn = BendAtRandom(options, seed);
  const ReducedModel& model = drawn.model;
  const Mechanism& m = *drawn.mechanism;
  const int r = model.size();
  if (r == 0) return;
  const ExactPose here(model, drawn.z);
  const Expansion expansion = Expand(model, drawn.z, here.configuration);
  EXPECT_LT((expansion.M - here.M).norm(), 1e-12 * here.M.norm());
  EXPECT_LT((expansion.spring_force - here.spring_force).norm(), 1e-12 * (1 + here.spring_force.norm()));
  EXPECT_LT((expansion.weight_force - here.weight_force).norm(), 1e-12 * (1 + here.weight_force.norm()));

  EXPECT_LT((expansion.D - here.D).norm(), 1e-12 * (1 + here.D.norm()));
  // Dampers of springy closures and along paths stay as they are.
  const bool damped_paths =
      options.springy_closures > 0 ||
      std::any_of(m.springs().begin(), m.springs().end(), [](const auto& s) { return s.length.path >= 0; });

  std::vector<BodyExpansion> bodies;
  for (BodyIndex b : model.interfaces) bodies.push_back(ExpandBody(model, expansion, b));
  MatrixX velocities(r * r,
                     r);  // ∂/∂z_i of momenta of z', as the pose z* feels them, and of joint velocities
  for (int i = 0; i < r; ++i) {
    SCOPED_TRACE(i);
    const double step = kTurnOfDifference / model.Q.col(i).cwiseAbs().maxCoeff();
    VectorX delta = VectorX::Zero(r);
    delta(i) = step;
    const ExactPose after(model, drawn.z + delta), before(model, drawn.z - delta);
    const auto slope = [&](const auto& a, const auto& b) { return MatrixX((a - b) / (2 * step)); };
    const MatrixX G_i = Eigen::Map<const MatrixX>(expansion.G.col(i).data(), r, r);
    const double reach = 1 / step * kTurnOfDifference;
    ExpectSlope(G_i + G_i.transpose(), slope(after.M, before.M), reach * here.M.cwiseAbs().maxCoeff() + 1,
                "M");
    if (!damped_paths) {
      const MatrixX D_i = Eigen::Map<const MatrixX>(expansion.D_slope.col(i).data(), r, r);
      ExpectSlope(D_i + D_i.transpose(), slope(after.D, before.D), here.D.cwiseAbs().maxCoeff() + 1, "D");
    }
    ExpectSlope(expansion.spring_slope.col(i), slope(after.spring_force, before.spring_force),
                expansion.spring_slope.cwiseAbs().maxCoeff() + 1, "springs");
    for (int axis = 0; axis < 3; ++axis)
      ExpectSlope(Eigen::Map<const MatrixX>(expansion.weight_slope.col(axis).data(), r, r).col(i),
                  slope(after.weight_force.col(axis), before.weight_force.col(axis)),
                  expansion.weight_slope.cwiseAbs().maxCoeff() + 1, "weight");
    MatrixX momenta = here.JointVelocities(model).transpose() * m.armature().asDiagonal() *
                      slope(after.JointVelocities(model), before.JointVelocities(model));
    for (int b = 0; b < m.num_bodies(); ++b) {
      const auto momentum = [&](const ExactPose& at) {
        const SpatialInertia& own = m.bodies()[static_cast<std::size_t>(b)].inertia_B;
        return MatrixX(
            Transform(at.configuration.kinematics.X_RB[static_cast<std::size_t>(b)], own).Matrix() *
            at.Twists(model, BodyIndex(b)));
      };
      momenta += here.Twists(model, BodyIndex(b)).transpose() * slope(momentum(after), momentum(before));
    }
    velocities.col(i) = Eigen::Map<const VectorX>(momenta.data(), r * r);

    for (const BodyExpansion& body : bodies) {
      const Matrix6X bend = slope(after.Twists(model, body.body), before.Twists(model, body.body));
      RigidTransform X;
      Matrix6X J_after(6, r), J_before(6, r);
      EvaluateBody(body, delta, X, J_after);
      const RigidTransform& X_exact = after.configuration.kinematics.X_RB[body.body.u()];
      EXPECT_LT(Log(X.inverse() * X_exact).norm(), 1e-12 * (1 + reach)) << "pose";
      EvaluateBody(body, -delta, X, J_before);
      ExpectSlope(slope(J_after, J_before), bend, bend.cwiseAbs().maxCoeff() + 1, "twists");
    }
  }
  // Momenta of a body about a point of z*, not of z': they differ by what is antisymmetric in the two
  // displacements.
  const auto both = [&](const MatrixX& of, int k, int i, int j) {
    return of(k + r * j, i) + of(k + r * i, j);
  };
  double most = 0, off = 0;
  for (int k = 0; k < r; ++k)
    for (int i = 0; i < r; ++i)
      for (int j = 0; j < r; ++j) {
        most = std::max(most, std::abs(both(velocities, k, i, j)));
        off = std::max(off, std::abs(both(expansion.G, k, i, j) - both(velocities, k, i, j)));
      }
  EXPECT_LT(off, 1e-7 * (most + 1)) << "momenta";
}

TEST(Expansion, Hinges) {
  for (unsigned seed = 0; seed < 10; ++seed) {
    SCOPED_TRACE(seed);
    RandomMechanismOptions options;
    options.hinges_only = true;
    options.bodies = 3 + static_cast<int>(seed % 6);
    ExpectExpansion(options, seed);
  }
}

TEST(Expansion, JointsOfAllKinds) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    SCOPED_TRACE(seed);
    RandomMechanismOptions options;
    options.bodies = 3 + static_cast<int>(seed % 6);
    options.springs = 2;
    options.rest = true;
    ExpectExpansion(options, seed);
  }
}

TEST(Expansion, Loops) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    SCOPED_TRACE(seed);
    RandomMechanismOptions options;
    options.bodies = 5 + static_cast<int>(seed % 6);
    options.rigid_closures = 1 + static_cast<int>(seed % 2);
    options.couplings = 1;
    options.rest = true;
    ExpectExpansion(options, seed);
  }
}

TEST(Expansion, SpringyClosures) {
  for (unsigned seed = 0; seed < 10; ++seed) {
    SCOPED_TRACE(seed);
    RandomMechanismOptions options;
    options.bodies = 5;
    options.springy_closures = 1;
    options.rigid_closures = static_cast<int>(seed % 2);
    ExpectExpansion(options, seed);
  }
}

}  // namespace
}  // namespace fork1s
