// What contacts, stops and dry friction did in all stages and parts of a step.
#pragma once

#include <fork1s/world/world_state.hpp>
#include <vector>

namespace fork1s {

struct ImpulseSums {
  struct Contact {
    Vector6 wrench_W = Vector6::Zero();  // moment [N m s] and impulse [N s]
    Vector3 pull_W = Vector3::Zero();    // of adhesion [N s]
    double normal = 0, tangential = 0;   // see ContactRecord [N s]
  };
  std::vector<Contact> contacts;       // of the stage added last, in its order
  std::vector<ContactRecord> ended;    // of stages before, that are none of these
  std::vector<WorldState::Rows> rows;  // per mechanism: stops and dry friction
  std::vector<Vector6> closures;  // per switched closure: moment about the world's origin and impulse, on b

  void Reserve(std::size_t contacts);
  void Clear(std::size_t mechanisms, std::size_t switched_closures);
  /// Impulses of stops and dry friction of a mechanism in a stage, times `weight`.
  void AddRows(double weight, std::size_t mechanism, const std::vector<double>& limit_impulses,
               const std::vector<double>& friction_impulses);
  /// The contacts of the last stage, those at hand, get the sums; those that have ended follow them.
  void StoreContacts(std::vector<ContactRecord>& contacts) const;
};

/// Adds stages to sums. Its members are scratch.
class ContactSummation {
 public:
  void Reserve(std::size_t contacts);
  /// Impulses and moments of the contacts of a stage, times `weight`: vectors in world axes, magnitudes along
  /// and across the normal of each stage. `match`: which of `previous`, the contacts of the stage before,
  /// each is.
  void Add(double weight, const std::vector<ContactRecord>& contacts, const std::vector<int>& match,
           const std::vector<ContactRecord>& previous, ImpulseSums& sums);

 private:
  std::vector<ImpulseSums::Contact> next_;
  std::vector<char> goes_on_;  // per contact of the stage before
};

}  // namespace fork1s
