#include <fork1s/mechanism/builder.hpp>

namespace fork1s {

MechanismBuilder::MechanismBuilder(std::string name, BaseKind base, SpatialInertia base_inertia) {
  definition_.name = std::move(name);
  definition_.base = base;
  BodyDef body;
  body.name = "base";
  names_.insert(body.name);
  body.inertia = base_inertia;
  definition_.bodies.push_back(std::move(body));
}

BodyIndex MechanismBuilder::AddBody(BodyDef body) {
  FORK1S_REQUIRE(body.parent.valid() && body.parent.u() < definition_.bodies.size(),
                 "body '" + body.name + "' needs a parent that was added before it; base() is the first");
  FORK1S_REQUIRE(names_.insert(body.name).second, "there is a body '" + body.name + "'; give another name");
  definition_.bodies.push_back(std::move(body));
  return BodyIndex(definition_.bodies.size() - 1);
}

JointIndex MechanismBuilder::AddJoint(JointDef joint) {
  FORK1S_REQUIRE(
      joint.body.valid() && joint.body.u() < definition_.bodies.size(),
      "joint '" + joint.name + "' moves no body that was added; give an index that AddBody returned");
  definition_.joints.push_back(std::move(joint));
  return JointIndex(definition_.joints.size() - 1);
}

std::pair<JointIndex, JointIndex> MechanismBuilder::AddJoint(std::pair<JointDef, JointDef> universal) {
  const JointIndex first = AddJoint(std::move(universal.first));
  return {first, AddJoint(std::move(universal.second))};
}

MechanismBuilder& MechanismBuilder::AddClosure(ClosureDef closure) {
  definition_.closures.push_back(std::move(closure));
  return *this;
}

MechanismBuilder& MechanismBuilder::AddCoupling(CouplingDef coupling) {
  definition_.couplings.push_back(std::move(coupling));
  return *this;
}

MechanismBuilder& MechanismBuilder::AddSpring(SpringDef spring) {
  definition_.springs.push_back(std::move(spring));
  return *this;
}

MechanismBuilder& MechanismBuilder::AddControl(ControlDef control) {
  definition_.controls.push_back(std::move(control));
  return *this;
}

MechanismBuilder& MechanismBuilder::SetInterfaces(std::vector<std::string> bodies) {
  definition_.interfaces = std::move(bodies);
  return *this;
}

MechanismBuilder& MechanismBuilder::SetModes(int modes, ModeChoice choice) {
  definition_.modes = modes;
  definition_.modes_by_step = false;
  definition_.mode_choice = choice;
  return *this;
}

MechanismBuilder& MechanismBuilder::SetBasePose(const RigidTransform& X_WR) {
  definition_.X_WR = X_WR;
  return *this;
}

}  // namespace fork1s
