#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <fork1s/importer/importer.hpp>
#include <fork1s/mechanism/mechanism.hpp>
#include <set>

#include "bounds.hpp"
#include "conversion.hpp"
#include "importer/model_copy.hpp"
#include "importer/mujoco_import.hpp"
#include "mechanism/sensor_stiffness.hpp"
#include "mujoco_model.hpp"
#include "names.hpp"
#include "prepared_model.hpp"
#include "sensor_plugins.hpp"
#include "xml_checks.hpp"

namespace fork1s {
namespace {

using internal::Conversion;

// Names for the nameless, different from all names there are.
std::vector<std::string> Names(const mjModel& m, mjtSize count, const int* addresses, const char* kind) {
  std::set<std::string> taken;
  for (int i = 0; i < count; ++i) taken.insert(m.names + addresses[i]);
  std::vector<std::string> names;
  for (int i = 0; i < count; ++i) {
    std::string name = internal::NameOr(m, addresses[i], kind, i);
    while (m.names[addresses[i]] == '\0' && taken.count(name) > 0) name += '_';
    names.push_back(std::move(name));
  }
  return names;
}

void SetUp(Conversion& c) {
  const mjModel& m = c.m;
  const auto nv = static_cast<std::size_t>(m.nv);
  c.body.resize(m.nbody);
  c.joint.resize(m.njnt);
  c.rigid_root.assign(m.nbody, false);
  c.used_equality.assign(m.neq, false);
  c.switched_by_name.assign(m.neq, false);
  c.k.assign(nv, 0);
  c.c.assign(nv, 0);
  c.held_by.resize(nv);
  c.in_spring.assign(nv, false);
  c.coupled.assign(nv, false);
  c.body_names = Names(m, m.nbody, m.name_bodyadr, "body");
  c.joint_names = Names(m, m.njnt, m.name_jntadr, "joint");
  c.actuator_names = Names(m, m.nactuator, m.name_actuatoradr, "actuator");
  c.sensor_names = Names(m, m.nsensor, m.name_sensoradr, "sensor");
  const std::string name = m.names;
  c.scene.name = name.empty() || name == "MuJoCo Model" ? internal::Stem(c.file) : name;
  c.scene.gravity = Vector3(m.opt.gravity[0], m.opt.gravity[1], m.opt.gravity[2]);
  if (m.opt.disableflags & mjDSBL_GRAVITY) c.scene.gravity.setZero();
  // Steps of files are sized for explicit springs; taking them over would waste what the implicit step is
  // for.
  if (c.report.format == "MJCF" && std::abs(m.opt.timestep - c.scene.timestep) > 1e-5) {
    c.Note(ImportNote::Kind::kChosen, "option timestep",
           fmt::format("steps of 1/60 s are taken, not the file's {} s; the option dt sets others",
                       m.opt.timestep));
  }
}

// A model file as MuJoCo is to read it.
Expected<ImportedScene> Import(const internal::PreparedModel& prepared, const ImportOptions& options) {
  auto model = internal::ParsePrepared(prepared);
  if (!model) return tl::unexpected<Error>(model.error());
  const auto compiled = model->Compile();
  if (!compiled) return tl::unexpected<Error>(compiled.error());
  Conversion c(*compiled->model, *compiled->data, prepared.source.path);
  if (auto error = ConvertPrepared(c, prepared, compiled->warnings, options))
    return tl::unexpected<Error>(std::move(*error));
  return internal::MoveOut(c);
}

// A file of Gazebo: <sdf>, <gazebo> of its first versions, or another root in a file of its extensions.
bool IsSdformat(const std::string& path, const std::string& root) {
  const std::string extension = std::filesystem::path(path).extension().string();
  const bool is_other_format = root == "mujoco" || root == "mujocoinclude" || root == "robot";
  return root == "sdf" || root == "gazebo" ||
         (!is_other_format && (extension == ".sdf" || extension == ".world"));
}

Error RefuseSdformat(const std::string& path) {
  const std::filesystem::path file(path);
  const std::string out = file.stem().string() + (file.extension() == ".xml" ? "_mjcf.xml" : ".xml");
  return {
      ErrorCode::kFormat, path,
      fmt::format("is a file of Gazebo (SDFormat), which is not read; MJCF and URDF are. Convert it with "
                  "sdf2mjcf of the Python package sdformat-mjcf (https://github.com/gazebosim/gz-mujoco): "
                  "sdf2mjcf {} {}; or give the URDF that it was made from",
                  file.filename().string(), out)};
}

bool ContainsRobotTag(const std::string& text) { return text.find("<robot") != std::string::npos; }

Expected<internal::PreparedModel> PrepareText(const std::string& path, std::string text, bool on_disk,
                                              const ImportOptions& options) {
  auto root = internal::RootElement(path, text);
  int declaration_line = 0;
  if (!root && ContainsRobotTag(text)) {
    declaration_line = internal::RemoveLateDeclaration(text);
    if (declaration_line > 0) root = internal::RootElement(path, text);
  }
  if (!root) return tl::unexpected<Error>(root.error());
  if (IsSdformat(path, *root)) return tl::unexpected<Error>(RefuseSdformat(path));
  if (*root != "mujoco" && *root != "robot" && *root != "mujocoinclude") {
    return Fail(
        ErrorCode::kFormat, path,
        fmt::format("the root element is <{}>; <mujoco> (MJCF) or <robot> (URDF) is expected", *root));
  }
  if (auto error = internal::CheckNumbers(path, text)) return tl::unexpected<Error>(std::move(*error));
  if (*root == "robot") {
    auto urdf = internal::PrepareUrdf(path, text, options);
    if (!urdf) return tl::unexpected<Error>(urdf.error());
    if (declaration_line > 0) {
      urdf->notes.push_back({ImportNote::Kind::kChanged, fmt::format("line {}", declaration_line),
                             "the XML declaration is not at the beginning, so it was skipped"});
    }
    return internal::PreparedModel{std::move(*urdf), true};
  }
  if (!options.packages.empty()) {
    return Fail(ErrorCode::kUsage, fmt::format("{}, option package", path),
                "this is MJCF, which names its files by path: only URDF speaks of packages");
  }
  if (auto error = internal::CheckBounds(path, text)) return tl::unexpected<Error>(std::move(*error));
  internal::PreparedModel prepared;
  prepared.source.path = path;
  if (auto error = internal::RemoveSensorPlugins(path, text, prepared))
    return tl::unexpected<Error>(std::move(*error));
  if (on_disk) return prepared;
  const auto changed = prepared.source.buffers.extract(path);
  prepared.source.text = changed ? changed.mapped() : std::move(text);
  return prepared;
}

const char* Name(ImportNote::Kind kind) {
  switch (kind) {
    case ImportNote::Kind::kDropped:
      return "dropped";
    case ImportNote::Kind::kChanged:
      return "changed";
    case ImportNote::Kind::kChosen:
      return "chosen";
  }
  return "";
}

}  // namespace

namespace internal {

std::optional<Error> Convert(Conversion& c, const ImportOptions& options, const std::vector<Mimic>& mimics) {
  SetUp(c);
  if (auto error = FindSwitchedByName(c, options)) return error;
  if (auto error = Validate(c)) return error;
  if (auto error = CheckJointEqualities(c)) return error;
  if (auto error = FindWantedBase(c, options)) return error;
  if (auto error = FindComponents(c)) return error;
  if (c.components.empty()) {
    return c.ModelError("", "nothing in the file can move: it has no joint that this program simulates");
  }
  ConvertBodies(c);
  ConvertGeoms(c);
  ListDoubtfulMeshes(c);
  ConvertSprings(c);
  ConvertActuators(c);
  ConvertEqualities(c);
  ConvertSwitchedEqualities(c);
  if (auto error = ConvertMimics(c, mimics)) return error;
  ListUnsupported(c);
  if (auto error = ApplyCustom(c, options)) return error;
  AddSwitchedInterfaces(c);
  if (auto error = ConvertKeyframes(c, options.keyframe)) return error;
  ConvertLengthLimits(c);
  if (auto error = ApplyInitialState(c, options, mimics)) return error;
  if (auto error = ApplyGround(c, options)) return error;
  if (auto error = ExcludeOverlaps(c)) return error;
  if (auto error = ApplyPd(c, options)) return error;
  if (auto error = ApplyHold(c, options)) return error;
  ConvertSensors(c);
  ConvertBoundedForces(c);
  FinishSprings(c);
  ListHolds(c);
  if (!(options.stiffness_scale > 0) || !std::isfinite(options.stiffness_scale)) {
    return Error{ErrorCode::kUsage, "option stiffness-scale",
                 fmt::format("{} is no finite number above 0", options.stiffness_scale)};
  }
  if (options.stiffness_scale != 1) {
    Scene actuators;
    actuators.mechanisms = c.scene.mechanisms;
    actuators.sensors = std::move(c.actuators);
    ScaleSensorLaws(options.stiffness_scale, actuators);
    c.actuators = std::move(actuators.sensors);
    for (MechanismDef& mechanism : c.scene.mechanisms) {
      mechanism = ScaleStiffness(std::move(mechanism), options.stiffness_scale);
    }
    ScaleSensorLaws(options.stiffness_scale, c.scene);
    for (ServoGains& servo : c.report.servos) {
      servo.stiffness *= options.stiffness_scale;
      servo.bias *= options.stiffness_scale;
      servo.damping *= std::sqrt(options.stiffness_scale);
    }
  }
  return std::nullopt;
}

std::optional<Error> ConvertPrepared(Conversion& c, const PreparedModel& prepared,
                                     const std::vector<std::string>& warnings, const ImportOptions& options) {
  c.report.format = prepared.is_urdf ? "URDF" : "MJCF";
  c.is_urdf = prepared.is_urdf;
  c.self_colliding = prepared.extensions.self_colliding;
  c.report.notes = prepared.notes;
  c.report.velocity_limits = prepared.velocity_limits;
  c.start = prepared.extensions.start;
  for (const UrdfLoop& loop : prepared.extensions.loops)
    if (loop.kind == UrdfLoop::Kind::kHinge) c.hinges.insert(loop.name);
  for (const std::string& warning : warnings) {
    // MuJoCo's trial step at qpos0 warns about motion that our own solver decides on.
    if (warning.find("Time =") != std::string::npos) continue;
    c.Note(ImportNote::Kind::kChanged, "MuJoCo reader", warning);
  }
  return Convert(c, options, prepared.mimics);
}

Expected<EditableModel> ParsePrepared(const PreparedModel& prepared) {
  auto model = EditableModel::Parse(prepared.source);
  if (model) AddExtensions(model->spec(), prepared.extensions);
  return model;
}

Expected<PreparedModel> PrepareModel(const std::string& path, const ImportOptions& options) {
  const auto text = ReadFile(path);
  if (!text) return tl::unexpected<Error>(text.error());
  if (text->empty()) return Fail(ErrorCode::kFormat, path, "the file is empty; MJCF or URDF is expected");
  return PrepareText(path, *text, true, options);
}

}  // namespace internal

std::string ImportNote::Text() const { return fmt::format("{}: {}: {}", Name(kind), where, message); }

Expected<ImportedScene> LoadMechanism(const std::string& path, const ImportOptions& options) {
  const auto prepared = internal::PrepareModel(path, options);
  if (!prepared) return tl::unexpected<Error>(prepared.error());
  return Import(*prepared, options);
}

Expected<std::string> MomentAsMjcf(const std::string& path, const ImportOptions& options,
                                   const KeyframeDef& state, const std::string& name, double time) {
  const auto text = internal::ReadFile(path);
  if (!text) return tl::unexpected<Error>(text.error());
  const auto root = internal::RootElement(path, *text);
  if (!root || *root != "mujoco")
    return Fail(ErrorCode::kModel, path, "is no MJCF, which alone has keyframes; save a recording instead");
  const auto prepared = internal::PrepareModel(path, options);
  if (!prepared) return tl::unexpected<Error>(prepared.error());
  const auto compiled = internal::CompileModel(prepared->source);
  if (!compiled) return tl::unexpected<Error>(compiled.error());
  Conversion c(*compiled->model, *compiled->data, path);
  c.report.format = "MJCF";
  if (auto error = Convert(c, options, {})) return tl::unexpected<Error>(std::move(*error));
  if (c.scene.mechanisms.size() != state.mechanisms.size() ||
      c.scene.free_bodies.size() != state.free_bodies.size())
    return Fail(ErrorCode::kModel, path,
                "has changed: it has other mechanisms or free bodies than the state");
  return internal::MomentText(c, state, name, time);
}

Expected<ImportedScene> LoadMechanismFromString(const std::string& mjcf, const std::string& name,
                                                const ImportOptions& options) {
  if (mjcf.empty()) return Fail(ErrorCode::kFormat, name, "the text is empty; MJCF is expected");
  const auto prepared = PrepareText(name, mjcf, false, options);
  if (!prepared) return tl::unexpected<Error>(prepared.error());
  return Import(*prepared, options);
}

std::string MujocoVersion() { return mj_versionString(); }

Expected<ImportedScene> LoadMujocoModel(const mjModel_& model, const std::string& name,
                                        const ImportOptions& options) {
  const auto data = internal::ReferenceData(model, name);
  if (!data) return tl::unexpected<Error>(data.error());
  Conversion c(model, **data, name);
  c.report.format = "MJCF";
  if (!options.packages.empty())
    return Fail(ErrorCode::kUsage, fmt::format("{}, option package", name),
                "this model is compiled, its files are read: only URDF speaks of packages");
  if (auto error = Convert(c, options, {})) return tl::unexpected<Error>(std::move(*error));
  return internal::MoveOut(c);
}

}  // namespace fork1s
