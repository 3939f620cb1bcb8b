// Suction by closed forms: a cup that holds, drops, lets go, slides and attracts a box.
#include "record/simulation_bytes.hpp"
#include "support.hpp"

namespace fork1s::adhesion_test {
namespace {

// A servo stiff enough to hold the cup within 1e-4 of its size, critically damped.
std::string Servo(const Cup& cup) {
  const double kp = 1e4 * 11 * cup.weight() / cup.size, kv = 2 * std::sqrt(kp * 11 * cup.mass());
  return fmt::format("<position name='servo' joint='slide' kp='{:.17g}' kv='{:.17g}'/>", kp, kv);
}

// The contact bears the pull less the weight, the box follows the cup; as far as contacts give way, by `depth`.
TEST(Adhesion, PullAboveTheWeight_HoldsTheBox) {
  for (const double size : kSizes)
    for (const Quaternion& turn : kTurns)
      for (const bool box_first : {false, true}) {
        Cup cup;
        cup.size = size;
        cup.turn = turn;
        cup.box_first = box_first;
        cup.gain = 1.2 * cup.weight();
        cup.motors = Servo(cup);
        Simulation s = MustStart(cup.Text(), 1. / 240);
        s.SetControl("suction", 1);
        const Vector3 before = Place(s, "box") - Place(s, "cup");
        RunUntil(s, 1);
        EXPECT_LT((Place(s, "box") - Place(s, "cup") - before).norm(), 2e-5) << size << box_first;
        const Normal force = NormalForces(s);
        EXPECT_NEAR(force.pull, cup.gain, 1e-9 * cup.gain);
        EXPECT_NEAR(force.contact, 0.2 * cup.weight(), 1e-3 * cup.weight()) << size << box_first;
        EXPECT_EQ(force.count, 4);
      }
}

// It pulls until the box is farther than contacts give way, `depth`.
TEST(Adhesion, PullBelowTheWeight_DropsTheBox) {
  for (const double size : {0.1, 1.0})
    for (const Quaternion& turn : kTurns) {
      Cup cup;
      cup.size = size;
      cup.turn = turn;
      cup.gain = 0.8 * cup.weight();
      cup.motors = Servo(cup);
      const double dt = 1. / 240, T = 0.5;
      Simulation s = MustStart(cup.Text(), dt);
      s.SetControl("suction", 1);
      const Vector3 before = Place(s, "box");
      RunUntil(s, T);
      const double fallen = -(Place(s, "box") - before).dot(cup.Axis(2));
      // The plate sags by up to 1e-4 of its size. Until the box is `depth` below it, and to the end of that step, it
      // falls at a fifth of g or more, which costs up to 0.8 g of the speed.
      const double late = std::sqrt(2 * (1e-5 + 1e-4 * size) / (0.2 * kGravity)) + dt;
      EXPECT_LT(fallen, kGravity * T * T / 2 + 1e-5);
      EXPECT_GT(fallen, kGravity * T * T / 2 - 0.8 * kGravity * late * T);
      EXPECT_EQ(NormalForces(s).count, 0);
    }
}

TEST(Adhesion, ReleasedByTheControl_TheBoxFallsFreely) {
  for (const double size : kSizes)
    for (const Quaternion& turn : kTurns) {
      Cup cup;
      cup.size = size;
      cup.turn = turn;
      cup.gain = 3 * cup.weight();
      cup.motors = Servo(cup);
      Simulation s = MustStart(cup.Text(), 1. / 240);
      s.SetControl("suction", 1);
      RunUntil(s, 0.5);
      const Vector3 then = Place(s, "box");
      s.SetControl("suction", 0);
      RunUntil(s, 1);
      const Vector3 fall = Place(s, "box") - then;
      // What contacts gave way by comes back within a step or two: at most `depth`, 1e-5 m, at 4 steps' rate.
      EXPECT_NEAR(-fall.dot(cup.Axis(2)), kGravity * 0.25 / 2, 2e-3 * kGravity * 0.125) << size;
      EXPECT_LT((fall - fall.dot(cup.Axis(2)) * cup.Axis(2)).norm(), 1e-6);
    }
}

// A motor lifts cup and box at a; the contact bears F - m (g + a), and the box is lost where that is negative.
TEST(Adhesion, LiftedAtAnAcceleration_HeldAboveWeightAndInertia) {
  for (const double size : kSizes)
    for (const double share : {1.05, 0.95}) {
      Cup cup;
      cup.size = size;
      const double a = 2, m = cup.mass();
      cup.gain = share * m * (kGravity + a);
      cup.motors = fmt::format("<motor name='lift' joint='slide' gear='{:.17g}'/>", 11 * m * (kGravity + a));
      Simulation s = MustStart(cup.Text(), 1. / 240);
      s.SetControl("suction", 1);
      s.SetControl("lift", 1);
      const double start = Place(s, "cup").z(), box = Place(s, "box").z(), T = 0.5;
      RunUntil(s, T);
      const double risen = Place(s, "cup").z() - start, box_risen = Place(s, "box").z() - box;
      if (share > 1) {
        EXPECT_NEAR(risen, a * T * T / 2, 1e-4 * a * T * T) << size;
        EXPECT_NEAR(box_risen, risen, 2e-5) << size;
        EXPECT_NEAR(NormalForces(s).contact, 0.05 * m * (kGravity + a), 1e-3 * m * kGravity) << size;
      } else {
        EXPECT_LT(box_risen, -0.5) << size;
      }
    }
}

// The plate holds against gravity across it by µ (F - its component along the normal).
TEST(Adhesion, LoadAcrossThePlate_SlidesByFrictionOfTheCompression) {
  for (const double size : {0.02, 0.1, 1.0})
    for (const Quaternion& turn : kTurns) {
      Cup cup;
      cup.size = size;
      cup.turn = turn;
      cup.gravity = kGravity * Vector3(0.6, 0, -0.8);
      const double m = cup.mass(), across = 0.6 * kGravity, along = 0.8 * kGravity;
      for (const double share : {1.1, 0.5}) {
        cup.gain = share * m * across / cup.friction + m * along;
        cup.motors = Servo(cup);
        Simulation s = MustStart(cup.Text(), 1. / 240);
        s.SetControl("suction", 1);
        const double x = Place(s, "box").dot(cup.Axis(0));
        const double T = std::sqrt(2 * 2 * size / across);  // two half sides
        const int steps = static_cast<int>(T / s.dt());
        for (int k = 0; k < steps; ++k) ASSERT_TRUE(s.Step().finite);
        const double t = s.time(), slid = Place(s, "box").dot(cup.Axis(0)) - x;
        if (share > 1)
          EXPECT_LT(std::abs(slid), 1e-4) << size;  // of the tangential springs
        else
          EXPECT_NEAR(slid, (1 - share) * across * t * t / 2, 0.01 * across * t * t / 2) << size;
      }
    }
}

// In free space the two attract each other within `gap` and meet; beyond it they do not.
TEST(Adhesion, BoxWithinTheGap_IsAttracted) {
  for (const double size : kSizes)
    for (const Quaternion& turn : kTurns) {
      Cup cup;
      cup.size = size;
      cup.turn = turn;
      cup.gravity.setZero();
      cup.gap = 0.5 * size;
      cup.distance = 0.4 * size;
      const double m = cup.mass(), T = 0.5;
      // Half of the way in T, of which the plate goes a tenth.
      cup.gain = 0.4 * size * m / (T * T) / 1.1;
      Simulation s = MustStart(cup.Text(), 1. / 120);
      const Vector3 box = Place(s, "box"), plate = Place(s, "cup");
      s.SetControl("suction", 1);
      RunUntil(s, T);
      const double way = (Place(s, "box") - box).dot(cup.Axis(2));
      EXPECT_NEAR(way, cup.gain / m * T * T / 2, 1e-9 * size);
      EXPECT_NEAR((Place(s, "cup") - plate).dot(cup.Axis(2)), -way / 10, 1e-9 * size);
      RunUntil(s, 3 * T);
      EXPECT_NEAR((Place(s, "cup") - Place(s, "box")).dot(cup.Axis(2)), size + cup.half().z(), 2e-5);
      cup.distance = 0.6 * size;
      Simulation far = MustStart(cup.Text(), 1. / 120);
      const Vector3 start = Place(far, "box");
      far.SetControl("suction", 1);
      RunUntil(far, T);
      EXPECT_LT((Place(far, "box") - start).norm(), 1e-12 * size);
    }
}

// Two boxes: all contacts have equal shares, whichever box they are of.
TEST(Adhesion, SeveralContacts_ShareTheForceEqually) {
  Cup cup;
  cup.gain = 4 * cup.weight();
  cup.motors = Servo(cup);
  const Vector3 h = cup.half();
  cup.more = fmt::format(
      "<body name='other' pos='{} 0 {:.17g}'><freejoint/><geom type='sphere' size='{:.17g}' mass='{:.17g}'/></body>",
      3 * cup.size, -h.x(), h.x(), cup.mass() / 2);
  Simulation s = MustStart(cup.Text(), 1. / 240);
  s.SetControl("suction", 1);
  RunUntil(s, 0.5);
  int count = 0;
  for (const ContactRecord& c : s.world().contacts()) {
    EXPECT_NEAR(-c.pull.x() / s.dt(), cup.gain / 5, 1e-9 * cup.gain);
    ++count;
  }
  EXPECT_EQ(count, 5);
  EXPECT_NEAR(NormalForces(s).contact, 2.5 * cup.weight(), 1e-3 * cup.weight());
}

TEST(Adhesion, StateOrBytesRestored_GoOnWithTheSameBits) {
  Cup cup;
  cup.gain = 2 * cup.weight();
  cup.gap = 0.01;
  cup.motors = Servo(cup);
  Simulation s = MustStart(cup.Text(), 1. / 240);
  s.SetControl("suction", 1);
  RunUntil(s, 0.1);
  const Simulation::Snapshot saved = s.Save();
  const std::string bytes = WriteSimulationBytes({s.scene(), s.options(), {}, saved});
  RunUntil(s, 0.3);
  const Vector3 first = Place(s, "box");
  ASSERT_TRUE(s.Restore(saved));
  RunUntil(s, 0.3);
  EXPECT_EQ(first, Place(s, "box"));
  const auto content = ReadSimulationBytes(bytes, "bytes");
  ASSERT_TRUE(content) << content.error().Text();
  auto other = Simulation::Create(content->scene, content->options);
  ASSERT_TRUE(other && other->Restore(content->snapshot));
  RunUntil(*other, 0.3);
  EXPECT_EQ(first, Place(*other, "box"));
}

}  // namespace
}  // namespace fork1s::adhesion_test
