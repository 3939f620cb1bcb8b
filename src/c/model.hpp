// What a model of the C interface holds.
#pragma once

#include <fork1s/importer/importer.hpp>
#include <memory>
#include <string>
#include <vector>

namespace fork1s::c {

/// Never changed once it is made, so that simulations and snapshots share it.
struct Model {
  std::string origin;  // the path, or what stands for it in messages
  ImportedScene imported;
  std::vector<FileJoint> joints;   // those that move, in the order of the file
  std::vector<std::string> notes;  // of the importer
};

}  // namespace fork1s::c

struct fork1s_model {
  std::shared_ptr<const fork1s::c::Model> model;
};
