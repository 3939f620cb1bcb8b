// What of a URDF nothing reads.
#include <cstring>

#include "urdf_parts.hpp"

namespace fork1s::internal {
namespace {

using tinyxml2::XMLElement;

// What is read of an element.
struct ReadOf {
  std::set<std::string> elements, attributes;
};

const std::map<std::string, ReadOf>& ReadOfElements() {
  static const std::map<std::string, ReadOf> read = {
      {"link", {{"inertial", "visual", "collision"}, {"name"}}},
      {"inertial", {{"origin", "mass", "inertia"}, {}}},
      {"mass", {{}, {"value"}}},
      {"inertia", {{}, {"ixx", "ixy", "ixz", "iyy", "iyz", "izz"}}},
      {"origin", {{}, {"xyz", "rpy"}}},
      {"visual", {{"origin", "geometry", "material"}, {"name"}}},
      {"collision", {{"origin", "geometry", "material"}, {"name"}}},
      {"box", {{}, {"size"}}},
      {"cylinder", {{}, {"radius", "length"}}},
      {"capsule", {{}, {"radius", "length"}}},
      {"sphere", {{}, {"radius"}}},
      {"mesh", {{}, {"filename", "scale"}}},
      {"material", {{"color"}, {"name"}}},
      {"color", {{}, {"rgba"}}},
      {"joint",
       {{"origin", "parent", "child", "axis", "limit", "dynamics", "mimic", "calibration"},
        {"name", "type"}}},
      {"parent", {{}, {"link"}}},
      {"child", {{}, {"link"}}},
      {"axis", {{}, {"xyz"}}},
      {"limit", {{}, {"lower", "upper", "effort", "velocity"}}},
      {"dynamics", {{}, {"damping", "friction"}}},
      {"mimic", {{}, {"joint", "multiplier", "offset"}}},
      {"loop_joint", {{"link1", "link2", "axis"}, {"name", "type"}}},
      {"link1", {{}, {"link", "xyz", "rpy"}}},
      {"link2", {{}, {"link", "xyz", "rpy"}}},
      {"drake:ball_constraint",
       {{"drake:ball_constraint_body_A", "drake:ball_constraint_body_B", "drake:ball_constraint_p_AP",
         "drake:ball_constraint_p_BQ"},
        {"name"}}},
      {"drake:ball_constraint_body_A", {{}, {"name"}}},
      {"drake:ball_constraint_body_B", {{}, {"name"}}},
      {"drake:ball_constraint_p_AP", {{}, {"value"}}},
      {"drake:ball_constraint_p_BQ", {{}, {"value"}}}};
  return read;
}

}  // namespace

void CountUnreadAttributes(const XMLElement& e, const std::set<std::string>& read,
                           std::map<std::string, int>& unread) {
  for (const auto* a = e.FirstAttribute(); a != nullptr; a = a->Next())
    if (!read.contains(a->Name()) && std::strncmp(a->Name(), "xmlns", 5) != 0)
      ++unread[fmt::format("{}= in <{}>", a->Name(), e.Name())];
}

// <calibration> says where an encoder has its zero.
void CountUnread(XMLElement& e, std::map<std::string, int>& unread) {
  static const std::set<std::string> several = {"visual", "collision", "material"};
  const bool is_geometry = std::strcmp(e.Name(), "geometry") == 0;  // shapes that are none are told elsewhere
  const auto known = ReadOfElements().find(e.Name());
  if (known == ReadOfElements().end() && !is_geometry) return;
  CountUnreadAttributes(e, is_geometry ? std::set<std::string>() : known->second.attributes, unread);
  std::set<std::string> found;
  for (XMLElement *child = e.FirstChildElement(), *next = nullptr; child != nullptr; child = next) {
    next = child->NextSiblingElement();
    const std::string name = child->Name();
    if (!is_geometry && !known->second.elements.contains(name)) {
      ++unread[fmt::format("<{}> in <{}>", name, e.Name())];
    } else if (!several.contains(name) && !found.insert(is_geometry ? "shape" : name).second) {
      ++unread[fmt::format("further <{}> in <{}>", name, e.Name())];
      e.DeleteChild(child);
    } else {
      CountUnread(*child, unread);
    }
  }
}

}  // namespace fork1s::internal
