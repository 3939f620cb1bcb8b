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
  kObject,     ///< the held object: contacts that hold a free body are frozen as joints, without slip
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

/// A free body that is part of a mechanism while its contacts are frozen. Mechanisms that hold it together are
/// one mechanism for that time.
struct FrozenGrasp {
  struct Contact {
    int mechanism = 0;                  // of the scene
    std::string body;                   // of that mechanism
    RigidTransform X_BC;                // contact frame on that body: x is the normal, towards the held body
    Vector3 force_C = Vector3::Zero();  // N on the held body, when it was frozen
    double friction = 0;
    bool frictionless = false;  // constrains the normal only
    /// Rolling stiffness [N·m/rad] about y and z of the contact frame, which are principal: the force when it was
    /// frozen times the migration of the contact point per radian. Without it a grasp under load is less stable.
    Eigen::Vector2d rolling = Eigen::Vector2d::Zero();
  };
  int free_body = 0;  // of the scene
  std::vector<Contact> contacts;
};

/// Location of a mechanism of the scene in the world: its own index, or a range of the mechanism that it forms
/// with others while they hold a body together. The mechanism of its own index is empty then.
struct MechanismPlace {
  int mechanism = 0;
  int first_body = 0, first_coordinate = 0, first_control = 0;
};

/// Force of one frozen contact. Contacts whose load is statically indeterminate (several on one pair of bodies,
/// stretched fingers against each other) have the shares that they had when they were frozen.
struct FrozenContactForce {
  int body = -1;                       // the holding body: index in Simulation::bodies()
  int held = -1;                       // the held body
  Vector3 point_W = Vector3::Zero();   // m
  Vector3 normal_W = Vector3::Zero();  // towards the held body
  Vector3 force_W = Vector3::Zero();   // N, on the held body
  double friction = 0;
  /// |f_t| / (µ f_n), infinite for a contact that pulls. Above 1 a contact that is not frozen would slip or open.
  double use = 0;
};

/// The scene with the interface bodies of a level. kObject changes none.
Scene RefineInterfaces(Scene scene, DetailLevel level);

}  // namespace fork1s
