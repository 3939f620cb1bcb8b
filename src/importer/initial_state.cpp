// Where the model starts when options say so: the pose of its base and coordinates of joints.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fork1s/mechanism/kinematics.hpp>
#include <set>

#include "conversion.hpp"
#include "importer/loop_moves.hpp"
#include "names.hpp"

namespace fork1s::internal {
namespace {

// A coordinate that an option asks for.
struct Asked : WantedCoordinate {
  int mechanism = 0;
};

Error RefusePose(const Conversion& c, std::string message) {
  return {ErrorCode::kUsage, fmt::format("{}, option base-pose", c.file), std::move(message)};
}

std::optional<Error> PlaceMechanism(Conversion& c, const RigidTransform& X_WB) {
  const mjModel& m = c.m;
  const auto component = std::find_if(c.components.begin(), c.components.end(),
                                      [](const Component& one) { return !one.free_body; });
  MechanismDef& mechanism = c.scene.mechanisms[0];
  if (component->base_body == 0) {
    return RefusePose(
        c, fmt::format("mechanism '{}' stands on the world itself, so it has no base to place; put a "
                       "body without joints under it",
                       mechanism.name));
  }
  for (int e = 0; e < m.neq; ++e) {
    if (!c.EqualityWorks(e) || JointEqualityOf(c, e) || c.used_equality[e]) continue;
    const BodyPlace &a = c.body[PlaceOfEquality(m, e, 0).body], &b = c.body[PlaceOfEquality(m, e, 1).body];
    if (a.still() == b.still()) continue;
    return RefusePose(
        c, fmt::format("equality '{}' ties mechanism '{}' to the world, so its base stays where it is",
                       NameOr(m, m.name_eqadr[e], "equality", e), mechanism.name));
  }
  mechanism.X_WR = X_WB;
  for (std::size_t key = 0; key < c.scene.keyframes.size(); ++key) {
    // Other keyframes keep the pose that they give to a base that can move.
    if (mechanism.base == BaseKind::kFixed || static_cast<int>(key) == c.initial_keyframe)
      c.scene.keyframes[key].mechanisms[0].X_WR = X_WB;
  }
  return std::nullopt;
}

std::optional<Error> PlaceBase(Conversion& c, const RigidTransform& X_WB) {
  if (!X_WB.IsFinite()) return RefusePose(c, "a number is not finite; write finite numbers");
  if (c.scene.mechanisms.size() == 1) return PlaceMechanism(c, X_WB);
  if (c.scene.mechanisms.empty() && c.scene.free_bodies.size() == 1) {
    c.scene.free_bodies[0].X_WB = X_WB;
    if (c.initial_keyframe >= 0) c.scene.keyframes[c.initial_keyframe].free_bodies[0].X_WB = X_WB;
    return std::nullopt;
  }
  std::vector<std::string> names;
  for (const MechanismDef& mechanism : c.scene.mechanisms) names.push_back(mechanism.name);
  if (names.empty())
    for (const FreeBodyDef& body : c.scene.free_bodies) names.push_back(body.name);
  return RefusePose(
      c, fmt::format("the file has {} movable parts, {}, and the option places one; write their poses in "
                     "the file",
                     names.size(), Quoted(names)));
}

// `limited`: of a freedom or a length.
bool Outside(const auto& limited, double at) {
  constexpr double kRounding = 1e-9;  // rad or m; limits are written with that many digits
  return at < limited.lower - kRounding || at > limited.upper + kRounding;
}

// `by` says who asks for it.
Expected<Asked> FindAsked(Conversion& c, const std::string& by, const std::string& name, double value,
                          bool keep) {
  const mjModel& m = c.m;
  const std::string where = fmt::format("{}, {} '{}'", c.file, by, name);
  std::vector<std::string> known;
  int found = -1;
  for (int j = 0; j < m.njnt; ++j) {
    if (c.joint_names[j] == name) found = j;
    const bool scalar = m.jnt_type[j] == mjJNT_HINGE || m.jnt_type[j] == mjJNT_SLIDE;
    if (scalar && c.joint[j].mechanism >= 0) known.push_back(c.joint_names[j]);
  }
  if (found < 0) {
    return Fail(ErrorCode::kUsage, where,
                fmt::format("no mechanism has a joint of that name{}", Suggestion(name, known)));
  }
  const int type = m.jnt_type[found];
  if (type == mjJNT_FREE || c.joint[found].mechanism < 0) {
    return Fail(
        ErrorCode::kUsage, where,
        "the joint moves freely and has no single coordinate; the pose of a base is set as the base pose");
  }
  if (type == mjJNT_BALL)
    return Fail(ErrorCode::kUsage, where,
                "a ball joint has no single coordinate; set it by a keyframe of the file");
  const int dof = m.jnt_dofadr[found];
  const char* unit = type == mjJNT_SLIDE ? "m" : "rad";
  if (!std::isfinite(value))
    return Fail(ErrorCode::kUsage, where, "the value is not finite; write a finite number");
  const double q0 = c.Reference(dof);
  const FreedomDef& freedom = c.FreedomOf(dof);
  Asked asked{{name, c.Freedom(dof), value - q0}, c.MechanismOf(dof)};
  if (!keep && Outside(freedom, asked.displacement)) {
    asked.displacement = std::clamp(asked.displacement, freedom.lower, freedom.upper);
    c.Note(ImportNote::Kind::kChosen, fmt::format("{} '{}'", by, name),
           fmt::format(
               "{:.4g} {} is outside its limits {:.4g} to {:.4g} {}: it starts at the nearest, {:.4g} {}",
               value, unit, freedom.lower + q0, freedom.upper + q0, unit, asked.displacement + q0, unit));
  }
  return asked;
}

std::optional<Error> MoveTo(const Conversion& c, int mechanism, const std::vector<Asked>& asked, VectorX& q) {
  return MoveCoordinates(
      c.scene.mechanisms[mechanism], std::vector<WantedCoordinate>(asked.begin(), asked.end()),
      fmt::format("{}, option q{}", c.file, c.start.empty() ? "" : " or initial_value of <ros2_control>"), q);
}

using AskedByMechanism = std::vector<std::vector<Asked>>;

// Leaders at their reference, where an offset moves a follower away from its own.
AskedByMechanism LeadersOf(const Conversion& c, const std::vector<Mimic>& mimics) {
  AskedByMechanism leaders(c.scene.mechanisms.size());
  if (std::all_of(mimics.begin(), mimics.end(), [](const Mimic& m) { return m.offset == 0; })) return leaders;
  std::set<std::string> names;
  for (const Mimic& mimic : mimics) names.insert(mimic.leader);
  for (const Mimic& mimic : mimics) names.erase(mimic.joint);
  for (int j = 0; j < c.m.njnt; ++j)
    if (names.count(c.joint_names[j]) > 0 && c.joint[j].mechanism >= 0)
      leaders[c.joint[j].mechanism].push_back(
          {{c.joint_names[j], {c.joint[j].joint, 0}, 0}, c.joint[j].mechanism});
  return leaders;
}

// Joints whose displacement is outside their limits, each at the nearest value inside.
std::vector<Asked> NearestInside(const Conversion& c, int mechanism, const VectorX& q) {
  std::vector<Asked> nearest;
  const MechanismDef& definition = c.scene.mechanisms[mechanism];
  for (std::size_t j = 0; j < definition.joints.size(); ++j) {
    const JointDef& joint = definition.joints[j];
    for (int i = 0; i < static_cast<int>(joint.freedoms.size()); ++i) {
      const FreedomDef& freedom = joint.freedoms[i];
      const FreedomRef ref{JointIndex(j), i};
      const double at = q[CoordinateOf(definition, ref)];
      if (Outside(freedom, at))
        nearest.push_back({{joint.name, ref, std::clamp(at, freedom.lower, freedom.upper)}, mechanism});
    }
  }
  return nearest;
}

// No force brings joints inside limits in which their loops do not close.
void WidenLimits(Conversion& c, int mechanism, const std::vector<Asked>& outside, const VectorX& q) {
  MechanismDef& definition = c.scene.mechanisms[mechanism];
  for (const Asked& one : outside) {
    FreedomDef& freedom = definition.joints[one.freedom.joint.u()].freedoms[one.freedom.freedom];
    const double at = q[CoordinateOf(definition, one.freedom)];
    freedom.lower = std::min(freedom.lower, at);
    freedom.upper = std::max(freedom.upper, at);
  }
}

// A joint does not start outside its limits, unless its loops do not close inside them or `keep` is set.
void MoveInsideLimits(Conversion& c, int mechanism, std::vector<Asked> asked, bool keep, VectorX& q) {
  const std::vector<Asked> nearest = NearestInside(c, mechanism, q);
  if (nearest.empty()) return;
  asked.insert(asked.end(), nearest.begin(), nearest.end());
  VectorX inside = q;
  std::vector<std::string> names;
  for (const Asked& one : nearest) names.push_back(one.joint);
  if (MoveTo(c, mechanism, asked, inside)) {
    WidenLimits(c, mechanism, nearest, q);
    c.ChangedMany("joint", names,
                  "starts outside its limits, since its loops stay open inside them: its stop is where it "
                  "starts");
    return;
  }
  if (keep) {
    c.ChangedMany("joint", names,
                  "starts outside its limits, as the file has it: it is brought inside at a bounded speed");
    return;
  }
  q = inside;
  c.ChangedMany("joint", names,
                "the file starts it outside its limits: it starts at the nearest value inside; the option "
                "keep-start starts it where the file does");
}

double LengthOf(const MechanismDef& definition, const LengthLimitDef& limit, const VectorX& q) {
  double length = 0;
  for (const auto& [freedom, coefficient] : limit.terms)
    length += coefficient * q[CoordinateOf(definition, freedom)];
  return length;
}

// The least displacements of joints within their limits that bring a sum of coordinates inside its own; those of `fixed`
// stay. Less than that where the limits of joints do not allow it.
std::vector<Asked> NearestInside(const MechanismDef& definition, int mechanism, const LengthLimitDef& limit,
                                 const std::vector<Asked>& fixed, VectorX q) {
  auto movable = limit.terms;
  std::erase_if(movable, [&](const auto& term) {
    const int at = CoordinateOf(definition, term.first);
    return term.second == 0 || std::any_of(fixed.begin(), fixed.end(), [&](const Asked& one) {
             return CoordinateOf(definition, one.freedom) == at;
           });
  });
  std::vector<Asked> moved;
  for (const auto& term : movable)
    moved.push_back({{definition.joints[term.first.joint.u()].name, term.first, 0}, mechanism});
  while (!movable.empty()) {
    const double length = LengthOf(definition, limit, q),
                 missing = std::clamp(length, limit.lower, limit.upper) - length;
    double squares = 0;
    for (const auto& term : movable) squares += term.second * term.second;
    const std::size_t before = movable.size();
    std::erase_if(movable, [&](const auto& term) {
      const FreedomDef& freedom = definition.joints[term.first.joint.u()].freedoms[term.first.freedom];
      double& at = q[CoordinateOf(definition, term.first)];
      const double wanted = at + term.second * missing / squares;
      at = std::clamp(wanted, freedom.lower, freedom.upper);
      return at != wanted;
    });
    if (movable.size() == before) break;
  }
  for (Asked& one : moved) one.displacement = q[CoordinateOf(definition, one.freedom)];
  return moved;
}

// Nor does a tendon that is a sum of coordinates, where joints inside their limits can bring it inside.
void MoveTendonsInside(Conversion& c, int mechanism, const std::vector<Asked>& asked, bool keep, VectorX& q) {
  const MechanismDef& definition = c.scene.mechanisms[mechanism];
  std::vector<std::string> moved, outside;
  const auto passed = [&](const LengthLimitDef& limit, const VectorX& at) {
    return limit.along.path < 0 && Outside(limit, LengthOf(definition, limit, at));
  };
  for (const LengthLimitDef& limit : definition.length_limits) {
    if (!passed(limit, q)) continue;
    std::vector<Asked> wanted = NearestInside(definition, mechanism, limit, asked, q);
    wanted.insert(wanted.end(), asked.begin(), asked.end());
    VectorX inside = q;
    const auto passes_another = [&] {
      return std::any_of(definition.length_limits.begin(), definition.length_limits.end(),
                         [&](const LengthLimitDef& l) { return passed(l, inside) && !passed(l, q); });
    };
    if (keep || MoveTo(c, mechanism, wanted, inside) || !NearestInside(c, mechanism, inside).empty() ||
        passed(limit, inside) || passes_another()) {
      outside.push_back(limit.name);
      continue;
    }
    q = inside;
    moved.push_back(limit.name);
  }
  c.ChangedMany(
      "tendon", moved,
      "the file starts it outside its limits: its joints start where it is at the nearest value inside; "
      "the option keep-start starts them where the file does");
  c.ChangedMany("tendon", outside, "starts outside its limits: it is brought inside at a bounded speed");
}

std::optional<Error> SetCoordinates(Conversion& c, const ImportOptions& options,
                                    const std::vector<Mimic>& mimics) {
  const AskedByMechanism leaders = LeadersOf(c, mimics);
  AskedByMechanism asked(c.scene.mechanisms.size());
  for (const auto& [name, value] : options.joint_coordinates) {
    auto one = FindAsked(c, "option q", name, value, options.keep_start);
    if (!one) return one.error();
    asked[one->mechanism].push_back(std::move(*one));
  }
  for (const auto& [name, value] : c.start) {
    if (options.joint_coordinates.contains(name)) continue;
    auto one = FindAsked(c, "initial_value of joint", name, value, options.keep_start);
    if (!one) return one.error();
    asked[one->mechanism].push_back(std::move(*one));
  }
  KeyframeDef start = PresentStart(c);
  bool moved = false;
  for (int i = 0; i < static_cast<int>(asked.size()); ++i) {
    const VectorX before = start.mechanisms[i].q;
    VectorX& q = start.mechanisms[i].q;
    if (auto error = MoveTo(c, i, leaders[i], q)) return error;
    if (auto error = MoveTo(c, i, asked[i], q)) return error;
    MoveInsideLimits(c, i, asked[i], options.keep_start, q);
    MoveTendonsInside(c, i, asked[i], options.keep_start, q);
    moved = moved || !asked[i].empty() || q != before;
  }
  if (!moved) return std::nullopt;
  AddStart(c, std::move(start));
  return std::nullopt;
}

}  // namespace

KeyframeDef PresentStart(const Conversion& c) {
  if (c.initial_keyframe >= 0) return c.scene.keyframes[c.initial_keyframe];
  KeyframeDef start;
  for (const MechanismDef& mechanism : c.scene.mechanisms) {
    KeyframeDef::MechanismState state;
    Eigen::Index n = 0;
    for (const JointDef& joint : mechanism.joints) n += static_cast<Eigen::Index>(joint.freedoms.size());
    state.q = VectorX::Zero(n);
    state.q_dot = VectorX::Zero(n);
    state.X_WR = mechanism.X_WR;
    state.controls = VectorX::Zero(static_cast<Eigen::Index>(mechanism.controls.size()));
    for (std::size_t k = 0; k < mechanism.controls.size(); ++k)
      state.controls[static_cast<Eigen::Index>(k)] = mechanism.controls[k].initial;
    start.mechanisms.push_back(std::move(state));
  }
  for (const FreeBodyDef& body : c.scene.free_bodies) start.free_bodies.push_back({body.X_WB});
  return start;
}

void AddStart(Conversion& c, KeyframeDef start) {
  start.name = "start";
  const auto taken = [&] {
    return std::any_of(c.scene.keyframes.begin(), c.scene.keyframes.end(),
                       [&](const KeyframeDef& key) { return key.name == start.name; });
  };
  while (taken()) start.name += '_';
  c.initial_keyframe = static_cast<int>(c.scene.keyframes.size());
  c.scene.keyframes.push_back(std::move(start));
}

std::optional<Error> ApplyInitialState(Conversion& c, const ImportOptions& options,
                                       const std::vector<Mimic>& mimics) {
  if (options.base_pose) {
    if (auto error = PlaceBase(c, *options.base_pose)) return error;
  }
  return SetCoordinates(c, options, mimics);
}

}  // namespace fork1s::internal
