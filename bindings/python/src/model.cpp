#include "model.hpp"

#include "errors.hpp"

namespace fork1s::python {

std::shared_ptr<const Model> Model::Create(Expected<ImportedScene> imported, std::string origin,
                                           std::string file) {
  auto model = std::make_shared<Model>();
  model->imported_ = Take(std::move(imported), origin);
  model->mechanisms_ = Take(PoseMechanisms(model->imported_), origin);
  model->reductions_.resize(model->mechanisms_.size());
  model->origin_ = std::move(origin);
  model->file_ = std::move(file);
  return model;
}

std::shared_ptr<const ReducedModel> Model::Reduction(std::size_t mechanism) const {
  const std::lock_guard lock(mutex_);
  auto& reduction = reductions_.at(mechanism);
  if (!reduction) {
    const PosedMechanism& posed = mechanisms_[mechanism];
    ReductionOptions options;
    options.promote_hidden = !posed.interfaces_chosen;
    reduction =
        std::make_shared<const ReducedModel>(Take(Reduce(posed.mechanism, posed.q, options), origin_));
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
