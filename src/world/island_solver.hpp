// Contact solves of a scene, island by island: what no contact joins is solved apart.
#pragma once

#include <fork1s/constraints/contact_solver.hpp>
#include <vector>

#include "parallel/scratch_pool.hpp"

namespace fork1s {

/// An island is a set of velocity blocks that contacts join. Solved together, islands would wait for the
/// slowest of them, be judged beside the largest impulse anywhere, and together pass the size that Newton can
/// take. Solved apart they do not know of each other, so that a hundred hands hold as one does, and many run
/// at a time. Deferred contacts join none: islands that the velocities found would close one between are joined and solved
/// again. The same bits for any number of threads.
class IslandSolver {
 public:
  /// Reserves memory so that solves of up to this size, islands of up to `num_together` velocities in them,
  /// do not allocate while they run on one thread. It grows with the square of an island; larger ones take
  /// theirs when they first come. What a solve writes to belongs to the threads that solve, not to this
  /// object.
  void Reserve(int num_contacts, int num_limits, int num_blocks, int num_velocities, int num_together,
               int num_freedoms = 0);

  /// As ContactSolver::Solve. The report has the most iterations and the largest residual of any island;
  /// converged only if all are.
  ContactSolverReport Solve(const std::vector<VelocityBlock>& blocks,
                            std::vector<ContactConstraint>& contacts, std::vector<LimitConstraint>& limits,
                            VectorX& velocities, const ContactSolverOptions& options);
  /// In the last solve.
  int num_islands() const { return static_cast<int>(islands_.size()); }

 private:
  // Ranges of block_order_, contact_order_ and limit_order_.
  struct Island {
    int blocks = 0, num_blocks = 0;
    int contacts = 0, num_contacts = 0;
    int limits = 0, num_limits = 0;
    bool is_solved = false;
    ContactSolverReport report;
  };
  // A solver with the island at hand in numbers of its own.
  struct Scratch {
    ContactSolver solver;
    std::vector<VelocityBlock> blocks;
    std::vector<ContactConstraint> contacts;
    std::vector<LimitConstraint> limits;
    VectorX velocities;
  };
  static ScratchPool<Scratch>& Pool();
  void JoinBlocks(const std::vector<VelocityBlock>& blocks, const std::vector<ContactConstraint>& contacts,
                  Eigen::Index num_velocities);
  void SortIntoIslands(const std::vector<VelocityBlock>& blocks,
                       const std::vector<ContactConstraint>& contacts,
                       const std::vector<LimitConstraint>& limits);
  bool JoinClosing(const std::vector<ContactConstraint>& contacts, const VectorX& velocities);
  void RecordStart(const std::vector<ContactConstraint>& contacts, const std::vector<LimitConstraint>& limits,
                   const VectorX& velocities);
  void RestoreStart(const std::vector<VelocityBlock>& blocks, std::vector<ContactConstraint>& contacts,
                    std::vector<LimitConstraint>& limits, VectorX& velocities) const;
  int BlockOf(int row) const { return row < 0 ? -1 : block_of_[static_cast<std::size_t>(row)]; }
  int IslandOf(int block);
  bool Join(int block_a, int block_b);
  void SolveIslands(const std::vector<VelocityBlock>& blocks, std::vector<ContactConstraint>& contacts,
                    std::vector<LimitConstraint>& limits, VectorX& velocities,
                    const ContactSolverOptions& options);
  void SolveIsland(Island& island, const std::vector<VelocityBlock>& blocks,
                   std::vector<ContactConstraint>& contacts, std::vector<LimitConstraint>& limits,
                   VectorX& velocities, const ContactSolverOptions& options, Scratch& scratch) const;

  std::vector<ScratchPool<Scratch>::Lease> borrowed_;  // within Solve
  std::vector<Island> islands_, islands_before_;
  std::vector<int> unsolved_;  // islands
  std::vector<int> between_;   // deferred contacts of two islands
  // Before the solve, where there are any of these.
  struct ContactStart {
    Vector3 impulse, moment;
  };
  VectorX start_velocities_;
  std::vector<ContactStart> start_contacts_;
  std::vector<double> start_limits_;
  std::vector<int> block_of_;                   // velocity row -> block
  std::vector<int> parent_;                     // of a block in the union of blocks
  std::vector<int> island_of_, island_before_;  // per block
  std::vector<int> block_order_, contact_order_, limit_order_;
  std::vector<int> new_offset_;  // block -> first row in its island
};

}  // namespace fork1s
