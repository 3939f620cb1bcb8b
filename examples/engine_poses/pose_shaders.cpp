#include "pose_shaders.hpp"

#include <EGL/eglext.h>

#include <fstream>
#include <sstream>

namespace engine_poses {

Context::Context() {
  // Mesa's platform without a surface needs neither a display server nor a graphics card.
  const auto get_display =
      reinterpret_cast<PFNEGLGETPLATFORMDISPLAYEXTPROC>(eglGetProcAddress("eglGetPlatformDisplayEXT"));
  if (get_display != nullptr)
    display_ = get_display(EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, nullptr);
  if (display_ == EGL_NO_DISPLAY || eglInitialize(display_, nullptr, nullptr) == EGL_FALSE)
    throw GraphicsError(
        "EGL has no display without a surface here; Debian's libegl-mesa0 and libgl1-mesa-dri bring one");
  eglBindAPI(EGL_OPENGL_ES_API);
  const EGLint version[] = {EGL_CONTEXT_MAJOR_VERSION, 3, EGL_CONTEXT_MINOR_VERSION, 1, EGL_NONE};
  context_ = eglCreateContext(display_, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, version);
  if (context_ == EGL_NO_CONTEXT ||
      eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_) == EGL_FALSE)
    throw GraphicsError("EGL gives no context of OpenGL ES 3.1, which compute shaders need");
}

Context::~Context() {
  eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
  eglDestroyContext(display_, context_);
}

std::string Context::Renderer() const { return reinterpret_cast<const char*>(glGetString(GL_RENDERER)); }

std::string ReadShader(const std::string& folder, const std::string& name) {
  std::ifstream file(folder + "/" + name);
  if (!file) throw GraphicsError(folder + "/" + name + ": cannot be opened");
  std::string text;
  for (std::string line; std::getline(file, line);) {
    if (line.rfind("#include \"", 0) == 0)
      text += ReadShader(folder, line.substr(10, line.rfind('"') - 10));
    else if (line.rfind("#extension GL_GOOGLE_include_directive", 0) != 0)
      text += line + "\n";
  }
  return text;
}

GLuint PoseShaders::Compile(const std::string& folder, const std::string& name) {
  const std::string text = ReadShader(folder, name + ".comp.glsl");
  const char* begin = text.c_str();
  const GLuint program = glCreateShaderProgramv(GL_COMPUTE_SHADER, 1, &begin);
  GLint linked = GL_FALSE;
  glGetProgramiv(program, GL_LINK_STATUS, &linked);
  if (linked == GL_FALSE) {
    char log[4096] = "";
    glGetProgramInfoLog(program, sizeof log, nullptr, log);
    throw GraphicsError(name + ": " + log);
  }
  return program;
}

PoseShaders::PoseShaders(const std::string& folder) {
  for (const char* name : {"recover_twist", "recover_joints", "recover_scan", "recover_exact"})
    programs_[name] = Compile(folder, name);
  GLuint all[6];
  glGenBuffers(6, all);
  tables_ = all[0], numbers_ = all[1], frame_ = all[2], links_[0] = all[3], links_[1] = all[4],
  poses_ = all[5];
}

PoseShaders::~PoseShaders() {
  for (const auto& [name, program] : programs_) glDeleteProgram(program);
  for (const GLuint buffer : {tables_, numbers_, frame_, links_[0], links_[1], poses_})
    glDeleteBuffers(1, &buffer);
}

namespace {

void Fill(GLuint buffer, const void* data, std::size_t bytes, GLenum usage) {
  glBindBuffer(GL_SHADER_STORAGE_BUFFER, buffer);
  glBufferData(GL_SHADER_STORAGE_BUFFER, static_cast<GLsizeiptr>(bytes), data, usage);
}

constexpr std::size_t kMotion = 8 * sizeof(float);  // a link or a pose

}  // namespace

void PoseShaders::SetModel(const std::vector<std::int32_t>& tables, const std::vector<float>& numbers) {
  num_links_ = tables[2];
  num_bodies_ = tables[3];
  Fill(tables_, tables.data(), tables.size() * sizeof tables[0], GL_STATIC_DRAW);
  Fill(numbers_, numbers.data(), numbers.size() * sizeof numbers[0], GL_STATIC_DRAW);
  for (const GLuint links : links_)
    Fill(links, nullptr, kMotion * static_cast<std::size_t>(num_links_), GL_STREAM_COPY);
  Fill(poses_, nullptr, kMotion * static_cast<std::size_t>(num_bodies_), GL_STREAM_COPY);
}

void PoseShaders::SetFrame(const std::vector<float>& frame) {
  Fill(frame_, frame.data(), frame.size() * sizeof frame[0], GL_STREAM_DRAW);
}

void PoseShaders::Dispatch(GLuint program, int invocations) {
  glUseProgram(program);
  glDispatchCompute((static_cast<GLuint>(invocations) + 63) / 64, 1, 1);
  glMemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT);
}

void PoseShaders::RunTwist() {
  const GLuint bound[] = {tables_, numbers_, frame_, links_[0], links_[1], poses_};
  for (GLuint i = 0; i < 6; ++i) glBindBufferBase(GL_SHADER_STORAGE_BUFFER, i, bound[i]);
  Dispatch(programs_["recover_twist"], num_bodies_);
}

void PoseShaders::RunExact(int scans) {
  GLuint from = links_[0], to = links_[1];
  const GLuint bound[] = {tables_, numbers_, frame_, from, to, poses_};
  for (GLuint i = 0; i < 6; ++i) glBindBufferBase(GL_SHADER_STORAGE_BUFFER, i, bound[i]);
  Dispatch(programs_["recover_joints"], num_links_);
  for (int pass = 0; pass < scans; ++pass) {
    Dispatch(programs_["recover_scan"], num_links_);
    std::swap(from, to);  // what was written is read next
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 3, from);
    glBindBufferBase(GL_SHADER_STORAGE_BUFFER, 4, to);
  }
  Dispatch(programs_["recover_exact"], num_bodies_);
}

Poses PoseShaders::Read() const {
  Poses poses(8 * static_cast<std::size_t>(num_bodies_));
  glMemoryBarrier(GL_BUFFER_UPDATE_BARRIER_BIT);
  glBindBuffer(GL_SHADER_STORAGE_BUFFER, poses_);
  const auto bytes = static_cast<GLsizeiptr>(poses.size() * sizeof(float));
  if (const void* mapped = glMapBufferRange(GL_SHADER_STORAGE_BUFFER, 0, bytes, GL_MAP_READ_BIT)) {
    const auto* values = static_cast<const float*>(mapped);
    poses.assign(values, values + poses.size());
    glUnmapBuffer(GL_SHADER_STORAGE_BUFFER);
  }
  if (const GLenum error = glGetError(); error != GL_NO_ERROR)
    throw GraphicsError("OpenGL reports error " + std::to_string(error));
  return poses;
}

}  // namespace engine_poses
