#include <algorithm>
#include <chrono>
#include <fork1s/record/recording.hpp>
#include <fork1s/sim/queries.hpp>
#include <fork1s/sim/sensors.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <optional>

#include "columns.hpp"
#include "hdf5_disk.hpp"
#include "hdf5_file.hpp"
#include "model_store.hpp"
#include "record/output_file.hpp"

namespace fork1s {
namespace {

using namespace internal;

void CreateColumn(hid_t file, const Column& column, hid_t type) {
  if (column.width == 0) return;
  Dims dims = {0}, limit = {H5S_UNLIMITED};
  // About 64 KiB a chunk, fewer where few rows are to be expected.
  Dims chunk = {static_cast<hsize_t>(std::clamp(8192 / column.width, 1, 1024))};
  if (column.inner > 0) dims.push_back(static_cast<hsize_t>(column.width / column.inner));
  if (column.inner > 0 || column.width > 1)
    dims.push_back(static_cast<hsize_t>(column.inner > 0 ? column.inner : column.width));
  limit.insert(limit.end(), dims.begin() + 1, dims.end());
  chunk.insert(chunk.end(), dims.begin() + 1, dims.end());
  const Hdf5 space(H5Screate_simple(static_cast<int>(dims.size()), dims.data(), limit.data()), H5Sclose);
  const Hdf5 layout(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  H5Pset_chunk(layout.id(), static_cast<int>(chunk.size()), chunk.data());
  const Hdf5 dataset(H5Dcreate2(file, column.name, type, space.id(), H5P_DEFAULT, layout.id(), H5P_DEFAULT),
                     H5Dclose);
  if (!dataset)
    throw Hdf5Fault(std::string("cannot write '") + column.name + "' (" + LastHdf5Message() + ')',
                    ErrorCode::kFile);
  if (*column.unit) WriteAttribute(dataset.id(), "unit", std::string(column.unit));
  if (*column.text) WriteAttribute(dataset.id(), "description", std::string(column.text));
}

void AppendRows(const Hdf5& dataset, hid_t type, hsize_t rows, const void* data) {
  Dims dims = DimsOf(dataset), start(dims.size(), 0);
  start[0] = dims[0];
  dims[0] += rows;
  bool good = H5Dset_extent(dataset.id(), dims.data()) >= 0;
  if (good) {
    const Hdf5 file_space(H5Dget_space(dataset.id()), H5Sclose);
    dims[0] = rows;
    const Hdf5 memory(H5Screate_simple(static_cast<int>(dims.size()), dims.data(), nullptr), H5Sclose);
    good = H5Sselect_hyperslab(file_space.id(), H5S_SELECT_SET, start.data(), nullptr, dims.data(),
                               nullptr) >= 0 &&
           H5Dwrite(dataset.id(), type, memory.id(), file_space.id(), H5P_DEFAULT, data) >= 0;
  }
  if (!good) throw Hdf5Fault("cannot be written (" + LastHdf5Message() + ')', ErrorCode::kFile);
}

void WriteHeader(hid_t file, const Simulation& simulation) {
  WriteAttribute(file, "format", std::string(kFormatName));
  WriteAttribute(file, "format_version", static_cast<std::int64_t>(kFormatVersion));
  WriteAttribute(file, "program", std::string("fork1s " FORK1S_VERSION));
  const Hdf5 scene = CreateGroup(file, "scene");
  WriteModel(scene.id(), WriteScene(simulation.scene()));

  SimulationOptions options = simulation.options();
  options.dt = simulation.dt();
  const Hdf5 run = CreateGroup(file, "simulation");
  WriteText(run.id(), "options", WriteOptions(options), {"", "options of the run as JSON"});
  WriteArray(run.id(), "dt", std::vector<double>{options.dt}, {"s", "time step"});

  std::vector<std::string> names, coordinates, mechanisms;
  std::vector<int> owner, index;
  std::vector<std::uint8_t> is_interface;
  std::vector<double> poses;
  for (std::size_t i = 0; i < simulation.bodies().size(); ++i) {
    const SceneBody& b = simulation.bodies()[i];
    names.push_back(b.name);
    owner.push_back(b.mechanism);
    index.push_back(b.index);
    is_interface.push_back(b.is_interface ? 1 : 0);
    AddPose(simulation.Pose(static_cast<int>(i)), poses);
  }
  for (const MechanismDef& def : simulation.scene().mechanisms) mechanisms.push_back(def.name);
  for (const std::string& name : simulation.CoordinateNames()) coordinates.push_back(name);
  const Hdf5 names_group = CreateGroup(file, "names");
  WriteTexts(names_group.id(), "bodies", names, {"", "bodies of all mechanisms, then free bodies"});
  WriteTexts(names_group.id(), "controls", simulation.control_names(), {});
  WriteTexts(names_group.id(), "coordinates", coordinates,
             {"", "joint coordinates, mechanism after mechanism"});
  WriteTexts(names_group.id(), "sensors", SensorValueNames(simulation.scene()),
             {"", "values of sensors in the order of the file"});
  WriteTexts(names_group.id(), "mechanisms", mechanisms, {});
  WriteArray(names_group.id(), "body_mechanism", owner, {"", "mechanism of each body, -1: a free body"});
  WriteArray(names_group.id(), "body_index", index,
             {"", "place of each body in its mechanism or among free bodies"});
  WriteArray(names_group.id(), "body_is_interface", is_interface, {"", "1: the body may touch the world"});

  const Hdf5 initial = CreateGroup(file, "initial");
  WriteAttribute(initial.id(), "step", simulation.steps());
  WriteHashAttribute(initial.id(), "hash", simulation.HashState());
  WriteArray(initial.id(), "poses", {names.size(), 7}, poses.data(),
             {"m, 1", "x y z qw qx qy qz before the first step"});
  const auto values = [](const VectorX& v) { return std::vector<double>(v.data(), v.data() + v.size()); };
  WriteArray(initial.id(), "controls", values(simulation.controls()),
             {"rad, m, N or N m, as the control has it", "set before the first step"});
  WriteArray(
      initial.id(), "start_controls", values(simulation.start_controls()),
      {"rad, m, N or N m, as the control has it", "where the first step starts if controls move within it"});
}

void CreateGroups(hid_t file) {
  for (const char* name : {"steps", "reduced", "contacts", "wrenches", "point_springs"})
    CreateGroup(file, name);
}

}  // namespace

struct Recorder::Detail {
  std::string path;
  RecorderOptions options;
  Widths widths;
  DiskState disk;  // before the file, which writes to it until it is closed
  std::optional<OutputFile> output;
  Hdf5 file;
  std::vector<Hdf5> datasets;  // in the order of ForEachColumn; empty handles where a column has no width
  RecordedSteps pending;
  std::vector<RigidTransform> poses;   // scratch
  std::optional<Sensors> sensors;      // where the scene has some
  std::int64_t totals[kNumRows] = {};  // rows appended
  std::int64_t steps_on_disk = 0;
  std::chrono::steady_clock::time_point last_flush = std::chrono::steady_clock::now();
  Expected<void> failure;

  void MakeFile(const Simulation& simulation);
  void Open();
  void CollectStep(const Simulation& simulation, const StepReport& report,
                   const std::vector<AppliedWrench>& wrenches);
  void CollectContacts(const Simulation& simulation);
  void Write();
  std::string WriteFailure() const;

  template <class F>
  Expected<void> Guard(F&& work) {
    if (!failure) return failure;
    const QuietHdf5 quiet;
    try {
      work();
    } catch (const Hdf5Fault& e) {
      failure = Fail(e.code(), path, e.what());
    }
    return failure;
  }
};

Recorder::Recorder() = default;
Recorder::Recorder(Recorder&&) noexcept = default;
Recorder& Recorder::operator=(Recorder&& other) noexcept {
  if (this != &other) {
    if (detail_) static_cast<void>(Finish());
    detail_ = std::move(other.detail_);
  }
  return *this;
}
Recorder::~Recorder() {
  if (!detail_) return;
  try {
    static_cast<void>(Finish());
  } catch (...) {  // out of memory at worst: what was flushed stays
  }
}

Expected<Recorder> Recorder::Create(const std::string& path, const Simulation& simulation,
                                    const RecorderOptions& options) {
  const QuietHdf5 quiet;
  Recorder recorder;
  auto detail = std::make_unique<Detail>();
  Detail& d = *detail;
  d.path = path;
  d.options = options;
  const World& world = simulation.world();
  d.widths.controls = static_cast<int>(simulation.control_names().size());
  d.widths.base_rates = simulation.num_base_coordinates();
  d.widths.bodies = static_cast<int>(simulation.bodies().size());
  d.widths.mechanisms = static_cast<int>(world.mechanisms().size());
  for (int i = 0; i < d.widths.mechanisms; ++i)
    d.widths.coordinates += static_cast<int>(simulation.JointCoordinates(i).size());

  if (!simulation.scene().sensors.empty()) {
    d.sensors.emplace(simulation);
    d.widths.sensors = static_cast<int>(d.sensors->values().size());
  }

  auto output = OutputFile::Create(path, kHdf5File);
  if (!output) return tl::unexpected(output.error());
  d.output.emplace(std::move(*output));
  try {
    d.MakeFile(simulation);
    d.Open();
  } catch (const Hdf5Fault& e) {
    d.datasets.clear();
    d.file.Close();
    return Fail(ErrorCode::kFile, path, d.disk.failed() ? d.WriteFailure() : e.what());
  }
  // Only now does a file that was there before give way.
  if (auto kept = d.output->Commit(); !kept) return tl::unexpected(kept.error());
  recorder.detail_ = std::move(detail);
  return recorder;
}

std::string Recorder::Detail::WriteFailure() const { return "cannot be written: " + disk.Reason(); }

void Recorder::Detail::MakeFile(const Simulation& simulation) {
  const Hdf5 access = DiskAccess(disk);
  Hdf5 made(H5Fcreate(output->part().c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access.id()), H5Fclose);
  if (!made) throw Hdf5Fault("cannot be written (" + LastHdf5Message() + ')', ErrorCode::kFile);
  WriteHeader(made.id(), simulation);
  CreateGroups(made.id());
  ForEachColumn(pending, widths, [&](const Column& column, auto& values) {
    CreateColumn(made.id(), column, MemoryType<typename std::decay_t<decltype(values)>::value_type>());
  });
  if (!made.Close() || disk.failed())
    throw Hdf5Fault("cannot be written (" + LastHdf5Message() + ')', ErrorCode::kFile);
}

// Single writer, many readers: HDF5 then orders its writes so that the file is whole at any moment, and a
// program that is killed leaves it readable. It wants the 1.10 file format and every dataset made beforehand.
void Recorder::Detail::Open() {
  const Hdf5 access = DiskAccess(disk);
  file = Hdf5(H5Fopen(output->part().c_str(), H5F_ACC_RDWR | H5F_ACC_SWMR_WRITE, access.id()), H5Fclose);
  if (!file || disk.failed())
    throw Hdf5Fault("cannot be opened again (" + LastHdf5Message() + ')', ErrorCode::kFile);
  ForEachColumn(pending, widths, [&](const Column& column, auto&) {
    datasets.push_back(column.width > 0 ? OpenDataset(file.id(), column.name) : Hdf5());
  });
}

void Recorder::Detail::CollectContacts(const Simulation& simulation) {
  auto& s = pending;
  for (const BodyContact& c : Contacts(simulation)) {
    s.contact_body_a.push_back(c.body_a);
    s.contact_body_b.push_back(c.body_b);
    for (int k = 0; k < 3; ++k) {
      s.contact_point.push_back(c.point_W(k));
      s.contact_normal.push_back(c.normal_W(k));
      s.contact_force.push_back(c.force_W(k));
    }
    s.contact_gap.push_back(c.gap);
    s.contact_friction.push_back(c.friction);
  }
}

void Recorder::Detail::CollectStep(const Simulation& simulation, const StepReport& report,
                                   const std::vector<AppliedWrench>& wrenches) {
  auto& s = pending;
  StepRows rows;
  rows.first[static_cast<std::size_t>(Rows::kSteps)] = s.time.size();
  rows.first[static_cast<std::size_t>(Rows::kReduced)] = s.z.size();
  rows.first[static_cast<std::size_t>(Rows::kContacts)] = s.contact_gap.size();
  rows.first[static_cast<std::size_t>(Rows::kWrenches)] = s.wrench_body.size();
  rows.first[static_cast<std::size_t>(Rows::kPointSprings)] = s.point_spring_body.size();

  const auto add = [](std::vector<double>& out, const auto& v) {
    out.insert(out.end(), v.data(), v.data() + v.size());
  };
  s.time.push_back(simulation.time());
  s.hash.push_back(simulation.HashState());
  add(s.controls, simulation.controls());
  s.controls_moved.push_back(simulation.last_step().controls_moved ? 1 : 0);
  add(s.base_rates, simulation.last_step().base_rates);
  simulation.Poses(poses);
  for (const RigidTransform& X_WB : poses) AddPose(X_WB, s.poses);
  for (std::size_t i = 0; i < simulation.world().mechanisms().size(); ++i) {
    const MechanismDynamics& m = simulation.world().mechanisms()[i];
    add(s.coordinates, simulation.JointCoordinates(static_cast<int>(i)));
    AddPose(simulation.BasePose(static_cast<int>(i)), s.base_poses);
    add(s.base_twists, simulation.BaseTwist(static_cast<int>(i)));
    s.reduced_sizes.push_back(static_cast<int>(m.state().z.size()));
    add(s.z, m.state().z);
    add(s.w, m.state().w);
  }
  if (sensors) {
    sensors->Update(simulation);
    add(s.sensors, sensors->values());
  }
  const Fidelity& fidelity = simulation.fidelity();
  s.detail.push_back(static_cast<std::uint8_t>(fidelity.level));
  s.modes.push_back(fidelity.modes);
  s.recovery.push_back(static_cast<std::uint8_t>(fidelity.recovery));
  s.kinetic_energy.push_back(simulation.KineticEnergy());
  s.potential_energy.push_back(simulation.PotentialEnergy());
  s.closure_gap.push_back(simulation.ClosureGap());
  s.residual.push_back(report.solver.residual);
  s.max_penetration.push_back(report.max_penetration);
  s.contacts.push_back(report.contacts);
  s.limits.push_back(report.limits);
  s.newton_iterations.push_back(report.solver.newton_iterations);
  s.contact_stage.push_back(report.solver.fallback);
  s.refreshes.push_back(report.refreshes);
  s.failed_refreshes.push_back(report.failed_refreshes);
  s.converged.push_back(report.IsSolved() ? 1 : 0);
  s.contacts_dropped.push_back(report.contacts_dropped ? 1 : 0);
  s.finite.push_back(report.finite ? 1 : 0);
  // A step that was undone leaves the contacts of the one before it.
  if (report.finite) CollectContacts(simulation);
  for (const AppliedWrench& a : wrenches) {
    s.wrench_body.push_back(a.body);
    for (const Vector3* v : {&a.force_W, &a.moment_W, &a.point_W}) add(s.wrench, *v);
  }
  for (const auto& [body, spring] : simulation.last_step().point_springs) {
    s.point_spring_body.push_back(body);
    for (const Vector3* v : {&spring.point_B, &spring.target_start_W, &spring.target_W})
      add(s.point_spring, *v);
    s.point_spring.insert(s.point_spring.end(), {spring.stiffness, spring.damping});
  }

  rows.last[static_cast<std::size_t>(Rows::kSteps)] = s.time.size();
  rows.last[static_cast<std::size_t>(Rows::kReduced)] = s.z.size();
  rows.last[static_cast<std::size_t>(Rows::kContacts)] = s.contact_gap.size();
  rows.last[static_cast<std::size_t>(Rows::kWrenches)] = s.wrench_body.size();
  rows.last[static_cast<std::size_t>(Rows::kPointSprings)] = s.point_spring_body.size();
  for (std::size_t k = 0; k < kNumRows; ++k)
    totals[k] += static_cast<std::int64_t>(rows.last[k] - rows.first[k]);
  s.reduced_end.push_back(totals[static_cast<std::size_t>(Rows::kReduced)]);
  s.contact_end.push_back(totals[static_cast<std::size_t>(Rows::kContacts)]);
  s.wrench_end.push_back(totals[static_cast<std::size_t>(Rows::kWrenches)]);
  s.point_spring_end.push_back(totals[static_cast<std::size_t>(Rows::kPointSprings)]);
  s.checksum.push_back(StepChecksum(s, widths, rows));
}

void Recorder::Detail::Write() {
  last_flush = std::chrono::steady_clock::now();
  if (pending.time.empty()) return;
  std::size_t next = 0;
  ForEachColumn(pending, widths, [&](const Column& column, auto& values) {
    using T = typename std::decay_t<decltype(values)>::value_type;
    const Hdf5& dataset = datasets[next++];
    if (!values.empty() && column.width > 0)
      AppendRows(dataset, MemoryType<T>(), values.size() / static_cast<std::size_t>(column.width),
                 values.data());
    values.clear();
  });
  if (H5Fflush(file.id(), H5F_SCOPE_LOCAL) < 0 && !disk.failed())
    throw Hdf5Fault("cannot be written (" + LastHdf5Message() + ')', ErrorCode::kFile);
  if (disk.failed())
    throw Hdf5Fault(
        WriteFailure() + (disk.error == DiskState::kCutOff
                              ? ""
                              : ". Its first " + std::to_string(steps_on_disk) + " steps are safe"),
        ErrorCode::kFile);
  steps_on_disk = totals[static_cast<std::size_t>(Rows::kSteps)];
}

Expected<void> Recorder::Append(const Simulation& simulation, const StepReport& report,
                                const std::vector<AppliedWrench>& wrenches) {
  FORK1S_REQUIRE(detail_ && (detail_->file || !detail_->failure), "the recording is finished");
  Detail& d = *detail_;
  FORK1S_REQUIRE(static_cast<int>(simulation.bodies().size()) == d.widths.bodies, "another simulation");
  FORK1S_REQUIRE(simulation.controls().size() == d.widths.controls, "another simulation");
  FORK1S_REQUIRE(static_cast<int>(simulation.world().mechanisms().size()) == d.widths.mechanisms);
  for (const AppliedWrench& w : wrenches) FORK1S_REQUIRE(w.body >= 0 && w.body < d.widths.bodies, w.body);
  if (!d.failure) return d.failure;
  d.CollectStep(simulation, report, wrenches);
  const std::chrono::duration<double> waited = std::chrono::steady_clock::now() - d.last_flush;
  constexpr std::size_t kMostValues = 1 << 20;  // 8 MiB
  const bool due = waited.count() >= d.options.flush_interval ||
                   static_cast<int>(d.pending.time.size()) >= d.options.flush_steps ||
                   d.pending.poses.size() + d.pending.coordinates.size() + d.pending.z.size() > kMostValues;
  return due ? d.Guard([&] { d.Write(); }) : d.failure;
}

Expected<void> Recorder::Flush() {
  FORK1S_REQUIRE(detail_ && (detail_->file || !detail_->failure), "the recording is finished");
  return detail_->Guard([&] { detail_->Write(); });
}

Expected<void> Recorder::Finish() {
  FORK1S_REQUIRE(detail_ != nullptr, "moved away");
  Detail& d = *detail_;
  if (!d.file) return d.failure;
  static_cast<void>(d.Guard([&] { d.Write(); }));
  const QuietHdf5 quiet;
  d.datasets.clear();
  const bool closed = d.file.Close();
  if (d.failure && (!closed || d.disk.failed()))
    d.failure = Fail(ErrorCode::kFile, d.path,
                     d.disk.failed() ? d.WriteFailure() : "cannot be closed (" + LastHdf5Message() + ')');
  if (d.failure && !d.output->IsInPlace())
    d.failure =
        Fail(ErrorCode::kFile, d.path,
             "was removed, renamed or replaced by another program while it was written; what was recorded "
             "is in the file that it was, if that still has a name");
  d.output.reset();  // unlocked
  return d.failure;
}

std::int64_t Recorder::steps() const {
  FORK1S_REQUIRE(detail_ != nullptr, "moved away");
  return detail_->totals[static_cast<std::size_t>(Rows::kSteps)];
}

}  // namespace fork1s
