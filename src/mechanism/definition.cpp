#include <fork1s/mechanism/definition.hpp>

#include <cmath>

namespace fork1s {
namespace {

FreedomDef Turn(const Vector3& axis, const Vector3& anchor) {
  const Vector3 a = axis.normalized();
  FreedomDef freedom;
  freedom.screw_B << a, anchor.cross(a);
  return freedom;
}

FreedomDef Shift(const Vector3& axis) {
  FreedomDef freedom;
  freedom.screw_B << Vector3::Zero(), axis.normalized();
  return freedom;
}

JointDef Make(std::string name, BodyIndex body, JointKind kind, std::vector<FreedomDef> freedoms) {
  JointDef joint;
  joint.name = std::move(name);
  joint.body = body;
  joint.kind = kind;
  joint.freedoms = std::move(freedoms);
  return joint;
}

}  // namespace

JointDef JointDef::Hinge(std::string name, BodyIndex body, const Vector3& axis_B, const Vector3& anchor_B) {
  return Make(std::move(name), body, JointKind::kHinge, {Turn(axis_B, anchor_B)});
}

JointDef JointDef::Slide(std::string name, BodyIndex body, const Vector3& axis_B) {
  return Make(std::move(name), body, JointKind::kSlide, {Shift(axis_B)});
}

JointDef JointDef::Ball(std::string name, BodyIndex body, const Vector3& anchor_B) {
  return Make(
      std::move(name), body, JointKind::kBall,
      {Turn(Vector3::UnitX(), anchor_B), Turn(Vector3::UnitY(), anchor_B), Turn(Vector3::UnitZ(), anchor_B)});
}

JointDef JointDef::Cylindrical(std::string name, BodyIndex body, const Vector3& axis_B,
                               const Vector3& anchor_B) {
  return Make(std::move(name), body, JointKind::kCylindrical, {Turn(axis_B, anchor_B), Shift(axis_B)});
}

JointDef JointDef::Planar(std::string name, BodyIndex body, const Vector3& normal_B,
                          const Vector3& anchor_B) {
  const Vector3 n = normal_B.normalized();
  const Vector3 helper = std::abs(n.x()) < 0.9 ? Vector3::UnitX() : Vector3::UnitY();
  const Vector3 x = n.cross(helper).normalized();
  return Make(std::move(name), body, JointKind::kPlanar, {Turn(n, anchor_B), Shift(x), Shift(n.cross(x))});
}

JointDef JointDef::Free(std::string name, BodyIndex body) {
  return Make(std::move(name), body, JointKind::kFree,
              {Turn(Vector3::UnitX(), Vector3::Zero()), Turn(Vector3::UnitY(), Vector3::Zero()),
               Turn(Vector3::UnitZ(), Vector3::Zero()), Shift(Vector3::UnitX()), Shift(Vector3::UnitY()),
               Shift(Vector3::UnitZ())});
}

JointDef JointDef::General(std::string name, BodyIndex body, const Matrix6X& screws_B) {
  std::vector<FreedomDef> freedoms(static_cast<std::size_t>(screws_B.cols()));
  for (std::size_t i = 0; i < freedoms.size(); ++i)
    freedoms[i].screw_B = screws_B.col(static_cast<Eigen::Index>(i));
  return Make(std::move(name), body, JointKind::kGeneral, std::move(freedoms));
}

JointDef& JointDef::WithSpring(double stiffness, double damping) {
  for (auto& f : freedoms) {
    f.stiffness = stiffness;
    f.damping = damping;
  }
  return *this;
}

JointDef& JointDef::WithArmature(double armature) {
  for (auto& f : freedoms) f.armature = armature;
  return *this;
}

JointDef& JointDef::WithRest(double rest) {
  for (auto& f : freedoms) f.rest = rest;
  return *this;
}

JointDef& JointDef::WithLimits(double lower, double upper) {
  for (auto& f : freedoms) {
    f.lower = lower;
    f.upper = upper;
  }
  return *this;
}

std::pair<JointDef, JointDef> UniversalJoint(const std::string& name, BodyIndex body, const Vector3& axis1_B,
                                             const Vector3& axis2_B, const Vector3& anchor_B) {
  return {JointDef::Hinge(name + ".1", body, axis1_B, anchor_B),
          JointDef::Hinge(name + ".2", body, axis2_B, anchor_B)};
}

ClosureDef ClosureDef::Weld(std::string name, BodyIndex a, BodyIndex b, const RigidTransform& X_AJ,
                            const RigidTransform& X_BJ) {
  ClosureDef closure;
  closure.name = std::move(name);
  closure.body_a = a;
  closure.body_b = b;
  closure.X_AJ = X_AJ;
  closure.X_BJ = X_BJ;
  closure.rigid.setConstant(true);
  return closure;
}

ClosureDef ClosureDef::Connect(std::string name, BodyIndex a, BodyIndex b, const Vector3& point_A,
                               const Vector3& point_B) {
  ClosureDef closure = Weld(std::move(name), a, b, RigidTransform(point_A), RigidTransform(point_B));
  closure.rigid.head<3>().setConstant(false);
  return closure;
}

std::vector<JointIndex> MechanismDef::JointsOfPath(int path) const {
  // How many elements hang on each body; what all hang on changes nothing, unless the world is the other end.
  std::vector<int> on(bodies.size(), 0);
  int elements = 0;
  for (const PathElementDef& e : paths[static_cast<std::size_t>(path)].elements) {
    if (e.kind == PathElementDef::Kind::kPulley) continue;
    ++elements;
    for (BodyIndex b = e.body; b.valid(); b = bodies[b.u()].parent) ++on[b.u()];
  }
  std::vector<JointIndex> out;
  for (std::size_t j = 0; j < joints.size(); ++j)
    if (const int count = on[joints[j].body.u()]; count > 0 && (count < elements || elements == 1))
      out.emplace_back(j);
  return out;
}

BodyIndex MechanismDef::FindBody(const std::string& body_name) const {
  for (std::size_t i = 0; i < bodies.size(); ++i)
    if (bodies[i].name == body_name) return BodyIndex(i);
  return {};
}

JointIndex MechanismDef::FindJoint(const std::string& joint_name) const {
  for (std::size_t i = 0; i < joints.size(); ++i)
    if (joints[i].name == joint_name) return JointIndex(i);
  return {};
}

}  // namespace fork1s
