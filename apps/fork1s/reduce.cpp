#include <fmt/format.h>
#include <algorithm>
#include <chrono>
#include <cmath>
#include <filesystem>
#include <fork1s/record/recovery_buffers.hpp>
#include <fork1s/record/reduced_model_file.hpp>
#include <fork1s/reduction/compliance.hpp>
#include <fork1s/reduction/free_motion.hpp>
#include <fork1s/reduction/frequencies.hpp>
#include <iterator>
#include <memory>

#include "checks.hpp"
#include "gain.hpp"
#include "mode_line.hpp"
#include "model_arguments.hpp"
#include "output.hpp"
#include "point_output.hpp"
#include "print.hpp"
#include "study/deflection.hpp"
#include "study/linear_model.hpp"

namespace fork1s::app {
namespace {

// [{body, joints, ties, motion, text}]: motions of interface bodies that no spring resists.
Json FreeMotionsJson(const Mechanism& m, const VectorX& q, const std::vector<BodyIndex>& interfaces) {
  Json all = Json::array();
  for (const FreeMotion& motion : FindFreeMotions(m, q, interfaces)) {
    Json one;
    one["body"] = motion.body.valid() ? Json(m.body(motion.body).name) : Json(nullptr);
    one["motion_world"] = std::vector<double>(motion.twist.data(), motion.twist.data() + 6);
    one["joints"] = Json::array();
    for (const JointIndex j : motion.joints) one["joints"].push_back(m.joint(j).name);
    one["ties"] = motion.ties;
    one["text"] = motion.Text(m);
    all.push_back(std::move(one));
  }
  return all;
}

// Stiffness, frequencies and compliance about the equilibrium under load; null where there is none.
Json LoadedJson(const Expected<LoadedState>& loaded, double length) {
  if (!loaded) return nullptr;
  const TangentStiffness& tangent = loaded->tangent;
  Json out;
  out["stable"] = tangent.IsStable();
  out["lowest_stiffness_Nm"] = tangent.lowest();
  out["frequencies_hz"] = loaded->modes.hertz;
  out["mode_pairs"] = Json::array();
  for (const ModePair& pair : loaded->pairs)
    out["mode_pairs"].push_back(pair.mode < 0 ? Json(nullptr)
                                              : Json{{"mode", pair.mode}, {"agreement", pair.agreement}});
  out["compliance_world"] = loaded->compliance.free.cols() > 0 ? Json(nullptr) : ToJson(loaded->compliance.C);
  out["stiffness_world"] = ToJson(StiffnessFromCompliance(loaded->compliance, length));
  out["base_held"] = true;
  return out;
}

Expected<Json> ReduceOne(const PosedMechanism& posed, const Scene& scene, OnFreeMotion on_free,
                         const std::vector<NamedPoint>& points, const std::optional<Vector3>& along,
                         ReducedModel& model) {
  const Mechanism& m = *posed.mechanism;
  const auto start = std::chrono::steady_clock::now();
  auto reduced = ReduceAtStart(posed);
  const std::chrono::duration<double, std::milli> spent = std::chrono::steady_clock::now() - start;
  if (!reduced) return tl::unexpected(reduced.error());
  model = std::move(*reduced);

  Json out;
  out["name"] = m.name();
  out["mass_kg"] = m.total_mass();
  const bool floats = m.base() == BaseKind::kFloating;
  out["dofs"] = m.num_coordinates() - model.loop_rank() + (floats ? 6 : 0);
  out["loop_rank"] = model.loop_rank();
  out["interfaces"] = Json::array();
  for (BodyIndex b : model.interfaces) out["interfaces"].push_back(m.body(b).name);

  Json warnings = Json::array();
  for (const std::string& w : model.warnings) warnings.push_back(w);
  // Without a lock the bodies that no spring holds have no compliance, and none is printed.
  std::vector<BodyIndex> held_bodies = model.interfaces;
  if (on_free == OnFreeMotion::kLock)
    for (const NamedPoint& point : points) held_bodies.push_back(m.FindBody(point.body));
  const auto locked = CoordinatesToLock(m, posed.q, held_bodies, on_free);
  const std::vector<int> held = locked.value_or(std::vector<int>{});
  // By two methods, which share no decision; where they part the figure is not to be trusted.
  const InterfaceCompliance compliance = WalkCompliance(m, posed.q, model.interfaces, held);
  const double apart =
      ComplianceDifference(compliance, DenseCompliance(m, posed.q, model.interfaces, held), m.length_scale());
  constexpr double kApart = 1e-6;  // seven orders above rounding
  if (!(apart < kApart))
    warnings.push_back(fmt::format(
        "two computations of the compliance of '{}' differ by {:.2g} of it: take neither as right, and report "
        "this model",
        m.name(), apart));
  const Json C = locked ? ToJson(compliance.C) : Json(nullptr);
  const Json K = locked ? ToJson(StiffnessFromCompliance(compliance, m.length_scale())) : Json(nullptr);
  out["compliance_rank"] = compliance.rank;
  out["free_motions"] = FreeMotionsJson(m, posed.q, model.interfaces);
  out["compliance_world"] = floats ? Json(nullptr) : C;
  if (floats) out["compliance_world_base_held"] = C;
  out["stiffness_world"] = floats ? Json(nullptr) : K;
  out["compliance_locked"] = Json::array();
  for (const int i : held) out["compliance_locked"].push_back(m.CoordinateName(i));
  const int count = std::max(8, std::min(model.size(), 16));
  out["frequencies_hz"] = {{"full", FullFrequencies(m, posed.q, count)},
                           {"reduced", ReducedFrequencies(model, count)}};
  const auto loaded = ComputeLoadedState(posed, model.interfaces, scene.gravity, held, count);
  out["loaded"] = LoadedJson(loaded, m.length_scale());
  std::vector<MeasuredPoint> measured;
  for (const NamedPoint& point : points)
    measured.push_back(MeasurePoint(posed, point, held, loaded ? &*loaded : nullptr));
  out["points"] = PointsJson(measured, along);
  if (!loaded) warnings.push_back(loaded.error().message);
  if (loaded && !loaded->tangent.IsStable())
    warnings.push_back(
        fmt::format("the equilibrium under gravity, controls and preload is unstable (lowest eigenvalue of "
                    "its stiffness {:.4g} "
                    "N m/rad): it has no frequencies, and a slight push makes the mechanism leave it",
                    loaded->tangent.lowest()));
  out["coordinates"] = {{"elastic", model.num_elastic},
                        {"free", model.num_free},
                        {"modes", model.num_modes},
                        {"loads", model.num_loads}};
  out["mode_selection"] = ModesJson(model);
  out["column_names"] = model.column_names;
  out["reduction_ms"] = spent.count();
  out["gain"] = GainJson(MeasureInterfaceGain(posed, model, scene.timestep));
  out["warnings"] = std::move(warnings);
  return out;
}

void PrintFrequencies(const Json& d) {
  const auto &full = d["frequencies_hz"]["full"], &reduced = d["frequencies_hz"]["reduced"];
  const Json none = Json::array();
  const Json& loaded = d["loaded"].is_null() ? none : d["loaded"]["frequencies_hz"];
  const Json& pairs = d["loaded"].is_null() ? none : d["loaded"]["mode_pairs"];
  const auto hertz = [](const Json& all, std::size_t i, const char* otherwise) {
    return i < all.size() ? fmt::format("{:.6g}", all[i].get<double>()) : std::string(otherwise);
  };
  PrintText(
      "  frequencies of the springs alone (full and reduced) and about the equilibrium under gravity, "
      "controls and\n  preload, base held (loaded), of the mode with the same shape, and how far it is:\n");
  PrintText("  {:>6}  {:>12}  {:>12}  {:>8}  {:>12}  {:>8}\n", "mode", "full Hz", "reduced Hz", "off %",
            "loaded Hz", "shape %");
  std::vector<bool> is_paired(loaded.size());
  for (std::size_t i = 0; i < full.size(); ++i) {
    std::string loaded_hertz = "-", agreement;
    if (i < pairs.size() && !pairs[i].is_null()) {
      const auto mode = pairs[i]["mode"].get<std::size_t>();
      is_paired[mode] = true;
      loaded_hertz = hertz(loaded, mode, "-");
      agreement = fmt::format("{:.1f}", 100 * pairs[i]["agreement"].get<double>());
    }
    PrintText("  {:>6}  {:>12}  {:>12}  {:>8}  {:>12}  {:>8}\n", i + 1, hertz(full, i, "-"),
              hertz(reduced, i, "left out"),
              i < reduced.size()
                  ? fmt::format("{:.3f}", 100 * (reduced[i].get<double>() / full[i].get<double>() - 1))
                  : "",
              loaded_hertz, agreement);
  }
  for (std::size_t i = 0; i < loaded.size(); ++i)
    if (!is_paired[i])
      PrintText("  {:>6}  {:>12}  {:>12}  {:>8}  {:>12}\n", "-", "-", "-", "", hertz(loaded, i, "-"));
}

void PrintCompliance(const Json& interfaces, const Json& C, const std::string& of_what) {
  if (C.is_null()) return;
  PrintText("  compliance of each interface body, world axes (diagonal; rad/(N m), m/N; {}):\n", of_what);
  constexpr double kRounding =
      1e-12;  // beside the largest of its kind: a hinge does not turn across its axis
  double largest[2] = {0, 0};
  for (std::size_t i = 0; i < C.size(); ++i)
    largest[i % 6 / 3] = std::max(largest[i % 6 / 3], std::abs(C[i][i].get<double>()));
  for (std::size_t e = 0; e < interfaces.size(); ++e) {
    PrintText("    {:<20}", interfaces[e].get<std::string>());
    for (std::size_t i = 6 * e; i < 6 * e + 6; ++i) {
      const double value = C[i][i].get<double>();
      PrintText(" {:>10.4g}", std::abs(value) > kRounding * largest[i % 6 / 3] ? value : 0.0);
    }
    PrintText("\n");
  }
}

void Print(const Json& d, const Mechanism& m) {
  PrintText("mechanism '{}': {:.6g} kg, {} degrees of freedom, loop rank {}\n", d["name"].get<std::string>(),
            d["mass_kg"].get<double>(), d["dofs"].get<int>(), d["loop_rank"].get<int>());
  std::string names;
  for (const Json& b : d["interfaces"]) names += (names.empty() ? "" : ", ") + b.get<std::string>();
  PrintText("  interface: {}\n", names);
  const Json& c = d["coordinates"];
  PrintText(
      "  reduced coordinates: {} elastic, {} free, {} modes, {} loads (of {} joint coordinates), in {:.2f} "
      "ms\n",
      c["elastic"].get<int>(), c["free"].get<int>(), c["modes"].get<int>(), c["loads"].get<int>(),
      m.num_coordinates(), d["reduction_ms"].get<double>());
  PrintText("  {}\n", ModeLine(d["mode_selection"]));
  PrintFrequencies(d);
  const bool base_held = d.contains("compliance_world_base_held");
  const Json& C = base_held ? d["compliance_world_base_held"] : d["compliance_world"];
  std::string held = base_held ? "; base held" : "";
  for (const Json& name : d["compliance_locked"]) held += "; '" + name.get<std::string>() + "' locked";
  PrintCompliance(d["interfaces"], C, "of the springs alone" + held);
  if (const Json& loaded = d["loaded"]; !loaded.is_null())
    PrintCompliance(d["interfaces"], loaded["compliance_world"], "about the loaded equilibrium" + held);
  PrintPoints(d["points"]);
  if (!d["free_motions"].empty()) {
    PrintText("  free of springs ({}){}:\n", d["free_motions"].size(),
              C.is_null() ? ", so that the compliance of the springs has no bound; --lock-free gives it "
                            "with one joint of each locked"
                          : "");
    for (const Json& motion : d["free_motions"]) PrintText("    {}\n", motion["text"].get<std::string>());
  }
  PrintGain(d["gain"]);
  for (const Json& w : d["warnings"]) PrintText("  warning: {}\n", w.get<std::string>());
}

// --out: endings that are known. Files without one are HDF5, as they always were.
Expected<void> RequireKnownEnding(const std::string& path) {
  const std::string ending = std::filesystem::path(path).extension().string();
  for (const char* known : {"", ".h5", ".hdf5", ".mat", ".npz"})
    if (ending == known) return {};
  return Fail(
      ErrorCode::kFile, path,
      fmt::format(
          "the ending '{}' is not known; known are .h5 and .hdf5 (HDF5, the whole reduced model), .mat "
          "(MATLAB) and .npz (NumPy; the matrices of its equations of motion)",
          ending));
}

// The file of the first mechanism, or FILE.2.h5 of the second and so on.
std::string FileOf(const std::string& path, std::size_t mechanism) {
  if (mechanism == 0) return path;
  const std::filesystem::path of_first(path);
  return (of_first.parent_path() /
          fmt::format("{}.{}{}", of_first.stem().string(), mechanism + 1, of_first.extension().string()))
      .string();
}

Expected<void> WriteModel(const PosedMechanism& posed, const ReducedModel& reduced, const std::string& path) {
  const std::string ending = std::filesystem::path(path).extension().string();
  if (ending != ".mat" && ending != ".npz") return SaveReducedModel(reduced, path);
  return SaveLinearModel(ComputeLinearModel(posed, reduced), path);
}

// --buffers: of a simulation as `run` begins it, since that has the coordinates that a host gets.
Expected<void> WriteBuffers(const ImportedScene& imported, Recovery recovery, const std::string& folder) {
  SimulationOptions options;
  options.initial_keyframe = imported.initial_keyframe;
  options.recovery = recovery;
  auto simulation = Simulation::Create(imported.scene, options);
  if (!simulation) return tl::unexpected(simulation.error());
  return SaveRecoveryBuffers(*simulation, folder);
}

}  // namespace

void AddReduce(CLI::App& app, Action& action) {
  auto* command = app.add_subcommand(
      "reduce", "compliance and frequencies without and under load, size of the reduced model");
  auto model = std::make_shared<ModelArguments>();
  auto file = std::make_shared<std::string>();
  auto buffers = std::make_shared<std::string>();
  auto points = std::make_shared<PointArguments>();
  auto recovery = std::make_shared<Recovery>(Recovery::kExact);
  auto lock_free = std::make_shared<bool>(false);
  model->AddTo(*command);
  command->add_flag(
      "--lock-free", *lock_free,
      "compliance with a joint locked for each motion that no spring resists; without it there is none "
      "where such a motion moves an interface body");
  points->AddTo(
      *command,
      "BODY:x,y,z in m from the body's origin, in its axes: a point at which compliance and stiffness "
      "are measured; may be repeated");
  command->add_option(
      "--out", *file,
      "write the reduced model to this file: HDF5 (.h5), or its equations of motion as matrices with names "
      "and units for MATLAB (.mat) or NumPy (.npz); further mechanisms go to FILE.2.h5 and so on");
  auto* folder = command->add_option(
      "--buffers", *buffers,
      "write recovery.json and recovery.bin, by which shaders pose all bodies, into this folder");
  AddRecoveryTo(*command, *recovery);
  command->get_option("--recovery")->needs(folder);
  command->callback([&action, model, file, buffers, points, recovery, lock_free] {
    action = [model, file, buffers, points, recovery, lock_free]() -> int {
      if (auto ok = RefuseInputs(*file, {model->path}); !ok) return Report(ok.error(), model->json);
      if (!file->empty())
        if (auto ok = RequireKnownEnding(*file); !ok) return Report(ok.error(), model->json);
      const auto along = points->Direction();
      if (!along) return Report(along.error(), model->json);
      const auto named = points->Points("");
      if (!named) return Report(named.error(), model->json);
      auto imported = model->Load();
      if (!imported) return Report(imported.error(), model->json);
      auto posed = PoseMechanisms(*imported);
      if (!posed) return Report(posed.error(), model->json);
      if (posed->empty())
        return Report(
            {ErrorCode::kModel, model->path, "holds no mechanism, only free bodies; nothing can be reduced"},
            model->json);
      for (const NamedPoint& point : *named)
        if (!FindMechanism(*posed, point.body))
          return Report({ErrorCode::kUsage, model->path + ", --point",
                         fmt::format("no mechanism has a body '{}'", point.body)},
                        model->json);
      if (!model->json) PrintNotes(imported->report);
      std::vector<Json> all;
      for (std::size_t i = 0; i < posed->size(); ++i) {
        ReducedModel reduced;
        std::vector<NamedPoint> its_points;
        std::copy_if(
            named->begin(), named->end(), std::back_inserter(its_points),
            [&](const NamedPoint& point) { return FindMechanism(*posed, point.body) == &(*posed)[i]; });
        auto one =
            ReduceOne((*posed)[i], imported->scene, *lock_free ? OnFreeMotion::kLock : OnFreeMotion::kRefuse,
                      its_points, *along, reduced);
        if (!one) {
          Error error = one.error();
          error.where = model->path + ": " + error.where;
          return Report(error, model->json);
        }
        if (!file->empty()) {
          const std::string path = FileOf(*file, i);
          if (auto saved = WriteModel((*posed)[i], reduced, path); !saved)
            return Report(saved.error(), model->json);
          if (!model->json) PrintText(stderr, "wrote {}\n", path);
        }
        if (!model->json) Print(*one, *(*posed)[i].mechanism);
        all.push_back(std::move(*one));
      }
      if (!buffers->empty()) {
        if (auto saved = WriteBuffers(*imported, *recovery, *buffers); !saved)
          return Report(saved.error(), model->json);
        if (!model->json) PrintText(stderr, "wrote {0}/recovery.json and {0}/recovery.bin\n", *buffers);
      }
      const Json times = StepTimesJson(MeasureStepTimes(imported->scene, imported->initial_keyframe));
      if (!model->json) PrintStepTimes(times);
      if (model->json) {
        Json out = all.size() == 1 ? all[0] : Json{{"mechanisms", all}};
        out["step_us"] = times;
        out["notes"] = NotesJson(imported->report);
        PrintText("{}\n", ToText(out, 1));
      }
      return kDone;
    };
  });
}

}  // namespace fork1s::app
