// How much of a scene is simulated: the levels between a carried object alone and every body.
//
// docs/method.md, section 7.
#pragma once

#include <fork1s/base/error.hpp>
#include <fork1s/mechanism/scene.hpp>
#include <fork1s/recovery/recovery.hpp>
#include <limits>
#include <string>
#include <vector>

namespace fork1s {

/// Which bodies of a mechanism may touch, and so are kept by the reduction.
enum class DetailLevel {
  kObject,     ///< what it holds: contacts that hold a free body are frozen as joints, without slip
  kInterface,  ///< the interface bodies that its definition names: fingertips, feet
  kParents,    ///< these and the bodies that carry them
  kAll,        ///< every body
};
/// "object", "interface", "parents" or "all".
const char* Name(DetailLevel level);

struct Fidelity {
  DetailLevel level = DetailLevel::kInterface;
  int modes = -1;  // fixed-interface modes of every mechanism; negative: each its definition's number
  Recovery recovery = Recovery::kExact;
  bool operator==(const Fidelity&) const = default;
};

/// Fidelity over time, each entry from its time on.
struct FidelityTrack {
  struct Entry {
    double time = 0;  // s
    Fidelity fidelity;
  };
  std::vector<Entry> entries;  // times increasing

  /// Reads entries with commas between: [TIME:]WORD[+WORD...]. Words are object, interface, parents, all;
  /// modes=K; exact, expanded, curved, twist. What an entry does not name stays as in the one before it, the
  /// first starting from `initial`; an entry without a time begins at 0. Errors: kUsage.
  static Expected<FidelityTrack> Parse(const std::string& text, const Fidelity& initial = {});
};

/// A free body that is part of a mechanism as long as its contacts are frozen. Where several mechanisms hold
/// it they are one as long as they do.
struct FrozenGrasp {
  struct Contact {
    int mechanism = 0;                  // of the scene
    std::string body;                   // of that mechanism
    RigidTransform X_BC;                // contact frame on that body: x is the normal, towards what is held
    Vector3 force_C = Vector3::Zero();  // N on what is held, when it was frozen
    double friction = 0;
    bool frictionless = false;  // holds along the normal only
    /// N·m/rad about y and z of the contact frame, which are principal: the force of that moment times how
    /// far its point migrates where the surfaces roll on each other. Without, a grasp under load is less
    /// stable.
    Eigen::Vector2d rolling = Eigen::Vector2d::Zero();
  };
  int free_body = 0;  // of the scene
  std::vector<Contact> contacts;
};

/// Where a mechanism of the scene stands in the world: by itself, at its own place, or from these on in the
/// one that it forms with others while they hold a body together. Its own place is empty then.
struct MechanismPlace {
  int mechanism = 0;
  int first_body = 0, first_coordinate = 0, first_control = 0;
};

/// Force of one frozen contact. Where no yielding decides how contacts share a load, several on one pair of
/// bodies or stretched fingers against each other, they keep the share they had when they were frozen.
struct FrozenContactForce {
  int body = -1;                       // that holds, place in Simulation::bodies()
  int held = -1;                       // the same of what is held
  Vector3 point_W = Vector3::Zero();   // m
  Vector3 normal_W = Vector3::Zero();  // towards what is held
  Vector3 force_W = Vector3::Zero();   // N, on what is held
  double friction = 0;
  /// Tangential force as a share of what friction could carry: above 1, or infinite where the contact
  /// pulls, a contact that is not frozen would slip or part.
  double use = 0;
};

/// The scene with the interface bodies of a level worked in. kObject leaves them as they are.
Scene RefineInterfaces(Scene scene, DetailLevel level);

}  // namespace fork1s
