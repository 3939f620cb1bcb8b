#include "body_names.hpp"

#include <map>

namespace fork1s::internal {

std::vector<std::string> BodyNames(const RecordingHeader& recording) {
  std::map<std::string, int> count;
  for (const SceneBody& b : recording.bodies) ++count[b.name];
  std::vector<std::string> names;
  for (const SceneBody& b : recording.bodies) {
    const bool alone = count[b.name] == 1;
    const std::string owner =
        b.mechanism < 0 ? "free" : recording.scene.mechanisms[static_cast<std::size_t>(b.mechanism)].name;
    names.push_back(alone ? b.name : owner + '/' + b.name);
  }
  return names;
}

}  // namespace fork1s::internal
