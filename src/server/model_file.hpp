// The file behind a live simulation: what it says beyond the scene, and who writes changes into a copy of it.
#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "server/tunables.hpp"

namespace fork1s {

/// What a viewer asks to keep.
struct CopyRequest {
  std::vector<Tunable> changed;  // those with a value that is not the file's
  std::optional<KeyframeDef> moment;
  double time = 0;               // s, of the moment
  bool write_file = true;        // false: only the text of the moment is wanted
  const Scene* scene = nullptr;  // that `changed` and `moment` count in: as the simulation orders it
};

struct WrittenCopy {
  std::string path;                // of the copy; empty: none was asked for
  std::string text;                // of the moment, as the file's format has it
  std::vector<std::string> notes;  // what could not be written and why, a sentence each
};

struct ModelFile {
  std::vector<ServoShare> servos;
  /// Never writes over a file that is there. None: nothing can be kept.
  std::function<Expected<WrittenCopy>(const CopyRequest&)> write;
};

}  // namespace fork1s
