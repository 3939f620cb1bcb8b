// A progress bar on a terminal; in a pipe a line every ten seconds.
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
  bool is_terminal_ = false;
  bool drawn_ = false;
  std::chrono::steady_clock::time_point last_ = std::chrono::steady_clock::now();
};

}  // namespace fork1s::app
