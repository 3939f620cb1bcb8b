// A host of shaders/*.comp.glsl in OpenGL ES 3.1, without a window: what an engine does with them, in full.
#pragma once

#include <EGL/egl.h>
#include <GLES3/gl31.h>

#include <cstdint>
#include <map>
#include <stdexcept>
#include <string>
#include <vector>

namespace engine_poses {

/// Why there is no graphics processor to be had, or what it said of a shader.
struct GraphicsError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// A context of OpenGL ES 3.1 without a window, current in this thread while it lives.
class Context {
 public:
  Context();
  ~Context();
  Context(const Context&) = delete;
  Context& operator=(const Context&) = delete;
  /// Such as "llvmpipe (LLVM 15.0.6, 256 bits)".
  std::string Renderer() const;

 private:
  EGLDisplay display_ = EGL_NO_DISPLAY;
  EGLContext context_ = EGL_NO_CONTEXT;
};

/// The text of a shader with its #include lines replaced by the files of the same folder.
std::string ReadShader(const std::string& folder, const std::string& name);

/// Eight numbers a body: quaternion x y z w, position x y z [m], 1.
using Poses = std::vector<float>;

/// The four passes and their buffers.
class PoseShaders {
 public:
  /// `folder`: that of the shaders. Needs a current context.
  explicit PoseShaders(const std::string& folder);
  ~PoseShaders();
  PoseShaders(const PoseShaders&) = delete;
  PoseShaders& operator=(const PoseShaders&) = delete;

  /// When the model is new, and whenever its reference has moved.
  void SetModel(const std::vector<std::int32_t>& tables, const std::vector<float>& numbers);
  /// Every frame, before one of the two below.
  void SetFrame(const std::vector<float>& frame);
  void RunTwist();
  /// `scans`: how often recover_scan runs; 0 leaves whole paths to recover_exact.
  void RunExact(int scans);
  /// Buffer of the poses, for a vertex shader that draws the bodies.
  GLuint poses() const { return poses_; }
  /// Waits for the graphics processor and copies them back: for tests, not for frames.
  Poses Read() const;

 private:
  GLuint Compile(const std::string& folder, const std::string& name);
  void Dispatch(GLuint program, int invocations);

  std::map<std::string, GLuint> programs_;
  GLuint tables_ = 0, numbers_ = 0, frame_ = 0, poses_ = 0, links_[2] = {0, 0};
  int num_links_ = 0, num_bodies_ = 0;
};

}  // namespace engine_poses
