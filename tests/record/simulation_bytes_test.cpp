// Models and simulations as bytes, and on from there.

#include "record/simulation_bytes.hpp"
#include "support.hpp"

namespace fork1s::testing {
namespace {

// Steps both with the same inputs and compares their states.
void ExpectSameSteps(Simulation& a, Simulation& b, int steps) {
  EXPECT_EQ(a.HashState(), b.HashState());
  for (int i = 0; i < steps; ++i) {
    ApplyWrenches(SetInputs(i, a), a);
    ApplyWrenches(SetInputs(i, b), b);
    a.Step();
    b.Step();
    ASSERT_EQ(a.HashState(), b.HashState()) << i;
  }
}

Simulation Touching(const SimulationOptions& options = {}) {
  Simulation simulation = CreateOrThrow(TouchingScene(), options);
  for (int i = 0; i < 40; ++i) {
    ApplyWrenches(SetInputs(i, simulation), simulation);
    simulation.Step();
  }
  return simulation;
}

TEST(SimulationBytes, ASimulationGoesOnWithTheSameBits) {
  for (const Recovery recovery :
       {Recovery::kExact, Recovery::kExpanded, Recovery::kCurved, Recovery::kTwist}) {
    SimulationOptions options;
    options.recovery = recovery;
    Simulation simulation = Touching(options);
    const std::string bytes =
        WriteSimulationBytes({simulation.scene(), simulation.options(), {}, simulation.Save()});
    const auto content = ReadSimulationBytes(bytes, "bytes");
    ASSERT_TRUE(content) << content.error().Text();
    Simulation other = CreateOrThrow(content->scene, content->options);
    const auto restored = other.Restore(content->snapshot);
    ASSERT_TRUE(restored) << restored.error().Text();
    EXPECT_EQ(other.steps(), 40);
    ExpectSameSteps(simulation, other, 30);
  }
}

TEST(SimulationBytes, ASnapshotIsGoneBackTo) {
  Simulation simulation = Touching();
  const auto snapshot = ReadSnapshotBytes(WriteSnapshotBytes(simulation.Save()), "bytes");
  ASSERT_TRUE(snapshot) << snapshot.error().Text();
  Simulation other = CreateOrThrow(TouchingScene());
  ASSERT_TRUE(other.Restore(*snapshot));
  ExpectSameSteps(simulation, other, 30);
}

TEST(SimulationBytes, MomentsOfABatchTakeTheSceneOfThoseThatAreMade) {
  Simulation simulation = Touching();
  BatchContent content{simulation.options(), {simulation.Save(), simulation.Save()}};
  for (Simulation::Snapshot& moment : content.snapshots) moment.made_of.reset();
  const std::string bytes = WriteBatchBytes(content);
  auto read = ReadBatchBytes(bytes, "bytes");
  ASSERT_TRUE(read) << read.error().Text();
  ASSERT_EQ(read->snapshots.size(), 2u);
  Simulation other = CreateOrThrow(TouchingScene(), read->options);
  ASSERT_TRUE(CompleteSnapshot(other.Save(), "bytes", read->snapshots[1]));
  ASSERT_TRUE(other.Restore(read->snapshots[1]));
  ExpectSameSteps(simulation, other, 30);
  // Of another scene.
  Simulation falling = CreateOrThrow(Scene{});
  const auto completed = CompleteSnapshot(falling.Save(), "bytes", read->snapshots[0]);
  ASSERT_FALSE(completed);
  EXPECT_EQ(completed.error().code, ErrorCode::kFormat);
  // Without its scene no moment stands by itself.
  const auto alone = ReadSnapshotBytes(WriteSnapshotBytes(content.snapshots[0]), "bytes");
  ASSERT_FALSE(alone);
  EXPECT_NE(alone.error().Text().find("has no scene"), std::string::npos) << alone.error().Text();
}

TEST(SimulationBytes, AModelKeepsSceneReportAndOptions) {
  ImportedScene imported{SceneWithEverything(3), {}, 1, {}, {}, {}};
  imported.report.notes = {{ImportNote::Kind::kChanged, "joint \xff", "not UTF-8"}};
  ImportOptions options;
  options.stiffness_scale = 1.0 / 3;
  const auto read = ReadModelBytes(WriteModelBytes({imported, options}), "bytes");
  ASSERT_TRUE(read) << read.error().Text();
  EXPECT_EQ(WriteImportedScene(read->imported).json, WriteImportedScene(imported).json);
  const ModelText then = WriteImportedScene(imported), now = WriteImportedScene(read->imported);
  ASSERT_EQ(now.meshes.size(), then.meshes.size());
  for (std::size_t i = 0; i < then.meshes.size(); ++i) {
    EXPECT_EQ(now.meshes[i]->name, then.meshes[i]->name);
    EXPECT_EQ(now.meshes[i]->vertices, then.meshes[i]->vertices);
    EXPECT_EQ(now.meshes[i]->triangles, then.meshes[i]->triangles);
    EXPECT_EQ(now.meshes[i]->corner_uv, then.meshes[i]->corner_uv);
  }
  ASSERT_EQ(now.grids.size(), then.grids.size());
  for (std::size_t i = 0; i < then.grids.size(); ++i) EXPECT_EQ(now.grids[i]->values, then.grids[i]->values);
  ASSERT_EQ(now.pictures.size(), then.pictures.size());
  for (std::size_t i = 0; i < then.pictures.size(); ++i)
    EXPECT_EQ(now.pictures[i]->rgb, then.pictures[i]->rgb);
  ASSERT_TRUE(read->options);
  EXPECT_EQ(read->options->stiffness_scale, 1.0 / 3);
  const auto plain = ReadModelBytes(WriteModelBytes({imported, std::nullopt}), "bytes");
  ASSERT_TRUE(plain);
  EXPECT_FALSE(plain->options);
}

TEST(SimulationBytes, DamagedBytesAreRefused) {
  const std::string whole = WriteSnapshotBytes(Touching().Save());
  for (const std::size_t size :
       {std::size_t{0}, std::size_t{16}, std::size_t{24}, whole.size() / 2, whole.size() - 1}) {
    const auto read = ReadSnapshotBytes(whole.substr(0, size), "bytes");
    ASSERT_FALSE(read) << size;
    EXPECT_EQ(read.error().code, ErrorCode::kFormat);
  }
  for (std::size_t at = 0; at < whole.size(); at += 1 + whole.size() / 97) {
    std::string damaged = whole;
    damaged[at] = static_cast<char>(damaged[at] ^ 0x55);
    // A changed distance in the compressed bytes may copy the same ones from another place: then nothing is damaged.
    const auto read = ReadSnapshotBytes(damaged, "bytes");
    if (read) {
      EXPECT_EQ(WriteSnapshotBytes(*read), whole) << at;
    }
  }
  // Bytes of something else.
  EXPECT_FALSE(ReadSimulationBytes(whole, "bytes"));
}

}  // namespace
}  // namespace fork1s::testing
