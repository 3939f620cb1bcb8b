#include "scan_tables.hpp"

#include <algorithm>

#include "one_tables.hpp"

namespace fork1s::internal {

std::vector<LinkRange> LinkRanges(const std::vector<Link>& links, int bodies, int least, int most) {
  const auto follows = [&](int l) {
    const Link &link = links[static_cast<std::size_t>(l)], &before = links[static_cast<std::size_t>(l) - 1];
    return link.parent == before.slot && link.slot == before.slot + 1;
  };
  const auto may = [&](int l) {
    const Link& link = links[static_cast<std::size_t>(l)];
    return link.slot < bodies && link.kind != LinkKind::kTwist;
  };
  std::vector<LinkRange> out;
  const auto add = [&](int begin, int end, bool is_run) {
    if (begin == end) return;
    if (!is_run && !out.empty() && !out.back().is_run)
      out.back().end = end;
    else
      out.push_back({begin, end, is_run});
  };
  const int count = static_cast<int>(links.size());
  for (int begin = 0; begin < count;) {
    int end = begin + 1;
    while (may(begin) && end < count && may(end) && follows(end)) ++end;
    const int pieces = (end - begin + most - 1) / most;
    if (end - begin < least)
      add(begin, end, false);
    else
      for (int p = 0, from = begin; p < pieces; ++p) {  // even ones, cut where a cache line of slots begins
        const int share = begin + static_cast<int>(static_cast<long>(end - begin) * (p + 1) / pieces);
        const int slot = links[static_cast<std::size_t>(begin)].slot - begin;
        const int to = p + 1 == pieces ? end : (share + slot) / kBlock<float> * kBlock<float> - slot;
        add(from, to, true);
        from = to;
      }
    begin = end;
  }
  return out;
}

template <class Real>
RunTables<Real>::RunTables(const LinkTables<Real>& tables, int begin, int end, int y_size)
    : count_(end - begin), root_(tables.slots) {
  constexpr int block = kBlock<Real>;
  const auto& links = tables.links;
  first_slot_ = links[static_cast<std::size_t>(begin)].slot;
  parent_ = links[static_cast<std::size_t>(begin)].parent;
  steps_ = std::max(block, (count_ + block - 1) / block);
  std::vector<int> some;
  for (int l = begin; l < end; l += block) {
    some.clear();
    for (int k = l; k < std::min(end, l + block); ++k) some.push_back(k);
    GatherWeights(tables, some, 1, y_size, inputs_, weights_);
    first_.push_back(static_cast<int>(inputs_.size()));
  }
  constants_.assign(static_cast<std::size_t>(kLinkRows * block) * static_cast<std::size_t>(steps_), Real(0));
  for (int step = 0; step < steps_; ++step)
    for (int lane = 0; lane < block; ++lane) {
      Real* to = constants_.data() + static_cast<std::size_t>(kLinkRows * step * block + lane);
      const int l = begin + lane * steps_ + step;
      if (l < end)
        PutConstants(tables, l, to);
      else
        for (int i = 0; i < 3; ++i) to[4 * i * block] = Real(1);
    }
  std::vector<bool> is_asked(static_cast<std::size_t>(count_), false);
  is_asked.back() = true;
  for (std::size_t l = 0; l < links.size(); ++l)
    if (const int at = links[l].parent - first_slot_;
        at >= 0 && at < count_ && (static_cast<int>(l) < begin || static_cast<int>(l) >= end))
      is_asked[static_cast<std::size_t>(at)] = true;
  for (int l = 0; l < count_; ++l)
    if (is_asked[static_cast<std::size_t>(l)]) asked_.push_back(l);
}

namespace {

// One pose of many that stand side by side, and their product.
template <class Real>
struct OnePose {
  Real entry[12];
  OnePose(const Real* from, std::size_t stride) {
    for (std::size_t e = 0; e < 12; ++e) entry[e] = from[e * stride];
  }
  OnePose operator*(const OnePose& b) const {
    OnePose out = *this;
    for (std::size_t i = 0; i < 3; ++i) {
      const Real *row = entry + 3 * i, *p = b.entry + 9;
      for (std::size_t j = 0; j < 3; ++j)
        out.entry[3 * i + j] = row[0] * b.entry[j] + row[1] * b.entry[3 + j] + row[2] * b.entry[6 + j];
      out.entry[9 + i] += row[0] * p[0] + row[1] * p[1] + row[2] * p[2];
    }
    return out;
  }
};

}  // namespace

template <class Real>
void RunTables<Real>::Stand(const Real* poses, Real* X, std::size_t column, Real* stands) const {
  constexpr std::size_t block = kBlock<Real>;
  const Real* from = X + 4 * static_cast<std::size_t>(parent_ < 0 ? root_ : parent_);
  Real entries[12];
  for (std::size_t i = 0; i < 3; ++i) {
    for (std::size_t k = 0; k < 3; ++k) entries[3 * i + k] = from[k * column + i];
    entries[9 + i] = from[3 * column + i];
  }
  const auto at = [&](std::size_t step, std::size_t segment) { return poses + 12 * step * block + segment; };
  const auto last = static_cast<std::size_t>(steps_) - 1;
  OnePose<Real> stand(entries, 1);
  for (std::size_t s = 0; s < block; ++s) {
    for (std::size_t e = 0; e < 12; ++e) stands[e * block + s] = stand.entry[e];
    stand = stand * OnePose<Real>(at(last, s), block);
  }
  for (const int l : asked_) {
    const auto segment = static_cast<std::size_t>(l / steps_), step = static_cast<std::size_t>(l % steps_);
    const OnePose<Real> pose =
        OnePose<Real>(stands + segment, block) * OnePose<Real>(at(step, segment), block);
    Real* to = X + 4 * static_cast<std::size_t>(first_slot_ + l);
    for (std::size_t i = 0; i < 3; ++i) {
      for (std::size_t k = 0; k < 3; ++k) to[k * column + i] = pose.entry[3 * i + k];
      to[3 * column + i] = pose.entry[9 + i];
    }
  }
}

template <class Real>
void RunTables<Real>::Ask(int begin, int end) {
  for (int l = std::max(0, begin - first_slot_); l < std::min(count_, end - first_slot_); ++l)
    if (std::find(asked_.begin(), asked_.end(), l) == asked_.end()) asked_.push_back(l);
}

template <class Real>
std::size_t RunTables<Real>::BytesRead() const {
  return (weights_.size() + constants_.size()) * sizeof(Real) + inputs_.size() * sizeof(int);
}

template class RunTables<float>;
template class RunTables<double>;

}  // namespace fork1s::internal
