// Every fuzz target on its corpus and on a fixed number of seeded changes of it: what `./check` can afford.
// Hours of it, with sanitizers and with a search for new branches, are tools/fuzz.sh.
#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>
#include <chrono>
#include <csignal>
#include <cstdlib>
#include <fork1s/record/recording.hpp>
#include <fstream>

#include "corpus.hpp"
#include "foreign_leaks.hpp"
#include "fuzz.hpp"
#include "mutate.hpp"

namespace fork1s::fuzz {
namespace {

// The input under way, for a signal handler.
std::string current_input, current_file;
double slowest = 0;  // s

extern "C" void KeepInput(int signal) {
  const int file = open(current_file.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644);
  if (file >= 0 && write(file, current_input.data(), current_input.size()) >= 0) {
    constexpr char kSaid[] = "fuzz: the input that ended the program is kept in ";
    if (write(2, kSaid, sizeof kSaid - 1) < 0 || write(2, current_file.data(), current_file.size()) < 0 ||
        write(2, "\n", 1) < 0)
      _exit(1);
  }
  std::signal(signal, SIG_DFL);
  raise(signal);
}

void Try(const Registered& target, const std::string& input) {
  current_input = input;
  alarm(120);  // an input that never ends is kept, too
  const auto started = std::chrono::steady_clock::now();
  try {
    target.target({reinterpret_cast<const std::uint8_t*>(input.data()), input.size()});
  } catch (const std::exception& e) {
    std::ofstream(current_file, std::ios::binary | std::ios::trunc) << input;
    ADD_FAILURE() << target.name << ": " << e.what() << "; the input is kept in " << current_file;
  }
  alarm(0);
  const double took = std::chrono::duration<double>(std::chrono::steady_clock::now() - started).count();
  if (took > slowest) {
    slowest = took;
    std::ofstream(current_file + "_slowest", std::ios::binary | std::ios::trunc) << input;
  }
}

class Fuzzed : public testing::TestWithParam<Registered> {};

TEST_P(Fuzzed, CorpusAndChangesOfIt) {
  const Registered& target = GetParam();
  current_file = testing::TempDir() + "fuzz_input_" + target.name;
  for (int signal : {SIGSEGV, SIGABRT, SIGFPE, SIGBUS, SIGILL, SIGALRM}) std::signal(signal, KeepInput);
  slowest = 0;
  Stepped() = 0;
  const std::vector<std::string> corpus = Corpus(target.name);
  ASSERT_FALSE(corpus.empty());
  for (const std::string& input : corpus) Try(target, input);
  Try(target, "");
  // FORK1S_FUZZ_SEED and FORK1S_FUZZ_TIMES draw others, and more.
  const char* seed = std::getenv("FORK1S_FUZZ_SEED");
  const char* times = std::getenv("FORK1S_FUZZ_TIMES");
  Mutator mutator(seed != nullptr ? static_cast<unsigned>(std::atoi(seed)) : 1u);
  const int count = target.mutations * (times != nullptr ? std::atoi(times) : 1);
  for (int i = 0; i < count && !testing::Test::HasFailure(); ++i) Try(target, mutator.Change(corpus));
  std::printf(
      "%s: %zu inputs of the corpus, %d changed ones, %ld of them stepped; the slowest took %.0f ms "
      "(%s_slowest)\n",
      target.name, corpus.size(), count, Stepped(), 1000 * slowest, current_file.c_str());
}

std::vector<Registered> SortedTargets() {
  DisableHdf5Cleanup();
  std::vector<Registered> targets = Targets();
  std::sort(targets.begin(), targets.end(),
            [](const Registered& a, const Registered& b) { return std::string_view(a.name) < b.name; });
  return targets;
}

INSTANTIATE_TEST_SUITE_P(All, Fuzzed, testing::ValuesIn(SortedTargets()),
                         [](const auto& chosen) { return std::string(chosen.param.name); });

}  // namespace
}  // namespace fork1s::fuzz
