// Frames of a replay page, drawn by a headless browser.
#pragma once

#include <fork1s/base/error.hpp>
#include <optional>
#include <string>
#include <string_view>

namespace fork1s::app {

struct VideoOptions {
  int width = 1280, height = 720;  // pixels
  /// Draws this moment alone [s after the start], framed by itself: a film's camera holds the whole path.
  std::optional<double> at;
  std::optional<double> fps;  // frames a second of simulated time; none: one a step, 60 a second in a film
  std::optional<double> azimuth, elevation;  // degrees, of the camera; from x towards y, upwards
  double zoom = 1;
  bool forces = true;       // arrows at contacts
  int colouring = 0;        // 0: the file's colours, 1: interface bodies, 2: roles, 3: gaps at joints
  std::optional<int> body;  // place in Simulation::bodies() of what the camera looks at; none: the middle
};

/// Draws every frame of the page's recording. `out` is FILE.mp4 (needs ffmpeg), a folder for PNG files or,
/// with `at`, FILE.png.
/// Returns how many frames there were. Errors (kFile) name the program that is missing or failed.
Expected<int> RenderVideo(std::string_view page, const std::string& out, const VideoOptions& options);

}  // namespace fork1s::app
