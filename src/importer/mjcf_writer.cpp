// A model as MuJoCo's reader has it, with the options written into its elements, saved by MuJoCo's own
// writer.
#include "importer/mjcf.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <fork1s/mechanism/mechanism.hpp>
#include <set>

#include "mechanism/names.hpp"
#include "prepared_model.hpp"
#include "xml_checks.hpp"

namespace fork1s::internal {
namespace {

// Elements of one kind by the number that the compiler gave them.
std::vector<mjsElement*> ElementsOf(mjSpec* spec, mjtObj kind) {
  std::vector<mjsElement*> elements;
  for (mjsElement* e = mjs_firstElement(spec, kind); e != nullptr; e = mjs_nextElement(spec, e)) {
    const auto id = static_cast<std::size_t>(mjs_getId(e));
    elements.resize(std::max(elements.size(), id + 1), nullptr);
    elements[id] = e;
  }
  return elements;
}

class MjcfWriter {
 public:
  MjcfWriter(mjSpec* spec, Conversion& c, const ImportOptions& options)
      : spec_(spec),
        c_(c),
        options_(options),
        bodies_(ElementsOf(spec, mjOBJ_BODY)),
        joints_(ElementsOf(spec, mjOBJ_JOINT)),
        actuators_(ElementsOf(spec, mjOBJ_ACTUATOR)) {}

  std::optional<Error> Write(const std::vector<Mimic>& mimics) {
    mjs_setString(spec_->modelname, c_.scene.name.c_str());
    SetNames(bodies_, c_.body_names);
    SetNames(joints_, c_.joint_names);
    SetNames(actuators_, c_.actuator_names);
    if (auto error = WriteBases()) return error;
    if (auto error = WriteCustom()) return error;
    for (const Mimic& mimic : mimics) AddMimic(mimic);
    RemoveReplacedMotors();
    if (auto error = AddServos()) return error;
    AddGround();
    AddExcludes();
    return std::nullopt;
  }

 private:
  mjsBody* Body(int b) const { return mjs_asBody(bodies_[static_cast<std::size_t>(b)]); }

  Error Refuse(const std::string& option, const std::string& message) const {
    return {ErrorCode::kUsage, fmt::format("{}, option {}", c_.file, option), message};
  }

  static void SetNames(const std::vector<mjsElement*>& elements, const std::vector<std::string>& names) {
    for (std::size_t i = 0; i < elements.size(); ++i)
      if (elements[i] != nullptr && *mjs_getString(mjs_getName(elements[i])) == '\0')
        mjs_setName(elements[i], names[i].c_str());
  }

  std::optional<Error> WriteBases() {
    std::size_t mechanism = 0;
    for (const Component& component : c_.components) {
      if (component.free_body) {
        if (options_.base_pose)
          if (auto error = Place(component, *options_.base_pose)) return error;
        continue;
      }
      const MechanismDef& def = c_.scene.mechanisms[mechanism++];
      if (options_.base_pose)
        if (auto error = Place(component, def.X_WR)) return error;
      if (options_.base && component.base != def.base)
        if (auto error = SetBase(component, def)) return error;
    }
    return std::nullopt;
  }

  // MuJoCo moves the trees of a mechanism one by one, each by its own root.
  std::optional<Error> RefuseTrees(const Component& component, const std::string& option) const {
    if (component.tops.size() == 1) return std::nullopt;
    if (component.base == BaseKind::kFixed && component.base_body != 0)
      return Refuse(
          option,
          fmt::format("body '{}' is the base of trees beside it in the file, which MJCF does not move "
                      "as one; put them into that body",
                      c_.body_names[static_cast<std::size_t>(component.base_body)]));
    return Refuse(
        option,
        fmt::format("body '{}' is one of {} trees that its loops join, which MJCF does not move "
                    "as one; write the option into the file",
                    c_.body_names[static_cast<std::size_t>(component.tops[0])], component.tops.size()));
  }

  std::optional<Error> Place(const Component& component, const RigidTransform& X_WB) {
    if (auto error = RefuseTrees(component, "base-pose")) return error;
    mjsBody* body = Body(component.tops[0]);
    if (mjs_getFrame(body->element) != nullptr)
      return Refuse("base-pose",
                    fmt::format("body '{}' stands in a <frame> of the file; write its pose there",
                                c_.body_names[static_cast<std::size_t>(component.tops[0])]));
    const Quaternion turn = X_WB.quaternion();
    const double quat[] = {turn.w(), turn.x(), turn.y(), turn.z()};
    std::copy_n(X_WB.translation().data(), 3, body->pos);
    std::copy_n(quat, 4, body->quat);
    body->alt.type = mjORIENTATION_QUAT;
    return std::nullopt;
  }

  std::optional<Error> SetBase(const Component& component, const MechanismDef& def) {
    if (auto error = RefuseTrees(component, "base")) return error;
    mjsBody* body = Body(component.base_body);
    if (component.base == BaseKind::kFloating)
      mjs_delete(spec_, joints_[static_cast<std::size_t>(c_.m.body_jntadr[component.base_body])]);
    body->mocap = def.base == BaseKind::kDriven;
    if (def.base == BaseKind::kFloating) mjs_addFreeJoint(body);
    return std::nullopt;
  }

  void SetText(const char* name, const std::string& value) {
    mjsElement* element = mjs_findElement(spec_, mjOBJ_TEXT, name);
    if (element == nullptr) {
      element = mjs_addText(spec_)->element;
      mjs_setName(element, name);
    }
    mjs_setString(mjs_asText(element)->data, value.c_str());
  }

  std::optional<Error> WriteNames(const char* option, const char* text,
                                  const std::vector<std::string>& names) {
    if (names.empty()) return std::nullopt;
    std::string words;
    for (const std::string& name : names) {
      if (name.find_first_of(" \t\n") != std::string::npos)
        return Refuse(
            option, fmt::format("the name '{}' has a blank, which separates names in MJCF; rename it", name));
      words += (words.empty() ? "" : " ") + name;
    }
    SetText(text, words);
    return std::nullopt;
  }

  std::optional<Error> WriteCustom() {
    if (auto error = WriteNames("interfaces", "fork1s_interface", options_.interfaces)) return error;
    for (const std::string& name : options_.switched)
      if (c_.hinges.count(name) > 0)
        return Refuse("switched",
                      fmt::format("loop joint '{}' is a hinge, which MJCF has as two equalities; make it a "
                                  "spherical or fixed one, or leave it closed",
                                  name));
    if (auto error = WriteNames("switched", "fork1s_switched", options_.switched)) return error;
    if (options_.base) SetText("fork1s_base", Name(*options_.base));
    if (options_.mode_choice) SetText("fork1s_mode_choice", Name(*options_.mode_choice));
    if (!options_.modes && !options_.modes_by_step) return std::nullopt;
    if (mjsElement* old = mjs_findElement(spec_, mjOBJ_NUMERIC, "fork1s_modes")) mjs_delete(spec_, old);
    if (options_.modes) {
      mjsNumeric* modes = mjs_addNumeric(spec_);
      const double value = *options_.modes;
      mjs_setName(modes->element, "fork1s_modes");
      mjs_setDouble(modes->data, &value, 1);
      modes->size = 1;
    }
    return std::nullopt;
  }

  void AddMimic(const Mimic& mimic) {
    mjsEquality* equality = mjs_addEquality(spec_, nullptr);
    mjs_setName(equality->element, ("mimic_" + mimic.joint).c_str());
    equality->type = mjEQ_JOINT;
    equality->objtype = mjOBJ_JOINT;
    mjs_setString(equality->name1, mimic.joint.c_str());
    mjs_setString(equality->name2, mimic.leader.c_str());
    std::fill_n(equality->data, mjNEQDATA, 0.0);
    equality->data[0] = mimic.offset;
    equality->data[1] = mimic.multiplier;
    // Of two limits of one motion, those of the leader act.
    mjs_asJoint(mjs_findElement(spec_, mjOBJ_JOINT, mimic.joint.c_str()))->limited = mjLIMITED_FALSE;
  }

  // Whether the inputs of an actuator are controls: PD control may have come in its place.
  bool IsKept(const LinearActuator& a) const {
    return std::any_of(c_.controls.begin(), c_.controls.end(),
                       [&](const std::vector<ControlSource>& sources) {
                         return std::any_of(sources.begin(), sources.end(), [&](const ControlSource& source) {
                           return source.ctrl >= 0 && source.ctrl == a.inputs[0].ctrl;
                         });
                       });
  }

  void RemoveReplacedMotors() {
    if (!options_.pd) return;
    for (const LinearActuator& a : LinearActuators(c_.m, c_.d))
      if (!IsKept(a)) mjs_delete(spec_, actuators_[static_cast<std::size_t>(a.actuator)]);
  }

  std::optional<Error> AddServos() {
    for (std::size_t i = 0; i < c_.controls.size(); ++i)
      for (std::size_t k = 0; k < c_.controls[i].size(); ++k) {
        const ControlSource& source = c_.controls[i][k];
        if (source.pd.empty()) continue;
        const int joint = c_.m.dof_jntid[source.pd[0].first];
        if (c_.m.jnt_type[joint] == mjJNT_FREE)
          return Refuse("joint-pd", fmt::format("free joint '{}': in MJCF no actuator holds its position",
                                                c_.joint_names[static_cast<std::size_t>(joint)]));
        std::string& name = c_.scene.mechanisms[i].controls[k].name;
        while (mjs_findElement(spec_, mjOBJ_ACTUATOR, name.c_str()) != nullptr) name += '_';
        AddServo(name, joint, source);
        if (!c_.m.jnt_actfrclimited[joint]) continue;
        for (const LinearActuator& a : LinearActuators(c_.m, c_.d))
          for (const auto& term : a.length.terms)
            if (c_.m.dof_jntid[term.first] == joint && IsKept(a))
              return Refuse(
                  "joint-pd",
                  fmt::format("joint '{}' bounds the force of actuator '{}', and in MJCF it would bound the "
                              "PD control too; give the actuator a forcerange in its place",
                              c_.joint_names[static_cast<std::size_t>(joint)], a.name));
      }
    return std::nullopt;
  }

  // F = kp (u + rest + q0 - q) - kv dq/dt: the input counts from the start, as here.
  void AddServo(const std::string& name, int joint, const ControlSource& source) {
    const auto [dof, rest] = source.pd[0];
    const auto [kp, kv] = source.gains;
    mjsActuator* servo = mjs_addActuator(spec_, nullptr);
    mjs_setName(servo->element, name.c_str());
    servo->trntype = mjTRN_JOINT;
    mjs_setString(servo->target, c_.joint_names[static_cast<std::size_t>(joint)].c_str());
    std::fill_n(servo->gear, 6, 0.0);
    servo->gear[dof - c_.m.jnt_dofadr[joint]] = 1;
    servo->gaintype = mjGAIN_FIXED;
    servo->gainprm[0] = kp;
    servo->biastype = mjBIAS_AFFINE;
    servo->biasprm[0] = kp * (rest + c_.Reference(dof));
    servo->biasprm[1] = -kp;
    servo->biasprm[2] = -kv;
  }

  void AddGround() {
    if (!options_.ground) return;
    const GeometryDef& ground = c_.scene.world.back();
    mjsGeom* geom = mjs_addGeom(mjs_findBody(spec_, "world"), nullptr);
    mjs_setName(geom->element, ground.name.c_str());
    geom->type = mjGEOM_PLANE;
    geom->size[0] = geom->size[1] = 0;  // without end
    geom->size[2] = 1;                  // m: distance of the drawn lines
    std::copy_n(ground.X_BG.translation().data(), 3, geom->pos);
  }

  // What the file does not say of pairs that never touch: overlaps at the start, and in a URDF links fixed to
  // the world beside their children. An exclusion here is of rigid parts, MuJoCo's of two bodies.
  void AddExcludes() {
    const mjModel& m = c_.m;
    std::set<std::pair<int, int>> parts;
    const auto exclude = [&](int a, int b) { parts.insert(std::minmax(m.body_weldid[a], m.body_weldid[b])); };
    const auto id = [&](const std::string& name) {
      const auto at = std::find(c_.body_names.begin(), c_.body_names.end(), name);
      return static_cast<int>(at - c_.body_names.begin());
    };
    for (std::size_t i = static_cast<std::size_t>(m.nexclude); i < c_.scene.excluded_pairs.size(); ++i)
      exclude(id(c_.scene.excluded_pairs[i].first), id(c_.scene.excluded_pairs[i].second));
    if (c_.is_urdf)
      for (int b = 1; b < m.nbody; ++b)
        if (m.body_weldid[m.body_parentid[b]] == 0 && m.body_weldid[b] == b) exclude(0, b);
    for (int a = 1; a < m.nbody; ++a)
      for (int b = a + 1; b < m.nbody; ++b)
        if (m.body_geomnum[a] > 0 && m.body_geomnum[b] > 0 &&
            parts.count(std::minmax(m.body_weldid[a], m.body_weldid[b])) > 0)
          AddExclude(a, b);
  }

  void AddExclude(int a, int b) {
    mjsExclude* exclude = mjs_addExclude(spec_);
    mjs_setString(exclude->bodyname1, c_.body_names[static_cast<std::size_t>(a)].c_str());
    mjs_setString(exclude->bodyname2, c_.body_names[static_cast<std::size_t>(b)].c_str());
  }

  mjSpec* spec_;
  Conversion& c_;
  const ImportOptions& options_;
  std::vector<mjsElement*> bodies_, joints_, actuators_;
};

// The state with its controls in the order of the written model.
KeyframeDef InOrderOf(const Conversion& written, const Scene& scene, const KeyframeDef& key) {
  KeyframeDef out = key;
  for (std::size_t i = 0; i < key.mechanisms.size(); ++i) {
    const auto &from = scene.mechanisms[i].controls, &to = written.scene.mechanisms[i].controls;
    out.mechanisms[i].controls.setZero(static_cast<Eigen::Index>(to.size()));
    for (std::size_t k = 0; k < to.size(); ++k)
      for (std::size_t j = 0; j < from.size(); ++j)
        if (from[j].name == to[k].name)
          out.mechanisms[i].controls[static_cast<Eigen::Index>(k)] =
              key.mechanisms[i].controls[static_cast<Eigen::Index>(j)];
  }
  return out;
}

void AddKey(mjSpec* spec, const Conversion& written, const KeyframeDef& state, double time) {
  const KeyNumbers numbers = NumbersOf(written, state);
  mjsKey* key = mjs_addKey(spec);
  mjs_setName(key->element, state.name.c_str());
  key->time = time;
  for (const auto& [to, from] : {std::pair{key->qpos, &numbers.qpos}, std::pair{key->qvel, &numbers.qvel},
                                 std::pair{key->act, &numbers.act}, std::pair{key->ctrl, &numbers.ctrl},
                                 std::pair{key->mpos, &numbers.mpos}, std::pair{key->mquat, &numbers.mquat}})
    mjs_setDouble(to, from->data(), static_cast<int>(from->size()));
}

// Keyframes of the scene from `first` on; `model` is compiled without them.
std::optional<Error> AddKeys(EditableModel& model, const Conversion& c, std::size_t first) {
  if (first == c.scene.keyframes.size()) return std::nullopt;
  const auto compiled = model.Compile();
  if (!compiled) return compiled.error();
  Conversion written(*compiled->model, *compiled->data, c.file);
  if (auto error = Convert(written, {}, {})) return error;
  if (written.scene.mechanisms.size() != c.scene.mechanisms.size() ||
      written.scene.free_bodies.size() != c.scene.free_bodies.size())
    return c.ModelError("", "becomes other mechanisms by the options; write them into the file");
  for (std::size_t key = first; key < c.scene.keyframes.size(); ++key)
    AddKey(model.spec(), written, InOrderOf(written, c.scene, c.scene.keyframes[key]),
           key < static_cast<std::size_t>(c.m.nkey) ? c.m.key_time[key] : 0);
  return std::nullopt;
}

// Activations that no control of the scene has: those of integral gains, windings and the like.
void NoteLostActivations(Conversion& c) {
  const mjModel& m = c.m;
  std::vector<std::string> names;
  for (int key = 0; key < m.nkey; ++key) {
    const KeyNumbers kept = NumbersOf(c, c.scene.keyframes[static_cast<std::size_t>(key)]);
    if (!std::equal(kept.act.begin(), kept.act.end(), m.key_act + key * m.na))
      names.push_back(c.scene.keyframes[static_cast<std::size_t>(key)].name);
  }
  c.ChangedMany(
      "keyframe", names,
      "it is written again for the options, without the activations of parts of actuators that are not simulated");
}

// The files that the text names, from where it will lie.
Expected<void> MoveFiles(mjSpec* spec, const PreparedModel& prepared, const std::string& folder,
                         const std::string& mesh_folder, MjcfModel& out) {
  namespace fs = std::filesystem;
  if (prepared.is_urdf) {
    out.meshes = prepared.source.buffers;
    for (const auto& [name, path] : prepared.source.files) {
      auto content = ReadFile(path);
      if (!content) return tl::unexpected<Error>(content.error());
      out.meshes[name] = std::move(*content);
    }
    if (!out.meshes.empty()) mjs_setString(spec->compiler.meshdir, mesh_folder.c_str());
    return {};
  }
  for (const mjtObj kind : {mjOBJ_MESH, mjOBJ_HFIELD, mjOBJ_SKIN, mjOBJ_TEXTURE})
    for (mjsElement* e = mjs_firstElement(spec, kind); e != nullptr; e = mjs_nextElement(spec, e))
      if (mjs_getOriginSpec(e) != spec)
        return Fail(
            ErrorCode::kModel, prepared.source.path,
            fmt::format("'{}' comes with an attached model, which has folders of its own for its files; the "
                        "written file has one: replace <attach> by <include>",
                        mjs_getString(mjs_getName(e))));
  const fs::path from = fs::absolute(prepared.source.path).parent_path(), to = fs::absolute(folder);
  const auto move = [&](mjString* directory, std::initializer_list<mjtObj> kinds) {
    if (std::none_of(kinds.begin(), kinds.end(),
                     [&](mjtObj kind) { return mjs_firstElement(spec, kind) != nullptr; }))
      return;
    const fs::path moved = (from / mjs_getString(directory)).lexically_relative(to.lexically_normal());
    mjs_setString(directory, moved.generic_string().c_str());
  };
  move(spec->compiler.meshdir, {mjOBJ_MESH, mjOBJ_HFIELD, mjOBJ_SKIN});
  move(spec->compiler.texturedir, {mjOBJ_TEXTURE});
  return {};
}

}  // namespace
}  // namespace fork1s::internal

namespace fork1s {

Expected<MjcfModel> ModelAsMjcf(const std::string& path, const ImportOptions& options,
                                const std::string& folder, const std::string& mesh_folder) {
  using namespace internal;
  if (options.stiffness_scale != 1)
    return Fail(ErrorCode::kUsage, fmt::format("{}, option stiffness-scale", path),
                "is not written as MJCF; write the stiffnesses into the file");
  const auto prepared = PrepareModel(path, options);
  if (!prepared) return tl::unexpected<Error>(prepared.error());
  auto model = ParsePrepared(*prepared);
  if (!model) return tl::unexpected<Error>(model.error());
  auto compiled = model->Compile();
  if (!compiled) return tl::unexpected<Error>(compiled.error());
  Conversion c(*compiled->model, *compiled->data, path);
  if (auto error = ConvertPrepared(c, *prepared, compiled->warnings, options))
    return tl::unexpected<Error>(std::move(*error));
  if (auto error = MjcfWriter(model->spec(), c, options).Write(prepared->mimics))
    return tl::unexpected<Error>(std::move(*error));
  SplitHinges(model->spec(), prepared->extensions, c.m.stat.meansize);
  // Keyframes of the file stay as they are unless coordinates or inputs have changed.
  const bool rewrites = options.base || options.base_pose || options.pd || !options.joint_pd.empty();
  if (rewrites) NoteLostActivations(c);
  const std::vector<mjsElement*> keys = ElementsOf(model->spec(), mjOBJ_KEY);
  for (std::size_t key = 0; key < keys.size(); ++key)
    if (rewrites)
      mjs_delete(model->spec(), keys[key]);
    else
      mjs_setName(keys[key], c.scene.keyframes[key].name.c_str());
  if (auto error = AddKeys(*model, c, rewrites ? 0 : keys.size()))
    return tl::unexpected<Error>(std::move(*error));
  if (const auto whole = model->Compile(); !whole) return tl::unexpected<Error>(whole.error());
  MjcfModel out;
  if (auto moved = MoveFiles(model->spec(), *prepared, folder, mesh_folder, out); !moved)
    return tl::unexpected<Error>(moved.error());
  auto text = model->Text();
  if (!text) return tl::unexpected<Error>(text.error());
  out.text = std::move(*text);
  if (c.initial_keyframe >= 0)
    out.start = c.scene.keyframes[static_cast<std::size_t>(c.initial_keyframe)].name;
  out.imported = MoveOut(c);
  return out;
}

}  // namespace fork1s
