// A recording that is read stretch by stretch says the same as one that is read whole.
#include <sys/resource.h>
#include <sys/wait.h>

#include <fork1s/record/csv.hpp>

#include "support.hpp"

namespace fork1s::testing {
namespace {

void MakeLongRecording(const std::string& path, int steps) {
  Simulation simulation = CreateOrThrow(TouchingScene());
  auto recorder = Recorder::Create(path, simulation);
  ASSERT_TRUE(recorder);
  Record(simulation, *recorder, steps);
  ASSERT_TRUE(recorder->Finish());
}

TEST(RecordingReader, StretchesMakeTheWhole) {
  Folder folder;
  MakeLongRecording(folder / "run.h5", 100);
  const auto whole = Recording::Open(folder / "run.h5");
  ASSERT_TRUE(whole);
  for (const std::size_t bytes : {std::size_t{1}, std::size_t{30000}, std::size_t{1} << 30}) {
    auto reader = RecordingReader::Open(folder / "run.h5", bytes);
    ASSERT_TRUE(reader) << reader.error().Text();
    int step = 0, stretches = 0;
    for (;; ++stretches) {
      const auto part = reader->Next();
      ASSERT_TRUE(part) << part.error().Text();
      if (part->num_steps() == 0) break;
      for (int i = 0; i < part->num_steps(); ++i, ++step) {
        ASSERT_EQ(part->data().hash[static_cast<std::size_t>(i)],
                  whole->data().hash[static_cast<std::size_t>(step)]);
        ASSERT_EQ(part->Controls(i), whole->Controls(step));
        ASSERT_EQ(part->ReducedCoordinates(i, 1), whole->ReducedCoordinates(step, 1));
        ASSERT_EQ(part->Contacts(i).size(), whole->Contacts(step).size());
        for (std::size_t c = 0; c < part->Contacts(i).size(); ++c)
          ASSERT_EQ(part->Contacts(i)[c].force, whole->Contacts(step)[c].force);
        ASSERT_EQ(part->Wrenches(i).size(), whole->Wrenches(step).size());
        ASSERT_EQ(part->PointSprings(i).size(), whole->PointSprings(step).size());
      }
    }
    EXPECT_EQ(step, 100);
    EXPECT_EQ(stretches, bytes == 1 ? 100 : bytes == 30000 ? stretches : 1);
    EXPECT_GT(stretches, bytes == 30000 ? 2 : 0);
  }
}

TEST(RecordingReader, ReplaysAndExportsTheSame) {
  Folder folder;
  MakeLongRecording(folder / "run.h5", 60);
  auto reader = RecordingReader::Open(folder / "run.h5", 20000);
  ASSERT_TRUE(reader);
  const auto replay = Replay(*reader);
  ASSERT_TRUE(replay) << replay.error().Text();
  EXPECT_TRUE(replay->identical);
  EXPECT_EQ(replay->steps, 60);
  const auto whole = Recording::Open(folder / "run.h5");
  ASSERT_TRUE(ExportCsv(*whole, folder / "whole"));
  reader = RecordingReader::Open(folder / "run.h5", 20000);
  const auto steps = ExportCsv(*reader, folder / "parts");
  ASSERT_TRUE(steps);
  EXPECT_EQ(*steps, 60);
  for (const char* table :
       {"/poses.csv", "/contacts.csv", "/pairs.csv", "/controls.csv", "/energy.csv", "/sensors.csv"})
    EXPECT_EQ(Bytes(folder / ("parts" + std::string(table))), Bytes(folder / ("whole" + std::string(table))));
}

TEST(RecordingReader, EndsAtTheLastWholeStepOfAKilledWriter) {
  Folder folder;
  Simulation simulation = CreateOrThrow(TouchingScene());
  auto recorder = Recorder::Create(folder / "run.h5", simulation);
  ASSERT_TRUE(recorder);
  Record(simulation, *recorder, 50);
  ASSERT_TRUE(recorder->Flush());
  const std::string bytes = Bytes(folder / "run.h5");
  for (const double share : {1.0, 0.9, 0.7}) {
    WriteBytes(folder / "cut.h5",
               bytes.substr(0, static_cast<std::size_t>(share * static_cast<double>(bytes.size()))));
    const auto whole = Recording::Open(folder / "cut.h5");
    auto reader = RecordingReader::Open(folder / "cut.h5", 20000);
    if (!whole || !reader) continue;
    int steps = 0;
    while (true) {
      const auto part = reader->Next();
      ASSERT_TRUE(part) << part.error().Text();
      if (part->num_steps() == 0) break;
      steps += part->num_steps();
    }
    EXPECT_EQ(steps, whole->num_steps()) << share;
  }
}

// What `work` adds to the most memory that this program ever held [bytes]; in a process of its own, which begins
// with what this one holds.
template <class Work>
long MemoryOf(Work&& work) {
  int ends[2];
  if (pipe(ends) != 0) return -1;
  const pid_t child = fork();
  if (child == 0) {
    const auto most = [] {
      rusage usage{};
      getrusage(RUSAGE_SELF, &usage);
      return 1024 * usage.ru_maxrss;
    };
    const long before = most();
    const long added = work() ? most() - before : -1;
    _exit(write(ends[1], &added, sizeof added) == sizeof added ? 0 : 1);
  }
  long added = -1;
  if (read(ends[0], &added, sizeof added) != sizeof added) added = -1;
  close(ends[0]);
  close(ends[1]);
  waitpid(child, nullptr, 0);
  return added;
}

// A recording of any length is replayed and exported in the memory of a stretch.
TEST(RecordingReader, MemoryDoesNotGrowWithLength) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers keep what was freed";
#endif
  constexpr std::size_t kStretch = 1 << 20;
  constexpr int kShort = 2000, kLong = 6000;  // steps
  Folder folder;
  const auto play = [&](const std::string& file, int steps) {
    return MemoryOf([&] {
      auto reader = RecordingReader::Open(file, kStretch);
      const auto replay = Replay(*reader);
      return replay && replay->identical && replay->steps == steps;
    });
  };
  const auto tabulate = [&](const std::string& file) {
    return MemoryOf([&] {
      auto reader = RecordingReader::Open(file, kStretch);
      return ExportCsv(*reader, folder / "tables").has_value();
    });
  };
  MakeLongRecording(folder / "short.h5", kShort);
  MakeLongRecording(folder / "long.h5", kLong);
  const auto longer = static_cast<long>(std::filesystem::file_size(folder / "long.h5") -
                                        std::filesystem::file_size(folder / "short.h5"));
  const long short_replay = play(folder / "short.h5", kShort), short_tables = tabulate(folder / "short.h5");
  EXPECT_GT(short_replay, 0);
  EXPECT_GT(short_tables, 0);
  EXPECT_LT(play(folder / "long.h5", kLong), short_replay + longer / 4);
  EXPECT_LT(tabulate(folder / "long.h5"), short_tables + longer / 4);
  // What the whole takes, and would be measured if it were read.
  EXPECT_GT(MemoryOf([&] { return Recording::Open(folder / "long.h5").has_value(); }), longer);
}

}  // namespace
}  // namespace fork1s::testing
