// A spring between a point of a body and a target in the world: energy, order and rest of two-stage steps.
#include <algorithm>
#include <cmath>
#include <functional>
#include <stepping/support.hpp>

namespace fork1s {
namespace {

using testing::MustCreate;
using testing::MustStart;
using testing::TwoStage;

const Matrix3 kPulledFrame = ExpRotation(Vector3(0.4, -0.7, 1.1));

PointSpring PointSpringTo(const Vector3& point_B, const Vector3& target_W, double stiffness,
                          double damping = 0) {
  return {point_B, target_W, target_W, stiffness, damping};
}

double SpringEnergy(const PointSpring& spring, const RigidTransform& X_WB) {
  return 0.5 * spring.stiffness * (spring.target_W - X_WB * spring.point_B).squaredNorm();
}

// An arm on soft hinges, as a page shows it; pulled at its tip.
struct PulledArm {
  World world;
  BodyIndex tip;
  Matrix3 R;
  MechanismDynamics& m() { return world.mechanisms()[0]; }
};
PulledArm MakePulledArm(const Matrix3& R, BaseKind base, double joint_stiffness, double joint_damping) {
  const testing::HingeSpring spring{joint_stiffness, joint_damping};
  MechanismDef def = testing::TwoLinkArm(base, spring, spring);
  if (base == BaseKind::kFloating) def.bodies[0].inertia = testing::Ball(1, 0.1);
  def.X_WR = RigidTransform(R, Vector3(0.3, -2, 1));
  return {MustCreate(def), BodyIndex(2), R};
}

constexpr double kSuggested = 200;  // N/m, about 2 m g over a fifth of the radius

// The target leaves the tip within the first step, as a pointer does. Without damping the energy never grows
// beyond that of the whole distance, at any stiffness.
TEST(PointSpring, AnArmGainsNoEnergy) {
  for (const BaseKind base : {BaseKind::kFixed, BaseKind::kFloating})
    for (const Matrix3& R : {Matrix3(Matrix3::Identity()), kPulledFrame})
      for (const double joint : {0.0, 3.0, 300.0})
        for (const double harder : {1.0, 25.0, 1e2, 1e3, 1e4})
          for (const Vector3& reach :
               {Vector3(0.1, 0.0, 0.35), Vector3(0.3, 0, -0.3), Vector3(0.7, 0.1, 0.2)}) {
            SCOPED_TRACE(::testing::Message()
                         << "floating " << (base == BaseKind::kFloating) << " joint " << joint << " harder "
                         << harder << " reach " << reach.transpose());
            PulledArm arm = MakePulledArm(R, base, joint, 0);
            const Vector3 target = arm.m().state().X_WR * reach;
            PointSpring spring = PointSpringTo(Vector3(0.25, 0, 0), target, kSuggested * harder);
            spring.target_start_W = arm.m().BodyPose(arm.tip) * spring.point_B;
            arm.m().SetPointSpring(arm.tip, spring);
            const auto energy = [&] {
              return arm.m().KineticEnergy() + arm.m().PotentialEnergy(Vector3::Zero()) +
                     SpringEnergy(spring, arm.m().BodyPose(arm.tip));
            };
            const double start = energy();
            double gain = 0;
            int undone = 0;
            for (int i = 0; i < 120; ++i) {
              const StepReport report = arm.world.Step(TwoStage(1.0 / 60));
              undone += report.finite ? 0 : 1;
              gain = std::max(gain, energy() - start);
            }
            EXPECT_EQ(undone, 0);
            EXPECT_LT(gain, 1e-3 * start);
          }
}

// Damped, it comes to rest where springs balance, for a stiff spring at the target.
TEST(PointSpring, ADampedArmComesToRestAtTheTarget) {
  for (const BaseKind base : {BaseKind::kFixed, BaseKind::kFloating})
    for (const double harder : {1.0, 25.0, 1e2, 1e3, 1e4})
      for (const Vector3& reach : {Vector3(0.1, 0.0, 0.35), Vector3(0.3, 0, -0.3), Vector3(0.7, 0.0, 0.2)}) {
        SCOPED_TRACE(::testing::Message() << "floating " << (base == BaseKind::kFloating) << " harder "
                                          << harder << " reach " << reach.transpose());
        PulledArm arm = MakePulledArm(kPulledFrame, base, 3, 0.05);
        const Vector3 target = arm.m().state().X_WR * reach;
        const double k = kSuggested * harder;
        PointSpring spring = PointSpringTo(Vector3(0.25, 0, 0), target, k, 2 * std::sqrt(k * 0.1));
        spring.target_start_W = arm.m().BodyPose(arm.tip) * spring.point_B;
        arm.m().SetPointSpring(arm.tip, spring);
        const double start = SpringEnergy(spring, arm.m().BodyPose(arm.tip));
        double largest = 0;
        for (int i = 0; i < 360; ++i) {
          ASSERT_TRUE(arm.world.Step(TwoStage(1.0 / 60)).finite) << i;
          largest = std::max(largest, arm.m().KineticEnergy() + arm.m().PotentialEnergy(Vector3::Zero()) +
                                          SpringEnergy(spring, arm.m().BodyPose(arm.tip)));
        }
        EXPECT_LT(largest, 1.001 * start);
        const double distance = (arm.m().BodyPose(arm.tip) * spring.point_B - target).norm();
        const double beyond = base == BaseKind::kFixed ? std::max(0.0, reach.norm() - 0.55) : 0;
        if (base == BaseKind::kFixed) {
          EXPECT_LT(arm.m().KineticEnergy(), 1e-6 * start);
        }
        // Springs of 3 N m/rad turned by 2 rad hold against it, with arms of 0.1 m and more.
        if (harder > 1) {
          // A floating base turns on about the target, and the spring bears its centripetal force.
          EXPECT_LT(distance, beyond + (base == BaseKind::kFixed ? 100 : 200) / k);
        }
      }
}

TEST(PointSpring, AFreeBodyGainsNoEnergyAndComesToRest) {
  for (const Matrix3& R : {Matrix3(Matrix3::Identity()), kPulledFrame})
    for (const double scale : {0.01, 1.0})
      for (const double harder : {1.0, 25.0, 1e2, 1e3, 1e4})
        for (const double damping : {0.0, 1.0}) {
          SCOPED_TRACE(::testing::Message()
                       << "scale " << scale << " harder " << harder << " damping " << damping);
          Scene scene;
          scene.free_bodies.push_back(testing::BoxBody("box", 0.5, scale * Vector3(0.1, 0.2, 0.4),
                                                       scale * Vector3(0.2, 0.1, 0.5), 0.5));
          scene.free_bodies[0].X_WB.rotation() = R;
          World world = MustCreate(scene);
          FreeBody& body = world.free_bodies()[0];
          const double k = 2 * 0.5 * 9.81 / (0.2 * 0.46 * scale) * harder;
          PointSpring spring = PointSpringTo(scale * Vector3(0.1, 0.15, 0.35), scale * Vector3(0.5, 0.4, 1),
                                             k, damping * 2 * std::sqrt(k * 0.1));
          spring.target_start_W = body.pose() * spring.point_B;
          body.SetPointSpring(spring);
          const auto energy = [&] { return body.KineticEnergy() + SpringEnergy(spring, body.pose()); };
          const double start = energy();
          double gain = 0;
          for (int i = 0; i < 1200; ++i) {
            const StepReport report = world.Step(TwoStage(1.0 / 60));
            ASSERT_TRUE(report.finite) << i;
            gain = std::max(gain, energy() - start);
          }
          EXPECT_LT(gain, 1e-3 * start);
          if (damping > 0) {
            EXPECT_LT(energy(), 0.02 * start);
          }
        }
}

// Smooth motion, the target moving: distance from a run with a sixteenth of the step falls by the square.
TEST(PointSpring, TheErrorIsOfSecondOrder) {
  const auto slope = [](const std::function<Vector3(double)>& end) {
    const Vector3 exact = end(1.0 / 3840);
    const double coarse = (end(1.0 / 120) - exact).norm(), fine = (end(1.0 / 240) - exact).norm();
    EXPECT_GT(coarse, 1e-7);
    return std::log2(coarse / fine);
  };
  const auto target_at = [](double t) { return Vector3(0.1 * std::sin(2 * t), 0.05 * t, 0.1 * t); };
  for (const BaseKind base : {BaseKind::kFixed, BaseKind::kFloating, BaseKind::kDriven})
    for (const double damping : {0.0, 3.0})
      EXPECT_GT(slope([&](double h) {
                  PulledArm arm = MakePulledArm(kPulledFrame, base, 3, 0.05);
                  const Vector3 target = arm.m().state().X_WR * Vector3(0.4, 0.0, 0.2);
                  PointSpring spring = PointSpringTo(Vector3(0.25, 0, 0.02), target, 60, damping);
                  for (int i = 0; i < std::lround(0.5 / h); ++i) {
                    spring.target_start_W = target + target_at(i * h);
                    spring.target_W = target + target_at((i + 1) * h);
                    arm.m().SetPointSpring(arm.tip, spring);
                    EXPECT_EQ(arm.world.Step(TwoStage(h)).halving, HalvingCause::kNone);
                  }
                  return Vector3(arm.m().BodyPose(arm.tip) * spring.point_B);
                }),
                1.8)
          << static_cast<int>(base) << ' ' << damping;
  for (const double damping : {0.0, 3.0})
    EXPECT_GT(slope([&](double h) {
                Scene scene;
                scene.free_bodies.push_back(
                    testing::BoxBody("box", 0.5, Vector3(0.1, 0.2, 0.4), Vector3(0.2, 0.1, 0.5), 0.5));
                World world = MustCreate(scene);
                FreeBody& body = world.free_bodies()[0];
                PointSpring spring = PointSpringTo(Vector3(0.1, 0.15, 0.35), Vector3::Zero(), 60, damping);
                for (int i = 0; i < std::lround(0.5 / h); ++i) {
                  spring.target_start_W = Vector3(0.5, 0.4, 1) + target_at(i * h);
                  spring.target_W = Vector3(0.5, 0.4, 1) + target_at((i + 1) * h);
                  body.SetPointSpring(spring);
                  EXPECT_EQ(world.Step(TwoStage(h)).halving, HalvingCause::kNone);
                }
                return Vector3(body.pose() * spring.point_B);
              }),
              1.8)
        << damping;
}

// Pulled onto a floor at its top, a ball rolls and comes to rest; nothing gains energy.
TEST(PointSpring, AFreeBodyIsPulledOntoTheFloor) {
  for (const double harder : {1.0, 25.0, 1e2, 1e3})
    for (const double damping : {0.0, 1.0}) {
      SCOPED_TRACE(::testing::Message() << "harder " << harder << " damping " << damping);
      const double r = 0.02, k = 2 * 0.1 * 9.81 / (0.2 * r) * harder;
      Scene scene;
      scene.world.push_back(testing::Geometry("floor", Plane{}, 0.8));
      scene.free_bodies.push_back(testing::BallBody("ball", 0.1, r, Vector3(0, 0, r), 0.8));
      World world = MustCreate(scene);
      FreeBody& body = world.free_bodies()[0];
      PointSpring spring =
          PointSpringTo(Vector3(0, 0, r), Vector3(0.01, 0.005, 0), k, damping * 2 * std::sqrt(k * 0.1));
      spring.target_start_W = body.pose() * spring.point_B;
      body.SetPointSpring(spring);
      const auto energy = [&] {
        return body.KineticEnergy() + 0.981 * body.center_W().z() + SpringEnergy(spring, body.pose());
      };
      const double start = energy();
      double gain = 0;
      for (int i = 0; i < 300; ++i) {
        StepOptions step = TwoStage(1.0 / 60);
        step.gravity = Vector3(0, 0, -9.81);
        const StepReport report = world.Step(step);
        ASSERT_TRUE(report.finite) << i;
        gain = std::max(gain, energy() - start);
      }
      EXPECT_LT(gain, 1e-3 * start);
      EXPECT_GT(body.center_W().z(), 0.95 * r);
      if (damping > 0) {
        EXPECT_LT(body.KineticEnergy(), 1e-6 * start);
      }
    }
}

// The spring is part of the state: saved, restored, hashed.
TEST(PointSpring, IsPartOfTheState) {
  Scene scene;
  scene.mechanisms.push_back(testing::Walker(BaseKind::kFloating, 60, 0.5));
  scene.free_bodies.push_back(testing::BoxBody("box", 2, Vector3(0.1, 0.2, 0.4), Vector3(3, 0, 0.5), 0.5));
  World world = MustCreate(scene), other = MustCreate(scene);
  MechanismDynamics& m = world.mechanisms()[0];
  WorldState state;
  world.Save(state);
  const std::uint64_t before = HashOf(state);
  PointSpring spring = PointSpringTo(Vector3(0.1, 0, 0), Vector3(0, 1, 2), 100, 1);
  spring.target_start_W = Vector3(0, 1, 1);
  m.SetPointSpring(BodyIndex(m.mechanism().num_bodies() - 1), spring);
  world.Save(state);
  EXPECT_NE(HashOf(state), before);
  const std::uint64_t with_one = HashOf(state);
  world.free_bodies()[0].SetPointSpring(spring);
  world.Save(state);
  EXPECT_NE(HashOf(state), with_one);
  other.Restore(state);
  for (int i = 0; i < 5; ++i) {
    EXPECT_TRUE(world.Step(TwoStage(1.0 / 60)).finite);
    EXPECT_TRUE(other.Step(TwoStage(1.0 / 60)).finite);
  }
  WorldState one, two;
  world.Save(one);
  other.Save(two);
  EXPECT_EQ(HashOf(one), HashOf(two));
  EXPECT_EQ(m.point_spring().target_start_W, spring.target_W);  // a target that moved rests
}

}  // namespace
}  // namespace fork1s
