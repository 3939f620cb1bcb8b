// Long paths of a mechanism as ScanFirst and ScanLast read them.
#pragma once

#include <utility>
#include <vector>

#include "aligned_vector.hpp"
#include "chain_tables.hpp"
#include "scan_kernels.hpp"

namespace fork1s::internal {

/// Links of one freedom or none, each hanging on the one before it in the list and in the slot behind it.
template <class Real>
class RunTables {
 public:
  RunTables(const LinkTables<Real>& tables, int begin, int end, int y_size);

  /// Makes Stand place the poses of slots begin to end, as far as they are its.
  void Ask(int begin, int end);

  int first_slot() const { return first_slot_; }
  int size() const { return count_; }
  std::size_t turns() const { return RunTurns(Map()); }
  std::size_t poses() const { return RunPoses(Map()); }
  void First(const Real* y, Real* turns, Real* poses) const { ScanFirst(Map(), y, turns, poses); }
  /// What segments stand on [12 x kBlock], from the pose of the run's parent in X, poses by columns as
  /// ForwardKinematicsSingle has them; and into X the poses that other links hang on.
  void Stand(const Real* poses, Real* X, std::size_t column, Real* stands) const;
  /// Rows from the run's first slot on, out[0] the first row's slot 0.
  void Last(const Real* poses, const Real* stands, Real* out, std::size_t stride) const {
    ScanLast(Map(), poses, stands, out + first_slot_, stride);
  }
  std::size_t BytesRead() const;

 private:
  RunMap<Real> Map() const {
    return {count_, steps_, first_.data(), inputs_.data(), weights_.data(), constants_.data()};
  }

  int count_ = 0, steps_ = 0, first_slot_ = 0, parent_ = -1, root_ = 0;
  std::vector<int> first_{0}, inputs_;
  AlignedVector<Real> weights_, constants_;
  std::vector<int> asked_;  // links of it that others hang on, the last always
};

/// Ranges of links, in their order, that are walked one by one or scanned.
struct LinkRange {
  int begin = 0, end = 0;
  bool is_run = false;
};
/// `bodies`: slots from there on are no bodies. A run has `least` links or more, and not many more than
/// `most`.
std::vector<LinkRange> LinkRanges(const std::vector<Link>& links, int bodies, int least, int most);

}  // namespace fork1s::internal
