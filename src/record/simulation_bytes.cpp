// Fields of moments of a simulation, and the bytes of JSON with the tables beside it.
//
// The structured bindings are the guard, as in scene_fields.hpp: a struct that gains a field stops the compiler here.
#include "record/simulation_bytes.hpp"

#include <cstring>
#include <memory>
#include <new>
#include <type_traits>

#include "pictures.hpp"
#include "scene_fields.hpp"

namespace fork1s {
namespace internal {
namespace {

// A matrix of any size, column by column.
struct MatrixText {
  int rows = 0, columns = 0;
  std::vector<double> values;
};

template <class A>
void Fields(A& a, Like<MatrixText, A>& s) {
  auto& [rows, columns, values] = s;
  a("rows", rows), a("columns", columns), a("values", values);
}

template <class M>
MatrixText ToText(const M& m) {
  MatrixText text{static_cast<int>(m.rows()), static_cast<int>(m.cols()), {}};
  for (Eigen::Index k = 0; k < m.cols(); ++k)
    for (Eigen::Index i = 0; i < m.rows(); ++i) text.values.push_back(m(i, k));
  return text;
}

template <class M>
void FromText(const MatrixText& text, const char* key, M& m) {
  if (text.rows < 0 || text.columns < 0 ||
      text.values.size() != static_cast<std::size_t>(text.rows) * static_cast<std::size_t>(text.columns) ||
      (M::RowsAtCompileTime != Eigen::Dynamic && text.rows != M::RowsAtCompileTime))
    throw JsonFault({nullptr, key}, "does not have as many numbers as rows and columns");
  m.resize(text.rows, text.columns);
  for (Eigen::Index k = 0, at = 0; k < m.cols(); ++k)
    for (Eigen::Index i = 0; i < m.rows(); ++i, ++at) m(i, k) = text.values[static_cast<std::size_t>(at)];
}

template <class A>
constexpr bool kReads = std::same_as<A, JsonReader>;

template <class A, class M>
void Matrix(A& a, const char* key, M& m) {
  if constexpr (kReads<A>) {
    MatrixText text;
    a(key, text);
    FromText(text, key, m);
  } else {
    a(key, ToText(m));
  }
}

template <class A, class Ms>
void Matrices(A& a, const char* key, Ms& ms) {
  std::vector<MatrixText> texts;
  if constexpr (kReads<A>) {
    a(key, texts);
    ms.resize(texts.size());
    for (std::size_t i = 0; i < ms.size(); ++i) FromText(texts[i], key, ms[i]);
  } else {
    for (const auto& m : ms) texts.push_back(ToText(m));
    a(key, texts);
  }
}

// As another type that text has: S holds every value of T.
template <class S, class A, class T>
void As(A& a, const char* key, T& value) {
  if constexpr (kReads<A>) {
    S text{};
    a(key, text);
    value = static_cast<T>(text);
  } else {
    a(key, static_cast<S>(value));
  }
}

}  // namespace

template <class A>
void Fields(A& a, Like<AppliedForces, A>& s) {
  auto& [force_W, moment_W, force_moments] = s;
  a("force_W", force_W), a("moment_W", moment_W), a("force_moments", force_moments);
}

template <class A>
void Fields(A& a, Like<PointSpring, A>& s) {
  auto& [point_B, target_start_W, target_W, stiffness, damping] = s;
  a("point_B", point_B), a("target_start_W", target_start_W), a("target_W", target_W);
  a("stiffness", stiffness), a("damping", damping);
}

template <class A>
void Fields(A& a, Like<Simulation::BodyPointSpring, A>& s) {
  auto& [body, spring] = s;
  a("body", body), a("spring", spring);
}

template <class A>
void Fields(A& a, Like<BodyMotion, A>& s) {
  auto& [X_WB, V_W, load_W] = s;
  a("X_WB", X_WB), a("V_W", V_W), a("load_W", load_W);
}

template <class A>
void Fields(A& a, Like<Simulation::LastStep, A>& s) {
  auto& [exists, controls_moved, base_rates, point_springs, wrenches_W, start_motions] = s;
  a("exists", exists), a("controls_moved", controls_moved), a("base_rates", base_rates);
  a("point_springs", point_springs), a("start_motions", start_motions);
  Matrices(a, "wrenches_W", wrenches_W);
}

template <class A>
void Fields(A& a, Like<Fidelity, A>& s) {
  auto& [level, modes, recovery] = s;
  a("level", level), a("modes", modes), a("recovery", recovery);
}

template <class A>
void Fields(A& a, Like<FrozenGrasp::Contact, A>& s) {
  auto& [mechanism, body, X_BC, force_C, friction, frictionless, rolling] = s;
  a("mechanism", mechanism), a("body", body), a("X_BC", X_BC), a("force_C", force_C);
  a("friction", friction), a("frictionless", frictionless), a("rolling", rolling);
}

template <class A>
void Fields(A& a, Like<FrozenGrasp, A>& s) {
  auto& [free_body, contacts] = s;
  a("free_body", free_body), a("contacts", contacts);
}

template <class A>
void Fields(A& a, Like<ContactPoint, A>& s) {
  auto& [body_a, body_b, geometry_a, geometry_b, point, frame, gap, friction, friction_scale, torsion,
         rolling, restitution, adhesion_gap, adhesion, surface_velocity] = s;
  a("body_a", body_a), a("body_b", body_b), a("geometry_a", geometry_a), a("geometry_b", geometry_b);
  a("point", point), a("frame", frame), a("gap", gap), a("friction", friction), a("torsion", torsion);
  a("rolling", rolling), a("restitution", restitution), a("adhesion_gap", adhesion_gap);
  a.Optional("friction_scale", friction_scale), a.Optional("adhesion", adhesion);  // before 24 there are none
  a.Optional("surface_velocity", surface_velocity);
}

template <class A>
void Fields(A& a, Like<ContactRecord, A>& s) {
  auto& [point, impulse, normal_sum, tangential_sum, pull, friction, moment, use, gives_way, end_force,
         end_moment, end_speed] = s;
  a("point", point), a("impulse", impulse), a("normal_sum", normal_sum), a("tangential_sum", tangential_sum);
  a("friction", friction), a("moment", moment), a("use", use), a("end_force", end_force);
  a("end_moment", end_moment), a("end_speed", end_speed), a("pull", pull), a("gives_way", gives_way);
}

template <class A>
void Fields(A& a, Like<FreeBody::State, A>& s) {
  auto& [X_WB, omega_B, velocity, load, point_spring, angular_acceleration_B, acceleration] = s;
  a("X_WB", X_WB), a("omega_B", omega_B), a("velocity", velocity), a("load", load);
  a("point_spring", point_spring), a("angular_acceleration_B", angular_acceleration_B);
  a("acceleration", acceleration);
}

template <class A>
void Fields(A& a, Like<ModeSelection, A>& s) {
  auto& [count, choice, below_hz] = s;
  a("count", count), a("choice", choice), a("below_hz", below_hz);
}

template <class A>
void Fields(A& a, Like<RankDoubt, A>& s) {
  auto& [what, kept, dropped, joints] = s;
  a("what", what), a("kept", kept), a("dropped", dropped), a("joints", joints);
}

// The mechanism follows from the scene, what FillDerived makes and the curvature from the rest.
template <class A>
void Fields(A& a, Like<ReducedModel, A>& s) {
  auto& [mechanism, interfaces, q_ref, num_free, num_elastic, num_modes, num_loads, mode_selection,
         column_names, Q, K_r, M, D, M_00, M_0z, S_ref, X_RB_ref, T, has_complement, k_inverse, C_perp,
         loop_rows, h_inverse, Q_rows, runs, loops, B, curvature, interior_stops, promoted, doubts,
         warnings] = s;
  a("interfaces", interfaces), a("q_ref", q_ref), a("num_free", num_free), a("num_elastic", num_elastic);
  a("num_modes", num_modes), a("num_loads", num_loads), a("mode_selection", mode_selection);
  a("column_names", column_names), a("K_r", K_r), a("M_00", M_00), a("X_RB_ref", X_RB_ref);
  a("has_complement", has_complement), a("k_inverse", k_inverse), a("loop_rows", loop_rows);
  a("h_inverse", h_inverse), a("interior_stops", interior_stops), a("promoted", promoted);
  a("doubts", doubts), a("warnings", warnings);
  Matrix(a, "Q", Q), Matrix(a, "M", M), Matrix(a, "D", D), Matrix(a, "M_0z", M_0z);
  Matrix(a, "S_ref", S_ref), Matrix(a, "T", T), Matrix(a, "C_perp", C_perp);
}

template <class A>
void Fields(A& a, Like<ReducedState, A>& s) {
  auto& [z, w, X_WR, V_R] = s;
  a("z", z), a("w", w), a("X_WR", X_WR), a("V_R", V_R);
}

template <class A>
void Fields(A& a, Like<BaseHistory, A>& s) {
  auto& [h, h_before, mean_rate, mean_rate_before] = s;
  a("h", h), a("h_before", h_before), a("mean_rate", mean_rate), a("mean_rate_before", mean_rate_before);
}

template <class A>
void Fields(A& a, Like<MechanismState, A>& s) {
  auto& [model, step_model, reduced, expanded_at, mu, controls, controls_from, controls_move, activation,
         driven_next, knows_driven_rate, driven_rate, base_history, loads, has_loads, point_spring,
         point_spring_body, at_bound, missing_time, reference_age, acceleration] = s;
  if constexpr (kReads<A>) {
    auto read = std::make_shared<ReducedModel>();
    a("model", *read);
    model = std::move(read);
  } else {
    a("model", *model);
  }
  a("reduced", reduced), a("expanded_at", expanded_at), a("mu", mu), a("controls", controls);
  a("controls_from", controls_from), a("controls_move", controls_move), a("activation", activation);
  a("driven_next", driven_next), a("knows_driven_rate", knows_driven_rate), a("driven_rate", driven_rate);
  a("base_history", base_history), a("loads", loads), a("has_loads", has_loads);
  a("point_spring", point_spring), a("point_spring_body", point_spring_body);
  a("missing_time", missing_time), a("reference_age", reference_age), a("acceleration", acceleration);
  std::vector<int> sides(at_bound.begin(), at_bound.end());
  if constexpr (kReads<A>) {
    a("at_bound", sides);
    for (int side : sides) at_bound.push_back(static_cast<signed char>(side));
  } else {
    a("at_bound", sides);
  }
}

template <class A>
void Fields(A& a, Like<WorldState::Rows, A>& s) {
  auto& [limit_impulses, friction_impulses, refreshed] = s;
  a("limit_impulses", limit_impulses), a("friction_impulses", friction_impulses), a("refreshed", refreshed);
}

template <class A>
void Fields(A& a, Like<SwitchedClosureRecord, A>& s) {
  auto& [acts, point_W, impulse_W, moment_W] = s;
  a("acts", acts), a("point_W", point_W), a("impulse_W", impulse_W), a("moment_W", moment_W);
}

template <class A>
void Fields(A& a, Like<WorldState, A>& s) {
  auto& [mechanisms, free_bodies, contacts, contacts_h, collision_body_poses, contraction, rows,
         switched_closures] = s;
  a("mechanisms", mechanisms), a("free_bodies", free_bodies), a("contacts", contacts);
  a("contacts_h", contacts_h), a("contactor_poses", collision_body_poses), a("contraction", contraction);
  a("rows", rows), a("switched_closures", switched_closures);
}

template <class A>
void Fields(A& a, Like<Simulation::Snapshot, A>& s) {
  auto& [steps, controls, last_controls, base_rates, fidelity, holds, made_of, keyframe, base_start,
         last_step, world] = s;
  As<double>(a, "steps", steps);  // exact below 2^53, of which no run makes as many
  a("controls", controls), a("last_controls", last_controls), a("base_rates", base_rates);
  a("fidelity", fidelity), a("holds", holds), a("keyframe", keyframe), a("base_start", base_start);
  a("last_step", last_step), a("world", world);
  bool has_scene = made_of != nullptr;
  a("has_scene", has_scene);
  if (!has_scene) return;
  if constexpr (kReads<A>) {
    auto scene = std::make_shared<Scene>();
    a("made_of", *scene);
    made_of = std::move(scene);
  } else {
    a("made_of", *made_of);
  }
}

template <class A>
void Fields(A& a, Like<ModelContent, A>& s) {
  auto& [imported, options] = s;
  a("imported", imported), a("options", options);
}

template <class A>
void Fields(A& a, Like<SimulationContent, A>& s) {
  auto& [scene, options, actuators, snapshot] = s;
  a("scene", scene), a("options", options), a("actuators", actuators), a("snapshot", snapshot);
}

template <class A>
void Fields(A& a, Like<BatchContent, A>& s) {
  auto& [options, snapshots] = s;
  a("options", options), a("snapshots", snapshots);
}

namespace {

constexpr std::string_view kBytesFormat = "fork1s content 1\n";

struct BytesFault : std::runtime_error {
  using std::runtime_error::runtime_error;
};

class ByteWriter {
 public:
  template <class T>
  void Put(T value) {
    static_assert(std::is_arithmetic_v<T>);
    const auto* at = reinterpret_cast<const std::uint8_t*>(&value);
    bytes_.insert(bytes_.end(), at, at + sizeof(T));
  }
  template <class Values>
  void PutAll(const Values& values) {
    Put(static_cast<std::uint64_t>(values.size()));
    const auto* at = reinterpret_cast<const std::uint8_t*>(values.data());
    if (!values.empty()) bytes_.insert(bytes_.end(), at, at + values.size() * sizeof(values[0]));
  }
  const std::vector<std::uint8_t>& bytes() const { return bytes_; }

 private:
  std::vector<std::uint8_t> bytes_;
};

class ByteReader {
 public:
  explicit ByteReader(const std::vector<std::uint8_t>& bytes) : bytes_(bytes) {}
  template <class T>
  void Get(T& value) {
    static_assert(std::is_arithmetic_v<T>);
    Copy(&value, 1, sizeof(T));
  }
  template <class Values>
  void GetAll(Values& values) {
    constexpr std::size_t size = sizeof(typename Values::value_type);
    const std::size_t count = GetCount(size);
    values.resize(count);
    Copy(values.data(), count, size);
  }
  // How many items of at least `size` bytes follow.
  std::size_t GetCount(std::size_t size) {
    std::uint64_t count = 0;
    Get(count);
    if (count > (bytes_.size() - at_) / size) throw BytesFault("they are cut off");
    return static_cast<std::size_t>(count);
  }

 private:
  void Copy(void* to, std::size_t count, std::size_t size) {
    if (count * size > bytes_.size() - at_) throw BytesFault("they are cut off");
    if (count > 0) std::memcpy(to, bytes_.data() + at_, count * size);
    at_ += count * size;
  }
  const std::vector<std::uint8_t>& bytes_;
  std::size_t at_ = 0;
};

template <class T>
std::string ToBytes(const T& value) {
  const ModelText text = Encoded(value);
  ByteWriter out;
  out.PutAll(text.json);
  out.Put(static_cast<std::uint64_t>(text.meshes.size()));
  for (const auto& mesh : text.meshes) {
    out.PutAll(mesh->name);
    out.PutAll(mesh->vertices);
    out.PutAll(mesh->triangles);
    out.PutAll(mesh->corner_uv);
  }
  out.Put(static_cast<std::uint64_t>(text.grids.size()));
  for (const auto& grid : text.grids) {
    out.PutAll(grid->name);
    for (int n : {grid->rows, grid->columns}) out.Put(n);
    for (double v : {grid->half_x, grid->half_y, grid->max_height, grid->base_depth}) out.Put(v);
    out.PutAll(grid->values);
  }
  out.Put(static_cast<std::uint64_t>(text.pictures.size()));
  for (const auto& picture : text.pictures) {
    out.PutAll(picture->name);
    for (int n : {picture->width, picture->height}) out.Put(n);
    out.PutAll(picture->rgb);
  }
  const std::vector<std::uint8_t> packed = Deflated(out.bytes());
  std::string bytes(kBytesFormat);
  const auto size = static_cast<std::uint64_t>(out.bytes().size());
  bytes.append(reinterpret_cast<const char*>(&size), sizeof size);
  bytes.append(packed.begin(), packed.end());
  return bytes;
}

ModelText UnpackText(const std::string& bytes) {
  std::uint64_t size = 0;
  const std::size_t header = kBytesFormat.size() + sizeof size;
  if (bytes.size() < header || bytes.compare(0, kBytesFormat.size(), kBytesFormat) != 0)
    throw BytesFault("they do not begin as those of this version");
  std::memcpy(&size, bytes.data() + kBytesFormat.size(), sizeof size);
  constexpr std::uint64_t kMaxRatio = 1032;  // of zlib, "zlib Technical Details"; more cannot be true
  if (size > kMaxRatio * bytes.size()) throw BytesFault("they are damaged");
  const std::vector<std::uint8_t> packed(bytes.begin() + static_cast<std::ptrdiff_t>(header), bytes.end());
  const std::vector<std::uint8_t> all = Inflated(packed, static_cast<std::size_t>(size));
  if (all.empty()) throw BytesFault("they are damaged");
  ByteReader in(all);
  ModelText text;
  in.GetAll(text.json);
  constexpr std::size_t kLeast = sizeof(std::uint64_t);  // bytes of a name
  for (std::size_t n = in.GetCount(kLeast); n > 0; --n) {
    auto mesh = std::make_shared<TriangleMesh>();
    in.GetAll(mesh->name);
    in.GetAll(mesh->vertices);
    in.GetAll(mesh->triangles);
    in.GetAll(mesh->corner_uv);
    text.meshes.push_back(std::move(mesh));
  }
  for (std::size_t n = in.GetCount(kLeast); n > 0; --n) {
    auto grid = std::make_shared<HeightGrid>();
    in.GetAll(grid->name);
    for (int* value : {&grid->rows, &grid->columns}) in.Get(*value);
    for (double* value : {&grid->half_x, &grid->half_y, &grid->max_height, &grid->base_depth}) in.Get(*value);
    in.GetAll(grid->values);
    text.grids.push_back(std::move(grid));
  }
  for (std::size_t n = in.GetCount(kLeast); n > 0; --n) {
    auto picture = std::make_shared<Picture>();
    in.GetAll(picture->name);
    for (int* value : {&picture->width, &picture->height}) in.Get(*value);
    in.GetAll(picture->rgb);
    text.pictures.push_back(std::move(picture));
  }
  return text;
}

template <class T>
Expected<T> FromBytes(const std::string& bytes, const std::string& where) {
  try {
    return Decoded<T>(UnpackText(bytes));
  } catch (const std::bad_alloc&) {
    throw;
  } catch (const std::exception& e) {
    return Fail(ErrorCode::kFormat, where,
                std::string("the bytes cannot be read (") + e.what() + "); make it again with this version");
  }
}

// The model of a mechanism with what it was written without.
std::shared_ptr<const ReducedModel> Complete(const ReducedModel& read,
                                             std::shared_ptr<const Mechanism> mechanism, bool curved) {
  auto model = std::make_shared<ReducedModel>(read);
  model->mechanism = std::move(mechanism);
  FillDerived(*model);
  if (curved) model->curvature = LoopCurvature(*model);
  return model;
}

// Sizes that the functions above rely on.
bool Fits(const ReducedModel& model, const Mechanism& mechanism) {
  const Eigen::Index n = mechanism.num_coordinates(), b = mechanism.num_bodies(), r = model.size();
  const auto is_body = [&](BodyIndex i) { return i.value() >= 0 && i.value() < b; };
  const auto is_row = [&](int i) { return i >= 0 && i < mechanism.num_constraints(); };
  const auto is = [](const auto& m, Eigen::Index rows, Eigen::Index columns) {
    return m.rows() == rows && m.cols() == columns;
  };
  const auto none_or = [](const VectorX& v, Eigen::Index size) { return v.size() == 0 || v.size() == size; };
  return model.q_ref.size() == n && is(model.Q, n, r) && is(model.M, r, r) && is(model.D, r, r) &&
         is(model.M_0z, 6, r) && is(model.S_ref, 6, n) && is(model.T, 6, b * r) &&
         model.X_RB_ref.size() == static_cast<std::size_t>(b) && none_or(model.k_inverse, n) &&
         none_or(model.h_inverse, n) && (model.loop_rows.empty() || model.h_inverse.size() == n) &&
         std::all_of(model.loop_rows.begin(), model.loop_rows.end(), is_row) &&
         std::all_of(model.interfaces.begin(), model.interfaces.end(), is_body) &&
         std::all_of(model.promoted.begin(), model.promoted.end(), is_body);
}

Expected<void> CompleteModels(const std::vector<std::shared_ptr<const Mechanism>>& mechanisms,
                              const std::string& where, Simulation::Snapshot& snapshot) {
  auto& states = snapshot.world.mechanisms;
  for (std::size_t i = 0; i < states.size(); ++i) {
    if (states.size() != mechanisms.size() || !Fits(*states[i].model, *mechanisms[i]))
      return Fail(ErrorCode::kFormat, where,
                  "the state does not fit the mechanisms of its scene; make it again with this version");
    states[i].model =
        Complete(*states[i].model, mechanisms[i], snapshot.fidelity.recovery == Recovery::kCurved);
  }
  return {};
}

Expected<void> CompleteFromScene(const std::string& where, Simulation::Snapshot& snapshot) {
  if (!snapshot.made_of)
    return Fail(ErrorCode::kFormat, where, "the state has no scene; make it again with this version");
  std::vector<std::shared_ptr<const Mechanism>> mechanisms;
  for (const MechanismDef& definition : snapshot.made_of->mechanisms) {
    auto built = BuildMechanism(definition);
    if (!built) return tl::unexpected(built.error());
    mechanisms.push_back(std::make_shared<const Mechanism>(std::move(*built)));
  }
  return CompleteModels(mechanisms, where, snapshot);
}

}  // namespace
}  // namespace internal

std::string WriteModelBytes(const ModelContent& content) { return internal::ToBytes(content); }
Expected<ModelContent> ReadModelBytes(const std::string& bytes, const std::string& where) {
  return internal::FromBytes<ModelContent>(bytes, where);
}

std::string WriteSimulationBytes(const SimulationContent& content) { return internal::ToBytes(content); }
Expected<SimulationContent> ReadSimulationBytes(const std::string& bytes, const std::string& where) {
  auto content = internal::FromBytes<SimulationContent>(bytes, where);
  if (!content) return content;
  if (auto done = internal::CompleteFromScene(where, content->snapshot); !done)
    return tl::unexpected(done.error());
  return content;
}

std::string WriteSnapshotBytes(const Simulation::Snapshot& snapshot) { return internal::ToBytes(snapshot); }
Expected<Simulation::Snapshot> ReadSnapshotBytes(const std::string& bytes, const std::string& where) {
  auto snapshot = internal::FromBytes<Simulation::Snapshot>(bytes, where);
  if (!snapshot) return snapshot;
  if (auto done = internal::CompleteFromScene(where, *snapshot); !done) return tl::unexpected(done.error());
  return snapshot;
}

std::string WriteBatchBytes(const BatchContent& content) { return internal::ToBytes(content); }
Expected<BatchContent> ReadBatchBytes(const std::string& bytes, const std::string& where) {
  auto content = internal::FromBytes<BatchContent>(bytes, where);
  if (!content) return content;
  for (Simulation::Snapshot& snapshot : content->snapshots)
    if (snapshot.made_of)
      if (auto done = internal::CompleteFromScene(where, snapshot); !done)
        return tl::unexpected(done.error());
  return content;
}

Expected<void> CompleteSnapshot(const Simulation::Snapshot& made, const std::string& where,
                                Simulation::Snapshot& snapshot) {
  snapshot.made_of = made.made_of;
  std::vector<std::shared_ptr<const Mechanism>> mechanisms;
  for (const MechanismState& state : made.world.mechanisms) mechanisms.push_back(state.model->mechanism);
  return internal::CompleteModels(mechanisms, where, snapshot);
}

}  // namespace fork1s
