#include "copy_writer.hpp"
#include "importer/model_copy.hpp"

#include <cmath>
#include <cstdio>
#include <filesystem>

#include <fmt/format.h>

namespace fork1s::app {
namespace {

using Quantity = Tunable::Quantity;

std::vector<ServoShare> Shares(const ImportReport& report) {
  std::vector<ServoShare> out;
  for (const ServoGains& s : report.servos)
    out.push_back({s.mechanism, s.control, s.stiffness, s.damping, s.bias, s.at_reference});
  return out;
}

const SpatialInertia& InertiaOf(const Scene& scene, const Tunable& t) {
  const auto item = static_cast<std::size_t>(t.item);
  if (t.mechanism < 0) return scene.free_bodies[item].inertia;
  return scene.mechanisms[static_cast<std::size_t>(t.mechanism)].bodies[item].inertia;
}

// The bounds of a range as they stand in the scene, one of them changed.
ModelChange RangeOf(const Scene& scene, const Tunable& t, ModelChange change) {
  const MechanismDef& def = scene.mechanisms[static_cast<std::size_t>(t.mechanism)];
  const auto item = static_cast<std::size_t>(t.item);
  if (t.of == Tunable::Of::kJoint) {
    const FreedomDef& f = def.joints[item].freedoms[static_cast<std::size_t>(t.freedom)];
    change.quantity = ModelChange::Quantity::kRange;
    change.value = f.lower;
    change.upper = f.upper;
  } else {
    change.quantity = ModelChange::Quantity::kForceRange;
    change.value = -std::numeric_limits<double>::infinity();
    change.upper = -change.value;
    for (const ForceLimitDef& f : def.force_limits)
      if (f.name == t.owner) change.value = f.lower, change.upper = f.upper;
  }
  return change;
}

ModelChange ChangeOf(const Scene& tuned, const Tunable& t) {
  ModelChange change;
  change.name = t.owner;
  change.value = t.value;
  switch (t.of) {
    case Tunable::Of::kJoint:
      change.of = ModelChange::Of::kJoint;
      break;
    case Tunable::Of::kActuator:
      change.of = ModelChange::Of::kActuator;
      break;
    case Tunable::Of::kBody:
      change.of = ModelChange::Of::kBody;
      break;
    case Tunable::Of::kWorld:
      change.of = ModelChange::Of::kShape;
      break;
  }
  switch (t.quantity) {
    case Quantity::kStiffness:
      change.quantity = ModelChange::Quantity::kStiffness;
      break;
    case Quantity::kDamping:
      change.quantity = ModelChange::Quantity::kDamping;
      break;
    case Quantity::kDryFriction:
      change.quantity = ModelChange::Quantity::kDryFriction;
      break;
    case Quantity::kMass:
      change.quantity = ModelChange::Quantity::kInertia;
      change.inertia = InertiaOf(tuned, t);
      break;
    case Quantity::kFriction:
      change.quantity = ModelChange::Quantity::kFriction;
      break;
    default:
      return RangeOf(tuned, t, change);
  }
  return change;
}

// MODEL_tuned.xml, MODEL_tuned2.xml, ...: the first that is not there.
Expected<std::string> WriteBeside(const std::string& path, const std::string& text) {
  const std::filesystem::path model(path);
  for (int i = 1; i < 1000; ++i) {
    const std::filesystem::path copy =
        model.parent_path() / fmt::format("{}_tuned{}{}", model.stem().string(),
                                          i == 1 ? "" : std::to_string(i), model.extension().string());
    if (std::filesystem::exists(copy)) continue;
    std::FILE* file = std::fopen(copy.c_str(), "wxb");
    if (!file) break;
    const bool whole = std::fwrite(text.data(), 1, text.size(), file) == text.size();
    const bool closed = std::fclose(file) == 0;
    if (whole && closed) return copy.string();
    std::filesystem::remove(copy);
    break;
  }
  return Fail(ErrorCode::kFile, path,
              "no copy could be written beside it; make room or give its folder write permission");
}

// Numbers of the copy that are not what was asked for: defaults, other options or merged bodies stand above
// what was written.
void Compare(const std::vector<Tunable>& wanted, const Expected<ImportedScene>& copy, WrittenCopy& out) {
  if (!copy) {
    out.notes.push_back("the copy cannot be read: " + copy.error().Text());
    return;
  }
  const std::vector<Tunable> found = FindTunables(copy->scene, Shares(copy->report));
  for (const Tunable& t : wanted) {
    double is = std::nan("");
    for (const Tunable& f : found)
      if (f.of == t.of && f.quantity == t.quantity && f.owner == t.owner && f.mechanism == t.mechanism)
        is = f.value;
    if (std::abs(is - t.value) <= 1e-6 * std::max(1e-3, std::abs(t.value))) continue;
    out.notes.push_back(std::isnan(is) ? fmt::format("{} of {} '{}' is not in the copy", Name(t.quantity),
                                                     Name(t.of), t.owner)
                                       : fmt::format("{} of {} '{}' is {:.4g} in the copy, not {:.4g}",
                                                     Name(t.quantity), Name(t.of), t.owner, is, t.value));
  }
}

Expected<WrittenCopy> Write(const ModelArguments& model, const std::vector<ServoShare>& servos,
                            const CopyRequest& request, const std::atomic<bool>& stop) {
  WrittenCopy out;
  // The file may have changed since this session read it.
  if (const auto read = model.Load(stop); !read) return tl::unexpected(read.error());
  const auto text = ReadModelText(model.path);
  if (!text) return tl::unexpected(text.error());
  std::string name = "kept";
  for (int i = 2; text->find(fmt::format("\"{}\"", name)) != std::string::npos; ++i)
    name = fmt::format("kept{}", i);
  if (request.moment) {
    auto options = model.Options();
    if (!options) return tl::unexpected(options.error());
    auto moment = MomentAsMjcf(model.path, *options, *request.moment, name, request.time);
    if (!moment) return tl::unexpected(moment.error());
    out.text = *moment;
  }
  if (!request.write_file) return out;
  Scene tuned = *request.scene;
  ApplyTunables(request.changed, servos, tuned);
  std::vector<ModelChange> changes;
  for (const Tunable& t : request.changed) changes.push_back(ChangeOf(tuned, t));
  auto changed = ChangeModelText(model.path, *text, changes, out.text);
  if (!changed) return tl::unexpected(changed.error());
  auto path = WriteBeside(model.path, changed->text);
  if (!path) return tl::unexpected(path.error());
  out.path = *path;
  out.notes = std::move(changed->notes);
  ModelArguments copy = model;
  copy.path = out.path;
  if (request.moment) {
    copy.keyframe = name;
    copy.base_pose.clear();
    copy.coordinates.clear();
  }
  Compare(request.changed, copy.Load(stop), out);
  return out;
}

}  // namespace

ModelFile FileOf(const ModelArguments& model, const ImportReport& report, const std::atomic<bool>& stop) {
  ModelFile file;
  file.servos = Shares(report);
  file.write = [model, servos = file.servos, &stop](const CopyRequest& request) {
    return Write(model, servos, request, stop);
  };
  return file;
}

}  // namespace fork1s::app
