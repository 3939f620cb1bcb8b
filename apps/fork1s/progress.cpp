#include "progress.hpp"

#include <fmt/core.h>
#include <unistd.h>
#include <algorithm>

namespace fork1s::app {

ProgressBar::ProgressBar(std::string label)
    : label_(std::move(label)), is_terminal_(isatty(STDERR_FILENO) != 0) {}

ProgressBar::~ProgressBar() {
  if (drawn_) fmt::print(stderr, "\r\033[K");
}

void ProgressBar::Update(double share) {
  const auto now = std::chrono::steady_clock::now();
  if (!is_terminal_) {
    constexpr auto kInterval = std::chrono::seconds(10);
    if (now - last_ < kInterval) return;
    last_ = now;
    fmt::print(stderr, "{}: {:.0f} %\n", label_, 100 * share);
    std::fflush(stderr);
    return;
  }
  if (drawn_ && now - last_ < std::chrono::milliseconds(100)) return;
  last_ = now;
  drawn_ = true;
  const int filled = static_cast<int>(30 * std::clamp(share, 0.0, 1.0));
  fmt::print(stderr, "\r{} [{}{}] {:3.0f} %", label_, std::string(static_cast<std::size_t>(filled), '#'),
             std::string(static_cast<std::size_t>(30 - filled), ' '), 100 * share);
  std::fflush(stderr);
}

}  // namespace fork1s::app
