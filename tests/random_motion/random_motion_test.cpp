// What must hold for every mechanism in motion by the two-stage step, tried on random ones.
//
// Others, and more: FORK1S_MOTION_SEED=5000 FORK1S_MOTION_COUNT=3000. One of them, step by step:
// FORK1S_MOTION_SEED=17 FORK1S_MOTION_COUNT=1 FORK1S_MOTION_TRACE=1. To find a cause:
// FORK1S_MOTION_WITHOUT=limits,servos without these features, FORK1S_MOTION_BODIES=2 with at most two moving
// bodies, FORK1S_MOTION_REFINED=4 with a quarter of the step. FORK1S_MOTION_ALL=1 without the exceptions of
// KnownFaults, FORK1S_MOTION_LIST=99 names more of those that fail.
#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <cstdlib>
#include <draws.hpp>
#include <functional>
#include <iostream>
#include <limits>
#include <map>
#include <set>
#include <sstream>

#include "random_motion.hpp"

namespace fork1s::random_motion {
namespace {

constexpr unsigned kFirst = 0;
#ifdef __SANITIZE_ADDRESS__
constexpr int kCount = 100;
#else
const int kCount = static_cast<int>(testing::Seeds(250, 1000));
#endif

const char* Variable(const char* name) { return std::getenv(name); }

int Number(const char* name, int otherwise) {
  const char* text = Variable(name);
  return text != nullptr ? std::atoi(text) : otherwise;
}

// What is left out for faults that are known and open, each with a seed that shows it. FORK1S_MOTION_ALL=1
// leaves nothing out.
struct KnownFaults {
  const bool open = Variable("FORK1S_MOTION_ALL") == nullptr;
  // The coordinates of a free joint are singular at a full turn: what acts on them then gains energy (505,
  // 912).
  double max_rotation_vector = open ? 1.75 * M_PI : std::numeric_limits<double>::infinity();
  // Newton's method does not solve even 1/64 of a step with artificial damping. Such steps are undone and reported.
  std::set<unsigned> undone_seeds = open ? std::set<unsigned>{177, 584} : std::set<unsigned>();
  // Energy that jumps at a relinearization with stiff tendons over a free joint.
  std::set<unsigned> energy_seeds = open ? std::set<unsigned>{272} : std::set<unsigned>();
  // What turns by more than this a step [rad] passes the floor (233, 576).
  double max_turn_near_floor = open ? 1 : std::numeric_limits<double>::infinity();
};

GeneratorOptions Range() {
  GeneratorOptions options;
  options.max_bodies = Number("FORK1S_MOTION_BODIES", options.max_bodies);
  options.base = Number("FORK1S_MOTION_BASE", options.base);
  const std::map<std::string, bool*> features = {
      {"closures", &options.closures},    {"couplings", &options.couplings},
      {"tendons", &options.tendons},      {"nonlinear_tendons", &options.nonlinear_tendons},
      {"dampers", &options.dampers},      {"armatures", &options.armatures},
      {"limits", &options.limits},        {"frictions", &options.frictions},
      {"servos", &options.servos},        {"bounds", &options.bounds},
      {"gravity", &options.gravity},      {"spin", &options.spin},
      {"floor", &options.floor},          {"free_bodies", &options.free_bodies},
      {"pushes", &options.pushes},        {"set_point_jumps", &options.set_point_jumps},
      {"base_jumps", &options.base_jumps}};
  if (const char* without = Variable("FORK1S_MOTION_WITHOUT")) {
    std::istringstream words(without);
    for (std::string word; std::getline(words, word, ',');) *features.at(word) = false;
  }
  return options;
}

const std::vector<Result>& AllResults() {
  static const std::vector<Result> results = [] {
    const auto started = std::chrono::steady_clock::now();
    const int first = Number("FORK1S_MOTION_SEED", kFirst), count = Number("FORK1S_MOTION_COUNT", kCount);
    const bool trace = Variable("FORK1S_MOTION_TRACE") != nullptr;
    const int refined = Number("FORK1S_MOTION_REFINED", 1);
    const GeneratorOptions range = Range();
    std::vector<Result> all;
    for (int i = 0; i < count; ++i)
      all.push_back(Simulate(Refined(DrawCase(static_cast<unsigned>(first + i), range), refined), trace));
    const std::chrono::duration<double> took = std::chrono::steady_clock::now() - started;
    int undone = 0, unconverged = 0, halved = 0, contacts = 0;
    for (const Result& r : all) {
      undone += r.undone;
      unconverged += r.unconverged;
      halved += r.halved;
      contacts += r.contacts;
    }
    std::cout << count << " mechanisms in " << took.count() << " s; steps in contact " << contacts
              << ", halved " << halved << ", undone " << undone << ", unconverged " << unconverged << '\n';
    return all;
  }();
  return results;
}

// Checks `holds` on those that `concerns`; names those that fail.
void ExpectOfEach(const std::function<bool(const Result&)>& concerns,
                  const std::function<bool(const Result&)>& holds,
                  const std::function<std::string(const Result&)>& found) {
  int concerned = 0, failed = 0;
  const int most = Number("FORK1S_MOTION_LIST", 20);
  std::ostringstream text;
  for (const Result& r : AllResults()) {
    if (!r.refusal.empty() || !concerns(r)) continue;
    ++concerned;
    if (holds(r)) continue;
    if (++failed <= most) text << "  seed " << r.seed << ": " << found(r) << " (" << r.description << ")\n";
  }
  if (failed > most) text << "  ...\n";
  EXPECT_EQ(failed, 0) << "of " << concerned
                       << " mechanisms; replay by FORK1S_MOTION_SEED, see the head of this file\n"
                       << text.str();
}

template <class... T>
std::string Text(const T&... values) {
  std::ostringstream out;
  ((out << values << ' '), ...);
  return out.str();
}

bool All(const Result&) { return true; }

TEST(RandomMotion, MechanismsAreAccepted) {
  int refused = 0;
  std::ostringstream text;
  for (const Result& r : AllResults())
    if (!r.refusal.empty() && ++refused <= 10)
      text << "  seed " << r.seed << ": " << r.refusal << " (" << r.description << ")\n";
  EXPECT_LE(refused, AllResults().size() / 20) << text.str();
}

TEST(RandomMotion, EverythingIsFinite) {
  ExpectOfEach(
      All, [](const Result& r) { return r.finite; }, [](const Result&) { return "not finite"; });
}

TEST(RandomMotion, SpeedsAreBounded) {
  ExpectOfEach(
      All, [](const Result& r) { return r.kinetic_ratio < 10; },
      [](const Result& r) {
        return Text("kinetic energy", r.kinetic_ratio, "times what start and inputs explain");
      });
}

TEST(RandomMotion, EnergyDoesNotGrow) {
  const KnownFaults faults;
  ExpectOfEach(
      [&](const Result& r) {
        return r.has_energy_bound && r.largest_rotation_vector < faults.max_rotation_vector &&
               faults.energy_seeds.count(r.seed) == 0;
      },
      [](const Result& r) { return r.energy_excess <= r.energy_allowed; },
      [](const Result& r) {
        return Text("energy above the start by", r.energy_excess, "of the kinetic energy, allowed",
                    r.energy_allowed, "in step", r.energy_step, "turn a step", r.largest_turn);
      });
}

TEST(RandomMotion, LinearMomentumIsExact) {
  ExpectOfEach([](const Result& r) { return r.has_momentum; },
               [](const Result& r) { return r.linear_error < 1e-9; },
               [](const Result& r) { return Text("off by", r.linear_error); });
}

TEST(RandomMotion, AngularMomentumIsExact) {
  ExpectOfEach([](const Result& r) { return r.has_momentum; },
               [](const Result& r) { return r.angular_error < 1e-9; },
               [](const Result& r) { return Text("off by", r.angular_error); });
}

TEST(RandomMotion, ReportsAreConsistent) {
  ExpectOfEach(
      All, [](const Result& r) { return r.report_fault.empty(); },
      [](const Result& r) { return r.report_fault; });
}

TEST(RandomMotion, NoStepIsUndone) {
  const KnownFaults faults;
  ExpectOfEach([&](const Result& r) { return faults.undone_seeds.count(r.seed) == 0; },
               [](const Result& r) { return r.undone == 0; },
               [](const Result& r) { return Text(r.undone, "steps undone, first of", r.undone_of); });
}

TEST(RandomMotion, NothingPassesThroughTheFloor) {
  const KnownFaults faults;
  ExpectOfEach([&](const Result& r) { return r.largest_turn < faults.max_turn_near_floor; },
               [](const Result& r) { return r.passage < 1; },
               [](const Result& r) { return Text("deep by", r.passage, "of its size"); });
}

}  // namespace
}  // namespace fork1s::random_motion
