// A host that knows nothing but the folder of `fork1s reduce --buffers`.
#include <gpu/support.hpp>
#include <nlohmann/json.hpp>

#include <cstring>
#include <filesystem>
#include <fstream>
#include <sstream>

namespace fork1s::test {
namespace {

namespace fs = std::filesystem;

std::string TextOf(const fs::path& path) {
  std::ifstream file(path, std::ios::binary);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

template <class T>
std::vector<T> Section(const nlohmann::json& description, const std::string& bytes, const char* name) {
  const auto& section = description["sections"][name];
  const auto at = section["offset"].get<std::size_t>(), size = section["bytes"].get<std::size_t>();
  EXPECT_EQ(at % 256, 0u);
  EXPECT_LE(at + size, bytes.size());
  std::vector<T> values(size / sizeof(T));
  std::memcpy(values.data(), bytes.data() + at, size);
  return values;
}

fs::path Folder() {
  const fs::path folder = fs::temp_directory_path() / ("fork1s_buffers_" + std::to_string(::getpid()));
  fs::remove_all(folder);
  return folder;
}

TEST_F(GpuPoses, FromTheFilesAlone) {
  for (const char* scene : {"hand", "firemen", "vehicle"})
    for (const Recovery recovery : {Recovery::kTwist, Recovery::kExact, Recovery::kCurved}) {
      const Simulation simulation = SimulationOf(scene, recovery);
      const fs::path folder = Folder();
      ASSERT_TRUE(SaveRecoveryBuffers(simulation, folder.string()));
      const std::string bytes = TextOf(folder / "recovery.bin");
      const auto description = nlohmann::json::parse(TextOf(folder / "recovery.json"));
      fs::remove_all(folder);
      ASSERT_EQ(bytes.rfind("fork1s recovery\n", 0), 0u);
      ASSERT_EQ(description["bytes"].get<std::size_t>(), bytes.size());
      std::uint64_t reference = 0;
      std::memcpy(&reference, bytes.data() + 16, sizeof reference);
      EXPECT_EQ(reference, RecoveryReference(simulation));
      EXPECT_EQ(std::stoull(description["reference"].get<std::string>(), nullptr, 16), reference);
      ASSERT_EQ(description["bodies"].size(), simulation.bodies().size());

      PoseShaders shaders(kShaders);
      shaders.SetModel(Section<std::int32_t>(description, bytes, "tables"),
                       Section<float>(description, bytes, "numbers"));
      shaders.SetFrame(Section<float>(description, bytes, "trial_frame"));
      if (description["recovery"].get<std::string>() == "twist")
        shaders.RunTwist();
      else
        shaders.RunExact(description["sizes"]["scan_passes"].get<int>());
      const std::vector<RigidTransform> trial = PosesOf(Section<float>(description, bytes, "trial_poses"));
      // A trial that moves nothing would try nothing.
      double moved = 0;
      for (std::size_t b = 0; b < trial.size(); ++b)
        moved = std::max(moved, LogRotation(simulation.Pose(static_cast<int>(b)).rotation().transpose() *
                                            trial[b].rotation())
                                    .norm());
      EXPECT_GT(moved, 0.05);
      std::printf("%s, %s, from files: ", scene, Name(recovery));
      ExpectClose(Difference(shaders.Read(), trial), 1e-6, 2e-6);
    }
}

// Without a graphics processor as well.
TEST(RecoveryBuffersFiles, RefuseWhatIsNotTheirs) {
  const Simulation simulation = SimulationOf("hand", Recovery::kExact);
  const fs::path folder = Folder();
  fs::create_directories(folder);
  std::ofstream(folder / "recovery.json") << "{\"notes\": \"of somebody else\"}\n";
  const auto saved = SaveRecoveryBuffers(simulation, folder.string());
  ASSERT_FALSE(saved);
  EXPECT_EQ(saved.error().code, ErrorCode::kFile);
  EXPECT_NE(saved.error().Text().find("recovery.json"), std::string::npos) << saved.error().Text();
  EXPECT_EQ(TextOf(folder / "recovery.json"), "{\"notes\": \"of somebody else\"}\n");
  fs::remove_all(folder);
}

}  // namespace
}  // namespace fork1s::test
