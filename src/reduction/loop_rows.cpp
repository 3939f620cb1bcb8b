#include <fork1s/reduction/loop_rows.hpp>

#include <algorithm>
#include <fork1s/base/quad.hpp>
#include <limits>
#include <map>
#include <type_traits>

namespace fork1s {
namespace {

const double* Row(const RowMatrixX& X, int i) { return X.data() + i * X.cols(); }
double* Row(RowMatrixX& X, int i) { return X.data() + i * X.cols(); }

using Eight = Eigen::Matrix<double, 8, 1>;

// Of points and of welds, which nearly all loops are, without a loop.
void CopyRows(const double* from, int rows, double* to) {
  const auto copy = [&](const auto& at) { at(to) = at(from); };
  if (rows == 6) {
    ByFours(6, copy);
  } else if (rows == 3) {
    ByFours(3, copy);
  } else {
    for (int r = 0; r < rows; ++r) to[r] = from[r];
  }
}

// Rows of a block by its coordinates: `values` kRows from `stride` to `stride`, `row_of[k]` the row of X for
// each.
struct BlockView {
  const double* values;
  int stride;
  const int* row_of;
  int count;
};

// As ByFours, by eights first: each value that is read serves twice as many columns.
template <class F>
void ByEights(int n, F&& f) {
  int i = 0;
  for (; i + 8 <= n; i += 8)
    f([i](auto* p) {
      using Map = std::conditional_t<std::is_const_v<std::remove_reference_t<decltype(*p)>>,
                                     Eigen::Map<const Eight>, Eigen::Map<Eight>>;
      return Map(p + i);
    });
  ByFours(n - i, [&](const auto& at) { f([&at, i](auto* p) { return at(p + i); }); });
}

// Y (kRows rows) = values X, `columns` of them.
template <int kRows>
void MultiplyBlock(const BlockView& b, const double* X, Eigen::Index X_stride, int columns, double* Y,
                   Eigen::Index Y_stride) {
  ByEights(columns, [&](const auto& at) {
    using Some = typename decltype(at(Y))::PlainObject;
    Some sum[kRows];
    for (Some& s : sum) s.setZero();
    const double* v = b.values;
    for (int k = 0; k < b.count; ++k, v += b.stride) {
      const Some x = at(X + b.row_of[k] * X_stride);
      for (int r = 0; r < kRows; ++r) sum[r] += v[r] * x;
    }
    for (int r = 0; r < kRows; ++r) at(Y + r * Y_stride) = sum[r];
  });
}

// X -= valuesᵀ Y.
template <int kRows>
void SubtractAppliedTransposed(const BlockView& b, const double* Y, Eigen::Index Y_stride, int columns,
                               double* X, Eigen::Index X_stride) {
  ByEights(columns, [&](const auto& at) {
    using Some = typename decltype(at(X))::PlainObject;
    Some y[kRows];
    for (int r = 0; r < kRows; ++r) y[r] = at(Y + r * Y_stride);
    const double* v = b.values;
    for (int k = 0; k < b.count; ++k, v += b.stride) {
      double* x = X + b.row_of[k] * X_stride;
      Some rest = at(x);
      for (int r = 0; r < kRows; ++r) rest -= v[r] * y[r];
      at(x) = rest;
    }
  });
}

// f.operator()<rows>() for the number of rows that a closure may have.
template <class F>
void ForRows(int rows, F&& f) {
  switch (rows) {
    case 1:
      return f.template operator()<1>();
    case 2:
      return f.template operator()<2>();
    case 3:
      return f.template operator()<3>();
    case 4:
      return f.template operator()<4>();
    case 5:
      return f.template operator()<5>();
    default:
      return f.template operator()<6>();
  }
}

}  // namespace

LoopRows::LoopRows(const Mechanism& mechanism, const std::vector<int>& rows) {
  const auto& closures = mechanism.closures();
  const auto& couplings = mechanism.couplings();
  std::vector<bool> kept(static_cast<std::size_t>(mechanism.num_constraints()), false);
  for (const int row : rows) kept[static_cast<std::size_t>(row)] = true;

  // Blocks with the rows of ClosureJacobian that are theirs, group by union-find over shared coordinates.
  struct Draft {
    Block block;
    std::vector<int> rows, coordinates;
    int group = 0;
  };
  std::vector<Draft> drafts;
  int row = 0;
  const auto keep = [&](Draft draft) {
    if (draft.rows.empty()) return;
    draft.group = static_cast<int>(drafts.size());
    drafts.push_back(std::move(draft));
  };
  for (std::size_t c = 0; c < closures.size(); ++c) {
    Draft draft;
    draft.block.source = static_cast<int>(c);
    for (int i = 0; i < 6; ++i) {
      if (!closures[c].rigid(i)) continue;
      if (kept[static_cast<std::size_t>(row)]) {
        draft.block.component[draft.rows.size()] = i;
        draft.rows.push_back(row);
      }
      ++row;
    }
    if (!draft.rows.empty()) draft.coordinates = ClosureCoordinates(mechanism, closures[c]);
    keep(std::move(draft));
  }
  for (std::size_t c = 0; c < couplings.size(); ++c, ++row) {
    if (!kept[static_cast<std::size_t>(row)]) continue;
    Draft draft;
    draft.block.source = static_cast<int>(closures.size() + c);
    draft.rows = {row};
    draft.coordinates = couplings[c].Coordinates();
    keep(std::move(draft));
  }
  std::map<int, std::size_t> first;  // block that depends on a coordinate
  const auto root = [&](std::size_t b) {
    while (static_cast<std::size_t>(drafts[b].group) != b) b = static_cast<std::size_t>(drafts[b].group);
    return b;
  };
  for (std::size_t b = 0; b < drafts.size(); ++b)
    for (const int i : drafts[b].coordinates) {
      const std::size_t r = root(first.emplace(i, b).first->second), own = root(b);
      drafts[std::max(r, own)].group = static_cast<int>(std::min(r, own));
    }
  for (std::size_t b = 0; b < drafts.size(); ++b) drafts[b].group = static_cast<int>(root(b));
  std::stable_sort(drafts.begin(), drafts.end(),
                   [](const Draft& a, const Draft& b) { return a.group < b.group; });

  for (std::size_t d = 0; d < drafts.size(); ++d) {
    Draft& draft = drafts[d];
    Block& block = draft.block;
    block.begin = static_cast<int>(rows_.size());
    block.rows = static_cast<int>(draft.rows.size());
    block.coordinates = static_cast<int>(coordinates_.size());
    block.count = static_cast<int>(draft.coordinates.size());
    block.at = num_values_;
    block.stride = (block.rows + 3) / 4 * 4;
    num_values_ += block.stride * block.count;
    rows_.insert(rows_.end(), draft.rows.begin(), draft.rows.end());
    coordinates_.insert(coordinates_.end(), draft.coordinates.begin(), draft.coordinates.end());
    if (d == 0 || draft.group != drafts[d - 1].group) groups_.push_back({block.begin, 0});
    groups_.back().size += block.rows;
    blocks_.push_back(block);
  }

  num_values_ += 4;  // kernels read six rows at a time, past those of the last block
  // Where a coordinate stands in the block at hand; no block has one twice.
  std::vector<int> place(static_cast<std::size_t>(mechanism.num_coordinates()), -1);
  std::size_t begin = 0;
  for (const Group& group : groups_) {
    std::size_t end = begin;
    while (end < blocks_.size() && blocks_[end].begin < group.begin + group.size) ++end;
    for (std::size_t i = begin; i < end; ++i)
      for (std::size_t j = begin; j < end; ++j) {
        const Block &a = blocks_[i], &b = blocks_[j];
        const int *of_a = coordinates_.data() + a.coordinates, *of_b = coordinates_.data() + b.coordinates;
        for (int l = 0; l < b.count; ++l) place[static_cast<std::size_t>(of_b[l])] = l;
        Pair pair{static_cast<int>(i), static_cast<int>(j), static_cast<int>(shared_.size()), 0};
        for (int k = 0; k < a.count; ++k)
          if (const int l = place[static_cast<std::size_t>(of_a[k])]; l >= 0)
            shared_.push_back({a.at + k * a.stride, b.at + l * b.stride});
        for (int l = 0; l < b.count; ++l) place[static_cast<std::size_t>(of_b[l])] = -1;
        pair.last = static_cast<int>(shared_.size());
        if (pair.last > pair.first) pairs_.push_back(pair);
      }
    begin = end;
  }
}

void LoopRows::Fill(const Mechanism& mechanism, const Kinematics& kinematics, const VectorX& q,
                    VectorX& values) const {
  const auto& closures = mechanism.closures();
  values.resize(num_values_);
  // Every value is written, those between too: zeroing all first would cost half as much again.
  for (const Block& block : blocks_) {
    double* out = values.data() + block.at;
    if (block.source < static_cast<int>(closures.size())) {
      ClosureRows(mechanism, closures[static_cast<std::size_t>(block.source)], kinematics, block.component,
                  block.rows, block.stride, out);
    } else {
      const auto& k = mechanism.couplings()[static_cast<std::size_t>(block.source) - closures.size()];
      k.ForEachSlope(q, [&](int, double slope) {
        QuadAt(out) = Quad(slope, 0, 0, 0);
        out += block.stride;
      });
    }
  }
  values.tail<4>().setZero();
}

void LoopRows::ScaleCoordinates(const VectorX& h, VectorX& values) const {
  for (const Block& block : blocks_)
    for (int k = 0; k < block.count; ++k)
      values.segment(block.at + k * block.stride, block.rows) *=
          h(coordinates_[static_cast<std::size_t>(block.coordinates + k)]);
}

void LoopRows::Apply(const VectorX& A, const VectorX& x, VectorX& y) const {
  y.resize(size());
  for (const Block& b : blocks_) {
    const double* values = A.data() + b.at;
    const int* coordinate = coordinates_.data() + b.coordinates;
    const bool two = b.rows > 4;
    Eight sum = Eight::Zero();
    for (int k = 0; k < b.count; ++k, values += b.stride) {
      const double moved = x[coordinate[k]];
      sum.head<4>() += moved * QuadAt(values);
      if (two) sum.tail<4>() += moved * QuadAt(values + 4);
    }
    CopyRows(sum.data(), b.rows, y.data() + b.begin);
  }
}

void LoopRows::Apply(const VectorX& A, const RowMatrixX& X, RowMatrixX& Y) const {
  FORK1S_REQUIRE(Y.rows() == size() && Y.cols() >= X.cols(), Y.rows(), Y.cols());
  const auto columns = static_cast<int>(X.cols());
  if (columns < Y.cols())
    for (int i = 0; i < size(); ++i) std::fill(Row(Y, i) + columns, Row(Y, i) + Y.cols(), 0.0);
  for (const Block& b : blocks_)
    ForRows(b.rows, [&]<int kRows>() {
      MultiplyBlock<kRows>({A.data() + b.at, b.stride, coordinates_.data() + b.coordinates, b.count},
                           X.data(), X.cols(), columns, Row(Y, b.begin), Y.cols());
    });
}

void LoopRows::SubtractTransposed(const VectorX& A, const VectorX& y, VectorX& x) const {
  for (const Block& b : blocks_) {
    const double* values = A.data() + b.at;
    const int* coordinate = coordinates_.data() + b.coordinates;
    Eight in = Eight::Zero();  // and values are 0 between their rows
    CopyRows(y.data() + b.begin, b.rows, in.data());
    const Quad first = in.head<4>(), second = in.tail<4>();
    if (b.rows > 4)
      for (int k = 0; k < b.count; ++k, values += b.stride)
        x[coordinate[k]] -=
            (first.cwiseProduct(QuadAt(values)) + second.cwiseProduct(QuadAt(values + 4))).sum();
    else
      for (int k = 0; k < b.count; ++k, values += b.stride)
        x[coordinate[k]] -= first.cwiseProduct(QuadAt(values)).sum();
  }
}

void LoopRows::SubtractTransposed(const VectorX& A, const RowMatrixX& Y, RowMatrixX& X) const {
  FORK1S_REQUIRE(Y.rows() == size() && Y.cols() >= X.cols(), Y.rows(), Y.cols());
  const auto columns = static_cast<int>(X.cols());
  for (const Block& b : blocks_)
    ForRows(b.rows, [&]<int kRows>() {
      SubtractAppliedTransposed<kRows>(
          {A.data() + b.at, b.stride, coordinates_.data() + b.coordinates, b.count}, Row(Y, b.begin),
          Y.cols(), columns, X.data(), X.cols());
    });
}

std::vector<std::vector<int>> LoopRows::GroupCoordinates() const {
  std::vector<std::vector<int>> out;
  for (const Group& group : groups_) {
    std::vector<int> all;
    for (const Block& b : blocks_)
      if (b.begin >= group.begin && b.begin < group.begin + group.size)
        all.insert(all.end(), coordinates_.begin() + b.coordinates,
                   coordinates_.begin() + b.coordinates + b.count);
    std::sort(all.begin(), all.end());
    all.erase(std::unique(all.begin(), all.end()), all.end());
    out.push_back(std::move(all));
  }
  return out;
}

std::vector<int> LoopRows::GroupSizes() const {
  std::vector<int> sizes;
  for (const Group& group : groups_) sizes.push_back(group.size);
  return sizes;
}

LoopFactor::LoopFactor(const LoopRows& rows) {
  std::vector<int> sizes;
  for (const LoopRows::Block& block : rows.blocks_) sizes.push_back(block.rows);
  std::vector<std::pair<int, int>> couplings;
  for (const LoopRows::Pair& pair : rows.pairs_) couplings.emplace_back(pair.block_a, pair.block_b);
  lu_ = MultifrontalLu(sizes, couplings);
  for (const auto& [a, b] : couplings) places_.push_back(lu_.PlaceOf(a, b));
}

namespace {

// out (from row to row, `size` from column to column) = Σ_k A_k B_kᵀ over pairs of values, kRows rows by kColumns
// columns of which `columns` count.
template <int kRows, int kColumns, class Shared>
void AssignProducts(const double* A, const double* B, const Shared* first, const Shared* last, int columns,
                    double* out, int size) {
  using Rows = Eigen::Matrix<double, (kRows + 3) / 4 * 4, 1>;
  Rows sum[kColumns];
  for (Rows& column : sum) column.setZero();
  for (const Shared* s = first; s != last; ++s) {
    const Rows a = Eigen::Map<const Rows>(A + s->a);
    for (int j = 0; j < kColumns; ++j) sum[j] += B[s->b + j] * a;
  }
  for (int j = 0; j < kColumns && j < columns; ++j) {
    const double* from = sum[j].data();
    double* to = out + j * size;
    ByFours(kRows, [&](const auto& at) { at(to) = at(from); });
  }
}

}  // namespace

void LoopFactor::Compute(const LoopRows& rows, const VectorX& A, const VectorX& B) {
  lu_.ClearFill();
  for (std::size_t p = 0; p < places_.size(); ++p) {
    const LoopRows::Pair& pair = rows.pairs_[p];
    const LoopRows::Block& a = rows.blocks_[static_cast<std::size_t>(pair.block_a)];
    const LoopRows::Block& b = rows.blocks_[static_cast<std::size_t>(pair.block_b)];
    const LoopRows::Shared *first = rows.shared_.data() + pair.first, *last = rows.shared_.data() + pair.last;
    double* const out = lu_.values() + places_[p].begin;
    ForRows(a.rows, [&]<int kRows>() {
      const auto assign = b.rows <= 3 ? &AssignProducts<kRows, 3, LoopRows::Shared>
                                      : &AssignProducts<kRows, 6, LoopRows::Shared>;
      assign(A.data(), B.data(), first, last, b.rows, out, places_[p].stride);
    });
  }
  ok_ = lu_.Factor();
}

// What a singular A Bᵀ gives is not a number, and is seen as such.
void LoopFactor::SolveInPlace(VectorX& x) const {
  if (!ok_) return x.setConstant(std::numeric_limits<double>::quiet_NaN()), void();
  lu_.Solve(x.data());
}

void LoopFactor::SolveInPlace(RowMatrixX& x) const {
  if (!ok_) return x.setConstant(std::numeric_limits<double>::quiet_NaN()), void();
  lu_.SolveRows(static_cast<int>(x.cols()), x.data());
}

void LoopFactor::SolveTransposedInPlace(VectorX& x) const {
  if (!ok_) return x.setConstant(std::numeric_limits<double>::quiet_NaN()), void();
  lu_.SolveTransposed(x.data());
}

}  // namespace fork1s
