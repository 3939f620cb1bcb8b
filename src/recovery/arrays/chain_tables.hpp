// What the kernels of chain_kernels.hpp read of a reduced model.
#pragma once

#include <algorithm>
#include <array>
#include <fork1s/reduction/reduced_model.hpp>
#include <utility>
#include <vector>

#include "chain_kernels.hpp"

namespace fork1s::internal {

/// Every coordinate as a linear form of y = [1, z, ν]: q = q_ref + Q z - B µ, each row of µ = unit ν in a
/// unit of its own (LoopUnits).
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
  std::vector<int> inputs;
  std::vector<Real> weights, constants;
  // Of every link behind its pose C at θ = 0: ω, ω × v and the slide with θ, (ω·v) ω; 0 where it has none.
  std::vector<std::array<Real, 9>> screws;
  int slots = 0;

  LinkTables() = default;
  template <class Other>
  explicit LinkTables(const LinkTables<Other>& other)
      : links(other.links),
        inputs(other.inputs),
        weights(other.weights.begin(), other.weights.end()),
        constants(other.constants.begin(), other.constants.end()),
        slots(other.slots) {
    for (const auto& screw : other.screws)
      std::copy(screw.begin(), screw.end(), screws.emplace_back().begin());
  }
  LinkMap<Real> Map() const {
    return {links.data(), static_cast<int>(links.size()), inputs.data(), weights.data(), constants.data()};
  }
};

LinkTables<double> MakeLinks(const Mechanism& mechanism, const CoordinateForms& forms);
/// Multiplications and additions of the poses of one state, in numbers of so many bytes.
std::size_t LinkOperations(const std::vector<Link>& links, std::size_t weights, std::size_t bytes);

}  // namespace fork1s::internal
