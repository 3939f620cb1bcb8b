// Sensors while detail and state change: a ball between two fingers, with closed forms.
#include <fork1s/sim/sensors.hpp>

#include <cmath>

#include "sim/gripper.hpp"

namespace fork1s::testing_sensors {
namespace {

using testing::Gripper;
using testing::Squeeze;
using testing::Steps;

constexpr double kSqueeze = 0.01, kG = 9.81;
const Fidelity kObject{DetailLevel::kObject, -1, Recovery::kExact};
const Fidelity kInterface{DetailLevel::kInterface, -1, Recovery::kExact};
const Fidelity kAll{DetailLevel::kAll, -1, Recovery::kExact};

SensorDef Sensor(const std::string& name, SensorKind kind, int size, const SensorBody& body) {
  SensorDef s;
  s.name = name;
  s.kind = kind;
  s.size = size;
  s.frame.body = body;
  return s;
}

Simulation Holding(const Gripper& gripper, const SimulationOptions& options = {}) {
  Scene scene = gripper.Make();
  const SensorBody left{0, BodyIndex(1), -1}, ball{-1, {}, 0};
  scene.sensors = {Sensor("touch", SensorKind::kTouch, 1, left),
                   Sensor("force", SensorKind::kForce, 3, left),
                   Sensor("acceleration", SensorKind::kAcceleration, 3, ball),
                   Sensor("place", SensorKind::kPosition, 3, ball),
                   Sensor("speed", SensorKind::kVelocity, 3, ball),
                   Sensor("grip", SensorKind::kLength, 1, {}),
                   Sensor("motor", SensorKind::kActuatorForce, 1, {})};
  scene.sensors[0].volume = Sphere{1};
  scene.sensors[1].own_axes = scene.sensors[2].own_axes = true;
  scene.sensors[1].subtree = {left};
  const std::vector<std::pair<FreedomRef, double>> grip = {{FreedomRef{JointIndex(0), 0}, 1.0}};
  scene.sensors[5].mechanism = scene.sensors[6].mechanism = 0;
  scene.sensors[5].terms = grip;
  SensorActuator actuator;
  actuator.mechanism = 0;
  actuator.terms = grip;
  actuator.inputs = {{"left", gripper.k}};
  scene.sensors[6].actuators = {actuator};
  auto simulation = Simulation::Create(scene, options);
  if (!simulation) throw std::runtime_error(simulation.error().Text());
  Squeeze(*simulation, kSqueeze);
  Steps(*simulation, 240);
  return std::move(*simulation);
}

// The left finger presses with N = k times its set-point and carries itself and half of the ball.
void ExpectValuesOfAGrip(const Gripper& gripper, const Simulation& simulation) {
  const Sensors sensors(simulation);
  const double normal = gripper.k * kSqueeze;
  // Contact gives 10 µm, a thousandth of the spring's length.
  EXPECT_NEAR(sensors["touch"][0], normal, 0.002 * normal);
  EXPECT_NEAR(sensors["force"][0], normal, 0.002 * normal);
  EXPECT_NEAR(sensors["force"][2], (gripper.finger_mass + gripper.ball_mass / 2) * kG, 1e-3);
  EXPECT_NEAR(sensors["acceleration"][2], kG, 1e-3);
  EXPECT_EQ(sensors["motor"][0], gripper.k * kSqueeze);
  EXPECT_EQ(sensors["grip"][0], simulation.JointCoordinates(0)(0));
  const Vector3 place = simulation.Pose("ball").translation();
  for (int i = 0; i < 3; ++i) EXPECT_EQ(sensors["place"][static_cast<std::size_t>(i)], place(i));
}

TEST(Sensors, ThroughSetFidelity_MeasureTheSameGrip) {
  const Gripper gripper;
  Simulation simulation = Holding(gripper);
  ExpectValuesOfAGrip(gripper, simulation);
  Sensors sensors(simulation);
  for (const Fidelity& to : {kObject, kInterface, kAll, kObject, kAll}) {
    SCOPED_TRACE(static_cast<int>(to.level));
    sensors.Update(simulation);
    const VectorX before = sensors.values();
    const auto set = simulation.SetFidelity(to);
    ASSERT_TRUE(set) << set.error().Text();
    sensors.Update(simulation);
    // Means over a step have no value until the next one.
    for (const char* name : {"touch", "force", "acceleration"})
      for (const double value : sensors[name]) EXPECT_TRUE(std::isnan(value)) << name;
    EXPECT_EQ(sensors["motor"][0], gripper.k * kSqueeze);
    for (Eigen::Index k = 7; k < 10; ++k) EXPECT_NEAR(sensors.values()(k), before(k), 1e-12);
    // A changed model comes to rest again.
    Steps(simulation, 120);
    ExpectValuesOfAGrip(gripper, simulation);
  }
}

TEST(Sensors, AfterRestore_HaveTheValuesOfThen) {
  const Gripper gripper;
  for (const Fidelity& level : {kInterface, kObject}) {
    SCOPED_TRACE(static_cast<int>(level.level));
    Simulation simulation = Holding(gripper);
    ASSERT_TRUE(simulation.SetFidelity(level));
    Squeeze(simulation, 2 * kSqueeze);  // in motion
    for (int i = 0; i < 3; ++i) {
      simulation.ApplyWrench(simulation.FindBody("ball"), Vector3(0, 0.2, 0.3), Vector3::Zero(),
                             simulation.Pose("ball").translation());
      Steps(simulation, 1);
    }
    Sensors sensors(simulation);
    const VectorX then = sensors.values();
    ASSERT_TRUE(then.allFinite()) << then.transpose();
    const Simulation::Snapshot moment = simulation.Save();
    Steps(simulation, 5);
    sensors.Update(simulation);
    EXPECT_GT((sensors.values() - then).norm(), 1e-6);
    ASSERT_TRUE(simulation.Restore(moment));
    const auto expect_then = [&] {
      sensors.Update(simulation);
      if (level.level != DetailLevel::kObject) {
        EXPECT_EQ(sensors.values(), then);
        return;
      }
      // Forces of frozen contacts are not saved.
      EXPECT_TRUE(sensors.values().head(4).array().isNaN().all());
      EXPECT_EQ(sensors.values().tail(11), then.tail(11));
    };
    expect_then();
    // From another level of detail too.
    ASSERT_TRUE(simulation.SetFidelity(kAll));
    Steps(simulation, 5);
    ASSERT_TRUE(simulation.Restore(moment));
    expect_then();
  }
}

TEST(Sensors, WithEveryRecovery_MeasureTheSameGrip) {
  const Gripper gripper;
  for (const Recovery recovery :
       {Recovery::kExact, Recovery::kTwist, Recovery::kCurved, Recovery::kExpanded}) {
    SCOPED_TRACE(static_cast<int>(recovery));
    SimulationOptions options;
    options.recovery = recovery;
    Simulation simulation = Holding(gripper, options);
    ExpectValuesOfAGrip(gripper, simulation);
    // Positions and velocities belong together: the mean velocity of a step is that of its end and its start, up to
    // h² times the jerk.
    Squeeze(simulation, 2 * kSqueeze);
    Sensors sensors(simulation);
    for (int i = 0; i < 5; ++i) {
      simulation.ApplyWrench(simulation.FindBody("ball"), Vector3(0, 0.2, 0.3), Vector3::Zero(),
                             simulation.Pose("ball").translation());
      sensors.Update(simulation);
      const VectorX before = sensors.values();
      Steps(simulation, 1);
      sensors.Update(simulation);
      const Vector3 change_of_speed = (sensors.values() - before).segment<3>(10);
      // An accelerometer has no weight in it.
      const Vector3 acceleration = sensors.values().segment<3>(4);
      const Matrix3 R = simulation.Pose("ball").rotation();
      const Vector3 expected = change_of_speed / simulation.dt() + Vector3(0, 0, kG);
      EXPECT_NEAR((R * acceleration - expected).norm(), 0,
                  0.02 * expected.norm());  // axes half a step before
    }
  }
}

}  // namespace
}  // namespace fork1s::testing_sensors
