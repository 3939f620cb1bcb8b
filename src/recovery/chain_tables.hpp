// What the kernels of chain_kernels.hpp read of a reduced model.
#pragma once

#include <array>
#include <fork1s/reduction/reduced_model.hpp>
#include <utility>
#include <vector>

#include "chain_kernels.hpp"

namespace fork1s::internal {

/// Every coordinate as a linear form of y = [1, z, ν]: q = q_ref + Q z + q_perp - B µ. Of µ = w ν each row
/// has its own unit w, such that residuals c/w and ν are numbers of like size (1 for turns, a length for
/// slides).
class CoordinateForms {
 public:
  using Term = std::pair<int, double>;  // entry of y, weight
  explicit CoordinateForms(const ReducedModel& model, const VectorX& unit);
  /// Entry 0 first, always there.
  const std::vector<Term>& of(int coordinate) const { return forms_[static_cast<std::size_t>(coordinate)]; }
  int size() const { return size_; }  // of y

 private:
  std::vector<std::vector<Term>> forms_;
  int size_ = 1;
};

/// Links of a mechanism: bodies have the slot of their number, what stands between two joints of one body
/// comes behind.
template <class Real>
struct LinkTables {
  std::vector<Link> links;
  std::vector<int> heard;
  std::vector<Real> weights, constants;
  // Of every link behind its pose C at θ = 0: ω, ω × v and the slide with θ, (ω·v) ω; 0 where it has none.
  std::vector<std::array<Real, 9>> screws;
  int slots = 0;
  // Where q_perp enters: which links each coordinate moves is found by joint.
  std::vector<int> link_of_joint;

  LinkTables() = default;
  LinkTables(const Mechanism& mechanism, const CoordinateForms& forms);
  /// q_ref + q_perp, in place of what was there.
  void SetConstants(const Mechanism& mechanism, const VectorX& q);
  LinkMap<Real> Map() const {
    return {links.data(), static_cast<int>(links.size()), heard.data(), weights.data(), constants.data()};
  }
  /// Multiplications and additions of the poses of one state.
  std::size_t Operations() const;
};

}  // namespace fork1s::internal
