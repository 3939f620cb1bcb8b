// A model file with some of its numbers changed: the text stays as it was written, comments included.
#pragma once

#include <fork1s/importer/importer.hpp>
#include <string>
#include <vector>

namespace fork1s {

/// One change. Numbers in SI, as a scene has them.
struct ModelChange {
  enum class Of { kJoint, kActuator, kBody, kShape };
  enum class Quantity { kStiffness, kDamping, kRange, kDryFriction, kForceRange, kInertia, kFriction };
  Of of = Of::kJoint;
  Quantity quantity = Quantity::kStiffness;
  std::string name;
  double value = 0, upper = 0;  // upper: of ranges
  SpatialInertia inertia;       // whole, of kInertia
};

struct ChangedText {
  std::string text;
  std::vector<std::string> notes;  // what found no place, a sentence each
};

/// MJCF text with the changes written into the elements that bear the names, and `moment`, a <key> element,
/// in a <keyframe> of its own. What stands in included files, defaults or replicas finds no place. Errors:
/// kFormat.
Expected<ChangedText> ChangeModelText(const std::string& path, const std::string& text,
                                      const std::vector<ModelChange>& changes, const std::string& moment);

/// The whole file as it is. Errors: kFile.
Expected<std::string> ReadModelText(const std::string& path);

/// A state of the scene that the file imports to as an element of MJCF: <key name= qpos= qvel= ctrl=/>.
/// `scene` as LoadMechanism gave it; `state` in its order. Errors as of LoadMechanism, kModel for URDF.
Expected<std::string> MomentAsMjcf(const std::string& path, const ImportOptions& options,
                                   const KeyframeDef& state, const std::string& name, double time);

}  // namespace fork1s
