#include "loop_tables.hpp"

#include <algorithm>

#include "pose_backend.hpp"

namespace fork1s::internal {

LoopUnits::LoopUnits(const ReducedModel& model) : unit(VectorX::Ones(model.loop_rank())) {
  const Mechanism& mechanism = *model.mechanism;
  const auto& closures = mechanism.closures();
  double extent = mechanism.length_scale();
  for (const ClosureDef& closure : closures)
    for (const BodyIndex body : {closure.body_a, closure.body_b})
      extent = std::max(extent, model.X_RB_ref[body.u()].translation().norm());
  shift = 1 / extent;
  // Rows in the order of ClosureResidual.
  std::vector<Source> all;
  for (std::size_t c = 0; c < closures.size(); ++c)
    for (int i = 0; i < 6; ++i)
      if (closures[c].rigid(i)) all.push_back({static_cast<int>(c), i});
  for (std::size_t c = 0; c < mechanism.couplings().size(); ++c) {
    const int a = mechanism.couplings()[c].a;
    const bool turns = mechanism.Turns(a);
    all.push_back({static_cast<int>(closures.size() + c), turns ? 0 : 3});
  }
  for (int k = 0; k < model.loop_rank(); ++k) {
    rows.push_back(all[static_cast<std::size_t>(model.loops.row(k))]);
    if (rows.back().component >= 3) unit(k) = shift;
  }
}

// N[z, z]/2 by pairs of coordinates, each once.
template <>
void LoopTables<double>::FillBend(const ReducedModel& model, const LoopUnits& units) {
  const LoopCurvature made = model.curvature.exists() ? LoopCurvature() : LoopCurvature(model);
  const LoopCurvature& curvature = model.curvature.exists() ? model.curvature : made;
  if (!curvature.exists()) return;  // no coordinate moves them
  const int r = model.size();
  std::vector<RowMatrixX> by_column(static_cast<std::size_t>(r));  // N e_l
  for (int l = 0; l < r; ++l) {
    RowMatrixX& W = by_column[static_cast<std::size_t>(l)];
    W.setZero(rows_, (r + 3) / 4 * 4);
    curvature.Apply(VectorX::Unit(r, l), W);
  }
  const auto coordinates = model.loops.GroupCoordinates();
  const std::vector<int> sizes = model.loops.GroupSizes();
  int row = 0;
  for (std::size_t g = 0; g < sizes.size(); row += sizes[g], ++g) {
    const ReducedModel::Run run = model.runs[static_cast<std::size_t>(coordinates[g].front())];
    BendGroup group{entry_ + row, sizes[g], static_cast<int>(a_.size()), 0, N_.size()};
    for (int k = run.begin; k < run.begin + run.size; ++k)
      for (int l = run.begin; l <= k; ++l) {
        a_.push_back(1 + k);
        b_.push_back(1 + l);
      }
    group.pairs = static_cast<int>(a_.size()) - group.first_pair;
    most_pairs_ = std::max(most_pairs_, group.pairs);
    for (int i = row; i < row + sizes[g]; ++i)
      for (int k = run.begin; k < run.begin + run.size; ++k)
        for (int l = run.begin; l <= k; ++l)
          N_.push_back((k == l ? 0.5 : 1.0) * by_column[static_cast<std::size_t>(l)](i, k) / units.unit(i));
    bends_.push_back(group);
  }
}

template <>
void LoopTables<double>::FillClosures(const ReducedModel& model, const LoopUnits& units,
                                      const CoordinateForms& forms, const LinkTables<double>& links) {
  const Mechanism& mechanism = *model.mechanism;
  const auto& all = mechanism.closures();
  // Links on the way to a closure, with slots of their own.
  std::vector<int> link_of_slot(static_cast<std::size_t>(links.slots)), slot(link_of_slot.size(), -1);
  std::vector<bool> is_asked(links.links.size(), false);
  for (std::size_t l = 0; l < links.links.size(); ++l)
    link_of_slot[static_cast<std::size_t>(links.links[l].slot)] = static_cast<int>(l);
  for (const LoopUnits::Source& source : units.rows) {
    if (source.source >= static_cast<int>(all.size())) continue;
    const ClosureDef& closure = all[static_cast<std::size_t>(source.source)];
    for (const BodyIndex body : {closure.body_a, closure.body_b})
      for (int s = body.value(); s >= 0;) {
        const auto l = static_cast<std::size_t>(link_of_slot[static_cast<std::size_t>(s)]);
        is_asked[l] = true;
        s = links.links[l].parent;
      }
  }
  for (std::size_t l = 0; l < links.links.size(); ++l) {
    if (!is_asked[l]) continue;
    Link link = links.links[l];
    slot[static_cast<std::size_t>(link.slot)] = slots_;
    link.slot = slots_++;
    if (link.parent >= 0) link.parent = slot[static_cast<std::size_t>(link.parent)];
    links_.push_back(link);
  }
  const auto add_input = [&](int coordinate, double coefficient) {
    for (const auto& [entry, weight] : forms.of(coordinate)) {
      inputs_.push_back(entry);
      weights_.push_back(coefficient * weight);
    }
    return static_cast<int>(inputs_.size());
  };
  int last = -1;
  for (int k = 0; k < rows_; ++k) {
    const auto [source, component] = units.rows[static_cast<std::size_t>(k)];
    if (source < static_cast<int>(all.size())) {
      const ClosureDef& closure = all[static_cast<std::size_t>(source)];
      if (source != last) {
        ClosureRows<double> rows{};
        rows.slot_a = slot[closure.body_a.u()];
        rows.slot_b = slot[closure.body_b.u()];
        for (int e = 0; e < 12; ++e) {
          rows.X_a[e] = Entry(closure.X_AJ, e);
          rows.X_b[e] = Entry(closure.X_BJ, e);
        }
        closures_.push_back(rows);
      }
      ClosureRows<double>& rows = closures_.back();
      rows.component[rows.rows] = component;
      rows.row[rows.rows++] = k;
    } else {
      const Mechanism::Coupling& coupling =
          mechanism.couplings()[static_cast<std::size_t>(source) - all.size()];
      CouplingRow<double> row{};
      row.row = k;
      row.first_a = static_cast<int>(inputs_.size());
      row.last_a = add_input(coupling.a, 1);
      for (const auto& [i, coefficient] : coupling.terms) row.last_a = add_input(i, -coefficient);
      row.last_b = coupling.b >= 0 ? add_input(coupling.b, 1) : row.last_a;
      for (int i = 0; i < 5; ++i) row.polynomial[i] = coupling.polynomial[i];
      row.unit = units.unit(k);
      couplings_.push_back(row);
    }
    last = source;
  }
}

template <>
void LoopTables<double>::FillInverse(const ReducedModel& model, const LoopUnits& units) {
  Kinematics kinematics(*model.mechanism);
  ComputeKinematics(*model.mechanism, model.q_ref, kinematics);
  VectorX A;
  model.loops.Fill(*model.mechanism, kinematics, model.q_ref, A);
  LoopFactor factor(model.loops);
  factor.Compute(model.loops, A, model.B);
  RowMatrixX inverse = MatrixX::Identity(rows_, rows_);
  factor.SolveInPlace(inverse);
  int row = 0;
  for (const int size : model.loops.GroupSizes()) {
    groups_.push_back({row, size, G_.size()});
    for (int i = row; i < row + size; ++i)  // of c/unit to ν
      for (int k = row; k < row + size; ++k) G_.push_back(inverse(i, k) / (units.unit(i) * units.unit(k)));
    row += size;
  }
}

template <>
LoopTables<double>::LoopTables(const ReducedModel& model, const LoopUnits& units,
                               const CoordinateForms& forms, const LinkTables<double>& links, bool exact)
    : rows_(model.loop_rank()), entry_(1 + model.size()), shift_(units.shift) {
  if (rows_ == 0) return;
  FillBend(model, units);
  if (!exact) return;
  FillClosures(model, units, forms, links);
  FillInverse(model, units);
}

template <class Real>
template <class Other>
LoopTables<Real>::LoopTables(const LoopTables<Other>& o)
    : rows_(o.rows_),
      entry_(o.entry_),
      most_pairs_(o.most_pairs_),
      slots_(o.slots_),
      shift_(static_cast<Real>(o.shift_)),
      bends_(o.bends_),
      a_(o.a_),
      b_(o.b_),
      N_(o.N_.begin(), o.N_.end()),
      links_(o.links_),
      inputs_(o.inputs_),
      weights_(o.weights_.begin(), o.weights_.end()),
      G_(o.G_.begin(), o.G_.end()),
      groups_(o.groups_) {
  for (const auto& of : o.closures_) {
    ClosureRows<Real>& own = closures_.emplace_back();
    own.slot_a = of.slot_a;
    own.slot_b = of.slot_b;
    own.rows = of.rows;
    std::copy_n(of.X_a, 12, own.X_a);
    std::copy_n(of.X_b, 12, own.X_b);
    std::copy_n(of.component, 6, own.component);
    std::copy_n(of.row, 6, own.row);
  }
  for (const auto& of : o.couplings_) {
    CouplingRow<Real>& own = couplings_.emplace_back();
    own.row = of.row;
    own.first_a = of.first_a;
    own.last_a = of.last_a;
    own.last_b = of.last_b;
    std::copy_n(of.polynomial, 5, own.polynomial);
    own.unit = static_cast<Real>(of.unit);
  }
}

template <class Real>
void LoopTables<Real>::Bend(Real* y, std::size_t y_stride, std::size_t states,
                            AlignedVector<Real>& scratch) const {
  if (scratch.size() < BendScratch<Real>(most_pairs_)) scratch.resize(BendScratch<Real>(most_pairs_));
  BendStates({bends_.data(), static_cast<int>(bends_.size()), a_.data(), b_.data(), N_.data()}, y, y_stride,
             states, scratch.data());
}

template <class Real>
Closing LoopTables<Real>::Close(const LinkTables<Real>& links, Real* y, std::size_t y_stride,
                                std::size_t states, AlignedVector<Real>& scratch) const {
  LoopMap<Real> map;
  map.links = links.Map();
  map.links.links = links_.data();
  map.links.count = static_cast<int>(links_.size());
  map.slots = slots_;
  map.closures = closures_.data();
  map.num_closures = static_cast<int>(closures_.size());
  map.couplings = couplings_.data();
  map.num_couplings = static_cast<int>(couplings_.size());
  map.inputs = inputs_.data();
  map.weights = weights_.data();
  map.groups = groups_.data();
  map.num_groups = static_cast<int>(groups_.size());
  map.G = G_.data();
  map.rows = rows_;
  map.entry = entry_;
  map.shift_unit = shift_;
  if (scratch.size() < CloseScratch(map)) scratch.resize(CloseScratch(map));
  return CloseBlock(map, y, y_stride, states, scratch.data());
}

template LoopTables<float>::LoopTables(const LoopTables<double>&);
template class LoopTables<float>;
template class LoopTables<double>;

}  // namespace fork1s::internal
