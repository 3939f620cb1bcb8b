#include <fork1s/mechanism/mechanism.hpp>
#include <fork1s/sim/randomisation.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <utility>

#include "base/fnv1a.hpp"
#include "sim/vary.hpp"

namespace fork1s {
namespace {

constexpr std::array kAxes{".x", ".y", ".z", ".rx", ".ry", ".rz"};

// 0 to 1 from the upper 53 bits: std::uniform_real_distribution may differ between libraries, this cannot.
double Unit(std::mt19937_64& bits) { return static_cast<double>(bits() >> 11) * 0x1p-53; }

double Factor(std::mt19937_64& bits, const DrawRange& range) {
  const double at = Unit(bits);
  return range.low == range.high ? range.low : range.low * std::exp(at * std::log(range.high / range.low));
}

std::string NamesAll(const Simulation& simulation) {
  std::string all;
  for (const std::string& name : simulation.CoordinateNames()) all += (all.empty() ? "" : ", ") + name;
  const Scene& scene = simulation.scene();
  const auto add = [&](const std::string& body) {
    all += (all.empty() ? "" : ", ") + body + ".x to " + body + ".rz";
  };
  for (const MechanismDef& def : scene.mechanisms)
    if (def.base != BaseKind::kFixed) add(def.bodies[0].name);
  for (const FreeBodyDef& def : scene.free_bodies) add(def.name);
  return all;
}

// A number added to one of x, y, z, rx, ry, rz of a pose, world axes.
void Shift(RigidTransform& X, int axis, double by) {
  const Vector3 along = Vector3::Unit(axis % 3) * by;
  X = axis < 3 ? RigidTransform(X.rotation(), Vector3(X.translation() + along))
               : RigidTransform(Matrix3(ExpRotation(along) * X.rotation()), X.translation());
}

}  // namespace

Randomisation UsualRandomisation() { return {{0.7, 1.4}, {0.7, 1.3}, {0.8, 1.25}, {}}; }

Drawn Draw(const Randomisation& randomisation, std::uint64_t seed, std::uint64_t time) {
  const auto low = [](std::uint64_t word) { return static_cast<std::uint32_t>(word); };
  std::seed_seq words{low(seed), low(seed >> 32), low(time), low(time >> 32)};
  std::mt19937_64 bits(words);
  std::vector<DrawRange> of_factors = {randomisation.stiffness, randomisation.friction, randomisation.mass};
  for (const FactorRange& named : randomisation.named) of_factors.push_back(named.range);
  for (const DrawRange& range : of_factors)
    FORK1S_REQUIRE(0 < range.low && range.low <= range.high && std::isfinite(range.high), "a range",
                   range.low, "to", range.high, "of a factor; give low above 0 and high from there on");
  Drawn drawn;
  drawn.factors.stiffness = Factor(bits, randomisation.stiffness);
  drawn.factors.friction = Factor(bits, randomisation.friction);
  drawn.factors.mass = Factor(bits, randomisation.mass);
  drawn.start.resize(static_cast<Eigen::Index>(randomisation.start.size()));
  for (std::size_t i = 0; i < randomisation.start.size(); ++i) {
    const DrawRange& range = randomisation.start[i].range;
    FORK1S_REQUIRE(std::isfinite(range.low) && range.low <= range.high && std::isfinite(range.high),
                   "a range", range.low, "to", range.high,
                   "of '" + randomisation.start[i].coordinate + "'; give low, then high");
    drawn.start(static_cast<Eigen::Index>(i)) = range.low + (range.high - range.low) * Unit(bits);
  }
  for (const auto& [key, range] : randomisation.named) {
    std::seed_seq own_words{low(seed),       low(seed >> 32), low(time),
                            low(time >> 32), low(Fnv1a(key)), low(Fnv1a(key) >> 32)};
    std::mt19937_64 own(own_words);
    SetFactor(key, Factor(own, range), drawn.factors);
  }
  return drawn;
}

std::uint64_t SeedOf(std::uint64_t seed, std::uint64_t i) {
  // SplitMix64, twice: once for the seed, so that the members of seed 1 are not those of seed 0, moved by
  // one.
  const auto mixed = [](std::uint64_t z) {
    z += 0x9e3779b97f4a7c15;
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9;
    z = (z ^ (z >> 27)) * 0x94d049bb133111eb;
    return z ^ (z >> 31);
  };
  return mixed(mixed(seed) + i * 0x9e3779b97f4a7c15);
}

Expected<Starts::Place> Starts::Find(const Simulation& simulation, const std::string& coordinate) {
  const Scene& scene = simulation.scene();
  const std::string where = "start of '" + coordinate + "'";
  for (std::size_t a = 0; a < kAxes.size(); ++a) {
    if (!coordinate.ends_with(kAxes[a])) continue;
    const std::string body = coordinate.substr(0, coordinate.rfind('.'));
    for (std::size_t i = 0; i < scene.mechanisms.size(); ++i)
      if (scene.mechanisms[i].bodies[0].name == body && scene.mechanisms[i].base != BaseKind::kFixed)
        return Place{Kind::kBase, i, static_cast<int>(a)};
    for (std::size_t i = 0; i < scene.free_bodies.size(); ++i)
      if (scene.free_bodies[i].name == body) return Place{Kind::kFreeBody, i, static_cast<int>(a)};
  }
  for (std::size_t i = 0; i < scene.mechanisms.size(); ++i) {
    const MechanismDef& def = scene.mechanisms[i];
    const auto built = BuildMechanism(def);
    if (!built) return tl::unexpected(built.error());
    for (int c = 0; c < built->num_coordinates(); ++c) {
      if (built->CoordinateName(c) != coordinate) continue;
      if (!def.closures.empty() || !def.couplings.empty())
        return Fail(
            ErrorCode::kUsage, where,
            "is of a mechanism with closed loops or couplings, which would not fit; draw where a base "
            "or a free body starts instead");
      return Place{Kind::kJoint, i, c};
    }
  }
  return Fail(ErrorCode::kUsage, where, "is no coordinate; there are: " + NamesAll(simulation));
}

Expected<Starts> Starts::Create(Scene scene, const SimulationOptions& options,
                                std::vector<StartRange> start) {
  Starts starts;
  starts.scene_ = std::move(scene);
  starts.options_ = options;
  if (start.empty()) return starts;
  auto first = Simulation::Create(starts.scene_, options);
  if (!first) return tl::unexpected(first.error());
  for (const StartRange& s : start) {
    auto place = Find(*first, s.coordinate);
    if (!place) return tl::unexpected(place.error());
    starts.places_.push_back(*place);
  }
  starts.key_ = first->State();
  starts.key_.name = "drawn";
  return starts;
}

Expected<Simulation> Starts::Begin(const Drawn& drawn) const {
  FORK1S_REQUIRE(drawn.start.size() == num_coordinates(), drawn.start.size(), num_coordinates());
  if (auto known = CheckFactors(scene_, drawn.factors); !known) return tl::unexpected(known.error());
  Scene scene = internal::VaryChecked(scene_, drawn.factors);
  if (places_.empty()) return Simulation::Create(std::move(scene), options_);
  KeyframeDef key = key_;
  for (std::size_t i = 0; i < places_.size(); ++i) {
    const auto& [kind, index, axis] = places_[i];
    const double by = drawn.start(static_cast<Eigen::Index>(i));
    switch (kind) {
      case Kind::kJoint:
        key.mechanisms[index].q(axis) += by;
        break;
      case Kind::kBase:
        Shift(key.mechanisms[index].X_WR, axis, by);
        break;
      case Kind::kFreeBody:
        Shift(key.free_bodies[index].X_WB, axis, by);
        break;
    }
  }
  scene.keyframes.push_back(std::move(key));
  SimulationOptions options = options_;
  options.initial_keyframe = static_cast<int>(scene.keyframes.size()) - 1;
  return Simulation::Create(std::move(scene), options);
}

}  // namespace fork1s
