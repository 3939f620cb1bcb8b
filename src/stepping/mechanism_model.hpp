// What a step of a mechanism reads and only a refresh changes.
#pragma once

#include <fork1s/reduction/reduced_model.hpp>
#include <fork1s/stepping/mechanism_options.hpp>
#include <memory>
#include <string>
#include <vector>

#include "linalg/row_squares.hpp"
#include "mechanism/rigid_parts.hpp"

namespace fork1s {

struct VelocityRange {
  int begin = 0, size = 0;
};

/// Springs and dampers about the reference. Sizes: n joint coordinates, r reduced ones.
struct ReferenceForces {
  std::vector<PathState> paths;
  std::vector<double> spring_stiffness;     // of springs()
  std::vector<WeightedRows> dampers;        // of joints
  std::vector<WeightedRows> joint_springs;  // without those of servos with bounds
  MatrixX joint_damping;                    // r x r, lower triangle, with loops: what `dampers` are in D
  std::vector<int> damped_rotations;        // of rotations(); their dampers are not among `dampers`
  // Three rows a damped rotation, E Q_θ, by the columns that move them.
  std::vector<WeightedRows> rotation_dampers;
  MatrixX rotation_damping;       // r x r, lower triangle: what `rotation_dampers` are in D
  MatrixX closure_damping;        // r x r, lower triangle: of springy closures in D; empty for none
  bool has_bent_springs = false;  // of paths, or not linear
};

/// Const and shared once it is made; a refresh makes another one. Sizes: n joint coordinates, r reduced ones.
struct MechanismModel {
  /// At its start, the pose of the reference.
  MechanismModel(std::shared_ptr<const ReducedModel> about, const MechanismOptions& with);
  /// The same mechanism about another reference.
  MechanismModel(const MechanismModel& before, std::shared_ptr<const ReducedModel> about);

  const Mechanism& mechanism() const { return *reduced->mechanism; }
  /// r
  int size() const { return reduced->size(); }
  /// Number of generalized velocities: r, plus 6 where the base floats.
  int num_velocities() const { return base_size + size(); }
  bool base_moves() const { return mechanism().base() != BaseKind::kFixed; }
  /// The part that moves group g; -1 where it only follows the base.
  int PartOfGroup(int g) const { return part_of_group[static_cast<std::size_t>(g)]; }

  // The same after every refresh.
  MechanismOptions options;
  RigidParts rigid_parts;
  std::vector<ContactGroup> groups;
  std::vector<char>
      invariant;  // n: joints whose displacement leaves the reduction as it is (FindInvariantJoints)
  std::vector<std::string> warnings;
  int base_size = 0;     // 6 where the base floats
  bool expands = false;  // steps by expansions (Recovery::kExpanded), where nothing forbids it

  std::shared_ptr<const ReducedModel> reduced;
  std::vector<char> whole;   // n: joints of which the model has all motions (FindWhole)
  VectorX coordinate_reach;  // r: most that a joint moves per z, slides in lengths of the mechanism
  // Velocities [begin, begin + size) that neither inertia nor damping nor any contact group couples to the
  // others: the fingers of a hand whose palm is held, for instance. W is formed and contacts are solved part
  // by part.
  std::vector<VelocityRange> parts;
  std::vector<int> part_of_group, part_of_limited, part_of_friction;  // of length_limits, of frictions()
  std::vector<int> part_of_bounded_force;                             // -1: of one that nothing moves by

  ReferenceForces at_reference;
};

}  // namespace fork1s
