// Files that are cut off, damaged or something else.
#include <hdf5.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <csignal>
#include <functional>

#include <fork1s/record/reduced_model_file.hpp>

#include "foreign_leaks.hpp"
#include "support.hpp"

namespace fork1s::testing {
namespace {

// HDF5 keeps parts of damaged files, and its cleanup at exit then loops and prints so.
[[maybe_unused]] const bool kCleanupIsDisabled = (DisableHdf5Cleanup(), true);

void MakeRecording(const std::string& path, int steps, const std::string& unfinished_copy = "") {
  Simulation simulation = CreateOrThrow(TouchingScene());
  auto recorder = Recorder::Create(path, simulation, {.flush_interval = 1e9, .flush_steps = 8});
  ASSERT_TRUE(recorder);
  Record(simulation, *recorder, steps);
  if (!unfinished_copy.empty()) {
    ASSERT_TRUE(recorder->Flush());
    std::filesystem::copy_file(path, unfinished_copy);
  }
  ASSERT_TRUE(recorder->Finish());
}

TEST(DamagedRecording, CutAnywhereIsRefusedOrItsWholeStepsRead) {
  Folder folder;
  MakeRecording(folder / "whole.h5", 40, folder / "killed.h5");
  const auto whole = Recording::Open(folder / "whole.h5");
  ASSERT_TRUE(whole);
  for (const char* name : {"whole.h5", "killed.h5"}) {
    const std::string bytes = Bytes(folder / name);
    std::vector<std::size_t> lengths = {
        0, 1, 7, 8, 11, 12, 47, 48, 512, 2048, bytes.size() - 1, bytes.size() - 8};
    for (std::size_t i = 1; i < 30; ++i) lengths.push_back(bytes.size() * i / 30);
    int opened = 0;
    for (std::size_t length : lengths) {
      WriteBytes(folder / "cut.h5", bytes.substr(0, length));
      const auto cut = Recording::Open(folder / "cut.h5");
      if (!cut) {
        EXPECT_TRUE(cut.error().code == ErrorCode::kFile || cut.error().code == ErrorCode::kFormat);
        EXPECT_NE(cut.error().where.find("cut.h5"), std::string::npos);
        EXPECT_FALSE(cut.error().message.empty());
        continue;
      }
      ++opened;
      EXPECT_FALSE(cut->header().finished) << name << ' ' << length;
      const auto n = static_cast<std::size_t>(cut->num_steps());
      ASSERT_LE(n, whole->data().hash.size());
      for (std::size_t i = 0; i < n; ++i) EXPECT_EQ(cut->data().hash[i], whole->data().hash[i]);
      EXPECT_EQ(cut->data().poses.size(), n * 7 * whole->bodies().size());
    }
    if (std::string(name) == "whole.h5") {
      EXPECT_EQ(opened, 0);
    }
  }
}

TEST(DamagedRecording, FlippedBytesNeverPassForSteps) {
  Folder folder;
  MakeRecording(folder / "whole.h5", 24);
  const auto whole = Recording::Open(folder / "whole.h5");
  ASSERT_TRUE(whole);
  const std::string bytes = Bytes(folder / "whole.h5");
  RandomSource random(5);
  for (int i = 0; i < 150; ++i) {
    std::string other = bytes;
    const auto at = static_cast<std::size_t>(random.Uniform(0, 1) * static_cast<double>(bytes.size() - 1));
    other[at] = static_cast<char>(other[at] ^ (1 << random.Below(8)));
    WriteBytes(folder / "flipped.h5", other);
    const auto read = Recording::Open(folder / "flipped.h5");
    if (!read) continue;
    for (std::size_t k = 0; k < read->data().hash.size(); ++k) {
      ASSERT_EQ(read->data().hash[k], whole->data().hash[k]);
      ASSERT_EQ(read->Controls(static_cast<int>(k)), whole->Controls(static_cast<int>(k)));
    }
  }
}

// Changes a file through HDF5 itself, and returns what opening it says.
template <class F>
Error Spoil(const std::string& path, F&& spoil) {
  const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
  EXPECT_GE(file, 0);
  spoil(file);
  H5Fclose(file);
  const auto recording = Recording::Open(path);
  EXPECT_FALSE(recording);
  return recording ? Error{} : recording.error();
}

TEST(DamagedRecording, SaysWhatIsWrong) {
  Folder folder;
  MakeRecording(folder / "whole.h5", 9);
  auto fresh = [&] {
    std::filesystem::copy_file(folder / "whole.h5", folder / "bad.h5",
                               std::filesystem::copy_options::overwrite_existing);
    return folder / "bad.h5";
  };
  for (const char* name : {"steps/time", "steps/poses", "contacts/force", "names/bodies", "names/sensors",
                           "scene/json", "steps", "initial", "simulation/options", "wrenches/wrench"}) {
    const Error e = Spoil(fresh(), [&](hid_t file) { H5Ldelete(file, name, H5P_DEFAULT); });
    EXPECT_EQ(e.code, ErrorCode::kFormat) << name;
    const std::string last = std::string(name).substr(std::string(name).rfind('/') + 1);
    EXPECT_NE(e.message.find(last), std::string::npos) << e.message;
  }
  Error e = Spoil(fresh(), [&](hid_t file) {
    const hid_t a = H5Aopen(file, "format_version", H5P_DEFAULT);
    const std::int64_t version = 99;
    H5Awrite(a, H5T_NATIVE_INT64, &version);
    H5Aclose(a);
  });
  EXPECT_EQ(e.code, ErrorCode::kFormat);
  EXPECT_NE(e.message.find("version 99"), std::string::npos) << e.message;
  for (const char* name : {"steps/time", "contacts/gap", "reduced/w"}) {
    e = Spoil(fresh(), [&](hid_t file) {
      const hid_t d = H5Dopen2(file, name, H5P_DEFAULT);
      const hsize_t size = 3;
      H5Dset_extent(d, &size);
      H5Dclose(d);
    });
    EXPECT_EQ(e.code, ErrorCode::kFormat) << name;
  }
  // Bodies are looked up in the scene by these.
  for (const char* name : {"names/body_mechanism", "names/body_index"}) {
    e = Spoil(fresh(), [&](hid_t file) {
      const hid_t d = H5Dopen2(file, name, H5P_DEFAULT);
      std::vector<int> places(static_cast<std::size_t>(H5Dget_storage_size(d)) / sizeof(int), 1000);
      H5Dwrite(d, H5T_NATIVE_INT, H5S_ALL, H5S_ALL, H5P_DEFAULT, places.data());
      H5Dclose(d);
    });
    EXPECT_EQ(e.code, ErrorCode::kFormat) << name;
    EXPECT_NE(e.message.find("list of bodies"), std::string::npos) << e.message;
  }
}

// Reading must neither wait for a pipe nor take what another file says.
TEST(DamagedRecording, NothingOutsideIsRead) {
  Folder folder;
  MakeRecording(folder / "whole.h5", 9);
  ASSERT_EQ(mkfifo((folder / "pipe").c_str(), 0600), 0);
  const auto fresh = [&] {
    std::filesystem::copy_file(folder / "whole.h5", folder / "bad.h5",
                               std::filesystem::copy_options::overwrite_existing);
    return folder / "bad.h5";
  };
  for (const char* name : {"steps", "steps/time", "scene/json"})
    for (const std::string& target : {folder / "pipe", folder / "whole.h5"}) {
      const Error e = Spoil(fresh(), [&](hid_t file) {
        H5Ldelete(file, name, H5P_DEFAULT);
        H5Lcreate_external(target.c_str(), name, file, name, H5P_DEFAULT, H5P_DEFAULT);
      });
      EXPECT_EQ(e.code, ErrorCode::kFormat) << name;
      EXPECT_NE(e.message.find("leads elsewhere"), std::string::npos) << e.message;
    }
  const Error e = Spoil(fresh(), [&](hid_t file) {
    H5Ldelete(file, "steps/time", H5P_DEFAULT);
    const hid_t layout = H5Pcreate(H5P_DATASET_CREATE);
    H5Pset_external(layout, (folder / "pipe").c_str(), 0, H5F_UNLIMITED);
    const hsize_t size = 9;
    const hid_t space = H5Screate_simple(1, &size, nullptr);
    H5Dclose(H5Dcreate2(file, "steps/time", H5T_NATIVE_DOUBLE, space, H5P_DEFAULT, layout, H5P_DEFAULT));
    H5Sclose(space);
    H5Pclose(layout);
  });
  EXPECT_EQ(e.code, ErrorCode::kFormat);
  EXPECT_NE(e.message.find("another file"), std::string::npos) << e.message;
}

TEST(DamagedRecording, OtherFiles) {
  Folder folder;
  auto code = [&](const std::string& path) {
    const auto r = Recording::Open(path);
    EXPECT_FALSE(r);
    return r ? ErrorCode::kUsage : r.error().code;
  };
  EXPECT_EQ(code(folder / "none.h5"), ErrorCode::kFile);
  EXPECT_EQ(code(folder / ""), ErrorCode::kFile);
  WriteBytes(folder / "empty.h5", "");
  EXPECT_EQ(code(folder / "empty.h5"), ErrorCode::kFile);
  WriteBytes(folder / "text.h5", "<mujoco/>");
  EXPECT_EQ(code(folder / "text.h5"), ErrorCode::kFormat);
  const auto model = Reduce(std::make_shared<const Mechanism>(RandomMechanism(3)),
                            VectorX::Zero(RandomMechanism(3).num_coordinates()));
  ASSERT_TRUE(model);
  ASSERT_TRUE(SaveReducedModel(*model, folder / "model.h5"));
  EXPECT_EQ(code(folder / "model.h5"), ErrorCode::kFormat);
}

TEST(Recorder, TellsWhereItCannotWrite) {
  Folder folder;
  Simulation simulation = CreateOrThrow(TouchingScene());
  const auto recorder = Recorder::Create(folder / "no/such/folder.h5", simulation);
  ASSERT_FALSE(recorder);
  EXPECT_EQ(recorder.error().code, ErrorCode::kFile);
}

// What another program does to the file meanwhile: said in the end, not found out by the reader.
TEST(Recorder, TellsOfAFileThatWasTakenAway) {
  namespace fs = std::filesystem;
  Folder folder;
  const std::string path = folder / "run.h5", other = folder / "other.h5";
  const struct {
    const char* said;
    std::function<void()> work;
  } cases[] = {
      {"was removed", [&] { fs::remove(path); }},
      {"renamed", [&] { fs::rename(path, other); }},
      {"replaced", [&] { WriteBytes(folder / "new", "text"), fs::rename(folder / "new", path); }},
      {"cut it off", [&] { fs::resize_file(path, 0); }},
      {"cut it off", [&] { fs::resize_file(path, fs::file_size(path) - 1); }},
  };
  for (const auto& c : cases) {
    Simulation simulation = CreateOrThrow(TouchingScene());
    auto recorder = Recorder::Create(path, simulation);
    ASSERT_TRUE(recorder) << recorder.error().Text();
    Record(simulation, *recorder, 30);
    ASSERT_TRUE(recorder->Flush());
    c.work();
    Record(simulation, *recorder, 3);
    const auto ended = recorder->Finish();
    ASSERT_FALSE(ended) << c.said;
    EXPECT_EQ(ended.error().code, ErrorCode::kFile);
    EXPECT_NE(ended.error().message.find(c.said), std::string::npos) << ended.error().message;
    fs::remove(path);
  }
  const auto moved = Recording::Open(other);  // the renamed one is whole
  ASSERT_TRUE(moved) << moved.error().Text();
  EXPECT_EQ(moved->num_steps(), 33);
}

TEST(Recorder, AFullDiskKeepsWhatWasFlushed) {
  Folder folder;
  const pid_t child = fork();
  if (child == 0) {
    signal(SIGXFSZ, SIG_IGN);
    Simulation simulation = CreateOrThrow(TouchingScene());
    auto recorder =
        Recorder::Create(folder / "run.h5", simulation, {.flush_interval = 1e9, .flush_steps = 10});
    if (!recorder) _exit(2);
    const auto size = std::filesystem::file_size(folder / "run.h5");
    rlimit limit{size + 1000000, size + 1000000};
    setrlimit(RLIMIT_FSIZE, &limit);
    for (int i = 0; i < 5000; ++i) {
      auto ok = recorder->Append(simulation, simulation.Step());
      if (ok) continue;
      WriteBytes(folder / "flushed",
                 std::to_string(i + 1 - 10));  // this flush failed, the one before did not
      _exit(ok.error().code == ErrorCode::kFile ? 0 : 3);
    }
    _exit(4);
  }
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  ASSERT_TRUE(WIFEXITED(status));
  ASSERT_EQ(WEXITSTATUS(status), 0);
  const auto recording = Recording::Open(folder / "run.h5");
  ASSERT_TRUE(recording) << recording.error().Text();
  EXPECT_GE(recording->num_steps(), std::stoi(Bytes(folder / "flushed")));
  EXPECT_GT(recording->num_steps(), 20);
  const auto replay = Replay(*recording);
  ASSERT_TRUE(replay);
  EXPECT_TRUE(replay->identical);
}

// Version 18 differs in fields that read as their defaults where they are missing (SceneJson), and neither has values
// of sensors.
TEST(OlderVersion, WithTheStepsOfThisOne_IsReadAndReplayed) {
  for (const std::int64_t version : {18, 19}) {
    Folder folder;
    const std::string path = folder / "old.h5";
    MakeRecording(path, 9);
    const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
    const hid_t a = H5Aopen(file, "format_version", H5P_DEFAULT);
    H5Awrite(a, H5T_NATIVE_INT64, &version);
    H5Aclose(a);
    H5Ldelete(file, "names/sensors", H5P_DEFAULT);
    H5Fclose(file);
    const auto recording = Recording::Open(path);
    ASSERT_TRUE(recording) << recording.error().Text();
    EXPECT_TRUE(recording->header().sensor_names.empty());
    const auto replayed = Replay(*recording);
    ASSERT_TRUE(replayed) << replayed.error().Text();
    EXPECT_TRUE(replayed->identical);
  }
}

// Version 17 has an integrator and an option of the step that are gone.
TEST(OtherSteps, AreReadAndNotReplayed) {
  Folder folder;
  const std::string path = folder / "old.h5";
  MakeRecording(path, 9);
  const auto poses = Recording::Open(path)->data().poses;
  const hid_t file = H5Fopen(path.c_str(), H5F_ACC_RDWR, H5P_DEFAULT);
  const hid_t a = H5Aopen(file, "format_version", H5P_DEFAULT);
  const std::int64_t version = 17;
  H5Awrite(a, H5T_NATIVE_INT64, &version);
  H5Aclose(a);
  const char* name = "simulation/options";
  hid_t d = H5Dopen2(file, name, H5P_DEFAULT), stored = H5Dget_type(d), type = H5Tcopy(stored),
        space = H5Dget_space(d);
  std::string text(H5Tget_size(type), ' ');
  H5Dread(d, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, text.data());
  H5Dclose(d);
  H5Ldelete(file, name, H5P_DEFAULT);
  const std::string word = "\"two-stage\"";
  ASSERT_NE(text.find(word), std::string::npos) << text;
  text.replace(text.find(word), word.size(), "\"theta\", \"contact_curvature\": true");
  H5Tset_size(type, text.size());
  d = H5Dcreate2(file, name, type, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
  H5Dwrite(d, type, H5S_ALL, H5S_ALL, H5P_DEFAULT, text.data());
  H5Dclose(d);
  H5Tclose(stored);
  H5Tclose(type);
  H5Sclose(space);
  H5Fclose(file);
  const auto recording = Recording::Open(path);
  ASSERT_TRUE(recording) << recording.error().Text();
  EXPECT_EQ(recording->data().poses, poses);
  const auto replayed = Replay(*recording);
  ASSERT_FALSE(replayed);
  EXPECT_EQ(replayed.error().code, ErrorCode::kUsage);
  EXPECT_NE(replayed.error().message.find("whose steps were others"), std::string::npos)
      << replayed.error().Text();
}

}  // namespace
}  // namespace fork1s::testing
