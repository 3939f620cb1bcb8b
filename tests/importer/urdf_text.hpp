// Pieces of URDF text.
#pragma once

#include <string>

namespace fork1s::testing_importer {

inline constexpr const char* kInertial =
    R"(<inertial><origin xyz=".1 0 0" rpy=".3 -.2 .5"/><mass value="2"/>
       <inertia ixx=".03" ixy=".001" ixz=".002" iyy=".04" iyz="-.003" izz=".05"/></inertial>)";

inline std::string Link(const std::string& name, const std::string& content = kInertial) {
  return "<link name=\"" + name + "\">" + content + "</link>\n";
}
inline std::string Joint(const std::string& name, const std::string& type, const std::string& parent,
                         const std::string& child, const std::string& content = "<axis xyz=\"0 1 0\"/>") {
  return "<joint name=\"" + name + "\" type=\"" + type + "\"><parent link=\"" + parent +
         "\"/><child link=\"" + child + "\"/>" + content + "</joint>\n";
}
inline std::string Robot(const std::string& content) { return "<robot name=\"r\">\n" + content + "</robot>"; }

/// <collision> or <visual> with that geometry.
inline std::string Part(const std::string& kind, const std::string& geometry,
                        const std::string& origin = "") {
  return "<" + kind + ">" + origin + "<geometry>" + geometry + "</geometry></" + kind + ">";
}
inline std::string MeshPart(const std::string& kind, const std::string& file, const std::string& scale = "") {
  return Part(kind, "<mesh filename=\"" + file + "\"" +
                        (scale.empty() ? std::string() : " scale=\"" + scale + "\"") + "/>");
}
/// A base and a link 'a' on a hinge, which holds `content`.
inline std::string Arm(const std::string& content) {
  return Robot(Link("base") + Link("a", content) + Joint("j", "continuous", "base", "a"));
}

}  // namespace fork1s::testing_importer
