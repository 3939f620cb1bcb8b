// What must hold for every mechanism, tried on random ones.
#include <gtest/gtest.h>
#include <fork1s/mechanism/set_stiffness.hpp>
#include <fork1s/reduction/compliance.hpp>
#include <fork1s/reduction/statics.hpp>
#include <mechanisms.hpp>
#include <random_mechanism.hpp>

#include "linalg/cholesky.hpp"
#include "linalg/products.hpp"

namespace fork1s {
namespace {

using testing::RandomMechanismOptions;
using testing::RandomSource;

constexpr unsigned kMechanisms = 30;

RandomMechanismOptions WithLoops() {
  RandomMechanismOptions options;
  options.rigid_closures = 2;
  options.springy_closures = 1;
  options.couplings = 1;
  options.coupling_terms = 1;
  options.springs = 2;
  return options;
}

std::vector<BodyIndex> InterfacesOf(const Mechanism& m) {
  std::vector<BodyIndex> bodies;
  for (const std::string& name : m.definition().interfaces) bodies.push_back(m.FindBody(name));
  return bodies;
}

void ExpectSameCompliance(const Mechanism& m, const VectorX& q, double tolerance) {
  const auto bodies = InterfacesOf(m);
  const auto walk = WalkCompliance(m, q, bodies), dense = DenseCompliance(m, q, bodies);
  EXPECT_LT(ComplianceDifference(walk, dense, m.length_scale()), tolerance);
}

TEST(ComplianceProperties, WalkIsDenseOnTrees) {
  for (unsigned seed = 0; seed < kMechanisms; ++seed) {
    SCOPED_TRACE(seed);
    RandomMechanismOptions options;
    options.stiffness_low = 1e-2;
    options.stiffness_high = 1e4;
    const auto m = testing::RandomMechanism(seed, options);
    ExpectSameCompliance(m, testing::RandomCoordinates(m, seed), 1e-10);
  }
}

TEST(ComplianceProperties, WalkIsDenseOnLoops) {
  int compared = 0;
  for (unsigned seed = 0; seed < kMechanisms; ++seed) {
    SCOPED_TRACE(seed);
    RandomMechanismOptions options = WithLoops();
    options.unsprung = seed % 3 == 0 ? 0.3 : 0;
    const auto m = testing::RandomMechanism(seed, options);
    compared += WalkCompliance(m, VectorX::Zero(m.num_coordinates()), InterfacesOf(m)).free.cols() == 0;
    ExpectSameCompliance(m, VectorX::Zero(m.num_coordinates()), 1e-8);
  }
  EXPECT_GT(compared, static_cast<int>(kMechanisms) / 2);
}

// The gradient by stiffness against the compliance itself, by the other method, at two stiffnesses.
TEST(ComplianceProperties, GradientIsThatOfTheWalk) {
  int sprung = 0;
  for (unsigned seed = 0; seed < kMechanisms; ++seed) {
    SCOPED_TRACE(seed);
    RandomMechanismOptions options = seed % 2 ? WithLoops() : RandomMechanismOptions();
    options.unsprung = seed % 3 == 0 ? 0.3 : 0;
    const auto m = testing::RandomMechanism(seed, options);
    const VectorX q = VectorX::Zero(m.num_coordinates());
    const MatrixX Y = InterfaceResponse(m, q, InterfacesOf(m));
    ASSERT_EQ(Y.cols(), m.num_coordinates());
    const double size = Y.squaredNorm();
    int coordinate = -1;
    for (std::size_t j = 0; j < m.definition().joints.size(); ++j)
      for (std::size_t f = 0; f < m.definition().joints[j].freedoms.size(); ++f) {
        ++coordinate;
        const double k = m.definition().joints[j].freedoms[f].stiffness;
        if (!(k > 0)) continue;
        const double step = 1e-4 * k;
        const auto at = [&](double stiffness) {
          const FreedomRef freedom{JointIndex(static_cast<int>(j)), static_cast<int>(f)};
          const auto changed = BuildMechanism(SetStiffness(m.definition(), freedom, stiffness));
          return WalkCompliance(*changed, q, InterfacesOf(*changed)).C;
        };
        const MatrixX slope = (at(k + step) - at(k - step)) / (2 * step);
        const VectorX y = Y.col(coordinate);
        // The central difference is off by (step / k)^2 of the slope, and by rounding of C over the step.
        // Where loops hold the bodies still, all is rounding of 1 / k^2.
        EXPECT_LT((slope + y * y.transpose()).cwiseAbs().maxCoeff(),
                  1e-6 * (y.squaredNorm() + 1e-3 * size) + 1e-16 / (k * k));
        ++sprung;
      }
  }
  EXPECT_GT(sprung, 100);
}

// The model, the basis of stiffness and the interface's view of it.
struct ReducedCase {
  ReducedCase(unsigned seed, const RandomMechanismOptions& options, const ReductionOptions& reduction)
      : mechanism(std::make_shared<const Mechanism>(testing::RandomMechanism(seed, options))),
        q0(VectorX::Zero(mechanism->num_coordinates())),
        model(Reduce(mechanism, q0, reduction)),
        kinematics(*mechanism) {
    ComputeKinematics(*mechanism, q0, kinematics);
    K = StiffnessMatrix(*mechanism, kinematics, q0);
  }
  std::shared_ptr<const Mechanism> mechanism;
  VectorX q0;
  Expected<ReducedModel> model;
  Kinematics kinematics;
  MatrixX K;
};

// QᵀKQ in double precision loses what stiffness ratios of 40 and a few dozen coordinates cost.
constexpr double kUnitRounding = 1e-9;

TEST(ReducedModelProperties, StiffnessIsDiagonal) {
  for (unsigned seed = 0; seed < 2 * kMechanisms; ++seed) {
    SCOPED_TRACE(seed);
    RandomMechanismOptions options = seed % 2 ? WithLoops() : RandomMechanismOptions();
    options.unsprung = 0.2;
    ReductionOptions reduction;
    reduction.promote_hidden = true;
    const ReducedCase r(seed, options, reduction);
    ASSERT_TRUE(r.model) << r.model.error().Text();
    const MatrixX K_r = Congruence(r.K, r.model->Q);
    EXPECT_LT((K_r - MatrixX(r.model->K_r.asDiagonal())).cwiseAbs().maxCoeff(), kUnitRounding);
    EXPECT_EQ(static_cast<int>(r.model->FreeColumns().size()), r.model->num_free);
    EXPECT_EQ(static_cast<int>(r.model->SprungColumns().size()), r.model->num_elastic + r.model->num_modes);
    // Reduced motions keep the loops closed to first order.
    MatrixX A;
    ClosureJacobian(*r.mechanism, r.kinematics, r.q0, A);
    if (A.size() > 0) {
      EXPECT_LT((A * r.model->Q).cwiseAbs().maxCoeff(), kUnitRounding);
    }
    // M = QᵀM_qQ.
    MatrixX M;
    MassMatrix(*r.mechanism, r.kinematics, M);
    const MatrixX M_r = Congruence(M, r.model->Q);
    EXPECT_LT((M_r - r.model->M).cwiseAbs().maxCoeff(), kUnitRounding * (1 + M_r.cwiseAbs().maxCoeff()));
    const MatrixX D_r = r.model->Q.transpose() * DampingMatrix(*r.mechanism, r.kinematics, r.q0) * r.model->Q;
    EXPECT_LT((D_r - r.model->D).cwiseAbs().maxCoeff(), kUnitRounding * (1 + D_r.cwiseAbs().maxCoeff()));
  }
}

TEST(ReducedModelProperties, StaticResponseIsComplete) {
  for (unsigned seed = 0; seed < 2 * kMechanisms; ++seed) {
    SCOPED_TRACE(seed);
    RandomMechanismOptions options = seed % 2 ? WithLoops() : RandomMechanismOptions();
    options.interfaces = 1;
    options.controls = 3;
    ReductionOptions reduction;
    reduction.modes = 2;
    const ReducedCase r(seed, options, reduction);
    ASSERT_TRUE(r.model) << r.model.error().Text();
    RandomSource random(seed);
    StaticsOptions statics;
    statics.controls = random.Vector(static_cast<int>(r.mechanism->controls().size()), 1);
    statics.gravity_R = random.InBox(10);
    VectorX g = VectorX::Zero(r.q0.size());
    if (statics.controls.size() > 0) AddControlForce(*r.mechanism, r.kinematics, statics.controls, g);
    Matrix6X F = Matrix6X::Zero(6, r.mechanism->num_bodies());
    AddGravityWrenches(*r.mechanism, r.kinematics, statics.gravity_R, F);
    AccumulateGeneralizedForce(*r.mechanism, r.kinematics.S, F, g);
    // Set-points and gravity: Q takes its share, the complement the rest.
    VectorX q = r.model->Q * (r.model->Q.transpose() * g);
    if (r.model->has_complement) {
      VectorX q_perp;
      ApplyComplement(*r.model, g, q_perp);
      q += q_perp;
    }
    const double size = q.cwiseAbs().maxCoeff();
    if (r.mechanism->num_constraints() == 0) {
      EXPECT_LT((q - SolveSymmetric(r.K, g)).cwiseAbs().maxCoeff(), kUnitRounding * size);
    }
    const auto linear = LinearDeflection(*r.mechanism, r.q0, {}, statics);
    ASSERT_TRUE(linear) << linear.error().Text();
    EXPECT_LT((q - *linear).cwiseAbs().maxCoeff(), kUnitRounding * size);
  }
}

TEST(ReducedModelProperties, BodyTwistsSumTheScrewsOfTheirPaths) {
  for (unsigned seed = 0; seed < kMechanisms; ++seed) {
    SCOPED_TRACE(seed);
    const ReducedCase r(seed, seed % 2 ? WithLoops() : RandomMechanismOptions(), {});
    ASSERT_TRUE(r.model) << r.model.error().Text();
    for (int b = 0; b < r.mechanism->num_bodies(); ++b) {
      const MatrixX T = BodyJacobian(*r.mechanism, r.kinematics, BodyIndex(b)) * r.model->Q;
      // Columns are up to k^{-1/2} and a metre long; sums of a dozen of them round at 1e-15.
      EXPECT_LT((T - r.model->T_of(BodyIndex(b))).cwiseAbs().maxCoeff(), 1e-12);
    }
  }
}

}  // namespace
}  // namespace fork1s
