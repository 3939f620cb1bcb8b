#include "mujoco_model.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fork1s/base/compiler_lock.hpp>
#include <fstream>
#include <iterator>
#include <mutex>
#include <regex>
#include <stdexcept>

#include "xml_checks.hpp"

namespace fork1s::internal {
namespace {

// MuJoCo reports through global function pointers. A simulation may step on another thread meanwhile: what
// MuJoCo says there does not belong to the compilation, so only the thread that compiles has a sink.
thread_local std::vector<std::string>* warnings_sink = nullptr;

class MujocoFault : public std::runtime_error {
 public:
  using std::runtime_error::runtime_error;
};

[[noreturn]] void ThrowFault(const char* message) { throw MujocoFault(message); }
void KeepWarning(const char* message) {
  if (warnings_sink != nullptr) warnings_sink->emplace_back(message);
}

class HandlerScope {
 public:
  explicit HandlerScope(std::vector<std::string>* sink)
      : lock_(CompilerLock()), error_(mju_user_error), warning_(mju_user_warning) {
    warnings_sink = sink;
    mju_user_error = ThrowFault;
    mju_user_warning = KeepWarning;
  }
  ~HandlerScope() {
    mju_user_error = error_;
    mju_user_warning = warning_;
    warnings_sink = nullptr;
  }
  HandlerScope(const HandlerScope&) = delete;
  HandlerScope& operator=(const HandlerScope&) = delete;

 private:
  std::lock_guard<std::mutex> lock_;
  void (*error_)(const char*);
  void (*warning_)(const char*);
};

struct VfsDeleter {
  void operator()(mjVFS* vfs) const {
    mj_deleteVFS(vfs);
    delete vfs;
  }
};
using Vfs = std::unique_ptr<mjVFS, VfsDeleter>;

bool AddToVfs(mjVFS* vfs, const std::string& name, const std::string& content) {
  if (mj_makeEmptyFileVFS(vfs, name.c_str(), static_cast<int>(content.size())) != 0) return false;
  const int i = mj_findFileVFS(vfs, name.c_str());
  if (i < 0) return false;
  std::copy(content.begin(), content.end(), static_cast<char*>(vfs->filedata[i]));
  return true;
}

std::string OneLine(std::string text) {
  std::replace(text.begin(), text.end(), '\n', ' ');
  static const std::regex spaces("\\s+");
  text = std::regex_replace(text, spaces, " ");
  while (!text.empty() && (text.back() == ' ' || text.back() == '.')) text.pop_back();
  return text;
}

std::string Remedy(const std::string& message) {
  const auto says = [&](const char* part) { return message.find(part) != std::string::npos; };
  if (says("unrecognized attribute") || says("unrecognized element") || says("invalid keyword")) {
    return "; if the word is right, it is newer than the MuJoCo 2.2.2 reader: remove it or write it the "
           "older way";
  }
  if (says("DEPTH_EXCEEDED") || says("nesting is too deep")) {
    return "; the reader stops at about 96 nested bodies: split the chain into two trees joined by a weld "
           "equality, or give it as URDF, which is not nested";
  }
  if (says("mass and inertia of moving bodies")) {
    return "; give the body an <inertial> with positive mass and inertia, or a geom with mass";
  }
  if (says("could not open") || says("Cannot open") || says("could not find") || says("resource not found")) {
    return "; put the file there, or mend 'file' and the compiler's meshdir";
  }
  if (says("balanceinertia")) {
    return "; correct the inertia, or set balanceinertia=\"true\" in <compiler>";
  }
  if (says("axis too small")) return "; give the joint a non-zero axis";
  if (says("repeated name")) return "; rename one of the two";
  if (says("negative")) return "; make it positive";
  if (says("invalid qpos size") || says("invalid ctrl size") || says("invalid qvel size")) {
    return "; a keyframe needs one number per coordinate, free joints included";
  }
  return "; correct the element";
}

// MuJoCo's message carries element and line in several shapes; we want "file, line N" and one sentence.
Error Translate(const ModelSource& source, const std::string& message) {
  Error error;
  error.where = source.path;
  std::smatch match;
  static const std::regex line_pattern("[Ll]ine(?: number)? ?= ?([0-9]+)|line ([0-9]+)");
  std::string line;
  if (std::regex_search(message, match, line_pattern)) {
    line = match[1].matched ? match[1].str() : match[2].str();
  }
  const bool format = message.rfind("XML", 0) == 0;
  error.code = format ? ErrorCode::kFormat : ErrorCode::kModel;
  std::string cause = message.substr(0, message.find("\nElement"));
  cause = cause.substr(0, cause.find("Object name ="));
  std::string object;
  static const std::regex object_pattern("Object name = ([^,\n]*),");
  if (std::regex_search(message, match, object_pattern) && !match[1].str().empty()) object = match[1].str();
  std::string element;
  static const std::regex element_pattern("Element '([^']*)'");
  if (std::regex_search(message, match, element_pattern)) element = match[1].str();

  static const std::regex attribute_pattern("unrecognized attribute: '([^']*)'");
  static const std::regex keyword_pattern("invalid keyword: '([^']*)'");
  std::optional<XmlPlace> place;
  if (std::regex_search(message, match, attribute_pattern)) {
    place = FindInXml(source.path, source.text, element, match[1].str(), "");
  } else if (std::regex_search(message, match, keyword_pattern)) {
    place = FindInXml(source.path, source.text, element, "", match[1].str());
  }
  if (place) {  // included files come without a line from MuJoCo
    error.where = place->file;
    line = std::to_string(place->line);
  }
  if (!line.empty() && line != "0") error.where += fmt::format(", line {}", line);
  cause = OneLine(cause);
  for (const char* prefix : {"XML Error: ", "Error: "}) {
    if (cause.rfind(prefix, 0) == 0) cause = cause.substr(std::string(prefix).size());
  }
  if (!element.empty()) cause = fmt::format("element '{}': {}", element, cause);
  if (!object.empty()) cause = fmt::format("'{}': {}", object, cause);
  error.message = cause + Remedy(message);
  return error;
}

std::optional<Error> FillVfs(const ModelSource& source, mjVFS* vfs) {
  for (const auto& [name, path] : source.files) {
    std::ifstream stream(path, std::ios::binary);
    const std::string content((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
    if (!stream.good() && content.empty()) {
      return Error{ErrorCode::kModel, source.path, fmt::format("mesh file '{}' cannot be read", path)};
    }
    if (!AddToVfs(vfs, name, content)) {
      return Error{ErrorCode::kModel, source.path,
                   fmt::format("too many mesh files: the reader takes {}", mjMAXVFS)};
    }
  }
  return std::nullopt;
}

}  // namespace

Expected<CompiledModel> CompileModel(const ModelSource& source) {
  CompiledModel compiled;
  char message[2048] = "";
  HandlerScope handlers(&compiled.warnings);
  try {
    if (source.text.empty()) {
      compiled.model.reset(mj_loadXML(source.path.c_str(), nullptr, message, sizeof message));
    } else {
      Vfs vfs(new mjVFS);
      mj_defaultVFS(vfs.get());
      if (auto error = FillVfs(source, vfs.get())) return tl::unexpected<Error>(*error);
      constexpr const char* kName = "fork1s_model.xml";
      if (!AddToVfs(vfs.get(), kName, source.text)) {
        return Fail(ErrorCode::kModel, source.path, "the model could not be handed to the reader");
      }
      compiled.model.reset(mj_loadXML(kName, vfs.get(), message, sizeof message));
    }
    if (!compiled.model) return tl::unexpected<Error>(Translate(source, message));
    compiled.data.reset(mj_makeData(compiled.model.get()));
    mj_kinematics(compiled.model.get(), compiled.data.get());
  } catch (const std::exception& fault) {
    return Fail(ErrorCode::kModel, source.path,
                fmt::format("the MuJoCo reader gave up: {}", OneLine(fault.what())));
  }
  return compiled;
}

}  // namespace fork1s::internal
