// Contacts of the step or stage before, and which of them those at hand are.
#pragma once

#include <fork1s/world/world_state.hpp>
#include <vector>

#include "contact_matching.hpp"
#include "detection.hpp"

namespace fork1s {

struct ContactHistory {
  void Reserve(std::size_t contacts);
  /// The contacts before are those of `records`, which gets what were these; impulses are of steps of h [s].
  /// What else is known of them is set apart.
  void Store(std::vector<ContactRecord>& records, double h, const std::vector<RigidTransform>& poses);
  /// Nothing that a step in progress knows is known of the contacts before.
  void StartStep();
  /// The contacts at hand are matched with those before.
  void Match(const Detection& detection);
  /// Gaps of the contacts at hand, found at the start of the step, that CarriedAtRest at this speed.
  void RecordStartGaps(const std::vector<ContactPoint>& points, double speed);
  /// Start gaps of the contacts at hand, which are those before from now on.
  void CarryStartGaps();

  /// The contact before, or none; in the second stage that of the first. What is to hold for the whole step goes the
  /// way of `start_gap`: StartStep, then CarryStartGaps.
  const ContactRecord* Before(std::size_t contact) const;
  /// Whether a contact at hand bore a load at the end of the last step and did not only close its gap then,
  /// at this speed [m/s] or faster.
  bool CarriedAtRest(std::size_t contact, double speed) const;
  /// In the second stage: whether a contact at hand carried load at the start of the step and in the first stage.
  bool Lasts(std::size_t contact) const;
  /// m; NaN where a contact carried no load at the start of the step at hand.
  double StartGap(std::size_t contact) const;
  /// What turns an impulse before into one of a step of length h.
  double TimeStepRatio(double h) const { return length > 0 ? h / length : 1; }

  std::vector<ContactRecord> contacts;
  double length = 0;                  // s, of the step that gave them their impulses
  std::vector<RigidTransform> poses;  // per collision body
  std::vector<int> match;             // per contact at hand: that before, or -1
  // Per contact before.
  std::vector<double> start_gap;  // m, at the start of the step, of what carried load there; else NaN
  std::vector<char> is_fresh;     // in the second stage: met in the first
  // In their frames, from the end of the first stage to the base point of the second [N m; N].
  std::vector<Vector6> to_base_point;

 private:
  ContactMatcher matcher_;
  std::vector<double> next_start_gap_;
};

}  // namespace fork1s
