// Recordings as moving scenes for other programs.
#pragma once

#include <fork1s/record/recording.hpp>
#include <string>

namespace fork1s {

struct GltfOptions {
  double fps = 60;  // keys a second at most; 0: one every step
};

/// Writes a recording as a glTF 2.0 scene with one animation: FILE.glb as one binary, FILE.gltf as text with
/// the binary part in base64. What it holds:
/// - one node a body, with its name (MECHANISM/BODY where two share it), under one node that turns this
///   program's z-up axes into glTF's y-up; a node "world" for what stands still;
/// - under each a node a shape with its mesh in metres and a material of its colour. Shapes of groups 3 and
/// up
///   are left out where their body has others, and so are wholly transparent ones, as the viewer does it;
///   planes without end become squares that hold what moves over them;
/// - the pose of every body that moves, in seconds since the start of the recording, whose state is key 0.
/// Numbers are floats of 24 bits, as glTF has them. Errors: kUsage for another extension or a negative fps,
/// kFile; kFormat for recordings with numbers that are not finite or a scene that cannot be drawn.
Expected<void> ExportGltf(const Recording& recording, const std::string& path,
                          const GltfOptions& options = {});

}  // namespace fork1s
