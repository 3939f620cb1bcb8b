// Ranks that the digits of a file do not settle: decided as they are meant, and said.
#include <gtest/gtest.h>
#include <fork1s/reduction/compliance.hpp>
#include <fork1s/reduction/free_motion.hpp>
#include <fork1s/reduction/frequencies.hpp>
#include <mechanisms.hpp>

#include <algorithm>

namespace fork1s {
namespace {

using testing::Share;

// A four-bar whose last hinge closes by five directions, so that three rows repeat others; the pin's axis there
// is off by `tilt` [rad], as one typed with few digits is.
std::shared_ptr<const Mechanism> TiltedFourBar(double tilt) {
  const testing::FourBar bar;
  MechanismDef definition = bar.Definition();
  ClosureDef& closure = definition.closures[0];
  closure.rigid << true, true, false, true, true, true;
  // Both frames along the pin at the reference, then b's turned about x.
  const Mechanism tree = *Share([&] {
    MechanismDef open = definition;
    open.closures.clear();
    return open;
  }());
  closure.X_AJ = RigidTransform(Matrix3(tree.body(closure.body_a).X_RB0.rotation().transpose()),
                                closure.X_AJ.translation());
  const Matrix3 turn = Eigen::AngleAxisd(tilt, Vector3::UnitX()).matrix();
  closure.X_BJ = RigidTransform(Matrix3(tree.body(closure.body_b).X_RB0.rotation().transpose() * turn),
                                closure.X_BJ.translation());
  return Share(definition);
}

TEST(Doubt, NoneWhereTheGeometryIsExactOrPlain) {
  const auto exact = TiltedFourBar(0);
  const auto model = Reduce(exact, VectorX::Zero(3));
  ASSERT_TRUE(model) << model.error().Text();
  EXPECT_EQ(model->loop_rank(), 2);
  EXPECT_TRUE(model->doubts.empty());
  EXPECT_EQ(FullFrequencies(*exact, VectorX::Zero(3)).size(), 1u);
}

TEST(Doubt, HingesTypedWithFewDigitsStillMove) {
  // Seven digits: the loop moves as meant, and the report names its joints.
  const auto m = TiltedFourBar(4e-7);
  const auto model = Reduce(m, VectorX::Zero(3));
  ASSERT_TRUE(model) << model.error().Text();
  EXPECT_EQ(model->size(), 1);
  const InterfaceCompliance walk = WalkCompliance(*m, VectorX::Zero(3), model->interfaces);
  EXPECT_LT(ComplianceDifference(walk, WalkCompliance(*TiltedFourBar(0), VectorX::Zero(3), model->interfaces),
                                 m->length_scale()),
            1e-5);
}

TEST(Doubt, IsReportedWithItsJoints) {
  // A slider crank whose slide is all but square to what could move it.
  for (const double slant : {1e-7, 1e-6, 1e-5}) {
    SCOPED_TRACE(slant);
    MechanismBuilder builder("wedge");
    BodyDef slider;
    slider.name = "slider";
    slider.parent = builder.base();
    slider.inertia = testing::Ball(1, 0.1);
    const BodyIndex a = builder.AddBody(slider);
    builder.AddJoint(JointDef::Slide("across", a, Vector3(slant, 0, 1).normalized()).WithSpring(10));
    BodyDef follower = slider;
    follower.name = "follower";
    follower.X_PB = RigidTransform(Vector3(0.1, 0, 0));
    const BodyIndex b = builder.AddBody(follower);
    builder.AddJoint(JointDef::Slide("along", b, Vector3::UnitX()).WithSpring(10));
    ClosureDef closure = ClosureDef::Connect("wedge", a, b, Vector3::Zero(), Vector3(-0.1, 0, 0));
    closure.rigid << false, false, false, true, false, false;  // along x alone
    builder.AddClosure(closure);
    // A second one that only the slant tells from the first.
    closure.name = "again";
    closure.X_AJ = closure.X_BJ =
        RigidTransform(Matrix3(Eigen::AngleAxisd(slant, Vector3::UnitY()).matrix()), Vector3::Zero());
    closure.X_BJ = RigidTransform(closure.X_BJ.rotation(), Vector3(-0.1, 0, 0));
    builder.AddClosure(closure);
    builder.SetInterfaces({"slider", "follower"});
    const auto m = Share(builder.definition());
    const auto model = Reduce(m, VectorX::Zero(2));
    ASSERT_TRUE(model) << model.error().Text();
    ASSERT_FALSE(model->doubts.empty());
    EXPECT_EQ(model->doubts[0].what, "loops hold");
    EXPECT_TRUE(model->doubts[0].joints.size() >= 1 && model->doubts[0].joints[0] == "across")
        << model->doubts[0].Text();
    EXPECT_TRUE(std::any_of(model->warnings.begin(), model->warnings.end(),
                            [](const std::string& w) { return w.find("'across'") != std::string::npos; }));
  }
}

TEST(FreeMotions, ATendonOverTwoJointsHoldsTheirSumOnly) {
  MechanismDef definition = testing::Chain(3, 0.1, 0.1, 30);
  definition.joints[1].freedoms[0].stiffness = definition.joints[2].freedoms[0].stiffness = 0;
  SpringDef tendon;
  tendon.name = "both";
  tendon.terms = {{FreedomRef{JointIndex(1), 0}, 1.0}, {FreedomRef{JointIndex(2), 0}, 1.0}};
  tendon.stiffness = 5;
  definition.springs.push_back(tendon);
  const auto m = Share(definition);
  const auto motions = FindFreeMotions(*m, VectorX::Zero(3), {m->FindBody("tip")});
  ASSERT_EQ(motions.size(), 1u);
  EXPECT_EQ(motions[0].joints.size(), 2u);
  EXPECT_NEAR(motions[0].q(1) + motions[0].q(2), 0, 1e-15);
  EXPECT_EQ(motions[0].ties, std::vector<std::string>{"tendon 'both'"});
  const std::string text = motions[0].Text(*m);
  for (const char* part : {"'tip'", "'joint2'", "'joint3'", "tendon 'both'", "PD gains, joint"})
    EXPECT_NE(text.find(part), std::string::npos) << text;
  // A straight planar chain moves its tip two ways; one of them is free.
  const InterfaceCompliance walk = WalkCompliance(*m, VectorX::Zero(3), {m->FindBody("tip")}),
                            dense = DenseCompliance(*m, VectorX::Zero(3), {m->FindBody("tip")});
  EXPECT_EQ(walk.rank, 1);
  EXPECT_LT(ComplianceDifference(walk, dense, m->length_scale()), 1e-12);
}

}  // namespace
}  // namespace fork1s
