// A progress bar on a terminal, nothing in a pipe.
#pragma once

#include <chrono>
#include <string>

namespace fork1s::app {

class ProgressBar {
 public:
  explicit ProgressBar(std::string label);
  ~ProgressBar();
  /// share in [0, 1]; redraws ten times a second at most.
  void Update(double share);

 private:
  std::string label_;
  bool shown_ = false;
  bool drawn_ = false;
  std::chrono::steady_clock::time_point last_{};
};

}  // namespace fork1s::app
