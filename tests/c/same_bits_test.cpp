// The C interface beside the C++ one, bit for bit; each is linked with a copy of the library of its own.
#include <fork1s/fork1s.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <fork1s/importer/importer.hpp>
#include <fork1s/sim/control_move.hpp>
#include <fork1s/sim/sensors.hpp>
#include <fork1s/sim/simulation.hpp>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "c/simulation.hpp"
#include "support.hpp"

namespace fork1s {
namespace {

using namespace testing;  // the simulations of support.hpp

void ExpectSame(const CSimulation& in_c, const Simulation& simulation) {
  EXPECT_EQ(Hash(in_c), simulation.HashState());
  const auto bodies = simulation.bodies().size();
  ASSERT_EQ(Count(in_c, fork1s_simulation_num_bodies), static_cast<int>(bodies));
  std::vector<double> poses(7 * bodies), velocities(6 * bodies);
  Check(fork1s_simulation_poses(in_c.get(), poses.data(), poses.size()));
  Check(fork1s_simulation_velocities(in_c.get(), velocities.data(), velocities.size()));
  for (std::size_t b = 0; b < bodies; ++b) {
    const RigidTransform X = simulation.Pose(static_cast<int>(b));
    const Vector6 V = simulation.Velocity(static_cast<int>(b));
    EXPECT_EQ(std::memcmp(&poses[7 * b], X.translation().data(), 3 * sizeof(double)), 0);
    EXPECT_EQ(std::memcmp(&velocities[6 * b], V.data(), 6 * sizeof(double)), 0);
    // Of the quaternion the rotation, by its definition: to rounding of products of numbers below 1.
    const double *q = &poses[7 * b + 3], w = q[0], x = q[1], y = q[2], z = q[3];
    Matrix3 R;
    R << 1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y), 2 * (x * y + w * z),
        1 - 2 * (x * x + z * z), 2 * (y * z - w * x), 2 * (x * z - w * y), 2 * (y * z + w * x),
        1 - 2 * (x * x + y * y);
    EXPECT_LT((R - X.rotation()).cwiseAbs().maxCoeff(), 1e-14);
    EXPECT_GE(w, 0);
    double one[7];
    Check(fork1s_simulation_pose(in_c.get(), static_cast<int>(b), one));
    EXPECT_EQ(std::memcmp(one, &poses[7 * b], sizeof one), 0);
  }
  double time = -1, kinetic = -1, potential = -1;
  Check(fork1s_simulation_time(in_c.get(), &time));
  Check(fork1s_simulation_energy(in_c.get(), &kinetic, &potential));
  EXPECT_EQ(time, simulation.time());
  EXPECT_EQ(kinetic, simulation.KineticEnergy());
  EXPECT_EQ(potential, simulation.PotentialEnergy());
}

TEST(CSimulation, GraspsAsTheCppOne) {
  const auto imported = LoadMechanism(ScenePath("fourbar_gripper.xml"));
  ASSERT_TRUE(imported);
  Simulation simulation = Create(*imported);
  const CSimulation in_c = CreateInC(LoadInC(ScenePath("fourbar_gripper.xml")));
  ExpectSame(in_c, simulation);
  for (const char* name : {"left_grip", "right_grip"}) {
    std::int32_t control = -1;
    Check(fork1s_simulation_find_control(in_c.get(), name, &control));
    Check(fork1s_simulation_set_control(in_c.get(), control, 0.4));
    simulation.SetControl(name, 0.4);
  }
  fork1s_report all{};
  Check(fork1s_simulation_step(in_c.get(), 60, FORK1S_HOLD, &all));
  StepReport last;
  int unconverged = 0, refreshes = 0, halved = 0;
  double penetration = 0, residual = 0, stage_residual = 0;
  for (int i = 0; i < 60; ++i) {
    last = simulation.Step();
    unconverged += last.IsSolved() ? 0 : 1;
    halved += last.halving != HalvingCause::kNone ? 1 : 0;
    refreshes += last.refreshes;
    penetration = std::max(penetration, last.max_penetration);
    residual = std::max(residual, last.solver.residual);
    stage_residual = std::max(stage_residual, last.stage_residual);
  }
  ExpectSame(in_c, simulation);
  EXPECT_EQ(all.steps, 60);
  EXPECT_EQ(all.finite, 1);
  EXPECT_GT(all.contacts, 0);
  EXPECT_EQ(all.contacts, last.contacts);
  EXPECT_EQ(all.limits, last.limits);
  EXPECT_EQ(all.forces_at_bound, last.forces_at_bound);
  EXPECT_EQ(all.unconverged, unconverged);
  EXPECT_EQ(all.halved, halved);
  EXPECT_EQ(all.refreshes, refreshes);
  EXPECT_EQ(all.max_penetration, penetration);
  EXPECT_EQ(all.residual, residual);
  EXPECT_EQ(all.stage_residual, stage_residual);
}

TEST(CSimulation, MovesControlsOverACall) {
  const auto imported = LoadMechanism(ScenePath("hand.xml"));
  ASSERT_TRUE(imported);
  SimulationOptions options;
  options.dt = 0.005;
  options.recovery = Recovery::kExpanded;
  Simulation simulation = Create(*imported, options);
  const CSimulation in_c =
      CreateInC(LoadInC(ScenePath("hand.xml")), R"({"dt": 0.005, "recovery": "expanded"})");
  const int count = Count(in_c, fork1s_simulation_num_controls);
  ASSERT_EQ(count, simulation.controls().size());
  VectorX values(count);
  for (int i = 0; i < count; ++i) {
    double lower = 0, upper = 0;
    Check(fork1s_simulation_control_range(in_c.get(), i, &lower, &upper));
    values(i) = std::isfinite(lower) ? lower + 0.3 * (upper - lower) : 0.01;
  }
  Check(fork1s_simulation_set_controls(in_c.get(), values.data(), static_cast<std::size_t>(count)));
  simulation.SetControls(values);
  Check(fork1s_simulation_step(in_c.get(), 20, FORK1S_MOVE, nullptr));
  ControlMove move(simulation, 20);
  for (int i = 0; i < 20; ++i) move.Step(simulation);
  ExpectSame(in_c, simulation);
  double dt = 0;
  Check(fork1s_simulation_dt(in_c.get(), &dt));
  EXPECT_EQ(dt, 0.005);
}

TEST(CSimulation, ControlRangesAreThoseThatValuesMoveInto) {
  for (const char* scene : {"hand.xml", "fourbar_gripper.xml", "hammer.xml", "vehicle.xml"}) {
    const CSimulation in_c = CreateInC(LoadInC(ScenePath(scene)));
    const int count = Count(in_c, fork1s_simulation_num_controls);
    for (const double far : {-1e9, 1e9}) {
      std::vector<double> values(static_cast<std::size_t>(count), far), read(values.size());
      Check(fork1s_simulation_set_controls(in_c.get(), values.data(), values.size()));
      Check(fork1s_simulation_controls(in_c.get(), read.data(), read.size()));
      for (int i = 0; i < count; ++i) {
        double lower = 0, upper = 0;
        Check(fork1s_simulation_control_range(in_c.get(), i, &lower, &upper));
        EXPECT_EQ(read[static_cast<std::size_t>(i)], far < 0 ? std::max(lower, far) : std::min(upper, far));
      }
    }
  }
}

TEST(CSimulation, PushActsThroughTheNextCallAtAPointOfTheBody) {
  const auto imported = LoadMechanism(ScenePath("two_link_arm.xml"));
  ASSERT_TRUE(imported);
  Simulation simulation = Create(*imported);
  const CSimulation in_c = CreateInC(LoadInC(ScenePath("two_link_arm.xml")));
  std::int32_t body = -1;
  Check(fork1s_simulation_find_body(in_c.get(), "forearm", &body));
  const double force[3] = {0, 5, 0}, torque[3] = {0, 0, 0.5}, point[3] = {1, 1, 0.5};
  Check(fork1s_simulation_push(in_c.get(), body, force, torque, point));
  Check(fork1s_simulation_push(in_c.get(), body, force, nullptr, nullptr));
  Check(fork1s_simulation_step(in_c.get(), 10, FORK1S_HOLD, nullptr));
  Check(fork1s_simulation_step(in_c.get(), 10, FORK1S_HOLD, nullptr));
  const Vector3 point_B = simulation.Pose(body).inverse() * Vector3(1, 1, 0.5);
  for (int i = 0; i < 20; ++i) {
    if (i < 10) {
      simulation.ApplyWrench(body, {0, 5, 0}, {0, 0, 0.5}, simulation.Pose(body) * point_B);
      simulation.ApplyWrench(body, {0, 5, 0}, Vector3::Zero(), simulation.Pose(body) * Vector3::Zero());
    }
    simulation.Step();
  }
  ExpectSame(in_c, simulation);
}

TEST(CSimulation, TipGivesWayAsItsClosedFormSays) {
  // docs/validation.md: K = [[100, 100], [100, 200]] N/m at the tip. 0.1 N bends the arm by 1e-3 rad, whose
  // square is what the linear answer leaves out.
  const CSimulation in_c = CreateInC(LoadInC(ScenePath("two_link_arm.xml")));
  std::int32_t body = -1;
  Check(fork1s_simulation_find_body(in_c.get(), "forearm", &body));
  double start[7], end[7];
  Check(fork1s_simulation_pose(in_c.get(), body, start));
  const auto tip = [](const double* pose) {  // 1 m along x of the forearm
    const double *p = pose, *q = pose + 3;
    return Vector3(p[0] + 1 - 2 * (q[2] * q[2] + q[3] * q[3]), p[1] + 2 * (q[1] * q[2] + q[0] * q[3]),
                   p[2] + 2 * (q[1] * q[3] - q[0] * q[2]));
  };
  const double force[3] = {0.1, 0.05, 0};
  for (int i = 0; i < 3600; ++i) {  // a minute: dampers of 0.01 s times the springs take e^-17 of 7.57 rad/s
    Check(fork1s_simulation_pose(in_c.get(), body, end));
    const Vector3 at = tip(end);
    const double point[3] = {at.x(), at.y(), at.z()};
    Check(fork1s_simulation_push(in_c.get(), body, force, nullptr, point));
    Check(fork1s_simulation_step(in_c.get(), 1, FORK1S_HOLD, nullptr));
  }
  Check(fork1s_simulation_pose(in_c.get(), body, end));
  const Vector3 moved = tip(end) - tip(start);
  // K^-1 f = [[2, -1], [-1, 1]] f / 100
  EXPECT_NEAR(moved.x(), (2 * 0.1 - 0.05) / 100, 5e-6);
  EXPECT_NEAR(moved.y(), (-0.1 + 0.05) / 100, 5e-6);
}

std::vector<double> Numbers(const VectorX& v) { return {v.data(), v.data() + v.size()}; }

TEST(CSimulation, JointStateIsThatOfTheFile) {
  const auto imported = LoadMechanism(ScenePath("quadruped.xml"));
  ASSERT_TRUE(imported);
  Simulation simulation = Create(*imported);
  const CSimulation in_c = CreateInC(LoadInC(ScenePath("quadruped.xml")));
  Check(fork1s_simulation_step(in_c.get(), 20, FORK1S_HOLD, nullptr));
  for (int i = 0; i < 20; ++i) simulation.Step();
  const std::vector<FileJoint> joints = MovingJoints(imported->joints, imported->scene);
  const FileState state = ComputeFileState(joints, imported->scene, simulation.State());
  ASSERT_EQ(Count(in_c, fork1s_simulation_num_joint_positions), 7 + 12);
  ASSERT_EQ(Count(in_c, fork1s_simulation_num_joint_velocities), 6 + 12);
  std::vector<double> q = Read(in_c, 19, fork1s_simulation_joint_positions);
  std::vector<double> v = Read(in_c, 18, fork1s_simulation_joint_velocities);
  EXPECT_EQ(q, Numbers(state.positions));
  EXPECT_EQ(v, Numbers(state.velocities));
  // The free joint is the pose of the trunk.
  const RigidTransform X_WB = simulation.Pose("trunk");
  EXPECT_EQ(std::memcmp(q.data(), X_WB.translation().data(), 3 * sizeof(double)), 0);

  std::int32_t knee = -1;
  Check(fork1s_simulation_find_joint(in_c.get(), "front_left_knee", &knee));
  fork1s_joint joint{};
  Check(fork1s_simulation_joint(in_c.get(), knee, &joint));
  EXPECT_STREQ(joint.name, "front_left_knee");
  EXPECT_EQ(joint.kind, FORK1S_JOINT_HINGE);
  EXPECT_EQ(joint.num_positions, 1);
  EXPECT_EQ(joint.first_position,
            joint.first_velocity + 1);  // the free joint has one position more than velocities
  const auto at = static_cast<std::size_t>(joint.first_position);
  q[at] += 0.1;
  q[2] += 0.2;
  v[static_cast<std::size_t>(joint.first_velocity)] = 0.5;
  Check(fork1s_simulation_set_joint_state(in_c.get(), q.data(), q.size(), v.data(), v.size()));
  // Numbers to rounding of products of rotations.
  for (std::size_t i = 0; i < q.size(); ++i)
    EXPECT_NEAR(Read(in_c, 19, fork1s_simulation_joint_positions)[i], q[i], 1e-14);
  for (std::size_t i = 0; i < v.size(); ++i)
    EXPECT_NEAR(Read(in_c, 18, fork1s_simulation_joint_velocities)[i], v[i], 1e-13);
  double change = -1, time = -1;
  Check(fork1s_simulation_state_change(in_c.get(), &change));
  EXPECT_LT(change, 1e-15);  // no loops
  Check(fork1s_simulation_time(in_c.get(), &time));
  EXPECT_EQ(time, 20 * simulation.dt());
  // The shank turns by 0.1 rad about the axis of the knee relative to the thigh.
  std::int32_t thigh = -1, shank = -1;
  Check(fork1s_simulation_find_body(in_c.get(), "front_left_thigh", &thigh));
  Check(fork1s_simulation_find_body(in_c.get(), "front_left_shank", &shank));
  const auto relative = [&](const Simulation& s) -> Matrix3 {
    return s.Pose("front_left_thigh").rotation().transpose() * s.Pose("front_left_shank").rotation();
  };
  const auto rotation_in_c = [&](std::int32_t body) -> Matrix3 {
    double pose[7];
    Check(fork1s_simulation_pose(in_c.get(), body, pose));
    return Quaternion(pose[3], pose[4], pose[5], pose[6]).toRotationMatrix();
  };
  const Matrix3 turned = rotation_in_c(thigh).transpose() * rotation_in_c(shank);
  EXPECT_NEAR(std::acos((relative(simulation).transpose() * turned).trace() / 2 - 0.5), 0.1, 1e-9);

  const std::uint64_t hash = Hash(in_c);
  q[3] = NAN;
  EXPECT_EQ(fork1s_simulation_set_joint_state(in_c.get(), q.data(), q.size(), nullptr, 0),
            FORK1S_ERROR_USAGE);
  q[3] = q[4] = q[5] = q[6] = 0;
  EXPECT_EQ(fork1s_simulation_set_joint_state(in_c.get(), q.data(), q.size(), nullptr, 0),
            FORK1S_ERROR_USAGE);
  EXPECT_EQ(fork1s_simulation_set_joint_state(in_c.get(), nullptr, 0, v.data(), 17), FORK1S_ERROR_USAGE);
  EXPECT_EQ(Hash(in_c), hash);
  Check(fork1s_simulation_set_joint_state(in_c.get(), nullptr, 0, nullptr, 0));
}

TEST(CSimulation, LoopsCloseWhereAStateLeavesThemOpen) {
  const CSimulation in_c = CreateInC(LoadInC(ScenePath("fourbar_gripper.xml")));
  const auto count = static_cast<std::size_t>(Count(in_c, fork1s_simulation_num_joint_positions));
  std::vector<double> q = Read(in_c, count, fork1s_simulation_joint_positions);
  std::int32_t index = -1;
  fork1s_joint joint{};
  Check(fork1s_simulation_find_joint(in_c.get(), "left_crank", &index));
  Check(fork1s_simulation_joint(in_c.get(), index, &joint));
  const double wanted = q[static_cast<std::size_t>(joint.first_position)] += 0.1;
  Check(fork1s_simulation_set_joint_state(in_c.get(), q.data(), q.size(), nullptr, 0));
  double change = 0;
  Check(fork1s_simulation_state_change(in_c.get(), &change));
  const double became =
      Read(in_c, count, fork1s_simulation_joint_positions)[static_cast<std::size_t>(joint.first_position)];
  EXPECT_GT(change, 0.01);
  EXPECT_GE(change, std::abs(became - wanted) - 1e-15);
}

TEST(CSimulation, SensorsAreThoseOfCpp) {
  const char* text =
      R"(<mujoco><worldbody><body name="bob" pos="0 0 1"><joint name="hinge" axis="0 1 0" stiffness="2"/>
    <geom type="sphere" size="0.1" pos="0.5 0 0" mass="1"/><site name="s" pos="0.5 0 0"/></body></worldbody>
    <sensor><clock name="time"/><jointpos name="angle" joint="hinge"/><accelerometer name="acceleration" site="s"/>
    <framequat name="turn" objtype="site" objname="s"/></sensor></mujoco>)";
  const auto imported = LoadMechanismFromString(text, "bob");
  ASSERT_TRUE(imported) << imported.error().Text();
  Simulation simulation = Create(*imported);
  fork1s_model* model = nullptr;
  Check(fork1s_model_load_text(text, "bob", nullptr, &model));
  const CSimulation in_c = CreateInC(CModel(model));
  ASSERT_EQ(Count(in_c, fork1s_simulation_num_sensors), 4);
  ASSERT_EQ(Count(in_c, fork1s_simulation_num_sensor_values), 9);
  EXPECT_TRUE(std::isnan(Read(in_c, 9, fork1s_simulation_sensor_values)[2]));  // before the first step
  Check(fork1s_simulation_step(in_c.get(), 7, FORK1S_HOLD, nullptr));
  for (int i = 0; i < 7; ++i) simulation.Step();
  EXPECT_EQ(Read(in_c, 9, fork1s_simulation_sensor_values), Numbers(Sensors(simulation).values()));
  std::int32_t index = -1;
  fork1s_sensor sensor{};
  Check(fork1s_simulation_find_sensor(in_c.get(), "turn", &index));
  Check(fork1s_simulation_sensor(in_c.get(), index, &sensor));
  EXPECT_STREQ(sensor.name, "turn");
  EXPECT_STREQ(sensor.missing, "");
  EXPECT_EQ(sensor.first_value, 5);
  EXPECT_EQ(sensor.num_values, 4);
  // The clock counts on where a state was set.
  const double q = 0.3;
  Check(fork1s_simulation_set_joint_state(in_c.get(), &q, 1, nullptr, 0));
  EXPECT_EQ(Read(in_c, 9, fork1s_simulation_sensor_values)[0], 7 * simulation.dt());
  EXPECT_NEAR(Read(in_c, 9, fork1s_simulation_sensor_values)[1], 0.3, 1e-15);
}

struct FreeSnapshot {
  void operator()(fork1s_snapshot* s) const { fork1s_snapshot_free(s); }
};

TEST(CSimulation, SnapshotsComeBackBitByBit) {
  const CModel model = LoadInC(ScenePath("fourbar_gripper.xml"));
  const CSimulation in_c = CreateInC(model);
  const std::uint64_t start = Hash(in_c);
  const double grip[2] = {0.4, 0.4}, force[3] = {0, 0, 1};
  Check(fork1s_simulation_set_controls(in_c.get(), grip, 2));
  Check(fork1s_simulation_step(in_c.get(), 30, FORK1S_HOLD, nullptr));
  Check(fork1s_simulation_push(in_c.get(), 0, force, nullptr, nullptr));
  fork1s_snapshot* saved = nullptr;
  Check(fork1s_simulation_save(in_c.get(), &saved));
  const std::unique_ptr<fork1s_snapshot, FreeSnapshot> snapshot(saved);
  const std::uint64_t hash = Hash(in_c);
  Check(fork1s_simulation_step(in_c.get(), 30, FORK1S_HOLD, nullptr));
  const std::uint64_t end = Hash(in_c);
  double time = 0;
  const auto count = static_cast<std::size_t>(Count(in_c, fork1s_simulation_num_joint_velocities));
  const std::vector<double> rest(count, 0);
  // Also after a state was set, and into another simulation.
  Check(fork1s_simulation_set_joint_state(in_c.get(), nullptr, 0, rest.data(), rest.size()));
  const CSimulation other = CreateInC(model);
  for (const CSimulation* simulation : {&in_c, &other}) {
    Check(fork1s_simulation_restore(simulation->get(), snapshot.get()));
    EXPECT_EQ(Hash(*simulation), hash);
    Check(fork1s_simulation_time(simulation->get(), &time));
    EXPECT_DOUBLE_EQ(time, 0.5);
    Check(fork1s_simulation_step(simulation->get(), 30, FORK1S_HOLD, nullptr));
    EXPECT_EQ(Hash(*simulation), end);
    Check(fork1s_simulation_reset(simulation->get()));
    EXPECT_EQ(Hash(*simulation), start);
    Check(fork1s_simulation_time(simulation->get(), &time));
    EXPECT_EQ(time, 0);
  }
  const CSimulation finer = CreateInC(model, R"({"dt": 0.001})");
  EXPECT_EQ(fork1s_simulation_restore(finer.get(), snapshot.get()), FORK1S_ERROR_USAGE);
  EXPECT_NE(
      std::string(fork1s_last_error()).find("of another dt, 0.0166667 s, than this simulation, 0.001 s"),
      std::string::npos);
  const CSimulation foreign = CreateInC(LoadInC(ScenePath("fourbar_gripper.xml")));
  EXPECT_EQ(fork1s_simulation_restore(foreign.get(), snapshot.get()), FORK1S_ERROR_USAGE);
  EXPECT_NE(std::string(fork1s_last_error()).find("of another model"), std::string::npos);
}

TEST(CSimulation, StepThatIsUndoneIsAnError) {
  const CSimulation in_c = CreateInC(LoadInC(ScenePath("two_link_arm.xml")));
  Check(fork1s_simulation_step(in_c.get(), 2, FORK1S_HOLD, nullptr));
  const std::uint64_t hash = Hash(in_c);
  const double force[3] = {0, 1e300, 0};
  std::int32_t forearm = -1;
  Check(fork1s_simulation_find_body(in_c.get(), "forearm", &forearm));
  Check(fork1s_simulation_push(in_c.get(), forearm, force, nullptr, nullptr));
  fork1s_report report{};
  EXPECT_EQ(fork1s_simulation_step(in_c.get(), 5, FORK1S_HOLD, &report), FORK1S_ERROR_NUMERICS);
  EXPECT_EQ(report.finite, 0);
  EXPECT_EQ(report.steps, 0);
  EXPECT_NE(std::string(fork1s_last_error()).find("step 1: could not be solved"), std::string::npos);
  EXPECT_EQ(Hash(in_c), hash);
  EXPECT_EQ(fork1s_simulation_step(in_c.get(), 5, FORK1S_HOLD, &report), FORK1S_OK);
}

TEST(CSimulation, TwoThreadsStepTwoSimulationsOfAModel) {
  const CModel model = LoadInC(ScenePath("fourbar_gripper.xml"));
  const CSimulation alone = CreateInC(model);
  const auto grasp = [](fork1s_simulation* s) {
    const double values[2] = {0.4, 0.4};
    ASSERT_EQ(fork1s_simulation_set_controls(s, values, 2), FORK1S_OK);
    for (int i = 0; i < 30; ++i) ASSERT_EQ(fork1s_simulation_step(s, 2, FORK1S_HOLD, nullptr), FORK1S_OK);
  };
  grasp(alone.get());
  CSimulation both[2];
  std::string messages[2];
  std::vector<std::thread> threads;
  for (int t = 0; t < 2; ++t)
    threads.emplace_back([&, t] {
      both[t] = CreateInC(model);
      grasp(both[t].get());
      EXPECT_EQ(fork1s_simulation_set_control(both[t].get(), 10 + t, 0), FORK1S_ERROR_USAGE);
      messages[t] = fork1s_last_error();
    });
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(Hash(both[0]), Hash(alone));
  EXPECT_EQ(Hash(both[1]), Hash(alone));
  EXPECT_EQ(messages[0], "fork1s_simulation_set_control: control 10 of 2; indices count from 0");
  EXPECT_EQ(messages[1], "fork1s_simulation_set_control: control 11 of 2; indices count from 0");
}

TEST(CSimulation, CallWhileAnotherThreadIsInItIsRefused) {
  const CSimulation in_c = CreateInC(LoadInC(ScenePath("two_link_arm.xml")));
  in_c->in_use = true;
  double time = 0;
  EXPECT_EQ(fork1s_simulation_time(in_c.get(), &time), FORK1S_ERROR_USAGE);
  EXPECT_NE(std::string(fork1s_last_error()).find("another thread uses this simulation"), std::string::npos);
  EXPECT_EQ(fork1s_simulation_step(in_c.get(), 1, FORK1S_HOLD, nullptr), FORK1S_ERROR_USAGE);
  in_c->in_use = false;
  EXPECT_EQ(fork1s_simulation_step(in_c.get(), 1, FORK1S_HOLD, nullptr), FORK1S_OK);
}

TEST(CModel, ErrorsOfFilesAreThoseOfTheImporter) {
  for (const std::string& path : {ScenePath("none.xml"), ScenePath("grasp_box.csv"), ScenePath("")}) {
    const auto imported = LoadMechanism(path);
    ASSERT_FALSE(imported);
    fork1s_model* model = nullptr;
    EXPECT_NE(fork1s_model_load(path.c_str(), nullptr, &model), FORK1S_OK);
    EXPECT_EQ(model, nullptr);
    EXPECT_EQ(fork1s_last_error(), "fork1s_model_load: " + imported.error().Text());
  }
}

TEST(CModel, OptionsAreThoseOfTheImporter) {
  ImportOptions options;
  options.base = BaseKind::kDriven;
  options.modes = 2;
  options.mode_choice = ModeChoice::kContribution;
  options.stiffness_scale = 2;
  options.pd = PdGains{5, 0.1};
  options.base_pose = RigidTransform(Quaternion(1, 2, -1, 0.5).normalized(), Vector3(0.1, 0.2, 0.3));
  options.interfaces = {"hand"};
  options.switched = {"grip"};
  options.joint_pd = {{"elbow", {3, 0.2}}};
  options.joint_coordinates = {{"elbow", 1.1}};  // outside its limits
  options.keep_start = true;
  options.hold = true;
  options.ground = true;
  options.ground_height = -2;
  const char* text =
      R"(<mujoco><worldbody><body name="mount"><geom size="0.1"/><body name="arm" pos="0.2 0 0">
    <joint name="shoulder" axis="0 0 1"/><geom type="capsule" size="0.02" fromto="0 0 0 0.3 0 0"/>
    <body name="hand" pos="0.3 0 0"><joint name="elbow" axis="0 1 0" range="-1 1" limited="true" stiffness="4"/>
    <geom type="capsule" size="0.02" fromto="0 0 0 0.3 0 0"/></body></body>
    <body name="tool" pos="0 0 0.3"><joint name="rail" type="slide" axis="0 0 1" damping="1"/><geom size="0.02"/></body></body></worldbody>
    <equality><weld name="grip" body1="arm" body2="tool"/></equality>
    <compiler angle="radian"/><actuator><position name="servo" joint="elbow" kp="3"/></actuator></mujoco>)";
  const auto imported = LoadMechanismFromString(text, "arm", options);
  ASSERT_TRUE(imported) << imported.error().Text();
  Simulation simulation = Create(*imported);
  fork1s_model* model = nullptr;
  Check(fork1s_model_load_text(text, "arm", R"({
    "interface": ["hand"], "switched": ["grip"], "base": "driven", "modes": 2, "mode_choice": "contribution", "stiffness_scale": 2,
    "pd": [5, 0.1], "joint_pd": {"elbow": [3, 0.2]}, "q": {"elbow": 1.1}, "keep_start": true, "hold": true, "ground": -2,
    "base_pose": [0.1, 0.2, 0.3, 1, 2, -1, 0.5]})",
                               &model));
  const CSimulation in_c = CreateInC(CModel(model));
  EXPECT_EQ(simulation.HashState(), Hash(in_c));
  simulation.Step();
  Check(fork1s_simulation_step(in_c.get(), 1, FORK1S_HOLD, nullptr));
  ExpectSame(in_c, simulation);
  EXPECT_EQ(Count(in_c, fork1s_simulation_num_controls), simulation.controls().size());
}

// A load on a hook: switched on where the file has it off, and let go.
TEST(CSimulation, SwitchesEqualitiesAsTheCppOne) {
  const char* text =
      R"(<mujoco><worldbody><body name="mast" pos="0 0 2"><joint name="swing" axis="0 1 0" stiffness="4000" damping="200"/>
    <geom type="capsule" fromto="0 0 0 1 0 0" size="0.03" mass="5" contype="0" conaffinity="0"/></body>
    <body name="crate" pos="1 0 1.5"><freejoint/><geom type="box" size="0.1 0.1 0.1" mass="3"/></body></worldbody>
    <equality><weld name="hook" body1="mast" body2="crate" active="false"/></equality></mujoco>)";
  const auto imported = LoadMechanismFromString(text, "crane", {});
  ASSERT_TRUE(imported) << imported.error().Text();
  Simulation simulation = Create(*imported);
  fork1s_model* model = nullptr;
  Check(fork1s_model_load_text(text, "crane", nullptr, &model));
  const CSimulation in_c = CreateInC(CModel(model));
  std::int32_t hook = -1;
  Check(fork1s_simulation_find_control(in_c.get(), "hook", &hook));
  const int crate = simulation.FindBody("crate");
  double fallen = 0;
  for (const double value : {1.0, 0.0, 1.0}) {
    Check(fork1s_simulation_set_control(in_c.get(), hook, value));
    simulation.SetControl("hook", value);
    const double before = simulation.Pose(crate).translation().z();
    Check(fork1s_simulation_step(in_c.get(), 30, FORK1S_HOLD, nullptr));
    for (int k = 0; k < 30; ++k) simulation.Step();
    ExpectSame(in_c, simulation);
    if (value == 0) fallen = before - simulation.Pose(crate).translation().z();
  }
  EXPECT_GT(fallen, 1.0);  // g t²/2 of half a second is 1.2 m: it was let go
}

}  // namespace
}  // namespace fork1s
