// Sensors of MJCF: what each measures, of which body, joint or length.
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <tuple>

#include "conversion.hpp"
#include "names.hpp"

namespace fork1s::internal {
namespace {

// A sensor that has no value here.
SensorDef Unknown(SensorDef s, std::string reason) {
  s.kind = SensorKind::kUnknown;
  s.reason = std::move(reason);
  return s;
}

SensorBody PlaceOf(const Conversion& c, int body) {
  const BodyPlace& place = c.body[body];
  return {place.mechanism, place.body, place.free_body};
}

// The body of the file whose frame a free body has. An option may have placed the free body elsewhere since.
int TopOfFreeBody(const Conversion& c, int free_body) {
  for (const Component& component : c.components)
    if (component.free_body && free_body-- == 0) return component.tops[0];
  return 0;
}

// Pose of a frame that is fixed to a body of the file, in what that body became.
SensorFrame OnBody(const Conversion& c, int body, const RigidTransform& X_BF) {
  SensorFrame frame{PlaceOf(c, body), X_BF};
  if (frame.body.is_world())
    frame.X_BF = c.WorldPose(body) * X_BF;
  else if (frame.body.free_body >= 0)
    frame.X_BF = c.WorldPose(TopOfFreeBody(c, frame.body.free_body)).inverse() * c.WorldPose(body) * X_BF;
  return frame;
}

std::optional<SensorFrame> FrameOf(const Conversion& c, int type, int id) {
  const mjModel& m = c.m;
  const auto on = [&](int body, const mjtNum* pos, const mjtNum* quat) {
    return OnBody(c, body, RigidTransform(Quat(quat + 4 * id).normalized(), Vec3(pos + 3 * id)));
  };
  switch (type) {
    case mjOBJ_BODY:
      return on(id, m.body_ipos, m.body_iquat);
    case mjOBJ_XBODY:
      return OnBody(c, id, RigidTransform());
    case mjOBJ_GEOM:
      return on(m.geom_bodyid[id], m.geom_pos, m.geom_quat);
    case mjOBJ_SITE:
      return on(m.site_bodyid[id], m.site_pos, m.site_quat);
    case mjOBJ_CAMERA:
      if (m.cam_mode[id] != mjCAMLIGHT_FIXED) return std::nullopt;
      return on(m.cam_bodyid[id], m.cam_pos, m.cam_quat);
    default:
      return std::nullopt;
  }
}

bool IsBelow(const mjModel& m, int body, int ancestor) {
  while (body > ancestor) body = m.body_parentid[body];
  return body == ancestor;
}

// What a body and all that hangs on it became; nothing where the scene does not have it apart.
std::optional<std::vector<SensorBody>> SubtreeOf(const Conversion& c, int top) {
  const mjModel& m = c.m;
  std::vector<SensorBody> bodies;
  for (int b = 0; b < m.nbody; ++b) {
    if (!IsBelow(m, b, top)) continue;
    const SensorBody place = PlaceOf(c, b);
    if (place.is_world()) {
      if (m.body_mass[b] > 0) return std::nullopt;
      continue;
    }
    if (place.free_body >= 0 &&
        c.scene.free_bodies[static_cast<std::size_t>(place.free_body)].name != c.body_names[b]) {
      // Part of a free body, which is whole only where its top is in the subtree too.
      if (IsBelow(m, top, m.body_rootid[b]) && top != m.body_rootid[b]) return std::nullopt;
      continue;
    }
    bodies.push_back(place);
  }
  return bodies;
}

// Fills what measures a length. False where it hangs on what is no joint of one mechanism.
bool PutLengthOf(Conversion& c, const Length& length, const std::vector<int>& bodies, SensorDef& s) {
  s.at_reference = length.at_reference;
  for (const auto& [dof, coefficient] : length.terms) {
    const int mechanism = c.MechanismOf(dof);
    if (mechanism < 0 || (s.mechanism >= 0 && mechanism != s.mechanism)) return false;
    s.mechanism = mechanism;
  }
  for (const int b : bodies)
    if (!c.body[b].still() && c.body[b].mechanism != s.mechanism) return false;
  if (s.mechanism >= 0) c.PutLength(length, s);
  return true;
}

constexpr const char* kNotOfOneMechanism =
    "its length hangs on a free body or a floating base, or on several mechanisms";

constexpr const char* kBallOfSeveral = "another joint of its body turns it too";

SensorDef LengthSensor(Conversion& c, SensorDef s, SensorKind kind, int type, int id) {
  const mjModel& m = c.m;
  s.kind = kind;
  bool is_known = false;
  if (type == mjOBJ_JOINT && m.jnt_type[id] == mjJNT_BALL) {
    is_known = PutLengthOf(c, BallAngle(m, id), {}, s);
  } else if (type == mjOBJ_JOINT) {
    Length length;
    length.terms = {{m.jnt_dofadr[id], 1.0}};
    length.at_reference = m.qpos0[m.jnt_qposadr[id]];
    is_known = PutLengthOf(c, length, {}, s);
  } else if (type == mjOBJ_TENDON) {
    is_known = PutLengthOf(c, TendonLength(m, c.d, id), BodiesOfTendon(m, id), s);
  } else {
    const int on = m.actuator_trntype[id];
    if (on == mjTRN_BODY) return Unknown(std::move(s), "an adhesion actuator has no length");
    const std::vector<int> bodies =
        on == mjTRN_TENDON ? BodiesOfTendon(m, m.actuator_trnid[2 * id]) : BodiesOfActuator(m, id);
    const bool is_zero = kind == SensorKind::kLength && IsOnFreeJoint(m, id);
    is_known = is_zero || PutLengthOf(c, ActuatorLength(m, c.d, id), bodies, s);
  }
  return is_known ? s : Unknown(std::move(s), kNotOfOneMechanism);
}

SensorDef LimitSensor(Conversion& c, SensorDef s, SensorKind kind, int type, int id) {
  const mjModel& m = c.m;
  s = LengthSensor(c, std::move(s), kind, type, id);
  const bool is_joint = type == mjOBJ_JOINT;
  const bool is_limited = is_joint ? m.jnt_limited[id] : m.tendon_limited[id];
  if (!is_limited || (m.opt.disableflags & (mjDSBL_LIMIT | mjDSBL_CONSTRAINT))) return s;
  if (is_joint && m.jnt_type[id] == mjJNT_BALL) {
    if (IsBallOfSeveral(m, id)) return Unknown(std::move(s), kBallOfSeveral);
    s.upper = BallLimit(m, id);
    return s;
  }
  std::tie(s.lower, s.upper) = is_joint ? LimitedRange(m.jnt_range + 2 * id, m.jnt_margin[id])
                                        : LimitedRange(m.tendon_range + 2 * id, m.tendon_margin[id]);
  return s;
}

SensorDef BallSensor(const Conversion& c, SensorDef s, SensorKind kind, int joint) {
  s.kind = kind;
  s.mechanism = c.joint[joint].mechanism;
  if (s.mechanism < 0) return Unknown(std::move(s), "its joint is no joint of a mechanism here");
  for (int i = 0; i < 3; ++i) s.terms.emplace_back(FreedomRef{c.joint[joint].joint, i}, 1.0);
  return s;
}

SensorDef FrameSensor(const Conversion& c, SensorDef s, SensorKind kind, int i, bool own_axes) {
  const mjModel& m = c.m;
  s.kind = kind;
  s.own_axes = own_axes;
  constexpr const char* kCamera = "it is of a camera that turns by itself";
  const auto frame = FrameOf(c, m.sensor_objtype[i], m.sensor_objid[i]);
  if (!frame) return Unknown(std::move(s), kCamera);
  s.frame = *frame;
  if (m.sensor_refid[i] < 0) return s;
  const auto reference = FrameOf(c, m.sensor_reftype[i], m.sensor_refid[i]);
  if (!reference) return Unknown(std::move(s), kCamera);
  s.reference = *reference;
  return s;
}

SensorDef SubtreeSensor(const Conversion& c, SensorDef s, SensorKind kind, int body) {
  s.kind = kind;
  const auto subtree = SubtreeOf(c, body);
  if (!subtree)
    return Unknown(std::move(s), "the masses of still bodies and of parts of a free body are not kept apart");
  s.subtree = *subtree;
  return s;
}

bool IsNamedWeldOrConnect(const Conversion& c, const std::string& name) {
  const int e = mj_name2id(&c.m, mjOBJ_EQUALITY, name.c_str());
  return e >= 0 && (c.m.eq_type[e] == mjEQ_WELD || c.m.eq_type[e] == mjEQ_CONNECT);
}

// The force between a body and what carries it.
SensorDef CutSensor(const Conversion& c, SensorDef s, SensorKind kind, int i) {
  const int body = c.m.site_bodyid[c.m.sensor_objid[i]];
  s = FrameSensor(c, std::move(s), kind, i, true);
  const auto subtree = SubtreeOf(c, body);
  if (!subtree || s.frame.body.is_world())
    return Unknown(std::move(s), "the masses of still bodies and of parts of a free body are not kept apart");
  s.subtree = *subtree;
  if (s.frame.body.mechanism < 0) return s;
  const auto is_inside = [&](BodyIndex b) {
    return std::any_of(s.subtree.begin(), s.subtree.end(),
                       [&](const SensorBody& of) { return of.body == b; });
  };
  const MechanismDef& mechanism = c.scene.mechanisms[static_cast<std::size_t>(s.frame.body.mechanism)];
  std::vector<std::string> loops;
  bool can_switch = true;
  for (const ClosureDef& closure : mechanism.closures) {
    if (is_inside(closure.body_a) == is_inside(closure.body_b)) continue;
    loops.push_back(closure.name);
    can_switch = can_switch && IsNamedWeldOrConnect(c, closure.name);
  }
  if (loops.empty()) return s;
  return Unknown(
      std::move(s),
      fmt::format("{} close{} a loop over its body{}", Quoted(loops, 8), loops.size() == 1 ? "s" : "",
                  can_switch
                      ? fmt::format(" (the option switched={} gives it a value)", fmt::join(loops, ","))
                      : ""));
}

// With the volume of a site.
SensorDef VolumeSensor(const Conversion& c, SensorDef s, SensorKind kind, int i, int site) {
  const mjModel& m = c.m;
  const mjtNum* size = m.site_size + 3 * site;
  s = FrameSensor(c, std::move(s), kind, i, true);
  if (s.kind == SensorKind::kUnknown) return s;
  switch (m.site_type[site]) {
    case mjGEOM_SPHERE:
      s.volume = Sphere{size[0]};
      return s;
    case mjGEOM_CAPSULE:
      s.volume = Capsule{size[0], size[1]};
      return s;
    case mjGEOM_CYLINDER:
      s.volume = Cylinder{size[0], size[1]};
      return s;
    case mjGEOM_ELLIPSOID:
      s.volume = Ellipsoid{Vec3(size)};
      return s;
    case mjGEOM_BOX:
      s.volume = Box{Vec3(size)};
      return s;
    default:
      return Unknown(std::move(s), "a site of this shape has no volume");
  }
}

SensorDef LimitForceSensor(Conversion& c, SensorDef s, int type, int id) {
  if (type == mjOBJ_TENDON)
    s.limit = NameOr(c.m, c.m.name_tendonadr[id], "tendon", id);  // ConvertLengthLimits
  else if (c.m.jnt_type[id] == mjJNT_BALL) {
    if (IsBallOfSeveral(c.m, id)) return Unknown(std::move(s), kBallOfSeveral);
    s.limit = c.joint_names[id];
  }
  return LengthSensor(c, std::move(s), SensorKind::kLimitForce, type, id);
}

// The ray sees what touches (RayWorld), but not the geoms of the body of its site.
SensorDef DistanceSensor(const Conversion& c, SensorDef s, int i) {
  const mjModel& m = c.m;
  if (m.sensor_objtype[i] != mjOBJ_SITE || m.sensor_intprm[mjNSENS * i] != 1 << mjRAYDATA_DIST)
    return Unknown(std::move(s), "only the distance along the ray of a site is computed");
  s = FrameSensor(c, std::move(s), SensorKind::kDistance, i, true);
  const int body = m.site_bodyid[m.sensor_objid[i]];
  for (int g = m.body_geomadr[body]; g >= 0 && g < m.body_geomadr[body] + m.body_geomnum[body]; ++g)
    if (const int shape = c.shape[static_cast<std::size_t>(g)]; shape >= 0) s.unseen.push_back(shape);
  return s;
}

SensorDef InsideSensor(const Conversion& c, SensorDef s, int i) {
  if (c.m.sensor_reftype[i] != mjOBJ_SITE) return Unknown(std::move(s), "this kind is not computed here");
  return VolumeSensor(c, std::move(s), SensorKind::kInside, i, c.m.sensor_refid[i]);
}

// Weight of all bodies and springs of joints and tendons, as MuJoCo counts them: not those of actuators.
SensorDef PotentialEnergySensor(Conversion& c, SensorDef s) {
  const mjModel& m = c.m;
  s.kind = SensorKind::kPotentialEnergy;
  for (int b = 1; b < m.nbody; ++b) {
    const SensorBody place = PlaceOf(c, b);
    if (place.is_world()) {
      s.at_reference -=
          m.body_mass[b] * c.scene.gravity.dot(c.WorldPose(b) * Vector3(Vec3(m.body_ipos + 3 * b)));
      continue;
    }
    // A free body has the masses of all that is fixed to it.
    if (place.free_body >= 0 &&
        c.scene.free_bodies[static_cast<std::size_t>(place.free_body)].name != c.body_names[b])
      continue;
    s.subtree.push_back(place);
  }
  if (m.opt.disableflags & mjDSBL_SPRING) return s;
  const auto has_spring = [](const mjtNum* linear, const mjtNum* higher, int i) {
    return linear[i] != 0 ||
           std::any_of(higher + mjNPOLY * i, higher + mjNPOLY * (i + 1), [](mjtNum k) { return k != 0; });
  };
  const auto add = [&](const std::string& name, const Length& length, double rest, double slack, double k,
                       const mjtNum* higher) {
    SensorDef of;
    if (!PutLengthOf(c, length, {}, of)) return false;
    if (of.mechanism < 0) return true;  // it does not move
    SpringDef spring;
    spring.name = name;  // as that of the mechanism
    spring.terms = of.terms;
    spring.along = of.along;
    spring.rest = rest;
    spring.slack = slack;
    spring.stiffness = k;
    std::copy_n(higher, 2, spring.higher_stiffness.begin());
    s.springs.push_back({of.mechanism, std::move(spring)});
    return true;
  };
  constexpr const char* kLeftOut = "it counts springs of a free joint, which are not simulated";
  constexpr mjtNum kLinear[mjNPOLY] = {};
  for (int j = 0; j < m.njnt; ++j) {
    if (!has_spring(m.jnt_stiffness, m.jnt_stiffnesspoly, j)) continue;
    const int dof = m.jnt_dofadr[j], at = m.jnt_qposadr[j];
    const bool is_free = m.jnt_type[j] == mjJNT_FREE, is_ball = is_free || m.jnt_type[j] == mjJNT_BALL;
    if (is_free && c.joint[j].mechanism < 0) return Unknown(std::move(s), kLeftOut);
    for (int k = 0; k < (is_free ? 6 : is_ball ? 3 : 1); ++k) {
      Length length;
      length.terms = {{dof + k, 1.0}};
      // Ball and free joints are sprung towards the reference, and have the linear part alone.
      if (!add(c.joint_names[j], length, is_ball ? 0 : m.qpos_spring[at] - m.qpos0[at], 0, m.jnt_stiffness[j],
               is_ball ? kLinear : m.jnt_stiffnesspoly + mjNPOLY * j))
        return Unknown(std::move(s), kNotOfOneMechanism);
    }
  }
  for (int t = 0; t < m.ntendon; ++t) {
    if (!has_spring(m.tendon_stiffness, m.tendon_stiffnesspoly, t)) continue;
    const Length length = TendonLength(m, c.d, t);
    const mjtNum* range = m.tendon_lengthspring + 2 * t;
    if (!add(NameOr(m, m.name_tendonadr[t], "tendon", t), length, range[0] - length.at_reference,
             range[1] - range[0], m.tendon_stiffness[t], m.tendon_stiffnesspoly + mjNPOLY * t))
      return Unknown(std::move(s), kNotOfOneMechanism);
  }
  return s;
}

// The law of an actuator; nothing where proportional-derivative control has taken its place.
std::optional<SensorActuator> ActuatorOf(Conversion& c, const LinearActuator& a) {
  SensorActuator actuator;
  actuator.mechanism = c.MechanismOf(a.length.terms[0].first);
  const auto& controls = c.controls[static_cast<std::size_t>(actuator.mechanism)];
  for (const ActuatorInput& input : a.inputs) {
    if (std::none_of(controls.begin(), controls.end(),
                     [&](const ControlSource& source) { return source.ctrl == input.ctrl; }))
      return std::nullopt;
    actuator.inputs.emplace_back(input.name, input.gain);
  }
  c.PutLength(a.length, actuator);
  if (a.muscle) actuator.muscle = a.name;
  actuator.at_reference = a.length.at_reference;
  actuator.stiffness = -a.b1;
  actuator.damping = -a.b2;
  actuator.bias = a.b0;
  if (c.m.actuator_forcelimited[a.actuator]) {
    actuator.lower = c.m.actuator_forcerange[2 * a.actuator];
    actuator.upper = c.m.actuator_forcerange[2 * a.actuator + 1];
  }
  return actuator;
}

constexpr const char* kNoLaw = "its actuator is not simulated as the file has it";

// Laws of the actuators for which `acts` says so of their number; nothing where one is not simulated as the file has it.
template <class F>
std::optional<std::vector<SensorActuator>> ActuatorsThat(Conversion& c, const F& acts) {
  if (c.m.opt.disableflags & mjDSBL_ACTUATION) return std::nullopt;
  const std::vector<LinearActuator> laws = LinearActuators(c.m, c.d);
  std::vector<SensorActuator> out;
  for (int i = 0; i < c.m.nactuator; ++i) {
    if (!acts(i)) continue;
    const auto law = std::find_if(laws.begin(), laws.end(), [&](const auto& a) { return a.actuator == i; });
    auto actuator = law == laws.end() || !law->left_out.empty() ? std::nullopt : ActuatorOf(c, *law);
    if (!actuator) return std::nullopt;
    out.push_back(std::move(*actuator));
  }
  return out;
}

template <class F>
SensorDef WithActuators(Conversion& c, SensorDef s, const F& acts) {
  auto actuators = ActuatorsThat(c, acts);
  if (!actuators) return Unknown(std::move(s), kNoLaw);
  s.actuators = std::move(*actuators);
  if (!s.actuators.empty()) s.mechanism = s.actuators[0].mechanism;
  return s;
}

SensorDef ActuatorForceSensor(Conversion& c, SensorDef s, int id) {
  if (IsAdhesion(c.m, id))
    return Unknown(std::move(s), "the force of an adhesion actuator is its gain times its control");
  s.kind = SensorKind::kActuatorForce;
  return WithActuators(c, std::move(s), [&](int i) { return i == id; });
}

SensorDef JointActuatorForceSensor(Conversion& c, SensorDef s, int joint) {
  const mjModel& m = c.m;
  s = LengthSensor(c, std::move(s), SensorKind::kJointActuatorForce, mjOBJ_JOINT, joint);
  if (s.kind == SensorKind::kUnknown) return s;
  if (m.jnt_actfrclimited[joint]) {
    s.lower = m.jnt_actfrcrange[2 * joint];
    s.upper = m.jnt_actfrcrange[2 * joint + 1];
  }
  return WithActuators(c, std::move(s), [&](int i) {
    const Length length = ActuatorLength(m, c.d, i);
    return std::any_of(length.terms.begin(), length.terms.end(),
                       [&](const auto& term) { return term.first == m.jnt_dofadr[joint]; });
  });
}

SensorDef TendonActuatorForceSensor(Conversion& c, SensorDef s, int tendon) {
  s.kind = SensorKind::kTendonActuatorForce;
  return WithActuators(c, std::move(s), [&](int i) {
    return c.m.actuator_trntype[i] == mjTRN_TENDON && c.m.actuator_trnid[2 * i] == tendon;
  });
}

SensorDef ConvertSensor(Conversion& c, SensorDef s, int i) {
  const mjModel& m = c.m;
  const int type = m.sensor_objtype[i], id = m.sensor_objid[i];
  using K = SensorKind;
  switch (m.sensor_type[i]) {
    case mjSENS_JOINTPOS:
    case mjSENS_TENDONPOS:
    case mjSENS_ACTUATORPOS:
      return LengthSensor(c, std::move(s), K::kLength, type, id);
    case mjSENS_JOINTVEL:
    case mjSENS_TENDONVEL:
    case mjSENS_ACTUATORVEL:
      return LengthSensor(c, std::move(s), K::kLengthRate, type, id);
    case mjSENS_JOINTLIMITPOS:
    case mjSENS_TENDONLIMITPOS:
      return LimitSensor(c, std::move(s), K::kLimitDistance, type, id);
    case mjSENS_JOINTLIMITVEL:
    case mjSENS_TENDONLIMITVEL:
      return LimitSensor(c, std::move(s), K::kLimitRate, type, id);
    case mjSENS_BALLQUAT:
      return BallSensor(c, std::move(s), K::kBallRotation, id);
    case mjSENS_BALLANGVEL:
      return BallSensor(c, std::move(s), K::kBallAngularVelocity, id);
    case mjSENS_FRAMEPOS:
      return FrameSensor(c, std::move(s), K::kPosition, i, false);
    case mjSENS_FRAMEQUAT:
      return FrameSensor(c, std::move(s), K::kRotation, i, false);
    case mjSENS_FRAMEXAXIS:
      return FrameSensor(c, std::move(s), K::kXAxis, i, false);
    case mjSENS_FRAMEYAXIS:
      return FrameSensor(c, std::move(s), K::kYAxis, i, false);
    case mjSENS_FRAMEZAXIS:
      return FrameSensor(c, std::move(s), K::kZAxis, i, false);
    case mjSENS_FRAMELINVEL:
      return FrameSensor(c, std::move(s), K::kVelocity, i, false);
    case mjSENS_FRAMEANGVEL:
      return FrameSensor(c, std::move(s), K::kAngularVelocity, i, false);
    case mjSENS_VELOCIMETER:
      return FrameSensor(c, std::move(s), K::kVelocity, i, true);
    case mjSENS_GYRO:
      return FrameSensor(c, std::move(s), K::kAngularVelocity, i, true);
    case mjSENS_MAGNETOMETER:
      s.field_W = Vec3(m.opt.magnetic);
      return FrameSensor(c, std::move(s), K::kMagneticField, i, true);
    case mjSENS_SUBTREECOM:
      return SubtreeSensor(c, std::move(s), K::kSubtreeCenter, id);
    case mjSENS_SUBTREELINVEL:
      return SubtreeSensor(c, std::move(s), K::kSubtreeVelocity, id);
    case mjSENS_SUBTREEANGMOM:
      return SubtreeSensor(c, std::move(s), K::kSubtreeAngularMomentum, id);
    case mjSENS_ACCELEROMETER:
      return FrameSensor(c, std::move(s), K::kAcceleration, i, true);
    case mjSENS_FRAMELINACC:
      return FrameSensor(c, std::move(s), K::kAcceleration, i, false);
    case mjSENS_FRAMEANGACC:
      return FrameSensor(c, std::move(s), K::kAngularAcceleration, i, false);
    case mjSENS_FORCE:
      return CutSensor(c, std::move(s), K::kForce, i);
    case mjSENS_TORQUE:
      return CutSensor(c, std::move(s), K::kTorque, i);
    case mjSENS_TOUCH:
      return VolumeSensor(c, std::move(s), K::kTouch, i, id);
    case mjSENS_JOINTLIMITFRC:
    case mjSENS_TENDONLIMITFRC:
      return LimitForceSensor(c, std::move(s), type, id);
    case mjSENS_RANGEFINDER:
      return DistanceSensor(c, std::move(s), i);
    case mjSENS_INSIDESITE:
      return InsideSensor(c, std::move(s), i);
    case mjSENS_TENDONACTFRC:
      return TendonActuatorForceSensor(c, std::move(s), id);
    case mjSENS_E_POTENTIAL:
      return PotentialEnergySensor(c, std::move(s));
    case mjSENS_ACTUATORFRC:
      return ActuatorForceSensor(c, std::move(s), id);
    case mjSENS_JOINTACTFRC:
      return JointActuatorForceSensor(c, std::move(s), id);
    case mjSENS_CLOCK:
      s.kind = K::kTime;
      return s;
    case mjSENS_E_KINETIC:
      s.kind = K::kKineticEnergy;
      return s;
    case mjSENS_USER:
      return Unknown(std::move(s), "a program of the user computes it");
    case mjSENS_PLUGIN:
      return Unknown(std::move(s), "a plugin computes it");
    default:
      return Unknown(std::move(s), "this kind is not computed here");
  }
}

}  // namespace

void ConvertSensors(Conversion& c) {
  const mjModel& m = c.m;
  const auto add_frame = [&](int name, const char* word, FileFrame::Kind kind, int type, int i) {
    if (const auto frame = FrameOf(c, type, i)) c.frames.push_back({NameOr(m, name, word, i), kind, *frame});
  };
  for (int i = 0; i < m.nsite; ++i)
    add_frame(m.name_siteadr[i], "site", FileFrame::Kind::kSite, mjOBJ_SITE, i);
  for (int i = 0; i < m.ncam; ++i)
    add_frame(m.name_camadr[i], "camera", FileFrame::Kind::kCamera, mjOBJ_CAMERA, i);
  for (int i = 0; i < m.nactuator; ++i) {
    SensorDef s;
    s.name = c.actuator_names[static_cast<std::size_t>(i)];
    c.actuators.push_back(ActuatorForceSensor(c, std::move(s), i));
  }
  if (m.nsensor > 0 && (m.opt.disableflags & mjDSBL_SENSOR)) {
    c.Dropped(m.nsensor == 1 ? "1 sensor" : fmt::format("{} sensors", m.nsensor),
              "sensors are switched off in <option>");
    return;
  }
  std::map<std::string, std::vector<std::string>> unknown;
  std::vector<std::string> noisy, late;
  for (int i = 0; i < m.nsensor; ++i) {
    SensorDef s;
    s.name = c.sensor_names[static_cast<std::size_t>(i)];
    s.size = m.sensor_dim[i];
    const int data = m.sensor_datatype[i];
    if (const double cutoff = m.sensor_cutoff[i]; cutoff > 0) {
      if (data == mjDATATYPE_REAL || data == mjDATATYPE_POSITIVE) s.clip_upper = cutoff;
      if (data == mjDATATYPE_REAL) s.clip_lower = -cutoff;
    }
    if (m.sensor_noise[i] > 0) noisy.push_back(s.name);
    if (m.sensor_delay[i] > 0 || m.sensor_interval[2 * i] > 0) late.push_back(s.name);
    s = ConvertSensor(c, std::move(s), i);
    if (s.kind == SensorKind::kUnknown) unknown[s.reason].push_back(s.name);
    c.scene.sensors.push_back(std::move(s));
  }
  for (const auto& [reason, names] : unknown) c.DroppedMany("sensor", names, reason + "; its value is NaN");
  c.DroppedMany("noise of sensor", noisy, "values are exact");
  c.DroppedMany("delay and interval of sensor", late, "values are those at the end of each step");
}

}  // namespace fork1s::internal
