#include "importer/loop_moves.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fork1s/mechanism/kinematics.hpp>

#include "names.hpp"

namespace fork1s::internal {
namespace {

// Closes loops and couplings with the asked coordinates held. It walks there in small steps, so that the
// linkage stays on the branch on which it starts.
std::optional<Error> MoveLoops(const MechanismDef& definition, const std::vector<WantedCoordinate>& asked,
                               const std::string& where, VectorX& q) {
  auto built = BuildMechanism(definition);
  if (!built) return built.error();
  CloseLoops(*built, q);
  MechanismDef held = definition;
  VectorX from(static_cast<Eigen::Index>(asked.size()));
  double farthest = 0;
  std::vector<std::string> names;
  for (std::size_t i = 0; i < asked.size(); ++i) {
    CouplingDef lock;
    lock.name = fmt::format("q {}", asked[i].joint);
    lock.a = asked[i].freedom;
    held.couplings.push_back(lock);
    from[static_cast<Eigen::Index>(i)] = q[CoordinateOf(definition, asked[i].freedom)];
    farthest = std::max(farthest, std::abs(asked[i].displacement - from[static_cast<Eigen::Index>(i)]));
    names.push_back(asked[i].joint);
  }
  constexpr double kStep = 0.1;  // rad or m
  constexpr int kMostSteps = 100;
  const int steps = std::clamp(static_cast<int>(std::ceil(std::min(farthest / kStep, 1e6))), 1, kMostSteps);
  const std::size_t first = held.couplings.size() - asked.size();
  double gap = 0;
  for (int step = 1; step <= steps; ++step) {
    for (std::size_t i = 0; i < asked.size(); ++i) {
      const double start = from[static_cast<Eigen::Index>(i)], share = static_cast<double>(step) / steps;
      double* polynomial = held.couplings[first + i].polynomial;
      std::fill(polynomial, polynomial + 5, 0.0);
      polynomial[0] = step == steps ? asked[i].displacement : start + share * (asked[i].displacement - start);
    }
    auto locked = BuildMechanism(held);
    if (!locked) return locked.error();
    gap = CloseLoops(*locked, q);
  }
  // The bound of every simulator here: a loop that cannot be closed to a micrometre is no loop of rigid
  // parts.
  if (gap <= 1e-6) return std::nullopt;
  return Error{
      ErrorCode::kUsage, where,
      fmt::format("the loops and couplings of mechanism '{}' stay open by {:.2g} m with {} where {} asked; "
                  "ask fewer joints, so that the others can follow, or smaller values",
                  definition.name, gap, Quoted(names), names.size() == 1 ? "it is" : "they are")};
}

}  // namespace

int CoordinateOf(const MechanismDef& mechanism, const FreedomRef& ref) {
  int at = ref.freedom;
  for (std::size_t j = 0; j < ref.joint.u(); ++j) at += static_cast<int>(mechanism.joints[j].freedoms.size());
  return at;
}

std::optional<Error> MoveCoordinates(const MechanismDef& mechanism,
                                     const std::vector<WantedCoordinate>& wanted, const std::string& where,
                                     VectorX& q) {
  if (wanted.empty()) return std::nullopt;
  if (!mechanism.closures.empty() || !mechanism.couplings.empty()) {
    if (auto error = MoveLoops(mechanism, wanted, where, q)) return error;
  }
  for (const WantedCoordinate& one : wanted) q[CoordinateOf(mechanism, one.freedom)] = one.displacement;
  return std::nullopt;
}

}  // namespace fork1s::internal
