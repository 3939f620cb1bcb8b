#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>

#include "conversion.hpp"
#include "names.hpp"

namespace fork1s::internal {
namespace {

bool MovesRelative(const mjModel& m, int a, int b) { return m.body_weldid[a] != m.body_weldid[b]; }

void ConvertClosure(Conversion& c, int e) {
  const mjModel& m = c.m;
  const EqualityPlace on_a = PlaceOfEquality(m, e, 0), on_b = PlaceOfEquality(m, e, 1);
  const int a = on_a.body, b = on_b.body;
  const std::string name = NameOr(m, m.name_eqadr[e], "equality", e);
  const std::string where = fmt::format("equality '{}'", name);
  const int mechanism = std::max(c.body[a].mechanism, c.body[b].mechanism);
  if (mechanism < 0 || !MovesRelative(m, a, b)) {
    c.Dropped(where, "joins bodies that do not move relative to each other");
    return;
  }
  const Anchor at_a = AnchorIn(c, mechanism, a), at_b = AnchorIn(c, mechanism, b);
  const mjtNum* data = m.eq_data + mjNEQDATA * e;
  const RigidTransform X_ab = c.WorldPose(a).inverse() * c.WorldPose(b);  // at the reference
  ClosureDef closure;
  if (m.eq_type[e] == mjEQ_CONNECT) {
    const bool sites = HoldsSites(m, e);
    const Vector3 point_a = sites ? on_a.X_BS.translation() : Vec3(data),
                  point_b = sites ? on_b.X_BS.translation() : X_ab.inverse() * point_a;
    closure.X_AJ = at_a.X_AB * RigidTransform(point_a);
    closure.X_BJ = at_b.X_AB * RigidTransform(point_b);
    // The two frames start parallel, so that the rotation c leaves free is measured from the reference.
    closure.X_BJ.rotation() = at_b.X_AB.rotation() * X_ab.rotation().transpose();
    closure.rigid << false, false, false, true, true, true;
  } else if (HoldsSites(m, e)) {
    closure.X_AJ = at_a.X_AB * on_a.X_BS;
    closure.X_BJ = at_b.X_AB * on_b.X_BS;
    closure.rigid.setConstant(true);
    closure.rigid[2] = c.hinges.count(name) == 0;
  } else {
    // Point data[0..2] of body b stays on point data[3..5] of body a, turned by the quaternion data[6..9].
    const Quaternion turn(data[6], data[7], data[8], data[9]);
    RigidTransform X_aj = X_ab * RigidTransform(Vec3(data));
    if (turn.norm() > 0.5) X_aj = RigidTransform(turn, Vec3(data + 3));
    closure.X_AJ = at_a.X_AB * X_aj;
    closure.X_BJ = at_b.X_AB * RigidTransform(Vec3(data));
    closure.rigid.setConstant(true);
  }
  closure.name = name;
  closure.body_a = at_a.body;
  closure.body_b = at_b.body;
  c.scene.mechanisms[mechanism].closures.push_back(std::move(closure));
}

void ConvertCoupling(Conversion& c, int e, const JointEquality& joints) {
  const mjModel& m = c.m;
  CouplingDef coupling;
  coupling.name = NameOr(m, m.name_eqadr[e], "equality", e);
  coupling.a = c.Freedom(joints.a);
  if (joints.b >= 0) coupling.b = c.Freedom(joints.b);
  std::copy(std::begin(joints.polynomial), std::end(joints.polynomial), coupling.polynomial);
  c.coupled[joints.a] = true;
  c.held_by[joints.a].push_back(joints.b >= 0
                                    ? fmt::format("coupling to '{}'", c.joint_names[m.dof_jntid[joints.b]])
                                    : "coupling, locked");
  c.scene.mechanisms[c.MechanismOf(joints.a)].couplings.push_back(std::move(coupling));
}

std::string SceneName(const Conversion& c, int b) {
  const BodyPlace& place = c.body[b];
  if (place.mechanism >= 0) return c.scene.mechanisms[place.mechanism].bodies[place.body.u()].name;
  if (place.free_body >= 0) return c.scene.free_bodies[place.free_body].name;
  return "world";
}

}  // namespace

// Of joints:  x_a = p(x_b).  Of fixed tendons, whose length is Σ c x:  Σ c x of the first = p(Σ c x of the
// second), or p0 without a second. All are displacements from the reference.
std::optional<JointEquality> JointEqualityOf(const Conversion& c, int e) {
  const mjModel& m = c.m;
  const int first = m.eq_obj1id[e], second = m.eq_obj2id[e];
  const mjtNum* p = m.eq_data + mjNEQDATA * e;
  JointEquality out;
  if (m.eq_type[e] == mjEQ_JOINT) {
    out.a = m.jnt_dofadr[first];
    if (second >= 0) out.b = m.jnt_dofadr[second];
    std::copy_n(p, second >= 0 ? 5 : 1, out.polynomial);
    return out;
  }
  if (m.eq_type[e] != mjEQ_TENDON || IsSpatial(m, first) || (second >= 0 && IsSpatial(m, second)))
    return std::nullopt;
  const auto terms = TendonLength(m, c.d, first).terms;
  if (terms.empty()) return std::nullopt;
  const auto [a, scale] = terms[0];
  out.a = a;
  out.polynomial[0] = p[0] / scale;
  if (second < 0) {
    if (terms.size() > 2) return std::nullopt;
    if (terms.size() == 2) {
      out.b = terms[1].first;
      out.polynomial[1] = -terms[1].second / scale;
    }
  } else {
    const auto others = TendonLength(m, c.d, second).terms;
    if (terms.size() > 1 || others.size() != 1) return std::nullopt;
    out.b = others[0].first;
    for (int i = 1; i < 5; ++i) out.polynomial[i] = p[i] * std::pow(others[0].second, i) / scale;
  }
  if (out.a == out.b) return std::nullopt;
  return out;
}

void ConvertEqualities(Conversion& c) {
  const mjModel& m = c.m;
  std::vector<std::string> inactive, tendons, others;
  const bool off = m.opt.disableflags & (mjDSBL_EQUALITY | mjDSBL_CONSTRAINT);
  for (int e = 0; e < m.neq; ++e) {
    const std::string name = NameOr(m, m.name_eqadr[e], "equality", e);
    if (c.used_equality[e]) continue;
    if (!m.eq_active0[e] || off) {
      inactive.push_back(name);
    } else if (const auto joints = JointEqualityOf(c, e)) {
      ConvertCoupling(c, e, *joints);
    } else if (m.eq_type[e] == mjEQ_TENDON) {
      tendons.push_back(name);
    } else if (!c.EqualityWorks(e)) {
      others.push_back(name);
    } else {
      ConvertClosure(c, e);
    }
  }
  c.DroppedMany("inactive equality constraint", inactive, "it is switched off in the file");
  c.DroppedMany("tendon equality constraint", tendons,
                "only those of fixed tendons over two joints together are constrained");
  c.DroppedMany("equality constraint", others, "its kind is not simulated");

  for (int i = 0; i < m.nexclude; ++i) {
    const int b1 = m.exclude_signature[i] >> 16, b2 = m.exclude_signature[i] & 0xFFFF;
    if (b1 < 0 || b2 < 0 || b1 >= m.nbody || b2 >= m.nbody) continue;
    c.scene.excluded_pairs.emplace_back(SceneName(c, b1), SceneName(c, b2));
  }
}

namespace {

// The limits of the first leader of a chain of mimics, as limits of the follower.
std::pair<double, double> LimitsByLeader(
    const std::vector<Mimic>& mimics, const Mimic& follower,
    const std::function<const FreedomDef&(const std::string&)>& freedom) {
  double multiplier = follower.multiplier, offset = follower.offset;
  std::string leader = follower.leader;
  for (std::size_t links = 0; links < mimics.size(); ++links) {
    const auto next =
        std::find_if(mimics.begin(), mimics.end(), [&](const Mimic& other) { return other.joint == leader; });
    if (next == mimics.end()) break;
    offset += multiplier * next->offset;
    multiplier *= next->multiplier;
    leader = next->leader;
  }
  if (multiplier == 0) return {offset, offset};
  const FreedomDef& first = freedom(leader);
  return std::minmax(offset + multiplier * first.lower, offset + multiplier * first.upper);
}

}  // namespace

std::optional<Error> ConvertMimics(Conversion& c, const std::vector<Mimic>& mimics) {
  const mjModel& m = c.m;
  const auto dof_of = [&](const std::string& name) {
    for (int j = 0; j < m.njnt; ++j) {
      const bool scalar = m.jnt_type[j] == mjJNT_HINGE || m.jnt_type[j] == mjJNT_SLIDE;
      if (scalar && c.joint_names[j] == name) return m.jnt_dofadr[j];
    }
    return -1;
  };
  for (const Mimic& mimic : mimics) {
    const int a = dof_of(mimic.joint), b = dof_of(mimic.leader);
    const std::string where = fmt::format("joint '{}'", mimic.joint);
    if (a < 0 || b < 0) {
      return c.ModelError(
          where,
          fmt::format("mimics '{}', but both must be revolute, continuous or prismatic", mimic.leader));
    }
    CouplingDef coupling;
    coupling.name = "mimic_" + mimic.joint;
    coupling.a = c.Freedom(a);
    coupling.b = c.Freedom(b);
    coupling.polynomial[0] = mimic.offset;
    coupling.polynomial[1] = mimic.multiplier;
    c.coupled[a] = true;
    c.held_by[a].push_back(fmt::format("mimic of '{}'", mimic.leader));
    c.scene.mechanisms[c.MechanismOf(a)].couplings.push_back(std::move(coupling));
  }
  std::vector<std::string> beyond;
  std::vector<FreedomDef*> followers;
  for (const Mimic& mimic : mimics) {
    FreedomDef& follower = c.FreedomOf(dof_of(mimic.joint));
    const auto [lower, upper] = LimitsByLeader(
        mimics, mimic,
        [&](const std::string& joint) -> const FreedomDef& { return c.FreedomOf(dof_of(joint)); });
    constexpr double kRounding = 1e-3;  // rad or m; files write limits of followers with few digits
    if (lower < follower.lower - kRounding || upper > follower.upper + kRounding)
      beyond.push_back(mimic.joint);
    followers.push_back(&follower);
  }
  // Of two limits of one motion, those of the leader act.
  for (FreedomDef* follower : followers) {
    follower->lower = -std::numeric_limits<double>::infinity();
    follower->upper = std::numeric_limits<double>::infinity();
  }
  c.ChangedMany("joint", beyond,
                "its own limits do not act on a follower: those of the leader let it go beyond");
  if (!mimics.empty()) {
    std::vector<std::string> names;
    for (const Mimic& mimic : mimics) names.push_back(mimic.joint);
    c.Note(ImportNote::Kind::kChanged, fmt::format("{} mimic joints", mimics.size()),
           fmt::format("{} follow their leaders exactly, as couplings", Quoted(names)));
  }
  return std::nullopt;
}

}  // namespace fork1s::internal
