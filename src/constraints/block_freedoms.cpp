#include "block_freedoms.hpp"

#include <algorithm>
#include <fork1s/base/error.hpp>

#include "linalg/in_place.hpp"

namespace fork1s::internal {
namespace {

// As many freedoms, a body's or a finger's, are not looked through for some that move nothing.
constexpr int kAllMove = 6;

template <class Moves>
void FindSpansWhere(int freedoms, const Moves& moves, Span (&out)[2]) {
  int first = 0, last = freedoms - 1, gap_begin = 0, gap = 0;
  while (first < freedoms && !moves(first)) ++first;
  while (last >= first && !moves(last)) --last;
  if (freedoms > kAllMove)
    for (int i = first + 1, before = first; i <= last; ++i) {
      if (!moves(i)) continue;
      if (i - before - 1 > gap) {
        gap_begin = before + 1;
        gap = i - before - 1;
      }
      before = i;
    }
  const int end = std::max(first, last + 1);
  out[0] = {first, gap > 0 ? gap_begin : end};
  out[1] = gap > 0 ? Span{gap_begin + gap, end} : Span();
}

void FindFreedoms(const double* Y, int begin, int freedoms, PortRows& port) {
  const auto moves = [&](int i) {
    for (int c = 0; c < 6; ++c)
      if (Y[static_cast<std::ptrdiff_t>(c) * port.stride + i] != 0) return true;
    return false;
  };
  Span spans[2];
  FindSpansWhere(freedoms, moves, spans);
  port.Y = Y + spans[0].begin;
  port.begin = begin + spans[0].begin;
  port.freedoms = spans[0].size();
  port.Y_apart = Y + spans[1].begin;
  port.begin_apart = begin + spans[1].begin;
  port.freedoms_apart = spans[1].size();
}

}  // namespace

void FindSpans(const double* Y, int freedoms, Span (&out)[2]) {
  FindSpansWhere(
      freedoms, [&](int i) { return Y[i] != 0; }, out);
}

void BlockFreedoms::Reserve(int num_velocities, int num_freedoms) {
  const auto velocities = static_cast<std::size_t>(num_velocities);
  block_of_.reserve(velocities);
  port_of_.reserve(velocities);
  blocks_.reserve(velocities);
  by_freedom_.reserve(2 * velocities * velocities);
  storage_.reserve(velocities * static_cast<std::size_t>(num_freedoms));
}

void BlockFreedoms::SetBlocks(const std::vector<VelocityBlock>& blocks, int num_velocities) {
  block_of_.assign(static_cast<std::size_t>(num_velocities), -1);
  port_of_.assign(static_cast<std::size_t>(num_velocities), -1);
  blocks_.resize(blocks.size());
  const auto moves = [](const VelocityBlock& block, int freedom) {
    for (int c = 0; c < block.size; ++c)
      if (block.Y[static_cast<std::ptrdiff_t>(c) * block.stride + freedom] != 0) return true;
    return false;
  };
  std::size_t room = 0;
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    const VelocityBlock& block = blocks[b];
    int moving = block.freedoms;
    if (moving > kAllMove) {
      moving = 0;
      for (int i = 0; i < block.freedoms; ++i) moving += moves(block, i) ? 1 : 0;
    }
    blocks_[b].count = moving;
    if (moving < block.freedoms || moving > block.size)
      room += static_cast<std::size_t>(moving) * static_cast<std::size_t>(block.size);
  }
  storage_.resize(room);
  room = 0;
  for (std::size_t b = 0; b < blocks.size(); ++b)
    room += static_cast<std::size_t>(8 * std::min(blocks_[b].count, blocks[b].size) * (blocks[b].size / 6));
  if (by_freedom_.size() < room) by_freedom_.resize(room);
  by_freedom_used_ = 0;
  room = 0;
  count_ = 0;
  for (std::size_t b = 0; b < blocks.size(); ++b) {
    const VelocityBlock& block = blocks[b];
    FORK1S_REQUIRE(block.offset >= 0 && block.offset + block.size <= num_velocities, b);
    std::fill_n(block_of_.begin() + block.offset, block.size, static_cast<int>(b));
    Block& f = blocks_[b];
    const int moving = f.count;
    f = {block.Y, block.stride, count_, moving, block.offset, block.size};
    if (moving < block.freedoms || moving > block.size) {
      // Legs that touch nothing are left out.
      double* Y = storage_.data() + room;
      for (int i = 0, next = 0; i < block.freedoms; ++i) {
        if (!moves(block, i)) continue;
        for (int c = 0; c < block.size; ++c)
          Y[static_cast<std::ptrdiff_t>(c) * moving + next] =
              block.Y[static_cast<std::ptrdiff_t>(c) * block.stride + i];
        ++next;
      }
      f.Y = Y;
      f.stride = moving;
      if (moving > block.size) {
        // Ports move by no more than their rows can tell apart: Y = Q R, and R takes the place of Y.
        TriangularRoot(Y, moving, block.size);
        f.count = block.size;
      }
      room += static_cast<std::size_t>(moving) * static_cast<std::size_t>(block.size);
    }
    count_ += f.count;
  }
}

int BlockFreedoms::PortAt(int row, std::vector<PortRows>& ports) {
  if (row < 0) return -1;
  FORK1S_REQUIRE(row + 6 <= static_cast<int>(block_of_.size()), row);
  int& known = port_of_[static_cast<std::size_t>(row)];
  if (known >= 0) return known;
  const Block& f = BlockOf(row);
  FORK1S_REQUIRE(row + 6 <= f.offset + f.rows, row, f.offset, f.rows);
  known = static_cast<int>(ports.size());
  PortRows& port = ports.emplace_back();
  port.stride = f.stride;
  port.row = row;
  FindFreedoms(f.Row(row), f.begin, f.count, port);
  port.SetByFreedom(by_freedom_.data() + by_freedom_used_);
  by_freedom_used_ += 8 * static_cast<std::size_t>(port.freedoms + port.freedoms_apart);
  return known;
}

const BlockFreedoms::Block& BlockFreedoms::BlockOf(int row) const {
  FORK1S_REQUIRE(row >= 0 && row < static_cast<int>(block_of_.size()), row);
  const int b = block_of_[static_cast<std::size_t>(row)];
  FORK1S_REQUIRE(b >= 0, row);
  return blocks_[static_cast<std::size_t>(b)];
}

}  // namespace fork1s::internal
