#include <fork1s/sim/fidelity.hpp>

#include <algorithm>

namespace fork1s {

const char* Name(DetailLevel level) {
  switch (level) {
    case DetailLevel::kObject:
      return "object";
    case DetailLevel::kInterface:
      return "interface";
    case DetailLevel::kParents:
      return "parents";
    case DetailLevel::kAll:
      return "all";
  }
  return "";
}

Scene RefineInterfaces(Scene scene, DetailLevel level) {
  for (MechanismDef& def : scene.mechanisms) {
    auto add = [&](const std::string& name) {
      if (std::find(def.interfaces.begin(), def.interfaces.end(), name) == def.interfaces.end())
        def.interfaces.push_back(name);
    };
    if (level == DetailLevel::kParents)
      for (const std::string& name : std::vector<std::string>(def.interfaces)) {
        const BodyIndex body = def.FindBody(name);
        if (!body.valid() || body.value() == 0) continue;
        const BodyIndex parent = def.bodies[body.u()].parent;
        if (parent.valid() && parent.value() > 0) add(def.bodies[parent.u()].name);
      }
    if (level == DetailLevel::kAll)
      for (std::size_t b = 1; b < def.bodies.size(); ++b) add(def.bodies[b].name);
  }
  return scene;
}

}  // namespace fork1s
