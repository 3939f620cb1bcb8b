// The newest of everything that viewers may want, shared between threads and never changed.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace fork1s {

using Message = std::shared_ptr<const std::string>;

struct Snapshot {
  Message geometry;  // JSON, the same for the whole session
  Message meshes;    // binary
  Message scene;     // JSON, anew whenever `epoch` counts on
  std::uint32_t epoch = 0;
  Message settings;  // JSON, anew whenever `settings_version` counts on
  std::uint32_t settings_version = 0;
  std::vector<Message> maps;  // one a mechanism
  std::vector<std::uint32_t> versions;
  Message frame;
  std::uint32_t sequence = 0;
};

}  // namespace fork1s
