#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>

#include "conversion.hpp"
#include "linalg/rank.hpp"
#include "names.hpp"

namespace fork1s::internal {

std::string SceneName(const Conversion& c, int b) {
  const BodyPlace& place = c.body[b];
  if (place.mechanism >= 0) return c.scene.mechanisms[place.mechanism].bodies[place.body.u()].name;
  if (place.free_body >= 0) return c.scene.free_bodies[place.free_body].name;
  return "world";
}

bool MovesRelative(const mjModel& m, int a, int b) { return m.body_weldid[a] != m.body_weldid[b]; }

EqualityFrames FramesOfEquality(const Conversion& c, int e) {
  const mjModel& m = c.m;
  const EqualityPlace on_a = PlaceOfEquality(m, e, 0), on_b = PlaceOfEquality(m, e, 1);
  const mjtNum* data = m.eq_data + mjNEQDATA * e;
  const RigidTransform X_ab = c.WorldPose(on_a.body).inverse() * c.WorldPose(on_b.body);  // at the reference
  EqualityFrames out;
  if (m.eq_type[e] == mjEQ_CONNECT) {
    const bool sites = HoldsSites(m, e);
    const Vector3 point_a = sites ? on_a.X_BS.translation() : Vec3(data),
                  point_b = sites ? on_b.X_BS.translation() : X_ab.inverse() * point_a;
    out.X_AJ = RigidTransform(point_a);
    // The two frames start parallel, so that the rotation c leaves free is measured from the reference.
    out.X_BJ = RigidTransform(Matrix3(X_ab.rotation().transpose()), point_b);
    out.rigid << false, false, false, true, true, true;
  } else if (HoldsSites(m, e)) {
    out.X_AJ = on_a.X_BS;
    out.X_BJ = on_b.X_BS;
    out.rigid[2] = c.hinges.count(NameOr(m, m.name_eqadr[e], "equality", e)) == 0;
  } else {
    // Point data[0..2] of body b stays on point data[3..5] of body a, turned by the quaternion data[6..9].
    const Quaternion turn(data[6], data[7], data[8], data[9]);
    out.X_AJ = X_ab * RigidTransform(Vec3(data));
    if (turn.norm() > 0.5) out.X_AJ = RigidTransform(turn, Vec3(data + 3));
    out.X_BJ = RigidTransform(Vec3(data));
  }
  return out;
}

namespace {

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
  const EqualityFrames frames = FramesOfEquality(c, e);
  ClosureDef closure;
  closure.X_AJ = at_a.X_AB * frames.X_AJ;
  closure.X_BJ = at_b.X_AB * frames.X_BJ;
  closure.rigid = frames.rigid;
  closure.name = name;
  closure.body_a = at_a.body;
  closure.body_b = at_b.body;
  c.scene.mechanisms[mechanism].closures.push_back(std::move(closure));
}

std::string EqualityName(const Conversion& c, int e) { return NameOr(c.m, c.m.name_eqadr[e], "equality", e); }

void ConvertCoupling(Conversion& c, int e, const JointEquality& joints) {
  const mjModel& m = c.m;
  CouplingDef coupling;
  coupling.name = EqualityName(c, e);
  coupling.a = c.Freedom(joints.a);
  if (joints.b >= 0) coupling.b = c.Freedom(joints.b);
  std::copy(std::begin(joints.polynomial), std::end(joints.polynomial), coupling.polynomial);
  for (const auto& [dof, coefficient] : joints.terms)
    coupling.terms.emplace_back(c.Freedom(dof), coefficient);
  c.coupled[joints.a] = true;
  std::vector<std::string> others;
  for (const int dof : joints.Dofs())
    if (dof != joints.a) others.push_back(c.joint_names[m.dof_jntid[dof]]);
  c.held_by[joints.a].push_back(others.empty() ? "coupling, locked"
                                               : fmt::format("coupling to {}", Quoted(others)));
  c.scene.mechanisms[c.MechanismOf(joints.a)].couplings.push_back(std::move(coupling));
}

// Σ v x = right, and the equalities of which it is the sum, with their shares.
struct LinearRow {
  std::map<int, double> v, shares;
  double right = 0;
  int pivot = -1;

  void Add(double factor, const LinearRow& other) {
    for (const auto& [dof, coefficient] : other.v) v[dof] += factor * coefficient;
    for (const auto& [equality, share] : other.shares) shares[equality] += factor * share;
    right += factor * other.right;
  }
};

LinearRow RowOf(int e, const JointEquality& joints) {
  LinearRow row;
  row.v[joints.a] = 1;
  if (joints.b >= 0) row.v[joints.b] = -joints.polynomial[1];
  for (const auto& [dof, coefficient] : joints.terms) row.v[dof] = -coefficient;
  row.shares[e] = 1;
  row.right = joints.polynomial[0];
  return row;
}

// An equality that is a sum of others, and how far it is from what they say [of x_a].
struct Repeated {
  int equality;
  std::vector<int> of;
  double off;
};

// Linear rows of joints and tendons that depend on rows before them, by Gaussian elimination. What is left of a row is
// 0 below the threshold by which ranks of loops are decided; rows have 1 for their largest coefficient or for a.
std::vector<Repeated> FindRepeated(const Conversion& c) {
  std::vector<Repeated> out;
  std::vector<LinearRow> rows;
  for (int e = 0; e < c.m.neq; ++e) {
    if (!c.IsActive(e)) continue;
    const auto joints = JointEqualityOf(c, e);
    if (!joints || joints->a < 0 || !joints->is_linear()) continue;
    LinearRow row = RowOf(e, *joints);
    for (const LinearRow& before : rows)
      if (const auto at = row.v.find(before.pivot); at != row.v.end()) {
        row.Add(-at->second / before.v.at(before.pivot), before);
        row.v.erase(before.pivot);
      }
    double most = 0;
    for (const auto& [dof, coefficient] : row.v)
      if (std::abs(coefficient) > most) most = std::abs(coefficient), row.pivot = dof;
    if (most > kRankThreshold) {
      rows.push_back(std::move(row));
      continue;
    }
    Repeated repeated{e, {}, row.right};
    for (const auto& [other, share] : row.shares)
      if (other != e && std::abs(share) > kRankThreshold) repeated.of.push_back(other);
    out.push_back(std::move(repeated));
  }
  return out;
}

std::string NamesOf(const Conversion& c, const std::vector<int>& equalities) {
  std::vector<std::string> names;
  for (const int e : equalities) names.push_back(EqualityName(c, e));
  return Quoted(names);
}

}  // namespace

std::vector<int> JointEquality::Dofs() const {
  std::vector<int> all;
  for (const int dof : {a, b})
    if (dof >= 0) all.push_back(dof);
  for (const auto& term : terms) all.push_back(term.first);
  return all;
}

namespace {

using Terms = std::vector<std::pair<int, double>>;

// What an equality measures of its first or second object: a displacement from the reference, Σ coefficient x.
Terms TermsOfEquality(const Conversion& c, int e, int object) {
  if (object < 0) return {};
  if (c.m.eq_type[e] == mjEQ_JOINT) return {{c.m.jnt_dofadr[object], 1.0}};
  return TendonLength(c.m, c.d, object).terms;
}

// Σ coefficient x + factor Σ of other, each x once. A sum that is rounding of its parts is 0 and left out.
Terms Sum(const Terms& terms, double factor, const Terms& other) {
  std::vector<std::pair<int, std::pair<double, double>>> sums;  // and the sum of absolute values
  const auto add = [&](int dof, double coefficient) {
    auto at = std::find_if(sums.begin(), sums.end(), [&](const auto& sum) { return sum.first == dof; });
    if (at == sums.end()) at = sums.insert(sums.end(), {dof, {0.0, 0.0}});
    at->second.first += coefficient;
    at->second.second += std::abs(coefficient);
  };
  for (const auto& [dof, coefficient] : terms) add(dof, coefficient);
  for (const auto& [dof, coefficient] : other) add(dof, factor * coefficient);
  Terms out;
  for (const auto& [dof, sum] : sums)
    if (!(std::abs(sum.first) <= 4 * std::numeric_limits<double>::epsilon() * sum.second))
      out.emplace_back(dof, sum.first);
  return out;
}

}  // namespace

// L = p(M), with L and M the displacements of its objects, of joints or of fixed tendons, which are sums over joints;
// L = p_0 without a second. Where p is linear, or M of one joint, it is one row.
std::optional<JointEquality> JointEqualityOf(const Conversion& c, int e) {
  const mjModel& m = c.m;
  const int first = m.eq_obj1id[e], second = m.eq_obj2id[e];
  const bool is_tendon = m.eq_type[e] == mjEQ_TENDON;
  if (m.eq_type[e] != mjEQ_JOINT && !is_tendon) return std::nullopt;
  if (is_tendon && (IsSpatial(m, first) || (second >= 0 && IsSpatial(m, second)))) return std::nullopt;
  const mjtNum* p = m.eq_data + mjNEQDATA * e;
  Terms L = Sum(TermsOfEquality(c, e, first), 0, {});
  const Terms M = Sum(TermsOfEquality(c, e, second), 0, {});
  JointEquality out;
  out.polynomial[0] = p[0];
  const bool is_linear = p[2] == 0 && p[3] == 0 && p[4] == 0;
  const auto shared =
      std::find_if(L.begin(), L.end(), [&](const auto& t) { return M.size() == 1 && t.first == M[0].first; });
  if (is_linear && (M.size() != 1 || L.empty() || shared != L.end())) {
    L = Sum(L, -p[1], M);
  } else if (M.size() == 1) {
    out.b = M[0].first;
    for (int i = 1; i < 5; ++i) out.polynomial[i] = p[i] * std::pow(M[0].second, i);
    if (shared != L.end()) {
      out.polynomial[1] -= shared->second;
      L.erase(shared);
    }
  } else if (!M.empty()) {
    return std::nullopt;
  }
  if (L.empty()) return out.b >= 0 ? std::nullopt : std::optional(out);
  // Solved for the joint of the largest coefficient, the first of several.
  const auto largest = std::max_element(L.begin(), L.end(), [](const auto& x, const auto& y) {
    return std::abs(x.second) < std::abs(y.second);
  });
  const auto [a, scale] = *largest;
  L.erase(largest);
  out.a = a;
  for (double& coefficient : out.polynomial) coefficient /= scale;
  for (const auto& [dof, coefficient] : L) out.terms.emplace_back(dof, -coefficient / scale);
  return out;
}

// The bound of every simulator here: loops that stay open by more than a micrometre are no loops of rigid parts.
constexpr double kOpen = 1e-6;

std::optional<Error> CheckJointEqualities(const Conversion& c) {
  for (int e = 0; e < c.m.neq; ++e) {
    if (!c.IsActive(e)) continue;
    const auto joints = JointEqualityOf(c, e);
    if (!joints || joints->a >= 0 || std::abs(joints->polynomial[0]) <= kOpen) continue;
    return c.ModelError(
        fmt::format("equality '{}'", EqualityName(c, e)),
        fmt::format("asks for a length of {:.4g} that no joint changes: its coefficients are zero or "
                    "cancel; give a joint a coefficient, or remove the equality",
                    joints->polynomial[0]));
  }
  for (const Repeated& repeated : FindRepeated(c))
    if (std::abs(repeated.off) > kOpen)
      return c.ModelError(
          fmt::format("equality '{}'", EqualityName(c, repeated.equality)),
          fmt::format(
              "contradicts {}, which fix the same combination of joints {:.4g} away; make their constants "
              "agree, or remove one",
              NamesOf(c, repeated.of), std::abs(repeated.off)));
  return std::nullopt;
}

void ConvertEqualities(Conversion& c) {
  const mjModel& m = c.m;
  std::vector<std::string> inactive, disabled, empty, tendons, others;
  for (int e = 0; e < m.neq; ++e) {
    const std::string name = EqualityName(c, e);
    if (c.used_equality[e]) continue;
    if (c.IsSwitchable(e)) continue;  // ConvertSwitchedEqualities
    if (!m.eq_active0[e]) {
      inactive.push_back(name);
    } else if (!c.IsActive(e)) {
      disabled.push_back(name);
    } else if (const auto joints = JointEqualityOf(c, e)) {
      if (joints->a >= 0)
        ConvertCoupling(c, e, *joints);
      else
        empty.push_back(name);
    } else if (m.eq_type[e] == mjEQ_TENDON) {
      tendons.push_back(name);
    } else if (!c.EqualityWorks(e)) {
      others.push_back(name);
    } else {
      ConvertClosure(c, e);
    }
  }
  c.DroppedMany(
      "inactive equality constraint", inactive,
      "active is false, and of equalities welds and connects that have a name are switched while a simulation "
      "runs; with active true it holds from the start to the end");
  c.DroppedMany("equality constraint", disabled,
                "a flag of <option> disables it: remove equality or constraint from <flag>");
  c.DroppedMany("equality constraint", empty,
                "no joint has a part in it: its coefficients are zero or cancel, so it constrains nothing");
  for (const Repeated& repeated : FindRepeated(c))
    c.Note(ImportNote::Kind::kChanged,
           fmt::format("equality constraint '{}'", EqualityName(c, repeated.equality)),
           fmt::format("it follows from {} and adds nothing", NamesOf(c, repeated.of)));
  c.DroppedMany(
      "tendon equality constraint", tendons,
      "only those of fixed tendons are constrained, and of these by a polynomial of second or higher order "
      "only those whose second tendon is over one joint, and the first over another");
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
