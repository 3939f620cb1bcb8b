// Changed files of models through the reader in a child process: whatever becomes of the child, the caller gets a
// scene or a sentence, in time.
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <string>
#include <thread>
#include <vector>

#include "corpus.hpp"
#include "files.hpp"
#include "hostile_models.hpp"
#include "mutate.hpp"
#include "record/child_reader.hpp"

namespace fork1s::fuzz {
namespace {

constexpr double kMaxTime = 20;  // s of a file; most take 0.02

// Files of one run: FORK1S_FUZZ_FILES, else 250 (fewer where a sanitizer takes most of their time); ./check --all reads
// 10,000.
int NumFiles() {
  if (const char* count = std::getenv("FORK1S_FUZZ_FILES")) return std::atoi(count);
#ifdef __SANITIZE_ADDRESS__
  return 50;
#else
  return 250;
#endif
}

struct Counts {
  std::atomic<int> read = 0, refused = 0, crashed = 0, late = 0;
};

// Reads the file at `path` in a child, checks the sentence where it is refused, and counts what became of it. Returns
// the sentence, empty where it was read.
std::string ReadFile(const std::string& path, const ImportOptions& options, double max_time, Counts& counts) {
  const auto start = std::chrono::steady_clock::now();
  const auto model =
      ReadInChild({.program = FORK1S_BINARY, .max_time = max_time}, path, options, [] { return false; });
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
  EXPECT_LT(took.count(), max_time + kMaxTime) << path;
  if (model) {
    ++counts.read;
    return {};
  }
  const std::string said = model.error().Text();
  EXPECT_FALSE(model.error().message.empty());
  EXPECT_FALSE(model.error().where.empty()) << said;
  const bool crashed = said.find("brought its reader down") != std::string::npos;
  const bool late = said.find("was not read within") != std::string::npos;
  ++(crashed ? counts.crashed : late ? counts.late : counts.refused);
  return said;
}

void Read(const std::string& name, const std::string& text, const ImportOptions& options, Counts& counts) {
  const int before = counts.crashed + counts.late;
  const std::string said = ReadFile(WriteScratch(name, text), options, kMaxTime, counts);
  if (counts.crashed + counts.late > before || testing::Test::HasFailure())
    std::printf("%s\n%s\n", said.c_str(), text.c_str());
}

// A thread reads every second file of a format, so that files do not depend on the number of threads.
void ReadEverySecond(const std::string& format, unsigned seed, int count, Counts& counts) {
  const std::vector<std::string> corpus = Corpus(format);
  ImportOptions options;
  if (format == "urdf") {
    options.base = BaseKind::kFloating;
    options.pd = PdGains{100, 2};
    options.ground = true;
  }
  Mutator mutator(seed);
  const std::string name = "child" + std::to_string(seed) + (format == "urdf" ? ".urdf" : ".xml");
  for (int i = 0; i < count; ++i) Read(name, mutator.Change(corpus), options, counts);
}

TEST(ThroughTheChild, EveryFileIsReadOrRefusedInTime) {
  const int quarter = NumFiles() / 4;
  for (const char* format : {"mjcf", "urdf"}) {
    Counts counts;
    std::thread other([&] { ReadEverySecond(format, 2, quarter, counts); });
    ReadEverySecond(format, 1, quarter, counts);
    other.join();
    std::printf("%s: %d files read, %d refused, %d crashed their reader, %d took longer than %g s\n", format,
                counts.read.load(), counts.refused.load(), counts.crashed.load(), counts.late.load(),
                kMaxTime);
    EXPECT_GT(counts.read, quarter / 10);
  }
}

// Addresses that children may take while it lives; on this machine half of the memory may be a lot.
class AddressLimit {
 public:
  explicit AddressLimit(rlim_t bytes) {
    getrlimit(RLIMIT_AS, &before_);
    const rlimit limit{std::min(bytes, before_.rlim_max), before_.rlim_max};
    setrlimit(RLIMIT_AS, &limit);
  }
  ~AddressLimit() { setrlimit(RLIMIT_AS, &before_); }
  AddressLimit(const AddressLimit&) = delete;
  AddressLimit& operator=(const AddressLimit&) = delete;

 private:
  rlimit before_{};
};

TEST(ThroughTheChild, HostileModelsAreRefusedWithTheirFile) {
#ifdef __SANITIZE_ADDRESS__
  GTEST_SKIP() << "the sanitizer takes terabytes of addresses";
#endif
  const AddressLimit limit(rlim_t{4} << 30);
  constexpr double kTime = 1;  // s of a file; those that crash take 0.1
  Counts counts;
  for (const test::HostileModel& model : test::HostileModels()) {
    for (const auto& [name, bytes] : model.beside) WriteScratch(name, bytes);
    for (const std::string& pipe : model.pipes) {
      const std::filesystem::path path = ScratchFolder() + "/" + pipe;
      std::filesystem::create_directories(path.parent_path());
      mkfifo(path.c_str(), 0600);
    }
    const std::string said = ReadFile(WriteScratch(model.name, model.text), {}, kTime, counts);
    const bool names_file =
        said.find(model.name) != std::string::npos ||
        (!model.beside.empty() && said.find(model.beside.front().first) != std::string::npos);
    EXPECT_TRUE(names_file) << model.name << ": " << said;
  }
  EXPECT_GE(counts.crashed, 2);
  // And what changes of those make that MuJoCo's compiler builds.
  std::vector<std::string> corpus;
  for (const test::HostileModel& model : test::HostileModels())
    if (model.text.find("builtin") != std::string::npos) corpus.push_back(model.text);
  Mutator mutator(3);
  for (int i = 0; i < 40; ++i)
    ReadFile(WriteScratch("hostile.xml", mutator.Change(corpus)), {}, kTime, counts);
  std::printf("hostile: %d files read, %d refused, %d crashed their reader, %d took longer than %g s\n",
              counts.read.load(), counts.refused.load(), counts.crashed.load(), counts.late.load(), kTime);
}

}  // namespace
}  // namespace fork1s::fuzz
