// What counts as an impact: each threshold at its edge.
#include "world/impact.hpp"

#include <gtest/gtest.h>

namespace fork1s {
namespace {

// One contact of a ball of radius 1 m, collision body 1, with one of 2 m, collision body 0, whose normal velocity is
// the third linear one of port 0. Steps of 0.01 s, impacts from 0.001 m/s on.
struct OneContact {
  OneContact() {
    for (const double radius : {2.0, 1.0}) {
      CollisionBodyDef body;
      body.moves = radius == 1;
      body.geometries.emplace_back();
      body.geometries.back().shape = Sphere{radius};
      detection.shapes.Add(body);
    }
    ContactPoint point;
    point.body_a = point.geometry_a = point.geometry_b = 0;
    point.body_b = 1;
    detection.points = {point};
    detection.motion.Reset(2);
    detection.margins.group = {0, -1};
    history.match = {-1};
    rows.contacts.resize(1);
    rows.contacts[0].port_b = 0;
    rows.contacts[0].J_b.setZero();
    rows.contacts[0].J_b(0, 5) = 1;
    rows.velocities.setZero(6);
    approaches.closing = {0};
    StepOptions step;
    step.h = h;
    step.material.depth = 1e-5;
    step.gravity.setZero();
    approaches.SetSpeeds(step);
  }
  // It bore a load in the last step, and closed its gap at this speed at its end.
  void Bear(double end_speed) {
    ContactRecord before;
    before.impulse(0) = 1;
    before.end_speed = end_speed;
    history.contacts = {before};
    history.is_fresh = {1};
    history.match = {0};
    history.StartStep();
  }
  ImpactView At() const { return {detection, history, rows, approaches}; }

  double h = 0.01;
  Detection detection;
  ContactHistory history;
  ConstraintRows rows;
  Approaches approaches;
};

bool Found(const StepSubject& subject) { return subject.kind == StepSubject::Kind::kContact; }

TEST(Impact, SpeedIsAtMostThatOfAFallThroughTheDepthOfTheMaterial) {
  StepOptions step;
  step.material.depth = 1e-5;
  step.gravity = Vector3(0, 0, -9.81);
  const double fall = std::sqrt(2 * 9.81 * 1e-5);  // 14 mm/s
  Approaches approaches;
  for (const double share : {0.99, 1.01}) {
    step.h = step.material.depth / (share * fall);
    approaches.SetSpeeds(step);
    EXPECT_DOUBLE_EQ(approaches.impact_speed, std::min(share, 1.0) * fall);
  }
}

TEST(Impact, SpeedIsTheDepthOfTheMaterialInAStep) {
  const OneContact c;
  EXPECT_DOUBLE_EQ(c.approaches.impact_speed, 1e-3);
  EXPECT_DOUBLE_EQ(c.approaches.carried_speed, 1e-3);
}

TEST(Impact, ForeseenIsTheFirstThatClosesAtTheSpeedOfAnImpact) {
  OneContact c;
  // A patch at rest with restitution would be met in every step, were any speed an impact.
  for (const double restitution : {0.0, 0.5})
    for (const double speed : {0.99e-3, 1.01e-3}) {
      c.detection.points[0].restitution = restitution;
      c.approaches.closing = {speed};
      EXPECT_EQ(Found(FindPredictedImpact(c.At()).of), speed > 1e-3) << speed;
      c.rows.contacts[0].impulse(0) = 1;
      EXPECT_EQ(Found(FindImpact(c.At(), c.h)), speed > 1e-3) << speed;
      c.rows.contacts[0].impulse(0) = 0;
    }
  c.approaches.closing = {2};
  for (const double gap : {-1e-3, 1e-2}) {
    c.detection.points[0].gap = gap;
    EXPECT_DOUBLE_EQ(FindPredictedImpact(c.At()).time, gap / 2);
  }
  c.detection.points.push_back(c.detection.points[0]);
  c.rows.contacts.push_back(c.rows.contacts[0]);
  c.history.match.push_back(-1);
  c.approaches.closing.push_back(3);
  c.detection.points[1].body_b = 2;
  EXPECT_DOUBLE_EQ(FindPredictedImpact(c.At()).time, 1e-2 / 3);
  EXPECT_EQ(FindPredictedImpact(c.At()).of.part, 2);
  c = OneContact();
  c.approaches.closing = {1};
  for (const double end_speed : {-0.99e-3, -1.01e-3}) {
    c.Bear(end_speed);
    EXPECT_EQ(Found(FindPredictedImpact(c.At()).of), end_speed < -1e-3) << end_speed;
  }
}

// In the second stage, of what lasts from the start of the step and was borne in the first.
TEST(Impact, WhatLastsMayHaveClosedItsGapAtAnySpeed) {
  OneContact c;
  c.approaches.closing = {1};
  c.rows.contacts[0].impulse(0) = 1;
  c.Bear(-1);
  EXPECT_TRUE(Found(FindImpact(c.At(), c.h)));
  c.history.start_gap = {1e-6};
  EXPECT_FALSE(Found(FindImpact(c.At(), c.h)));
  c.history.contacts[0].impulse(0) = 0;
  EXPECT_TRUE(Found(FindImpact(c.At(), c.h)));
}

TEST(Impact, WhatBearsWasMetAtSpeedOrFromAsFar) {
  OneContact c;
  c.rows.contacts[0].impulse(0) = 1;
  for (const double gap : {0.99e-5, 1.01e-5}) {
    c.detection.points[0].gap = gap;
    EXPECT_EQ(Found(FindImpact(c.At(), c.h)), gap > 1e-5) << gap;
  }
  c.rows.contacts[0].impulse(0) = 0;
  EXPECT_FALSE(Found(FindImpact(c.At(), c.h)));
}

TEST(Impact, WhatWasStoppedPartsAgainByAShareOfItsSizeASecond) {
  OneContact c;
  c.Bear(0);
  for (const double speed : {1.99e-4, 2.01e-4}) {
    c.rows.velocities(5) = speed;
    EXPECT_EQ(Found(FindParting(c.At(), {})), speed > 2e-4) << speed;
  }
  c.history.is_fresh = {0};
  EXPECT_FALSE(Found(FindParting(c.At(), {})));
}

TEST(Impact, MotionByMoreThanHalfOfTheInnerRadiiMayHavePassedTheOther) {
  OneContact c;
  for (const double motion : {1.49, 1.51}) {  // of 3 m
    c.detection.motion.in_world[1] = motion;
    EXPECT_EQ(MayHavePassed(c.At(), c.h), motion > 1.5) << motion;
  }
}

// Turned over within a stage, what touches at its end overlapped along the normal at its start.
TEST(Impact, PointsThatOverlappedByMoreThanHalfOfTheInnerRadiiHavePassed) {
  for (const double moved : {1.49, 1.51}) {  // of 3 m
    OneContact c;
    c.detection.collision_bodies.resize(2);
    c.detection.collision_bodies[1].kind = CollisionBody::Kind::kFreeBody;
    c.detection.points[0].frame.row(0) = -Vector3::UnitZ();
    c.detection.poses = c.detection.stage_start_poses = {RigidTransform(), RigidTransform()};
    c.detection.stage_start_poses[1].translation().z() = moved;
    c.approaches.pose_gaps = {0};
    c.detection.motion.in_world[1] = moved;
    EXPECT_EQ(Found(FindTunnelling(c.At())), moved > 1.5) << moved;
    c.detection.points[0].frame.row(0) = Vector3::UnitZ();
    EXPECT_FALSE(Found(FindTunnelling(c.At())));
  }
}

TEST(Impact, WhatOverlapsAndMovesAsOneHasNotPassed) {
  OneContact c;
  c.detection.collision_bodies.resize(2);
  for (CollisionBody& body : c.detection.collision_bodies) body.kind = CollisionBody::Kind::kFreeBody;
  c.detection.points[0].frame.row(0) = -Vector3::UnitZ();
  c.approaches.pose_gaps = {-2};  // beyond half of 3 m
  c.detection.poses = c.detection.stage_start_poses = {RigidTransform(), RigidTransform()};
  for (RigidTransform& pose : c.detection.stage_start_poses) pose.translation().z() = 5;
  for (double& motion : c.detection.motion.in_world) motion = 5;
  EXPECT_FALSE(Found(FindTunnelling(c.At())));
  c.detection.stage_start_poses[0].translation().z() = 0;
  EXPECT_TRUE(Found(FindTunnelling(c.At())));
}

// The predicted pose shows another face than the one that was met, if along its normal the pair overlaps at the base
// point already.
TEST(Impact, WhatOverlappedAlongTheNormalCameThroughAnotherFace) {
  for (const double share : {0.9e-6, 1.1e-6}) {
    OneContact c;
    c.detection.points[0].gap = -share * c.detection.shapes.PairSize(c.detection.points[0]);
    EXPECT_EQ(MayHavePassed(c.At(), c.h), share > 1e-6) << share;
    c.Bear(0);
    EXPECT_FALSE(MayHavePassed(c.At(), c.h));
  }
  OneContact c;
  c.detection.points[0].gap = -1e-3;
  c.rows.velocities(5) = 0.11;  // it parts within the stage
  EXPECT_FALSE(MayHavePassed(c.At(), c.h));
}

}  // namespace
}  // namespace fork1s
