#include <fmt/format.h>

#include <set>

#include "conversion.hpp"
#include "urdf.hpp"

namespace fork1s::internal {
namespace {

SpatialInertia InertiaOf(const Conversion& c, int b) {
  const mjModel& m = c.m;
  SpatialInertia I;
  I.mass = m.body_mass[b];
  I.center = Vec3(m.body_ipos + 3 * b);
  const Matrix3 R = Quat(m.body_iquat + 4 * b).normalized().toRotationMatrix();
  Vector3 diagonal = Vec3(m.body_inertia + 3 * b);
  if (c.is_urdf) {
    if (IsMasslessUrdf(I.mass)) I.mass = 0;
    for (int i = 0; i < 3; ++i) {
      if (IsMasslessUrdf(diagonal[i])) diagonal[i] = 0;
    }
  }
  I.rotational = R * diagonal.asDiagonal() * R.transpose();
  return I;
}

SpatialInertia Sum(const SpatialInertia& a, const SpatialInertia& b) {
  SpatialInertia s;
  s.mass = a.mass + b.mass;
  if (s.mass > 0) s.center = (a.mass * a.center + b.mass * b.center) / s.mass;
  const auto about = [&](const SpatialInertia& I) {
    const Matrix3 r = Skew(I.center - s.center);
    return Matrix3(I.rotational - I.mass * r * r);
  };
  s.rotational = about(a) + about(b);
  return s;
}

void ConvertFreeBody(Conversion& c, const Component& component, const std::vector<int>& bodies) {
  const mjModel& m = c.m;
  const int top = component.tops[0];
  FreeBodyDef body;
  body.name = c.body_names[top];
  body.X_WB = c.WorldPose(top);
  std::vector<std::string> merged;
  double carried = 0;  // kg whose weight is compensated
  for (int b : bodies) {
    const RigidTransform X_TB = body.X_WB.inverse() * c.WorldPose(b);
    const SpatialInertia I = Transform(X_TB, InertiaOf(c, b));
    body.inertia = Sum(body.inertia, I);
    carried += m.body_gravcomp[b] * I.mass;
    c.body[b].free_body = static_cast<int>(c.scene.free_bodies.size());
    if (b != top) merged.push_back(c.body_names[b]);
  }
  for (const std::string& name : merged) {
    c.Note(ImportNote::Kind::kChanged, fmt::format("body '{}'", name),
           fmt::format("welded to free body '{}', so both became one", body.name));
  }
  if (body.inertia.mass > 0) body.gravity_compensation = carried / body.inertia.mass;
  c.scene.free_bodies.push_back(std::move(body));
}

FreedomDef Rotation(const Vector3& axis, const Vector3& anchor) {
  FreedomDef freedom;
  freedom.screw_B << axis, anchor.cross(axis);
  return freedom;
}

// Two of a free joint: its position along the axes of the base, as MuJoCo has it along the world's, then its
// rotation, which may turn as far as it likes. Of any other joint one.
std::vector<JointDef> ConvertJoint(const Conversion& c, int j, const RigidTransform& X_W_base) {
  const mjModel& m = c.m;
  JointDef joint;
  joint.name = c.joint_names[j];
  joint.body = c.body[m.jnt_bodyid[j]].body;
  const int dof = m.jnt_dofadr[j];
  const auto put_losses = [&](JointDef& to, int first) {
    for (std::size_t i = 0; i < to.freedoms.size(); ++i) {
      const int at = first + static_cast<int>(i);
      to.freedoms[i].damping = m.opt.disableflags & mjDSBL_DAMPER ? 0 : m.dof_damping[at];
      to.freedoms[i].armature = m.dof_armature[at];
    }
  };
  if (m.jnt_type[j] == mjJNT_FREE) {
    const Matrix3 R_base_B = (X_W_base.inverse() * c.WorldPose(m.jnt_bodyid[j])).rotation();
    Matrix6X screws = Matrix6X::Zero(6, 3);
    screws.bottomRows<3>() = R_base_B.transpose();
    JointDef position = JointDef::General(joint.name + ".position", joint.body, screws),
             rotation = JointDef::Ball(joint.name + ".rotation", joint.body);
    put_losses(position, dof);
    put_losses(rotation, dof + 3);
    return {std::move(position), std::move(rotation)};
  }
  const Vector3 axis = Vec3(m.jnt_axis + 3 * j), anchor = Vec3(m.jnt_pos + 3 * j);
  switch (m.jnt_type[j]) {
    case mjJNT_HINGE:
      joint.kind = JointKind::kHinge;
      joint.freedoms = {Rotation(axis, anchor)};
      break;
    case mjJNT_SLIDE: {
      joint.kind = JointKind::kSlide;
      FreedomDef freedom;
      freedom.screw_B << Vector3::Zero(), axis;
      joint.freedoms = {freedom};
      break;
    }
    default:
      joint.kind = JointKind::kBall;
      for (int i = 0; i < 3; ++i) joint.freedoms.push_back(Rotation(Vector3::Unit(i), anchor));
  }
  put_losses(joint, dof);
  const bool limited = m.jnt_limited[j] && !(m.opt.disableflags & (mjDSBL_LIMIT | mjDSBL_CONSTRAINT));
  if (limited && joint.freedoms.size() == 1) {
    const double q0 = m.qpos0[m.jnt_qposadr[j]];
    const auto [lower, upper] = LimitedRange(m.jnt_range + 2 * j, m.jnt_margin[j]);
    joint.freedoms[0].lower = lower - q0;
    joint.freedoms[0].upper = upper - q0;
  }
  return {std::move(joint)};
}

void ConvertMechanism(Conversion& c, const Component& component, const std::vector<int>& bodies) {
  const mjModel& m = c.m;
  const int index = static_cast<int>(c.scene.mechanisms.size());
  MechanismDef mechanism;
  mechanism.name = c.body_names[component.base_body != 0 ? component.base_body : component.tops[0]];
  mechanism.base = component.base;
  // In a URDF the root is fixed by --base alone, and links overlap at their joints.
  if (!c.is_urdf) {
    const bool off = m.opt.disableflags & mjDSBL_FILTERPARENT;
    mechanism.parent_filter = off ? ParentFilter::kNone : ParentFilter::kMoving;
  }
  RigidTransform X_W_base;
  if (component.base_body != 0) {
    X_W_base = c.WorldPose(component.base_body);
  } else {
    BodyDef world;
    world.name = "world";
    mechanism.bodies.push_back(world);
  }
  mechanism.X_WR = X_W_base;
  // The base comes first, also where another tree of the component has smaller ids.
  std::vector<int> order;
  if (component.base_body != 0) order.push_back(component.base_body);
  for (int b : bodies) {
    if (b != component.base_body) order.push_back(b);
  }
  for (int b : order) {
    BodyDef body;
    body.name = c.body_names[b];
    body.inertia = InertiaOf(c, b);
    body.gravity_compensation = m.body_gravcomp[b];
    if (b != component.base_body) {
      const int p = m.body_parentid[b];
      body.parent = p == 0 ? BodyIndex(0) : c.body[p].body;
      body.X_PB = (p == 0 ? X_W_base : c.WorldPose(p)).inverse() * c.WorldPose(b);
    }
    c.body[b].mechanism = index;
    c.body[b].body = BodyIndex(mechanism.bodies.size());
    mechanism.bodies.push_back(std::move(body));
  }
  // In the order of the bodies, as a built mechanism keeps them: keyframes rely on it.
  std::vector<int> joints;
  for (int b : order) {
    const bool is_base = b == component.base_body && component.base == BaseKind::kFloating;
    if (is_base || c.rigid_root[b]) continue;
    for (int i = 0; i < m.body_jntnum[b]; ++i) joints.push_back(m.body_jntadr[b] + i);
  }
  for (int j : joints) {
    c.joint[j] = {index, JointIndex(mechanism.joints.size())};
    for (JointDef& joint : ConvertJoint(c, j, X_W_base)) mechanism.joints.push_back(std::move(joint));
  }
  c.scene.mechanisms.push_back(std::move(mechanism));
  c.controls.emplace_back();
}

void NoteFreeJointLosses(Conversion& c) {
  const mjModel& m = c.m;
  for (const Component& component : c.components) {
    if (component.base != BaseKind::kFloating && !component.free_body) continue;
    const int top = component.free_body ? component.tops[0] : component.base_body;
    const int dof = m.body_dofadr[top];
    double sum = m.jnt_stiffness[m.body_jntadr[top]];
    for (int i = 0; i < 6; ++i) sum += m.dof_damping[dof + i] + m.dof_armature[dof + i];
    if (sum != 0) {
      c.Dropped(fmt::format("joint '{}'", c.joint_names[m.body_jntadr[top]]),
                "stiffness, damping and armature of a free joint are left out: the base moves freely");
    }
  }
}

}  // namespace

void ConvertBodies(Conversion& c) {
  const mjModel& m = c.m;
  for (const Component& component : c.components) {
    const std::set<int> tops(component.tops.begin(), component.tops.end());
    std::vector<int> bodies;
    for (int b = 1; b < m.nbody; ++b) {
      if (tops.count(m.body_rootid[b]) > 0) bodies.push_back(b);
    }
    if (component.free_body) {
      ConvertFreeBody(c, component, bodies);
    } else {
      ConvertMechanism(c, component, bodies);
    }
  }
  NoteFreeJointLosses(c);
}

}  // namespace fork1s::internal
