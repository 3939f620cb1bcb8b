// The same mechanism written down differently, and errors.
#include <gtest/gtest.h>
#include <fork1s/reduction/compliance.hpp>
#include <fork1s/reduction/free_motion.hpp>
#include <fork1s/reduction/frequencies.hpp>
#include <mechanisms.hpp>
#include <random_mechanism.hpp>

#include <algorithm>
#include <numeric>

namespace fork1s {
namespace {

using testing::RandomMechanismOptions;
using testing::RandomSource;
using testing::Share;

RandomMechanismOptions Everything() {
  RandomMechanismOptions options;
  options.rigid_closures = 2;
  options.springy_closures = 1;
  options.couplings = 1;
  options.coupling_terms = 1;
  options.springs = 2;
  options.controls = 2;
  return options;
}

// Values that do not depend on the order in which bodies and joints were written.
struct Figures {
  explicit Figures(const std::shared_ptr<const Mechanism>& m) {
    const VectorX q0 = VectorX::Zero(m->num_coordinates());
    std::vector<BodyIndex> bodies;
    for (const std::string& name : m->definition().interfaces) bodies.push_back(m->FindBody(name));
    C = WalkCompliance(*m, q0, bodies).C;
    full = FullFrequencies(*m, q0);
    const auto model = Reduce(m, q0);
    EXPECT_TRUE(model) << model.error().Text();
    reduced = ReducedFrequencies(*model);
    rank = model->loop_rank();
    size = model->size();
  }
  MatrixX C;
  std::vector<double> full, reduced;
  int rank, size;
};

void ExpectSame(const Figures& a, const Figures& b) {
  EXPECT_EQ(a.rank, b.rank);
  EXPECT_EQ(a.size, b.size);
  // The tolerance of walks over loops.
  EXPECT_LT((a.C - b.C).cwiseAbs().maxCoeff(), 1e-8 * a.C.cwiseAbs().maxCoeff());
  ASSERT_EQ(a.full.size(), b.full.size());
  ASSERT_EQ(a.reduced.size(), b.reduced.size());
  for (std::size_t i = 0; i < a.full.size(); ++i) EXPECT_NEAR(a.full[i], b.full[i], 1e-8 * a.full[i]);
  for (std::size_t i = 0; i < a.reduced.size(); ++i)
    EXPECT_NEAR(a.reduced[i], b.reduced[i], 1e-7 * a.reduced[i]);
}

TEST(Invariance, RedundantLoopsChangeNothing) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    SCOPED_TRACE(seed);
    MechanismDef definition = testing::RandomMechanismDef(seed, Everything());
    const Figures once(Share(definition));
    for (std::size_t i = definition.closures.size(); i-- > 0;) {
      ClosureDef again = definition.closures[i];
      if (!again.rigid.any()) continue;
      again.name += "again";
      again.stiffness.setZero();  // springs of a second closure would add up
      std::swap(again.body_a, again.body_b);
      std::swap(again.X_AJ, again.X_BJ);
      definition.closures.push_back(again);
    }
    ExpectSame(once, Figures(Share(definition)));
  }
}

// Bodies in another order in which parents still come first, joints likewise.
MechanismDef Permuted(const MechanismDef& from, unsigned seed) {
  RandomSource random(seed);
  MechanismDef to = from;
  const std::size_t count = from.bodies.size();
  std::vector<int> new_of(count, -1);
  std::vector<std::size_t> order{0};
  new_of[0] = 0;
  while (order.size() < count) {
    const auto pick = static_cast<std::size_t>(random.Below(static_cast<int>(count)));
    if (new_of[pick] >= 0 || new_of[from.bodies[pick].parent.u()] < 0) continue;
    new_of[pick] = static_cast<int>(order.size());
    order.push_back(pick);
  }
  auto body = [&](BodyIndex b) { return b.valid() ? BodyIndex(new_of[b.u()]) : b; };
  for (std::size_t i = 0; i < count; ++i) {
    to.bodies[i] = from.bodies[order[i]];
    to.bodies[i].parent = body(to.bodies[i].parent);
  }
  // Joints of one body keep their order.
  std::vector<std::size_t> joints(from.joints.size());
  std::iota(joints.begin(), joints.end(), 0u);
  std::vector<double> key(count);
  for (double& k : key) k = random.Uniform(0, 1);
  std::stable_sort(joints.begin(), joints.end(), [&](std::size_t a, std::size_t b) {
    return key[from.joints[a].body.u()] < key[from.joints[b].body.u()];
  });
  std::vector<int> new_joint(joints.size());
  for (std::size_t i = 0; i < joints.size(); ++i) {
    new_joint[joints[i]] = static_cast<int>(i);
    to.joints[i] = from.joints[joints[i]];
    to.joints[i].body = body(to.joints[i].body);
  }
  auto freedom = [&](FreedomRef& f) {
    if (f.joint.valid()) f.joint = JointIndex(new_joint[f.joint.u()]);
  };
  for (ClosureDef& c : to.closures) c.body_a = body(c.body_a), c.body_b = body(c.body_b);
  for (CouplingDef& c : to.couplings) {
    freedom(c.a), freedom(c.b);
    for (auto& term : c.terms) freedom(term.first);
  }
  for (SpringDef& s : to.springs)
    for (auto& term : s.terms) freedom(term.first);
  for (ControlDef& c : to.controls)
    for (auto& term : c.terms) freedom(term.first);
  return to;
}

TEST(Invariance, OrderOfBodiesAndJoints) {
  for (unsigned seed = 0; seed < 20; ++seed) {
    SCOPED_TRACE(seed);
    const MechanismDef definition = testing::RandomMechanismDef(seed, Everything());
    ExpectSame(Figures(Share(definition)), Figures(Share(Permuted(definition, seed))));
  }
}

// Other compilers and flags round differently. Here every number is off by a thousand times as much.
TEST(Invariance, RoundingTurnsNoDecision) {
  for (unsigned seed = 0; seed < 30; ++seed) {
    SCOPED_TRACE(seed);
    RandomMechanismOptions options = Everything();
    options.unsprung = seed % 3 ? 0 : 0.2;
    MechanismDef definition = testing::RandomMechanismDef(seed, options);
    for (std::size_t i = definition.closures.size(); i-- > 0;) {  // overconstrained as well
      ClosureDef again = definition.closures[i];
      again.name += "again";
      again.stiffness.setZero();
      if (again.rigid.any()) definition.closures.push_back(again);
    }
    MechanismDef off = definition;
    RandomSource random(seed);
    const auto shake = [&](double& x) { x *= 1 + random.Uniform(-2e-13, 2e-13); };
    const auto shake_pose = [&](RigidTransform& X) {
      Vector3 p = X.translation();
      for (double& x : p) shake(x);
      X = RigidTransform(Matrix3(X.rotation() * ExpRotation(2e-13 * random.InBox(1))), p);
    };
    for (BodyDef& b : off.bodies) shake_pose(b.X_PB);
    for (ClosureDef& c : off.closures) shake_pose(c.X_AJ), shake_pose(c.X_BJ);
    for (JointDef& j : off.joints)
      for (FreedomDef& f : j.freedoms) {
        shake(f.stiffness);
        for (double& x : f.screw_B) shake(x);
      }
    const auto a = Share(definition), b = Share(off);
    const VectorX q0 = VectorX::Zero(a->num_coordinates());
    ReductionOptions reduction;
    reduction.promote_hidden = true;
    const auto one = Reduce(a, q0, reduction), other = Reduce(b, q0, reduction);
    ASSERT_EQ(one.has_value(), other.has_value());
    if (!one) {
      EXPECT_EQ(one.error().where, other.error().where);
      continue;
    }
    EXPECT_EQ(one->loop_rank(), other->loop_rank());
    EXPECT_EQ(one->num_free, other->num_free);
    EXPECT_EQ(one->size(), other->size());
    EXPECT_EQ(one->interfaces, other->interfaces);
    EXPECT_TRUE(one->doubts.empty());
    const InterfaceCompliance walk = WalkCompliance(*a, q0, one->interfaces);
    EXPECT_LT(ComplianceDifference(walk, WalkCompliance(*b, q0, one->interfaces), a->length_scale()), 1e-8);
  }
}

TEST(Invariance, BasePoseTurnsTheCompliance) {
  MechanismDef definition = testing::Chain(6, 0.1, 0.1, 30, 0, true);
  const Figures here(Share(definition));
  RandomSource random(3);
  definition.X_WR = random.Pose(1);
  const Figures there(Share(definition));
  Matrix6 R = Matrix6::Zero();
  R.topLeftCorner<3, 3>() = R.bottomRightCorner<3, 3>() = definition.X_WR.rotation();
  EXPECT_LT((R * here.C * R.transpose() - there.C).cwiseAbs().maxCoeff(), 1e-14);
}

MechanismDef HiddenJoint() {
  MechanismDef definition = testing::Walker(BaseKind::kFixed, 20, 0);
  definition.interfaces = {"shank0"};
  for (JointDef& joint : definition.joints)
    if (joint.name == "knee2") joint.freedoms[0].stiffness = 0;
  return definition;
}

TEST(ReduceErrors, HiddenJointIsNamed) {
  const auto m = Share(HiddenJoint());
  const auto model = Reduce(m, VectorX::Zero(8));
  ASSERT_FALSE(model);
  EXPECT_EQ(model.error().code, ErrorCode::kUnderdetermined);
  EXPECT_EQ(model.error().where, "joint 'knee2'");
  EXPECT_NE(model.error().message.find("'shank2'"), std::string::npos) << model.error().message;
  EXPECT_NE(model.error().message.find("turning about"), std::string::npos) << model.error().message;
}

TEST(ReduceErrors, HiddenJointIsPromotedOnRequest) {
  const auto m = Share(HiddenJoint());
  ReductionOptions options;
  options.promote_hidden = true;
  const auto model = Reduce(m, VectorX::Zero(8), options);
  ASSERT_TRUE(model) << model.error().Text();
  ASSERT_EQ(model->promoted.size(), 1u);
  EXPECT_EQ(m->body(model->promoted[0]).name, "shank2");
  EXPECT_EQ(model->interfaces.size(), 2u);
  EXPECT_EQ(model->num_free, 1);
}

TEST(ReduceErrors, InterfacesMissingTwiceOrOutOfRange) {
  MechanismDef definition = testing::Walker(BaseKind::kFixed, 20, 0);
  definition.interfaces.clear();
  const auto m = Share(definition);
  const VectorX q0 = VectorX::Zero(8);
  auto model = Reduce(m, q0);
  ASSERT_FALSE(model);
  EXPECT_EQ(model.error().code, ErrorCode::kModel);
  EXPECT_NE(model.error().where.find("walker"), std::string::npos);
  ReductionOptions options;
  options.interfaces = {BodyIndex(2), BodyIndex(4), BodyIndex(2)};
  model = Reduce(m, q0, options);
  ASSERT_FALSE(model);
  EXPECT_EQ(model.error().code, ErrorCode::kModel);
  EXPECT_NE(model.error().where.find(m->body(BodyIndex(2)).name), std::string::npos);
  options.interfaces = {BodyIndex(99)};
  EXPECT_THROW((void)Reduce(m, q0, options), std::invalid_argument);
  EXPECT_THROW((void)Reduce(m, VectorX::Zero(3)), std::invalid_argument);
}

TEST(ReduceErrors, ComplianceOfASpringFreeMotion) {
  MechanismDef definition = testing::Chain(3, 0.1, 0.1, 30);
  definition.joints[1].freedoms[0].stiffness = 0;
  const auto m = Share(definition);
  const std::vector<BodyIndex> tip{m->FindBody("tip")};
  const auto walk = WalkCompliance(*m, VectorX::Zero(3), tip),
             dense = DenseCompliance(*m, VectorX::Zero(3), tip);
  // The tip swings about the second joint, 0.2 m away; what it feels of the springs beside that is the same by
  // both methods and does no work on the swing.
  ASSERT_EQ(walk.free.cols(), 1);
  ASSERT_EQ(dense.free.cols(), 1);
  EXPECT_NEAR(std::abs(walk.free(4, 0) / walk.free(2, 0)), 0.2, 1e-12);
  EXPECT_LT(ComplianceDifference(walk, dense, m->length_scale()), 1e-12);
  VectorX swing = walk.free.col(0);
  swing.head<3>() *= m->length_scale() * m->length_scale();  // load that works on it, per length
  EXPECT_LT((walk.C * swing).cwiseAbs().maxCoeff(), 1e-15);
  EXPECT_GT(walk.C.cwiseAbs().maxCoeff(), 1e-6);
  const auto motions = FindFreeMotions(*m, VectorX::Zero(3), tip);
  ASSERT_EQ(motions.size(), 1u);
  EXPECT_EQ(motions[0].body, tip[0]);
  ASSERT_EQ(motions[0].joints.size(), 1u);
  EXPECT_EQ(m->joint(motions[0].joints[0]).name, "joint2");
  EXPECT_EQ(m->CoordinateName(motions[0].pivot), "joint2");
  // The first link does not feel it.
  EXPECT_EQ(WalkCompliance(*m, VectorX::Zero(3), {m->FindBody("link1")}).free.cols(), 0);
}

// Displacement of the tip of a chain of links of 0.1 m per load, about z and along y: springs in series, each
// with its lever arm.
void ExpectSeries(const MatrixX& C, const std::vector<std::pair<double, double>>& arms_and_stiffnesses) {
  double turn = 0, mixed = 0, shift = 0;
  for (const auto& [arm, k] : arms_and_stiffnesses) turn += 1 / k, mixed += arm / k, shift += arm * arm / k;
  EXPECT_NEAR(C(2, 2), turn, 1e-12 * turn);
  EXPECT_NEAR(C(2, 4), mixed, 1e-12 * mixed);
  EXPECT_NEAR(C(4, 4), shift, 1e-12 * shift);
}

TEST(Compliance, BehindAFreeJointIsRefusedOrThatOfTheLockedJoint) {
  MechanismDef definition = testing::Chain(3, 0.1, 0.1, 30);
  definition.joints[1].freedoms[0].stiffness = 0;
  const auto m = Share(definition);
  const VectorX q = VectorX::Zero(3);
  const std::vector<BodyIndex> tip{m->FindBody("tip")}, first{m->FindBody("link1")};
  const auto refused = ComputeCompliance(*m, q, tip, OnFreeMotion::kRefuse);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kUnderdetermined);
  EXPECT_EQ(refused.error().where, "joint 'joint2'");
  EXPECT_NE(refused.error().message.find("'tip'"), std::string::npos) << refused.error().Text();
  const auto locked = ComputeCompliance(*m, q, tip, OnFreeMotion::kLock);
  ASSERT_TRUE(locked) << locked.error().Text();
  EXPECT_EQ(locked->locked, std::vector<int>{1});
  EXPECT_EQ(locked->free.cols(), 0);
  ExpectSeries(locked->C, {{0.3, 30}, {0.1, 30}});
  ExpectSeries(DenseCompliance(*m, q, tip, {1}).C, {{0.3, 30}, {0.1, 30}});
  // y_j of the springs that are left, and nothing of the locked joint.
  const MatrixX y = InterfaceResponse(*m, q, tip, {1});
  EXPECT_NEAR(y(4, 0), 0.3 / 30, 1e-14);
  EXPECT_NEAR(y(4, 2), 0.1 / 30, 1e-14);
  EXPECT_LT(y.col(1).norm(), 1e-14);
  // A body before the free joint is held by springs and has its compliance either way.
  const auto held = ComputeCompliance(*m, q, first, OnFreeMotion::kRefuse);
  ASSERT_TRUE(held) << held.error().Text();
  EXPECT_TRUE(held->locked.empty());
}

// A tendon spring holds the sum of two hinges. With the hinge locked that is named the other one bears all of
// it.
TEST(Compliance, BehindJointsThatATendonLeavesFreeIsThatWithOneOfThemLocked) {
  MechanismDef definition = testing::Chain(3, 0.1, 0.1, 30);
  for (int j : {1, 2}) definition.joints[static_cast<std::size_t>(j)].freedoms[0].stiffness = 0;
  SpringDef tendon;
  tendon.name = "sum";
  tendon.terms = {{{JointIndex(1), 0}, 1.0}, {{JointIndex(2), 0}, 1.0}};
  tendon.stiffness = 5;
  definition.springs.push_back(tendon);
  const auto m = Share(definition);
  const VectorX q = VectorX::Zero(3);
  const std::vector<BodyIndex> tip{m->FindBody("tip")};
  EXPECT_FALSE(ComputeCompliance(*m, q, tip, OnFreeMotion::kRefuse));
  for (const int locked : {1, 2}) {
    const std::vector<std::pair<double, double>> springs = {{0.3, 30}, {locked == 1 ? 0.1 : 0.2, 5}};
    ExpectSeries(WalkCompliance(*m, q, tip, {locked}).C, springs);
    ExpectSeries(DenseCompliance(*m, q, tip, {locked}).C, springs);
    EXPECT_EQ(DenseCompliance(*m, q, tip, {locked}).rank, 2);
    EXPECT_EQ(WalkCompliance(*m, q, tip, {locked}).rank, 2);
  }
  const auto chosen = ComputeCompliance(*m, q, tip, OnFreeMotion::kLock);
  ASSERT_TRUE(chosen);
  EXPECT_EQ(chosen->locked.size(), 1u);
  EXPECT_EQ(chosen->free.cols(), 0);
}

}  // namespace
}  // namespace fork1s
