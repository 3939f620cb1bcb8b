// Extensions of URDF that change the mechanism.
//
// <gazebo reference="JOINT">: <springStiffness>, <springReference>, <damping>, <friction>; reference to a
// link:
//   <selfCollide>, <mu1>, <mu2>, <gravity>, <turnGravityOff>; without reference: <self_collide> of all links,
//   <static>. Gazebo lets two links of a robot touch where both say so. Source: sdformat, URDF parser.
// <ros2_control>: initial_value of a joint's <state_interface name="position">. Source: ros2_control, hardware
//   components.
// <loop_joint>: frames on two links; `axis` has the same coordinates in both. Source: Drake before 2018,
//   RigidBodyTree loops.
// <drake:ball_constraint>: point P on body A stays on point Q on body B. Source: Drake, multibody parsing.
#include "urdf_extensions.hpp"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>

#include "names.hpp"
#include "urdf_parts.hpp"

namespace fork1s::internal {
namespace {

using tinyxml2::XMLElement;

std::vector<std::string> NamesOf(const XMLElement& robot, const char* kind) {
  std::vector<std::string> names;
  for (const XMLElement* e = robot.FirstChildElement(kind); e != nullptr; e = e->NextSiblingElement(kind))
    names.push_back(NameOf(*e));
  return names;
}

bool IsDrakeConstraint(const std::string& element) {
  return element.rfind("drake:", 0) == 0 &&
         (element.find("constraint") != std::string::npos || element == "drake:linear_bushing_rpy");
}

class ExtensionReader {
 public:
  ExtensionReader(UrdfWork& work, const XMLElement& robot)
      : work_(work),
        robot_(robot),
        links_(NamesOf(robot, "link")),
        joints_(NamesOf(robot, "joint")),
        out_(work.out.extensions) {
    if (std::count(links_.begin(), links_.end(), "world") == 0) links_.emplace_back("world");
  }

  std::optional<Error> Read() {
    for (const XMLElement* e = robot_.FirstChildElement(); e != nullptr; e = e->NextSiblingElement()) {
      const std::string kind = e->Name();
      std::optional<Error> error;
      if (kind == "gazebo")
        error = ReadGazebo(*e);
      else if (kind == "loop_joint")
        error = ReadLoopJoint(*e);
      else if (kind == "ros2_control")
        error = ReadRos2Control(*e);
      else if (kind == "drake:ball_constraint")
        error = ReadBallConstraint(*e);
      else if (IsDrakeConstraint(kind))
        Drop(fmt::format("<{}> '{}'", kind, NameOf(*e)),
             "its two bodies stay apart; <drake:ball_constraint> and <loop_joint> close loops here");
      if (error) return error;
    }
    ReadSelfCollision();
    for (const auto& [name, count] : unread_)
      Drop(fmt::format("{} <{}> in <gazebo>", count, name), WhyUnread(name));
    if (num_ros2_control_ > 0)
      Drop(fmt::format("{} <ros2_control>", num_ros2_control_),
           "it is not modelled; initial_value of the position of a joint is where it starts");
    return std::nullopt;
  }

 private:
  void Drop(std::string where, std::string message) {
    work_.out.notes.push_back({ImportNote::Kind::kDropped, std::move(where), std::move(message)});
  }

  std::optional<Error> ReadNumber(const XMLElement& element, double& value) const {
    const char* text = element.GetText();
    const std::vector<std::string> words = SplitWords(text != nullptr ? text : "");
    const bool is_number = words.size() == 1 && IsNumber(words[0]);
    value = is_number ? std::strtod(words[0].c_str(), nullptr) : std::numeric_limits<double>::quiet_NaN();
    if (std::isfinite(value)) return std::nullopt;
    return work_.Refuse(ErrorCode::kModel, element,
                        fmt::format("<{}> holds '{}', which is no finite number; write one", element.Name(),
                                    text != nullptr ? text : ""));
  }

  std::optional<Error> ReadFlag(const XMLElement& element, std::optional<bool>& flag) const {
    const char* text = element.GetText();
    const std::string word = text != nullptr ? text : "";
    if (word != "true" && word != "1" && word != "false" && word != "0")
      return work_.Refuse(ErrorCode::kModel, element,
                          fmt::format("<{}> holds '{}'; write true or false", element.Name(), word));
    flag = word == "true" || word == "1";
    return std::nullopt;
  }

  std::optional<Error> ReadGazebo(const XMLElement& gazebo) {
    const char* reference = gazebo.Attribute("reference");
    const std::string name = reference != nullptr ? reference : "";
    GazeboJoint joint;
    joint.joint = name;
    std::map<std::string, double> coefficients;  // mu1, mu2
    for (const XMLElement* e = gazebo.FirstChildElement(); e != nullptr; e = e->NextSiblingElement()) {
      const std::string kind = e->Name();
      const bool collides = kind == "selfCollide" || kind == "self_collide";
      const bool rubs = kind == "mu1" || kind == "mu2";
      const bool of_joint =
          kind == "springStiffness" || kind == "springReference" || kind == "damping" || kind == "friction";
      std::optional<Error> error;
      double value = 0;
      if (collides) {
        error = ReadFlag(*e, reference != nullptr ? collides_[name] : all_collide_);
      } else if ((kind == "gravity" || kind == "turnGravityOff") && reference != nullptr) {
        std::optional<bool> flag;
        error = ReadFlag(*e, flag);
        if (!error) SetGravity(name, *flag == (kind == "gravity"));
      } else if (kind == "static" && reference == nullptr) {
        std::optional<bool> flag;
        error = ReadFlag(*e, flag);
        if (!error && *flag)
          work_.out.notes.push_back({ImportNote::Kind::kChanged, "<static> in <gazebo>",
                                     "its base is fixed unless base is floating, but its joints move here"});
      } else if ((of_joint || rubs) && reference != nullptr) {
        error = ReadNumber(*e, value);
      } else if (kind != "implicitSpringDamper") {  // springs and dampers are always implicit here
        ++unread_[kind];
      }
      if (error) return error;
      if (kind != "springReference" && value < 0)
        return work_.Refuse(
            ErrorCode::kModel, *e,
            fmt::format("<{}> of '{}' is {}; write a number of 0 or more", kind, name, e->GetText()));
      if (kind == "springStiffness") joint.stiffness = value;
      if (kind == "springReference") joint.reference = value;
      if (kind == "damping") joint.damping = value;
      if (kind == "friction") joint.friction = value;
      if (rubs && reference != nullptr) coefficients[kind] = value;
    }
    if (!coefficients.empty()) AddFriction(name, coefficients);
    if (joint.stiffness || joint.damping || joint.friction) AddJoint(std::move(joint));
    return std::nullopt;
  }

  void SetGravity(const std::string& link, bool acts) {
    if (std::count(links_.begin(), links_.end(), link) == 0)
      return Drop(fmt::format("<gazebo> of link '{}'", link),
                  fmt::format("no link has that name{}", Suggestion(link, links_)));
    if (acts)
      out_.weightless.erase(link);
    else
      out_.weightless.insert(link);
  }

  // Followers start where their leaders have them.
  std::optional<Error> ReadRos2Control(const XMLElement& control) {
    ++num_ros2_control_;
    for (const XMLElement* e = control.FirstChildElement("joint"); e != nullptr;
         e = e->NextSiblingElement("joint"))
      for (const XMLElement* state = e->FirstChildElement("state_interface"); state != nullptr;
           state = state->NextSiblingElement("state_interface"))
        for (const XMLElement* p = state->FirstChildElement("param"); p != nullptr;
             p = p->NextSiblingElement("param")) {
          if (NameOf(*state) != "position" || NameOf(*p) != "initial_value") continue;
          double value = 0;
          if (auto error = ReadNumber(*p, value)) return error;
          SetStart(NameOf(*e), value);
        }
    return std::nullopt;
  }

  void SetStart(const std::string& joint, double value) {
    const std::string where = fmt::format("initial_value of joint '{}'", joint);
    for (const XMLElement* e = robot_.FirstChildElement("joint"); e != nullptr;
         e = e->NextSiblingElement("joint")) {
      if (NameOf(*e) != joint) continue;
      const std::string type = e->Attribute("type") != nullptr ? e->Attribute("type") : "";
      if (type != "revolute" && type != "continuous" && type != "prismatic")
        return Drop(where, fmt::format("a {} joint has no single coordinate", type));
      if (e->FirstChildElement("mimic") != nullptr) return Drop(where, "it follows the joint that it mimics");
      out_.start[joint] = value;
      return;
    }
    Drop(where, fmt::format("no joint has that name{}", Suggestion(joint, joints_)));
  }

  void AddFriction(const std::string& link, const std::map<std::string, double>& coefficients) {
    if (std::count(links_.begin(), links_.end(), link) == 0)
      return Drop(fmt::format("<gazebo> of link '{}'", link),
                  fmt::format("no link has that name{}", Suggestion(link, links_)));
    const double first = coefficients.begin()->second, last = coefficients.rbegin()->second;
    out_.friction[link] = std::max(first, last);
    if (first != last)
      work_.out.notes.push_back(
          {ImportNote::Kind::kChanged, fmt::format("<gazebo> of link '{}'", link),
           fmt::format("friction is the same in all directions here, so the larger of mu1 and mu2 acts, {}",
                       std::max(first, last))});
  }

  void AddJoint(GazeboJoint joint) {
    if (std::count(joints_.begin(), joints_.end(), joint.joint) == 0)
      return Drop(fmt::format("<gazebo> of joint '{}'", joint.joint),
                  fmt::format("no joint has that name{}", Suggestion(joint.joint, joints_)));
    for (const XMLElement* e = robot_.FirstChildElement("joint"); e != nullptr;
         e = e->NextSiblingElement("joint")) {
      const std::string type = e->Attribute("type") != nullptr ? e->Attribute("type") : "";
      if (NameOf(*e) != joint.joint || type == "revolute" || type == "continuous" || type == "prismatic")
        continue;
      return Drop(fmt::format("<gazebo> of joint '{}'", joint.joint),
                  fmt::format("a {} joint has no spring, damper or friction here", type));
    }
    out_.joints.push_back(std::move(joint));
  }

  // Links that are said to touch their own robot, and pairs of which one is said not to.
  void ReadSelfCollision() {
    const auto said = [&](const std::string& link) {
      const auto own = collides_.find(link);
      return own != collides_.end() ? own->second : all_collide_;
    };
    std::vector<std::string> shaped;
    for (const XMLElement* e = robot_.FirstChildElement("link"); e != nullptr;
         e = e->NextSiblingElement("link"))
      if (e->FirstChildElement("collision") != nullptr) shaped.push_back(NameOf(*e));
    for (std::size_t a = 0; a < shaped.size(); ++a) {
      if (said(shaped[a]).value_or(false)) out_.self_colliding.insert(shaped[a]);
      for (std::size_t b = a + 1; b < shaped.size(); ++b)
        if (!(said(shaped[a]).value_or(true) && said(shaped[b]).value_or(true)))
          out_.excluded.emplace_back(shaped[a], shaped[b]);
    }
  }

  std::optional<Error> CheckLink(const XMLElement& loop, const XMLElement* end, const char* attribute,
                                 std::string& link) const {
    const char* name = end != nullptr ? end->Attribute(attribute) : nullptr;
    link = name != nullptr ? name : "";
    if (std::count(links_.begin(), links_.end(), link) > 0) return std::nullopt;
    return work_.Refuse(ErrorCode::kModel, loop,
                        fmt::format("<{}> '{}' joins link '{}', which is not in the file{}", loop.Name(),
                                    NameOf(loop), link, Suggestion(link, links_)));
  }

  std::optional<Error> ReadLoopJoint(const XMLElement& element) {
    const char* type = element.Attribute("type");
    const std::string kind = type != nullptr ? type : "continuous";
    UrdfLoop loop;
    loop.name = UniqueName(NameOf(element).empty() ? "loop_joint" : NameOf(element));
    if (kind == "continuous" || kind == "revolute") {
      loop.kind = UrdfLoop::Kind::kHinge;
    } else if (kind == "fixed") {
      loop.kind = UrdfLoop::Kind::kFixed;
    } else if (kind != "ball" && kind != "spherical") {
      Drop(fmt::format("<loop_joint> '{}'", NameOf(element)),
           fmt::format("its type is '{}', so the loop stays open: continuous, revolute, fixed and ball loops "
                       "are closed",
                       kind));
      return std::nullopt;
    }
    const XMLElement *a = element.FirstChildElement("link1"), *b = element.FirstChildElement("link2");
    if (auto error = CheckLink(element, a, "link", loop.link_a)) return error;
    if (auto error = CheckLink(element, b, "link", loop.link_b)) return error;
    const std::vector<double> axis = NumbersOf(element.FirstChildElement("axis"), "xyz");
    const Vector3 direction = axis.size() == 3 ? Vector3(axis[0], axis[1], axis[2]) : Vector3::UnitX();
    if (direction.norm() == 0)
      return work_.Refuse(
          ErrorCode::kModel, element,
          fmt::format("<loop_joint> '{}' has an <axis> of length 0; write a direction", NameOf(element)));
    const RigidTransform to_axis(Quaternion::FromTwoVectors(Vector3::UnitZ(), direction).toRotationMatrix(),
                                 Vector3::Zero());
    loop.X_AJ = PoseOf(a) * to_axis;
    loop.X_BJ = PoseOf(b) * to_axis;
    out_.loops.push_back(std::move(loop));
    return std::nullopt;
  }

  std::optional<Error> ReadBallConstraint(const XMLElement& element) {
    UrdfLoop loop;
    const auto child = [&](const char* end) {
      return element.FirstChildElement(fmt::format("drake:ball_constraint_{}", end).c_str());
    };
    if (auto error = CheckLink(element, child("body_A"), "name", loop.link_a)) return error;
    if (auto error = CheckLink(element, child("body_B"), "name", loop.link_b)) return error;
    for (const char* end : {"p_AP", "p_BQ"}) {
      const std::vector<double> p = NumbersOf(child(end), "value");
      if (p.size() != 3) {
        if (std::string(end) == "p_BQ" && child(end) == nullptr) continue;
        return work_.Refuse(ErrorCode::kModel, element,
                            fmt::format("<drake:ball_constraint> of '{}' and '{}' needs three numbers in "
                                        "<drake:ball_constraint_{} value=>",
                                        loop.link_a, loop.link_b, end));
      }
      const RigidTransform X(Vector3(p[0], p[1], p[2]));
      if (std::string(end) == "p_AP")
        loop.X_AJ = X;
      else
        loop.X_BJ = X;
    }
    loop.name = UniqueName(fmt::format("{}_{}", loop.link_a, loop.link_b));
    out_.loops.push_back(std::move(loop));
    return std::nullopt;
  }

  std::string UniqueName(std::string name) const {
    while (std::any_of(out_.loops.begin(), out_.loops.end(),
                       [&](const UrdfLoop& other) { return other.name == name; }))
      name += '_';
    return name;
  }

  UrdfWork& work_;
  const XMLElement& robot_;
  std::vector<std::string> links_, joints_;
  UrdfExtensions& out_;
  std::map<std::string, std::optional<bool>> collides_;  // by link
  std::optional<bool> all_collide_;
  std::map<std::string, int> unread_;  // elements in <gazebo>
  int num_ros2_control_ = 0;
};

std::string AddSite(mjSpec* spec, const std::string& link, const std::string& name, const RigidTransform& X) {
  mjsSite* site = mjs_addSite(mjs_findBody(spec, link.c_str()), nullptr);
  mjs_setName(site->element, name.c_str());
  const Quaternion turn = X.quaternion();
  const double quat[] = {turn.w(), turn.x(), turn.y(), turn.z()};
  std::copy_n(X.translation().data(), 3, site->pos);
  std::copy_n(quat, 4, site->quat);
  return name;
}

void AddEquality(mjSpec* spec, const std::string& name, mjtEq type, const UrdfLoop& loop,
                 const RigidTransform& X_AJ, const std::optional<RigidTransform>& X_BJ) {
  mjsEquality* equality = mjs_addEquality(spec, nullptr);
  mjs_setName(equality->element, name.c_str());
  equality->type = type;
  std::fill_n(equality->data, mjNEQDATA, 0.0);
  if (X_BJ) {
    equality->objtype = mjOBJ_SITE;
    mjs_setString(equality->name1, AddSite(spec, loop.link_a, name + "_a", X_AJ).c_str());
    mjs_setString(equality->name2, AddSite(spec, loop.link_b, name + "_b", *X_BJ).c_str());
  } else {
    equality->objtype = mjOBJ_BODY;
    mjs_setString(equality->name1, loop.link_a.c_str());
    mjs_setString(equality->name2, loop.link_b.c_str());
    std::copy_n(X_AJ.translation().data(), 3, equality->data);
  }
}

}  // namespace

const char* WhyUnread(const std::string& name) {
  static const std::set<std::string> shown = {
      "material", "texture", "visual", "provideFeedback", "preserveFixedJoint", "disableFixedJointLumping"};
  return shown.contains(name) ? "it has no meaning here" : "it is not modelled";
}

bool IsExtension(const std::string& element) {
  return element == "gazebo" || element == "loop_joint" || element == "ros2_control" ||
         IsDrakeConstraint(element);
}

std::optional<Error> ReadExtensions(UrdfWork& work, const XMLElement& robot) {
  return ExtensionReader(work, robot).Read();
}

void AddExtensions(mjSpec* spec, const UrdfExtensions& extensions) {
  for (const FloatingJoint& from : extensions.floating) {
    mjsBody* body = mjs_findBody(spec, from.link.c_str());
    for (int i = 0; i < 3; ++i) {
      mjsJoint* slide = mjs_addJoint(body, nullptr);
      slide->type = mjJNT_SLIDE;
      std::copy_n(Vector3::Unit(i).eval().data(), 3, slide->axis);
      mjs_setName(slide->element, fmt::format("{}.{}", from.joint, "xyz"[i]).c_str());
    }
    mjsJoint* ball = mjs_addJoint(body, nullptr);
    ball->type = mjJNT_BALL;
    mjs_setName(ball->element, (from.joint + ".rotation").c_str());
  }
  for (const GazeboJoint& from : extensions.joints) {
    mjsJoint* joint = mjs_asJoint(mjs_findElement(spec, mjOBJ_JOINT, from.joint.c_str()));
    if (from.stiffness) {
      joint->stiffness[0] = *from.stiffness;
      joint->springref = from.reference;
    }
    if (from.damping) joint->damping[0] = *from.damping;
    if (from.friction) joint->frictionloss = *from.friction;
  }
  for (const auto& [link, coefficient] : extensions.friction) {
    mjsBody* body = mjs_findBody(spec, link.c_str());
    for (mjsElement* e = mjs_firstChild(body, mjOBJ_GEOM, 0); e != nullptr; e = mjs_nextChild(body, e, 0)) {
      mjs_asGeom(e)->friction[0] = coefficient;
      mjs_asGeom(e)->priority = 1;  // over shapes of which the file says nothing
    }
  }
  for (const std::string& link : extensions.weightless) mjs_findBody(spec, link.c_str())->gravcomp = 1;
  for (const UrdfLoop& loop : extensions.loops)
    AddEquality(spec, loop.name, loop.kind == UrdfLoop::Kind::kBall ? mjEQ_CONNECT : mjEQ_WELD, loop,
                loop.X_AJ, loop.X_BJ);
  for (const auto& [a, b] : extensions.excluded) {
    mjsExclude* exclude = mjs_addExclude(spec);
    mjs_setString(exclude->bodyname1, a.c_str());
    mjs_setString(exclude->bodyname2, b.c_str());
  }
}

void SplitHinges(mjSpec* spec, const UrdfExtensions& extensions, double length) {
  for (const UrdfLoop& loop : extensions.loops) {
    if (loop.kind != UrdfLoop::Kind::kHinge) continue;
    for (mjtObj kind : {mjOBJ_EQUALITY, mjOBJ_SITE})
      for (const char* end : {"", "_a", "_b"})
        if (mjsElement* weld = mjs_findElement(spec, kind, (loop.name + end).c_str())) mjs_delete(spec, weld);
    const RigidTransform along(Vector3(0, 0, length));
    AddEquality(spec, loop.name, mjEQ_CONNECT, loop, loop.X_AJ, loop.X_BJ);
    AddEquality(spec, loop.name + "_axis", mjEQ_CONNECT, loop, loop.X_AJ * along, *loop.X_BJ * along);
  }
}

}  // namespace fork1s::internal
