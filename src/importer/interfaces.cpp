// What the file's <custom> element and the options say about base, modes and interface bodies.
#include <fmt/format.h>

#include <algorithm>

#include "conversion.hpp"
#include "mechanism/names.hpp"
#include "mechanism/rigid_groups.hpp"
#include "names.hpp"

namespace fork1s::internal {

std::optional<std::string> CustomText(const mjModel& m, const std::string& name) {
  for (int i = 0; i < m.ntext; ++i) {
    if (name == m.names + m.name_textadr[i]) return std::string(m.text_data + m.text_adr[i]);
  }
  return std::nullopt;
}

std::vector<std::string> ListedNames(const std::string& text,
                                     const std::function<bool(const std::string&)>& is_known) {
  std::vector<std::string> names;
  for (std::string word : SplitWords(text)) {
    const bool known = is_known(word);
    if (!known) std::replace(word.begin(), word.end(), ',', ' ');
    for (const std::string& name : known ? std::vector<std::string>{word} : SplitWords(word))
      names.push_back(name);
  }
  return names;
}

std::optional<Error> FindWantedBase(Conversion& c, const ImportOptions& options) {
  WantedBase& wanted = c.wanted_base;
  wanted.kind = options.base;
  if (wanted.kind) return std::nullopt;
  const std::optional<std::string> text = CustomText(c.m, "fork1s_base");
  if (!text) return std::nullopt;
  wanted.where = "text 'fork1s_base'";
  wanted.code = ErrorCode::kModel;
  const std::vector<std::string> words = SplitWords(*text);
  if (words.size() == 1) wanted.kind = Named(kBaseKindNames, words[0]);
  if (!wanted.kind)
    return c.ModelError(wanted.where, fmt::format("'{}' is no base; write fixed, floating or driven", *text));
  return std::nullopt;
}

namespace {

std::optional<double> CustomNumber(const mjModel& m, const std::string& name) {
  for (int i = 0; i < m.nnumeric; ++i) {
    if (name == m.names + m.name_numericadr[i] && m.numeric_size[i] > 0)
      return m.numeric_data[m.numeric_adr[i]];
  }
  return std::nullopt;
}

std::optional<Error> ApplyBase(Conversion& c) {
  const std::optional<BaseKind> base = c.wanted_base.kind;
  if (!base) return std::nullopt;
  std::size_t at = 0;
  for (const Component& component : c.components) {
    if (component.free_body) continue;
    MechanismDef& mechanism = c.scene.mechanisms[at++];
    if (mechanism.base == *base) continue;
    if (component.base_body == 0) {
      return Error{
          c.wanted_base.code, fmt::format("{}, {}", c.file, c.wanted_base.where),
          fmt::format("mechanism '{}' stands on the world itself, so its base cannot be {}; put a body "
                      "without joints under it, or leave the base fixed",
                      mechanism.name, Name(*base))};
    }
    mechanism.base = *base;
  }
  return std::nullopt;
}

bool IsInPair(const BodyDef& body) {
  return std::any_of(body.geometries.begin(), body.geometries.end(),
                     [](const GeometryDef& g) { return !g.pairs.empty(); });
}

bool HasAdhesion(const MechanismDef& mechanism, const BodyDef& body) {
  return std::any_of(mechanism.adhesions.begin(), mechanism.adhesions.end(),
                     [&](const AdhesionDef& a) { return a.body == body.name; });
}

enum class Touching {
  kAll,        // bodies with colliding shapes
  kOutermost,  // those with no other beyond a joint, and those of explicit contact pairs and of adhesion
  kLast,       // leaves, whatever they carry
};

// One body of each rigid group, which touches as one.
std::vector<std::string> Bodies(const MechanismDef& mechanism, Touching which) {
  const std::size_t n = mechanism.bodies.size();
  const std::vector<std::size_t> group = RigidGroups(mechanism);
  // `beyond`: a candidate lies below, past a joint; `below`: below, joint or not.
  std::vector<bool> beyond(n, false), below(n, false);
  std::vector<std::string> names;
  std::vector<std::size_t> groups_named;  // its outermost body stands for it
  for (std::size_t b = n; b-- > 1;) {
    const BodyDef& body = mechanism.bodies[b];
    const bool candidate = which == Touching::kLast || HasColliders(body);
    const bool here = candidate || below[b];
    const std::size_t p = body.parent.u();
    below[p] = below[p] || here;
    beyond[p] = beyond[p] || beyond[b] || (here && group[b] == b);
    // A leaf is enough: a welded child already stands for its parent.
    const bool last = !beyond[b] && !(which == Touching::kLast && below[b]);
    const bool wanted = which == Touching::kAll || last || IsInPair(body) || HasAdhesion(mechanism, body);
    if (!candidate || !wanted || group[b] == 0 ||
        std::find(groups_named.begin(), groups_named.end(), group[b]) != groups_named.end())
      continue;
    groups_named.push_back(group[b]);
    names.insert(names.begin(), body.name);
  }
  return names;
}

// Where that many bodies would not keep a mechanism from being reduced, all that can touch do: the coordinates are
// then few, or at most twice the six of each outermost body.
Touching ChooseTouching(const MechanismDef& mechanism, std::size_t num_outermost) {
  constexpr std::size_t kFewCoordinates = 24;  // as kMostCoordinatesByStep of the reduction
  if (num_outermost == 0) return Touching::kLast;
  std::size_t coordinates = 0;
  for (const JointDef& joint : mechanism.joints) coordinates += joint.freedoms.size();
  return coordinates <= std::max(kFewCoordinates, 2 * 6 * num_outermost) ? Touching::kAll
                                                                         : Touching::kOutermost;
}

// Shapes of a URDF often overlap those of its own robot as its joints move, which readers of the format leave out
// unless told otherwise: of the interfaces, only `outermost` touch each other and the base, and links that are said to.
bool ExcludeInnerPairs(Conversion& c, const MechanismDef& mechanism,
                       const std::vector<std::string>& outermost) {
  const std::vector<std::size_t> group = RigidGroups(mechanism);
  // Per body that stands for its rigid group.
  std::vector<bool> is_outer(group.size(), false), is_said_to(group.size(), false);
  is_outer[0] = true;
  for (const std::string& name : outermost) is_outer[group[mechanism.FindBody(name).u()]] = true;
  for (std::size_t b = 0; b < group.size(); ++b)
    if (c.self_colliding.count(mechanism.bodies[b].name) > 0) is_said_to[group[b]] = true;
  std::vector<std::string> bodies = mechanism.interfaces;
  if (mechanism.bodies[0].name != "world") bodies.push_back(mechanism.bodies[0].name);
  std::vector<std::size_t> of;
  for (const std::string& name : bodies) of.push_back(group[mechanism.FindBody(name).u()]);
  const std::size_t before = c.scene.excluded_pairs.size();
  for (std::size_t a = 0; a < bodies.size(); ++a)
    for (std::size_t b = a + 1; b < bodies.size(); ++b)
      if (!(is_outer[of[a]] && is_outer[of[b]]) && !(is_said_to[of[a]] && is_said_to[of[b]]))
        c.scene.excluded_pairs.emplace_back(bodies[a], bodies[b]);
  return c.scene.excluded_pairs.size() > before;
}

// Words of the caller are at fault where these are no names; words of the file where its own are not.
std::optional<Error> DistributeNames(Conversion& c, const std::vector<std::string>& names,
                                     const std::string& where, ErrorCode code) {
  const auto refuse = [&](std::string message) {
    return Error{code, fmt::format("{}, {}", c.file, where), std::move(message)};
  };
  std::vector<std::string> known;
  for (const MechanismDef& mechanism : c.scene.mechanisms) {
    for (const BodyDef& body : mechanism.bodies) known.push_back(body.name);
  }
  for (const std::string& name : names) {
    bool found = false;
    for (MechanismDef& mechanism : c.scene.mechanisms) {
      if (!mechanism.FindBody(name).valid()) continue;
      found = true;
      auto& list = mechanism.interfaces;
      if (std::find(list.begin(), list.end(), name) == list.end()) list.push_back(name);
      break;
    }
    if (found) continue;
    for (const FreeBodyDef& body : c.scene.free_bodies) {
      if (body.name == name) {
        return refuse(fmt::format(
            "body '{}' is a free body, which always touches; name bodies of a mechanism only", name));
      }
    }
    return refuse(fmt::format("no mechanism has a body '{}'{}", name, Suggestion(name, known)));
  }
  return std::nullopt;
}

std::optional<Error> ApplyInterfaces(Conversion& c, const ImportOptions& options) {
  std::vector<std::string> names = options.interfaces;
  std::string where = "option interfaces";
  ErrorCode code = ErrorCode::kUsage;
  if (names.empty()) {
    if (const auto text = CustomText(c.m, "fork1s_interface")) {
      where = "text 'fork1s_interface'";
      code = ErrorCode::kModel;
      names = ListedNames(*text, [&](const std::string& name) {
        return std::any_of(c.scene.mechanisms.begin(), c.scene.mechanisms.end(),
                           [&](const MechanismDef& m) { return m.FindBody(name).valid(); });
      });
      if (names.empty()) {
        return c.ModelError(where, "it names no body; list the bodies that touch, or remove the text");
      }
    }
  }
  if (auto error = DistributeNames(c, names, where, code)) return error;
  constexpr std::size_t kNotes = 6;  // a grid of small mechanisms need not say it a hundred times
  std::size_t chosen = 0;
  for (MechanismDef& mechanism : c.scene.mechanisms) {
    if (!mechanism.interfaces.empty()) continue;
    const std::vector<std::string> outermost = Bodies(mechanism, Touching::kOutermost);
    const Touching which = ChooseTouching(mechanism, outermost.size());
    mechanism.interfaces = Bodies(mechanism, which);
    mechanism.interfaces_chosen = false;
    const bool excluded = c.is_urdf && which == Touching::kAll && ExcludeInnerPairs(c, mechanism, outermost);
    if (++chosen > kNotes) continue;
    std::string text =
        fmt::format("no interface was named, so it touches by {}: {}", Quoted(mechanism.interfaces, 24),
                    which == Touching::kAll         ? "all bodies with colliding shapes"
                    : which == Touching::kOutermost ? "the outermost bodies with colliding shapes"
                                                    : "its last bodies");
    if (excluded)
      text += fmt::format("; each other and the base are touched by {} and links with <self_collide> alone",
                          Quoted(outermost, 24));
    std::vector<BodyIndex> touching;
    for (const std::string& name : mechanism.interfaces) touching.push_back(mechanism.FindBody(name));
    if (const std::size_t others = BodiesWithoutContact(mechanism, touching).size(); others > 0)
      text += fmt::format(
          "; {} more with such shapes touch{} nothing unless the option interface names {} or "
          "the run has detail all",
          others, others == 1 ? "es" : "", others == 1 ? "it" : "them");
    c.Note(ImportNote::Kind::kChosen, fmt::format("mechanism '{}'", mechanism.name), std::move(text));
  }
  if (chosen > kNotes) {
    c.Note(ImportNote::Kind::kChosen, fmt::format("{} more mechanisms", chosen - kNotes),
           "their interfaces were chosen in the same way");
  }
  return std::nullopt;
}

}  // namespace

std::optional<Error> ApplyCustom(Conversion& c, const ImportOptions& options) {
  if (auto error = ApplyBase(c)) return error;
  std::optional<int> modes = options.modes;
  if (modes && *modes < 0) {
    return Error{ErrorCode::kUsage, "option modes",
                 fmt::format("{} modes cannot be kept; give 0 or more", *modes)};
  }
  if (const auto number = CustomNumber(c.m, "fork1s_modes"); number && !modes && !options.modes_by_step) {
    if (*number < 0 || *number != static_cast<int>(*number)) {
      return c.ModelError("numeric 'fork1s_modes'",
                          fmt::format("{} is no number of modes; give 0, 1, 2, ...", *number));
    }
    modes = static_cast<int>(*number);
  }
  std::optional<ModeChoice> choice = options.mode_choice;
  if (const auto text = CustomText(c.m, "fork1s_mode_choice"); text && !choice) {
    const std::vector<std::string> words = SplitWords(*text);
    if (words.size() == 1) choice = Named(kModeChoiceNames, words[0]);
    if (!choice)
      return c.ModelError("text 'fork1s_mode_choice'",
                          fmt::format("'{}' is no choice of modes; write lowest or contribution", *text));
  }
  for (MechanismDef& mechanism : c.scene.mechanisms) {
    if (modes) mechanism.modes = *modes;
    mechanism.modes_by_step = !modes;
    if (choice) mechanism.mode_choice = *choice;
  }
  return ApplyInterfaces(c, options);
}

}  // namespace fork1s::internal
