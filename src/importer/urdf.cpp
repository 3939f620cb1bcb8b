#include "urdf.hpp"

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <map>
#include <set>

#include "names.hpp"
#include "urdf_parts.hpp"

namespace fork1s::internal {
namespace {

using tinyxml2::XMLElement;

struct Tree {
  std::vector<XMLElement*> links, joints;
  std::vector<std::string> link_names;
  XMLElement* root = nullptr;
};

std::optional<Error> CheckJointType(const UrdfWork& work, const XMLElement& joint) {
  static const std::vector<std::string> types = {"revolute", "continuous", "prismatic",
                                                 "fixed",    "floating",   "planar"};
  const char* type = joint.Attribute("type");
  if (type != nullptr && std::find(types.begin(), types.end(), type) != types.end()) return std::nullopt;
  return work.Refuse(
      ErrorCode::kFormat, joint,
      fmt::format(
          "joint '{}' has {}; URDF has revolute, continuous, prismatic, fixed, floating and planar: write "
          "a ball joint as three revolute joints with massless links between them",
          NameOf(joint), type != nullptr ? fmt::format("the unknown type '{}'", type) : "no type"));
}

const char* LinkOf(const XMLElement& joint, const char* end) {
  const XMLElement* element = joint.FirstChildElement(end);
  return element != nullptr ? element->Attribute("link") : nullptr;
}

// Drake's capsule has the attributes of the <capsule> that other writers use.
void RenameCapsules(XMLElement& parent) {
  for (XMLElement* e = parent.FirstChildElement(); e != nullptr; e = e->NextSiblingElement()) {
    if (std::string(e->Name()) == "drake:capsule") e->SetName("capsule");
    RenameCapsules(*e);
  }
}

// Words where numbers belong, with the lines of the file: the reader sees the text written again.
std::optional<Error> CheckAttributes(const UrdfWork& work, const XMLElement& parent) {
  static const std::set<std::string> numbers = {"xyz",      "rpy",    "lower",      "upper",   "effort",
                                                "velocity", "size",   "radius",     "damping", "friction",
                                                "rgba",     "length", "multiplier", "offset"};
  for (const XMLElement* e = parent.FirstChildElement(); e != nullptr; e = e->NextSiblingElement()) {
    const std::string kind = e->Name();
    const bool is_xacro = kind.rfind("xacro:", 0) == 0;
    for (const auto* a = e->FirstAttribute(); a != nullptr; a = a->Next())
      if (is_xacro || std::strstr(a->Value(), "${") != nullptr || std::strstr(a->Value(), "$(") != nullptr)
        return work.Refuse(
            ErrorCode::kModel, *e,
            fmt::format("<{} {}=\"{}\"> is unexpanded xacro; run xacro on the file first (xacro {} > "
                        "robot.urdf) and give its output",
                        kind, a->Name(), a->Value(), work.path));
    for (const auto* a = e->FirstAttribute(); a != nullptr; a = a->Next()) {
      if (numbers.count(a->Name()) == 0) continue;
      const std::vector<std::string> words = SplitWords(a->Value());
      if (!std::all_of(words.begin(), words.end(), IsNumber))
        return work.Refuse(
            ErrorCode::kModel, *e,
            fmt::format("<{} {}=\"{}\"> holds what is no number; write numbers with blanks between", kind,
                        a->Name(), a->Value()));
    }
    if (kind == "gazebo" || kind == "transmission") continue;  // their attributes are others' words
    if (auto error = CheckAttributes(work, *e)) return error;
  }
  return std::nullopt;
}

// The still world, which some writers name as the parent of a joint without a link of that name.
void AddWorld(XMLElement& robot, Tree& tree) {
  if (std::count(tree.link_names.begin(), tree.link_names.end(), "world") > 0) return;
  const auto hangs_on_world = [](const XMLElement* joint) {
    const char* parent = LinkOf(*joint, "parent");
    return parent != nullptr && std::string(parent) == "world";
  };
  if (std::none_of(tree.joints.begin(), tree.joints.end(), hangs_on_world)) return;
  XMLElement* world = robot.GetDocument()->NewElement("link");
  world->SetAttribute("name", "world");
  tree.links.push_back(robot.InsertFirstChild(world)->ToElement());
  tree.link_names.push_back("world");
}

// What stands in <mujoco> for MuJoCo's reader: its options are kept, its compiler settings are ours.
void ReadMujocoBlock(UrdfWork& work, const XMLElement& block) {
  for (const XMLElement* e = block.FirstChildElement(); e != nullptr; e = e->NextSiblingElement()) {
    if (std::string(e->Name()) == "option")
      work.mujoco_options.push_back(e);
    else
      work.out.notes.push_back(
          {ImportNote::Kind::kDropped, fmt::format("<{}> in <mujoco>", e->Name()),
           "only <option> counts here; the program has its own settings for the reader"});
  }
}

// "texture" of "<texture> in <material>".
std::string ElementOf(const std::string& kind) {
  const std::size_t begin = kind.find('<'), end = kind.find('>');
  return begin == std::string::npos ? kind : kind.substr(begin + 1, end - begin - 1);
}

std::optional<Error> ReadTree(UrdfWork& work, XMLElement& robot, Tree& tree) {
  std::set<std::string> names;
  std::map<std::string, int> dropped;
  CountUnreadAttributes(robot, {"name", "version"}, dropped);
  for (XMLElement* e = robot.FirstChildElement(); e != nullptr;) {
    XMLElement* next = e->NextSiblingElement();
    const std::string kind = e->Name();
    if (kind == "link") {
      const std::string name = NameOf(*e);
      if (name.empty() || !names.insert(name).second) {
        return work.Refuse(ErrorCode::kModel, *e,
                           name.empty() ? "a link has no name; give it one"
                                        : fmt::format("there are two links '{}'; rename one", name));
      }
      tree.links.push_back(e);
      tree.link_names.push_back(name);
      CountUnread(*e, dropped);
    } else if (kind == "joint") {
      tree.joints.push_back(e);
      CountUnread(*e, dropped);
    } else {
      CountUnread(*e, dropped);
      if (kind == "gazebo")
        CountUnreadAttributes(*e, {"reference"}, dropped);  // of its elements ReadExtensions tells
      if (kind == "material") {
        const std::vector<double> rgba = NumbersOf(e->FirstChildElement("color"), "rgba");
        if (rgba.size() == 4) work.materials[NameOf(*e)] = Vector4(rgba[0], rgba[1], rgba[2], rgba[3]);
      } else if (kind == "mujoco") {
        ReadMujocoBlock(work, *e);
        e = next;
        continue;  // its options go over in the end
      } else if (!IsExtension(kind)) {
        ++dropped[fmt::format("<{}>", kind)];
      }
      robot.DeleteChild(e);
    }
    e = next;
  }
  for (const auto& [kind, count] : dropped) {
    work.out.notes.push_back(
        {ImportNote::Kind::kDropped, fmt::format("{} {}", count, kind), WhyUnread(ElementOf(kind))});
  }
  AddWorld(robot, tree);
  if (tree.links.empty()) return Error{ErrorCode::kModel, work.path, "the robot has no link; add one"};
  return std::nullopt;
}

std::optional<Error> CheckJoints(UrdfWork& work, Tree& tree) {
  std::set<std::string> names;
  for (XMLElement* joint : tree.joints) {
    const std::string name = NameOf(*joint);
    if (auto error = CheckJointType(work, *joint)) return error;
    if (name.empty() || !names.insert(name).second) {
      return work.Refuse(ErrorCode::kModel, *joint,
                         name.empty() ? "a joint has no name; give it one"
                                      : fmt::format("there are two joints '{}'; rename one", name));
    }
    for (const char* end : {"parent", "child"}) {
      const char* link = LinkOf(*joint, end);
      const bool known =
          link != nullptr && std::count(tree.link_names.begin(), tree.link_names.end(), link) > 0;
      if (known) continue;
      return work.Refuse(
          ErrorCode::kModel, *joint,
          fmt::format("joint '{}' has {} link '{}', which is not in the file{}", name, end,
                      link != nullptr ? link : "", Suggestion(link != nullptr ? link : "", tree.link_names)));
    }
    const char* child = LinkOf(*joint, "child");
    if (!work.parent_joint.emplace(child, joint).second) {
      return work.Refuse(
          ErrorCode::kModel, *joint,
          fmt::format("link '{}' is the child of two joints, '{}' and '{}'; URDF is a tree: close "
                      "loops in MJCF by an equality",
                      child, NameOf(*work.parent_joint[child]), name));
    }
  }
  std::vector<std::string> roots;
  for (XMLElement* link : tree.links) {
    if (work.parent_joint.count(NameOf(*link)) > 0) continue;
    roots.push_back(NameOf(*link));
    tree.root = link;
  }
  if (roots.size() != 1) {
    return Error{ErrorCode::kModel, work.path,
                 roots.empty()
                     ? "every link is the child of a joint, so the joints run in a circle; remove one"
                     : fmt::format("{} links have no parent: {}; join them by fixed joints", roots.size(),
                                   Quoted(roots))};
  }
  for (const auto& [link, joint] : work.parent_joint) {  // a circle beside the tree
    std::string at = link;
    for (std::size_t steps = 0; work.parent_joint.count(at) > 0; ++steps) {
      if (steps > tree.links.size()) {
        return work.Refuse(
            ErrorCode::kModel, *joint,
            fmt::format("joint '{}' is part of a circle of joints; remove one of them", NameOf(*joint)));
      }
      at = LinkOf(*work.parent_joint[at], "parent");
    }
  }
  return std::nullopt;
}

std::optional<Error> PrepareJoint(UrdfWork& work, const Tree& tree, XMLElement& joint) {
  const std::string name = NameOf(joint), type = joint.Attribute("type");
  if (const XMLElement* element = joint.FirstChildElement("mimic")) {
    Mimic mimic;
    mimic.joint = name;
    mimic.leader = element->Attribute("joint") != nullptr ? element->Attribute("joint") : "";
    mimic.multiplier = element->DoubleAttribute("multiplier", 1);
    mimic.offset = element->DoubleAttribute("offset", 0);
    std::vector<std::string> joints;
    for (const XMLElement* other : tree.joints) joints.push_back(NameOf(*other));
    if (std::count(joints.begin(), joints.end(), mimic.leader) == 0) {
      return work.Refuse(ErrorCode::kModel, *element,
                         fmt::format("joint '{}' mimics '{}', which is not in the file{}", name, mimic.leader,
                                     Suggestion(mimic.leader, joints)));
    }
    const bool leader_is_fixed =
        std::any_of(tree.joints.begin(), tree.joints.end(), [&](const XMLElement* other) {
          return NameOf(*other) == mimic.leader && other->Attribute("type", "fixed") != nullptr;
        });
    if (type == "fixed" || leader_is_fixed)
      work.out.notes.push_back(
          {ImportNote::Kind::kDropped, fmt::format("joint '{}'", name),
           type == "fixed"
               ? fmt::format("it is fixed, so it does not mimic '{}'", mimic.leader)
               : fmt::format("joint '{}' is fixed, so nothing is mimicked and '{}' moves by itself",
                             mimic.leader, name)});
    else
      work.out.mimics.push_back(std::move(mimic));
  }
  if (type == "floating" && LinkOf(joint, "parent") != std::string("world")) {
    work.out.extensions.floating.push_back({name, LinkOf(joint, "child")});
    joint.SetAttribute("type", "fixed");  // until AddExtensions
    work.out.notes.push_back(
        {ImportNote::Kind::kChanged, fmt::format("joint '{}'", name),
         fmt::format("floats below link '{0}', which it does not touch: became three slides "
                     "'{1}.x', '{1}.y' and '{1}.z' and a ball joint '{1}.rotation'",
                     LinkOf(joint, "parent"), name)});
  }
  static const std::set<std::string> kept = {"parent", "child", "origin", "axis", "limit", "dynamics"};
  for (XMLElement* e = joint.FirstChildElement(); e != nullptr;) {
    XMLElement* next = e->NextSiblingElement();
    if (kept.count(e->Name()) == 0) joint.DeleteChild(e);
    e = next;
  }
  if (const XMLElement* limit = joint.FirstChildElement("limit");
      limit != nullptr && (type == "revolute" || type == "prismatic")) {
    const double lower = NumberOf(limit, "lower"), upper = NumberOf(limit, "upper");
    if (lower > upper)
      work.out.notes.push_back(
          {ImportNote::Kind::kDropped, fmt::format("joint '{}'", name),
           fmt::format("its lower limit {:.4g} lies above the upper, {:.4g}, so it has none; "
                       "swap them if that is meant",
                       lower, upper)});
  }
  for (const char* bound : {"effort", "velocity"})
    if (const double most = NumberOf(joint.FirstChildElement("limit"), bound); most < 0 && type != "fixed")
      work.out.notes.push_back(
          {ImportNote::Kind::kDropped, fmt::format("joint '{}'", name),
           fmt::format("its {} of {:.4g} is below 0, so it has no such limit", bound, most)});
  if (const double most = NumberOf(joint.FirstChildElement("limit"), "velocity");
      most > 0 && type != "fixed" && type != "floating")
    work.out.velocity_limits[name] = most;
  // URDF's default axis, said aloud.
  if (joint.FirstChildElement("axis") == nullptr && type != "fixed" && type != "floating") {
    joint.InsertNewChildElement("axis")->SetAttribute("xyz", "1 0 0");
  }
  return std::nullopt;
}

// The reader welds the root link to the world and forgets it, so it hangs on a link 'world' instead.
std::optional<Error> WrapRoot(UrdfWork& work, XMLElement& robot, Tree& tree, bool floating) {
  const std::string root = NameOf(*tree.root);
  if (root == "world") {
    XMLElement* only = nullptr;
    int count = 0;
    for (XMLElement* joint : tree.joints) {
      if (std::string(LinkOf(*joint, "parent")) == "world") only = joint, ++count;
    }
    if (!floating || only == nullptr || std::string(only->Attribute("type")) == "floating")
      return std::nullopt;
    if (count > 1 || std::string(only->Attribute("type")) != "fixed") {
      return Error{ErrorCode::kUsage, fmt::format("{}, option base", work.path),
                   "the link 'world' holds the robot by more than one fixed joint, so it cannot float"};
    }
    only->SetAttribute("type", "floating");
    work.out.notes.push_back({ImportNote::Kind::kChanged, fmt::format("joint '{}'", NameOf(*only)),
                              "floats instead of being fixed, as asked"});
    return std::nullopt;
  }
  if (std::count(tree.link_names.begin(), tree.link_names.end(), "world") > 0) {
    return work.Refuse(
        ErrorCode::kModel, *tree.root,
        fmt::format("a link 'world' hangs below link '{}'; rename it: that name is the still world", root));
  }
  XMLElement* world = robot.GetDocument()->NewElement("link");
  world->SetAttribute("name", "world");
  robot.InsertFirstChild(world);
  XMLElement* joint = robot.InsertNewChildElement("joint");
  joint->SetAttribute("name", "world_to_root");
  joint->SetAttribute("type", floating ? "floating" : "fixed");
  joint->InsertNewChildElement("parent")->SetAttribute("link", "world");
  joint->InsertNewChildElement("child")->SetAttribute("link", root.c_str());
  if (!floating) {
    work.out.notes.push_back({ImportNote::Kind::kChosen, fmt::format("link '{}'", root),
                              "the root is fixed to the world; base floating lets it move"});
  }
  return std::nullopt;
}

void Summarise(UrdfWork& work) {
  using Kind = ImportNote::Kind;
  const auto note = [&](Kind kind, const std::vector<std::string>& names, const char* what,
                        const char* message) {
    if (names.empty()) return;
    work.out.notes.push_back(
        {kind, names.size() == 1 ? fmt::format("link '{}'", names[0]) : fmt::format("{} links", names.size()),
         names.size() == 1 ? fmt::format("{}: {}", what, message)
                           : fmt::format("{} of {}: {}", what, Quoted(names), message)});
  };
  note(Kind::kDropped, work.massless, "inertia with zero mass", "the link weighs nothing");
  note(Kind::kChosen, work.weightless, "no <inertial>", "the link weighs nothing");
  note(Kind::kChanged, work.balanced, "rotational inertia",
       "one principal moment exceeds the sum of the others, so all three became their mean");
  note(Kind::kChanged, work.rounded, "rotational inertia",
       "one principal moment exceeds the sum of the others by rounding, so all three were raised by that");
  for (const auto& [shape, links] : work.shaped) {
    note(Kind::kChosen, links, "mass without rotational inertia",
         fmt::format("taken as that of a solid {} of the same mass", shape).c_str());
  }
  note(Kind::kChosen, work.points, "mass without rotational inertia",
       "there is no shape to take it from, so the mass is a point");
  note(Kind::kChosen, work.inferred, "no <inertial>", "taken from the collision shapes at 1000 kg/m³");
  note(Kind::kChanged, work.capsules, "capsule",
       "became a cylinder and two spheres, which is the same solid");
  note(Kind::kDropped, work.materials_dropped, "further <material> in one visual", "the first one counts");
  for (const auto& [what, links] : work.shapes_dropped) note(Kind::kDropped, links, what.c_str(), "left out");
  for (auto& [reason, files] : work.visuals_dropped) {
    const std::size_t count = files.size();
    std::sort(files.begin(), files.end());
    files.erase(std::unique(files.begin(), files.end()), files.end());
    work.out.notes.push_back({Kind::kDropped, count == 1 ? "1 visual" : fmt::format("{} visuals", count),
                              fmt::format("{} not drawn: {}", Quoted(files), reason)});
  }
}

std::optional<Error> CheckPackages(const UrdfWork& work) {
  for (const auto& [name, folder] : work.search.packages) {
    std::error_code ignored;
    if (std::filesystem::is_directory(folder, ignored)) continue;
    return Error{
        ErrorCode::kUsage, fmt::format("option package '{}'", name),
        fmt::format("there is no folder '{}'; give the folder that holds the package's meshes", folder)};
  }
  return std::nullopt;
}

void NoteUnusedPackages(UrdfWork& work) {
  const std::vector<std::string> named(work.packages.begin(), work.packages.end());
  for (const auto& [name, folder] : work.search.packages) {
    if (work.packages.count(name) > 0) continue;
    work.out.notes.push_back({ImportNote::Kind::kDropped, fmt::format("option package '{}'", name),
                              "no mesh of the file is of that package" + Suggestion(name, named)});
  }
}

}  // namespace

Expected<PreparedUrdf> PrepareUrdf(const std::string& path, const std::string& text,
                                   const ImportOptions& options) {
  const bool floating = options.base == BaseKind::kFloating;
  tinyxml2::XMLDocument document;
  if (document.Parse(text.data(), text.size()) != tinyxml2::XML_SUCCESS) {
    return Fail(ErrorCode::kFormat, fmt::format("{}, line {}", path, document.ErrorLineNum()),
                "this is not well-formed XML");
  }
  XMLElement& robot = *document.RootElement();
  RenameCapsules(robot);
  UrdfWork work;
  work.path = path;
  work.search = {path, options.packages};
  if (auto error = CheckPackages(work)) return tl::unexpected<Error>(std::move(*error));
  if (auto error = CheckAttributes(work, robot)) return tl::unexpected<Error>(std::move(*error));
  Tree tree;
  if (auto error = ReadExtensions(work, robot)) return tl::unexpected<Error>(std::move(*error));
  if (auto error = ReadTree(work, robot, tree)) return tl::unexpected<Error>(std::move(*error));
  if (auto error = CheckJoints(work, tree)) return tl::unexpected<Error>(std::move(*error));
  for (XMLElement* joint : tree.joints) {
    if (auto error = PrepareJoint(work, tree, *joint)) return tl::unexpected<Error>(std::move(*error));
  }
  for (XMLElement* link : tree.links) {
    if (auto error = PrepareLink(work, *link)) return tl::unexpected<Error>(std::move(*error));
  }
  if (auto error = WrapRoot(work, robot, tree, floating)) return tl::unexpected<Error>(std::move(*error));
  Summarise(work);
  NoteUnusedPackages(work);

  XMLElement* mujoco = document.NewElement("mujoco");
  robot.InsertFirstChild(mujoco);
  XMLElement* compiler = mujoco->InsertNewChildElement("compiler");
  compiler->SetAttribute("fusestatic", "false");
  compiler->SetAttribute("discardvisual", "false");
  compiler->SetAttribute("strippath", "false");
  compiler->SetAttribute("boundmass", kMasslessUrdf);
  compiler->SetAttribute("boundinertia", kMasslessUrdf);
  for (const XMLElement* option : work.mujoco_options) mujoco->InsertEndChild(option->DeepClone(&document));
  while (XMLElement* own = mujoco->NextSiblingElement("mujoco")) robot.DeleteChild(own);
  tinyxml2::XMLPrinter printer;
  document.Print(&printer);
  work.out.source.path = path;
  work.out.source.text = printer.CStr();
  return std::move(work.out);
}

}  // namespace fork1s::internal
