// What a simulation of the C interface holds.
#pragma once

#include <fork1s/fork1s.h>

#include <atomic>
#include <fork1s/record/recording.hpp>
#include <fork1s/sim/queries.hpp>
#include <fork1s/sim/sensors.hpp>
#include <fork1s/sim/simulation.hpp>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "calls.hpp"
#include "model.hpp"
#include "sim/step_totals.hpp"

namespace fork1s::c {

struct Moment {
  std::shared_ptr<const Model> model;
  Simulation::Snapshot simulation;
  double dt = 0;            // s
  double time_before = 0;   // s
  double state_change = 0;  // rad or m
  std::vector<internal::BodyPush> pushes;
};

struct SensorPlace {
  std::string name, reason;
  int first = 0, count = 0;  // values
};

struct Run {
  Run(std::shared_ptr<const Model> of, Simulation made) : model(std::move(of)), simulation(std::move(made)) {}

  std::shared_ptr<const Model> model;
  Simulation simulation;
  // As it was made: text that is handed out lives as long as this.
  std::vector<std::string> body_names, control_names, warnings;
  std::vector<SensorPlace> sensor_places;
  std::vector<internal::BodyPush> pushes;  // of the next call
  double time_before = 0;                  // s, of simulations that a state set took the place of
  double state_change = 0;                 // rad or m
  mutable std::optional<Sensors> sensors;  // as they were evaluated last
  mutable std::optional<RayCaster> rays;   // once one was cast
  Moment start;                            // as it was made

  double time() const { return time_before + simulation.time(); }
};

Moment Save(const Run& run);

}  // namespace fork1s::c

struct fork1s_snapshot {
  fork1s::c::Moment moment;
};

struct fork1s_simulation {
  fork1s::c::Run run;
  mutable std::atomic<bool> in_use{false};  // by a call
};

namespace fork1s::c {

/// Calls f(run), alone: a call that another thread is in meanwhile is refused.
template <class Handle, class F>
fork1s_status GuardRun(const char* function, Handle* simulation, F&& f) noexcept {
  return Guard(function, [&] {
    RequireGiven(simulation, "simulation");
    if (simulation->in_use.exchange(true, std::memory_order_acquire))
      Misuse("another thread uses this simulation; give each thread its own, or let one wait for the other");
    struct Release {
      const fork1s_simulation* of;
      ~Release() { of->in_use.store(false, std::memory_order_release); }
    } release{simulation};
    f(simulation->run);
  });
}

/// Hands out one of `names`.
void ReadName(const std::vector<std::string>& names, const char* what, std::int32_t index, const char** name);
/// Finite numbers; NULL: zeros.
Vector3 ReadVector(const double* numbers, const char* argument);
/// Refuses what is not finite.
void RequireFinite(const double* numbers, std::size_t count, const char* argument);

}  // namespace fork1s::c
