// Disks that end: whatever is left must open up to the last whole step, and nothing may be lost that was
// there.
#include <hdf5.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <csignal>
#include <fork1s/record/reduced_model_file.hpp>

#include "support.hpp"

namespace fork1s::testing {
namespace {

constexpr int kStepsWanted = 400, kFlushed = 40;

// What `work` returns in a process of its own whose files cannot grow beyond `limit`, or the signal that
// ended it as a negative number. HDF5 closes in it as it does when a program ends.
template <class Work>
int WithLimit(std::size_t limit, Work&& work) {
  const pid_t child = fork();
  if (child == 0) {
    close(STDERR_FILENO);  // HDF5 also complains of files that other tests damaged
    signal(SIGXFSZ, SIG_IGN);
    const rlimit bound{limit, limit};
    setrlimit(RLIMIT_FSIZE, &bound);
    const int outcome = work();
    H5close();
    _exit(outcome);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
}

// Records so: 0 finished, 1 refused at the beginning, 2 refused while it ran, 3 anything else.
int RecordWithLimit(const std::string& path, Simulation& simulation, std::size_t limit) {
  return WithLimit(limit, [&] {
    auto recorder = Recorder::Create(path, simulation, {.flush_interval = 1e9, .flush_steps = kFlushed});
    if (!recorder) return recorder.error().code == ErrorCode::kFile ? 1 : 3;
    for (int i = 0; i < kStepsWanted; ++i) {
      const auto wrenches = SetInputs(i, simulation);
      ApplyWrenches(wrenches, simulation);
      const auto ok = recorder->Append(simulation, simulation.Step(), wrenches);
      if (!ok) return ok.error().code == ErrorCode::kFile ? 2 : 3;
    }
    const auto ok = recorder->Finish();
    return ok ? 0 : ok.error().code == ErrorCode::kFile ? 2 : 3;
  });
}

TEST(FullDisk, KeepsEveryWholeStepWhereverItEnds) {
  Folder folder;
  Simulation simulation = CreateOrThrow(TouchingScene());
  ASSERT_EQ(RecordWithLimit(folder / "whole.h5", simulation, 1u << 30), 0);
  const auto whole = Recording::Open(folder / "whole.h5");
  ASSERT_TRUE(whole);
  const std::size_t size = std::filesystem::file_size(folder / "whole.h5");
  int most = 0, cut_short = 0;
  for (std::size_t limit = 0; limit < size; limit += 1 + size / 60) {
    const std::string path = folder / "cut.h5";
    const int outcome = RecordWithLimit(path, simulation, limit);
    ASSERT_TRUE(outcome == 1 || outcome == 2) << outcome << " at " << limit << " of " << size;
    // Not even a beginning: then there is no file, and none beside it.
    EXPECT_EQ(std::filesystem::exists(path), outcome == 2) << limit;
    if (outcome == 1) continue;
    ++cut_short;
    const auto cut = Recording::Open(path);
    ASSERT_TRUE(cut) << limit << ' ' << cut.error().Text();
    EXPECT_FALSE(cut->header().finished);
    for (int i = 0; i < cut->num_steps(); ++i)
      ASSERT_EQ(cut->data().hash[static_cast<std::size_t>(i)],
                whole->data().hash[static_cast<std::size_t>(i)]);
    most = std::max(most, cut->num_steps());
    std::filesystem::remove(path);
  }
  EXPECT_GT(cut_short, 10);
  EXPECT_GE(most, kStepsWanted - 3 * kFlushed);
  for (const auto& entry : std::filesystem::directory_iterator(folder / ""))
    EXPECT_EQ(entry.path().filename(), "whole.h5");
}

TEST(FullDisk, ARecordingThatCannotBeginLeavesTheOldOne) {
  Folder folder;
  Simulation simulation = CreateOrThrow(TouchingScene());
  ASSERT_EQ(RecordWithLimit(folder / "run.h5", simulation, 1u << 30), 0);
  const std::string before = Bytes(folder / "run.h5");
  EXPECT_EQ(RecordWithLimit(folder / "run.h5", simulation, 8192), 1);
  EXPECT_EQ(Bytes(folder / "run.h5"), before);
}

TEST(FullDisk, AReducedModelThatDoesNotFitLeavesTheOldOne) {
  Folder folder;
  const auto model = Reduce(std::make_shared<const Mechanism>(RandomMechanism(3)),
                            VectorX::Zero(RandomMechanism(3).num_coordinates()));
  ASSERT_TRUE(model);
  ASSERT_TRUE(SaveReducedModel(*model, folder / "model.h5"));
  const std::string before = Bytes(folder / "model.h5");
  for (std::size_t limit = 0; limit < before.size(); limit += 1 + before.size() / 20) {
    EXPECT_EQ(WithLimit(limit, [&] { return SaveReducedModel(*model, folder / "model.h5") ? 1 : 0; }), 0)
        << limit;
    EXPECT_EQ(Bytes(folder / "model.h5"), before);
  }
}

}  // namespace
}  // namespace fork1s::testing
