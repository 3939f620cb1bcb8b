// The fields of every struct that is written down.
//
// The structured bindings are the guard: a struct that gains a field stops the compiler here, so that no
// field is forgotten by recordings. Then list it, raise kFormatVersion and kModelVersion, and give it a value for
// files of older versions that are still read, or read them no longer.
#pragma once

#include "mechanism/names.hpp"

#include "json_archive.hpp"

namespace fork1s::internal {

template <>
struct EnumNames<ModeChoice> {
  static constexpr auto& kNames = kModeChoiceNames;
};
template <>
struct EnumNames<ParentFilter> {
  static constexpr auto& kNames = kParentFilterNames;
};
template <>
struct EnumNames<BaseKind> {
  static constexpr auto& kNames = kBaseKindNames;
};
template <>
struct EnumNames<JointKind> {
  static constexpr auto& kNames = kJointKindNames;
};
template <>
struct EnumNames<ControlDynamics> {
  static constexpr auto& kNames = kControlDynamicsNames;
};
template <>
struct EnumNames<PathElementDef::Kind> {
  static constexpr auto& kNames = kPathElementNames;
};
template <>
struct EnumNames<PathKind> {
  static constexpr auto& kNames = kPathKindNames;
};
template <>
struct EnumNames<SensorKind> {
  static constexpr auto& kNames = kSensorKindNames;
};
template <>
struct EnumNames<Recovery> {
  static constexpr auto& kNames = kRecoveryNames;
};

template <>
struct EnumNames<Integrator> {
  static constexpr auto& kNames = kIntegratorNames;
};

template <>
struct EnumNames<DetailLevel> {
  static constexpr std::pair<DetailLevel, const char*> kNames[] = {{DetailLevel::kObject, "object"},
                                                                   {DetailLevel::kInterface, "interface"},
                                                                   {DetailLevel::kParents, "parents"},
                                                                   {DetailLevel::kAll, "all"}};
};

template <>
struct EnumNames<FileJoint::Kind> {
  static constexpr std::pair<FileJoint::Kind, const char*> kNames[] = {{FileJoint::Kind::kFree, "free"},
                                                                       {FileJoint::Kind::kBall, "ball"},
                                                                       {FileJoint::Kind::kSlide, "slide"},
                                                                       {FileJoint::Kind::kHinge, "hinge"}};
};

template <>
struct EnumNames<FileFrame::Kind> {
  static constexpr std::pair<FileFrame::Kind, const char*> kNames[] = {{FileFrame::Kind::kSite, "site"},
                                                                       {FileFrame::Kind::kCamera, "camera"}};
};

template <>
struct EnumNames<ImportNote::Kind> {
  static constexpr std::pair<ImportNote::Kind, const char*> kNames[] = {
      {ImportNote::Kind::kDropped, "dropped"},
      {ImportNote::Kind::kChanged, "changed"},
      {ImportNote::Kind::kChosen, "chosen"}};
};

template <class A>
void Fields(A& a, Like<Sphere, A>& s) {
  a("radius", s.radius);
}
template <class A>
void Fields(A& a, Like<Plane, A>& s) {
  a("half_x", s.half_x), a("half_y", s.half_y);
}
template <class A>
void Fields(A& a, Like<Capsule, A>& s) {
  a("radius", s.radius), a("half_length", s.half_length);
}
template <class A>
void Fields(A& a, Like<Cylinder, A>& s) {
  a("radius", s.radius), a("half_length", s.half_length);
}
template <class A>
void Fields(A& a, Like<Ellipsoid, A>& s) {
  a("radii", s.radii);
}
template <class A>
void Fields(A& a, Like<Box, A>& s) {
  a("half", s.half);
}

template <class A>
void Fields(A& a, Like<SpatialInertia, A>& s) {
  auto& [mass, center, rotational] = s;
  a("mass", mass), a("center", center), a("rotational", rotational);
}

template <class A>
void Fields(A& a, Like<GeometryDef, A>& s) {
  auto& [name, shape, X_BG, friction, priority, contype, conaffinity, frictionless, torsion, rolling, moments,
         restitution, margin, gap, adhesion, surface_velocity, pairs, rgba, group, picture, picture_x,
         picture_y] = s;
  a("name", name), a("shape", shape), a("X_BG", X_BG), a("friction", friction), a("priority", priority);
  a("contype", contype), a("conaffinity", conaffinity), a("frictionless", frictionless);
  a("torsion", torsion), a("rolling", rolling), a("moments", moments);
  a("restitution", restitution), a("margin", margin), a("pairs", pairs);
  a.Optional("gap", gap);  // files of versions before 22 have none
  a.Optional("adhesion", adhesion), a.Optional("surface_velocity", surface_velocity);  // before 24
  a("rgba", rgba), a("group", group);
  a("picture", picture), a("picture_x", picture_x), a("picture_y", picture_y);
}

template <class A>
void Fields(A& a, Like<ContactPairDef, A>& s) {
  auto& [name, friction, friction_scale, torsion, rolling, restitution, margin, gap, adhesion] = s;
  a("name", name), a("friction", friction), a("torsion", torsion), a("rolling", rolling);
  a("restitution", restitution), a("margin", margin);
  a.Optional("gap", gap);  // as of GeometryDef
  a.Optional("friction_scale", friction_scale), a.Optional("adhesion", adhesion);
}

template <class A>
void Fields(A& a, Like<FreedomDef, A>& s) {
  auto& [screw_B, stiffness, damping, armature, rest, lower, upper] = s;
  a("screw_B", screw_B), a("stiffness", stiffness), a("damping", damping), a("armature", armature);
  a("rest", rest), a("lower", lower), a("upper", upper);
}

template <class A>
void Fields(A& a, Like<JointDef, A>& s) {
  auto& [name, body, kind, freedoms] = s;
  a("name", name), a("body", body), a("kind", kind), a("freedoms", freedoms);
}

template <class A>
void Fields(A& a, Like<BodyDef, A>& s) {
  auto& [name, parent, X_PB, inertia, geometries, compensation] = s;
  a("name", name), a("parent", parent), a("X_PB", X_PB), a("inertia", inertia), a("geometries", geometries);
  a("gravity_compensation", compensation);
}

template <class A>
void Fields(A& a, Like<ClosureDef, A>& s) {
  auto& [name, body_a, body_b, X_AJ, X_BJ, rigid, stiffness, damping] = s;
  a("name", name), a("body_a", body_a), a("body_b", body_b), a("X_AJ", X_AJ), a("X_BJ", X_BJ);
  a("rigid", rigid), a("stiffness", stiffness), a("damping", damping);
}

template <class A>
void Fields(A& a, Like<FreedomRef, A>& s) {
  auto& [joint, freedom] = s;
  a("joint", joint), a("freedom", freedom);
}

template <class A>
void Fields(A& a, Like<CouplingDef, A>& s) {
  auto& [name, first, second, polynomial, terms] = s;
  a("name", name), a("a", first), a("b", second), a("polynomial", polynomial);
  a.Optional("terms", terms);
}

template <class A>
void Fields(A& a, Like<PathElementDef, A>& s) {
  auto& [kind, body, X_BE, radius, divisor, has_side, side_body, side_B] = s;
  a("kind", kind), a("body", body), a("X_BE", X_BE), a("radius", radius), a("divisor", divisor);
  a("has_side", has_side), a("side_body", side_body), a("side_B", side_B);
}

template <class A>
void Fields(A& a, Like<PathDef, A>& s) {
  auto& [name, elements, kind, rod, gear] = s;
  a("name", name), a("elements", elements), a("kind", kind), a("rod", rod), a("gear", gear);
}

template <class A>
void Fields(A& a, Like<PathRef, A>& s) {
  auto& [path, gear] = s;
  a("path", path), a("gear", gear);
}

template <class A>
void Fields(A& a, Like<SpringDef, A>& s) {
  auto& [name, terms, stiffness, damping, rest, along, higher_stiffness, higher_damping, slack] = s;
  a("name", name), a("terms", terms), a("stiffness", stiffness), a("damping", damping), a("rest", rest);
  a("along", along), a("higher_stiffness", higher_stiffness), a("higher_damping", higher_damping);
  a("slack", slack);
}

template <class A>
void Fields(A& a, Like<ControlDef, A>& s) {
  auto& [name, terms, gain, is_setpoint, lower, upper, initial, along, dynamics, time_constant,
         activation_lower, activation_upper, initial_activation, deactivation_time, smoothing,
         setpoint_per_unit, setpoint_rest, is_velocity_setpoint] = s;
  a("name", name), a("terms", terms), a("gain", gain), a("is_setpoint", is_setpoint);
  a("lower", lower), a("upper", upper), a("initial", initial), a("along", along);
  a.Optional("dynamics", dynamics), a.Optional("time_constant", time_constant);
  a.Optional("activation_lower", activation_lower), a.Optional("activation_upper", activation_upper);
  a.Optional("initial_activation", initial_activation), a.Optional("deactivation_time", deactivation_time);
  a.Optional("smoothing", smoothing);
  a.Optional("setpoint_per_unit", setpoint_per_unit), a.Optional("setpoint_rest", setpoint_rest);
  a.Optional("is_velocity_setpoint", is_velocity_setpoint);
}

template <class A>
void Fields(A& a, Like<DryFrictionDef, A>& s) {
  auto& [name, terms, force, along] = s;
  a("name", name), a("terms", terms), a("force", force), a("along", along);
}

template <class A>
void Fields(A& a, Like<LengthLimitDef, A>& s) {
  auto& [name, terms, lower, upper, along] = s;
  a("name", name), a("terms", terms), a("lower", lower), a("upper", upper), a("along", along);
}

template <class A>
void Fields(A& a, Like<ForceLimitDef, A>& s) {
  auto& [name, terms, inputs, stiffness, damping, rest, lower, upper, along] = s;
  a("name", name), a("terms", terms), a("inputs", inputs), a("stiffness", stiffness), a("damping", damping);
  a("rest", rest), a("lower", lower), a("upper", upper), a("along", along);
}

template <class A>
void Fields(A& a, Like<MuscleDef, A>& s) {
  auto& [name, terms, control, force, length_lower, length_upper, range_lower, range_upper, lmin, lmax, vmax,
         fpmax, fvmax, along] = s;
  a("name", name), a("terms", terms), a("control", control), a("force", force);
  a("length_lower", length_lower), a("length_upper", length_upper), a("range_lower", range_lower);
  a("range_upper", range_upper), a("lmin", lmin), a("lmax", lmax), a("vmax", vmax), a("fpmax", fpmax);
  a("fvmax", fvmax), a("along", along);
}

template <class A>
void Fields(A& a, Like<AdhesionDef, A>& s) {
  auto& [name, body, control, gain, lower, upper] = s;
  a("name", name), a("body", body), a("control", control), a("gain", gain), a("lower", lower);
  a("upper", upper);
}

template <class A>
void Fields(A& a, Like<SwitchedClosureDef, A>& s) {
  auto& [name, body_a, body_b, X_AJ, X_BJ, rigid, control, time_constant] = s;
  a("name", name), a("body_a", body_a), a("body_b", body_b), a("X_AJ", X_AJ), a("X_BJ", X_BJ);
  a("rigid", rigid), a("control", control), a("time_constant", time_constant);
}

template <class A>
void Fields(A& a, Like<MechanismDef, A>& s) {
  auto& [name, base, X_WR, bodies, joints, closures, couplings, paths, springs, controls, frictions,
         length_limits, force_limits, muscles, adhesions, switched_closures, interfaces, chosen, modes,
         modes_by_step, mode_choice, parent_filter] = s;
  a("name", name), a("base", base), a("X_WR", X_WR), a("bodies", bodies), a("joints", joints);
  a("closures", closures), a("couplings", couplings), a("paths", paths), a("springs", springs),
      a("controls", controls);
  a("frictions", frictions), a("length_limits", length_limits), a("force_limits", force_limits);
  a.Optional("muscles", muscles);                      // files of versions before 21 have none
  a.Optional("adhesions", adhesions);                  // before 22
  a.Optional("switched_closures", switched_closures);  // before 23
  a("interfaces", interfaces), a("interfaces_chosen", chosen), a("modes", modes);
  a("modes_by_step", modes_by_step), a("mode_choice", mode_choice), a("parent_filter", parent_filter);
}

template <class A>
void Fields(A& a, Like<FreeBodyDef, A>& s) {
  auto& [name, X_WB, inertia, geometries, compensation] = s;
  a("name", name), a("X_WB", X_WB), a("inertia", inertia), a("geometries", geometries);
  a("gravity_compensation", compensation);
}

template <class A>
void Fields(A& a, Like<KeyframeDef::MechanismState, A>& s) {
  auto& [q, q_dot, X_WR, V_R, controls, activation] = s;
  a("q", q), a("q_dot", q_dot), a("X_WR", X_WR), a("V_R", V_R), a("controls", controls);
  a.Optional("activation", activation);
}

template <class A>
void Fields(A& a, Like<KeyframeDef::FreeBodyState, A>& s) {
  auto& [X_WB, omega_W, velocity_W] = s;
  a("X_WB", X_WB), a("omega_W", omega_W), a("velocity_W", velocity_W);
}

template <class A>
void Fields(A& a, Like<KeyframeDef, A>& s) {
  auto& [name, mechanisms, free_bodies] = s;
  a("name", name), a("mechanisms", mechanisms), a("free_bodies", free_bodies);
}

template <class A>
void Fields(A& a, Like<SensorBody, A>& s) {
  auto& [mechanism, body, free_body] = s;
  a("mechanism", mechanism), a("body", body), a("free_body", free_body);
}

template <class A>
void Fields(A& a, Like<SensorFrame, A>& s) {
  auto& [body, X_BF] = s;
  a("body", body), a("X_BF", X_BF);
}

template <class A>
void Fields(A& a, Like<SensorActuator, A>& s) {
  auto& [mechanism, terms, along, at_reference, inputs, muscle, stiffness, damping, bias, lower, upper] = s;
  a("mechanism", mechanism), a("terms", terms), a("along", along), a("at_reference", at_reference);
  a("inputs", inputs), a("stiffness", stiffness), a("damping", damping), a("bias", bias);
  a("lower", lower), a("upper", upper);
  a.Optional("muscle", muscle);
}

template <class A>
void Fields(A& a, Like<SensorSpring, A>& s) {
  auto& [mechanism, spring] = s;
  a("mechanism", mechanism), a("spring", spring);
}

template <class A>
void Fields(A& a, Like<SensorDef, A>& s) {
  auto& [name, kind, size, frame, reference, own_axes, subtree, mechanism, terms, along, at_reference, lower,
         upper, volume, field_W, actuators, springs, unseen, limit, clip_lower, clip_upper, reason] = s;
  a("name", name), a("kind", kind), a("size", size), a("frame", frame);
  a("reference", reference), a("own_axes", own_axes), a("subtree", subtree), a("mechanism", mechanism);
  a("terms", terms), a("along", along), a("at_reference", at_reference), a("lower", lower);
  a("upper", upper), a("volume", volume), a("field_W", field_W), a("actuators", actuators);
  a("clip_lower", clip_lower), a("clip_upper", clip_upper), a("reason", reason);
  // Files of version 19 have no sensors of such kinds.
  a.Optional("springs", springs), a.Optional("unseen", unseen), a.Optional("limit", limit);
}

template <class A>
void Fields(A& a, Like<Scene, A>& s) {
  auto& [name, gravity, timestep, mechanisms, free_bodies, world, excluded_pairs, contact_pairs, keyframes,
         sensors] = s;
  a("name", name), a("gravity", gravity), a("timestep", timestep), a("mechanisms", mechanisms);
  a("free_bodies", free_bodies), a("world", world), a("excluded_pairs", excluded_pairs),
      a("contact_pairs", contact_pairs), a("keyframes", keyframes);
  // Files of version 18 without this list have no sensors.
  a.Optional("sensors", sensors);
}

template <class A>
void Fields(A& a, Like<ImportNote, A>& s) {
  auto& [kind, where, message] = s;
  a("kind", kind), a("where", where), a("message", message);
}

template <class A>
void Fields(A& a, Like<JointHold, A>& s) {
  auto& [joint, held_by] = s;
  a("joint", joint), a("held_by", held_by);
}

template <class A>
void Fields(A& a, Like<ServoGains, A>& s) {
  auto& [mechanism, control, stiffness, damping, bias, at_reference] = s;
  a("mechanism", mechanism), a("control", control), a("stiffness", stiffness), a("damping", damping);
  a("bias", bias), a("at_reference", at_reference);
}

template <class A>
void Fields(A& a, Like<ImportReport, A>& s) {
  auto& [format, notes, holds, servos, velocity_limits] = s;
  a("format", format), a("notes", notes), a("holds", holds), a("servos", servos);
  a("velocity_limits", velocity_limits);
}

template <class A>
void Fields(A& a, Like<FileJoint, A>& s) {
  auto& [name, kind, free_body, mechanism, body, coordinate, reference] = s;
  a("name", name), a("kind", kind), a("free_body", free_body), a("mechanism", mechanism), a("body", body);
  a("coordinate", coordinate), a("reference", reference);
}

template <class A>
void Fields(A& a, Like<FileFrame, A>& s) {
  auto& [name, kind, frame] = s;
  a("name", name), a("kind", kind), a("frame", frame);
}

template <class A>
void Fields(A& a, Like<ImportedScene, A>& s) {
  auto& [scene, report, initial_keyframe, joints, actuators, frames] = s;
  a("scene", scene), a("report", report), a("initial_keyframe", initial_keyframe), a("joints", joints);
  a("actuators", actuators), a("frames", frames);
}

template <class A>
void Fields(A& a, Like<PdGains, A>& s) {
  auto& [kp, kv] = s;
  a("kp", kp), a("kv", kv);
}

template <class A>
void Fields(A& a, Like<ImportOptions, A>& s) {
  auto& [interfaces, switched, base, modes, modes_by_step, mode_choice, stiffness_scale, pd, joint_pd,
         keyframe, base_pose, joint_coordinates, keep_start, hold, ground, ground_height, packages] = s;
  a("interfaces", interfaces), a("base", base), a("modes", modes), a("modes_by_step", modes_by_step);
  a("mode_choice", mode_choice), a("stiffness_scale", stiffness_scale), a("pd", pd), a("joint_pd", joint_pd);
  a("keyframe", keyframe), a("base_pose", base_pose), a("joint_coordinates", joint_coordinates);
  a("keep_start", keep_start), a("hold", hold), a("ground", ground), a("ground_height", ground_height),
      a("packages", packages), a("switched", switched);
}

template <class A>
void Fields(A& a, Like<ContactSolverOptions, A>& s) {
  auto& [tolerance, max_newton_iterations, max_relative_regularization] = s;
  a("tolerance", tolerance), a("max_newton_iterations", max_newton_iterations),
      a("most_give", max_relative_regularization);
}

template <class A>
void Fields(A& a, Like<ContactMaterial, A>& s) {
  auto& [stiffness, depth, relaxation_steps, max_push_speed] = s;
  a("stiffness", stiffness), a("depth", depth), a("relaxation_steps", relaxation_steps);
  a("max_push_speed", max_push_speed);
}

template <class A>
void Fields(A& a, Like<StepOptions, A>& s) {
  auto& [h, integrator, controls_move, gravity, material, refresh, newton_tolerance, contact] = s;
  a("h", h), a("integrator", integrator), a("controls_move", controls_move);
  a("gravity", gravity), a("material", material);
  a("refresh", refresh), a("contact", contact);
  a.Optional("newton_tolerance", newton_tolerance);
}

template <class A>
void Fields(A& a, Like<CollisionOptions, A>& s) {
  auto& [margin, multi_point] = s;
  a("margin", margin), a("multi_point", multi_point);
}

template <class A>
void Fields(A& a, Like<ReductionOptions, A>& s) {
  // The step follows from dt and integrator of the simulation.
  auto& [interfaces, modes, rank_tolerance, promote_hidden, step] = s;
  a("interfaces", interfaces), a("modes", modes), a("rank_tolerance", rank_tolerance);
  a("promote_hidden", promote_hidden);
}

template <class A>
void Fields(A& a, Like<SimulationOptions, A>& s) {
  // Reserved memory changes no result.
  auto& [dt, recovery, reduction, refresh_angle, initial_keyframe, step, collision, reserved_contacts,
         detail] = s;
  static_cast<void>(reserved_contacts);
  a("dt", dt), a("recovery", recovery), a("reduction", reduction), a("refresh_angle", refresh_angle);
  a("initial_keyframe", initial_keyframe), a("step", step), a("collision", collision);
  a("detail", detail);
}

}  // namespace fork1s::internal
