// Exact and curved poses as arrays are those of Configure, on every instruction set of this processor.
#include <cmath>
#include <cstring>
#include <fork1s/recovery/pose_arrays.hpp>
#include <random_mechanism.hpp>
#include <recovery/support.hpp>

#include "parallel/parallel_for.hpp"
#include "recovery/arrays/instruction_sets.hpp"

namespace fork1s {
namespace {

using testing::Deflected;
using testing::MustReduce;
using testing::RandomSource;
using testing::Share;

// One set after the other; the best one again at the end.
template <class Work>
void OnEveryInstructionSet(Work work) {
  for (const std::int64_t set : internal::RecoveryInstructionSets()) {
    internal::UseInstructionSet(set);
    SCOPED_TRACE(RecoveryInstructionSet());
    work();
  }
  internal::UseInstructionSet(0);
}

// Shares of a turn and of the farthest distance that poses may be off.
struct Off {
  double turn = 0, share = 0;
};

// Largest distance of a mechanism's points, for shares of it.
double Extent(const std::vector<RigidTransform>& X_RB, const Mechanism& m) {
  double far = m.length_scale();
  for (const RigidTransform& X : X_RB) far = std::max(far, X.translation().norm());
  return far;
}

template <class Real>
ReducedState AsIn(
    const ReducedState& given) {  // what is left of z in Real, so that only the recovery differs
  ReducedState state = given;
  for (double& z : state.z) z = static_cast<double>(static_cast<Real>(z));
  return state;
}

// The states of `all` by Recover and by RecoverMany, against Configure of `model`.
template <class Real>
void ExpectPosesOfConfigure(const ReducedModel& model, Recovery mode, const std::vector<ReducedState>& all,
                            const Off& off) {
  PoseRecovery<Real> recovery(model, mode);
  const auto r = static_cast<std::size_t>(model.size());
  const std::size_t stride = all.size() + 3;
  std::vector<Real> many(r * stride, Real(7));
  std::vector<PoseArrays<Real>> poses(static_cast<std::size_t>(recovery.bodies()));
  for (std::size_t i = 0; i < all.size(); ++i)
    for (std::size_t k = 0; k < r; ++k)
      many[k * stride + i] = static_cast<Real>(all[i].z(static_cast<Eigen::Index>(k)));
  const LoopClosing closing = recovery.RecoverMany(many.data(), stride, all.size(), poses.data());
  EXPECT_EQ(closing.one_by_one, 0u) << sizeof(Real);
  PoseArrays<Real> one;
  Configuration scratch(model);
  // As near as rounding lets it come; of a mechanism in millimetres 1e-14 m is a coarse figure.
  scratch.closing_tolerance = 1e-14 * std::min(1.0, model.mechanism->length_scale());
  std::vector<RigidTransform> X_RB;
  for (std::size_t i = 0; i < all.size(); ++i) {
    SCOPED_TRACE("state " + std::to_string(i));
    RecoverPosesExact(model, AsIn<Real>(all[i]), scratch, X_RB);
    const double far = Extent(X_RB, *model.mechanism);
    std::vector<Real> z;
    for (std::size_t k = 0; k < r; ++k) z.push_back(many[k * stride + i]);
    recovery.Recover(z.data(), one);
    ASSERT_EQ(one.size(), X_RB.size());
    for (std::size_t b = 0; b < X_RB.size(); ++b) {
      ASSERT_EQ(poses[b].size(), all.size());
      for (const RigidTransform& X : {one.Pose(b), poses[b].Pose(i)}) {
        ASSERT_LT((X.rotation() - X_RB[b].rotation()).cwiseAbs().maxCoeff(), off.turn) << b;
        ASSERT_LT((X.translation() - X_RB[b].translation()).norm(), off.share * far) << b;
      }
    }
  }
}

std::vector<ReducedState> SomeStates(const ReducedModel& model, std::size_t count, double angle,
                                     unsigned seed) {
  RandomSource random(seed);
  std::vector<ReducedState> all;
  for (std::size_t i = 0; i < count; ++i) {
    all.push_back(Deflected(model, random.Vector(model.size(), 1), angle));
  }
  return all;
}

constexpr std::size_t kCounts[] = {1, 3, 17};

// Every kind of joint, several on a body and none, joints in another order than bodies; away from the
// reference and about a bent one; up to more than a turn.
TEST(ChainPoses, AreThoseOfJointsOnTrees) {
  OnEveryInstructionSet([] {
    for (unsigned seed = 0; seed < 12; ++seed) {
      testing::RandomMechanismOptions options;
      options.bodies = 3 + 3 * static_cast<int>(seed);
      options.joints_in_order = seed % 2 == 0;
      const auto m = Share(testing::RandomMechanismDef(seed, options));
      auto reduced = Reduce(m, testing::RandomCoordinates(*m, seed, seed % 3 == 0 ? 0 : 0.5), {});
      ASSERT_TRUE(reduced.has_value());
      for (const double angle : {1e-6, 0.4, 7.0}) {
        SCOPED_TRACE(std::to_string(seed) + ", " + std::to_string(angle));
        const auto states = SomeStates(*reduced, kCounts[seed % 3], angle, seed);
        // Rounding of a product of some ten poses; of angles of many turns the digits that a turn takes.
        ExpectPosesOfConfigure<double>(*reduced, Recovery::kExact, states,
                                       {1e-14 * (1 + angle), 1e-14 * (1 + angle)});
        ExpectPosesOfConfigure<float>(*reduced, Recovery::kExact, states,
                                      {2e-6 * (1 + angle), 2e-6 * (1 + angle)});
      }
    }
  });
}

// States behind each other in tiles and beside them, of several sizes of tile.
TEST(ChainPoses, AreTheSameForAnyNumberOfStates) {
  const ReducedModel model = MustReduce(Share(testing::RandomMechanismDef(7)));
  for (const std::size_t count : {16, 127, 128, 129, 300}) {
    SCOPED_TRACE(count);
    ExpectPosesOfConfigure<double>(model, Recovery::kExact, SomeStates(model, count, 0.5, 3), {1e-13, 1e-13});
    ExpectPosesOfConfigure<float>(model, Recovery::kExact, SomeStates(model, count, 0.5, 3), {5e-6, 5e-6});
  }
}

// A mechanism of another size, and its first body moved and turned in the root frame.
MechanismDef Elsewhere(MechanismDef m, double scale, const RigidTransform& X) {
  for (BodyDef& body : m.bodies) {
    body.X_PB.translation() *= scale;
    if (body.parent.valid() && body.parent.value() == 0) body.X_PB = X * body.X_PB;
    body.inertia.center *= scale;
    body.inertia.rotational *= scale * scale;
  }
  for (JointDef& joint : m.joints)
    for (FreedomDef& freedom : joint.freedoms) {
      if (!freedom.screw_B.head<3>().isZero(0)) freedom.screw_B.tail<3>() *= scale;
    }
  for (ClosureDef& closure : m.closures)
    for (const auto& [body, frame] :
         {std::pair{closure.body_a, &closure.X_AJ}, std::pair{closure.body_b, &closure.X_BJ}}) {
      frame->translation() *= scale;
      if (body.value() == 0) *frame = X * *frame;
    }
  return m;
}

ReducedModel CurvedModel(ReducedModel model) {
  model.curvature = LoopCurvature(model);
  return model;
}

// Loops in a plane and in space, several that are independent of each other, couplings, ball joints, slides.
std::vector<MechanismDef> LoopedMechanisms() {
  std::vector<MechanismDef> all = {testing::FourBar().Definition(), testing::CubicStewart(0.3, 1000)};
  testing::RandomMechanismOptions options;
  options.couplings = 1;
  options.coupling_terms = 1;
  for (unsigned seed = 0; seed < 12; ++seed) {
    options.bodies = 6 + static_cast<int>(seed);
    options.rigid_closures = 1 + static_cast<int>(seed % 3);
    all.push_back(testing::RandomMechanismDef(seed, options));
  }
  RandomSource random(11);
  all.push_back(Elsewhere(all[0], 1, random.Pose(0.3)));
  all.push_back(Elsewhere(all[1], 1e-3, random.Pose(1e-3)));
  all.push_back(Elsewhere(all[3], 1e-3, RigidTransform()));
  all.push_back(Elsewhere(all[3], 100, random.Pose(100)));
  return all;
}

TEST(ChainPoses, AreThoseOfCurvedLoops) {
  OnEveryInstructionSet([] {
    std::size_t i = 0;
    for (const MechanismDef& definition : LoopedMechanisms()) {
      const ReducedModel model = CurvedModel(MustReduce(Share(definition)));
      SCOPED_TRACE(std::to_string(i) + " " + definition.name);
      const auto states = SomeStates(model, kCounts[i % 3], 0.3, 5);
      ++i;
      ExpectPosesOfConfigure<double>(model, Recovery::kCurved, states, {1e-13, 1e-13});
      ExpectPosesOfConfigure<float>(model, Recovery::kCurved, states, {2e-5, 2e-5});
    }
  });
}

TEST(ChainPoses, AreThoseOfClosedLoops) {
  OnEveryInstructionSet([] {
    std::size_t i = 0;
    for (const MechanismDef& definition : LoopedMechanisms()) {
      const ReducedModel model = MustReduce(Share(definition));
      SCOPED_TRACE(std::to_string(i) + " " + definition.name);
      // A random loop may come to its end anywhere; small motions it must follow.
      for (const double angle : {1e-3, i < 2 ? 0.25 : 0.04}) {
        SCOPED_TRACE(angle);
        const auto states = SomeStates(model, kCounts[i % 3], angle, 5);
        ExpectPosesOfConfigure<double>(model, Recovery::kExact, states, {1e-13, 1e-13});
        ExpectPosesOfConfigure<float>(model, Recovery::kExact, states, {1e-5, 1e-5});
      }
      ++i;
    }
  });
}

// A long chain of hinges and slides; at every hundredth body a shorter one hangs beside it, a ball joint in
// the middle of that.
MechanismDef LongTree(int links) {
  MechanismBuilder builder("long tree");
  RandomSource random(5);
  const auto add = [&](BodyIndex parent, const std::string& name, int kind) {
    BodyDef body;
    body.name = name;
    body.parent = parent;
    body.X_PB = {ExpRotation(random.InBox(0.05)), Vector3(0.01, 0, 0)};
    body.inertia = random.Inertia();
    const BodyIndex b = builder.AddBody(body);
    const Vector3 axis = random.Direction();
    builder.AddJoint((kind == 0   ? JointDef::Slide(name, b, axis)
                      : kind == 1 ? JointDef::Ball(name, b)
                                  : JointDef::Hinge(name, b, axis))
                         .WithSpring(kind == 0 ? 1e5 : 100));
    return b;
  };
  std::vector<BodyIndex> spine = {builder.base()};
  for (int i = 1; i <= links; ++i) spine.push_back(add(spine.back(), "link" + std::to_string(i), i % 7));
  for (int i = 100; i < links; i += 100) {
    BodyIndex last = spine[static_cast<std::size_t>(i)];
    for (int k = 0; k < 5; ++k)
      last = add(last, "twig" + std::to_string(i) + "_" + std::to_string(k), k == 2 ? 1 : 2);
  }
  builder.SetInterfaces({"link" + std::to_string(links)});
  return builder.definition();
}

// Kinds of joints by i % 7: runs that a scan may take end at ball joints, so that these chains have none.
MechanismDef WithoutBalls(MechanismDef m) {
  for (JointDef& joint : m.joints)
    if (joint.kind == JointKind::kBall && joint.name.starts_with("link")) {
      joint = JointDef::Hinge(joint.name, joint.body, Vector3::UnitY());
      joint.WithSpring(100);
    }
  return m;
}

TEST(ChainPoses, AreThoseOfLongChains) {
  const ReducedModel with_twigs = MustReduce(Share(WithoutBalls(LongTree(1700))), 0);
  const ReducedModel with_balls = MustReduce(Share(LongTree(400)), 0);
  OnEveryInstructionSet([&] {
    for (const ReducedModel* model : {&with_twigs, &with_balls}) {
      SCOPED_TRACE(model->mechanism->num_bodies());
      const auto states = SomeStates(*model, 2, 0.02, 5);
      // Products of 1700 poses. Segments first and then their product round otherwise than one after the
      // other, but not more: instruction sets that are too narrow to scan are off by as much.
      ExpectPosesOfConfigure<double>(*model, Recovery::kExact, states, {4e-13, 4e-13});
      ExpectPosesOfConfigure<float>(*model, Recovery::kExact, states, {5e-5, 5e-5});
    }
  });
}

TEST(ChainPoses, AreTheSameBitsForAnyNumberOfThreads) {
  const ReducedModel model = MustReduce(Share(testing::Chain(9000, 0.001, 0.001, 50, 0, true)), 0);
  const std::vector<ReducedState> state = SomeStates(model, 1, 0.001, 3);
  ExpectPosesOfConfigure<double>(model, Recovery::kExact, state, {1e-12, 1e-12});
  const PoseRecovery<double> recovery(model, Recovery::kExact);
  PoseArrays<double> alone, together;
  WithThreads(1, [&] { recovery.Recover(state[0].z.data(), alone); });
  WithThreads(2, [&] { recovery.Recover(state[0].z.data(), together); });
  for (int e = 0; e < 12; ++e)
    EXPECT_EQ(std::memcmp(alone.row(e), together.row(e), alone.size() * sizeof(double)), 0) << e;
}

// What does not close side by side is closed one by one, and what that leaves open is told.
TEST(ChainPoses, ReportStatesThatDoNotClose) {
  const ReducedModel model = MustReduce(Share(testing::FourBar().Definition()));
  ASSERT_EQ(model.size(), 1);
  const PoseRecovery<double> recovery(model, Recovery::kExact);
  const double turn = Deflected(model, VectorX::Ones(1), 1).z(0);
  // The second is more than a third of a turn away, the third nowhere.
  const std::vector<double> z = {0.1 * turn, -2.5 * turn, std::nan(""), 1.0 * turn};
  std::vector<PoseArrays<double>> poses(static_cast<std::size_t>(recovery.bodies()));
  const LoopClosing closing = recovery.RecoverMany(z.data(), 4, 4, poses.data());
  EXPECT_EQ(closing.one_by_one, 2u);
  EXPECT_EQ(closing.open, 1u);
  EXPECT_GE(closing.corrections, 2);
  PoseArrays<double> one;
  EXPECT_EQ(recovery.Recover(&z[0], one).one_by_one, 0u);
  EXPECT_EQ(recovery.Recover(&z[1], one).one_by_one, 1u);
  for (const std::size_t i : {0, 1, 3}) {
    Configuration scratch(model);
    std::vector<RigidTransform> X_RB;
    RecoverPosesExact(model, {VectorX::Constant(1, z[i]), {}, {}}, scratch, X_RB);
    for (std::size_t b = 0; b < X_RB.size(); ++b)
      EXPECT_LT((poses[b].Pose(i).translation() - X_RB[b].translation()).norm(), 1e-9) << i << ' ' << b;
  }
}

}  // namespace
}  // namespace fork1s
