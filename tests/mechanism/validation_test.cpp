// Every bad input is refused, and the refusal names the element at fault.
#include "support.hpp"

#include <gtest/gtest.h>
#include <cmath>
#include <functional>
#include <limits>
#include <stdexcept>

namespace fork1s::mechanism_test {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

// A path of as many elements, all on the base.
PathDef& AddFrames(MechanismDef& def, PathKind kind, int count) {
  PathDef path;
  path.name = "pusher";
  path.kind = kind;
  path.elements.resize(static_cast<std::size_t>(count));
  for (PathElementDef& e : path.elements) e.body = BodyIndex(0);
  def.paths.push_back(path);
  return def.paths.back();
}

MuscleDef& AddMuscle(MechanismDef& def) {
  MuscleDef muscle;
  muscle.name = "flexor";
  muscle.terms = {{FreedomRef{JointIndex(0), 0}, 0.1}};
  muscle.control = def.controls[0].name;
  muscle.force = 100;
  muscle.length_lower = -0.1, muscle.length_upper = 0.1;
  def.muscles.push_back(muscle);
  return def.muscles.back();
}

AdhesionDef& AddAdhesion(MechanismDef& def) {
  AdhesionDef adhesion;
  adhesion.name = "cup";
  adhesion.body = "lower";
  adhesion.control = def.controls[0].name;
  adhesion.gain = 20;
  def.adhesions.push_back(adhesion);
  return def.adhesions.back();
}

SwitchedClosureDef& AddSwitched(MechanismDef& def) {
  SwitchedClosureDef closure;
  closure.name = "latch";
  closure.body_a = "lower";
  closure.body_b = "world";
  closure.control = def.controls[0].name;
  def.switched_closures.push_back(closure);
  return def.switched_closures.back();
}

// base - upper (hinge "shoulder") - lower (ball "elbow"), base - rod (slide "rail"), with one of everything.
MechanismDef Good() {
  MechanismBuilder builder("machine");
  const SpatialInertia I{1, Vector3(0.1, 0, 0), Matrix3::Identity() * 0.01};
  const BodyIndex upper = builder.AddBody({"upper", builder.base(), RigidTransform(Vector3(0, 0, 1)), I, {}});
  const BodyIndex lower = builder.AddBody({"lower", upper, RigidTransform(Vector3(0, 0, 1)), I, {}});
  const BodyIndex rod = builder.AddBody({"rod", builder.base(), RigidTransform(Vector3(1, 0, 0)), I, {}});
  const JointIndex shoulder =
      builder.AddJoint(JointDef::Hinge("shoulder", upper, Vector3::UnitY()).WithSpring(3, 1));
  const JointIndex elbow = builder.AddJoint(JointDef::Ball("elbow", lower).WithSpring(2));
  const JointIndex rail = builder.AddJoint(JointDef::Slide("rail", rod, Vector3::UnitX()).WithSpring(5));
  builder.AddClosure(ClosureDef::Connect("pin", lower, rod, Vector3::Zero(), Vector3(-1, 0, 2)));
  CouplingDef coupling;
  coupling.name = "gear";
  coupling.a = {shoulder, 0};
  coupling.b = {rail, 0};
  builder.AddCoupling(coupling);
  SpringDef spring;
  spring.name = "tendon";
  spring.terms = {{FreedomRef{shoulder, 0}, 1.0}, {FreedomRef{elbow, 2}, -0.5}};
  spring.stiffness = 4;
  builder.AddSpring(spring);
  ControlDef control;
  control.name = "motor";
  control.terms = {{FreedomRef{rail, 0}, 1.0}};
  control.gain = 5;
  builder.AddControl(control).SetInterfaces({"lower"}).SetModes(2);
  return builder.definition();
}

enum { kUpper = 1, kLower = 2, kRod = 3 };
enum { kShoulder = 0, kElbow = 1, kRail = 2 };

struct Fault {
  const char* what;
  std::function<void(MechanismDef&)> spoil;
  std::string where;    // Error::where must hold this,
  std::string message;  // and Error::message this
};

std::vector<Fault> BodyFaults() {
  return {
      {"no bodies", [](auto& d) { d.bodies.clear(); }, "machine", "no bodies"},
      {"NaN pose", [](auto& d) { d.bodies[kLower].X_PB.translation().y() = kNaN; }, "body 'lower'", "pose"},
      {"infinite pose", [](auto& d) { d.bodies[kRod].X_PB.rotation()(0, 0) = kInfinity; }, "body 'rod'",
       "pose"},
      {"mirrored pose", [](auto& d) { d.bodies[kRod].X_PB.rotation() *= -1; }, "body 'rod'",
       "not a rotation"},
      {"scaled pose", [](auto& d) { d.bodies[kRod].X_PB.rotation() *= 1.1; }, "body 'rod'", "not a rotation"},
      {"NaN base pose", [](auto& d) { d.X_WR.translation().x() = kNaN; }, "machine", "base pose"},
      {"negative mass", [](auto& d) { d.bodies[kUpper].inertia.mass = -1; }, "body 'upper'", "negative mass"},
      {"NaN mass", [](auto& d) { d.bodies[kUpper].inertia.mass = kNaN; }, "body 'upper'", "finite"},
      {"NaN centre", [](auto& d) { d.bodies[kUpper].inertia.center.x() = kNaN; }, "body 'upper'", "finite"},
      {"NaN inertia", [](auto& d) { d.bodies[0].inertia.rotational(0, 0) = kNaN; }, "body 'base'", "finite"},
      {"negative moment", [](auto& d) { d.bodies[kRod].inertia.rotational(1, 1) = -0.1; }, "body 'rod'",
       "principal moment"},
      {"lopsided inertia", [](auto& d) { d.bodies[kRod].inertia.rotational(0, 1) = 0.005; }, "body 'rod'",
       "symmetric"},
      {"body named twice", [](auto& d) { d.bodies[kRod].name = "upper"; }, "body 'upper'", "twice"},
      {"second root", [](auto& d) { d.bodies[kRod].parent = {}; }, "body 'rod'", "parent"},
      {"own parent", [](auto& d) { d.bodies[kLower].parent = BodyIndex(kLower); }, "body 'lower'", "parent"},
      {"later parent", [](auto& d) { d.bodies[kUpper].parent = BodyIndex(kRod); }, "body 'upper'", "parent"},
      {"parent out of range", [](auto& d) { d.bodies[kRod].parent = BodyIndex(9); }, "body 'rod'", "parent"},
      {"base with parent", [](auto& d) { d.bodies[0].parent = BodyIndex(1); }, "body 'base'", "parent"},
      {"massless end", [](auto& d) { d.bodies[kLower].inertia = {}; }, "joint 'elbow'", "no inertia"},
      {"point mass in a ball", [](auto& d) { d.bodies[kLower].inertia.rotational.setZero(); },
       "joint 'elbow'", "no inertia"},
      {"massless slide", [](auto& d) { d.bodies[kRod].inertia.mass = 0; }, "joint 'rail'", "no inertia"},
      {"point mass on its hinge",
       [](auto& d) {
         // Away from the root and off the axes, where rounding could pass for inertia.
         d.bodies[kRod].X_PB = RigidTransform(ExpRotation(Vector3(0.3, 0.2, 0.1)), Vector3(3.1, 1.7, 2.3));
         d.bodies[kRod].inertia = {2, Vector3::Zero(), Matrix3::Zero()};
         d.joints[kRail] = JointDef::Hinge("rail", BodyIndex(kRod), Vector3(1, 2, 3));
       },
       "joint 'rail'", "no inertia"},
      {"massless floating base",
       [](auto& d) {
         d = {};
         d.name = "machine";
         d.bodies.resize(1);
         d.base = BaseKind::kFloating;
       },
       "machine", "floats"},
      {"floating point mass",
       [](auto& d) {
         d = {};
         d.name = "machine";
         d.bodies.resize(1);
         d.bodies[0].inertia.mass = 1;
         d.base = BaseKind::kFloating;
       },
       "machine", "floats"},
  };
}

std::vector<Fault> JointFaults() {
  auto screw = [](auto& d, int joint, int freedom) -> Vector6& {
    return d.joints[static_cast<std::size_t>(joint)].freedoms[static_cast<std::size_t>(freedom)].screw_B;
  };
  auto freedom = [](auto& d, int joint) -> FreedomDef& {
    return d.joints[static_cast<std::size_t>(joint)].freedoms[0];
  };
  return {
      {"joint named twice", [](auto& d) { d.joints[kRail].name = "elbow"; }, "joint 'elbow'", "twice"},
      {"joint on the base", [](auto& d) { d.joints[kRail].body = BodyIndex(0); }, "joint 'rail'", "base"},
      {"joint on nothing", [](auto& d) { d.joints[kRail].body = {}; }, "joint 'rail'", "does not exist"},
      {"joint out of range", [](auto& d) { d.joints[kRail].body = BodyIndex(4); }, "joint 'rail'",
       "does not exist"},
      {"no freedoms", [](auto& d) { d.joints[kRail].freedoms.clear(); }, "joint 'rail'", "0 freedoms"},
      {"seven freedoms", [](auto& d) { d.joints[kRail].freedoms.resize(7); }, "joint 'rail'", "7 freedoms"},
      {"zero axis",
       [](auto& d) { d.joints[kRail] = JointDef::Slide("rail", BodyIndex(kRod), Vector3::Zero()); },
       "joint 'rail'", "length zero"},
      {"zero hinge axis",
       [](auto& d) {
         d.joints[kRail] = JointDef::Hinge("rail", BodyIndex(kRod), Vector3::Zero(), Vector3::UnitX());
       },
       "joint 'rail'", "length zero"},
      {"NaN axis", [=](auto& d) { screw(d, kShoulder, 0)(1) = kNaN; }, "joint 'shoulder'", "finite"},
      {"same freedom twice", [=](auto& d) { screw(d, kElbow, 2) = screw(d, kElbow, 1); }, "joint 'elbow'",
       "depend"},
      {"dependent freedoms",
       [=](auto& d) { screw(d, kElbow, 2) = 0.3 * screw(d, kElbow, 0) + 1.0 / 3 * screw(d, kElbow, 1); },
       "joint 'elbow'", "depend"},
      {"negative stiffness", [=](auto& d) { freedom(d, kShoulder).stiffness = -1; }, "joint 'shoulder'",
       "stiffness"},
      {"NaN stiffness", [=](auto& d) { freedom(d, kShoulder).stiffness = kNaN; }, "joint 'shoulder'",
       "stiffness"},
      {"infinite stiffness", [=](auto& d) { freedom(d, kShoulder).stiffness = kInfinity; },
       "joint 'shoulder'", "stiffness"},
      {"negative damping", [=](auto& d) { freedom(d, kElbow).damping = -1; }, "joint 'elbow'", "damping"},
      {"negative armature", [=](auto& d) { freedom(d, kRail).armature = -1; }, "joint 'rail'", "armature"},
      {"NaN rest", [=](auto& d) { freedom(d, kRail).rest = kNaN; }, "joint 'rail'", "reference"},
      {"limits in the wrong order", [](auto& d) { d.joints[kRail].WithLimits(1, -1); }, "joint 'rail'",
       "limits"},
      {"NaN limit", [](auto& d) { d.joints[kRail].WithLimits(kNaN, 1); }, "joint 'rail'", "limits"},
  };
}

std::vector<Fault> ConnectionFaults() {
  return {
      {"closure on itself", [](auto& d) { d.closures[0].body_b = d.closures[0].body_a; }, "closure 'pin'",
       "itself"},
      {"closure on nothing", [](auto& d) { d.closures[0].body_b = {}; }, "closure 'pin'", "does not exist"},
      {"closure out of range", [](auto& d) { d.closures[0].body_a = BodyIndex(7); }, "closure 'pin'",
       "does not exist"},
      {"NaN closure frame", [](auto& d) { d.closures[0].X_AJ.translation().z() = kNaN; }, "closure 'pin'",
       "frame"},
      {"mirrored closure frame", [](auto& d) { d.closures[0].X_BJ.rotation() *= -1; }, "closure 'pin'",
       "frame"},
      {"negative closure stiffness", [](auto& d) { d.closures[0].stiffness(1) = -1; }, "closure 'pin'",
       "stiffness"},
      {"NaN closure damping", [](auto& d) { d.closures[0].damping(1) = kNaN; }, "closure 'pin'", "damping"},
      {"coupling to itself", [](auto& d) { d.couplings[0].b = d.couplings[0].a; }, "coupling 'gear'",
       "itself"},
      {"coupling of nothing", [](auto& d) { d.couplings[0].a.joint = {}; }, "coupling 'gear'",
       "does not exist"},
      {"coupling out of range", [](auto& d) { d.couplings[0].b.joint = JointIndex(8); }, "coupling 'gear'",
       "does not exist"},
      {"coupling of no freedom", [](auto& d) { d.couplings[0].a.freedom = 1; }, "coupling 'gear'",
       "shoulder"},
      {"coupling by NaN", [](auto& d) { d.couplings[0].polynomial[3] = kNaN; }, "coupling 'gear'",
       "coefficient"},
      {"coupling term by NaN",
       [](auto& d) {
         d.couplings[0].terms = {{FreedomRef{JointIndex(kElbow), 1}, kNaN}};
       },
       "coupling 'gear'", "coefficient"},
      {"coupling term on nothing",
       [](auto& d) {
         d.couplings[0].terms = {{FreedomRef{}, 1.0}};
       },
       "coupling 'gear'", "does not exist"},
      {"coupling term on its own joint",
       [](auto& d) {
         d.couplings[0].terms = {{FreedomRef{JointIndex(kRail), 0}, 1.0}};
       },
       "coupling 'gear'", "'rail' to itself"},
      {"coupling terms of one joint",
       [](auto& d) {
         const FreedomRef twist{JointIndex(kElbow), 1};
         d.couplings[0].terms = {{twist, 1.0}, {twist, 2.0}};
       },
       "coupling 'gear'", "'elbow' to itself"},
      {"spring on nothing", [](auto& d) { d.springs[0].terms[0].first.joint = {}; }, "spring 'tendon'",
       "does not exist"},
      {"spring on no freedom", [](auto& d) { d.springs[0].terms[1].first.freedom = -1; }, "spring 'tendon'",
       "elbow"},
      {"spring by NaN", [](auto& d) { d.springs[0].terms[1].second = kNaN; }, "spring 'tendon'",
       "coefficient"},
      {"negative spring", [](auto& d) { d.springs[0].stiffness = -4; }, "spring 'tendon'", "stiffness"},
      {"NaN rest length", [](auto& d) { d.springs[0].rest = kNaN; }, "spring 'tendon'", "rest"},
      {"negative slack", [](auto& d) { d.springs[0].slack = -0.1; }, "spring 'tendon'", "slack"},
      {"pin on no body",
       [](auto& d) { AddFrames(d, PathKind::kSliderCrank, 2).elements[1].body = BodyIndex(9); },
       "path 'pusher', element 2", "does not exist"},
      {"slider-crank without a pin", [](auto& d) { AddFrames(d, PathKind::kSliderCrank, 1); },
       "path 'pusher', element 2", "a slider and a pin"},
      {"angle to nothing", [](auto& d) { AddFrames(d, PathKind::kAngle, 1); }, "path 'pusher', element 2",
       "between two frames"},
      {"rod of NaN", [](auto& d) { AddFrames(d, PathKind::kSliderCrank, 2).rod = kNaN; }, "path 'pusher'",
       "rod"},
      {"wrench between three", [](auto& d) { AddFrames(d, PathKind::kWrench, 3); },
       "path 'pusher', element 4", "first or second"},
      {"wrench of NaN", [](auto& d) { AddFrames(d, PathKind::kWrench, 1).gear(2) = kNaN; }, "path 'pusher'",
       "gear"},
      {"wrench on what floats",
       [](auto& d) {
         d.base = BaseKind::kFloating;
         AddFrames(d, PathKind::kWrench, 1);
       },
       "path 'pusher', element 1", "second frame"},
      {"control of nothing", [](auto& d) { d.controls[0].terms[0].first.joint = JointIndex(3); },
       "control 'motor'", "does not exist"},
      {"control by NaN", [](auto& d) { d.controls[0].terms[0].second = kNaN; }, "control 'motor'",
       "coefficient"},
      {"NaN gain", [](auto& d) { d.controls[0].gain = kNaN; }, "control 'motor'", "gain"},
      {"lag without a time",
       [](auto& d) { d.controls[0].dynamics = ControlDynamics::kLag, d.controls[0].time_constant = 0; },
       "control 'motor'", "time constant 0 s"},
      {"activation limits",
       [](auto& d) { d.controls[0].activation_lower = 1, d.controls[0].activation_upper = 0; },
       "control 'motor'", "activation"},
      {"NaN activation", [](auto& d) { d.controls[0].initial_activation = kNaN; }, "control 'motor'",
       "activation"},
      {"control limits", [](auto& d) { d.controls[0].lower = 1, d.controls[0].upper = 0; }, "control 'motor'",
       "limits"},
      {"muscle activation in no time",
       [](auto& d) { d.controls[0].dynamics = ControlDynamics::kMuscle, d.controls[0].time_constant = 0.01; },
       "control 'motor'", "deactivation time 0 s"},
      {"muscle activation that is too short",
       [](auto& d) {
         d.controls[0].dynamics = ControlDynamics::kMuscle;
         d.controls[0].time_constant = 1e-5, d.controls[0].deactivation_time = 0.999e-5;
       },
       "control 'motor'", "1e-05 s or more"},
      {"muscle without a control", [](auto& d) { AddMuscle(d).control = "nerve"; }, "muscle 'flexor'",
       "'nerve'"},
      {"muscle of negative force", [](auto& d) { AddMuscle(d).force = -1; }, "muscle 'flexor'", "force -1 N"},
      {"muscle of one length", [](auto& d) { AddMuscle(d).length_upper = -0.1; }, "muscle 'flexor'",
       "length range"},
      {"muscle of a reversed range", [](auto& d) { AddMuscle(d).range_lower = 2; }, "muscle 'flexor'",
       "range 2"},
      {"muscle that cannot stretch", [](auto& d) { AddMuscle(d).lmax = 1; }, "muscle 'flexor'", "lmax 1"},
      {"muscle without speed", [](auto& d) { AddMuscle(d).vmax = 0; }, "muscle 'flexor'", "vmax 0"},
      {"muscle that weakens as it lengthens", [](auto& d) { AddMuscle(d).fvmax = 0.9; }, "muscle 'flexor'",
       "fvmax 0.9"},
      {"adhesion without a control", [](auto& d) { AddAdhesion(d).control = "pump"; }, "adhesion 'cup'",
       "control 'pump', which is not there"},
      {"adhesion of no body", [](auto& d) { AddAdhesion(d).body = "hand"; }, "adhesion 'cup'", "body 'hand'"},
      {"adhesion of a gain that is no number", [](auto& d) { AddAdhesion(d).gain = kNaN; }, "adhesion 'cup'",
       "gain that is not finite"},
      {"adhesion of reversed bounds", [](auto& d) { AddAdhesion(d).lower = 1, d.adhesions[0].upper = 0; },
       "adhesion 'cup'", "bounds 1 to 0 N"},
      {"switched closure of no body", [](auto& d) { AddSwitched(d).body_a = "hand"; },
       "switched closure 'latch'", "body 'hand'"},
      {"switched closure without a control", [](auto& d) { AddSwitched(d).control = "key"; },
       "switched closure 'latch'", "control 'key', which is not there"},
      {"switched closure without a time", [](auto& d) { AddSwitched(d).time_constant = 0; },
       "switched closure 'latch'", "time constant of 0 s"},
      {"switched closure of a frame that is no number",
       [](auto& d) { AddSwitched(d).X_AJ.translation().x() = kNaN; }, "switched closure 'latch'",
       "not finite"},
      {"switched closure of one rotation", [](auto& d) { AddSwitched(d).rigid[0] = false; },
       "switched closure 'latch'", "some rotations alone"},
      {"switched closure of nothing", [](auto& d) { AddSwitched(d).rigid.setConstant(false); },
       "switched closure 'latch'", "holds no direction"},
      {"muscle of nothing", [](auto& d) { AddMuscle(d).terms[0].first.joint = JointIndex(3); },
       "muscle 'flexor'", "does not exist"},
      {"unknown interface", [](auto& d) { d.interfaces.push_back("tail"); }, "interface 'tail'", "machine"},
      {"negative modes", [](auto& d) { d.modes = -1; }, "machine", "modes"},
  };
}

void ExpectRefused(const std::vector<Fault>& faults) {
  for (const Fault& fault : faults) {
    MechanismDef def = Good();
    fault.spoil(def);
    const Expected<Mechanism> result = BuildMechanism(def);
    ASSERT_FALSE(result) << fault.what;
    EXPECT_EQ(result.error().code, ErrorCode::kModel) << fault.what;
    EXPECT_NE(result.error().where.find(fault.where), std::string::npos)
        << fault.what << ": " << result.error().Text();
    EXPECT_NE(result.error().message.find(fault.message), std::string::npos)
        << fault.what << ": " << result.error().Text();
  }
}

TEST(Validation, GoodMechanismBuilds) {
  const Expected<Mechanism> m = BuildMechanism(Good());
  ASSERT_TRUE(m) << m.error().Text();
  EXPECT_EQ(m->num_coordinates(), 5);
  EXPECT_EQ(m->num_constraints(), 4);
  EXPECT_EQ(m->CoordinateName(0), "shoulder");
  EXPECT_EQ(m->CoordinateName(3), "elbow (freedom 3)");
  EXPECT_EQ(m->FindBody("lower"), BodyIndex(kLower));
  EXPECT_FALSE(m->FindBody("nobody").valid());
}

TEST(Validation, RefusesBadBodies) { ExpectRefused(BodyFaults()); }
TEST(Validation, RefusesBadJoints) { ExpectRefused(JointFaults()); }
TEST(Validation, RefusesBadConnections) { ExpectRefused(ConnectionFaults()); }

TEST(Validation, AcceptsWhatIsUnusualButRight) {
  MechanismDef def = Good();
  def.bodies[kLower].inertia = {};  // massless, but its joint has a rotor
  def.joints[kElbow].WithArmature(1e-6);
  def.joints[kRail].WithLimits(0.5, 0.5);
  EXPECT_TRUE(BuildMechanism(def));
  // Tiny parts a hundred metres out are small, not massless.
  def = Good();
  def.bodies[kUpper].X_PB.translation() = Vector3(100, 0, 0);
  def.bodies[kLower].inertia = {1e-6, Vector3::Zero(), Matrix3::Identity() * 1e-13};
  EXPECT_TRUE(BuildMechanism(def));
}

TEST(Builder, RefusesIndicesThatItNeverGave) {
  MechanismBuilder builder("machine");
  EXPECT_THROW(builder.AddBody({"orphan", BodyIndex(), {}, {}, {}}), std::invalid_argument);
  EXPECT_THROW(builder.AddBody({"orphan", BodyIndex(1), {}, {}, {}}), std::invalid_argument);
  EXPECT_THROW(builder.AddJoint(JointDef::Ball("ball", BodyIndex(1))), std::invalid_argument);
}

TEST(Builder, RefusesASecondBodyOfOneName) {
  for (const char* name : {"base", "link"}) {
    MechanismBuilder builder("machine");
    builder.AddBody({"link", builder.base(), {}, {}, {}});
    try {
      builder.AddBody({name, builder.base(), {}, {}, {}});
      ADD_FAILURE() << name;
    } catch (const std::invalid_argument& e) {
      EXPECT_EQ(std::string(e.what()).rfind(
                    "MechanismBuilder::AddBody: there is a body '" + std::string(name) + "'", 0),
                0u)
          << e.what();
    }
  }
}

TEST(Shapes, FitTheirBoundingSpheres) {
  EXPECT_EQ(BoundingRadius(Sphere{0.5}), 0.5);
  EXPECT_EQ(BoundingRadius(Capsule{0.1, 0.4}), 0.5);
  EXPECT_EQ(BoundingRadius(Cylinder{3, 4}), 5);
  EXPECT_EQ(BoundingRadius(Ellipsoid{Vector3(1, 3, 2)}), 3);
  EXPECT_EQ(BoundingRadius(Box{Vector3(2, 3, 6)}), 7);
  EXPECT_TRUE(std::isinf(BoundingRadius(Plane{})));
  auto mesh = std::make_shared<TriangleMesh>();
  mesh->vertices = {{0, 0, 1}, {3, 0, 4}};
  EXPECT_EQ(BoundingRadius(MeshShape{mesh}), 5);
  EXPECT_EQ(BoundingRadius(MeshShape{}), 0);
  EXPECT_STREQ(ShapeName(Box{}), "box");
}

}  // namespace
}  // namespace fork1s::mechanism_test
