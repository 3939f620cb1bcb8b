// Links as WalkOne reads them: registers of links in the order of the walk.
#pragma once

#include "aligned_vector.hpp"
#include "chain_tables.hpp"

namespace fork1s::internal {

template <class Real>
class OneTables {
 public:
  OneTables() = default;
  /// `order`: of the links, parents first.
  OneTables(const LinkTables<Real>& tables, const std::vector<int>& order, int y_size);

  /// Poses by columns, as WalkOne leaves them, in `scratch`; returns where they begin.
  const Real* Walk(const Real* y, AlignedVector<Real>& scratch) const;
  std::size_t BytesRead() const;

 private:
  void PlaceTwists(const Real* y, Real* out, std::size_t stride) const;

  int slots_ = 0, twists_ = 0;
  std::vector<int> slot_, parent_, first_{0}, heard_, twist_;
  AlignedVector<Real> weights_, constants_;
  // Joints of several freedoms, in blocks of their own.
  std::vector<int> twist_first_{0}, twist_heard_;
  AlignedVector<Real> T_, C_;
};

}  // namespace fork1s::internal
