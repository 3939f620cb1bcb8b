#include "model.hpp"

#include <algorithm>
#include <cmath>
#include <fork1s/mechanism/set_stiffness.hpp>
#include <fork1s/sim/continue.hpp>
#include <fork1s/sim/scene_factors.hpp>

#include "errors.hpp"
#include "sim/vary.hpp"

namespace fork1s::python {

std::shared_ptr<const Model> Model::Create(Expected<ImportedScene> imported, std::string origin,
                                           std::optional<ImportOptions> options) {
  auto model = std::make_shared<Model>();
  model->imported_ = ValueOrThrow(std::move(imported), origin);
  model->mechanisms_ = ValueOrThrow(PoseMechanisms(model->imported_), origin);
  model->joints_ = MovingJoints(model->imported_.joints, model->scene());
  model->reductions_.resize(model->mechanisms_.size());
  model->origin_ = std::move(origin);
  model->file_options_ = std::move(options);
  return model;
}

namespace {

// A joint coordinate, by the places of its freedom in the scene: builders sort joints, scenes do not.
struct Coordinate {
  std::string name;
  std::size_t mechanism = 0;
  FreedomRef freedom;
};

std::vector<Coordinate> CoordinatesOf(const Model& model) {
  std::vector<Coordinate> all;
  for (std::size_t i = 0; i < model.mechanisms().size(); ++i) {
    const Mechanism& mechanism = *model.mechanisms()[i].mechanism;
    int at = 0;
    for (const JointDef& joint : mechanism.definition().joints)
      for (std::size_t f = 0; f < joint.freedoms.size(); ++f)
        all.push_back({mechanism.CoordinateName(at++),
                       i,
                       {model.scene().mechanisms[i].FindJoint(joint.name), static_cast<int>(f)}});
  }
  return all;
}

const FreedomDef& FreedomOf(const Model& model, const Coordinate& c) {
  return model.scene().mechanisms[c.mechanism].joints[c.freedom.joint.u()].freedoms[static_cast<std::size_t>(
      c.freedom.freedom)];
}

}  // namespace

std::map<std::string, double> Model::Stiffnesses() const {
  std::map<std::string, double> all;
  for (const Coordinate& c : CoordinatesOf(*this)) all[c.name] = FreedomOf(*this, c).stiffness;
  for (const MechanismDef& def : scene().mechanisms)
    for (const SpringDef& spring : def.springs)
      if (const double k = StiffnessOf(def, spring.name); k > 0) all.emplace(spring.name, k);
  return all;
}

Scene Model::SetStiffnesses(Scene scene, const std::map<std::string, double>& stiffness,
                            std::vector<SensorDef>& actuators) const {
  const std::map<std::string, double> known = Stiffnesses();
  for (const auto& [name, value] : stiffness) {
    if (!known.contains(name)) {
      std::vector<std::string> names;
      for (const auto& [one, stiffness_now] : known) names.push_back(one);
      RefuseName("joint coordinate, tendon or servo of a tendon", name, names);
    }
    // Laws of actuators change as those in sensors do.
    Scene laws;
    laws.mechanisms = scene.mechanisms;
    laws.sensors = std::move(actuators);
    actuators = ValueOrThrow(fork1s::WithStiffness(std::move(laws), name, value)).sensors;
    scene = ValueOrThrow(fork1s::WithStiffness(std::move(scene), name, value));
  }
  return scene;
}

std::shared_ptr<const Model> Model::WithStiffness(const std::map<std::string, double>& stiffness) const {
  ImportedScene changed = imported_;
  changed.scene = SetStiffnesses(std::move(changed.scene), stiffness, changed.actuators);
  return Create(std::move(changed), origin_, std::nullopt);
}

std::shared_ptr<const Model> Model::WithFactors(const std::map<std::string, double>& factors) const {
  SceneFactors all;
  for (const auto& [key, factor] : factors) SetFactor(key, factor, all);
  ValueOrThrow(CheckFactors(scene(), all));
  ImportedScene changed = imported_;
  // Laws of actuators change as those in sensors do.
  Scene laws;
  laws.mechanisms = scene().mechanisms;
  laws.free_bodies = scene().free_bodies;
  laws.world = scene().world;
  laws.contact_pairs = scene().contact_pairs;
  laws.sensors = std::move(changed.actuators);
  changed.actuators = fork1s::internal::VaryChecked(std::move(laws), all).sensors;
  changed.scene = fork1s::internal::VaryChecked(std::move(changed.scene), all);
  return Create(std::move(changed), origin_, std::nullopt);
}

std::shared_ptr<const ReducedModel> Model::Reduction(std::size_t mechanism) const {
  const std::lock_guard lock(mutex_);
  auto& reduction = reductions_.at(mechanism);
  if (!reduction) {
    const PosedMechanism& posed = mechanisms_[mechanism];
    ReductionOptions options;
    options.promote_hidden = !posed.interfaces_chosen;
    reduction = std::make_shared<const ReducedModel>(
        ValueOrThrow(Reduce(posed.mechanism, posed.q, options), origin_));
  }
  return reduction;
}

std::vector<std::string> Model::BodyNames() const {
  std::vector<std::string> names;
  for (const PosedMechanism& posed : mechanisms_)
    for (const Mechanism::Body& body : posed.mechanism->bodies()) names.push_back(body.name);
  for (const FreeBodyDef& body : scene().free_bodies) names.push_back(body.name);
  return names;
}

}  // namespace fork1s::python
