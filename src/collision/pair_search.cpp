#include "pair_search.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

#include "contact_law.hpp"
#include "parallel/parallel_for.hpp"

namespace fork1s::internal {
namespace {

constexpr int kMoversPerRange = 128;  // some 10 us
constexpr int kPairsPerRange = 64;    // some 30 us
constexpr int kMaxRanges = 32;

// Ranges of as much work as is worth a thread; as many for any number of threads.
int NumRanges(std::size_t items, int per_range) {
  return std::clamp(static_cast<int>(items) / per_range, 1, kMaxRanges);
}

template <class Act>
void ForRanges(int count, const Act& act) {
  ParallelFor(0, count, 1, [&act](int begin, int end) {
    for (int k = begin; k < end; ++k) act(k);
  });
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

// What one thread searches pairs with.
struct PairScratch {
  PairScratch() : memory(mju_malloc(kMemory), mju_free) {
    data.arena = memory.get();
    data.narena = kMemory;
    contacts.reserve(4 * kPairsPerRange);
    pairs.reserve(4 * kMoversPerRange);
  }
  // A search takes 480 kB at the most steps that it is allowed (pair_routines.cpp).
  static constexpr std::size_t kMemory = std::size_t{1} << 21;

  // MuJoCo's routines for pairs read nothing of an mjData but poses of geoms and memory.
  void Begin(const std::shared_ptr<const mjModel>& at_hand, const GeomPoses& poses) {
    // By owner, since counting references of a model that all members of a batch share makes threads wait.
    if (copied.owner_before(at_hand) || at_hand.owner_before(copied)) {
      copied = at_hand;
      model = *at_hand;
    }
    data.geom_xpos = const_cast<double*>(poses.position.data());
    data.geom_xmat = const_cast<double*>(poses.rotation.data());
    data.pstack = data.pbase = data.parena = 0;  // an error that was thrown through MuJoCo leaves it in use
    failed = false;
  }

  std::weak_ptr<const mjModel> copied;
  mjModel model{};
  mjData data{};
  std::unique_ptr<void, void (*)(void*)> memory;
  std::vector<PairSearch::Pair> pairs;
  std::vector<ContactPoint> contacts;
  bool failed = false;
};

namespace {

ScratchPool<PairScratch>& Pool() {
  static ScratchPool<PairScratch>& pool =
      *new ScratchPool<PairScratch>;  // for worlds that outlive static objects
  return pool;
}

}  // namespace

bool PairSearch::Pair::operator<(const Pair& o) const {
  return std::tie(body_b, geom_a, geom_b) < std::tie(o.body_b, o.geom_a, o.geom_b);
}

AxisBox PairSearch::BoxOf(int geom) const {
  const mjModel& m = model_;
  const Eigen::Map<const Vector3> middle(m.geom_aabb + 6 * geom), half(m.geom_aabb + 6 * geom + 3);
  const Vector3 p = poses_.p(geom);
  // The sphere about its middle is sometimes the smaller.
  const double radius = m.geom_rbound[geom], beyond = geoms_[static_cast<std::size_t>(geom)].reach;
  const Vector3 at = p + poses_.R(geom) * middle, reach = poses_.R(geom).cwiseAbs() * half;
  return {((at - reach).cwiseMax((p.array() - radius).matrix()).array() - beyond).matrix(),
          ((at + reach).cwiseMin((p.array() + radius).matrix()).array() + beyond).matrix()};
}

PairSearch::PairSearch(std::shared_ptr<const mjModel> shared_model, const GeomPoses& poses,
                       const std::vector<CollisionGeom>& geoms, const std::vector<bool>& moves,
                       const std::vector<std::pair<int, int>>& excluded,
                       const std::vector<ContactPairDef>& contact_pairs)
    : shared_model_(std::move(shared_model)),
      model_(*shared_model_),
      poses_(poses),
      geoms_(geoms),
      excluded_(excluded),
      contact_pairs_(contact_pairs) {
  const mjModel& model = model_;
  item_of_.assign(geoms.size(), -1);
  // More than this many have no use, and would take memory without end where all is in one place.
  most_contacts_ = 1000 + 100 * geoms.size();
  for (int k = 0; k < model.npair; ++k) {
    int a = model.pair_geom1[k], b = model.pair_geom2[k];
    if (model.geom_type[a] > model.geom_type[b]) std::swap(a, b);
    if (mjCOLLISIONFUNC[model.geom_type[a]][model.geom_type[b]])
      named_.push_back({model.geom_bodyid[a], model.geom_bodyid[b], a, b});
  }
  Borrow(1);  // makes what is missing, and reserves
  borrowed_.clear();
  if (model.npair > 0) return;
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
      still.push_back(BoxOf(g));
    }
  }
  boxes_.resize(movers_.size());
  for (const int g : movers_) Moved(g);
  sweep_.SetStill(std::move(still));
  first_pair_.resize(static_cast<std::size_t>(model.nbody) + 1);
  Borrow(NumRanges(movers_.size(), kMoversPerRange));
  borrowed_.clear();
}

PairSearch::~PairSearch() = default;

void PairSearch::Borrow(int count) {
  while (static_cast<int>(borrowed_.size()) < count) {
    borrowed_.push_back(Pool().Borrow());
    borrowed_.back()->Begin(shared_model_, poses_);
  }
}

void PairSearch::Moved(int geom) {
  const int item = item_of_[static_cast<std::size_t>(geom)];
  if (item >= 0) boxes_[static_cast<std::size_t>(item)] = BoxOf(geom);
}

const ContactPairDef* PairSearch::PairOf(int a, int b) const {
  const int pair =
      ExplicitPair(geoms_[static_cast<std::size_t>(a)].pairs, geoms_[static_cast<std::size_t>(b)].pairs);
  return pair < 0 ? nullptr : &contact_pairs_[static_cast<std::size_t>(pair)];
}

// Distance of the two shapes [m] at which they touch.
double PairSearch::MarginOf(int a, int b, const ContactPairDef* pair) const {
  if (pair != nullptr) return pair->margin;
  return geoms_[static_cast<std::size_t>(a)].margin + geoms_[static_cast<std::size_t>(b)].margin;
}

// By the sphere about each; of a plane all that is on its side.
bool PairSearch::IsNear(int a, int b, double distance) const {
  const Eigen::Map<const Vector3> p_a = poses_.p(a), p_b = poses_.p(b);
  if (model_.geom_type[a] == mjGEOM_PLANE)
    return !(poses_.R(a).col(2).dot(p_b - p_a) > distance + model_.geom_rbound[b]);
  const double reach = model_.geom_rbound[a] + model_.geom_rbound[b] + distance;
  return !((p_b - p_a).squaredNorm() > reach * reach);
}

bool PairSearch::MayTouch(int a, int b, const CollisionMargins& margins) const {
  const int body_a = geoms_[static_cast<std::size_t>(a)].body,
            body_b = geoms_[static_cast<std::size_t>(b)].body;
  if (body_a == body_b) return false;
  const ContactPairDef* pair = PairOf(a, b);
  if (pair == nullptr && !(model_.geom_contype[a] & model_.geom_conaffinity[b]) &&
      !(model_.geom_contype[b] & model_.geom_conaffinity[a]))
    return false;
  if (!IsNear(a, b, margins.Of(body_a, body_b) + MarginOf(a, b, pair))) return false;
  if (pair != nullptr) return true;
  return excluded_.empty() || !std::binary_search(excluded_.begin(), excluded_.end(),
                                                  std::pair<int, int>(std::minmax(body_a, body_b)));
}

void PairSearch::AddPair(int a, int b, const CollisionMargins& margins, std::vector<Pair>& pairs) const {
  const int body_a = model_.geom_bodyid[a], body_b = model_.geom_bodyid[b];
  // As MuJoCo would come to them: bodies in their order, and in its table the simpler shape first.
  if (model_.geom_type[a] > model_.geom_type[b] ||
      (model_.geom_type[a] == model_.geom_type[b] && body_b < body_a))
    std::swap(a, b);
  if (!mjCOLLISIONFUNC[model_.geom_type[a]][model_.geom_type[b]] || !MayTouch(a, b, margins)) return;
  pairs.push_back({std::min(body_a, body_b), std::max(body_a, body_b), a, b});
}

void PairSearch::FindPairs(const CollisionMargins& margins) {
  sweep_.Sort(boxes_, margins.most);
  const int ranges = NumRanges(movers_.size(), kMoversPerRange);
  const auto geom = [](const std::vector<int>& of, int item) { return of[static_cast<std::size_t>(item)]; };
  ForRanges(ranges, [&](int k) {
    std::vector<Pair>& pairs = borrowed_[static_cast<std::size_t>(k)]->pairs;
    pairs.clear();
    const auto place = [&](int range) {
      return static_cast<std::size_t>(range) * movers_.size() / static_cast<std::size_t>(ranges);
    };
    sweep_.Find(
        place(k), place(k + 1),
        [&](int i, int j) { AddPair(geom(movers_, i), geom(movers_, j), margins, pairs); },
        [&](int i, int s) { AddPair(geom(movers_, i), geom(still_, s), margins, pairs); });
    for (std::size_t i = place(k); i < place(k + 1); ++i)
      for (const int plane : planes_) AddPair(plane, movers_[i], margins, pairs);
  });
}

// All pairs by their first body.
void PairSearch::SortIn() {
  std::fill(first_pair_.begin(), first_pair_.end(), 0);
  std::size_t count = 0;
  for (const auto& scratch : borrowed_) {
    for (const Pair& pair : scratch->pairs) ++first_pair_[static_cast<std::size_t>(pair.body_a) + 1];
    count += scratch->pairs.size();
  }
  for (std::size_t b = 1; b < first_pair_.size(); ++b) first_pair_[b] += first_pair_[b - 1];
  pairs_.resize(count);
  for (const auto& scratch : borrowed_)
    for (const Pair& pair : scratch->pairs)
      pairs_[static_cast<std::size_t>(first_pair_[static_cast<std::size_t>(pair.body_a)]++)] = pair;
  // Each now says where the next one begins.
  std::copy_backward(first_pair_.begin(), first_pair_.end() - 1, first_pair_.end());
  first_pair_.front() = 0;
}

// Of the surface of a geom within itself at a contact: about its normal, along its tangents.
Vector3 PairSearch::SurfaceVelocity(int geom, const ContactPoint& at) const {
  const Vector6& V = geoms_[static_cast<std::size_t>(geom)].surface_velocity;
  const auto R = poses_.R(geom);
  const Vector3 omega = R * V.head<3>();
  const Vector3 velocity = R * V.tail<3>() + omega.cross(at.point - poses_.p(geom));
  Vector3 along = at.frame * velocity;
  along[0] = at.frame.row(0).dot(omega);
  return along;
}

void PairSearch::Collide(const Pair& pair, const CollisionMargins& margins, PairScratch& scratch,
                         std::vector<ContactPoint>& contacts) const {
  const int a = pair.geom_a, b = pair.geom_b;
  const ContactPairDef* own = PairOf(a, b);
  const double at = MarginOf(a, b, own);
  const double margin =
      margins.Of(geoms_[static_cast<std::size_t>(a)].body, geoms_[static_cast<std::size_t>(b)].body);
  std::array<mjPreContact, mjMAXCONPAIR> found;
  const int count = mjCOLLISIONFUNC[model_.geom_type[a]][model_.geom_type[b]](
      &scratch.model, &scratch.data, found.data(), a, b, margin + at);
  const CollisionGeom &geom_a = geoms_[static_cast<std::size_t>(a)],
                      &geom_b = geoms_[static_cast<std::size_t>(b)];
  const bool surfaces_move = !geom_a.surface_velocity.isZero(0) || !geom_b.surface_velocity.isZero(0);
  for (int i = 0; i < count; ++i) {
    const mjPreContact& in = found[static_cast<std::size_t>(i)];
    if (!(in.dist - at < margin)) continue;
    ContactPoint& out = contacts.emplace_back();
    out.body_a = geom_a.body;
    out.body_b = geom_b.body;
    out.geometry_a = geom_a.geometry;
    out.geometry_b = geom_b.geometry;
    out.point = Eigen::Map<const Vector3>(in.pos);
    out.frame = FrameOf(in);
    out.gap = in.dist - at;
    if (own != nullptr)
      SetLaw(*own, out);
    else
      SetLaw(geom_a, geom_b, out);
    if (surfaces_move) out.surface_velocity = SurfaceVelocity(b, out) - SurfaceVelocity(a, out);
  }
}

bool PairSearch::DetectNamed(const CollisionMargins& margins, std::vector<ContactPoint>& contacts) {
  Borrow(1);
  PairScratch& scratch = *borrowed_.front();
  try {
    for (const Pair& pair : named_)
      if (IsNear(pair.geom_a, pair.geom_b,
                 margins.Of(geoms_[static_cast<std::size_t>(pair.geom_a)].body,
                            geoms_[static_cast<std::size_t>(pair.geom_b)].body) +
                     MarginOf(pair.geom_a, pair.geom_b, PairOf(pair.geom_a, pair.geom_b))))
        Collide(pair, margins, scratch, contacts);
  } catch (...) {
    return false;
  }
  return contacts.size() <= most_contacts_;
}

bool PairSearch::Detect(const CollisionMargins& margins, std::vector<ContactPoint>& contacts) {
  const ScratchPool<PairScratch>::ReturnAll at_end(borrowed_);
  return model_.npair > 0 ? DetectNamed(margins, contacts) : DetectNear(margins, contacts);
}

bool PairSearch::DetectNear(const CollisionMargins& margins, std::vector<ContactPoint>& contacts) {
  Borrow(NumRanges(movers_.size(), kMoversPerRange));
  FindPairs(margins);
  SortIn();
  const int ranges = NumRanges(pairs_.size(), kPairsPerRange);
  Borrow(ranges);
  // Cut between bodies, nearest to where equal shares end.
  const auto cut = [&](int range) {
    const auto share = static_cast<std::size_t>(range) * pairs_.size() / static_cast<std::size_t>(ranges);
    return *std::lower_bound(first_pair_.begin(), first_pair_.end(), static_cast<int>(share));
  };
  ForRanges(ranges, [&](int k) {
    PairScratch& scratch = *borrowed_[static_cast<std::size_t>(k)];
    scratch.contacts.clear();
    const auto begin = pairs_.begin() + cut(k), end = pairs_.begin() + cut(k + 1);
    // Sorted here, body by body, and not where all wait for it.
    std::sort(begin, end, [](const Pair& x, const Pair& y) {
      return x.body_a < y.body_a || (x.body_a == y.body_a && x < y);
    });
    try {
      for (auto pair = begin; pair != end; ++pair) Collide(*pair, margins, scratch, scratch.contacts);
    } catch (...) {
      scratch.failed = true;
    }
  });
  bool complete = true;
  for (int k = 0; k < ranges; ++k) {
    const std::vector<ContactPoint>& own = borrowed_[static_cast<std::size_t>(k)]->contacts;
    const std::size_t room = most_contacts_ - contacts.size(), taken = std::min(room, own.size());
    contacts.insert(contacts.end(), own.begin(), own.begin() + static_cast<std::ptrdiff_t>(taken));
    complete = complete && taken == own.size() && !borrowed_[static_cast<std::size_t>(k)]->failed;
  }
  return complete;
}

}  // namespace fork1s::internal
