// Shapes and colours of URDF links.
#include <algorithm>
#include <cstdlib>
#include <sstream>

#include "names.hpp"
#include "spatial/roll_pitch_yaw.hpp"
#include "urdf_parts.hpp"

namespace fork1s::internal {
namespace {

using tinyxml2::XMLElement;

// A material becomes its colour: MuJoCo takes one material a shape, and one colour a name.
void PrepareMaterial(UrdfWork& work, const std::string& link, XMLElement& visual) {
  XMLElement* material = visual.FirstChildElement("material");
  if (material == nullptr) return;
  bool several = false;
  while (XMLElement* second = material->NextSiblingElement("material")) {
    visual.DeleteChild(second);
    several = true;
  }
  if (several && (work.materials_dropped.empty() || work.materials_dropped.back() != link)) {
    work.materials_dropped.push_back(link);
  }
  std::vector<double> rgba = NumbersOf(material->FirstChildElement("color"), "rgba");
  if (rgba.size() != 4) {
    const auto named = work.materials.find(NameOf(*material));
    rgba.clear();
    if (named != work.materials.end()) {
      rgba.assign(named->second.data(), named->second.data() + 4);
    }
  }
  visual.DeleteChild(material);
  if (rgba.empty()) return;
  material = visual.InsertNewChildElement("material");
  material->SetAttribute("name", fmt::format("colour{}", work.next_material++).c_str());
  material->InsertNewChildElement("color")->SetAttribute(
      "rgba", fmt::format("{} {} {} {}", rgba[0], rgba[1], rgba[2], rgba[3]).c_str());
}

// What is wrong with the size of a primitive; empty where nothing is.
struct SizeFault {
  std::string what;
  bool nothing = false;  // no extent at all: a placeholder
};

SizeFault CheckSize(const XMLElement& shape) {
  const std::string kind = shape.Name();
  std::vector<double> sizes;
  const auto add = [&](const char* attribute, std::size_t count) {
    const std::vector<double> numbers = NumbersOf(&shape, attribute);
    sizes.insert(sizes.end(), numbers.begin(), numbers.end());
    return numbers.size() == count;
  };
  bool whole = kind == "box" ? add("size", 3) : add("radius", 1);
  if (kind == "cylinder" || kind == "capsule") whole = add("length", 1) && whole;
  if (!whole) {
    return {fmt::format("a {} without its {}", kind,
                        kind == "box"      ? "size of three numbers"
                        : kind == "sphere" ? "radius"
                                           : "radius and length")};
  }
  if (std::any_of(sizes.begin(), sizes.end(), [](double s) { return s < 0; }))
    return {fmt::format("a {} of negative size", kind)};
  // A capsule of length zero is a sphere.
  if (kind == "capsule" && sizes[0] > 0) return {};
  if (std::all_of(sizes.begin(), sizes.end(), [](double s) { return s == 0; }))
    return {fmt::format("a {} of size zero", kind), true};
  if (std::any_of(sizes.begin(), sizes.end(), [](double s) { return s == 0; }))
    return {fmt::format("a {} with one size zero", kind)};
  return {};
}

// Says true where the shape may stay; without a fault to report it is gone otherwise.
std::optional<Error> CheckPrimitive(UrdfWork& work, XMLElement& link, XMLElement& part,
                                    const XMLElement& shape, bool& stays) {
  const SizeFault fault = CheckSize(shape);
  stays = fault.what.empty();
  if (stays) return std::nullopt;
  const std::string name = NameOf(link);
  const bool visual = std::string(part.Name()) == "visual";
  if (!visual && !fault.nothing) {
    return work.Refuse(
        ErrorCode::kModel, shape,
        fmt::format("link '{}' has as collision shape {}, which nothing can touch; correct the size, "
                    "or take the <collision> away",
                    name, fault.what));
  }
  work.shapes_dropped[fmt::format("{} in <{}>", fault.what, part.Name())].push_back(name);
  link.DeleteChild(&part);
  return std::nullopt;
}

// A capsule, which URDF does not have but some writers use, is a cylinder with a sphere at each end.
void SplitCapsule(UrdfWork& work, XMLElement& link, XMLElement& part) {
  XMLElement* geometry = part.FirstChildElement("geometry");
  XMLElement* capsule = geometry->FirstChildElement("capsule");
  const double radius = NumberOf(capsule, "radius"), length = NumberOf(capsule, "length");
  geometry->DeleteChildren();
  XMLElement* cylinder = geometry->InsertNewChildElement("cylinder");
  cylinder->SetAttribute("radius", NumberText(radius).c_str());
  cylinder->SetAttribute("length", NumberText(length).c_str());
  const RigidTransform X = PoseOf(part.FirstChildElement("origin"));
  for (const double side : {-1.0, 1.0}) {
    const Vector3 p = X * Vector3(0, 0, side * length / 2);
    auto* end = link.GetDocument()->NewElement(part.Name());
    link.InsertAfterChild(&part, end);
    end->InsertNewChildElement("origin")->SetAttribute(
        "xyz", fmt::format("{} {} {}", NumberText(p.x()), NumberText(p.y()), NumberText(p.z())).c_str());
    end->InsertNewChildElement("geometry")
        ->InsertNewChildElement("sphere")
        ->SetAttribute("radius", NumberText(radius).c_str());
    if (const XMLElement* material = part.FirstChildElement("material")) {
      end->InsertEndChild(material->DeepClone(link.GetDocument()));
    }
  }
  const std::string name = NameOf(link);
  if (work.capsules.empty() || work.capsules.back() != name) work.capsules.push_back(name);
}

std::optional<Error> PrepareShape(UrdfWork& work, XMLElement& link, XMLElement& part) {
  const std::string name = NameOf(link);
  const bool visual = std::string(part.Name()) == "visual";
  part.DeleteAttribute("name");
  if (visual) PrepareMaterial(work, name, part);
  XMLElement* geometry = part.FirstChildElement("geometry");
  XMLElement* shape = geometry != nullptr ? geometry->FirstChildElement() : nullptr;
  const std::string kind = shape != nullptr ? shape->Name() : "";
  if (kind == "mesh") {
    const std::optional<MeshFault> fault = PrepareMesh(work, *shape);
    if (!fault) return std::nullopt;
    const std::string file = shape->Attribute("filename") != nullptr ? shape->Attribute("filename") : "";
    if (visual) {
      work.visuals_dropped[fmt::format("{}; {}", fault->reason, fault->remedy)].push_back(file);
      link.DeleteChild(&part);
      return std::nullopt;
    }
    return work.Refuse(fault->code, *shape,
                       fmt::format("collision mesh '{}' of link '{}': {}; {}, or take the <collision> away",
                                   file, name, fault->reason, fault->remedy));
  }
  if (kind == "box" || kind == "cylinder" || kind == "sphere" || kind == "capsule") {
    bool stays = true;
    if (auto error = CheckPrimitive(work, link, part, *shape, stays)) return error;
    if (stays && kind == "capsule") SplitCapsule(work, link, part);
    return std::nullopt;
  }
  if (visual) {
    work.visuals_dropped[fmt::format("<{}> is no shape of URDF", kind)].push_back(name);
    link.DeleteChild(&part);
    return std::nullopt;
  }
  return work.Refuse(
      ErrorCode::kFormat, part,
      fmt::format("link '{}' has a collision shape <{}>; URDF has box, cylinder, sphere and mesh: "
                  "replace it by one of them",
                  name, kind));
}

}  // namespace

std::vector<double> NumbersOf(const XMLElement* element, const char* attribute) {
  std::vector<double> numbers;
  const char* text = element != nullptr ? element->Attribute(attribute) : nullptr;
  if (text == nullptr) return numbers;
  std::istringstream stream(text);
  stream.imbue(std::locale::classic());
  for (double value; stream >> value;) numbers.push_back(value);
  return numbers;
}

RigidTransform PoseOf(const XMLElement* element) {
  const std::vector<double> xyz = NumbersOf(element, "xyz"), rpy = NumbersOf(element, "rpy");
  RigidTransform X;
  if (xyz.size() == 3) X.translation() << xyz[0], xyz[1], xyz[2];
  if (rpy.size() == 3) X.rotation() = RollPitchYawRotation({rpy[0], rpy[1], rpy[2]});
  return X;
}

bool IsNumber(const std::string& word) {
  char* end = nullptr;
  std::strtod(word.c_str(), &end);
  return end != word.c_str() && *end == '\0';
}

double NumberOf(const XMLElement* element, const char* attribute) {
  const std::vector<double> numbers = NumbersOf(element, attribute);
  return numbers.empty() ? 0 : numbers[0];
}

std::string NumberText(double value) { return fmt::format("{:.17g}", value); }

std::optional<Error> UrdfWork::CheckNumber(const XMLElement* element, const char* attribute,
                                           const std::string& link) const {
  const char* text = element != nullptr ? element->Attribute(attribute) : nullptr;
  if (text == nullptr) return std::nullopt;
  std::istringstream stream(text);
  stream.imbue(std::locale::classic());
  double value = 0;
  char more = 0;
  if (stream >> value && !(stream >> more)) return std::nullopt;
  return Refuse(ErrorCode::kModel, *element,
                fmt::format("link '{}' has <{} {}=\"{}\">, which is no number; write one", link,
                            element->Name(), attribute, text));
}

std::optional<Error> PrepareLink(UrdfWork& work, XMLElement& link) {
  std::vector<XMLElement*> parts;
  for (XMLElement* part = link.FirstChildElement(); part != nullptr;) {
    XMLElement* next = part->NextSiblingElement();
    const std::string kind = part->Name();
    if (kind == "visual" || kind == "collision") {
      parts.push_back(part);
    } else if (kind != "inertial") {
      link.DeleteChild(part);
    }
    part = next;
  }
  for (XMLElement* part : parts) {
    if (auto error = PrepareShape(work, link, *part)) return error;
  }
  return PrepareInertia(work, link);  // after the shapes, which it may be taken from
}

}  // namespace fork1s::internal
