#include "random_linkage.hpp"

#include <algorithm>
#include <cmath>

#include "families.hpp"

namespace fork1s::linkages {
namespace {

Sketch Family(RandomSource& random) {
  switch (random.Below(12)) {
    case 0:
    case 1:
    case 2:
      return PlanarLinkage(random, 1 + random.Below(2));
    case 3:
      return PlanarLinkage(random, 3 + random.Below(2));
    case 4:
      return SphericalLinkage(random, 1 + random.Below(2));
    case 5:
      return SphericalLinkage(random, 1 + random.Below(3));
    case 6:
      return ParallelogramLinkage(random, 1 + random.Below(2));
    case 7:
      return BennettLinkage(random);
    case 8:
      return SarrusLinkage(random);
    case 9:
      return SpatialLinkage(random, 1);
    case 10:
      return SpatialLinkage(random, 2 + random.Below(2));
    default:
      return PlatformLinkage(random, 2 + random.Below(3));
  }
}

// Six orders of magnitude, around 1 N·m/rad and 1 N/m at unit size.
double Stiffness(RandomSource& random) { return std::pow(10, random.Uniform(-3, 3)); }

void AddSprings(RandomSource& random, Sketch& s) {
  constexpr double kShares[] = {1, 1, 0.7, 0.7, 0.4, 0.4, 0.15, 0.15};
  const double share = kShares[random.Below(8)];
  const bool narrow = random.Chance(0.3);  // all springs alike
  for (Pair& p : s.pairs) {
    const double turn = narrow ? random.Uniform(1, 3) : Stiffness(random),
                 slide = narrow ? random.Uniform(1, 3) : Stiffness(random);
    if (random.Chance(share)) p.k_turn = turn;
    if (random.Chance(share)) p.k_slide = slide;
    if (random.Chance(0.2)) p.armature = {random.Uniform(0, 0.05)};
  }
}

std::vector<int> SingleFreedoms(const Sketch& s, const std::vector<int>& joints) {
  std::vector<int> pairs;
  for (int k : joints) {
    const PairKind kind = s.pairs[static_cast<std::size_t>(k)].kind;
    if (kind == PairKind::kHinge || kind == PairKind::kSlide) pairs.push_back(k);
  }
  return pairs;
}

// Pairs that the plain way of writing makes joints of.
std::vector<int> JointPairs(const Sketch& s) {
  const MechanismDef def = Write(s, {.keep_order = true});
  std::vector<int> pairs;
  for (const JointDef& j : def.joints) pairs.push_back(std::stoi(j.name.substr(1)));
  return pairs;
}

void AddConnections(RandomSource& random, Sketch& s) {
  std::vector<int> free = SingleFreedoms(s, JointPairs(s));
  for (std::size_t i = free.size(); i > 1; --i)
    std::swap(free[i - 1], free[static_cast<std::size_t>(random.Below(static_cast<int>(i)))]);
  auto coefficient = [&] { return (random.Chance(0.5) ? -1 : 1) * random.Uniform(0.2, 1.5); };
  if (free.size() >= 2 && random.Chance(0.3)) {
    Tendon t;
    for (std::size_t i = 0;
         i < std::min<std::size_t>(free.size(), 2 + static_cast<std::size_t>(random.Below(3))); ++i)
      t.terms.push_back({free[i], coefficient()});
    t.stiffness = Stiffness(random);
    for (const TendonTerm& term : t.terms) s.pairs[static_cast<std::size_t>(term.pair)].in_tree = true;
    s.tendons.push_back(std::move(t));
  }
  if (free.size() >= 4 && random.Chance(0.25)) {
    const GearPair g{free[free.size() - 1], free[free.size() - 2], coefficient(), random.Uniform(-0.3, 0.3)};
    s.pairs[static_cast<std::size_t>(g.a)].in_tree = s.pairs[static_cast<std::size_t>(g.b)].in_tree = true;
    s.gears.push_back(g);
  }
}

void AddBushing(RandomSource& random, Sketch& s) {
  const int n = static_cast<int>(s.X.size());
  const int a = random.Below(n), b = (a + 1 + random.Below(n - 1)) % n;
  Pair& p = s.AddPair(a, b, PairKind::kBushing, random.InBox(1), random.Pose(1).rotation());
  p.bushing = 1u + static_cast<unsigned>(random.Below(63));
  p.k_turn = Stiffness(random);
  p.k_slide = Stiffness(random);
}

}  // namespace

Sketch RandomLinkage(unsigned seed) {
  RandomSource random(seed);
  Sketch s = Family(random);
  while (random.Chance(0.25)) HangBody(random, s);
  AddSprings(random, s);
  if (random.Chance(0.2)) AddBushing(random, s);
  AddConnections(random, s);
  const int bodies = static_cast<int>(s.X.size()) - 1;
  const int wanted = std::min(bodies, 1 + random.Below(3));
  while (static_cast<int>(s.interfaces.size()) < wanted) {
    const int b = 1 + random.Below(bodies);
    if (std::find(s.interfaces.begin(), s.interfaces.end(), b) == s.interfaces.end())
      s.interfaces.push_back(b);
  }
  // The root: near in half of them, up to 100 sizes away in the rest.
  const double reach = random.Chance(0.5) ? 1 : std::pow(10, random.Uniform(0, 2));
  s = WithRoot(std::move(s), RigidTransform(random.Pose(1).rotation(), reach * random.Direction()));
  s = Moved(std::move(s), random.Pose(1));
  return Scaled(std::move(s), std::pow(10, random.Uniform(-3, 1)));
}

std::vector<double> RandomNumbers(unsigned seed, int count) {
  RandomSource random(seed);
  std::vector<double> numbers;
  for (int i = 0; i < count; ++i) numbers.push_back(random.Uniform(0, 1));
  return numbers;
}

RigidTransform RandomPose(unsigned seed, double reach) {
  RandomSource random(seed ^ 0x9e3779b9u);
  return random.Pose(reach);
}

}  // namespace fork1s::linkages
