// Frames of a replay page, drawn by a headless browser.
#pragma once

#include <fork1s/base/error.hpp>
#include <string>
#include <string_view>

namespace fork1s::app {

struct VideoOptions {
  int width = 1280, height = 720;  // pixels
};

/// Draws every frame of the page's recording. `out` is FILE.mp4 (needs ffmpeg) or a folder for PNG files.
/// Returns how many frames there were. Errors (kFile) name the program that is missing or failed.
Expected<int> RenderVideo(std::string_view page, const std::string& out, const VideoOptions& options);

}  // namespace fork1s::app
