// What contacts hold of an error: docs/method.md, section 8.
#pragma once

#include <fork1s/world/world.hpp>
#include <vector>

#include "error_companion.hpp"
#include "error_free_body.hpp"
#include "linalg/solve.hpp"

namespace fork1s {

/// Rows on the error of all that moves: mechanisms in their order, then six a free body.
class ErrorContacts {
 public:
  /// Contacts that carried force in the step that begins at the companions' node, as they lie there.
  void ComputeRows(const World& world, const std::vector<ContactRecord>& contacts,
                   const std::vector<ErrorCompanion>& mechanisms,
                   const std::vector<FreeBodyPath>& free_bodies, double h);
  /// How their forces change as they go with the contacts.
  void ComputeStiffness(const World& world, const std::vector<ContactRecord>& contacts,
                        const std::vector<ErrorCompanion>& mechanisms,
                        const std::vector<FreeBodyPath>& free_bodies, double h);
  void AddStiffness(const std::vector<ErrorCompanion>& mechanisms, const std::vector<int>& offset,
                    MatrixX& K) const;
  /// Rows of the kept contacts for errors that lie at `offset`. `A`: the companion's operator, of stages of
  /// `s` [s].
  void Prepare(const std::vector<ErrorCompanion>& mechanisms, const std::vector<int>& offset,
               const LuFactor& A, double s);

  /// Rates at the end of a stage that without its own way ends at `e`. By how much the simulation's material
  /// gives counts in `column`.
  void Hold(const MatrixX& e, int column, MatrixX& rate) const;

 private:
  struct Contact {
    MatrixX rows;  // 6 x coordinates: ways and turns along normal and tangents; of joints, not of the bases
    Vector3 impulse, speed;
    double depth, h;
    bool sticks;    // at the end of the step, of whatever parts it was made
    bool turns[3];  // held by moments
  };
  std::vector<Contact> contacts_;
  MatrixX stiffness_;  // of joints
  MatrixX J_, hold_;
  VectorX depth_, pull_;  // rate -= hold_ (J_ rate + pull_ (J_ e - depth_))
};

}  // namespace fork1s
