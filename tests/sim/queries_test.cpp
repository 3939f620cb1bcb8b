// Names, contacts in newtons and rays, and motions that go on in another scene.
#include <gtest/gtest.h>
#include <fork1s/sim/continue.hpp>
#include <fork1s/sim/queries.hpp>

#include <algorithm>
#include <cmath>
#include <map>
#include <stdexcept>

#include "gripper.hpp"

namespace fork1s {
namespace {

Simulation Holding() {
  auto simulation = Simulation::Create(testing::Gripper().Make());
  simulation->SetControl("left", 0.02);
  simulation->SetControl("right", 0.02);
  for (int i = 0; i < 60; ++i) simulation->Step();
  return std::move(*simulation);
}

TEST(Ask, UnknownNamesAreErrorsThatListTheKnown) {
  Simulation s = Holding();
  EXPECT_EQ(s.bodies()[static_cast<std::size_t>(*BodyNamed(s, "left"))].name, "left");
  const auto none = BodyNamed(s, "thumb");
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::kUsage);
  EXPECT_NE(none.error().Text().find("left, right, ball"), std::string::npos) << none.error().Text();
  EXPECT_FALSE(ControlNamed(s, "thumb"));
  EXPECT_FALSE(TrySetControl(s, "thumb", 1));
  EXPECT_FALSE(TrySetControl(s, "left", std::nan("")));
  EXPECT_TRUE(TrySetControl(s, "left", 0.01));
  EXPECT_EQ(s.controls()(*ControlNamed(s, "left")), 0.01);
}

TEST(Ask, ContactsHoldWhatTheyCarry) {
  const Simulation s = Holding();
  Vector3 on_ball = Vector3::Zero();
  const auto contacts = Contacts(s);
  ASSERT_GE(contacts.size(), 2u);
  for (const BodyContact& c : contacts) {
    ASSERT_TRUE(c.name_a == "ball" || c.name_b == "ball");
    on_ball += (c.name_b == "ball" ? 1 : -1) * c.force_W;
    EXPECT_NEAR(c.normal_W.norm(), 1, 1e-12);
  }
  // 0.1 kg at rest.
  EXPECT_NEAR(on_ball.z(), 0.1 * 9.81, 1e-6);
  EXPECT_NEAR(on_ball.x(), 0, 1e-6);
}

// Whatever shapes touch, the first body of a pair is the one that Simulation::bodies() has first.
TEST(Ask, ContactsHaveTheirBodiesInOneOrder) {
  Scene scene;
  scene.world.emplace_back().shape = Box{Vector3(2, 2, 0.1)};
  scene.world.back().X_BG = RigidTransform(Vector3(0, 0, -0.1));
  const auto add = [&](const char* name, const Shape& shape, double z) {
    FreeBodyDef body;
    body.name = name;
    body.inertia.mass = 0.2;
    body.inertia.rotational = Vector3::Constant(1e-3).asDiagonal();
    body.X_WB = RigidTransform(Vector3(0, 0, z));
    body.geometries.emplace_back().shape = shape;
    scene.free_bodies.push_back(body);
  };
  add("box", Box{Vector3(0.2, 0.2, 0.05)}, 0.05);
  add("ball", Sphere{0.05}, 0.15);
  add("plate", Box{Vector3(0.2, 0.2, 0.05)}, 0.25);
  auto simulation = Simulation::Create(scene);
  ASSERT_TRUE(simulation) << simulation.error().Text();
  for (int i = 0; i < 30; ++i) simulation->Step();
  std::map<std::pair<std::string, std::string>, Vector3> on_b;
  for (const BodyContact& c : Contacts(*simulation)) {
    EXPECT_LT(c.body_a, c.body_b);
    EXPECT_GT(c.normal_W.z(), 0.9);
    auto& sum = on_b.try_emplace({c.name_a, c.name_b}, Vector3::Zero()).first->second;
    sum += c.force_W;
  }
  ASSERT_EQ(on_b.size(), 3u);
  EXPECT_NEAR((on_b[{"world", "box"}].z()), 0.6 * 9.81, 1e-6);
  EXPECT_NEAR((on_b[{"box", "ball"}].z()), 0.4 * 9.81, 1e-6);
  EXPECT_NEAR((on_b[{"ball", "plate"}].z()), 0.2 * 9.81, 1e-6);
}

TEST(Ask, RaysMeetShapesWhereTheyAre) {
  Simulation s = Holding();
  auto rays = RayCaster::Create(s);
  ASSERT_TRUE(rays) << rays.error().Text();
  const Vector3 ball = s.Pose("ball").translation();
  const auto down = rays->Cast(s, ball + Vector3(0, 0, 1), Vector3(0, 0, -2));
  ASSERT_TRUE(down);
  EXPECT_EQ(down->name, "ball");
  EXPECT_NEAR(down->distance, 1 - 0.02, 1e-9);
  EXPECT_LT((down->normal_W - Vector3::UnitZ()).norm(), 1e-9);
  EXPECT_LT((down->point_W - ball - Vector3(0, 0, 0.02)).norm(), 1e-9);
  const auto side = rays->Cast(s, ball - Vector3(1, 0, 0), Vector3(1, 0, 0));
  ASSERT_TRUE(side);
  EXPECT_EQ(side->name, "left");
  EXPECT_NEAR(side->distance, s.Pose("left").translation().x() - 0.01 - (ball.x() - 1), 1e-9);
  EXPECT_FALSE(rays->Cast(s, ball + Vector3(0, 0, 1), Vector3(0, 0, -2), 0.5));
  EXPECT_FALSE(rays->Cast(s, ball + Vector3(0, 0, 1), Vector3(0, 0, 1)));
  // It follows what moves.
  s.SetControl("left", -0.05);
  s.SetControl("right", -0.05);
  for (int i = 0; i < 30; ++i) s.Step();
  const double fallen = ball.z() - s.Pose("ball").translation().z();
  ASSERT_GT(fallen, 0.5);
  const auto again = rays->Cast(s, ball + Vector3(0, 0, 1), Vector3(0, 0, -1));
  ASSERT_TRUE(again);
  EXPECT_NEAR(again->distance, 1 - 0.02 + fallen, 1e-6);
  EXPECT_THROW((void)rays->Cast(s, ball, Vector3::Zero()), std::invalid_argument);
}

TEST(Continue, TheSameSceneGoesOnAsItWas) {
  Simulation s = Holding();
  auto next = Continue(s, s.scene());
  ASSERT_TRUE(next) << next.error().Text();
  for (int i = 0; i < 30; ++i) s.Step(), next->Step();
  for (std::size_t b = 0; b < s.bodies().size(); ++b)
    EXPECT_LT(
        (s.Pose(static_cast<int>(b)).translation() - next->Pose(static_cast<int>(b)).translation()).norm(),
        1e-6);
}

TEST(Continue, TimeGoesOn) {
  Simulation s = Holding();
  s.Step();
  auto next = Continue(s, s.scene());
  ASSERT_TRUE(next) << next.error().Text();
  EXPECT_EQ(next->steps(), 61);
  EXPECT_EQ(next->time(), s.time());
  // So set-points over time go on where they were.
  ControlTrack track{{"left", "right"}, {0, 1, 2}, {{0, 0}, {0.01, 0.01}, {0.03, 0.03}}};
  for (int i = 0; i < 30; ++i)
    for (Simulation* at : {&s, &*next}) {
      track.Apply(at->time() + at->dt(), *at);
      at->Step();
    }
  EXPECT_EQ(next->steps(), 91);
  EXPECT_NEAR(next->controls()(0), 0.01 + 0.02 * (91 * s.dt() - 1), 1e-12);
  EXPECT_LT((s.Pose("left").translation() - next->Pose("left").translation()).norm(), 1e-6);
}

TEST(Continue, ADrivenBaseCountsFromWhereItBegan) {
  testing::Gripper gripper;
  gripper.base = BaseKind::kDriven;
  auto s = Simulation::Create(gripper.Make());
  ASSERT_TRUE(s) << s.error().Text();
  const auto lift = [](Simulation& at, double to) {
    at.SetControl("frame.z", to);
    at.SetControl("frame.rz", 10 * to);
    at.Step();
  };
  for (int i = 1; i <= 30; ++i) lift(*s, 0.001 * i);
  auto next = Continue(*s, s->scene());
  ASSERT_TRUE(next) << next.error().Text();
  EXPECT_EQ(next->controls()(next->FindControl("frame.z")), 0.03);
  EXPECT_LT((next->Pose("frame").rotation() - s->Pose("frame").rotation()).norm(), 1e-12);
  for (int i = 31; i <= 60; ++i) {
    lift(*s, 0.001 * i);
    lift(*next, 0.001 * i);
    ASSERT_LT((next->Pose("left").translation() - s->Pose("left").translation()).norm(), 1e-6) << i;
  }
  EXPECT_NEAR(next->Pose("frame").translation().z(), 0.06, 1e-12);
}

TEST(Continue, GainsChangeWhileItRuns) {
  Simulation s = Holding();
  const auto pressed = [](const Simulation& at) {
    double most = 0;
    for (const BodyContact& c : Contacts(at)) most = std::max(most, std::abs(c.force_W.x()));
    return most;
  };
  const double before = pressed(s);
  Scene stiffer = s.scene();
  for (const char* name : {"left_grip", "right_grip"}) {
    auto changed = WithStiffness(stiffer, name, 1000);
    ASSERT_TRUE(changed) << changed.error().Text();
    stiffer = std::move(*changed);
  }
  const auto none = WithStiffness(stiffer, "thumb_grip", 1000);
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::kUsage);
  EXPECT_NE(none.error().Text().find("there are: left_grip, left_y"), std::string::npos)
      << none.error().Text();
  EXPECT_FALSE(WithStiffness(stiffer, "left_grip", -1));
  auto next = Continue(s, stiffer);
  ASSERT_TRUE(next) << next.error().Text();
  EXPECT_LT((next->Pose("ball").translation() - s.Pose("ball").translation()).norm(), 1e-12);
  EXPECT_EQ(next->controls()(next->FindControl("left")), 0.02);
  for (int i = 0; i < 60; ++i) next->Step();
  // Set-points are where they were and the gap as wide: twice the gain is twice the force.
  EXPECT_NEAR(pressed(*next), 2 * before, 0.02 * before);
}

TEST(Continue, BodiesComeAndGo) {
  Simulation s = Holding();
  Scene more = s.scene();
  FreeBodyDef second = more.free_bodies[0];
  second.name = "second";
  second.X_WB = RigidTransform(Vector3(1, 0, 0));
  more.free_bodies.insert(more.free_bodies.begin(), second);
  auto two = Continue(s, more);
  ASSERT_TRUE(two) << two.error().Text();
  const Vector3 held = s.Pose("ball").translation();
  for (int i = 0; i < 30; ++i) two->Step();
  EXPECT_LT((two->Pose("ball").translation() - held).norm(), 1e-4);
  EXPECT_LT(two->Pose("second").translation().z(), -0.5);
  Scene less = two->scene();
  less.free_bodies.pop_back();  // the ball
  auto one = Continue(*two, less);
  ASSERT_TRUE(one) << one.error().Text();
  EXPECT_EQ(one->FindBody("ball"), -1);
  EXPECT_LT(one->Velocity(one->FindBody("second"))(5), -4);
  for (int i = 0; i < 30; ++i) one->Step();
  // The fingers' faces meet where they come to rest, without force.
  for (const BodyContact& c : Contacts(*one))
    EXPECT_LT(c.force_W.norm(), 1e-12) << c.name_a << ' ' << c.name_b;
  // What cannot be leaves everything as it was.
  less.free_bodies[0].inertia.mass = -1;
  EXPECT_FALSE(Continue(*one, less));
}

}  // namespace
}  // namespace fork1s
