// A mechanism built by hand.
#pragma once

#include <fork1s/mechanism/definition.hpp>
#include <fork1s/mechanism/mechanism.hpp>
#include <unordered_set>

namespace fork1s {

/// Collects definitions and turns them into a Mechanism.
///
///     MechanismBuilder builder("finger");
///     BodyIndex link = builder.AddBody({.name = "link", .parent = builder.base(), ...});
///     builder.AddJoint(JointDef::Hinge("knuckle", link, Vector3::UnitY()).WithSpring(2.0));
///     Expected<Mechanism> finger = builder.Build();
///
/// AddBody and AddJoint throw std::invalid_argument for indices that they did not give and for a second body
/// of one name; Build has an error for everything else that cannot be built.
class MechanismBuilder {
 public:
  explicit MechanismBuilder(std::string name, BaseKind base = BaseKind::kFixed,
                            SpatialInertia base_inertia = {});

  BodyIndex base() const { return BodyIndex(0); }
  BodyIndex AddBody(BodyDef body);
  JointIndex AddJoint(JointDef joint);
  /// The two hinges of a universal joint, parent side first.
  std::pair<JointIndex, JointIndex> AddJoint(std::pair<JointDef, JointDef> universal);
  MechanismBuilder& AddClosure(ClosureDef closure);
  MechanismBuilder& AddCoupling(CouplingDef coupling);
  MechanismBuilder& AddSpring(SpringDef spring);
  MechanismBuilder& AddControl(ControlDef control);
  MechanismBuilder& SetInterfaces(std::vector<std::string> bodies);
  MechanismBuilder& SetModes(int modes, ModeChoice choice = ModeChoice::kLowest);
  MechanismBuilder& SetBasePose(const RigidTransform& X_WR);

  const MechanismDef& definition() const { return definition_; }
  Expected<Mechanism> Build() const { return BuildMechanism(definition_); }

 private:
  MechanismDef definition_;
  std::unordered_set<std::string> names_;  // of bodies
};

}  // namespace fork1s
