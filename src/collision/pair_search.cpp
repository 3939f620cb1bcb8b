#include "pair_search.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <fork1s/parallel/parallel_for.hpp>
#include <tuple>

#include "contact_law.hpp"

namespace fork1s::internal {
namespace {

constexpr int kMoversABench = 128;  // some 10 us
constexpr int kPairsABench = 64;    // some 30 us
constexpr int kMostBenches = 32;

// Ranges of as much work as is worth a thread; as many for any number of threads.
int NumBenches(std::size_t items, int a_bench) {
  return std::clamp(static_cast<int>(items) / a_bench, 1, kMostBenches);
}

template <class Act>
void ForBenches(int count, const Act& act) {
  ParallelFor(0, count, 1, [&act](int begin, int end) {
    for (int k = begin; k < end; ++k) act(k);
  });
}

AxisBox BoxOf(const mjModel& m, const mjData& d, int geom) {
  const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> R(d.geom_xmat + 9 * geom);
  const Eigen::Map<const Vector3> p(d.geom_xpos + 3 * geom), middle(m.geom_aabb + 6 * geom),
      half(m.geom_aabb + 6 * geom + 3);
  // The sphere about its middle is sometimes the smaller.
  const double radius = m.geom_rbound[geom];
  const Vector3 at = p + R * middle, reach = R.cwiseAbs() * half;
  return {(at - reach).cwiseMax((p.array() - radius).matrix()),
          (at + reach).cwiseMin((p.array() + radius).matrix())};
}

// Axes of a contact: the normal, and the tangent that the routine names or, where it names none, one near y
// or z. By MuJoCo's functions in mj_collision's order, so that scenes of few pairs and of many give the same
// bits.
Matrix3 FrameOf(const mjPreContact& c) {
  Eigen::Matrix<double, 3, 3, Eigen::RowMajor> frame;
  double *n = frame.data(), *t = n + 3, *b = n + 6, along[3];
  mju_copy3(n, c.normal);
  mju_copy3(t, c.tangent);
  mju_normalize3(n);
  if (mju_dot3(t, t) < 0.25) {
    mju_zero3(t);
    t[std::abs(n[1]) < 0.5 ? 1 : 2] = 1;
  }
  mju_scl3(along, n, mju_dot3(n, t));
  mju_subFrom3(t, along);
  mju_normalize3(t);
  mju_cross(b, n, t);
  return frame;
}

}  // namespace

// Copies of the model and the data for one thread at a time: routines switch options of the first, and take
// scratch from the second.
struct PairSearch::Bench {
  Bench(const mjModel& m, const mjData& d) : model(m), data(d), scratch(mju_malloc(kScratch), mju_free) {
    data.arena = scratch.get();
    data.narena = kScratch;
    data.pstack = data.pbase = data.parena = 0;
    data.threadpool = 0;
  }
  // A search takes 480 kB at the most steps that it is allowed (pair_routines.cpp).
  static constexpr std::size_t kScratch = std::size_t{1} << 21;

  mjModel model;
  mjData data;
  std::unique_ptr<void, void (*)(void*)> scratch;
  std::vector<Pair> pairs;
  std::vector<ContactPoint> contacts;
  bool failed = false;
};

bool PairSearch::Pair::operator<(const Pair& o) const {
  return std::tie(body_b, geom_a, geom_b) < std::tie(o.body_b, o.geom_a, o.geom_b);
}

PairSearch::PairSearch(const mjModel& model, const mjData& data, const std::vector<CollisionGeom>& geoms,
                       const std::vector<bool>& moves, const std::vector<std::pair<int, int>>& excluded)
    : model_(model), data_(data), geoms_(geoms), excluded_(excluded) {
  item_of_.assign(geoms.size(), -1);
  // More than this many have no use, and would take memory without end where all is in one place.
  most_contacts_ = 1000 + 100 * geoms.size();
  for (int k = 0; k < model.npair; ++k) {
    int a = model.pair_geom1[k], b = model.pair_geom2[k];
    if (model.geom_type[a] > model.geom_type[b]) std::swap(a, b);
    if (mjCOLLISIONFUNC[model.geom_type[a]][model.geom_type[b]])
      named_.push_back({model.geom_bodyid[a], model.geom_bodyid[b], a, b});
  }
  if (model.npair > 0) {
    NeedBenches(1);
    return;
  }
  std::vector<AxisBox> still;
  for (int g = 0; g < model.ngeom; ++g) {
    const bool moving = moves[static_cast<std::size_t>(geoms[static_cast<std::size_t>(g)].body)];
    if (model.geom_type[g] == mjGEOM_PLANE) {
      planes_.push_back(g);
    } else if (moving) {
      item_of_[static_cast<std::size_t>(g)] = static_cast<int>(movers_.size());
      movers_.push_back(g);
    } else {
      still_.push_back(g);
      still.push_back(BoxOf(model, data, g));
    }
  }
  boxes_.resize(movers_.size());
  for (const int g : movers_) Moved(g);
  sweep_.SetStill(std::move(still));
  first_pair_.resize(static_cast<std::size_t>(model.nbody) + 1);
  NeedBenches(NumBenches(movers_.size(), kMoversABench));
}

PairSearch::~PairSearch() = default;

void PairSearch::NeedBenches(int count) {
  while (static_cast<int>(benches_.size()) < count) {
    benches_.push_back(std::make_unique<Bench>(model_, data_));
    benches_.back()->contacts.reserve(4 * kPairsABench);
    benches_.back()->pairs.reserve(4 * kMoversABench);
  }
}

PairSearch::Bench& PairSearch::BenchAt(int k) { return *benches_[static_cast<std::size_t>(k)]; }

void PairSearch::Moved(int geom) {
  const int item = item_of_[static_cast<std::size_t>(geom)];
  if (item >= 0) boxes_[static_cast<std::size_t>(item)] = BoxOf(model_, data_, geom);
}

// By the sphere about each; of a plane all that is on its side.
bool PairSearch::IsNear(int a, int b, double margin) const {
  const Eigen::Map<const Vector3> p_a(data_.geom_xpos + 3 * a), p_b(data_.geom_xpos + 3 * b);
  if (model_.geom_type[a] == mjGEOM_PLANE) {
    const Eigen::Map<const Eigen::Matrix<double, 3, 3, Eigen::RowMajor>> R(data_.geom_xmat + 9 * a);
    return !(R.col(2).dot(p_b - p_a) > margin + model_.geom_rbound[b]);
  }
  const double reach = model_.geom_rbound[a] + model_.geom_rbound[b] + margin;
  return !((p_b - p_a).squaredNorm() > reach * reach);
}

bool PairSearch::MayTouch(int a, int b, double margin) const {
  const int body_a = geoms_[static_cast<std::size_t>(a)].body,
            body_b = geoms_[static_cast<std::size_t>(b)].body;
  if (body_a == body_b) return false;
  if (!(model_.geom_contype[a] & model_.geom_conaffinity[b]) &&
      !(model_.geom_contype[b] & model_.geom_conaffinity[a]))
    return false;
  if (!IsNear(a, b, margin)) return false;
  return excluded_.empty() || !std::binary_search(excluded_.begin(), excluded_.end(),
                                                  std::pair<int, int>(std::minmax(body_a, body_b)));
}

void PairSearch::AddPair(int a, int b, double margin, std::vector<Pair>& pairs) const {
  const int body_a = model_.geom_bodyid[a], body_b = model_.geom_bodyid[b];
  // As MuJoCo would come to them: bodies in their order, and in its table the simpler shape first.
  if (model_.geom_type[a] > model_.geom_type[b] ||
      (model_.geom_type[a] == model_.geom_type[b] && body_b < body_a))
    std::swap(a, b);
  if (!mjCOLLISIONFUNC[model_.geom_type[a]][model_.geom_type[b]] || !MayTouch(a, b, margin)) return;
  pairs.push_back({std::min(body_a, body_b), std::max(body_a, body_b), a, b});
}

void PairSearch::FindPairs(double margin) {
  sweep_.Sort(boxes_, margin);
  const int benches = NumBenches(movers_.size(), kMoversABench);
  const auto geom = [](const std::vector<int>& of, int item) { return of[static_cast<std::size_t>(item)]; };
  for (const auto& bench : benches_) bench->pairs.clear();
  ForBenches(benches, [&](int k) {
    std::vector<Pair>& pairs = BenchAt(k).pairs;
    const auto place = [&](int bench) {
      return static_cast<std::size_t>(bench) * movers_.size() / static_cast<std::size_t>(benches);
    };
    sweep_.Find(
        place(k), place(k + 1),
        [&](int i, int j) { AddPair(geom(movers_, i), geom(movers_, j), margin, pairs); },
        [&](int i, int s) { AddPair(geom(movers_, i), geom(still_, s), margin, pairs); });
    for (std::size_t i = place(k); i < place(k + 1); ++i)
      for (const int plane : planes_) AddPair(plane, movers_[i], margin, pairs);
  });
}

// All pairs by their first body.
void PairSearch::SortIn() {
  std::fill(first_pair_.begin(), first_pair_.end(), 0);
  std::size_t count = 0;
  for (const auto& bench : benches_) {
    for (const Pair& pair : bench->pairs) ++first_pair_[static_cast<std::size_t>(pair.body_a) + 1];
    count += bench->pairs.size();
  }
  for (std::size_t b = 1; b < first_pair_.size(); ++b) first_pair_[b] += first_pair_[b - 1];
  pairs_.resize(count);
  for (const auto& bench : benches_)
    for (const Pair& pair : bench->pairs)
      pairs_[static_cast<std::size_t>(first_pair_[static_cast<std::size_t>(pair.body_a)]++)] = pair;
  // Each now says where the next one begins.
  std::copy_backward(first_pair_.begin(), first_pair_.end() - 1, first_pair_.end());
  first_pair_.front() = 0;
}

void PairSearch::Collide(const Pair& pair, double margin, Bench& bench,
                         std::vector<ContactPoint>& contacts) const {
  const int a = pair.geom_a, b = pair.geom_b;
  std::array<mjPreContact, mjMAXCONPAIR> found;
  const int count = mjCOLLISIONFUNC[model_.geom_type[a]][model_.geom_type[b]](&bench.model, &bench.data,
                                                                              found.data(), a, b, margin);
  const CollisionGeom &geom_a = geoms_[static_cast<std::size_t>(a)],
                      &geom_b = geoms_[static_cast<std::size_t>(b)];
  for (int i = 0; i < count; ++i) {
    const mjPreContact& in = found[static_cast<std::size_t>(i)];
    if (!(in.dist < margin)) continue;
    ContactPoint& out = contacts.emplace_back();
    out.body_a = geom_a.body;
    out.body_b = geom_b.body;
    out.geometry_a = geom_a.geometry;
    out.geometry_b = geom_b.geometry;
    out.point = Eigen::Map<const Vector3>(in.pos);
    out.frame = FrameOf(in);
    out.gap = in.dist;
    SetLaw(geom_a, geom_b, out);
  }
}

bool PairSearch::DetectNamed(double margin, std::vector<ContactPoint>& contacts) {
  Bench& bench = BenchAt(0);
  bench.data.pstack = bench.data.pbase = 0;  // an error that was thrown through MuJoCo leaves it in use
  try {
    for (const Pair& pair : named_)
      if (IsNear(pair.geom_a, pair.geom_b, margin)) Collide(pair, margin, bench, contacts);
  } catch (...) {
    return false;
  }
  return contacts.size() <= most_contacts_;
}

bool PairSearch::Detect(double margin, std::vector<ContactPoint>& contacts) {
  if (model_.npair > 0) return DetectNamed(margin, contacts);
  FindPairs(margin);
  SortIn();
  const int benches = NumBenches(pairs_.size(), kPairsABench);
  NeedBenches(benches);
  // Cut between bodies, nearest to where equal shares end.
  const auto cut = [&](int bench) {
    const auto share = static_cast<std::size_t>(bench) * pairs_.size() / static_cast<std::size_t>(benches);
    return *std::lower_bound(first_pair_.begin(), first_pair_.end(), static_cast<int>(share));
  };
  ForBenches(benches, [&](int k) {
    Bench& bench = BenchAt(k);
    bench.contacts.clear();
    bench.failed = false;
    bench.data.pstack = bench.data.pbase = 0;  // an error that was thrown through MuJoCo leaves it in use
    const auto begin = pairs_.begin() + cut(k), end = pairs_.begin() + cut(k + 1);
    // Sorted here, body by body, and not where all wait for it.
    std::sort(begin, end, [](const Pair& x, const Pair& y) {
      return x.body_a < y.body_a || (x.body_a == y.body_a && x < y);
    });
    try {
      for (auto pair = begin; pair != end; ++pair) Collide(*pair, margin, bench, bench.contacts);
    } catch (...) {
      bench.failed = true;
    }
  });
  bool complete = true;
  for (int k = 0; k < benches; ++k) {
    const std::vector<ContactPoint>& own = BenchAt(k).contacts;
    const std::size_t room = most_contacts_ - contacts.size(), taken = std::min(room, own.size());
    contacts.insert(contacts.end(), own.begin(), own.begin() + static_cast<std::ptrdiff_t>(taken));
    complete = complete && taken == own.size() && !BenchAt(k).failed;
  }
  return complete;
}

}  // namespace fork1s::internal
