// Every attribute that MuJoCo's reader knows of what moves, touches or drives changes the scene, or has a note,
// or is listed here as meaningless: it chooses how MuJoCo computes, names what is never looked up, is drawn, or
// only goes with another one.
#include <gtest/gtest.h>
#include <fork1s/importer/importer.hpp>

#include <algorithm>
#include <map>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "helpers.hpp"
#include "record/scene_json.hpp"

namespace fork1s::testing_importer {
namespace {

using Attributes = std::map<std::string, std::string>;

// "a=1 2;b=3"; a value of "-" removes an attribute that was there.
Attributes AttributesOf(const std::string& text, Attributes base = {}) {
  std::stringstream stream(text);
  for (std::string cell; std::getline(stream, cell, ';');) {
    const auto equals = cell.find('=');
    const std::string name = cell.substr(0, equals), value = cell.substr(equals + 1);
    if (value == "-")
      base.erase(name);
    else
      base[name] = value;
  }
  return base;
}

std::string TextOf(const Attributes& attributes) {
  std::string text;
  for (const auto& [name, value] : attributes)
    text.append(" ").append(name).append("='").append(value) += "'";
  return text;
}

// What is understood of a model: the scene to the last bit, and the notes.
std::string Understood(const std::string& mjcf) {
  auto loaded = LoadMechanismFromString(mjcf, "test.xml");
  if (!loaded) return "refused: " + loaded.error().Text();
  std::string text = WriteScene(loaded->scene).json;
  for (const ImportNote& note : loaded->report.notes) text += "\n" + note.Text();
  return text;
}

// An element of the schema in a model that has it, with values that differ from those that stand there.
struct SchemaElement {
  std::string path;                  // "body/joint"
  std::string model;                 // $ stands for its attributes
  std::string base;                  // attributes that it has
  std::vector<std::string> changes;  // the first attribute is the one that is tried, the others go with it
  std::string meaningless;           // names, between spaces
};

void PrintTo(const SchemaElement& element, std::ostream* out) { *out << element.path; }

std::string ArmModel(const std::string& part, const std::string& arm_joint = "",
                     const std::string& rest = "") {
  return "<mujoco>" + part + R"(<worldbody><geom name="floor" type="plane" size="2 2 .1"/>
    <body name="arm" pos="0 0 1"><joint name="shoulder" axis="0 1 0" stiffness="2" damping=".1"/>
      <geom name="upper" type="capsule" size=".05" fromto="0 0 0 .3 0 0"/><site name="mid" pos=".1 0 .06"/><site name="low" pos=".1 0 -.06"/>
      <body name="hand" pos=".3 0 0"><joint name="wrist" )" +
         (arm_joint.empty() ? std::string(R"(axis="0 1 0" stiffness="1")") : arm_joint) +
         R"(/><geom name="palm" size=".05"/><geom name="bead" size=".04"/><site name="tip" pos=".1 0 .1"/></body></body>
    <body name="ball" pos="1 0 1"><freejoint/><geom name="ball" size=".1"/></body>
    </worldbody>)" +
         rest + "</mujoco>";
}

const std::string kActuators =
    "<actuator><motor name='m' joint='shoulder' ctrlrange='-1 1'/><general name='g' group='3' "
    "joint='wrist'/></actuator>";
const std::string kLimited = R"(axis="0 1 0" stiffness="1" range="-60 60" frictionloss=".1" margin=".01")";

std::vector<SchemaElement> SchemaElements() {
  std::vector<SchemaElement> all;
  all.push_back({"option",
                 ArmModel("<option $><flag override='enable'/></option>", "", kActuators),
                 "",
                 {"actuatorgroupdisable=3", "density=1", "gravity=0 1 -9",
                  "o_friction=.3 .3 .005 .0001 .0001", "o_margin=.1", "o_solimp=.5 .5 .01 .5 2",
                  "o_solref=.1 .3", "timestep=.02", "viscosity=.1", "wind=1 0 0"},
                 " ccd_iterations ccd_tolerance cone impratio integrator iterations jacobian ls_iterations "
                 "ls_tolerance magnetic noslip_iterations noslip_tolerance sdf_initpoints sdf_iterations "
                 "sleep_tolerance solver tolerance "});
  all.push_back({"option/flag",
                 ArmModel("<option o_friction='.3 .3 .005 .0001 .0001'><flag $/></option>", kLimited,
                          kActuators + "<equality><joint joint1='wrist' joint2='shoulder'/></equality>"),
                 "",
                 {"actuation=disable", "clampctrl=disable", "constraint=disable", "contact=disable",
                  "damper=disable", "equality=disable", "filterparent=disable", "frictionloss=disable",
                  "gravity=disable", "limit=disable", "override=enable", "spring=disable"},
                 " autoreset diagexact energy eulerdamp fwdinv invdiscrete ipc island midphase multiccd "
                 "nativeccd refsafe sensor sleep speculative warmstart "});
  const auto in_world = [](const std::string& part) {
    return "<mujoco><worldbody><geom name='floor' type='plane' size='2 2 .1'/>" + part +
           "</worldbody></mujoco>";
  };
  const std::string geom = "<geom size='.1 .2 .3' type='box' pos='.1 .2 0'/>";
  all.push_back(
      {"body",
       in_world("<body $>" + geom + "<body pos='0 0 1'>" + geom + "<joint name='j'/></body></body>"),
       "name=b",
       {"axisangle=1 0 0 20", "euler=10 0 0", "gravcomp=1", "mocap=true", "name=c", "pos=0 0 1",
        "quat=1 0 0 1", "xyaxes=0 1 0 -1 0 0", "zaxis=1 0 0"},
       " childclass fuse simple sleep user "});
  all.push_back({"body/inertial",
                 in_world("<body name='b'><inertial $/><joint name='j'/></body>"),
                 "mass=1;diaginertia=1 2 3;pos=0 0 0",
                 {"mass=2", "diaginertia=1 2 2.5", "fullinertia=1 1 1 .1 0 0;diaginertia=-", "pos=1 0 0",
                  "quat=1 1 0 0", "euler=10 0 0", "axisangle=1 0 0 20", "xyaxes=0 1 0 -1 0 0", "zaxis=0 1 1"},
                 ""});
  all.push_back({"body/joint",
                 in_world("<body name='b' gravcomp='.5'>" + geom + "<joint $/></body>")
                     .replace(0, 8, "<mujoco><actuator><motor name='m' joint='j'/></actuator>"),
                 "name=j;range=-60 60;frictionloss=.1;stiffness=2",
                 {"actuatorfrcrange=-1 1",
                  "actuatorfrclimited=true;actuatorfrcrange=-1 1",
                  "actuatorgravcomp=true;actuatorfrcrange=-1 1",
                  "armature=.1",
                  "axis=1 0 0",
                  "damping=.2",
                  "damping=.2 .1",
                  "frictionloss=.2",
                  "limited=false",
                  "margin=.1",
                  "pos=.1 0 0",
                  "range=-50 50",
                  "ref=10",
                  "solimplimit=.1 .2 .5 .5 2",
                  "solreflimit=.5 1",
                  "springdamper=1 1",
                  "springref=10",
                  "springyield=1",
                  "stiffness=3",
                  "stiffness=2 1",
                  "type=slide"},
                 " class group name solimpfriction solreffriction user "});
  all.push_back({"body/freejoint",
                 in_world("<body name='b'>" + geom + "<freejoint $/></body>"),
                 "name=j",
                 {"align=true"},
                 " group name "});
  all.push_back({"body/geom",
                 in_world("<body name='b'><freejoint/><geom $/></body>"),
                 "name=g;size=.1 .2 .3;type=box",
                 {"adhesion=1",
                  "axisangle=1 0 0 20",
                  "conaffinity=0",
                  "condim=4",
                  "contype=0",
                  "density=10",
                  "euler=10 0 0",
                  "friction=.2",
                  "fromto=0 0 0 1 0 0;type=capsule;size=.1",
                  "gap=.01;margin=.02",
                  "margin=.01",
                  "mass=3",
                  "pos=1 0 0",
                  "priority=1",
                  "quat=1 1 0 0",
                  "shellinertia=true",
                  "size=.2 .2 .2",
                  "solimp=.1 .2 .1 .5 2",
                  "solref=.1 1",
                  "surfacevel=1 0 0 0 0 0",
                  "type=ellipsoid",
                  "xyaxes=0 1 0 -1 0 0",
                  "zaxis=0 1 0",
                  "name=h",
                  "rgba=1 0 0 1"},
                 " castshadow class fitscale fluidcoef fluidshape group hfield material mesh solmix user "});
  all.push_back(
      {"contact/pair",
       ArmModel("", "", "<contact><pair $/></contact>"),
       "name=p;geom1=palm;geom2=ball",
       {"adhesion=1", "condim=1", "friction=.1 .1 .005 .0001 .0001", "gap=.01;margin=.02", "geom1=upper",
        "geom2=floor", "margin=.01", "solimp=.1 .2 .1 .5 2", "solref=.1 1", "solreffriction=.5 1"},
       " class name "});
  all.push_back({"contact/exclude",
                 ArmModel("", "", "<contact><exclude $/></contact>"),
                 "body1=hand;body2=ball",
                 {"body1=arm", "body2=world"},
                 " name "});
  const std::string tendon_base = "name=t;range=.1 .5;frictionloss=.1;stiffness=3;limited=true";
  const std::vector<std::string> tendon = {"actuatorfrcrange=-1 1",
                                           "actuatorfrclimited=true;actuatorfrcrange=-1 1",
                                           "armature=.1",
                                           "damping=.2",
                                           "damping=.2 .1",
                                           "frictionloss=.2",
                                           "limited=false",
                                           "margin=.1",
                                           "name=u",
                                           "range=.1 .6",
                                           "solimplimit=.1 .2 .5 .5 2",
                                           "solreflimit=.5 1",
                                           "springlength=.1 .2",
                                           "springyield=1",
                                           "stiffness=4",
                                           "stiffness=3 1"};
  const std::string tendon_none = " class group solimpfriction solreffriction user ";
  all.push_back(
      {"tendon/spatial",
       ArmModel("", "", "<tendon><spatial $><site site='mid'/><site site='tip'/></spatial></tendon>"),
       tendon_base, tendon, tendon_none + "material rgba width "});
  all.push_back(
      {"tendon/spatial/site",
       ArmModel("", "", "<tendon><spatial stiffness='1'><site $/><site site='tip'/></spatial></tendon>"),
       "site=mid",
       {"site=low"},
       ""});
  all.push_back({"tendon/fixed",
                 ArmModel("", "",
                          "<tendon><fixed $><joint joint='shoulder' coef='1'/><joint joint='wrist' "
                          "coef='2'/></fixed></tendon>"),
                 tendon_base, tendon, tendon_none});
  all.push_back({"tendon/spatial/geom",
                 ArmModel("", "",
                          "<tendon><spatial stiffness='1'><site site='mid'/><geom $/><site "
                          "site='tip'/></spatial></tendon>"),
                 "geom=palm",
                 {"geom=bead", "sidesite=tip"},
                 ""});
  all.push_back({"tendon/spatial/pulley",
                 ArmModel("", "",
                          "<tendon><spatial stiffness='1'><pulley $/><site site='mid'/><site "
                          "site='tip'/></spatial></tendon>"),
                 "divisor=1",
                 {"divisor=2"},
                 ""});
  all.push_back({"tendon/fixed/joint",
                 ArmModel("", "",
                          "<tendon><fixed stiffness='1'><joint joint='shoulder' coef='1'/><joint "
                          "$/></fixed></tendon>"),
                 "joint=wrist;coef=1",
                 {"coef=2"},
                 " joint "});
  const std::vector<std::string> constraint = {"active=false", "solref=.5 1", "solimp=.1 .2 .1 .5 2",
                                               "name=f"};
  const auto equality = [&](const char* kind, const std::string& base, std::vector<std::string> changes,
                            const std::string& none) {
    changes.insert(changes.end(), constraint.begin(), constraint.end());
    all.push_back({std::string("equality/") + kind,
                   ArmModel("", "",
                            "<tendon><fixed name='t'><joint joint='shoulder' coef='1'/></fixed><fixed "
                            "name='u'><joint joint='wrist' coef='1'/></fixed></tendon><equality><" +
                                std::string(kind) + " $/></equality>"),
                   base, changes, none});
  };
  equality("connect", "name=e;body1=hand;body2=ball;anchor=.1 0 0",
           {"anchor=.2 0 0", "body1=arm", "body2=world", "site1=mid;site2=tip;body1=-;body2=-;anchor=-"},
           " class site2 ");
  equality("weld", "name=e;body1=hand;body2=ball;anchor=.1 0 0",
           {"anchor=.2 0 0;relpose=1 0 0 1 0 0 0", "body1=arm", "body2=world", "relpose=1 0 0 1 0 0 0",
            "site1=mid;site2=tip;body1=-;body2=-;anchor=-"},
           " class site2 torquescale ");
  equality("joint", "name=e;joint1=wrist;joint2=shoulder", {"polycoef=0 2 0 0 0", "joint2=-"},
           " class joint1 ");
  equality("tendon", "name=e;tendon1=t;tendon2=u", {"polycoef=0 2 0 0 0", "tendon2=-"}, " class tendon1 ");
  const auto actuator = [&](const std::string& kind, const std::string& base,
                            std::vector<std::string> changes, const std::string& none) {
    for (const char* common :
         {"armature=.1", "damping=.3", "damping=.3 .1", "delay=.1;nsample=5", "gear=2", "name=b",
          "tendon=t;joint=-", "cranksite=mid;slidersite=tip;cranklength=.3;joint=-"})
      changes.push_back(common);
    const bool takes_site = kind != "muscle";  // by <general> alone
    if (takes_site) changes.push_back("site=tip;refsite=mid;joint=-;gear=0 1 0 0 0 0");
    // A DC motor has its bounds by saturation.
    if (kind != "dcmotor")
      for (const char* bounds : {"forcerange=-3 3", "forcelimited=true;forcerange=-3 3"})
        changes.push_back(bounds);
    for (const char* bounds : {"ctrlrange=-2 2", "ctrllimited=false"}) changes.push_back(bounds);
    all.push_back(
        {"actuator/" + kind,
         ArmModel("", "",
                  "<tendon><fixed name='t'><joint joint='shoulder' coef='1'/><joint joint='wrist' "
                  "coef='1'/></fixed></tendon><actuator><" +
                      kind + " $/></actuator>"),
         base, changes,
         none + " class cranklength group interp joint jointinparent lengthrange nsample slidersite user " +
             (takes_site ? "refsite " : "")});
  };
  all.push_back({"actuator/adhesion",
                 ArmModel("", "", "<actuator><adhesion $/></actuator>"),
                 "name=a;body=hand;ctrlrange=0 1;gain=3",
                 {"name=b", "body=arm", "ctrlrange=0 .5", "gain=4", "forcerange=-1 1",
                  "forcelimited=true;forcerange=0 2", "delay=.02;nsample=5"},
                 " class group interp nsample user "});
  actuator("general", "name=a;joint=shoulder;ctrlrange=-1 1;gainprm=2;biastype=affine;biasprm=0 -2 -1",
           {"actdim=2;dyntype=user", "actrange=-1 1;dyntype=integrator;actlimited=true",
            "actlimited=true;actrange=-1 1;dyntype=filter;dynprm=.1", "biasprm=1 -2 -1", "biastype=none",
            "dyntype=filter;dynprm=.1", "gainprm=3", "gaintype=affine;gainprm=2 1 1", "body=hand;joint=-"},
           " actearly dynprm ffrange input velrange inheritrange ");
  actuator("motor", "name=a;joint=shoulder;ctrlrange=-1 1", {}, "");
  actuator("position", "name=a;joint=shoulder;ctrlrange=-1 1;kp=3",
           {"kp=4", "kv=1", "dampratio=1", "timeconst=.1"}, " inheritrange ");
  actuator("velocity", "name=a;joint=shoulder;ctrlrange=-1 1;kv=3", {"kv=4"}, "");
  actuator("intvelocity", "name=a;joint=shoulder;ctrlrange=-1 1;kp=3;actrange=-1 1",
           {"kp=4", "kv=1", "dampratio=1", "actrange=-.5 .5"}, " actlimited inheritrange ");
  actuator("pid", "name=a;joint=shoulder;ctrlrange=-1 1;kp=3;kv=1",
           {"kp=4", "kv=2", "dampratio=1;kv=-", "ki=1", "imax=1;ki=1", "slewmax=1", "input=pos",
            "posrange=-2 2;ctrlrange=-", "velrange=-1 1;input=pos vel", "ffrange=-1 1;input=pos ff"},
           " inheritrange ");
  actuator("dcmotor", "name=a;joint=shoulder;ctrlrange=-1 1;motorconst=1;resistance=2",
           {"motorconst=2", "resistance=3", "nominal=1 2 3", "inductance=1 1", "saturation=1 0 0",
            "thermal=1 2 0 .004 25 25", "cogging=1 2 3", "lugre=1 1 1 1 1", "controller=1 1 1 1;input=pos",
            "input=vel;controller=1 0 1"},
           "");
  actuator("cylinder", "name=a;joint=shoulder;ctrlrange=-1 1",
           {"area=2", "bias=1 -1 -1", "diameter=1", "timeconst=.1"}, "");
  actuator("muscle", "name=a;joint=shoulder;ctrlrange=0 1;lengthrange=-1 1",
           {"timeconst=.02 .05", "tausmooth=.2", "range=.8 1", "force=10", "scale=300", "lmin=.4", "lmax=1.7",
            "vmax=2", "fpmax=1.4", "fvmax=1.4"},
           "");
  const std::string palm =
      "<worldbody><body name='palm' mocap='true'><geom size='.05'/><body pos='0 0 .2'><joint name='knuckle'/><geom "
      "size='.05'/></body></body></worldbody>";
  all.push_back(
      {"keyframe/key",
       ArmModel(palm, "",
                "<actuator><intvelocity name='s' joint='shoulder' kp='1' actrange='-1 1'/><motor name='m' "
                "joint='wrist'/></actuator><keyframe><key $/></keyframe>"),
       "name=k",
       {"qpos=.1 .1 .1 0 0 1 1 0 0 0", "qvel=1 0 0 0 0 0 0 0 0", "act=.5", "ctrl=0 .5", "mpos=0 0 1",
        "mquat=1 1 0 0", "name=l"},
       " plastic time "});
  return all;
}

// The attribute of a change.
std::string NameIn(const std::string& change) { return change.substr(0, change.find('=')); }

class SchemaOf : public ::testing::TestWithParam<SchemaElement> {};

TEST_P(SchemaOf, EveryAttributeIsUnderstoodOrNoted) {
  const SchemaElement& element = GetParam();
  const auto model = [&](const Attributes& attributes) {
    std::string text = element.model;
    return text.replace(text.find('$'), 1, TextOf(attributes));
  };
  const Attributes base = AttributesOf(element.base);
  const std::string understood = Understood(model(base));
  ASSERT_FALSE(understood.starts_with("refused")) << understood;
  for (const std::string& change : element.changes) {
    const std::string tried = Understood(model(AttributesOf(change, base)));
    EXPECT_FALSE(tried == understood) << change << " is ignored";
    EXPECT_FALSE(tried.starts_with("refused")) << change << ": " << tried;
  }
}

INSTANTIATE_TEST_SUITE_P(Mjcf, SchemaOf, ::testing::ValuesIn(SchemaElements()), [](const auto& element) {
  std::string name = element.param.path;
  std::replace(name.begin(), name.end(), '/', '_');
  return name;
});

// Elements and their attributes as MuJoCo's reader lists them, by path below <mujoco>.
std::map<std::string, std::set<std::string>> MujocoSchema() {
  std::string text(1 << 20, '\0');
  text.resize(
      static_cast<std::size_t>(mj_printSchema(nullptr, text.data(), static_cast<int>(text.size()), 0, 0)));
  constexpr std::size_t kIndent = 3, kAttributes = 30;  // columns
  std::map<std::string, std::set<std::string>> schema;
  std::vector<std::string> path;
  std::string at;
  std::stringstream lines(text);
  for (std::string line; std::getline(lines, line);) {
    const std::size_t begin = line.find_first_not_of(' ');
    if (begin == std::string::npos) continue;
    if (begin < kAttributes) {
      std::string name = line.substr(begin, line.find(' ', begin) - begin);
      if (name == "(world)body") name = "body";
      path.resize(begin / kIndent);
      path.push_back(name);
      at.clear();
      for (std::size_t i = 1; i < path.size(); ++i) at += (i > 1 ? "/" : "") + path[i];
    }
    std::stringstream names(line.substr(std::min(line.size(), kAttributes)));
    for (std::string name; names >> name;) schema[at].insert(name);
    schema[at];
  }
  return schema;
}

TEST(Schema, EveryElementAndAttributeIsListed) {
  // Read by MuJoCo's compiler alone, drawn, stored or measured, or left out whole with a note of each.
  const std::vector<std::string> whole = {"compiler",
                                          "size",
                                          "statistic",
                                          "visual",
                                          "default",
                                          "extension",
                                          "asset",
                                          "sensor",
                                          "custom",
                                          "deformable",
                                          "body/site",
                                          "body/camera",
                                          "body/light",
                                          "body/attach",
                                          "body/plugin",
                                          "body/flexcomp",
                                          "body/geom/plugin",
                                          "actuator/orientation",
                                          "actuator/damper",
                                          "actuator/plugin",
                                          "equality/flex",
                                          "equality/flexstrain"};
  std::map<std::string, std::set<std::string>> listed;
  for (const SchemaElement& element : SchemaElements()) {
    std::set<std::string>& names = listed[element.path];
    for (const std::string& change : element.changes) names.insert(NameIn(change));
    std::stringstream others(element.meaningless);
    for (std::string name; others >> name;)
      EXPECT_TRUE(names.insert(name).second) << element.path << ": '" << name << "' is listed twice";
  }
  for (const auto& [path, names] : MujocoSchema()) {
    const auto is_below = [&](const std::string& top) { return path == top || path.starts_with(top + "/"); };
    if (path.empty() || std::any_of(whole.begin(), whole.end(), is_below)) continue;
    if (!listed.contains(path)) {
      EXPECT_TRUE(names.empty()) << path << " is not listed";
      continue;
    }
    for (const std::string& name : names)
      EXPECT_TRUE(listed[path].contains(name)) << path << ": '" << name << "' is not listed";
    for (const std::string& name : listed[path])
      EXPECT_TRUE(names.contains(name)) << path << ": MuJoCo knows no '" << name << "'";
  }
}

}  // namespace
}  // namespace fork1s::testing_importer
