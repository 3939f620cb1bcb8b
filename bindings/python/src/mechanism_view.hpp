// One mechanism of a model, as Python sees it.
#pragma once

#include <fork1s/reduction/compliance.hpp>
#include <string>
#include <vector>

#include "model.hpp"

namespace fork1s::python {

struct MechanismView {
  std::shared_ptr<const Model> model;
  std::size_t index = 0;

  const PosedMechanism& posed() const { return model->mechanisms()[index]; }
  const Mechanism& mechanism() const { return *posed().mechanism; }
  std::vector<std::string> Bodies() const;
  std::vector<std::string> Interfaces() const;
  std::vector<std::string> Coordinates() const;
  /// The named bodies, or all interface bodies if none is named. Throws for unknown names.
  std::vector<BodyIndex> FindBodies(const std::vector<std::string>& names) const;
  /// Coordinates that are locked where `lock_free` is set; otherwise throws UnderdeterminedError where a
  /// motion that no spring resists moves one of the bodies.
  std::vector<int> CoordinatesToLock(const std::vector<BodyIndex>& bodies, bool lock_free) const;
  /// Walked compliance of the named bodies. Throws for unknown names, and as CoordinatesToLock.
  InterfaceCompliance Compliance(const std::vector<std::string>& bodies, bool lock_free) const;
};

/// The mechanism that has a body of this name; throws UnknownName with all bodies of mechanisms.
MechanismView MechanismOf(const std::shared_ptr<const Model>& model, const std::string& body);
/// The only mechanism; throws ModelError where there are several or none.
MechanismView OnlyMechanism(const std::shared_ptr<const Model>& model);

}  // namespace fork1s::python
