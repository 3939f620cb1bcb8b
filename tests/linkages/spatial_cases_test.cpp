// Named linkages in space: rods that spin unseen, and loops that move against their count.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <string>

#include "methods_expected.hpp"
#include "random_linkage.hpp"

namespace fork1s::linkages {
namespace {

SpatialInertia Lump() { return {0.5, Vector3(0.01, 0.02, 0), Vector3(1e-3, 2e-3, 2e-3).asDiagonal()}; }

void ForSpatialVariations(const Sketch& sketch,
                          const std::function<void(const Sketch&, const Writing&)>& check) {
  check(sketch, {.keep_order = true});
  for (unsigned seed = 0; seed < 12; ++seed) {
    SCOPED_TRACE(seed);
    Sketch s = WithRoot(sketch, RandomPose(seed, sketch.size * (seed % 4 == 0 ? 30 : 1)));
    s = Moved(std::move(s), RandomPose(seed + 100, 1));
    check(Scaled(std::move(s), seed % 3 == 0 ? 1e-2 : seed % 3 == 1 ? 1 : 10), {.seed = seed});
  }
}

// Steering: an upright on its kingpin, a rack that a spring centres, a tie rod with a ball at either end.
struct Steering {
  enum Body { kUpright = 1, kRack = 2, kRod = 3 };

  static Sketch Draw(double k_ball = 0) {
    Sketch s;
    s.family = "steering";
    s.AddBody(RigidTransform(), Lump());
    s.AddBody(RigidTransform(Vector3(0.1, 0.7, 0.3)), Lump());
    s.AddBody(RigidTransform(Vector3(0.25, 0.2, 0.25)), Lump());
    s.AddBody(RigidTransform(Vector3(0.25, 0.3, 0.25)), Lump());
    s.AddPair(0, kUpright, PairKind::kHinge, Vector3(0.1, 0.7, 0.3), FrameAlong(Vector3(-0.1, 0.15, 1)))
        .k_turn = 40;
    s.AddPair(0, kRack, PairKind::kSlide, Vector3(0.25, 0.2, 0.25), FrameAlong(Vector3::UnitY())).k_slide =
        3e4;
    s.AddPair(kRack, kRod, PairKind::kBall, Vector3(0.25, 0.3, 0.25), Matrix3::Identity()).k_turn = k_ball;
    s.AddPair(kRod, kUpright, PairKind::kBall, Vector3(0.24, 0.68, 0.31), Matrix3::Identity());
    s.interfaces = {kUpright};
    s.size = 0.4;
    return s;
  }
};

TEST(TieRod, SpinsUnseenAndIsRefusedByName) {
  ForSpatialVariations(Steering::Draw(), [](const Sketch& s, const Writing& w) {
    const Methods r(s, w);
    ExpectMethods(r, {.mobility = 2, .interface_rank = 1, .hidden = 1});
    ASSERT_FALSE(r.model);
    // The rod's own balls are the only joints that turn; one of them may be the closure.
    const std::string joint = JointOf(r.model.error());
    EXPECT_TRUE(joint == "p2" || joint == "p3") << r.model.error().Text();
  });
}

TEST(TieRod, IsSeenWhereItIsAnInterface) {
  Sketch s = Steering::Draw();
  s.interfaces = {Steering::kRod, Steering::kUpright};
  ForSpatialVariations(s, [](const Sketch& sketch, const Writing& w) {
    ExpectMethods(Methods(sketch, w), {.mobility = 2, .interface_rank = 1, .interface_free = 1});
  });
}

TEST(TieRod, IsHeldByASpringInItsBall) {
  ForSpatialVariations(Steering::Draw(0.3), [](const Sketch& s, const Writing& w) {
    ExpectMethods(Methods(s, w), {.mobility = 2, .interface_rank = 1});
  });
}

TEST(TieRod, PromotedOnRequest) {
  const Written linkage = Build(Steering::Draw(), {.seed = 3});
  ReductionOptions options;
  options.interfaces = linkage.interfaces;
  options.promote_hidden = true;
  const auto model = Reduce(linkage.mechanism, VectorX::Zero(linkage.mechanism->num_coordinates()), options);
  ASSERT_TRUE(model) << model.error().Text();
  EXPECT_EQ(model->num_free, 1);
  ASSERT_EQ(model->promoted.size(), 1u);
  EXPECT_EQ(linkage.mechanism->body(model->promoted[0]).name, "b3");
}

// Five rods on six edges of a cube, the sixth is the ground.
TEST(Bricard, OneMotionWhereTheCountGivesNone) {
  const Vector3 corner[] = {{0, 0, 0}, {1, 0, 0}, {1, -1, 0}, {1, -1, 1}, {0, -1, 1}, {0, 0, 1}};
  const Vector3 axis[] = {Vector3::UnitY(), Vector3::UnitZ(), Vector3::UnitX(),
                          Vector3::UnitY(), Vector3::UnitZ(), Vector3::UnitX()};
  for (const int springs : {63, 1, 18, 32}) {
    Sketch s;
    s.family = "bricard";
    s.AddBody(RigidTransform(), Lump());
    for (int i = 0; i < 5; ++i) s.AddBody(RigidTransform(corner[i]), Lump());
    for (int i = 0; i < 6; ++i)
      s.AddPair(i, (i + 1) % 6, PairKind::kHinge, corner[i], FrameAlong(axis[i])).k_turn =
          springs >> i & 1 ? 1 + 10 * i : 0;
    s.interfaces = {3};
    ForSpatialVariations(s, [](const Sketch& sketch, const Writing& w) {
      const Methods r(sketch, w);
      ExpectMethods(r, {.mobility = 1, .interface_rank = 1});
      EXPECT_EQ(r.plain.loop_rank, 4);
    });
  }
}

// Random members of the families that move against their count, springs or not.
TEST(Overconstrained, KeepTheirRanksInEveryFrame) {
  int seen = 0;
  for (unsigned seed = 0; seed < 200; ++seed) {
    const Sketch s = RandomLinkage(seed);
    if (s.family != "bennett" && s.family != "sarrus" && s.family != "parallelogram") continue;
    const Methods reference(s, {.keep_order = true});
    if (!reference.plain.well_posed) continue;
    ++seen;
    SCOPED_TRACE(::testing::Message() << "seed " << seed << " " << s.family);
    const Counts counts{reference.mobility(), reference.plain.interface_rank, reference.plain.interface_free,
                        reference.plain.hidden()};
    Sketch turned = WithRoot(s, RandomPose(seed, s.size));
    ExpectMethods(Methods(Moved(turned, RandomPose(seed + 1, 1)), {.seed = seed}), counts);
  }
  EXPECT_GT(seen, 30);
}

}  // namespace
}  // namespace fork1s::linkages
