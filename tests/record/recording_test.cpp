#include <sys/wait.h>
#include <csignal>
#include <fork1s/stepping/mechanism_dynamics.hpp>

#include "support.hpp"

namespace fork1s::testing {
namespace {

struct Kept {
  std::vector<std::uint64_t> hashes;
  std::vector<std::vector<RigidTransform>> poses;
  std::vector<VectorX> controls;
  std::vector<StepReport> reports;
  std::vector<std::vector<VectorX>> z, w;
  std::vector<Vector3> force_on_box;  // by the world's contacts
  std::vector<double> energy;
};

// Records the touching scene and keeps what the file should hold.
Kept RecordTouching(const std::string& path, int steps, const SimulationOptions& options = {}) {
  Kept run;
  Simulation simulation = CreateOrThrow(TouchingScene(), options);
  auto recorder = Recorder::Create(path, simulation, {.flush_interval = 1e9, .flush_steps = 17});
  if (!recorder) throw std::runtime_error(recorder.error().Text());
  for (int i = 0; i < steps; ++i) {
    const auto wrenches = SetInputs(i, simulation);
    ApplyWrenches(wrenches, simulation);
    const StepReport report = simulation.Step();
    auto ok = recorder->Append(simulation, report, wrenches);
    EXPECT_TRUE(ok);
    run.hashes.push_back(simulation.HashState());
    run.controls.push_back(simulation.controls());
    run.reports.push_back(report);
    run.energy.push_back(simulation.Energy());
    std::vector<RigidTransform> poses;
    for (std::size_t b = 0; b < simulation.bodies().size(); ++b)
      poses.push_back(simulation.Pose(static_cast<int>(b)));
    run.poses.push_back(poses);
    std::vector<VectorX> z, w;
    for (const MechanismDynamics& m : simulation.world().mechanisms()) {
      z.push_back(m.state().z);
      w.push_back(m.state().w);
    }
    run.z.push_back(z);
    run.w.push_back(w);
  }
  auto ok = recorder->Finish();
  EXPECT_TRUE(ok);
  return run;
}

// Steps of two stages read the rates of driven bases.
TEST(Recording, ReplaysRatesOfDrivenBases) {
  Folder folder;
  SimulationOptions options;
  options.step.integrator = Integrator::kTwoStage;
  RecordTouching(folder / "run.h5", 60, options);
  auto recording = Recording::Open(folder / "run.h5");
  ASSERT_TRUE(recording) << recording.error().Text();
  EXPECT_TRUE(std::isnan(recording->BaseRates(3)(2)));
  EXPECT_FALSE(std::isnan(recording->BaseRates(4)(2)));
  auto replayed = Replay(*recording);
  ASSERT_TRUE(replayed) << replayed.error().Text();
  EXPECT_TRUE(replayed->identical) << replayed->first_difference_step;
}

// Whether controls move is an input of each step; those set before the recording begins are inputs too.
TEST(Recording, ReplaysMovingControls) {
  Folder folder;
  for (const Integrator integrator : {Integrator::kEuler, Integrator::kTwoStage}) {
    for (const bool jumps : {false, true}) {
      SimulationOptions options;
      options.step.integrator = integrator;
      Simulation simulation = CreateOrThrow(TouchingScene(), options);
      simulation.SetControl("pusher_pull", 0.3);
      if (jumps) simulation.StartFromControls();
      simulation.SetControl("hand_base.z", -1e-3);
      {
        auto recorder = Recorder::Create(folder / "run.h5", simulation);
        ASSERT_TRUE(recorder) << recorder.error().Text();
        for (int i = 0; i < 40; ++i) {
          const bool move = i % 4 != 2;
          const StepReport report = simulation.Step(move);
          EXPECT_EQ(simulation.last_step().controls_moved, move);
          ASSERT_TRUE(recorder->Append(simulation, report));
          SetInputs(3, simulation);
        }
      }
      auto recording = Recording::Open(folder / "run.h5");
      ASSERT_TRUE(recording) << recording.error().Text();
      auto replayed = Replay(*recording);
      ASSERT_TRUE(replayed) << replayed.error().Text();
      EXPECT_TRUE(replayed->identical)
          << Name(integrator) << ' ' << jumps << " step " << replayed->first_difference_step;
    }
  }
}

TEST(Recording, HoldsWhatHappened) {
  Folder folder;
  constexpr int kSteps = 120;
  const Kept run = RecordTouching(folder / "run.h5", kSteps);
  auto recording = Recording::Open(folder / "run.h5");
  ASSERT_TRUE(recording) << recording.error().Text();
  EXPECT_TRUE(recording->header().finished);
  EXPECT_EQ(recording->header().program.rfind("fork1s ", 0), 0u);
  ASSERT_EQ(recording->num_steps(), kSteps);
  EXPECT_EQ(recording->data().hash, run.hashes);
  EXPECT_DOUBLE_EQ(recording->header().options.dt, 0.005);
  EXPECT_EQ(recording->header().coordinate_names.size(), 4u + 5u + 2u);

  int touching = 0, pushes = 0;
  for (int i = 0; i < kSteps; ++i) {
    const auto at = static_cast<std::size_t>(i);
    EXPECT_DOUBLE_EQ(recording->data().time[at], 0.005 * (i + 1));
    EXPECT_EQ(recording->Controls(i), run.controls[at]);
    EXPECT_EQ(recording->data().kinetic_energy[at] + recording->data().potential_energy[at], run.energy[at]);
    for (std::size_t b = 0; b < recording->bodies().size(); ++b) {
      const RigidTransform X = recording->Pose(i, static_cast<int>(b));
      EXPECT_EQ(X.translation(), run.poses[at][b].translation());
      // A quaternion holds a rotation to rounding.
      EXPECT_LT((X.rotation() - run.poses[at][b].rotation()).cwiseAbs().maxCoeff(), 4e-15);
    }
    for (int m = 0; m < 3; ++m) {
      EXPECT_EQ(recording->ReducedCoordinates(i, m), run.z[at][static_cast<std::size_t>(m)]);
      EXPECT_EQ(recording->ReducedRates(i, m), run.w[at][static_cast<std::size_t>(m)]);
    }
    const StepReport report = recording->Report(i);
    EXPECT_EQ(report.contacts, run.reports[at].contacts);
    EXPECT_EQ(report.solver.residual, run.reports[at].solver.residual);
    EXPECT_EQ(report.refreshes, run.reports[at].refreshes);
    const auto contacts = recording->Contacts(i);
    EXPECT_EQ(static_cast<int>(contacts.size()), report.contacts);
    for (const RecordedContact& c : contacts) {
      EXPECT_NEAR(c.normal.norm(), 1, 1e-9);
      const double normal = c.force.dot(c.normal);
      EXPECT_GT(normal, 0);
      EXPECT_LE((c.force - normal * c.normal).norm(), c.friction * normal * (1 + 1e-3) + 1e-9);
    }
    touching += contacts.empty() ? 0 : 1;
    pushes += static_cast<int>(recording->Wrenches(i).size());
  }
  EXPECT_GT(touching, kSteps / 2);
  EXPECT_EQ(pushes, 2 * 17);
  EXPECT_EQ(recording->Wrenches(3)[0].force_W, Vector3(0.3, 0.2, 0));
}

TEST(Recording, ForcesCarryTheWeight) {
  // A box at rest: the contacts with the ground carry m g.
  Folder folder;
  Scene scene = TouchingScene();
  scene.mechanisms.clear();
  Simulation simulation = CreateOrThrow(scene);
  auto recorder = Recorder::Create(folder / "run.h5", simulation);
  ASSERT_TRUE(recorder);
  for (int i = 0; i < 200; ++i) ASSERT_TRUE(recorder->Append(simulation, simulation.Step()));
  ASSERT_TRUE(recorder->Finish());
  const auto recording = Recording::Open(folder / "run.h5");
  ASSERT_TRUE(recording) << recording.error().Text();
  Vector3 force = Vector3::Zero();
  for (const RecordedContact& c : recording->Contacts(199)) {
    EXPECT_EQ(std::min(c.body_a, c.body_b), -1);
    EXPECT_EQ(std::max(c.body_a, c.body_b), 0);
    force += c.body_b == 0 ? c.force : Vector3(-c.force);
  }
  // The solver's own tolerance is 1e-4.
  EXPECT_NEAR(force.z(), 0.4 * 9.81, 1e-3 * 0.4 * 9.81);
  EXPECT_EQ(recording->data().controls.size(), 0u);
}

TEST(Replay, IsIdenticalToTheBit) {
  Folder folder;
  // No refresh where the model has every motion, but for what is drawn by twists.
  for (const auto& [recovery, integrator, refreshed] :
       {std::tuple(Recovery::kExact, Integrator::kEuler, false),
        std::tuple(Recovery::kExact, Integrator::kTwoStage, false),
        std::tuple(Recovery::kTwist, Integrator::kEuler, true)}) {
    SimulationOptions options;
    options.recovery = recovery;
    options.step.integrator = integrator;
    options.dt = 0.004;
    options.refresh_angle = 0.1;
    const Kept run = RecordTouching(folder / "run.h5", 150, options);
    const auto recording = Recording::Open(folder / "run.h5");
    ASSERT_TRUE(recording) << recording.error().Text();
    int refreshes = 0;
    for (int n : recording->data().refreshes) refreshes += n;
    EXPECT_EQ(refreshes > 0, refreshed);
    const auto result = Replay(*recording);
    ASSERT_TRUE(result) << result.error().Text();
    EXPECT_TRUE(result->identical);
    EXPECT_EQ(result->steps, 150);
    EXPECT_EQ(result->first_difference_step, -1);
    EXPECT_EQ(result->final_hash, run.hashes.back());
  }
}

TEST(Replay, FindsTheStepThatDiffers) {
  Folder folder;
  Simulation simulation = CreateOrThrow(TouchingScene());
  auto recorder = Recorder::Create(folder / "run.h5", simulation);
  ASSERT_TRUE(recorder);
  Record(simulation, *recorder, 20);
  simulation.step_options().gravity.x() = 0.5;  // not an input of a step, so the replay cannot know
  Record(simulation, *recorder, 5);
  ASSERT_TRUE(recorder->Finish());
  const auto result = Replay(*Recording::Open(folder / "run.h5"));
  ASSERT_TRUE(result);
  EXPECT_FALSE(result->identical);
  EXPECT_EQ(result->first_difference_step, 21);
}

TEST(Replay, StartsAtAKeyframe) {
  Folder folder;
  Scene scene = TouchingScene();
  KeyframeDef key;
  key.name = "bent";
  for (const MechanismDef& m : scene.mechanisms) {
    KeyframeDef::MechanismState s;
    s.q = VectorX::Constant(static_cast<Eigen::Index>(m.joints.size()), 0.1);
    s.q_dot = VectorX::Constant(s.q.size(), 0.3);
    s.X_WR = m.X_WR;
    key.mechanisms.push_back(s);
  }
  key.mechanisms[0].controls = VectorX::Constant(1, 0.9);  // beyond the control's limit: kept until it is set
  key.free_bodies.push_back({RigidTransform(Vector3(0, 0, 0.12)), Vector3(0, 0, 1), Vector3::Zero()});
  scene.keyframes = {key};
  SimulationOptions options;
  options.initial_keyframe = 0;
  Simulation simulation = CreateOrThrow(scene, options);
  auto recorder = Recorder::Create(folder / "run.h5", simulation);
  ASSERT_TRUE(recorder);
  Record(simulation, *recorder, 30);
  ASSERT_TRUE(recorder->Finish());
  const auto recording = Recording::Open(folder / "run.h5");
  ASSERT_TRUE(recording);
  EXPECT_EQ(
      recording
          ->Pose(-1, recording->header().bodies.size() ? static_cast<int>(recording->bodies().size()) - 1 : 0)
          .translation(),
      Vector3(0, 0, 0.12));
  const auto result = Replay(*recording);
  ASSERT_TRUE(result) << result.error().Text();
  EXPECT_TRUE(result->identical) << result->first_difference_step;
}

TEST(Replay, RandomMechanisms) {
  Folder folder;
  for (unsigned seed = 1; seed <= 4; ++seed) {
    RandomMechanismOptions random;
    random.rigid_closures = 1;
    random.springs = 1;
    random.controls = 2;
    random.base = seed % 2 ? BaseKind::kFloating : BaseKind::kFixed;
    random.joints_in_order = false;
    Scene scene;
    scene.timestep = 0.002;
    scene.mechanisms = {RandomMechanismDef(seed, random)};
    Simulation simulation = CreateOrThrow(scene);
    auto recorder = Recorder::Create(folder / "run.h5", simulation);
    ASSERT_TRUE(recorder);
    for (int i = 0; i < 25; ++i) {
      if (simulation.controls().size() > 0) simulation.SetControl(0, 0.1 * std::sin(i));
      ASSERT_TRUE(recorder->Append(simulation, simulation.Step()));
    }
    ASSERT_TRUE(recorder->Finish());
    const auto result = Replay(*Recording::Open(folder / "run.h5"));
    ASSERT_TRUE(result) << result.error().Text();
    EXPECT_TRUE(result->identical) << seed;
  }
}

TEST(Replay, RefusesRecordingsFromTheMiddle) {
  Folder folder;
  Simulation simulation = CreateOrThrow(TouchingScene());
  simulation.Step();
  auto recorder = Recorder::Create(folder / "run.h5", simulation);
  ASSERT_TRUE(recorder);
  Record(simulation, *recorder, 3);
  ASSERT_TRUE(recorder->Finish());
  const auto recording = Recording::Open(folder / "run.h5");
  ASSERT_TRUE(recording);
  EXPECT_EQ(recording->header().first_step, 1);
  const auto result = Replay(*recording);
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().code, ErrorCode::kUsage);
}

TEST(Recorder, IsReadableWhileItWritesAndByItsDestructor) {
  Folder folder;
  Simulation simulation = CreateOrThrow(TouchingScene());
  {
    auto recorder =
        Recorder::Create(folder / "run.h5", simulation, {.flush_interval = 1e9, .flush_steps = 10});
    ASSERT_TRUE(recorder);
    Record(simulation, *recorder, 25);
    EXPECT_EQ(recorder->steps(), 25);
    std::filesystem::copy_file(folder / "run.h5", folder / "copy.h5");
    const auto copy = Recording::Open(folder / "copy.h5");
    ASSERT_TRUE(copy) << copy.error().Text();
    EXPECT_FALSE(copy->header().finished);
    EXPECT_EQ(copy->num_steps(), 20);
    const auto live = Recording::Open(folder / "run.h5");
    ASSERT_TRUE(live) << live.error().Text();
    EXPECT_EQ(live->num_steps(), 20);
    const auto replay = Replay(*copy);
    ASSERT_TRUE(replay);
    EXPECT_TRUE(replay->identical);
  }
  const auto recording = Recording::Open(folder / "run.h5");
  ASSERT_TRUE(recording) << recording.error().Text();
  EXPECT_TRUE(recording->header().finished);
  EXPECT_EQ(recording->num_steps(), 25);
}

TEST(Recorder, SurvivesTheDeathOfItsProgram) {
  Folder folder;
  const pid_t child = fork();
  if (child == 0) {
    Simulation simulation = CreateOrThrow(TouchingScene());
    auto recorder =
        Recorder::Create(folder / "run.h5", simulation, {.flush_interval = 1e9, .flush_steps = 10});
    if (recorder) Record(simulation, *recorder, 57);
    raise(SIGKILL);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFSIGNALED(status));
  const auto recording = Recording::Open(folder / "run.h5");
  ASSERT_TRUE(recording) << recording.error().Text();
  EXPECT_FALSE(recording->header().finished);
  EXPECT_EQ(recording->num_steps(), 50);
  const auto replay = Replay(*recording);
  ASSERT_TRUE(replay);
  EXPECT_TRUE(replay->identical);
}

TEST(Recorder, CallersMistakesThrow) {
  Folder folder;
  Simulation simulation = CreateOrThrow(TouchingScene());
  auto recorder = Recorder::Create(folder / "run.h5", simulation);
  ASSERT_TRUE(recorder);
  Scene small = TouchingScene();
  small.mechanisms.pop_back();
  Simulation other = CreateOrThrow(small);
  EXPECT_THROW(static_cast<void>(recorder->Append(other, {})), std::invalid_argument);
  EXPECT_THROW(static_cast<void>(recorder->Append(simulation, {}, {AppliedWrench{.body = 99}})),
               std::invalid_argument);
  ASSERT_TRUE(recorder->Finish());
  ASSERT_TRUE(recorder->Finish());
  EXPECT_THROW(static_cast<void>(recorder->Append(simulation, {})), std::invalid_argument);
}

}  // namespace
}  // namespace fork1s::testing
