// What sticking points bear against each other fades; what nothing else could bear stays to the last digit.
#include <gtest/gtest.h>

#include "constraints/regularized_contact_problem.hpp"
#include "problems.hpp"

namespace fork1s {
namespace {

using testing::Problem;

// A body between others, each of which it touches at points on a line along their first tangent: there they may
// squeeze each other.
Problem Between(int others, int points) {
  Problem p;
  for (int b = 0; b <= others; ++b) p.W.push_back(testing::RigidBodyW(1 + b, 0.01 + 0.002 * b));
  p.Finish();
  for (int b = 1; b <= others; ++b)
    for (int i = 0; i < points; ++i) {
      const double turn = 2 * M_PI * b / others;
      const Vector3 normal(std::cos(turn), std::sin(turn), 0.1 * b);
      const Matrix3 frame = testing::FrameOf(normal);
      const Vector3 at = 0.1 * normal + 0.05 * i * frame.row(1).transpose();
      ContactConstraint c;
      const auto rows = [&](const Vector3& from) {
        Matrix36 J;
        J << -frame * Skew(from), frame;
        return J;
      };
      c.port_a = 0;
      c.port_b = 6 * b;
      c.J_a = -rows(at);
      c.J_b = rows(at - 0.15 * normal);
      c.friction = 0.8;
      c.compliance_normal = c.compliance_tangent = 1e-4;
      c.hardening_speed = 1;
      c.previous_impulse = c.impulse = Vector3(1, 0.1 + 0.05 * i, 0.2 - 0.1 * i);
      p.contacts.push_back(c);
    }
  return p;
}

// Tangents that are held after Prepare, and what all bear together, before and after.
struct Faded {
  std::vector<Vector2> held;
  double effect_off = 0;
};

Faded Fade(const Problem& p) {
  internal::RegularizedContactProblem rows;
  std::vector<int> taken;
  for (std::size_t i = 0; i < p.contacts.size(); ++i) taken.push_back(static_cast<int>(i));
  EXPECT_TRUE(rows.Prepare(p.blocks, p.contacts, taken, p.limits, p.velocity, 1e-3));
  Faded out;
  VectorX off = VectorX::Zero(p.velocity.size());
  for (std::size_t i = 0; i < rows.points.size(); ++i) {
    const ContactConstraint& c = p.contacts[static_cast<std::size_t>(rows.place(i))];
    out.held.push_back(rows.points[i].previous.tangents);
    off += p.RowsOf(c).bottomRows<2>().transpose() *
           (rows.points[i].previous.tangents - c.previous_impulse.tail<2>());
  }
  out.effect_off = off.norm();
  return out;
}

TEST(Squeeze, WhatNothingElseCouldBearStays) {
  const Problem p = Between(3, 1);
  const Faded faded = Fade(p);
  for (std::size_t i = 0; i < p.contacts.size(); ++i)
    EXPECT_EQ(faded.held[i], p.contacts[i].previous_impulse.tail<2>());
}

TEST(Squeeze, OfTwoPointsOnABodyFadesAndChangesNothing) {
  for (const int others : {1, 2, 3, 5}) {
    const Problem p = Between(others, 2);
    const Faded faded = Fade(p);
    EXPECT_LT(faded.effect_off, 1e-9) << others;
    double moved = 0, before = 0, after = 0;
    for (std::size_t i = 0; i < p.contacts.size(); ++i) {
      const Vector2 held = p.contacts[i].previous_impulse.tail<2>();
      moved += (faded.held[i] - held).norm();
      before += held.squaredNorm();
      after += faded.held[i].squaredNorm();
    }
    EXPECT_GT(moved, 1e-3) << others;
    EXPECT_LT(after, before) << others;
  }
}

// Rows are more than the freedoms of one body, and fewer than those of two.
TEST(Squeeze, IsTheSameFromFreedomsAndFromRows) {
  Problem one = Between(3, 2);
  one.W.resize(1);
  for (ContactConstraint& c : one.contacts) c.port_b = -1;
  one.contacts.pop_back();
  one.contacts.pop_back();
  Problem two = one;
  two.W.push_back(testing::RigidBodyW(1, 0.01));
  one.Finish();
  two.Finish();
  const Faded from_freedoms = Fade(one), from_rows = Fade(two);
  for (std::size_t i = 0; i < one.contacts.size(); ++i) {
    EXPECT_LT((from_freedoms.held[i] - from_rows.held[i]).norm(), 1e-8);
    EXPECT_GT((from_rows.held[i] - one.contacts[i].previous_impulse.tail<2>()).norm(), 1e-3);
  }
}

}  // namespace
}  // namespace fork1s
