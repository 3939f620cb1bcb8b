// The sum over ports that touch, Σ Y_left S Y_rightᵀ, in freedoms.
//
// Every port is on the right once: what stands left of it, U = Σ Y_left S, is summed over all that it
// touches, and each of its freedoms then meets the whole of U. A finger that has the freedoms of its hand
// would else pass over them once for itself and once for each thing that it touches.
#include <algorithm>
#include <fork1s/base/quad.hpp>

#include "regularized_contact_problem.hpp"

namespace fork1s::internal {
void RegularizedContactProblem::AddLeftProduct(const PortRows& left, const PaddedBlock& S) {
  if (S.isZero(0)) return;  // nothing touches there
  const auto meet = [&](const double* Y, int begin, int count) {
    if (count == 0) return;
    AddSixTimesSix(Y, left.stride, count, {S.data(), 1, 8}, 6, block_scratch_.U.data() + begin, freedoms());
    Span span{begin, begin + count};
    std::erase_if(block_scratch_.spans, [&](const Span& other) {
      if (other.end < span.begin || span.end < other.begin) return false;
      span = {std::min(span.begin, other.begin), std::max(span.end, other.end)};
      return true;
    });
    block_scratch_.spans.push_back(span);
  };
  meet(left.Y, left.begin, left.freedoms);
  meet(left.Y_apart, left.begin_apart, left.freedoms_apart);
}

void RegularizedContactProblem::AddRightProduct(const double* Y, int stride, int begin, int count,
                                                double* H) const {
  double* columns = H + static_cast<std::ptrdiff_t>(begin) * freedoms();
  for (const Span& span : block_scratch_.spans)
    AddSixTimesSix(block_scratch_.U.data() + span.begin, freedoms(), span.size(), {Y, stride, 1}, count,
                   columns + span.begin, freedoms());
}

void RegularizedContactProblem::SetDiagonal(double diagonal, double* H) const {
  const auto n = static_cast<std::size_t>(freedoms());
  std::fill_n(H, n * n, 0.0);
  for (std::size_t i = 0; i < n; ++i) H[i * (n + 1)] = diagonal;
}

void RegularizedContactProblem::AddBlocks(double* H) {
  block_scratch_.U.assign(6 * static_cast<std::size_t>(freedoms()), 0.0);
  for (std::size_t r = 0; r < ports.size(); ++r) {
    const PortRows& right = ports[r];
    AddLeftProduct(right, right.S);
    for (int p = right.first_pair; p >= 0;) {
      const auto at = static_cast<std::size_t>(p);
      const PairRows& pair = pairs[at];
      const bool is_a = pair.port_a == static_cast<int>(r);
      const int other = is_a ? pair.port_b : pair.port_a;
      if (other >= 0) AddLeftProduct(ports[static_cast<std::size_t>(other)], is_a ? S_ba_[at] : S_ab_[at]);
      p = is_a ? pair.next_of_a : pair.next_of_b;
    }
    AddRightProduct(right.Y, right.stride, right.begin, right.freedoms, H);
    AddRightProduct(right.Y_apart, right.stride, right.begin_apart, right.freedoms_apart, H);
    for (const Span& span : block_scratch_.spans)
      for (std::ptrdiff_t c = 0; c < 6; ++c) {
        double* u = block_scratch_.U.data() + c * freedoms() + span.begin;
        ByFours(span.end - span.begin, [&](const auto& at) { at(u).setZero(); });
      }
    block_scratch_.spans.clear();
  }
}

}  // namespace fork1s::internal
