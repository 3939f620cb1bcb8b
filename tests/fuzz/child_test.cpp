// Changed files of models through the reader in a child process: whatever becomes of the child, the caller gets a
// scene or a sentence, in time.
#include <gtest/gtest.h>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <thread>

#include "corpus.hpp"
#include "files.hpp"
#include "mutate.hpp"
#include "record/child_reader.hpp"

namespace fork1s::fuzz {
namespace {

constexpr double kMaxTime = 20;  // s of a file; most take 0.02

// Files of one run: FORK1S_FUZZ_FILES, else a thousand (fewer where a sanitizer takes most of their time).
int NumFiles() {
  if (const char* count = std::getenv("FORK1S_FUZZ_FILES")) return std::atoi(count);
#ifdef __SANITIZE_ADDRESS__
  return 50;
#else
  return 1000;
#endif
}

struct Counts {
  std::atomic<int> read = 0, refused = 0, crashed = 0, late = 0;
};

// Reads one file and says what became of it.
void Read(const std::string& name, const std::string& text, const ImportOptions& options, Counts& counts) {
  const std::string path = WriteScratch(name, text);
  const auto start = std::chrono::steady_clock::now();
  const auto model =
      ReadInChild({.program = FORK1S_BINARY, .max_time = kMaxTime}, path, options, [] { return false; });
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - start;
  EXPECT_LT(took.count(), 2 * kMaxTime) << text;
  if (model) {
    ++counts.read;
    return;
  }
  const std::string said = model.error().Text();
  EXPECT_FALSE(model.error().message.empty());
  EXPECT_FALSE(model.error().where.empty()) << said << '\n' << text;
  const bool crashed = said.find("brought its reader down") != std::string::npos;
  const bool late = said.find("was not read within") != std::string::npos;
  ++(crashed ? counts.crashed : late ? counts.late : counts.refused);
  if (crashed || late) std::printf("%s\n%s\n", said.c_str(), text.c_str());
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

}  // namespace
}  // namespace fork1s::fuzz
