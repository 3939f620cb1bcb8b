// What every fuzz target shares: how it is declared, how it says that something is wrong, and how it reads
// numbers out of an input.
//
// A target takes any bytes and must come back: with an answer or with a named error. It must not crash, hang
// or let an exception out. The same file is built twice: with clang's libFuzzer and sanitizers by
// tools/fuzz.sh, one program a target, and into test_fuzz, which replays corpus/TARGET and mutates it a fixed
// number of times (driver_test.cpp).
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fork1s/base/error.hpp>
#include <fork1s/base/types.hpp>
#include <fork1s/sim/simulation.hpp>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

namespace fork1s::fuzz {

using Input = std::span<const std::uint8_t>;
using Target = void (*)(Input);

struct Registered {
  const char* name;
  Target target;
  int mutations;  // of test_fuzz: about a second of them
};
/// All targets of test_fuzz.
inline std::vector<Registered>& Targets() {
  static std::vector<Registered> targets;
  return targets;
}
struct Registration {
  Registration(const char* name, Target target, int mutations) {
    Targets().push_back({name, target, mutations});
  }
};

#ifdef FORK1S_LIBFUZZER
#define FORK1S_FUZZ_TARGET(name, mutations)                                           \
  static void Fuzz_##name(fork1s::fuzz::Input input);                                 \
  extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);  \
  extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) { \
    Fuzz_##name({data, size});                                                        \
    return 0;                                                                         \
  }                                                                                   \
  static void Fuzz_##name(fork1s::fuzz::Input input)
#else
#define FORK1S_FUZZ_TARGET(name, mutations)                                                      \
  static void Fuzz_##name(fork1s::fuzz::Input input);                                            \
  static const fork1s::fuzz::Registration registration_of_##name(#name, Fuzz_##name, mutations); \
  static void Fuzz_##name(fork1s::fuzz::Input input)
#endif

/// Lets an exception out where a promise is broken, which both drivers report with the input.
inline void Demand(bool kept, const std::string& promise) {
  if (!kept) throw std::logic_error("broken promise: " + promise);
}

/// An error must say where and what. FORK1S_FUZZ_SAY=1 shows them, for whoever wants a corpus to get farther.
inline void DemandNamed(const Error& error) {
  static const bool say = std::getenv("FORK1S_FUZZ_SAY") != nullptr;
  if (say) std::fprintf(stderr, "refused: %s\n", error.Text().c_str());
  Demand(!error.message.empty(), "an error has a message");
  Demand(!error.where.empty(), "an error says where: " + error.message);
}

inline std::string_view Text(Input input) {
  return {reinterpret_cast<const char*>(input.data()), input.size()};
}

/// Structure out of bytes; after the last of them everything is zero.
class Source {
 public:
  explicit Source(Input input) : rest_(input) {}
  bool empty() const { return rest_.empty(); }
  std::uint8_t Byte() {
    if (rest_.empty()) return 0;
    const std::uint8_t b = rest_.front();
    rest_ = rest_.subspan(1);
    return b;
  }
  int Below(int count) { return Byte() % count; }
  bool Flag() { return Byte() & 1; }
  std::uint32_t Word() {
    std::uint32_t w = 0;
    for (int i = 0; i < 4; ++i) w = w << 8 | Byte();
    return w;
  }
  /// Within [-8, 8], in steps that are no powers of two; now and then a number at an edge, unless it shall be
  /// tame.
  double Real(bool tame) {
    static constexpr double kEdges[] = {0,      -0.0, 1e-300, 1e-18, 1e-9, 1e9,      1e18, 1e300,
                                        -1e300, 1,    -1,     1e-6,  1e6,  INFINITY, NAN,  5e-324};
    const std::uint8_t kind = Byte();
    if (!tame && kind >= 224) return kEdges[kind % 16];
    const int high = Byte();
    return (high * 256 + Byte() - 32768) / 4097.0;
  }
  Input Rest() const { return rest_; }

 private:
  Input rest_;
};

/// How many inputs came to be stepped.
inline long& Stepped() {
  static long count = 0;
  return count;
}

/// A few steps of a scene: what a step reports to be finite is finite, and what is not leaves the state
/// finite. Scenes so large that a step takes long are left out, and so are steps after one that many halvings left unsolved.
inline void Run(const Scene& scene, const SimulationOptions& options, int steps) {
  std::size_t size = scene.free_bodies.size();
  for (const MechanismDef& m : scene.mechanisms)
    size += m.bodies.size() + m.closures.size() + m.springs.size();
  if (size > 60) return;
  auto simulation = Simulation::Create(scene, options);
  if (!simulation) return DemandNamed(simulation.error());
  StepReport report;
  const auto demand_finite = [&](const std::string& when) {
    for (std::size_t b = 0; b < simulation->bodies().size(); ++b) {
      const RigidTransform X = simulation->Pose(static_cast<int>(b));
      Demand(X.translation().allFinite() && X.rotation().allFinite(),
             "poses are finite " + when + ": " + simulation->bodies()[b].name +
                 (report.finite ? "" : ", and the step was undone"));
    }
  };
  demand_finite("before the first step");
  ++Stepped();
  for (int i = 0; i < steps; ++i) {
    const std::uint64_t before = simulation->HashState();
    report = simulation->Step();
    demand_finite("after step " + std::to_string(i + 1));
    if (!report.finite) Demand(simulation->HashState() == before, "a step that is undone leaves every bit");
    if (report.parts >= 32 && !report.IsSolved()) break;  // each further step would take a second
  }
}

}  // namespace fork1s::fuzz
