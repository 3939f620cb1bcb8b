// Streams for the viewer's own tests, with the poses that belong to them: the page must find the same.
#include <cstring>
#include <filesystem>
#include <fork1s/recovery/recover.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "support.hpp"

namespace fork1s::test {
namespace {

struct Case {
  const char *name, *scene;
  Recovery recovery;
  const char* keyframe;
  const char* pulled;
};

class Streams : public ::testing::TestWithParam<Case> {};

void Append(std::ofstream& out, bool binary, const Message& message) {
  const std::uint32_t head[] = {binary ? 1u : 0u, static_cast<std::uint32_t>(message->size())};
  out.write(reinterpret_cast<const char*>(head), sizeof head);
  out.write(message->data(), static_cast<std::streamsize>(message->size()));
}

TEST_P(Streams, AreWritten) {
  const Case& c = GetParam();
  LiveSimulation live = Live(c.scene, c.recovery, c.keyframe);
  std::filesystem::create_directories(FORK1S_STREAMS);
  const std::string path = std::string(FORK1S_STREAMS) + "/" + c.name;
  std::ofstream out(path + ".stream", std::ios::binary);
  nlohmann::json poses = nlohmann::json::array();
  const int body = live.simulation().FindBody(c.pulled);
  ASSERT_GE(body, 0);
  const Vector3 start = live.simulation().Pose(body).translation();
  std::vector<std::uint32_t> versions;
  for (int i = 0; i < 60; ++i) {
    live.Handle(Pull(body, Vector3::Zero(), start + 0.004 * i * Vector3(1, 0.5, 1)));
    live.Advance(kNoLimit);
    const Snapshot s = live.Capture(1);
    if (i == 0) {
      Append(out, false, s.geometry);
      Append(out, true, s.meshes);
      Append(out, false, s.scene);
      Append(out, false, s.settings);
      versions.assign(s.maps.size(), 0);
    }
    for (std::size_t m = 0; m < s.maps.size(); ++m)
      if (versions[m] != s.versions[m]) Append(out, true, s.maps[m]), versions[m] = s.versions[m];
    Append(out, true, s.frame);
    nlohmann::json row = nlohmann::json::array();
    for (std::size_t b = 0; b < live.simulation().bodies().size(); ++b) {
      const SceneBody& drawn = live.simulation().bodies()[b];
      RigidTransform X = live.simulation().Pose(static_cast<int>(b));
      if (live.simulation().fidelity().recovery == Recovery::kTwist &&
          drawn.mechanism >= 0) {  // as the page draws it
        const MechanismDynamics& m =
            live.simulation().world().mechanisms()[static_cast<std::size_t>(drawn.mechanism)];
        X = m.state().X_WR * RecoverPoseTwist(m.model(), m.state(), BodyIndex(drawn.index));
      }
      for (int k = 0; k < 3; ++k) row.push_back(X.translation()(k));
      const Quaternion q = X.quaternion();
      for (double v : {q.w(), q.x(), q.y(), q.z()}) row.push_back(v);
    }
    poses.push_back(std::move(row));
  }
  ASSERT_TRUE(out.good());
  std::ofstream(path + ".poses.json") << poses.dump();
}

INSTANTIATE_TEST_SUITE_P(
    Scenes, Streams,
    ::testing::Values(Case{"hand_exact", "hand.xml", Recovery::kExact, "open", "index_tip"},
                      Case{"hand_twist", "hand.xml", Recovery::kTwist, "open", "index_tip"},
                      Case{"hexapod_exact", "hexapod.xml", Recovery::kExact, "", "trunk"},
                      Case{"firemen_exact", "firemen.xml", Recovery::kExact, "", "bunny"},
                      Case{"firemen_curved", "firemen.xml", Recovery::kCurved, "", "bunny"},
                      Case{"firemen_twist", "firemen.xml", Recovery::kTwist, "", "bunny"}),
    [](const auto& at) { return std::string(at.param.name); });

std::string SourceText(const char* path) {
  std::ifstream file(std::string(FORK1S_SOURCE_DIR) + path);
  std::stringstream text;
  text << file.rdbuf();
  return text.str();
}

TEST(Wire, HasOneVersionInProgramPageAndDocs) {
  const std::string version = std::to_string(kWireVersion);
  EXPECT_NE(SourceText("/docs/wire.md").find("The wire's `version` is " + version + "."), std::string::npos);
  EXPECT_NE(SourceText("/viewer/src/wire/messages.ts").find("WIRE_VERSION = " + version + ";"),
            std::string::npos);
}

// Bytes of a frame as docs/wire.md counts them: what is left after each fixed field is lists alone.
TEST(Wire, FrameHasTheBytesThatTheDocsList) {
  LiveSimulation live = Live("hand.xml");
  const Snapshot now = live.Capture(1);
  ASSERT_TRUE(now.frame);
  const std::string& bytes = *now.frame;
  const auto word = [&](std::size_t at) {
    std::uint32_t v = 0;
    std::memcpy(&v, bytes.data() + at, sizeof v);
    return v;
  };
  std::size_t at = 4 * 4 + 8 * 14;
  const std::uint32_t roots = word(at);
  at += 4;
  for (std::uint32_t i = 0; i < roots; ++i) at += 3 * 4 + 7 * 8 + 4 * (word(at + 4) + word(at + 8));
  at += 4 + word(at) * (2 * 4 + 9 * 4 + 2 * 4);
  at += 4 + word(at) * (4 + 9 * 4);
  at += 4 + word(at) * 4;
  EXPECT_EQ(at, bytes.size());
}

}  // namespace
}  // namespace fork1s::test
