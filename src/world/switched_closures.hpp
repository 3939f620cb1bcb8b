// Closures that a control switches: frame J on one body is held at frame J on another.
//
// With R the axes of J on a, p_a and p_b the origins of both frames and R_E = Rᵀ R_bJ, the gap is
// c = [log R_E; Rᵀ (p_b - p_a)], and its rate, where it is small, J v = [Rᵀ (ω_b - ω_a); Rᵀ (v_b - v_a)], both
// velocities those of points at p_b, so that the impulse λ on b is -λ on a at the same point. Every stage of a step of
// length h that starts with the gap c₀ has, at its pose,
//     J v = -(1 - exp(-h/T)) c₀/h,
// so that the gap falls by exp(-h/T) in a step, T the time constant.
//
// These rows are eliminated before the contact solve. The blocks of velocities that closures join become one: with Y
// that of its parts one below the other, G = Y Jᵀ = Q R and r = J v* - J v,
//     v* := v* - Yᵀ Q R⁻ᵀ r,   Y := (1 - Q Qᵀ) Y,
// contacts are solved on what the closures leave free, and by their impulses p
//     λ = -R⁻¹ (R⁻ᵀ r + Qᵀ Y p),   Y that of the parts.
#pragma once

#include <vector>

#include "bodies.hpp"
#include "detection.hpp"
#include "impact.hpp"
#include "rows.hpp"

namespace fork1s {

/// A SwitchedClosureDef of a scene.
struct SwitchedClosure {
  std::size_t mechanism = 0;  // of its control
  Eigen::Index control = 0;
  int a = 0, b = 0;           // collision bodies
  RigidTransform X_AJ, X_BJ;  // in the frames of the collision bodies; of a still one in the world
  Eigen::Matrix<bool, 6, 1> rigid = Eigen::Matrix<bool, 6, 1>::Constant(true);
  double time_constant = 0;        // s
  bool acts = false;               // in the step or part of one at hand
  Vector6 rate = Vector6::Zero();  // rad/s, m/s: J v of its stages
};

/// What of the scene a body is.
struct BodyOnCollisionBody {
  int collision_body = -1;  // -1: of none
  RigidTransform X_CB;      // of a still collision body the pose in the world
};
/// Those of all mechanisms. `find`: a body of the scene by its name. Errors: kModel where a body is not there, or is
/// none that can bear a force.
template <class Find>
Expected<std::vector<SwitchedClosure>> FindSwitchedClosures(const Bodies& bodies, const Find& find) {
  std::vector<SwitchedClosure> found;
  for (std::size_t i = 0; i < bodies.mechanisms.size(); ++i) {
    const MechanismDef& of = bodies.mechanisms[i].mechanism().definition();
    for (const SwitchedClosureDef& def : of.switched_closures) {
      SwitchedClosure& closure = found.emplace_back();
      closure.mechanism = i;
      closure.rigid = def.rigid;
      closure.time_constant = def.time_constant;
      for (std::size_t k = 0; k < of.controls.size(); ++k)
        if (of.controls[k].name == def.control) closure.control = static_cast<Eigen::Index>(k);
      const std::string where = "switched closure '" + def.name + "' of mechanism '" + of.name + "'";
      for (const bool is_a : {true, false}) {
        const std::string& name = is_a ? def.body_a : def.body_b;
        const BodyOnCollisionBody body = find(name);
        if (body.collision_body < 0)
          return Fail(
              ErrorCode::kModel, where,
              "holds '" + name +
                  "', which is no free body and no interface body of a mechanism; name it as an interface");
        (is_a ? closure.a : closure.b) = body.collision_body;
        (is_a ? closure.X_AJ : closure.X_BJ) = body.X_CB * (is_a ? def.X_AJ : def.X_BJ);
      }
      if (closure.a == closure.b)
        return Fail(ErrorCode::kModel, where,
                    "holds '" + def.body_a + "' and '" + def.body_b +
                        "', which do not move relative to each other; take it out");
    }
  }
  return found;
}

/// Which of them act in the step or part of a step of length h [s] that begins at the poses at hand, and their rates.
void StartSwitchedClosures(const Bodies& bodies, const Detection& detection, double h,
                           std::vector<SwitchedClosure>& closures);
/// One whose bodies move otherwise than it asks for, by more than the speed of an impact: switched on, or hit.
const SwitchedClosure* FindClosureImpact(const std::vector<SwitchedClosure>& closures, const Bodies& bodies,
                                         const Detection& detection, double impact_speed);
/// Rows of those that act, at the poses at hand; after AssignPorts and FindPortFrames.
void AssembleClosures(const std::vector<SwitchedClosure>& closures, const Bodies& bodies,
                      const Detection& detection, ConstraintRows& rows);
/// Eliminates them from rows.velocities, the free ones, and rows.blocks; after AssembleOperators and ApplyPulls.
void EliminateClosures(ConstraintRows& rows);
/// Their impulses, by those of contacts and limits.
void ComputeClosureImpulses(ConstraintRows& rows);
/// Adds these to those of ports; `rows.is_pushed` of their bodies.
void GatherClosureImpulses(const std::vector<SwitchedClosure>& closures, const Detection& detection,
                           ConstraintRows& rows);
/// sums += weight · [moment about the world's origin; impulse] on b, per closure.
void SumClosureImpulses(double weight, const ConstraintRows& rows, std::vector<Vector6>& sums);
/// What they did, by those sums, at the poses at hand.
void RecordClosures(const std::vector<SwitchedClosure>& closures, const Bodies& bodies,
                    const Detection& detection, const std::vector<Vector6>& sums,
                    std::vector<SwitchedClosureRecord>& records);

}  // namespace fork1s
