// Joints whose displacement leaves the span of the reduced coordinates as it is.
#include <gtest/gtest.h>
#include <fork1s/reduction/reduced_model.hpp>
#include <mechanisms.hpp>
#include <random_mechanism.hpp>

#include "linalg/null_space.hpp"
#include "reduction/invariant_joints.hpp"

namespace fork1s {
namespace {

using testing::RandomMechanismOptions;

// Norm of the sines of the angles between the columns' spans; 1 if their dimensions differ.
double SpanDistance(const MatrixX& A, const MatrixX& B) {
  if (A.cols() != B.cols()) return 1;
  const MatrixX a = RangeBasis(A), b = RangeBasis(B);
  return (b - a * (a.transpose() * b)).norm();
}

// About q, under weight and joint forces that balance all springs there.
ReducedModel ReducedAbout(const std::shared_ptr<const Mechanism>& m, const VectorX& q) {
  ReductionOptions options;
  options.modes = 2;
  options.promote_hidden = true;
  ReductionLoads loads;
  loads.gravity_R = Vector3(1, -2, -9.81);
  Kinematics kinematics(*m);
  ComputeKinematics(*m, q, kinematics);
  SpringForce(*m, kinematics, q, loads.controls);
  loads.controls *= -1;
  auto model = Reduce(m, q, options, &loads);
  if (!model) throw std::runtime_error(model.error().Text());
  return std::move(*model);
}

// A torque control for every coordinate.
void AddTorques(MechanismDef& def) {
  for (std::size_t j = 0; j < def.joints.size(); ++j)
    for (std::size_t k = 0; k < def.joints[j].freedoms.size(); ++k) {
      ControlDef control;
      control.name = "torque" + std::to_string(def.controls.size());
      control.terms = {{{JointIndex(static_cast<int>(j)), static_cast<int>(k)}, 1.0}};
      control.gain = 1;
      def.controls.push_back(control);
    }
}

TEST(InvariantJoints, ReductionAboutTheirDisplacementsSpansTheSame) {
  int truncated = 0, others = 0;
  for (unsigned seed = 0; seed < 60; ++seed) {
    SCOPED_TRACE(seed);
    RandomMechanismOptions options;
    options.bodies = 12;
    options.interfaces = 1 + static_cast<int>(seed % 2);
    options.chain = 0.8;
    options.hinges_only = seed % 3 == 0;
    options.springs = options.hinges_only ? 1 : 0;  // a ball's torques are about its own axes
    options.base = seed % 4 < 2 ? BaseKind::kFixed : BaseKind::kFloating;
    MechanismDef definition = testing::RandomMechanismDef(seed, options);
    AddTorques(definition);
    const auto m = testing::Share(definition);
    const VectorX q = testing::RandomCoordinates(*m, seed);
    const ReducedModel model = ReducedAbout(m, q);
    if (!model.has_complement) continue;
    const std::vector<char> invariant = FindInvariantJoints(*m, model.interfaces);
    for (int i = 0; i < m->num_coordinates(); ++i) {
      VectorX turned = q;
      turned(i) += 2;
      const double distance = SpanDistance(model.Q, ReducedAbout(m, turned).Q);
      if (invariant[static_cast<std::size_t>(i)]) {
        ++truncated;
        EXPECT_LT(distance, 1e-6) << m->CoordinateName(i);
      } else {
        others += distance > 1e-3 ? 1 : 0;
      }
    }
  }
  EXPECT_GT(truncated, 20);
  EXPECT_GT(others, 100);
}

}  // namespace
}  // namespace fork1s
