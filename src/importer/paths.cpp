// Tendons through space and actuators on sites as paths of a mechanism.
#include <cmath>

#include "conversion.hpp"

namespace fork1s::internal {
namespace {

PathDef TendonOf(const Conversion& c, int t, int mechanism) {
  const mjModel& m = c.m;
  const auto point = [&](int site, BodyIndex& on) {
    const Anchor at = AnchorIn(c, mechanism, m.site_bodyid[site]);
    on = at.body;
    return Vector3(at.X_AB * Vec3(m.site_pos + 3 * site));
  };
  PathDef path;
  path.name = NameOr(m, m.name_tendonadr[t], "tendon", t);
  for (int w = m.tendon_adr[t]; w < m.tendon_adr[t] + m.tendon_num[t]; ++w) {
    const int id = m.wrap_objid[w];
    PathElementDef e;
    switch (m.wrap_type[w]) {
      case mjWRAP_PULLEY:
        e.kind = PathElementDef::Kind::kPulley;
        e.divisor = m.wrap_prm[w];
        break;
      case mjWRAP_SITE:
        e.X_BE = RigidTransform(point(id, e.body));
        break;
      default: {
        e.kind =
            m.wrap_type[w] == mjWRAP_SPHERE ? PathElementDef::Kind::kSphere : PathElementDef::Kind::kCylinder;
        const Anchor at = AnchorIn(c, mechanism, m.geom_bodyid[id]);
        e.body = at.body;
        e.X_BE = at.X_AB * RigidTransform(Quat(m.geom_quat + 4 * id), Vec3(m.geom_pos + 3 * id));
        e.radius = m.geom_size[3 * id];
        const int side = static_cast<int>(std::lround(m.wrap_prm[w]));  // a site, -1: none
        e.has_side = side >= 0;
        if (e.has_side) e.side_B = point(side, e.side_body);
      }
    }
    path.elements.push_back(std::move(e));
  }
  return path;
}

// The force of an actuator on a site, or its slider-crank.
PathDef PathOfSites(const Conversion& c, int i, int mechanism) {
  const mjModel& m = c.m;
  const auto frame = [&](int site) {
    const Anchor at = AnchorIn(c, mechanism, m.site_bodyid[site]);
    PathElementDef e;
    e.body = at.body;
    e.X_BE = at.X_AB * RigidTransform(Quat(m.site_quat + 4 * site), Vec3(m.site_pos + 3 * site));
    return e;
  };
  const int* sites = m.actuator_trnid + 2 * i;
  PathDef path;
  path.name = NameOr(m, m.name_actuatoradr[i], "actuator", i);
  if (m.actuator_trntype[i] == mjTRN_SLIDERCRANK) {
    path.kind = PathKind::kSliderCrank;
    path.elements = {frame(sites[1]), frame(sites[0])};
    path.rod = m.actuator_cranklength[i];
    return path;
  }
  path.kind = PathKind::kWrench;
  path.elements = {frame(sites[0])};
  if (sites[1] >= 0) path.elements.push_back(frame(sites[1]));
  const mjtNum* gear = m.actuator_gear + 6 * m.actuator_outadr[i];
  path.gear << Vec3(gear + 3), Vec3(gear);
  return path;
}

// Both sides of a ball joint: the body, and where its parent has it at the reference.
std::vector<PathElementDef> FramesOfBall(const Conversion& c, int joint, int mechanism) {
  const mjModel& m = c.m;
  const int body = m.jnt_bodyid[joint];
  const Anchor child = AnchorIn(c, mechanism, body), parent = AnchorIn(c, mechanism, m.body_parentid[body]);
  PathElementDef on, from;
  on.body = child.body;
  on.X_BE = child.X_AB;
  from.body = parent.body;
  from.X_BE = parent.X_AB * RigidTransform(Quat(m.body_quat + 4 * body), Vec3(m.body_pos + 3 * body));
  return {on, from};
}

// The angle that a ball joint has turned by.
PathDef AngleOfBall(const Conversion& c, int joint, int mechanism) {
  PathDef path;
  path.name = c.joint_names[joint];
  path.kind = PathKind::kAngle;
  path.elements = FramesOfBall(c, joint, mechanism);
  return path;
}

// The torque of an actuator on a ball joint, in axes of the body or of its parent; its length is gear · θ in both.
PathDef PathOfBall(const Conversion& c, int i, int mechanism) {
  const mjModel& m = c.m;
  PathDef path;
  path.name = NameOr(m, m.name_actuatoradr[i], "actuator", i);
  path.kind = PathKind::kWrench;
  path.gear << Vec3(m.actuator_gear + 6 * m.actuator_outadr[i]), Vector3::Zero();
  path.elements = FramesOfBall(c, m.actuator_trnid[2 * i], mechanism);
  if (m.actuator_trntype[i] == mjTRN_JOINTINPARENT) return path;
  // The same seen from the body: the gear is along the second element's axes, and acts back on it.
  std::swap(path.elements[0], path.elements[1]);
  path.gear = -path.gear;
  return path;
}

// The wrench of an actuator on a free joint in axes of the world, at the origin of the body.
PathDef PathOfFreeJoint(const Conversion& c, int i, int mechanism) {
  const mjModel& m = c.m;
  const Anchor child = AnchorIn(c, mechanism, m.jnt_bodyid[m.actuator_trnid[2 * i]]),
               world = AnchorIn(c, mechanism, 0);
  PathElementDef on, from;
  on.body = child.body;
  on.X_BE = child.X_AB;
  from.body = world.body;
  from.X_BE = world.X_AB;
  PathDef path;
  path.name = NameOr(m, m.name_actuatoradr[i], "actuator", i);
  path.kind = PathKind::kWrench;
  path.elements = {on, from};
  const mjtNum* gear = m.actuator_gear + 6 * m.actuator_outadr[i];
  path.gear << Vec3(gear + 3), Vec3(gear);
  return path;
}

}  // namespace

int Conversion::PathOf(const Length& length) {
  path_of_tendon.resize(static_cast<std::size_t>(m.ntendon), -1);
  path_of_actuator.resize(static_cast<std::size_t>(m.nactuator), -1);
  path_of_ball.resize(static_cast<std::size_t>(m.njnt), -1);
  const bool thread = length.tendon >= 0;
  int& made = thread             ? path_of_tendon[static_cast<std::size_t>(length.tendon)]
              : length.ball >= 0 ? path_of_ball[static_cast<std::size_t>(length.ball)]
                                 : path_of_actuator[static_cast<std::size_t>(length.actuator)];
  if (made >= 0) return made;
  const int mechanism = MechanismOf(length.terms[0].first);
  auto& paths = scene.mechanisms[static_cast<std::size_t>(mechanism)].paths;
  made = static_cast<int>(paths.size());
  if (thread)
    paths.push_back(TendonOf(*this, length.tendon, mechanism));
  else if (length.ball >= 0)
    paths.push_back(AngleOfBall(*this, length.ball, mechanism));
  else if (IsOnBall(m, length.actuator))
    paths.push_back(PathOfBall(*this, length.actuator, mechanism));
  else if (IsOnFreeJoint(m, length.actuator))
    paths.push_back(PathOfFreeJoint(*this, length.actuator, mechanism));
  else
    paths.push_back(PathOfSites(*this, length.actuator, mechanism));
  return made;
}

}  // namespace fork1s::internal
