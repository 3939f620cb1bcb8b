#include <cmath>
#include <fork1s/record/csv.hpp>

#include "support.hpp"

namespace fork1s::testing {
namespace {

std::vector<std::string> Lines(const std::string& path) {
  std::ifstream in(path);
  std::vector<std::string> lines;
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

TEST(Csv, ExportsWhatTheRecordingHolds) {
  Folder folder;
  Simulation simulation = CreateOrThrow(TouchingScene());
  auto recorder = Recorder::Create(folder / "run.h5", simulation);
  ASSERT_TRUE(recorder);
  Record(simulation, *recorder, 30);
  ASSERT_TRUE(recorder->Finish());
  const auto recording = Recording::Open(folder / "run.h5");
  ASSERT_TRUE(recording);
  auto ok = ExportCsv(*recording, folder / "tables/of/run");
  ASSERT_TRUE(ok) << ok.error().Text();

  const auto poses = Lines(folder / "tables/of/run/poses.csv");
  ASSERT_EQ(poses.size(), 31u);
  EXPECT_EQ(poses[0].rfind("time,hand4.x,hand4.y,hand4.z,hand4.qw,", 0), 0u) << poses[0];
  EXPECT_EQ(poses[0].find("hand1."), std::string::npos);
  EXPECT_NE(poses[0].find("box.x"), std::string::npos);
  EXPECT_EQ(Lines(folder / "tables/of/run/energy.csv")[0], "time,kinetic,potential,total");
  std::size_t contacts = 1;
  for (int n : recording->data().contacts) contacts += static_cast<std::size_t>(n);
  EXPECT_EQ(Lines(folder / "tables/of/run/contacts.csv").size(), contacts);

  // The exported controls are a control track, with the same doubles.
  const auto track = ReadControls(folder / "tables/of/run/controls.csv");
  ASSERT_TRUE(track) << track.error().Text();
  EXPECT_EQ(track->names, simulation.control_names());
  EXPECT_TRUE(track->FindMissing(simulation).empty());
  EXPECT_EQ(track->times, recording->data().time);
  for (int i = 0; i < 30; ++i)
    for (std::size_t k = 0; k < track->names.size(); ++k)
      EXPECT_EQ(track->rows[static_cast<std::size_t>(i)][k],
                recording->Controls(i)(static_cast<Eigen::Index>(k)));

  ASSERT_TRUE(ExportCsv(*recording, folder / "all", {.all_bodies = true}));
  EXPECT_NE(Lines(folder / "all/poses.csv")[0].find("hand1.x"), std::string::npos);
  WriteBytes(folder / "file", "");
  const auto blocked = ExportCsv(*recording, folder / "file");
  ASSERT_FALSE(blocked);
  EXPECT_EQ(blocked.error().code, ErrorCode::kFile);
}

// A box that stands on a slope of angle θ uses tan θ/µ of its friction, a slippery one all of it.
TEST(Csv, FrictionUseOnASlope_IsTheTangentOverTheCoefficient) {
  constexpr double kAngle = 0.2, kMass = 2;
  for (const double friction : {0.5, 0.05, 0.0}) {
    Folder folder;
    Scene scene;
    const Vector3 half(0.05, 0.04, 0.02);
    FreeBodyDef box;
    box.name = "box";
    const Vector3 squares = half.cwiseAbs2();
    box.inertia = {kMass, Vector3::Zero(),
                   Matrix3((kMass / 3 * (Vector3::Constant(squares.sum()) - squares)).asDiagonal())};
    box.X_WB.translation().z() = half.z();
    box.geometries.push_back(Geometry("box", Box{half}));
    scene.world.push_back(Geometry("slope", Plane{}));
    box.geometries[0].friction = scene.world[0].friction = friction;
    scene.free_bodies.push_back(box);
    scene.gravity = 9.81 * Vector3(std::sin(kAngle), 0, -std::cos(kAngle));
    Simulation simulation = CreateOrThrow(scene);
    auto recorder = Recorder::Create(folder / "run.h5", simulation);
    ASSERT_TRUE(recorder);
    for (int i = 0; i < 60; ++i) {
      const StepReport report = simulation.Step();
      ASSERT_TRUE(recorder->Append(simulation, report, {}));
    }
    ASSERT_TRUE(recorder->Finish());
    const auto recording = Recording::Open(folder / "run.h5");
    ASSERT_TRUE(recording);
    ASSERT_TRUE(ExportCsv(*recording, folder / "tables"));
    // Of one point the share is its own; over those of the pair it is weighed by µ f_n.
    const double expected = friction > 0 ? std::min(1.0, std::tan(kAngle) / friction) : 0;
    const std::string row = Lines(folder / "tables/pairs.csv").back();
    EXPECT_NEAR(std::stod(row.substr(row.rfind(',') + 1)), expected, 1e-6) << row;  // settled to that
    double limit = 0, tangential = 0;
    for (const std::string& contact : Lines(folder / "tables/contacts.csv")) {
      if (contact.rfind(row.substr(0, row.find(',') + 1), 0) != 0) continue;
      std::vector<double> numbers;
      std::istringstream cells(contact);
      for (std::string cell; std::getline(cells, cell, ',');)
        numbers.push_back(cell == "box" || cell == "world" ? 0 : std::stod(cell));
      const Vector3 normal(numbers[6], numbers[7], numbers[8]), force(numbers[9], numbers[10], numbers[11]);
      limit += numbers[13] * force.dot(normal);
      tangential += numbers[14] * numbers[13] * force.dot(normal);
    }
    if (friction > 0) {
      EXPECT_NEAR(tangential / limit, expected, 1e-6);
    }
  }
}

// Time and place of the box are in other columns too.
TEST(Csv, SensorsAreThoseOfEveryStep) {
  Folder folder;
  Scene scene = TouchingScene();
  scene.sensors.resize(3);
  scene.sensors[0].name = "clock";
  scene.sensors[0].kind = SensorKind::kTime;
  scene.sensors[1].name = "own";
  scene.sensors[1].reason = "a program of the user computes it";
  scene.sensors[2].name = "place";
  scene.sensors[2].kind = SensorKind::kPosition;
  scene.sensors[2].size = 3;
  scene.sensors[2].frame.body.free_body = 0;
  Simulation simulation = CreateOrThrow(scene);
  auto recorder = Recorder::Create(folder / "run.h5", simulation, {.flush_interval = 1e9, .flush_steps = 7});
  ASSERT_TRUE(recorder);
  Record(simulation, *recorder, 20);
  ASSERT_TRUE(recorder->Finish());
  const auto recording = Recording::Open(folder / "run.h5");
  ASSERT_TRUE(recording) << recording.error().Text();
  EXPECT_EQ(recording->header().sensor_names,
            (std::vector<std::string>{"clock", "own", "place.0", "place.1", "place.2"}));
  const RecordedSteps& data = recording->data();
  ASSERT_EQ(data.sensors.size(), 100u);
  const int box = simulation.FindBody("box");
  for (std::size_t i = 0; i < 20; ++i) {
    EXPECT_EQ(data.sensors[5 * i], data.time[i]);
    EXPECT_TRUE(std::isnan(data.sensors[5 * i + 1]));
    const Vector3 place = recording->Pose(static_cast<int>(i), box).translation();
    for (std::size_t k = 0; k < 3; ++k)
      EXPECT_EQ(data.sensors[5 * i + 2 + k], place(static_cast<Eigen::Index>(k)));
  }
  ASSERT_TRUE(ExportCsv(*recording, folder / "tables"));
  const auto lines = Lines(folder / "tables/sensors.csv");
  ASSERT_EQ(lines.size(), 21u);
  EXPECT_EQ(lines[0], "time,clock,own,place.0,place.1,place.2");
  EXPECT_EQ(lines[1].rfind("0.005,0.005,nan,", 0), 0u) << lines[1];
  const auto replayed = Replay(*recording);
  ASSERT_TRUE(replayed);
  EXPECT_TRUE(replayed->identical);
}

TEST(Csv, SameNamesAreToldApart) {
  Folder folder;
  Scene scene;
  scene.timestep = 0.01;
  for (const char* name : {"left", "right"}) {
    MechanismDef m = Chain("arm", BaseKind::kFixed, 2, RigidTransform());
    m.name = name;
    m.bodies[2].geometries.clear();
    scene.mechanisms.push_back(m);
  }
  Simulation simulation = CreateOrThrow(scene);
  auto recorder = Recorder::Create(folder / "run.h5", simulation);
  ASSERT_TRUE(recorder);
  ASSERT_TRUE(recorder->Append(simulation, simulation.Step()));
  ASSERT_TRUE(recorder->Finish());
  ASSERT_TRUE(ExportCsv(*Recording::Open(folder / "run.h5"), folder / "out"));
  const std::string header = Lines(folder / "out/poses.csv")[0];
  EXPECT_NE(header.find("left/arm2.x"), std::string::npos);
  EXPECT_NE(header.find("right/arm2.x"), std::string::npos);
}

class ControlFile : public ::testing::Test {
 protected:
  Expected<ControlTrack> Read(const std::string& text) {
    WriteBytes(folder_ / "inputs.csv", text);
    return ReadControls(folder_ / "inputs.csv");
  }
  void Refuses(const std::string& text, const std::string& where, const std::string& what) {
    const auto track = Read(text);
    ASSERT_FALSE(track) << text;
    EXPECT_EQ(track.error().code, ErrorCode::kFormat);
    EXPECT_NE(track.error().where.find("inputs.csv" + where), std::string::npos) << track.error().Text();
    EXPECT_NE(track.error().message.find(what), std::string::npos) << track.error().Text();
  }
  Folder folder_;
};

TEST_F(ControlFile, IsRead) {
  const auto track = Read(
      "\xEF\xBB\xBF# made by hand\r\n\r\n time , \"grip, left\" ,tilt\r\n0,1,2\r\n# between\n0.5, -1e-3 "
      ",+4\n");
  ASSERT_TRUE(track) << track.error().Text();
  EXPECT_EQ(track->names, (std::vector<std::string>{"grip, left", "tilt"}));
  EXPECT_EQ(track->times, (std::vector<double>{0, 0.5}));
  EXPECT_EQ(track->rows, (std::vector<std::vector<double>>{{1, 2}, {-1e-3, 4}}));
  const auto middle = Read("a,time,b\n1,0,2\n");
  ASSERT_TRUE(middle);
  EXPECT_EQ(middle->names, (std::vector<std::string>{"a", "b"}));
  EXPECT_EQ(middle->rows[0], (std::vector<double>{1, 2}));
}

TEST_F(ControlFile, ErrorsNameTheLine) {
  Refuses("", "", "is empty");
  Refuses("# only a remark\n\n", "", "is empty");
  Refuses("time,a\n", "", "no row");
  Refuses("t,a\n0,1\n", ", line 1", "'time'");
  Refuses("0,1\n1,2\n", ", line 1", "'time'");
  for (const char* header : {"time;a\n0;1\n", "time\ta\n0\t1\n", "a;Time\n0;1\n"})
    Refuses(header, ", line 1", "commas");
  Refuses("a,Time\n1,0\n", ", line 1", "'Time'");
  Refuses("time;s,a\n0,1\n", ", line 1", "no column named 'time'");
  Refuses("time\n0\n", ", line 1", "no control");
  Refuses("time,a,a\n0,1,1\n", ", line 1", "twice");
  Refuses("time,a,time\n0,1,1\n", ", line 1", "twice");
  Refuses("time,,a\n0,1,1\n", ", line 1", "no name");
  Refuses("time,a\n0,1\n1,two\n", ", line 3", "'two'");
  Refuses("time,a\n0,\n", ", line 2", "no number");
  Refuses("time,a\n0,1e\n", ", line 2", "no number");
  Refuses("time,a\n0,1 2\n", ", line 2", "no number");
  Refuses("time,a\n0,1,5\n", ", line 2", "3 cells");
  Refuses("time,a\n0\n", ", line 2", "1 cells");
  Refuses("time,a\n0,nan\n", ", line 2", "finite");
  Refuses("time,a\ninf,0\n", ", line 2", "finite");
  Refuses("time,a\n0,1e999\n", ", line 2", "no number");
  Refuses("# x\ntime,a\n0,1\n0,2\n", ", line 4", "increase");
  Refuses("time,a\n1,1\n0.5,2\n", ", line 3", "increase");
  Refuses("time,\"a\n0,1\n", ", line 1", "quote");
  const auto none = ReadControls(folder_ / "none.csv");
  ASSERT_FALSE(none);
  EXPECT_EQ(none.error().code, ErrorCode::kFile);
  EXPECT_FALSE(ReadControls(folder_ / ""));
}

}  // namespace
}  // namespace fork1s::testing
