// Rigid parts: what is done for four of them at once against what is done for one.
#include "support.hpp"

#include <gtest/gtest.h>
#include <string>

#include "mechanism/rigid_parts.hpp"

namespace fork1s::mechanism_test {
namespace {

// Newton's iteration ends within some roundings of the root, wherever each of the two ends. Of an inertia m c² about
// R's origin is taken, so that it is known to the rounding of that.
constexpr double kTurnRounding = 1e-14;

void ExpectTurnsOfEach(const RigidParts& parts, double t, RandomSource& random) {
  MaterialVelocities v;
  v.c_dot.setZero(3, parts.size());
  v.omega.resize(3, parts.size());
  for (int i = 0; i < parts.size(); ++i) v.omega.col(i) = random.InBox(20);
  const Matrix3X before = v.omega;
  TurnFreely(parts, t, v);
  for (int i = 0; i < parts.size(); ++i) {
    const SpatialInertia& I = parts.parts[static_cast<std::size_t>(i)].inertia_R0;
    const Vector3 own =
        I.mass > 0 ? TurnFreely(I.rotational, before.col(i), Vector3::Zero(), t) : Vector3(before.col(i));
    const double size = I.mass > 0 ? I.rotational.norm() + I.mass * I.center.squaredNorm() : 1;
    const Vector3 off = v.omega.col(i) - own;
    EXPECT_LT((I.mass > 0 ? Vector3(I.rotational * off) : off).norm(),
              kTurnRounding * size * (1 + own.norm()))
        << i;
  }
}

TEST(RigidParts, FourTurnAsEachTurns) {
  for (unsigned seed = 0; seed < kSeeds; ++seed) {
    SCOPED_TRACE(seed);
    RandomSource random(seed);
    const RigidParts parts(RandomMechanism(seed, Everything()));
    for (const double t : {1e-3, 1.0 / 120}) ExpectTurnsOfEach(parts, t, random);
  }
}

// A point has no turn, and its inertia is a rounding or 0: neither may reach what turns beside it.
TEST(RigidParts, APointLeavesOthersAlone) {
  RandomSource random(3);
  MechanismBuilder builder("chain");
  BodyIndex last = builder.base();
  for (int i = 0; i < 7; ++i) {
    SpatialInertia inertia = random.Inertia();
    if (i == 1) inertia.rotational.setZero();
    if (i == 4) inertia.rotational = Vector3(1e-3, 1e-3, 1e-5).asDiagonal();
    BodyDef link;
    link.name = "link" + std::to_string(i);
    link.parent = last;
    link.inertia = inertia;
    last = builder.AddBody(link);
    builder.AddJoint(JointDef::Hinge("hinge" + std::to_string(i), last, random.Direction()));
  }
  ExpectTurnsOfEach(RigidParts(BuildOrThrow(builder.definition())), 1.0 / 120, random);
}

}  // namespace
}  // namespace fork1s::mechanism_test
