// Where every direction is kept, the coordinates are single joints, branch by branch.
#include <gtest/gtest.h>

#include <fork1s/reduction/reduced_model.hpp>
#include <memory>

#include "random_mechanism.hpp"

namespace fork1s {
namespace {

// Whether joint a is b or carries it.
bool Carries(const Mechanism& mechanism, int a, int b) {
  while (b > a) b = mechanism.joint(JointIndex(b)).previous;
  return a == b;
}

TEST(BranchOrder, BranchesStandTogetherAndDoNotMeet) {
  testing::RandomMechanismOptions options;
  options.bodies = 14;
  options.interfaces = 1;
  int far_pairs = 0;
  for (unsigned seed = 0; seed < 10; ++seed) {
    SCOPED_TRACE(seed);
    options.base = seed % 2 ? BaseKind::kFloating : BaseKind::kFixed;
    auto built = BuildMechanism(testing::RandomMechanismDef(seed, options));
    ASSERT_TRUE(built) << built.error().Text();
    auto mechanism = std::make_shared<const Mechanism>(std::move(*built));
    ReductionOptions reduction;
    reduction.modes = 1000;
    auto model = Reduce(mechanism, VectorX::Zero(mechanism->num_coordinates()), reduction);
    ASSERT_TRUE(model) << model.error().Text();
    ASSERT_EQ(model->size(), mechanism->num_coordinates());
    std::vector<int> joints;  // per column
    for (const int c : model->SprungColumns()) {
      EXPECT_EQ((model->Q.col(c).array() != 0).count(), 1);
      Eigen::Index coordinate = 0;
      model->Q.col(c).cwiseAbs().maxCoeff(&coordinate);
      joints.push_back(mechanism->CoordinateJoint(static_cast<int>(coordinate)).value());
    }
    for (int j = 0; j < mechanism->num_joints(); ++j) {
      int runs = 0;
      bool within = false;
      for (const int own : joints) {
        const bool carried = Carries(*mechanism, j, own);
        runs += carried && !within ? 1 : 0;
        within = carried;
      }
      EXPECT_LE(runs, 1) << "joint " << j;
    }
    const std::vector<int> columns = model->SprungColumns();
    for (std::size_t a = 0; a < joints.size(); ++a)
      for (std::size_t b = 0; b < a; ++b)
        if (!Carries(*mechanism, joints[a], joints[b]) && !Carries(*mechanism, joints[b], joints[a])) {
          EXPECT_EQ(model->M(columns[a], columns[b]), 0);
          ++far_pairs;
        }
  }
  EXPECT_GT(far_pairs, 100);
}

}  // namespace
}  // namespace fork1s
