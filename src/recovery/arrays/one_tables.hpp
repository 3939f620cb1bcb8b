// Links as ForwardKinematicsSingle reads them: registers of links in the order of the walk.
#pragma once

#include "aligned_vector.hpp"
#include "chain_tables.hpp"

namespace fork1s::internal {

/// The entries of y that any of `links` (-1: none) depends on, and their weights: `rows` of kBlock numbers an
/// entry.
template <class Real>
void GatherWeights(const LinkTables<Real>& tables, const std::vector<int>& links, std::size_t rows,
                   int y_size, std::vector<int>& inputs, AlignedVector<Real>& weights);
/// A link of one freedom or none as LinkRows has it, row k at to[k * kBlock].
template <class Real>
void PutConstants(const LinkTables<Real>& tables, int link, Real* to);

template <class Real>
class OneTables {
 public:
  OneTables() = default;
  /// Links begin to end, parents before them or among them.
  OneTables(const LinkTables<Real>& tables, int begin, int end, int y_size);

  /// Poses by columns, as ForwardKinematicsSingle leaves them.
  void Walk(const Real* y, Real* X) const;
  std::size_t BytesRead() const;

 private:
  void PlaceTwists(const Real* y, Real* out, std::size_t stride) const;

  int slots_ = 0, twists_ = 0;
  std::vector<int> slot_, parent_, first_{0}, inputs_, twist_;
  AlignedVector<Real> weights_, constants_;
  // Joints of several freedoms, in blocks of their own.
  std::vector<int> twist_first_{0}, twist_heard_;
  AlignedVector<Real> T_, C_;
};

}  // namespace fork1s::internal
