// What one viewer has got and lacks.
#pragma once

#include "server/snapshot.hpp"

namespace fork1s::internal {

class Outbox {
 public:
  /// What the viewer lacks most, none where it has all: what a frame needs comes before the frame. Taken as
  /// sent.
  Message Next(const Snapshot& s, bool& binary) {
    binary = false;
    if (!s.frame) return nullptr;
    // Meshes belong to the geometry before them: another geometry in between goes first.
    if (geometry_ != s.geometry_version) {
      geometry_ = s.geometry_version;
      meshes_sent_ = false;
      return s.geometry;
    }
    if (!meshes_sent_) return meshes_sent_ = true, binary = true, s.meshes;
    if (epoch_ != s.epoch) {
      epoch_ = s.epoch;
      versions_.assign(s.maps.size(), 0);
      return s.scene;
    }
    if (settings_ != s.settings_version) return settings_ = s.settings_version, s.settings;
    if (tuning_ != s.tuning_version) return tuning_ = s.tuning_version, s.tuning;
    if (problem_ != s.problem_version) return problem_ = s.problem_version, s.problem;
    binary = true;
    for (std::size_t i = 0; i < s.maps.size(); ++i)
      if (versions_[i] != s.versions[i]) return versions_[i] = s.versions[i], s.maps[i];
    // Frame and ghost by turns: on a slow line there always is a new one of both.
    const bool frame = sequence_ != s.sequence, ghost = s.ghost && ghost_ != s.ghost_sequence;
    ghost_next_ = ghost && (ghost_next_ || !frame);
    if (ghost_next_) return ghost_next_ = false, ghost_ = s.ghost_sequence, s.ghost;
    if (!frame) return nullptr;
    ghost_next_ = true;
    return sequence_ = s.sequence, s.frame;
  }

 private:
  bool meshes_sent_ = false;
  std::uint32_t geometry_ = 0, epoch_ = 0, settings_ = 0, tuning_ = 0, problem_ = 0, sequence_ = 0,
                ghost_ = 0;
  bool ghost_next_ = false;
  std::vector<std::uint32_t> versions_;
};

}  // namespace fork1s::internal
