#include "mujoco_model.hpp"

#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <limits>
#include <mutex>
#include <regex>
#include <set>
#include <stdexcept>

#include <tinyxml2.h>

#include "base/compiler_lock.hpp"
#include "xml_checks.hpp"

// Exported by MuJoCo's library; no header of it declares them.
extern "C" {
int _mjPRIVATE__get_xml_precision(void);
void _mjPRIVATE__set_xml_precision(int precision);
}

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
void StoreWarning(const char* message) {
  if (warnings_sink != nullptr) warnings_sink->emplace_back(message);
}

class HandlerScope {
 public:
  explicit HandlerScope(std::vector<std::string>* sink)
      : lock_(CompilerLock()), error_(mju_user_error), warning_(mju_user_warning) {
    warnings_sink = sink;
    mju_user_error = ThrowFault;
    mju_user_warning = StoreWarning;
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

// Digits of the numbers that MuJoCo writes, which are six by default.
class XmlPrecision {
 public:
  explicit XmlPrecision(int digits) : before_(_mjPRIVATE__get_xml_precision()) {
    _mjPRIVATE__set_xml_precision(digits);
  }
  ~XmlPrecision() { _mjPRIVATE__set_xml_precision(before_); }
  XmlPrecision(const XmlPrecision&) = delete;
  XmlPrecision& operator=(const XmlPrecision&) = delete;

 private:
  int before_;
};

// MuJoCo's own plugins lie beside its library; a file may ask for one of them.
void LoadPlugins() {
  static std::once_flag once;
  std::call_once(once, [] {
    Dl_info info{};
    if (dladdr(reinterpret_cast<const void*>(&mj_versionString), &info) == 0) return;
    const std::filesystem::path plugin =
        std::filesystem::path(info.dli_fname).parent_path() / "plugin" / "libactuator.so";
    std::error_code ignored;
    if (std::filesystem::exists(plugin, ignored)) mj_loadPluginLibrary(plugin.c_str());
  });
}

bool AddToVfs(mjVFS* vfs, const std::string& name, const std::string& content) {
  return mj_addBufferVFS(vfs, name.c_str(), content.data(), static_cast<int>(content.size())) == 0;
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
    return fmt::format(
        "; if the word is right, this reader, MuJoCo {}, does not know it: remove it or write it the way "
        "that version does",
        mj_versionString());
  }
  if (says("DEPTH_EXCEEDED") || says("nesting is too deep")) {
    return "; the reader stops at about 96 nested bodies: split the chain into two trees joined by a weld "
           "equality, or give it as URDF, which is not nested";
  }
  if (says("allocate memory"))
    return "; memory is used up, close other programs, raise the limit (ulimit -v) or simplify the model";
  if (says("mass and inertia of moving bodies")) {
    return fmt::format(
        "; give the body an <inertial> with positive mass and inertia, or a geom with mass. A mechanism so small that "
        "its bodies are below MuJoCo's least, mjMINVAL = {0:g} kg and {0:g} kg m², is written in other units, such as "
        "millimetres and grams: gravity is then 9810",
        mjMINVAL);
  }
  if (says("could not open") || says("Cannot open") || says("could not find") || says("resource not found") ||
      says("Error opening file")) {
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

// The file of a mesh, height field or texture by its name, which is that of the file where none is given.
std::string FileOfAsset(const ModelSource& source, const std::string& name) {
  for (const auto& [key, path] : source.files)  // those that a URDF names
    if (std::filesystem::path(key).stem() == name) return path;
  std::string file;
  VisitXml(source.path, source.text, [&](const tinyxml2::XMLElement& element, const std::string&) {
    const std::string kind = element.Name();
    const char* own = element.Attribute("name");
    const char* from = element.Attribute("file");
    if ((kind != "mesh" && kind != "hfield" && kind != "texture") || from == nullptr) return false;
    if (name != (own != nullptr ? own : std::filesystem::path(from).stem().string())) return false;
    file = from;
    return true;
  });
  return file;
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
  cause = cause.substr(0, cause.find("Element name"));
  std::string object;
  static const std::regex object_pattern("Element name '([^'\n]*)',");
  if (std::regex_search(message, match, object_pattern) && !match[1].str().empty()) object = match[1].str();
  std::string element;
  static const std::regex element_pattern("Element '([^']*)'");
  if (std::regex_search(message, match, element_pattern)) element = match[1].str();

  static const std::regex attribute_pattern("unrecognized attribute: '([^']*)'");
  static const std::regex keyword_pattern("invalid keyword: '([^']*)'");
  static const std::regex file_pattern("Error opening file '([^']*)'");
  std::optional<XmlPlace> place;
  if (std::regex_search(message, match, attribute_pattern)) {
    place = FindInXml(source.path, source.text, element, match[1].str(), std::nullopt);
  } else if (std::regex_search(message, match, keyword_pattern)) {
    place = FindInXml(source.path, source.text, element, std::nullopt, match[1].str());
  } else if (std::regex_search(message, match, file_pattern)) {
    // The reader names the file, with the folder it looked in; the element that asks for it has the last part.
    const std::string name = match[1].str();
    for (const char* asset : {"mesh", "hfield", "texture", "model", "skin"})
      for (const std::string& value : {name, std::filesystem::path(name).filename().string()})
        if (!place) place = FindInXml(source.path, source.text, asset, "file", value);
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
  const std::string file = object.empty() ? "" : FileOfAsset(source, object);
  if (!file.empty() && cause.find(file) == std::string::npos)
    cause = fmt::format("'{}' of file '{}': {}", object, file, cause);
  else if (!object.empty())
    cause = fmt::format("'{}': {}", object, cause);
  error.message = cause + Remedy(message);
  return error;
}

std::unique_ptr<mjData, MjDataDeleter> DataAtReference(const mjModel& model) {
  std::unique_ptr<mjData, MjDataDeleter> data(mj_makeData(&model));
  mj_kinematics(&model, data.get());
  mj_comPos(&model, data.get());
  mj_tendon(&model, data.get());
  mj_transmission(&model, data.get());
  return data;
}

std::optional<Error> FillVfs(const ModelSource& source, mjVFS* vfs) {
  for (const auto& [name, path] : source.files) {
    const auto content = ReadFile(path);
    if (!content) {
      return Error{ErrorCode::kModel, source.path,
                   fmt::format("mesh file '{}': {}", path, content.error().message)};
    }
    if (!AddToVfs(vfs, name, *content)) {
      return Error{ErrorCode::kModel, source.path,
                   fmt::format("mesh file '{}' could not be handed to the reader", path)};
    }
  }
  for (const auto& [name, content] : source.buffers) {
    if (AddToVfs(vfs, name, content)) continue;
    return Error{ErrorCode::kModel, source.path,
                 fmt::format("file '{}' could not be handed to the reader", name)};
  }
  return std::nullopt;
}

tl::unexpected<Error> GaveUp(const std::string& path, const std::exception& fault) {
  return Fail(ErrorCode::kModel, path, fmt::format("the MuJoCo reader gave up: {}", OneLine(fault.what())));
}

}  // namespace

Expected<std::unique_ptr<mjData, MjDataDeleter>> ReferenceData(const mjModel& model,
                                                               const std::string& name) {
  HandlerScope handlers(nullptr);
  try {
    return DataAtReference(model);
  } catch (const std::exception& fault) {
    return GaveUp(name, fault);
  }
}

bool IsKnownPlugin(const std::string& name) {
  const HandlerScope handlers(nullptr);
  LoadPlugins();
  int slot = 0;
  return mjp_getPlugin(name.c_str(), &slot) != nullptr;
}

void EditableModel::VfsDeleter::operator()(mjVFS* vfs) const {
  mj_deleteVFS(vfs);
  delete vfs;
}

Expected<EditableModel> EditableModel::Parse(ModelSource source) {
  EditableModel out;
  out.source_ = std::move(source);
  HandlerScope handlers(&out.warnings_);
  LoadPlugins();
  constexpr const char* kName = "fork1s_model.xml";
  try {
    const bool is_text = !out.source_.text.empty();
    if (is_text || !out.source_.buffers.empty()) {
      out.vfs_.reset(new mjVFS);
      mj_defaultVFS(out.vfs_.get());
      if (auto error = FillVfs(out.source_, out.vfs_.get())) return tl::unexpected<Error>(*error);
      if (is_text && !AddToVfs(out.vfs_.get(), kName, out.source_.text))
        return Fail(ErrorCode::kModel, out.source_.path, "the model could not be handed to the reader");
    }
    char message[2048] = "";
    out.spec_.reset(
        mj_parseXML(is_text ? kName : out.source_.path.c_str(), out.vfs_.get(), message, sizeof message));
    if (!out.spec_) return tl::unexpected<Error>(Translate(out.source_, message));
  } catch (const std::exception& fault) {
    return GaveUp(out.source_.path, fault);
  }
  return out;
}

namespace {

// Operating length ranges of muscles, which MuJoCo finds by simulation; [0, 0] where it finds none. As its compiler
// does, by joints and their limits alone. Where the simulation diverges it may not begin again: it would never end.
void FindLengthRanges(const mjLROpt& options, mjModel& model) {
  std::unique_ptr<mjData, MjDataDeleter> data;
  const mjOption own = model.opt;
  model.opt.disableflags = mjDSBL_FRICTIONLOSS | mjDSBL_CONTACT | mjDSBL_SPRING | mjDSBL_DAMPER |
                           mjDSBL_GRAVITY | mjDSBL_ACTUATION | mjDSBL_AUTORESET;
  if (options.timestep > 0) model.opt.timestep = options.timestep;
  for (int i = 0; i < model.nactuator; ++i) {
    if (model.actuator_gaintype[i] != mjGAIN_MUSCLE && model.actuator_biastype[i] != mjBIAS_MUSCLE) continue;
    if (!data) data.reset(mj_makeData(&model));
    mjtNum* range = model.actuator_lengthrange + 2 * model.actuator_outadr[i];
    if (!mj_setLengthRange(&model, data.get(), i, &options, nullptr, 0)) range[0] = range[1] = 0;
  }
  model.opt = own;
}

// Takes their joints from the bodies that are only vertices or nodes of a flex, which nothing would hold
// together here, so that each stands still in its parent. Whether there were any; by the ids of the compiled model.
bool RemoveFlexJoints(const mjModel& model, mjSpec& spec) {
  if (model.nflex == 0) return false;
  std::set<int> vertices(model.flex_vertbodyid, model.flex_vertbodyid + model.nflexvert);
  vertices.insert(model.flex_nodebodyid, model.flex_nodebodyid + model.nflexnode);
  const auto holds_others = [&](int body) {
    for (int b = body + 1; b < model.nbody; ++b)
      if (model.body_parentid[b] == body && vertices.count(b) == 0) return true;
    return false;
  };
  std::vector<mjsElement*> joints;
  for (mjsElement* e = mjs_firstElement(&spec, mjOBJ_BODY); e != nullptr; e = mjs_nextElement(&spec, e)) {
    const int body = mjs_getId(e);
    if (vertices.count(body) == 0 || model.body_geomnum[body] > 0 || holds_others(body)) continue;
    mjsBody* of = mjs_asBody(e);
    for (mjsElement* j = mjs_firstChild(of, mjOBJ_JOINT, 0); j != nullptr; j = mjs_nextChild(of, j, 0))
      joints.push_back(j);
  }
  for (mjsElement* joint : joints) mjs_delete(&spec, joint);
  return !joints.empty();
}

}  // namespace

Expected<CompiledModel> EditableModel::Compile() {
  CompiledModel compiled;
  compiled.warnings = warnings_;
  HandlerScope handlers(&compiled.warnings);
  // Without the lengths that muscles can reach: the compiler refuses the file where it finds none for one of them.
  const int length_ranges = spec_->compiler.LRopt.mode;
  spec_->compiler.LRopt.mode = mjLRMODE_NONE;
  try {
    compiled.model.reset(mj_compile(spec_.get(), vfs_.get()));
    if (compiled.model && RemoveFlexJoints(*compiled.model, *spec_)) {
      compiled.warnings = warnings_;  // they come again
      compiled.model.reset(mj_compile(spec_.get(), vfs_.get()));
    }
    spec_->compiler.LRopt.mode = length_ranges;
    if (!compiled.model) {
      const char* message = mjs_getError(spec_.get());
      return tl::unexpected<Error>(Translate(source_, message != nullptr ? message : ""));
    }
    mjLROpt options = spec_->compiler.LRopt;
    if (options.mode == mjLRMODE_NONE) options.mode = mjLRMODE_MUSCLE;
    const std::size_t num_warnings = compiled.warnings.size();
    FindLengthRanges(options, *compiled.model);
    compiled.warnings.resize(num_warnings);  // of the file, not of that simulation
    compiled.data = DataAtReference(*compiled.model);
  } catch (const std::exception& fault) {
    return GaveUp(source_.path, fault);
  }
  return compiled;
}

Expected<std::string> EditableModel::Text() const {
  HandlerScope handlers(nullptr);
  const XmlPrecision all_digits(std::numeric_limits<double>::digits10);
  char message[1024] = "";
  std::string text(1 << 16, '\0');
  try {
    // The size that it needs is its answer where the buffer is too short.
    int size =
        mj_saveXMLString(spec_.get(), text.data(), static_cast<int>(text.size()), message, sizeof message);
    if (size > 0) {
      text.resize(static_cast<std::size_t>(size) + 1);
      size =
          mj_saveXMLString(spec_.get(), text.data(), static_cast<int>(text.size()), message, sizeof message);
    }
    if (size != 0)
      return Fail(ErrorCode::kModel, source_.path,
                  fmt::format("MuJoCo cannot write it as MJCF: {}", OneLine(message)));
  } catch (const std::exception& fault) {
    return GaveUp(source_.path, fault);
  }
  text.resize(text.find('\0'));
  return text;
}

Expected<CompiledModel> CompileModel(const ModelSource& source) {
  auto model = EditableModel::Parse(source);
  if (!model) return tl::unexpected<Error>(model.error());
  return model->Compile();
}

}  // namespace fork1s::internal
