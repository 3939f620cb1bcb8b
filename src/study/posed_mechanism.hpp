// The mechanisms of a file at the pose where it starts: what compliance, frequencies and statics are asked
// of.
#pragma once

#include <fork1s/base/error.hpp>
#include <fork1s/importer/importer.hpp>
#include <fork1s/mechanism/mechanism.hpp>
#include <fork1s/reduction/reduced_model.hpp>
#include <memory>
#include <string>
#include <vector>

namespace fork1s {

/// One mechanism of a scene, built and with its loops closed at the requested keyframe.
struct PosedMechanism {
  std::shared_ptr<const Mechanism> mechanism;
  VectorX q;
  RigidTransform X_WR;   // of its root frame
  ReductionLoads loads;  // of the scene's gravity and the initial controls
  bool interfaces_chosen = true;
};

/// The model that a two-stage simulation at 1/60 s starts with; `interfaces` empty: those of the mechanism.
/// Errors: as of Reduce.
Expected<ReducedModel> ReduceAtStart(const PosedMechanism& posed,
                                     const std::vector<BodyIndex>& interfaces = {});

/// In the order of the scene. Errors: as of BuildMechanism; kModel where loops stay open.
Expected<std::vector<PosedMechanism>> PoseMechanisms(const ImportedScene& imported);

/// The one that has this body; null where none has.
const PosedMechanism* FindMechanism(const std::vector<PosedMechanism>& posed, const std::string& body);

}  // namespace fork1s
