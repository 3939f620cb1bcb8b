// A clock that is read only where somebody asked.
#pragma once

#include <chrono>

#include "world/step_times.hpp"

namespace fork1s {

/// Adds the time of its scope to a part of a step; without `times` it does nothing.
class PartClock {
 public:
  PartClock(StepPartTimes* times, double StepPartTimes::*part) : sum_(times ? &(times->*part) : nullptr) {
    if (sum_) start_ = Clock::now();
  }
  ~PartClock() { Stop(); }
  PartClock(const PartClock&) = delete;
  PartClock& operator=(const PartClock&) = delete;
  void Stop() {
    if (sum_) *sum_ += std::chrono::duration<double>(Clock::now() - start_).count();
    sum_ = nullptr;
  }

 private:
  using Clock = std::chrono::steady_clock;
  double* sum_;
  Clock::time_point start_;
};

}  // namespace fork1s
