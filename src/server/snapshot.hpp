// The newest of everything that viewers may want, shared between threads and never changed.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace fork1s {

using Message = std::shared_ptr<const std::string>;

struct Snapshot {
  Message geometry;  // JSON, again with `meshes` whenever `geometry_version` counts on: another model
  Message meshes;    // binary
  std::uint32_t geometry_version = 0;
  Message scene;  // JSON, again whenever `epoch` counts on
  std::uint32_t epoch = 0;
  Message settings;  // JSON, again whenever `settings_version` counts on
  std::uint32_t settings_version = 0;
  Message tuning;  // JSON, again whenever `tuning_version` counts on
  std::uint32_t tuning_version = 0;
  Message problem;  // JSON: what is wrong with the model's file; none while `problem_version` is 0
  std::uint32_t problem_version = 0;
  std::vector<Message> maps;  // one a mechanism
  std::vector<std::uint32_t> versions;
  Message frame;
  std::uint32_t sequence = 0;
  Message ghost;  // none while it is off
  std::uint32_t ghost_sequence = 0;
};

}  // namespace fork1s
