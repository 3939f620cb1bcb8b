// Velocity blocks in freedoms in which their implicit operators are the identity, and the ports among their rows.
#pragma once

#include <cstddef>
#include <fork1s/constraints/contact_solver.hpp>
#include <vector>

#include "elimination_order.hpp"
#include "port_rows.hpp"

namespace fork1s::internal {

/// From the first freedom that moves something, Y not 0, to the last, apart at the longest gap between them.
void FindSpans(const double* Y, int freedoms, Span (&out)[2]);

class BlockFreedoms {
 public:
  /// A block in freedoms: its own, or as many as it has rows where those are fewer.
  struct Block {
    const double* Y = nullptr;
    int stride = 0, begin = 0, count = 0;
    int offset = 0, rows = 0;  // in the stacked velocities

    /// Y of a row of the stacked velocities.
    const double* Row(int row) const { return Y + static_cast<std::ptrdiff_t>(row - offset) * stride; }
  };

  void Reserve(int num_velocities, int num_freedoms);
  void SetBlocks(const std::vector<VelocityBlock>& blocks, int num_velocities);
  /// Place in `ports`, where it is added once, of the port at six rows from `row` on; -1 where that is negative.
  int PortAt(int row, std::vector<PortRows>& ports);
  const Block& BlockOf(int row) const;
  const std::vector<Block>& blocks() const { return blocks_; }
  /// Of all blocks.
  int count() const { return count_; }

 private:
  int count_ = 0;
  std::vector<Block> blocks_;
  std::vector<int> block_of_, port_of_;  // of the stacked velocities
  std::vector<double> by_freedom_;       // of ports
  std::size_t by_freedom_used_ = 0;
  std::vector<double> storage_;  // Y of blocks with fewer rows than freedoms
};

}  // namespace fork1s::internal
