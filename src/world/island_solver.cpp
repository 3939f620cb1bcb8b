#include "world/island_solver.hpp"

#include <algorithm>
#include <fork1s/base/error.hpp>

#include "parallel/parallel_for.hpp"

namespace fork1s {
namespace {

// Contacts that are worth a thread: half a microsecond each.
constexpr int kContactsPerRange = 64;

void Merge(const ContactSolverReport& of_island, ContactSolverReport& report) {
  report.newton_iterations = std::max(report.newton_iterations, of_island.newton_iterations);
  report.fallback = std::max(report.fallback, of_island.fallback);
  // Written so that a residual that is no number stays.
  if (!(of_island.residual <= report.residual)) report.residual = of_island.residual;
  report.residual_impulse = std::max(report.residual_impulse, of_island.residual_impulse);
  report.residual_speed = std::max(report.residual_speed, of_island.residual_speed);
  report.active += of_island.active;
  report.sticking += of_island.sticking;
  report.sliding += of_island.sliding;
  report.converged = report.converged && of_island.converged;
}

// A place for every item in the order of its island; items of an island keep theirs. `first` of every island
// must be set; `count` grows from 0.
template <class Islands, class IslandOfItem>
void Sort(int items, Islands& islands, int Islands::value_type::*first, int Islands::value_type::*count,
          std::vector<int>& order, const IslandOfItem& island_of) {
  for (auto& island : islands) island.*count = 0;
  for (int i = 0; i < items; ++i)
    if (const int k = island_of(i); k >= 0) ++(islands[static_cast<std::size_t>(k)].*count);
  int next = 0;
  for (auto& island : islands) {
    island.*first = next;
    next += island.*count;
    island.*count = 0;
  }
  order.resize(static_cast<std::size_t>(next));
  for (int i = 0; i < items; ++i)
    if (const int k = island_of(i); k >= 0) {
      auto& island = islands[static_cast<std::size_t>(k)];
      order[static_cast<std::size_t>(island.*first + (island.*count)++)] = i;
    }
}

}  // namespace

ScratchPool<IslandSolver::Scratch>& IslandSolver::Pool() {
  static ScratchPool<Scratch>& pool = *new ScratchPool<Scratch>;  // for solvers that outlive static objects
  return pool;
}

void IslandSolver::Reserve(int num_contacts, int num_limits, int num_blocks, int num_velocities,
                           int num_together, int num_freedoms) {
  const auto contacts = static_cast<std::size_t>(num_contacts), limits = static_cast<std::size_t>(num_limits),
             blocks = static_cast<std::size_t>(num_blocks);
  const auto lease = Pool().Borrow();
  Scratch& scratch = *lease;
  scratch.solver.Reserve(num_contacts, num_limits, std::min(num_velocities, num_together), num_freedoms);
  scratch.blocks.reserve(blocks);
  scratch.contacts.reserve(contacts);
  scratch.limits.reserve(limits);
  if (scratch.velocities.size() < num_velocities) scratch.velocities.resize(num_velocities);
  borrowed_.reserve(1);
  islands_.reserve(blocks);
  islands_before_.reserve(blocks);
  block_of_.reserve(static_cast<std::size_t>(num_velocities));
  if (start_velocities_.size() < num_velocities) start_velocities_.resize(num_velocities);
  start_contacts_.reserve(contacts);
  start_limits_.reserve(limits);
  for (std::vector<int>* v :
       {&parent_, &island_of_, &island_before_, &block_order_, &new_offset_, &unsolved_})
    v->reserve(blocks);
  for (std::vector<int>* v : {&contact_order_, &between_}) v->reserve(contacts);
  limit_order_.reserve(limits);
}

int IslandSolver::IslandOf(int block) {
  while (parent_[static_cast<std::size_t>(block)] != block) {
    int& up = parent_[static_cast<std::size_t>(block)];
    up = parent_[static_cast<std::size_t>(up)];
    block = up;
  }
  return block;
}

// The lower number stands for the union, so that islands come in the order of their first blocks. False where both
// are of one already.
bool IslandSolver::Join(int block_a, int block_b) {
  const int a = IslandOf(block_a), b = IslandOf(block_b);
  parent_[static_cast<std::size_t>(std::max(a, b))] = std::min(a, b);
  return a != b;
}

void IslandSolver::JoinBlocks(const std::vector<VelocityBlock>& blocks,
                              const std::vector<ContactConstraint>& contacts, Eigen::Index num_velocities) {
  const int count = static_cast<int>(blocks.size());
  block_of_.assign(static_cast<std::size_t>(num_velocities), -1);
  parent_.resize(blocks.size());
  for (int b = 0; b < count; ++b) {
    const VelocityBlock& block = blocks[static_cast<std::size_t>(b)];
    FORK1S_REQUIRE(block.offset >= 0 && block.offset + block.size <= num_velocities, b);
    std::fill_n(block_of_.begin() + block.offset, block.size, b);
    parent_[static_cast<std::size_t>(b)] = b;
  }
  between_.clear();
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const int a = BlockOf(contacts[i].port_a), b = BlockOf(contacts[i].port_b);
    if (a < 0 || b < 0) continue;
    if (contacts[i].IsDeferred())
      between_.push_back(static_cast<int>(i));
    else
      Join(a, b);
  }
  islands_.clear();
  island_of_.assign(blocks.size(), -1);
}

// Islands by the joined blocks. One that had the same blocks before is as solved as it was.
void IslandSolver::SortIntoIslands(const std::vector<VelocityBlock>& blocks,
                                   const std::vector<ContactConstraint>& contacts,
                                   const std::vector<LimitConstraint>& limits) {
  islands_before_.swap(islands_);
  island_before_.swap(island_of_);
  const int count = static_cast<int>(blocks.size());
  island_of_.assign(blocks.size(), -1);
  islands_.clear();
  for (int b = 0; b < count; ++b) {
    const auto root = static_cast<std::size_t>(IslandOf(b));
    const int before = island_before_[static_cast<std::size_t>(b)];
    if (island_of_[root] < 0) {
      island_of_[root] = static_cast<int>(islands_.size());
      islands_.push_back(before < 0 ? Island{} : islands_before_[static_cast<std::size_t>(before)]);
    } else if (before != island_before_[root]) {
      islands_[static_cast<std::size_t>(island_of_[root])].is_solved = false;
    }
    island_of_[static_cast<std::size_t>(b)] = island_of_[root];
  }
  std::erase_if(between_, [&](int i) {
    const ContactConstraint& c = contacts[static_cast<std::size_t>(i)];
    return island_of_[static_cast<std::size_t>(BlockOf(c.port_a))] ==
           island_of_[static_cast<std::size_t>(BlockOf(c.port_b))];
  });
  if (islands_.size() <= 1 && islands_before_.empty()) return;  // solved as it stands
  auto island_of = [&](int block) { return block < 0 ? -1 : island_of_[static_cast<std::size_t>(block)]; };
  Sort(count, islands_, &Island::blocks, &Island::num_blocks, block_order_, island_of);
  Sort(static_cast<int>(contacts.size()), islands_, &Island::contacts, &Island::num_contacts, contact_order_,
       [&](int i) {
         const ContactConstraint& c = contacts[static_cast<std::size_t>(i)];
         const int a = island_of(BlockOf(c.port_a)), b = island_of(BlockOf(c.port_b));
         return a < 0 ? b : b < 0 || a == b ? a : -1;  // of two islands: of none
       });
  Sort(static_cast<int>(limits.size()), islands_, &Island::limits, &Island::num_limits, limit_order_,
       [&](int i) { return island_of(BlockOf(limits[static_cast<std::size_t>(i)].row)); });
  new_offset_.resize(blocks.size());
  for (const Island& island : islands_) {
    int next = 0;
    for (int k = 0; k < island.num_blocks; ++k) {
      const auto b = static_cast<std::size_t>(block_order_[static_cast<std::size_t>(island.blocks + k)]);
      new_offset_[b] = next;
      next += blocks[b].size;
    }
  }
}

// Islands between which these velocities close a contact. False where there is none.
bool IslandSolver::JoinClosing(const std::vector<ContactConstraint>& contacts, const VectorX& velocities) {
  bool any = false;
  for (const int i : between_)
    if (const ContactConstraint& c = contacts[static_cast<std::size_t>(i)]; c.NormalSpeed(velocities) < 0)
      any = Join(BlockOf(c.port_a), BlockOf(c.port_b)) || any;
  return any;
}

void IslandSolver::RecordStart(const std::vector<ContactConstraint>& contacts,
                               const std::vector<LimitConstraint>& limits, const VectorX& velocities) {
  if (start_velocities_.size() < velocities.size()) start_velocities_.resize(velocities.size());
  start_velocities_.head(velocities.size()) = velocities;
  start_contacts_.clear();
  for (const ContactConstraint& c : contacts) start_contacts_.push_back({c.impulse, c.moment});
  start_limits_.clear();
  for (const LimitConstraint& l : limits) start_limits_.push_back(l.impulse);
}

// Of islands that are not solved.
void IslandSolver::RestoreStart(const std::vector<VelocityBlock>& blocks,
                                std::vector<ContactConstraint>& contacts,
                                std::vector<LimitConstraint>& limits, VectorX& velocities) const {
  for (const Island& island : islands_) {
    if (island.is_solved) continue;
    for (int k = island.blocks; k < island.blocks + island.num_blocks; ++k) {
      const VelocityBlock& b = blocks[static_cast<std::size_t>(block_order_[static_cast<std::size_t>(k)])];
      velocities.segment(b.offset, b.size) = start_velocities_.segment(b.offset, b.size);
    }
    for (int k = island.contacts; k < island.contacts + island.num_contacts; ++k) {
      const auto i = static_cast<std::size_t>(contact_order_[static_cast<std::size_t>(k)]);
      contacts[i].impulse = start_contacts_[i].impulse;
      contacts[i].moment = start_contacts_[i].moment;
    }
    for (int k = island.limits; k < island.limits + island.num_limits; ++k) {
      const auto i = static_cast<std::size_t>(limit_order_[static_cast<std::size_t>(k)]);
      limits[i].impulse = start_limits_[i];
    }
  }
}

void IslandSolver::SolveIsland(Island& island, const std::vector<VelocityBlock>& blocks,
                               std::vector<ContactConstraint>& contacts, std::vector<LimitConstraint>& limits,
                               VectorX& velocities, const ContactSolverOptions& options,
                               Scratch& scratch) const {
  auto moved = [&](int row) {
    const auto b = static_cast<std::size_t>(block_of_[static_cast<std::size_t>(row)]);
    return row - blocks[b].offset + new_offset_[b];
  };
  scratch.blocks.clear();
  Eigen::Index size = 0;
  for (int k = 0; k < island.num_blocks; ++k) {
    VelocityBlock block =
        blocks[static_cast<std::size_t>(block_order_[static_cast<std::size_t>(island.blocks + k)])];
    block.offset = static_cast<int>(size);
    size += block.size;
    scratch.blocks.push_back(block);
  }
  if (scratch.velocities.size() < size) scratch.velocities.resize(size);
  auto each_block = [&](const auto& act) {
    for (int k = 0; k < island.num_blocks; ++k) {
      const VelocityBlock& from =
          blocks[static_cast<std::size_t>(block_order_[static_cast<std::size_t>(island.blocks + k)])];
      act(from.offset, scratch.blocks[static_cast<std::size_t>(k)].offset, from.size);
    }
  };
  each_block(
      [&](int from, int to, int n) { scratch.velocities.segment(to, n) = velocities.segment(from, n); });
  scratch.contacts.clear();
  for (int k = 0; k < island.num_contacts; ++k) {
    ContactConstraint& c = scratch.contacts.emplace_back(
        contacts[static_cast<std::size_t>(contact_order_[static_cast<std::size_t>(island.contacts + k)])]);
    if (c.port_a >= 0) c.port_a = moved(c.port_a);
    if (c.port_b >= 0) c.port_b = moved(c.port_b);
  }
  scratch.limits.clear();
  for (int k = 0; k < island.num_limits; ++k) {
    LimitConstraint& l = scratch.limits.emplace_back(
        limits[static_cast<std::size_t>(limit_order_[static_cast<std::size_t>(island.limits + k)])]);
    l.row = moved(l.row);
  }
  island.report = scratch.solver.Solve(scratch.blocks, scratch.contacts, scratch.limits,
                                       scratch.velocities.head(size), options);
  island.is_solved = true;
  each_block(
      [&](int from, int to, int n) { velocities.segment(from, n) = scratch.velocities.segment(to, n); });
  for (int k = 0; k < island.num_contacts; ++k) {
    ContactConstraint& c =
        contacts[static_cast<std::size_t>(contact_order_[static_cast<std::size_t>(island.contacts + k)])];
    // All of it, so that nothing that a solve says is lost.
    const int port_a = c.port_a, port_b = c.port_b;
    c = scratch.contacts[static_cast<std::size_t>(k)];
    c.port_a = port_a;
    c.port_b = port_b;
  }
  for (int k = 0; k < island.num_limits; ++k)
    limits[static_cast<std::size_t>(limit_order_[static_cast<std::size_t>(island.limits + k)])].impulse =
        scratch.limits[static_cast<std::size_t>(k)].impulse;
}

// Those that are not solved, side by side.
void IslandSolver::SolveIslands(const std::vector<VelocityBlock>& blocks,
                                std::vector<ContactConstraint>& contacts,
                                std::vector<LimitConstraint>& limits, VectorX& velocities,
                                const ContactSolverOptions& options) {
  unsolved_.clear();
  int rows = 0;
  for (std::size_t k = 0; k < islands_.size(); ++k) {
    if (islands_[k].is_solved) continue;
    unsolved_.push_back(static_cast<int>(k));
    rows += islands_[k].num_contacts + islands_[k].num_limits;
  }
  const int count = static_cast<int>(unsolved_.size());
  const int ranges = std::clamp(rows / kContactsPerRange, 1, count);
  const ScratchPool<Scratch>::ReturnAll at_end(borrowed_);
  while (static_cast<int>(borrowed_.size()) < ranges) borrowed_.push_back(Pool().Borrow());
  auto work = [&](int range) {
    Scratch& scratch = *borrowed_[static_cast<std::size_t>(range)];
    for (int k = range * count / ranges; k < (range + 1) * count / ranges; ++k)
      SolveIsland(islands_[static_cast<std::size_t>(unsolved_[static_cast<std::size_t>(k)])], blocks,
                  contacts, limits, velocities, options, scratch);
  };
  if (ranges == 1)
    work(0);
  else
    ParallelFor(0, ranges, 1, [&](int begin, int end) {
      for (int range = begin; range < end; ++range) work(range);
    });
}

ContactSolverReport IslandSolver::Solve(const std::vector<VelocityBlock>& blocks,
                                        std::vector<ContactConstraint>& contacts,
                                        std::vector<LimitConstraint>& limits, VectorX& velocities,
                                        const ContactSolverOptions& options) {
  JoinBlocks(blocks, contacts, velocities.size());
  SortIntoIslands(blocks, contacts, limits);
  if (islands_.size() <= 1)
    return Pool().Borrow()->solver.Solve(blocks, contacts, limits, velocities, options);
  for (const int i : between_) contacts[static_cast<std::size_t>(i)].utilization = 0;
  if (!between_.empty()) RecordStart(contacts, limits, velocities);
  SolveIslands(blocks, contacts, limits, velocities, options);
  while (JoinClosing(contacts, velocities)) {
    SortIntoIslands(blocks, contacts, limits);
    RestoreStart(blocks, contacts, limits, velocities);
    SolveIslands(blocks, contacts, limits, velocities, options);
  }
  ContactSolverReport report;
  for (const Island& island : islands_) Merge(island.report, report);
  return report;
}

}  // namespace fork1s
