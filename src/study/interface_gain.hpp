// What the choice of interface bodies gains: how much is computed, how quick a step is, what step is stable,
// and whether fewer would gain more.
#pragma once

#include <fork1s/base/error.hpp>
#include <fork1s/mechanism/scene.hpp>
#include <fork1s/reduction/reduced_model.hpp>
#include <optional>
#include <string>
#include <vector>

#include "study/posed_mechanism.hpp"

namespace fork1s {

struct InterfaceGain {
  int coordinates_full = 0;    // independent joint coordinates, loops taken off
  int coordinates = 0;         // of the reduced model
  int touching = 0;            // interface bodies
  int shaped = 0;              // bodies with shapes that collide, interface or not
  double fastest_hz = 0;       // natural frequency of the full model; 0: no spring, or too large to ask
  double step_s = 0;           // that is taken here
  double explicit_step_s = 0;  // above which an explicit (symplectic) Euler step diverges: 1 / (π fastest_hz)

  struct Choice {
    std::vector<std::string> interfaces;
    int coordinates = 0, modes = 0;  // modes: how many of the coordinates are fixed-interface modes
  };
  std::vector<Choice> fewer;  // one interface body less each time, where that saves coordinates
  std::vector<std::string> without_contact;  // bodies with colliding shapes that touch nothing
  std::vector<std::string> must_stay;  // interface bodies without which a joint without spring moves unseen

  /// One line or two, without times.
  std::vector<std::string> Sentences() const;
};

/// Tries subsets of the interface, each by a reduction; none where the mechanism is large.
/// `step_s` is the step that a simulation takes.
InterfaceGain MeasureInterfaceGain(const PosedMechanism& posed, const ReducedModel& model, double step_s);

/// Median times of a step from the scene's start on, taken by turns, by the scene's interface and with every
/// body one: the same solver, so that their ratio is what the reduction and its fewer contacts gain.
struct StepTimes {
  double interface_us = 0, all_us = 0;
  double dt = 0;  // s, that both took
};
/// Nothing where a run cannot be made or takes longer than a moment, or a mechanism has hundreds of joints.
std::optional<StepTimes> MeasureStepTimes(const Scene& scene, int initial_keyframe);

}  // namespace fork1s
