// What the kernels of loop_kernels.hpp read of a reduced model.
#pragma once

#include "aligned_vector.hpp"
#include "chain_tables.hpp"
#include "loop_kernels.hpp"

namespace fork1s::internal {

/// Units of the rows of model.loops, so that unit c and ν, of µ = unit ν, are numbers of like size: 1 where a
/// row is an angle, of a length 1/extent of what the loops join.
struct LoopUnits {
  explicit LoopUnits(const ReducedModel& model);
  VectorX unit;
  double shift = 1;  // of lengths
  /// The closure (or closures + coupling) of a row, and which of its six errors.
  struct Source {
    int source = 0, component = 0;
  };
  std::vector<Source> rows;
};

template <class Real>
class LoopTables {
 public:
  LoopTables() = default;
  /// In double alone, and then in what is asked for. `links` are those that `forms` made. Without `exact`
  /// what closing by curvature asks for alone.
  LoopTables(const ReducedModel& model, const LoopUnits& units, const CoordinateForms& forms,
             const LinkTables<double>& links, bool exact);
  template <class Other>
  explicit LoopTables(const LoopTables<Other>& other);

  bool exist() const { return rows_ > 0; }
  /// ν of `states` states (whole blocks) by curvature.
  void Bend(Real* y, std::size_t y_stride, std::size_t states, AlignedVector<Real>& scratch) const;
  /// From there to closed loops, for a block of which `states` count.
  Closing Close(const LinkTables<Real>& links, Real* y, std::size_t y_stride, std::size_t states,
                AlignedVector<Real>& scratch) const;
  std::size_t BytesRead() const { return N_.size() * sizeof(Real); }
  /// Multiplications and additions of Bend for a state.
  std::size_t Operations() const { return 2 * N_.size() + a_.size(); }

 private:
  template <class>
  friend class LoopTables;
  void FillBend(const ReducedModel& model, const LoopUnits& units);
  void FillClosures(const ReducedModel& model, const LoopUnits& units, const CoordinateForms& forms,
                    const LinkTables<double>& links);
  void FillInverse(const ReducedModel& model, const LoopUnits& units);

  int rows_ = 0, entry_ = 0, most_pairs_ = 0, slots_ = 0;
  Real shift_ = 1;
  std::vector<BendGroup> bends_;
  std::vector<int> a_, b_;
  std::vector<Real> N_;
  std::vector<Link> links_;
  std::vector<ClosureRows<Real>> closures_;
  std::vector<CouplingRow<Real>> couplings_;
  std::vector<int> inputs_;
  std::vector<Real> weights_, G_;
  std::vector<LoopGroup> groups_;
};

}  // namespace fork1s::internal
