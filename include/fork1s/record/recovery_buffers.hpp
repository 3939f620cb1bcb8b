// What a program of yours needs to pose all bodies on its graphics processor: the buffers that shaders/*.glsl
// read. docs/engines.md has their layout and a host from beginning to end.
#pragma once

#include <array>
#include <cstdint>
#include <fork1s/base/error.hpp>
#include <fork1s/sim/simulation.hpp>
#include <string>
#include <vector>

namespace fork1s {

inline constexpr int kRecoveryBuffersVersion = 1;

/// The model about its present reference as two buffers, in the order of Simulation::bodies(). To be made
/// again once IsOf says that the reference has moved; from frame to frame only WriteFrame is asked.
///
///     RecoveryBuffers buffers(*simulation);          // upload tables() and numbers()
///     simulation->Step();
///     if (!buffers.IsOf(*simulation)) buffers = RecoveryBuffers(*simulation);  // upload both again
///     buffers.WriteFrame(*simulation, frame);        // upload, dispatch
class RecoveryBuffers {
 public:
  explicit RecoveryBuffers(const Simulation& simulation);

  const std::vector<std::int32_t>& tables() const { return tables_; }
  const std::vector<float>& numbers() const { return numbers_; }
  Recovery recovery() const { return recovery_; }
  int bodies() const { return Size(3); }
  int links() const { return Size(2); }  // bases and joints: what recover_joints writes
  /// How often recover_scan has to run so that recover_exact walks no path.
  int scan_passes() const;
  /// Numbers of a frame.
  std::size_t frame_size() const { return static_cast<std::size_t>(tables_[8]); }

  /// Changes with the references of the mechanisms and with what they have for coordinates: equal where the
  /// same buffers serve.
  std::uint64_t reference() const { return reference_; }
  bool IsOf(const Simulation& simulation) const;

  /// Base poses, z, and what z alone does not tell (loops closed exactly), of the present state.
  /// Throws std::invalid_argument where the buffers are not of this simulation as it is. Allocates nothing
  /// where `frame` has its size.
  void WriteFrame(const Simulation& simulation, std::vector<float>& frame) const;

  /// A frame to try a host with, and what its shaders should then give: z is moved from the present state
  /// until the joint that moves most has moved by 0.1 rad or lengths of its mechanism. Eight numbers a body,
  /// as the shaders write them, computed in double precision without them.
  struct Trial {
    std::vector<float> frame, poses;
  };
  Trial MakeTrial(const Simulation& simulation) const;

 private:
  int Size(int place) const { return tables_[static_cast<std::size_t>(place)]; }
  std::vector<std::int32_t> tables_;
  std::vector<float> numbers_;
  Recovery recovery_;
  std::uint64_t reference_ = 0;
};

/// Of the simulation as it is: RecoveryBuffers::reference() of buffers made now. No allocation.
std::uint64_t RecoveryReference(const Simulation& simulation);

/// Writes recovery.json (sizes, names, offsets, units) and recovery.bin (tables, numbers, the present frame,
/// a trial frame and its poses) into `directory`, which is made if need be. Errors: kFile.
Expected<void> SaveRecoveryBuffers(const Simulation& simulation, const std::string& directory);

}  // namespace fork1s
