// Domain randomisation: what differs between simulations of one scene, drawn from a seed for each.
#pragma once

#include <cstdint>
#include <fork1s/sim/scene_factors.hpp>
#include <fork1s/sim/simulation.hpp>
#include <string>
#include <vector>

namespace fork1s {

struct DrawRange {
  double low = 1, high = 1;
};

/// Where a coordinate starts, relative to where the scene has it: a joint coordinate by its name (rad or m),
/// or of a free body or a base that moves NAME.x .y .z (m) and .rx .ry .rz (rotation vector, rad), world
/// axes.
struct StartRange {
  std::string coordinate;
  DrawRange range{0, 0};
};

/// A factor of SceneFactors::named.
struct FactorRange {
  std::string key;
  DrawRange range;
};

struct Randomisation {
  // Factors, of equal likelihood in their logarithm: as likely to be halved as to be doubled.
  DrawRange stiffness, friction, mass;
  std::vector<StartRange> start;        // of equal likelihood
  std::vector<FactorRange> named = {};  // as stiffness, friction, mass
};

/// Ranges in which a policy that is trained in simulation should still work: stiffness 0.7 to 1.4, friction
/// 0.7 to 1.3, mass 0.8 to 1.25.
Randomisation UsualRandomisation();

struct Drawn {
  SceneFactors factors;
  VectorX start;  // in the order of Randomisation::start
};

/// The same numbers for the same seed and time, on any machine up to the last digit of exp and log. `time`:
/// how often this one has begun before. A range more changes no number that others have drawn but those of
/// start after it; what a named one draws depends on its key, the seed and the time alone. Throws std::invalid_argument for ranges that are not finite or not ordered, factors of 0
/// or less.
Drawn Draw(const Randomisation& randomisation, std::uint64_t seed, std::uint64_t time = 0);

/// A seed for the i-th of many, from one for all; seeds next to each other give nothing alike.
std::uint64_t SeedOf(std::uint64_t seed, std::uint64_t i);

/// Begins simulations of one scene that differ by what was drawn.
class Starts {
 public:
  /// Errors: those of Simulation::Create; kUsage for coordinates that there are not, and for joints of a
  /// mechanism with closed loops or couplings, which would be open.
  static Expected<Starts> Create(Scene scene, const SimulationOptions& options,
                                 std::vector<StartRange> start = {});
  /// As Simulation::Create of the scene with these factors; kUsage as CheckFactors. May be called on several threads.
  Expected<Simulation> Begin(const Drawn& drawn) const;
  /// Number of coordinates that are drawn.
  Eigen::Index num_coordinates() const { return static_cast<Eigen::Index>(places_.size()); }

 private:
  enum class Kind { kJoint, kBase, kFreeBody };
  struct Place {
    Kind kind = Kind::kJoint;
    std::size_t index = 0;  // of the mechanism or free body
    int axis = 0;           // coordinate of the mechanism; x, y, z, rx, ry, rz
  };
  static Expected<Place> Find(const Simulation& simulation, const std::string& coordinate);

  Scene scene_;
  SimulationOptions options_;
  KeyframeDef key_;
  std::vector<Place> places_;
};

}  // namespace fork1s
