#include <cmath>
#include <fork1s/linalg/spectrum.hpp>
#include <sstream>

#include "names.hpp"
#include "urdf_parts.hpp"

namespace fork1s::internal {
namespace {

using tinyxml2::XMLElement;

// MuJoCo refuses moving bodies without mass; the importer takes this much away again.
constexpr double kTiny = 1e-12;

std::string Text(double value) { return fmt::format("{:.17g}", value); }

double Number(const XMLElement* element, const char* attribute) {
  const std::vector<double> numbers = NumbersOf(element, attribute);
  return numbers.empty() ? 0 : numbers[0];
}

constexpr const char* kMoments[] = {"ixx", "ixy", "ixz", "iyy", "iyz", "izz"};

void WriteInertia(XMLElement& inertial, double mass, const Matrix3& I) {
  const auto child = [&](const char* name) {
    XMLElement* element = inertial.FirstChildElement(name);
    return element != nullptr ? element : inertial.InsertNewChildElement(name);
  };
  child("mass")->SetAttribute("value", Text(mass).c_str());
  const double moments[] = {I(0, 0), I(0, 1), I(0, 2), I(1, 1), I(1, 2), I(2, 2)};
  for (int i = 0; i < 6; ++i) child("inertia")->SetAttribute(kMoments[i], Text(moments[i]).c_str());
}

// Rotational inertia of a solid primitive of that mass; nothing for meshes.
std::optional<Matrix3> SolidInertia(const XMLElement* collision, double mass) {
  const XMLElement* geometry = collision != nullptr ? collision->FirstChildElement("geometry") : nullptr;
  if (geometry == nullptr) return std::nullopt;
  Vector3 diagonal = Vector3::Zero();
  if (const XMLElement* box = geometry->FirstChildElement("box")) {
    const std::vector<double> s = NumbersOf(box, "size");
    if (s.size() != 3) return std::nullopt;
    diagonal << s[1] * s[1] + s[2] * s[2], s[0] * s[0] + s[2] * s[2], s[0] * s[0] + s[1] * s[1];
    diagonal /= 12;
  } else if (const XMLElement* sphere = geometry->FirstChildElement("sphere")) {
    diagonal.setConstant(0.4 * std::pow(Number(sphere, "radius"), 2));
  } else {
    const XMLElement* round = geometry->FirstChildElement("cylinder");
    if (round == nullptr) round = geometry->FirstChildElement("capsule");
    if (round == nullptr) return std::nullopt;
    const double r = Number(round, "radius"), l = Number(round, "length");
    diagonal << r * r / 4 + l * l / 12, r * r / 4 + l * l / 12, r * r / 2;
  }
  Matrix3 R = Matrix3::Identity();
  const std::vector<double> rpy = NumbersOf(collision->FirstChildElement("origin"), "rpy");
  if (rpy.size() == 3) {
    R = (Eigen::AngleAxisd(rpy[2], Vector3::UnitZ()) * Eigen::AngleAxisd(rpy[1], Vector3::UnitY()) *
         Eigen::AngleAxisd(rpy[0], Vector3::UnitX()))
            .toRotationMatrix();
  }
  return Matrix3(mass * R * diagonal.asDiagonal() * R.transpose());
}

std::optional<Error> PrepareInertia(UrdfWork& work, XMLElement& link) {
  const std::string name = NameOf(link);
  XMLElement* inertial = link.FirstChildElement("inertial");
  if (inertial == nullptr) {
    const auto joint = work.parent_joint.find(name);
    const char* type = joint != work.parent_joint.end() ? joint->second->Attribute("type") : nullptr;
    const bool moves = type != nullptr && std::string(type) != "fixed";
    if (moves && link.FirstChildElement("collision") != nullptr) {
      work.inferred.push_back(name);
      return std::nullopt;
    }
    WriteInertia(*link.InsertNewChildElement("inertial"), kTiny, kTiny * Matrix3::Identity());
    return std::nullopt;
  }
  while (XMLElement* second = inertial->NextSiblingElement("inertial")) link.DeleteChild(second);
  const double mass = Number(inertial->FirstChildElement("mass"), "value");
  if (mass < 0) {
    return work.Refuse(ErrorCode::kModel, *inertial,
                       fmt::format("link '{}' has negative mass {} kg; give 0 or more", name, mass));
  }
  if (mass == 0) {
    if (inertial->FirstChildElement("mass") != nullptr) work.massless.push_back(name);
    if (XMLElement* origin = inertial->FirstChildElement("origin")) inertial->DeleteChild(origin);
    WriteInertia(*inertial, kTiny, kTiny * Matrix3::Identity());
    return std::nullopt;
  }
  double v[6];
  for (int i = 0; i < 6; ++i) v[i] = Number(inertial->FirstChildElement("inertia"), kMoments[i]);
  Matrix3 I;
  I << v[0], v[1], v[2], v[1], v[3], v[4], v[2], v[4], v[5];
  if (I.cwiseAbs().maxCoeff() == 0) {
    const std::optional<Matrix3> solid = SolidInertia(link.FirstChildElement("collision"), mass);
    work.shaped.push_back(name);
    if (XMLElement* origin = inertial->FirstChildElement("origin"); origin != nullptr && solid) {
      origin->DeleteAttribute("rpy");
    }
    WriteInertia(*inertial, mass, solid.value_or(Matrix3(kTiny * Matrix3::Identity())));
    return std::nullopt;
  }
  const Vector3 e = PrincipalValues(I);  // ascending
  if (e[0] < -1e-6 * e[2] || e[2] <= 0) {
    return work.Refuse(
        ErrorCode::kModel, *inertial,
        fmt::format("link '{}' has a rotational inertia with the negative principal moment {:.4g} "
                    "kg·m²; correct <inertia>, no body has that",
                    name, e[0]));
  }
  if (e[0] + e[1] < e[2] * (1 - 1e-9) || e[0] <= 0) {
    work.balanced.push_back(name);
    WriteInertia(*inertial, mass, e.mean() * Matrix3::Identity());
  }
  return std::nullopt;
}

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

// A capsule, which URDF does not have but some writers use, is a cylinder with a sphere at each end.
void SplitCapsule(UrdfWork& work, XMLElement& link, XMLElement& part) {
  XMLElement* geometry = part.FirstChildElement("geometry");
  XMLElement* capsule = geometry->FirstChildElement("capsule");
  const double radius = Number(capsule, "radius"), length = Number(capsule, "length");
  geometry->DeleteChildren();
  XMLElement* cylinder = geometry->InsertNewChildElement("cylinder");
  cylinder->SetAttribute("radius", Text(radius).c_str());
  cylinder->SetAttribute("length", Text(length).c_str());
  const std::vector<double> xyz = NumbersOf(part.FirstChildElement("origin"), "xyz");
  const std::vector<double> rpy = NumbersOf(part.FirstChildElement("origin"), "rpy");
  RigidTransform X;
  if (xyz.size() == 3) X.translation() << xyz[0], xyz[1], xyz[2];
  if (rpy.size() == 3) {
    X.rotation() = (Eigen::AngleAxisd(rpy[2], Vector3::UnitZ()) *
                    Eigen::AngleAxisd(rpy[1], Vector3::UnitY()) * Eigen::AngleAxisd(rpy[0], Vector3::UnitX()))
                       .toRotationMatrix();
  }
  for (const double side : {-1.0, 1.0}) {
    const Vector3 p = X * Vector3(0, 0, side * length / 2);
    auto* end = link.GetDocument()->NewElement(part.Name());
    link.InsertAfterChild(&part, end);
    end->InsertNewChildElement("origin")->SetAttribute(
        "xyz", fmt::format("{} {} {}", Text(p.x()), Text(p.y()), Text(p.z())).c_str());
    end->InsertNewChildElement("geometry")
        ->InsertNewChildElement("sphere")
        ->SetAttribute("radius", Text(radius).c_str());
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
      work.visuals_dropped[fault->reason].push_back(file);
      link.DeleteChild(&part);
      return std::nullopt;
    }
    return work.Refuse(ErrorCode::kModel, *shape,
                       fmt::format("collision mesh '{}' of link '{}': {}; {}, or take the <collision> away",
                                   file, name, fault->reason, fault->remedy));
  }
  if (kind == "capsule") {
    SplitCapsule(work, link, part);
    return std::nullopt;
  }
  if (kind == "box" || kind == "cylinder" || kind == "sphere") return std::nullopt;
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

std::optional<Error> PrepareLink(UrdfWork& work, XMLElement& link) {
  if (auto error = PrepareInertia(work, link)) return error;
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
  return std::nullopt;
}

}  // namespace fork1s::internal
