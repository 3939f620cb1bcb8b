#include "join.hpp"

#include <algorithm>
#include <numeric>
#include <set>

namespace fork1s::internal {
namespace {

using Given = std::vector<std::shared_ptr<const Mechanism>>;

std::string Quoted(const Given& given, const std::vector<int>& members) {
  std::string names;
  for (const int m : members) {
    if (!names.empty()) names += m == members.back() ? " and " : ", ";
    names.append("'").append(given[static_cast<std::size_t>(m)]->name()).append("'");
  }
  return names;
}

tl::unexpected<Error> Refuse(const Given& given, const std::vector<int>& members, const std::string& why) {
  return Fail(
      ErrorCode::kModel, "mechanisms " + Quoted(given, members),
      "hold a body together and cannot become one mechanism: " + why + ", or keep detail 'interface'");
}

// Mechanisms that hold a body together, directly or through others; each list ascending.
std::vector<std::vector<int>> Groups(std::size_t count, const std::vector<FrozenGrasp>& holds) {
  std::vector<int> group(count);
  std::iota(group.begin(), group.end(), 0);
  for (const FrozenGrasp& hold : holds)
    for (const FrozenGrasp::Contact& contact : hold.contacts) {
      const int from = group[static_cast<std::size_t>(contact.mechanism)],
                to = group[static_cast<std::size_t>(hold.contacts.front().mechanism)];
      std::replace(group.begin(), group.end(), from, to);
    }
  std::vector<std::vector<int>> groups(count);
  for (std::size_t i = 0; i < count; ++i)
    groups[static_cast<std::size_t>(group[i])].push_back(static_cast<int>(i));
  std::erase_if(groups, [](const std::vector<int>& members) { return members.size() < 2; });
  return groups;
}

// Moves the mechanism that takes the others in to the front.
Expected<void> ChooseHost(const Given& given, std::vector<int>& members) {
  const auto base = [&](int m) { return given[static_cast<std::size_t>(m)]->base(); };
  for (const BaseKind kind : {BaseKind::kDriven, BaseKind::kFixed}) {
    const auto is_it = [&](int m) { return base(m) == kind; };
    const auto first = std::find_if(members.begin(), members.end(), is_it);
    if (first == members.end()) continue;
    if (kind == BaseKind::kDriven && std::any_of(members.begin(), members.end(), [&](int m) {
          return m != *first && base(m) != BaseKind::kFloating;
        }))
      return Refuse(
          given, members,
          "the base of '" + given[static_cast<std::size_t>(*first)]->name() +
              "' is driven, and another is driven or fixed, so neither can carry the other; put both "
              "on one base in the file");
    std::rotate(members.begin(), first, first + 1);
    return {};
  }
  return {};
}

Expected<void> CheckNames(const Given& given, const std::vector<int>& members) {
  std::set<std::string> bodies, joints, controls;
  const auto shared = [&](const char* kind, const std::string& name) {
    return Refuse(given, members,
                  std::string("two of them have a ") + kind + " '" + name + "'; give each a name of its own");
  };
  for (const int m : members) {
    const MechanismDef& def = given[static_cast<std::size_t>(m)]->definition();
    for (const BodyDef& b : def.bodies)
      if (!bodies.insert(b.name).second) return shared("body", b.name);
    for (const JointDef& j : def.joints)
      if (!joints.insert(j.name).second) return shared("joint", j.name);
    for (const ControlDef& c : def.controls)
      if (!controls.insert(c.name).second) return shared("control", c.name);
  }
  return {};
}

// What a definition counts from when it comes after others.
struct Shift {
  int bodies = 0, joints = 0, paths = 0;

  BodyIndex operator()(BodyIndex b) const { return b.valid() ? BodyIndex(b.value() + bodies) : b; }
  FreedomRef operator()(FreedomRef ref) const {
    if (ref.joint.valid()) ref.joint = JointIndex(ref.joint.value() + joints);
    return ref;
  }
  template <class Def>
  Def OnLength(Def def) const {
    for (auto& term : def.terms) term.first = (*this)(term.first);
    if (def.along.path >= 0) def.along.path += paths;
    return def;
  }
};

// Twist of `carrier`, seen from a frame that is at X_WB and moves with it, in that frame.
Vector6 TwistAt(const KeyframeDef::MechanismState& carrier, const RigidTransform& X_WB) {
  return AdjointApply(X_WB.inverse() * carrier.X_WR, carrier.V_R);
}

// The base: a body of the host without a joint where it is fixed, with a free one where it floats. Returns
// the rates of that joint.
VectorX AddBase(const MechanismDef& from, const KeyframeDef::MechanismState& from_state,
                const KeyframeDef::MechanismState& to_state, MechanismDef& to) {
  BodyDef base = from.bodies[0];
  base.parent = BodyIndex(0);
  base.X_PB = to_state.X_WR.inverse() * from_state.X_WR;
  const BodyIndex index(static_cast<int>(to.bodies.size()));
  const std::string name = base.name;
  to.bodies.push_back(std::move(base));
  if (from.base == BaseKind::kFixed) return {};
  to.joints.push_back(JointDef::Free("free:" + name, index));
  to.interfaces.push_back(name);  // as it was: it may turn about points that its hands hold on to
  return from_state.V_R - TwistAt(to_state, from_state.X_WR);
}

// What name, base, pose, parent filter and choices of interfaces and modes are is the host's affair.
void AppendDefinition(const MechanismDef& from, const Shift& shift, MechanismDef& to) {
  // A field more does not compile here: then append it, or leave it to the host.
  [[maybe_unused]] const auto& [name, base, X_WR, bodies, joints, closures, couplings, paths, springs,
                                controls, frictions, length_limits, force_limits, muscles, adhesions,
                                switched_closures, interfaces, chosen, modes, by_step, choice, filter] = from;
  for (std::size_t b = 1; b < from.bodies.size(); ++b) {
    to.bodies.push_back(from.bodies[b]);
    to.bodies.back().parent = shift(from.bodies[b].parent);
  }
  for (JointDef joint : from.joints) {
    joint.body = shift(joint.body);
    to.joints.push_back(std::move(joint));
  }
  for (ClosureDef closure : from.closures) {
    closure.body_a = shift(closure.body_a);
    closure.body_b = shift(closure.body_b);
    to.closures.push_back(std::move(closure));
  }
  for (CouplingDef coupling : from.couplings) {
    coupling.a = shift(coupling.a);
    coupling.b = shift(coupling.b);
    for (auto& term : coupling.terms) term.first = shift(term.first);
    to.couplings.push_back(std::move(coupling));
  }
  for (PathDef path : from.paths) {
    for (PathElementDef& element : path.elements) {
      element.body = shift(element.body);
      element.side_body = shift(element.side_body);
    }
    to.paths.push_back(std::move(path));
  }
  for (const SpringDef& s : from.springs) to.springs.push_back(shift.OnLength(s));
  for (const ControlDef& c : from.controls) to.controls.push_back(shift.OnLength(c));
  for (const DryFrictionDef& f : from.frictions) to.frictions.push_back(shift.OnLength(f));
  for (const LengthLimitDef& l : from.length_limits) to.length_limits.push_back(shift.OnLength(l));
  for (const ForceLimitDef& f : from.force_limits) to.force_limits.push_back(shift.OnLength(f));
  for (const MuscleDef& m : from.muscles) to.muscles.push_back(shift.OnLength(m));
  to.adhesions.insert(to.adhesions.end(), from.adhesions.begin(), from.adhesions.end());
  to.switched_closures.insert(to.switched_closures.end(), from.switched_closures.begin(),
                              from.switched_closures.end());
  to.interfaces.insert(to.interfaces.end(), from.interfaces.begin(), from.interfaces.end());
  to.modes += from.modes;
  to.modes_by_step |= from.modes_by_step;
}

void Append(const VectorX& more, VectorX& to) {
  VectorX all(to.size() + more.size());
  all << to, more;
  to = std::move(all);
}

// Rates may be left out of a state, and then are zeros.
VectorX RatesOf(const KeyframeDef::MechanismState& s) {
  return s.q_dot.size() > 0 ? s.q_dot : VectorX(VectorX::Zero(s.q.size()));
}

MechanismDef Empty(const MechanismDef& was) {
  MechanismDef def;
  def.name = was.name;
  def.X_WR = was.X_WR;
  def.modes = 0;
  def.interfaces_chosen = was.interfaces_chosen;
  def.parent_filter = was.parent_filter;
  BodyDef base;
  base.name = "place of " + was.bodies[0].name;
  def.interfaces.push_back(base.name);
  def.bodies.push_back(std::move(base));
  return def;
}

}  // namespace

Expected<std::vector<MechanismPlace>> PlacesOf(const Given& given, const std::vector<FrozenGrasp>& holds) {
  std::vector<MechanismPlace> places(given.size());
  for (std::size_t i = 0; i < given.size(); ++i) places[i].mechanism = static_cast<int>(i);
  for (std::vector<int>& members : Groups(given.size(), holds)) {
    if (auto chosen = ChooseHost(given, members); !chosen) return tl::unexpected(chosen.error());
    if (auto fit = CheckNames(given, members); !fit) return tl::unexpected(fit.error());
    MechanismPlace next{members.front(), 0, 0, 0};
    for (const int member : members) {
      const Mechanism& m = *given[static_cast<std::size_t>(member)];
      const bool on_free_joint = member != members.front() && m.base() == BaseKind::kFloating;
      if (on_free_joint) next.first_coordinate += 6;
      places[static_cast<std::size_t>(member)] = next;
      next.first_body += m.num_bodies();
      next.first_coordinate += m.num_coordinates();
      next.first_control += static_cast<int>(m.controls().size());
    }
  }
  return places;
}

int MechanismThatHolds(const FrozenGrasp& hold, const std::vector<MechanismPlace>& places) {
  return places[static_cast<std::size_t>(hold.contacts.front().mechanism)].mechanism;
}

void JoinInScene(const std::vector<MechanismPlace>& places, const Given& given, Scene& scene,
                 KeyframeDef& state) {
  // Those of one host in the order of their places.
  std::vector<std::size_t> order(places.size());
  std::iota(order.begin(), order.end(), 0u);
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    return std::pair(places[a].mechanism, places[a].first_body) <
           std::pair(places[b].mechanism, places[b].first_body);
  });
  for (const std::size_t i : order) {
    const auto h = static_cast<std::size_t>(places[i].mechanism);
    if (h == i) continue;
    MechanismDef &host = scene.mechanisms[h], &member = scene.mechanisms[i];
    KeyframeDef::MechanismState &into = state.mechanisms[h], &from = state.mechanisms[i];
    FORK1S_REQUIRE(static_cast<int>(host.bodies.size()) == places[i].first_body);
    FORK1S_REQUIRE(from.q.size() == given[i]->num_coordinates());
    into.q_dot = RatesOf(into);
    const VectorX base_rates = AddBase(member, from, into, host);
    const Shift shift{places[i].first_body, static_cast<int>(host.joints.size()),
                      static_cast<int>(host.paths.size())};
    AppendDefinition(member, shift, host);
    Append(VectorX::Zero(base_rates.size()), into.q);
    Append(base_rates, into.q_dot);
    Append(from.q, into.q);
    Append(RatesOf(from), into.q_dot);
    // Without dynamics there are none.
    if (from.activation.size() > 0 || into.activation.size() > 0) {
      into.activation.conservativeResizeLike(VectorX::Zero(into.controls.size()));
      from.activation.conservativeResizeLike(VectorX::Zero(from.controls.size()));
      Append(from.activation, into.activation);
    }
    Append(from.controls, into.controls);
    member = Empty(member);
    from.q = from.q_dot = from.controls = from.activation = VectorX(0);
    from.V_R.setZero();
    member.X_WR = from.X_WR;
  }
}

}  // namespace fork1s::internal
