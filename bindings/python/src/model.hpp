// What a Python Model holds: the file as it was read, its mechanisms, their reductions when first asked for.
#pragma once

#include <fork1s/importer/importer.hpp>
#include <fork1s/reduction/reduced_model.hpp>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <vector>

#include "study/posed_mechanism.hpp"

namespace fork1s::python {

/// Never changed once it is made, so that any number of simulations and views share it.
class Model {
 public:
  /// `origin`: the path, or what stands for it in messages. `options`: with which `origin` was read; none where
  /// that is no file, or the model has been changed since.
  static std::shared_ptr<const Model> Create(Expected<ImportedScene> imported, std::string origin,
                                             std::optional<ImportOptions> options);

  /// The same with other stiffnesses: coordinate name -> N·m/rad or N/m. Throws Refused or UnknownName.
  std::shared_ptr<const Model> WithStiffness(const std::map<std::string, double>& stiffness) const;
  /// The same with parts scaled, by the keys of SetFactor. Throws Refused.
  std::shared_ptr<const Model> WithFactors(const std::map<std::string, double>& factors) const;
  /// A scene of this model's mechanisms with other stiffnesses, and the laws of its actuators. Throws likewise.
  Scene SetStiffnesses(Scene scene, const std::map<std::string, double>& stiffness,
                       std::vector<SensorDef>& actuators) const;
  /// What holds every joint coordinate of all mechanisms, springs and servos together, by name.
  std::map<std::string, double> Stiffnesses() const;

  const std::string& origin() const { return origin_; }
  const std::optional<ImportOptions>& file_options() const { return file_options_; }
  const ImportedScene& imported() const { return imported_; }
  const Scene& scene() const { return imported_.scene; }
  const std::vector<PosedMechanism>& mechanisms() const { return mechanisms_; }
  /// Joints of the file that move, in its order: those of qpos and qvel.
  const std::vector<FileJoint>& joints() const { return joints_; }
  /// Of all these.
  Eigen::Index NumPositions() const { return Sum(&FileJoint::num_positions); }
  Eigen::Index NumVelocities() const { return Sum(&FileJoint::num_velocities); }

  /// The reduction of a mechanism at its pose. Throws Refused.
  std::shared_ptr<const ReducedModel> Reduction(std::size_t mechanism) const;
  /// Names of all bodies: those of the mechanisms, then free bodies.
  std::vector<std::string> BodyNames() const;

 private:
  Eigen::Index Sum(int (FileJoint::*count)() const) const {
    Eigen::Index sum = 0;
    for (const FileJoint& joint : joints_) sum += (joint.*count)();
    return sum;
  }

  std::string origin_;
  std::optional<ImportOptions> file_options_;
  ImportedScene imported_;
  std::vector<PosedMechanism> mechanisms_;
  std::vector<FileJoint> joints_;
  mutable std::mutex mutex_;
  mutable std::vector<std::shared_ptr<const ReducedModel>> reductions_;
};

}  // namespace fork1s::python
