#include <fmt/format.h>

#include <algorithm>
#include <numeric>

#include "conversion.hpp"
#include "names.hpp"

namespace fork1s::internal {
namespace {

// Sets of children of the world; element 0 stands for the world and never joins.
class Sets {
 public:
  explicit Sets(int n) : parent_(static_cast<std::size_t>(n)) {
    std::iota(parent_.begin(), parent_.end(), 0);
  }
  int Find(int i) {
    while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
    return i;
  }
  void Join(int a, int b) {
    a = Find(a);
    b = Find(b);
    if (a != b) parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<int> parent_;
};

bool IsFreeTop(const mjModel& m, int body) {
  return m.body_jntnum[body] == 1 && m.jnt_type[m.body_jntadr[body]] == mjJNT_FREE;
}

bool IsMocap(const mjModel& m, int body) { return m.body_mocapid[body] >= 0; }

// Joints below each child of the world, its own included.
std::vector<int> JointsOfTrees(const mjModel& m) {
  std::vector<int> count(m.nbody, 0);
  for (int j = 0; j < m.njnt; ++j) ++count[m.body_rootid[m.jnt_bodyid[j]]];
  return count;
}

void ChooseBase(Conversion& c, Component& component, bool touches_world, const std::vector<int>& joints) {
  const mjModel& m = c.m;
  const int first = component.tops[0];
  std::vector<int> free_tops, mocaps, still;
  for (int top : component.tops) {
    (IsFreeTop(m, top) ? free_tops : IsMocap(m, top) ? mocaps : still).push_back(top);
  }
  if (component.tops.size() == 1 && free_tops.size() == 1 && joints[first] == 1 && !touches_world) {
    component.free_body = true;
    return;
  }
  if (touches_world || !still.empty()) {
    component.base = BaseKind::kFixed;
    const bool own_base = component.tops.size() == 1 && still.size() == 1 && m.body_jntnum[first] == 0;
    component.base_body = own_base ? first : 0;
    for (int mocap : mocaps) {
      c.Note(ImportNote::Kind::kChanged, fmt::format("body '{}'", c.body_names[mocap]),
             "this mocap body is tied to still parts, so it stays where it is");
    }
    return;
  }
  if (!mocaps.empty()) {
    component.base = BaseKind::kDriven;
    component.base_body = mocaps[0];
    for (std::size_t i = 1; i < mocaps.size(); ++i) {
      c.Note(ImportNote::Kind::kChanged, fmt::format("body '{}'", c.body_names[mocaps[i]]),
             fmt::format("a mechanism follows one driven base, so this mocap body moves with '{}'",
                         c.body_names[mocaps[0]]));
    }
    return;
  }
  component.base = BaseKind::kFloating;
  component.base_body = free_tops[0];
}

// Whether a weld asks for the relative pose that its bodies have at the reference.
bool HoldsReference(const Conversion& c, int e) {
  if (HoldsSites(c.m, e)) return false;
  const mjtNum* data = c.m.eq_data + mjNEQDATA * e;
  const Quaternion turn(data[6], data[7], data[8], data[9]);
  if (turn.norm() < 0.5) return true;
  const RigidTransform X_ab = c.WorldPose(c.m.eq_obj1id[e]).inverse() * c.WorldPose(c.m.eq_obj2id[e]);
  const RigidTransform X_aj(turn, Vector3(data[3], data[4], data[5]));
  const RigidTransform X_bj(Vector3(data[0], data[1], data[2]));
  return Log(X_aj.inverse() * X_ab * X_bj).norm() < 1e-6;
}

// A mocap body that drags a floating tree by a weld on its root is a driven base with a fixed first link.
void ReplaceDragWelds(Conversion& c, const Component& component) {
  const mjModel& m = c.m;
  if (component.base != BaseKind::kDriven) return;
  for (int e = 0; e < m.neq; ++e) {
    if (!c.EqualityWorks(e) || m.eq_type[e] != mjEQ_WELD) continue;
    int a = PlaceOfEquality(m, e, 0).body, b = PlaceOfEquality(m, e, 1).body;
    if (b == component.base_body) std::swap(a, b);
    if (a != component.base_body || !IsFreeTop(m, b) || c.rigid_root[b] || !HoldsReference(c, e)) continue;
    c.rigid_root[b] = true;
    c.used_equality[e] = true;
    c.Note(
        ImportNote::Kind::kChanged, fmt::format("body '{}'", c.body_names[b]),
        fmt::format("the weld to mocap body '{}' is taken as rigid: it is the driven base", c.body_names[a]));
  }
}

// Planes and height fields, which no body that moves can carry.
bool HasGround(const mjModel& m, int top) {
  for (int g = 0; g < m.ngeom; ++g)
    if (m.body_rootid[m.geom_bodyid[g]] == top &&
        (m.geom_type[g] == mjGEOM_PLANE || m.geom_type[g] == mjGEOM_HFIELD))
      return true;
  return false;
}

// Trees that the file fixes to the world side by side, such as fingers beside their palm: freed each by itself they
// would fall apart.
struct SharedBase {
  std::vector<int> trees;  // those with joints
  int body = 0;  // the one without joints that floats with them; 0: at most one tree, or no such base wanted
};

// Whether a body without joints may carry a tree: the bounding sphere of one of its shapes reaches that of a shape which
// is rigid with the tree's top, or the anchor of one of the tree's first joints, up to the radius of the smaller.
bool MayCarry(const Conversion& c, int base, int tree) {
  const mjModel& m = c.m;
  const auto reaches = [&](const Vector3& center, double radius) {
    for (int g = 0; g < m.ngeom; ++g) {
      if (m.body_rootid[m.geom_bodyid[g]] != base) continue;
      const double own = m.geom_rbound[g];
      const double distance = (Vec3(c.d.geom_xpos + 3 * g) - center).norm();
      if (distance <= own + radius + std::min(own, radius)) return true;
    }
    return false;
  };
  for (int g = 0; g < m.ngeom; ++g) {
    const int b = m.geom_bodyid[g];
    if (m.body_rootid[b] == tree && m.body_weldid[b] == m.body_weldid[tree] &&
        reaches(Vec3(c.d.geom_xpos + 3 * g), m.geom_rbound[g]))
      return true;
  }
  for (int j = 0; j < m.njnt; ++j) {
    const int b = m.jnt_bodyid[j];
    if (m.body_rootid[b] == tree && m.body_weldid[m.body_parentid[b]] == 0 &&
        reaches(Vec3(c.d.xanchor + 3 * j), 0))
      return true;
  }
  return false;
}

Expected<SharedBase> FindSharedBase(const Conversion& c, const std::vector<int>& joints) {
  const mjModel& m = c.m;
  SharedBase shared;
  if (c.wanted_base.kind != BaseKind::kFloating) return shared;
  std::vector<int> bases;
  for (int b = 1; b < m.nbody; ++b) {
    if (m.body_parentid[b] != 0 || IsFreeTop(m, b) || IsMocap(m, b)) continue;
    if (joints[static_cast<std::size_t>(b)] > 0)
      shared.trees.push_back(b);
    else if (!HasGround(m, b))
      bases.push_back(b);
  }
  if (shared.trees.size() < 2) return shared;
  const auto carries_all = [&](int base) {
    return std::all_of(shared.trees.begin(), shared.trees.end(),
                       [&](int tree) { return MayCarry(c, base, tree); });
  };
  bases.erase(std::remove_if(bases.begin(), bases.end(), [&](int base) { return !carries_all(base); }),
              bases.end());
  if (bases.size() == 1) {
    shared.body = bases[0];
    return shared;
  }
  const auto names = [&](const std::vector<int>& bodies) {
    std::vector<std::string> list;
    for (const int b : bodies) list.push_back(c.body_names[static_cast<std::size_t>(b)]);
    return Quoted(list, 8);
  };
  return tl::unexpected<Error>(c.ModelError(
      c.wanted_base.where,
      fmt::format("the bodies {} are fixed to the world side by side and carry joints, and {}, so it is not "
                  "known which body floats; put those that float together into one <body>",
                  names(shared.trees),
                  bases.empty() ? "no body without joints reaches each of them"
                                : fmt::format("any of {} may be their base", names(bases)))));
}

}  // namespace

std::optional<Error> FindComponents(Conversion& c) {
  const mjModel& m = c.m;
  const std::vector<int> joints = JointsOfTrees(m);
  const auto top_of = [&](int body) { return body == 0 ? 0 : m.body_rootid[body]; };
  const Expected<SharedBase> shared = FindSharedBase(c, joints);
  if (!shared) return shared.error();
  const auto is_still = [&](int top) {
    return top == 0 || (joints[top] == 0 && !IsMocap(m, top) && top != shared->body);
  };

  Sets sets(static_cast<int>(m.nbody));
  if (shared->body != 0) {
    std::vector<std::string> trees;
    for (const int top : shared->trees) {
      sets.Join(shared->body, top);
      trees.push_back(c.body_names[static_cast<std::size_t>(top)]);
    }
    c.Note(ImportNote::Kind::kChosen,
           fmt::format("body '{}'", c.body_names[static_cast<std::size_t>(shared->body)]),
           fmt::format("floats as the one base of {}, which the file fixes to the world beside it",
                       Quoted(trees, 8)));
  }
  std::vector<int> touching;
  const auto tie = [&](int body_a, int body_b) {
    const int a = top_of(body_a), b = top_of(body_b);
    if (is_still(a) && is_still(b)) return;
    if (is_still(a)) {
      touching.push_back(b);
    } else if (is_still(b)) {
      touching.push_back(a);
    } else {
      sets.Join(a, b);
    }
  };
  for (int e = 0; e < m.neq; ++e) {
    if (!c.EqualityWorks(e)) continue;
    if (const auto joints_of = JointEqualityOf(c, e)) {
      for (const int dof : joints_of->Dofs()) tie(m.dof_bodyid[joints_of->a], m.dof_bodyid[dof]);
    } else {
      tie(PlaceOfEquality(m, e, 0).body, PlaceOfEquality(m, e, 1).body);
    }
  }
  const auto tie_by = [&](const Length& length, const std::vector<int>& bodies) {
    // Two trees that a tendon ties together do not touch each other by way of the still world.
    const auto moving =
        std::find_if(bodies.begin(), bodies.end(), [&](int b) { return !is_still(top_of(b)); });
    if (moving == bodies.end()) return;
    for (int body : bodies) tie(*moving, body);
    // Lengths and forces on free joints are of coordinates: their trees have joints to the still world.
    for (const auto& term : length.terms)
      if (const int joint = m.dof_jntid[term.first]; m.jnt_type[joint] == mjJNT_FREE)
        touching.push_back(top_of(m.jnt_bodyid[joint]));
  };
  for (int t = 0; t < m.ntendon; ++t)
    if (TendonWorks(m, c.d, t)) tie_by(TendonLength(m, c.d, t), BodiesOfTendon(m, t));
  if (!(m.opt.disableflags & mjDSBL_ACTUATION))
    for (const LinearActuator& a : LinearActuators(m, c.d)) tie_by(a.length, BodiesOfActuator(m, a.actuator));

  // The control of an adhesion is one of a mechanism: a body that moves freely by itself becomes one.
  for (int i = 0; i < m.nactuator; ++i)
    if (ActsByAdhesion(m, i))
      if (const int top = top_of(m.actuator_trnid[2 * i]);
          top > 0 && IsFreeTop(m, top) && joints[static_cast<std::size_t>(top)] == 1)
        touching.push_back(top);

  // So is that of an equality that is switched, which needs one on one side.
  const auto is_lone = [&](int top) {
    if (!IsFreeTop(m, top) || joints[static_cast<std::size_t>(top)] != 1) return false;
    if (std::find(touching.begin(), touching.end(), top) != touching.end()) return false;
    for (int b = 1; b < m.nbody; ++b)
      if (b != top && m.body_parentid[b] == 0 && sets.Find(b) == sets.Find(top)) return false;
    return true;
  };
  for (int e = 0; e < m.neq; ++e) {
    if (!c.IsSwitchable(e)) continue;
    const int a = top_of(PlaceOfEquality(m, e, 0).body), b = top_of(PlaceOfEquality(m, e, 1).body);
    const auto has_no_control = [&](int top) { return is_still(top) || IsMocap(m, top) || is_lone(top); };
    if (!has_no_control(a) || !has_no_control(b)) continue;
    if (is_lone(a))
      touching.push_back(a);
    else if (is_lone(b))
      touching.push_back(b);
  }

  std::vector<int> component_of(m.nbody, -1);
  for (int b = 1; b < m.nbody; ++b) {
    if (m.body_parentid[b] != 0 || is_still(b)) continue;
    int& index = component_of[sets.Find(b)];
    if (index < 0) {
      index = static_cast<int>(c.components.size());
      c.components.emplace_back();
    }
    c.components[index].tops.push_back(b);
  }
  std::vector<Component> kept;
  for (Component& component : c.components) {
    bool moves = false, touches = false;
    for (int top : component.tops) moves = moves || joints[top] > 0;
    for (int top : touching) {
      touches = touches || c.components[component_of[sets.Find(top)]].tops[0] == component.tops[0];
    }
    if (!moves) {
      for (int top : component.tops) {
        c.Note(ImportNote::Kind::kChanged, fmt::format("body '{}'", c.body_names[top]),
               "a mocap body without joints below it stays where it is");
      }
      continue;
    }
    ChooseBase(c, component, touches, joints);
    if (shared->body != 0 && sets.Find(component.tops[0]) == sets.Find(shared->body))
      component.base_body = shared->body;
    ReplaceDragWelds(c, component);
    kept.push_back(component);
  }
  c.components = std::move(kept);
  return std::nullopt;
}

}  // namespace fork1s::internal
