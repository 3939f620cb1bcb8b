#include "mechanism_view.hpp"

#include "errors.hpp"

namespace fork1s::python {

std::vector<std::string> MechanismView::Bodies() const {
  std::vector<std::string> names;
  for (const Mechanism::Body& body : mechanism().bodies()) names.push_back(body.name);
  return names;
}

std::vector<std::string> MechanismView::Interfaces() const {
  std::vector<std::string> names;
  for (BodyIndex b : model->Reduction(index)->interfaces) names.push_back(mechanism().body(b).name);
  return names;
}

std::vector<std::string> MechanismView::Coordinates() const {
  std::vector<std::string> names;
  for (int i = 0; i < mechanism().num_coordinates(); ++i) names.push_back(mechanism().CoordinateName(i));
  return names;
}

std::vector<BodyIndex> MechanismView::FindBodies(const std::vector<std::string>& names) const {
  std::vector<BodyIndex> bodies;
  for (const std::string& name : names) {
    bodies.push_back(mechanism().FindBody(name));
    if (!bodies.back().valid()) RefuseName("body", name, Bodies());
  }
  if (bodies.empty()) bodies = model->Reduction(index)->interfaces;
  return bodies;
}

std::vector<int> MechanismView::CoordinatesToLock(const std::vector<BodyIndex>& bodies,
                                                  bool lock_free) const {
  const OnFreeMotion on_free = lock_free ? OnFreeMotion::kLock : OnFreeMotion::kRefuse;
  return ValueOrThrow(fork1s::CoordinatesToLock(mechanism(), posed().q, bodies, on_free), model->origin());
}

InterfaceCompliance MechanismView::Compliance(const std::vector<std::string>& names, bool lock_free) const {
  const std::vector<BodyIndex> bodies = FindBodies(names);
  return WalkCompliance(mechanism(), posed().q, bodies, CoordinatesToLock(bodies, lock_free));
}

MechanismView MechanismOf(const std::shared_ptr<const Model>& model, const std::string& body) {
  std::vector<std::string> known;
  for (std::size_t i = 0; i < model->mechanisms().size(); ++i) {
    const MechanismView view{model, i};
    if (view.mechanism().FindBody(body).valid()) return view;
    for (std::string& name : view.Bodies()) known.push_back(std::move(name));
  }
  RefuseName("body of a mechanism", body, known);
}

MechanismView OnlyMechanism(const std::shared_ptr<const Model>& model) {
  const std::size_t count = model->mechanisms().size();
  if (count == 0)
    throw Refused{
        {ErrorCode::kModel, model->origin(), "holds no mechanism, only free bodies; nothing can be reduced"}};
  if (count > 1)
    throw Refused{{ErrorCode::kModel, model->origin(),
                   "holds " + std::to_string(count) + " mechanisms; ask one of them: model.mechanisms[i]"}};
  return {model, 0};
}

}  // namespace fork1s::python
