// A state of a scene as the joint positions and velocities of its file, in the file's order, and back.
//
// The conventions are MuJoCo's. Positions: hinge and slide a displacement, rad or m, counted as the file does; ball a
// unit quaternion w x y z of the body relative to where its joint hangs; free the position of the body in the world and
// its quaternion. Velocities: hinge and slide a rate; ball the angular velocity in axes of the body; free the velocity of
// the body's origin in world axes, then its angular velocity in axes of the body.
#pragma once

#include <fork1s/base/error.hpp>
#include <fork1s/mechanism/scene.hpp>
#include <string>
#include <vector>

namespace fork1s {

/// A joint of the file, and what it is in the scene.
struct FileJoint {
  enum class Kind { kFree, kBall, kSlide, kHinge };
  std::string name;
  Kind kind = Kind::kHinge;
  int free_body = -1;   // of the scene: the joint of that body
  int mechanism = -1;   // of the scene, of all others
  int body = 0;         // body of the mechanism that the joint moves
  int coordinate = -1;  // its first in KeyframeDef::MechanismState::q; -1: it moves the base, or is none here
  /// Positions at the reference, where displacements are 0: one number, or a quaternion w x y z. Free joints have none.
  std::vector<double> reference;

  int num_positions() const { return kind == Kind::kFree ? 7 : kind == Kind::kBall ? 4 : 1; }
  int num_velocities() const { return kind == Kind::kFree ? 6 : kind == Kind::kBall ? 3 : 1; }
};

/// The joints that have a freedom in `scene`, in their order. Free joints of bases that are fixed or driven, and those
/// that a weld locks, have none.
std::vector<FileJoint> MovingJoints(const std::vector<FileJoint>& joints, const Scene& scene);

struct FileState {
  VectorX positions, velocities;  // of all joints one after the other
};

/// The state of `scene` in the order of `joints`.
FileState ComputeFileState(const std::vector<FileJoint>& joints, const Scene& scene,
                           const KeyframeDef& state);

/// Writes positions and velocities of joints into a state of `scene`; quaternions are normalized. What has no joint stays,
/// and so do velocities of bases that do not float. Errors: kUsage for other numbers of values than the joints have, values
/// that are not finite and quaternions of length 0.
Expected<void> ApplyFileState(const std::vector<FileJoint>& joints, const Scene& scene,
                              const FileState& given, KeyframeDef& state);

}  // namespace fork1s
