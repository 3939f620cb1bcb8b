// Mass and rotational inertia of URDF links: checked, and what is missing taken from the shapes.
#include <algorithm>
#include <cmath>

#include "linalg/spectrum.hpp"
#include "names.hpp"
#include "urdf_parts.hpp"

namespace fork1s::internal {
namespace {

using tinyxml2::XMLElement;

// Relative error of moments that are written with three digits: half of the last digit in the largest, and as
// much in the sum of the others.
constexpr double kWrittenDigits = 1e-2;

constexpr const char* kMoments[] = {"ixx", "ixy", "ixz", "iyy", "iyz", "izz"};

void WriteInertia(XMLElement& inertial, double mass, const Matrix3& I) {
  const auto child = [&](const char* name) {
    XMLElement* element = inertial.FirstChildElement(name);
    return element != nullptr ? element : inertial.InsertNewChildElement(name);
  };
  child("mass")->SetAttribute("value", NumberText(mass).c_str());
  const double moments[] = {I(0, 0), I(0, 1), I(0, 2), I(1, 1), I(1, 2), I(2, 2)};
  for (int i = 0; i < 6; ++i) child("inertia")->SetAttribute(kMoments[i], NumberText(moments[i]).c_str());
}

Vector3 BoxMoments(const Vector3& s) {
  return Vector3(s.y() * s.y() + s.z() * s.z(), s.x() * s.x() + s.z() * s.z(),
                 s.x() * s.x() + s.y() * s.y()) /
         12;
}

struct SolidLike {
  Matrix3 I;          // of that mass, along the link's axes, about its own middle
  std::string shape;  // in messages
};

// Of a solid as the shape has it; a mesh counts as the box around it.
std::optional<SolidLike> SolidInertia(const UrdfWork& work, const XMLElement* part, double mass) {
  const XMLElement* geometry = part != nullptr ? part->FirstChildElement("geometry") : nullptr;
  const XMLElement* shape = geometry != nullptr ? geometry->FirstChildElement() : nullptr;
  if (shape == nullptr) return std::nullopt;
  const std::string kind = shape->Name();
  Vector3 diagonal = Vector3::Zero();
  if (kind == "box") {
    const std::vector<double> s = NumbersOf(shape, "size");
    if (s.size() != 3) return std::nullopt;
    diagonal = BoxMoments(Vector3(s[0], s[1], s[2]));
  } else if (kind == "sphere") {
    diagonal.setConstant(0.4 * std::pow(NumberOf(shape, "radius"), 2));
  } else if (kind == "cylinder") {
    const double r = NumberOf(shape, "radius"), l = NumberOf(shape, "length");
    diagonal << r * r / 4 + l * l / 12, r * r / 4 + l * l / 12, r * r / 2;
  } else {
    const char* name = shape->Attribute("filename");
    const auto extents = work.mesh_extents.find(name != nullptr ? name : "");
    if (extents == work.mesh_extents.end()) return std::nullopt;
    diagonal = BoxMoments(extents->second);
  }
  const Matrix3 R = PoseOf(part->FirstChildElement("origin")).rotation();
  return SolidLike{Matrix3(mass * R * diagonal.asDiagonal() * R.transpose()),
                   kind == "mesh" ? "box around its mesh" : kind};
}

// Without <inertial>: what moves and has a shape weighs what the shape does, all else nothing.
void InferInertial(UrdfWork& work, XMLElement& link) {
  const std::string name = NameOf(link);
  const auto joint = work.parent_joint.find(name);
  const char* type = joint != work.parent_joint.end() ? joint->second->Attribute("type") : nullptr;
  const bool moves = type != nullptr && std::string(type) != "fixed";
  const bool collides = link.FirstChildElement("collision") != nullptr;
  if (moves && collides) {
    work.inferred.push_back(name);
    return;
  }
  // A fixed link without a shape is a frame and needs no word.
  if (moves || collides) work.weightless.push_back(name);
  WriteInertia(*link.InsertNewChildElement("inertial"), kMasslessUrdf, kMasslessUrdf * Matrix3::Identity());
}

std::optional<Error> CheckInertialNumbers(const UrdfWork& work, const std::string& link,
                                          const XMLElement& inertial) {
  if (auto error = work.CheckNumber(inertial.FirstChildElement("mass"), "value", link)) return error;
  for (const char* moment : kMoments) {
    if (auto error = work.CheckNumber(inertial.FirstChildElement("inertia"), moment, link)) return error;
  }
  return std::nullopt;
}

void SetInertiaFromShape(UrdfWork& work, XMLElement& link, XMLElement& inertial, double mass) {
  const XMLElement* part = link.FirstChildElement("collision");
  if (part == nullptr) part = link.FirstChildElement("visual");
  const std::optional<SolidLike> solid = SolidInertia(work, part, mass);
  if (!solid) {
    work.points.push_back(NameOf(link));
    WriteInertia(inertial, mass, kMasslessUrdf * Matrix3::Identity());
    return;
  }
  work.shaped[solid->shape].push_back(NameOf(link));
  // The axes of <inertial> turned moments that were not there.
  if (XMLElement* origin = inertial.FirstChildElement("origin")) origin->DeleteAttribute("rpy");
  WriteInertia(inertial, mass, solid->I);
}

}  // namespace

std::optional<Error> PrepareInertia(UrdfWork& work, XMLElement& link) {
  const std::string name = NameOf(link);
  XMLElement* inertial = link.FirstChildElement("inertial");
  if (inertial == nullptr) {
    InferInertial(work, link);
    return std::nullopt;
  }
  while (XMLElement* second = inertial->NextSiblingElement("inertial")) link.DeleteChild(second);
  if (auto error = CheckInertialNumbers(work, name, *inertial)) return error;
  const double mass = NumberOf(inertial->FirstChildElement("mass"), "value");
  if (mass < 0) {
    return work.Refuse(ErrorCode::kModel, *inertial,
                       fmt::format("link '{}' has negative mass {} kg; give 0 or more", name, mass));
  }
  if (mass == 0) {
    work.massless.push_back(name);
    if (XMLElement* origin = inertial->FirstChildElement("origin")) inertial->DeleteChild(origin);
    WriteInertia(*inertial, kMasslessUrdf, kMasslessUrdf * Matrix3::Identity());
    return std::nullopt;
  }
  double v[6];
  for (int i = 0; i < 6; ++i) v[i] = NumberOf(inertial->FirstChildElement("inertia"), kMoments[i]);
  Matrix3 I;
  I << v[0], v[1], v[2], v[1], v[3], v[4], v[2], v[4], v[5];
  if (IsMasslessUrdf(I.cwiseAbs().maxCoeff())) {
    SetInertiaFromShape(work, link, *inertial, mass);
    return std::nullopt;
  }
  const Vector3 e = PrincipalValues(I);  // ascending
  if (e[0] < -kWrittenDigits * e[2] || e[2] <= 0) {
    return work.Refuse(
        ErrorCode::kModel, *inertial,
        fmt::format("link '{}' has a rotational inertia with the negative principal moment {:.4g} "
                    "kg·m²; correct <inertia>, no body has that",
                    name, e[0]));
  }
  // I + d 1 has the principal axes of I, and e0 + e1 - e2 larger by d.
  const double missing = std::max(-e[0], e[2] - e[0] - e[1]) / e[2];
  if (missing > kWrittenDigits) {
    work.balanced.push_back(name);
    WriteInertia(*inertial, mass, e.mean() * Matrix3::Identity());
    return std::nullopt;
  }
  constexpr double kMargin = 1e-9;  // of e2: the reader compares after rounding of its own
  if (missing <= -kMargin) return std::nullopt;
  if (missing > 1e-6) work.rounded.push_back(name);
  WriteInertia(*inertial, mass, I + (missing + kMargin) * e[2] * Matrix3::Identity());
  return std::nullopt;
}

}  // namespace fork1s::internal
