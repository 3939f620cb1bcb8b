// Recordings of a run: written while it runs, opened, replayed bit by bit.
//
// A recording is one HDF5 file. It holds all that the run depends on (scene, options, inputs of every step)
// and what came of it, under names and with units that h5py or MATLAB show without this program.
#pragma once

#include <array>
#include <cstdint>
#include <fork1s/base/error.hpp>
#include <fork1s/sim/simulation.hpp>
#include <memory>
#include <string>
#include <vector>

namespace fork1s {

/// A push from outside during one step: see Simulation::ApplyWrench.
struct AppliedWrench {
  int body = 0;                        // place in Simulation::bodies()
  Vector3 force_W = Vector3::Zero();   // N
  Vector3 moment_W = Vector3::Zero();  // N·m, about point_W
  Vector3 point_W = Vector3::Zero();   // m
};
void ApplyWrenches(const std::vector<AppliedWrench>& wrenches, Simulation& simulation);

/// A contact that carried force, or one that is frozen (see Hold).
struct RecordedContact {
  int body_a = -1;  // place in Simulation::bodies(), -1: the still world
  int body_b = -1;
  Vector3 point = Vector3::Zero();   // m
  Vector3 normal = Vector3::Zero();  // from a to b
  Vector3 force = Vector3::Zero();   // N, on b, friction included, world axes
  double gap = 0;                    // m, negative in penetration
  double friction = 0;               // coefficient
};

/// All steps as plain arrays, row after row; one row a step unless said otherwise. The file holds each as a
/// dataset of the same name, with its unit and meaning as attributes, in the groups /steps, /reduced,
/// /contacts, /wrenches and /point_springs.
struct RecordedSteps {
  std::vector<double> time;                  // s, after the step
  std::vector<std::uint64_t> hash;           // Simulation::HashState() after the step
  std::vector<double> controls;              // x controls: inputs of the step
  std::vector<std::uint8_t> controls_moved;  // Simulation::last_step().controls_moved
  std::vector<double>
      base_rates;             // x coordinates of driven bases: Simulation::SetBaseRate, NaN where not set
  std::vector<double> poses;  // x bodies x 7: x y z [m], qw qx qy qz
  /// x joint coordinates of all mechanisms as the scene has them, from the reference [rad, m].
  std::vector<double> coordinates;
  /// x values of Sensors, those of the scene one after another; NaN: no value.
  std::vector<double> sensors;
  std::vector<double> base_poses;              // x mechanisms x 7
  std::vector<double> base_twists;             // x mechanisms x 6, in R about R's origin [rad/s, m/s]
  std::vector<int> reduced_sizes;              // x mechanisms: r, which a refresh may change
  std::vector<std::uint8_t> detail, recovery;  // Fidelity of the step
  std::vector<int> modes;                      // the same
  std::vector<double> kinetic_energy, potential_energy;  // J
  std::vector<double> closure_gap;                       // m
  std::vector<double> residual;                          // of the contact solver
  std::vector<double> max_penetration;                   // m
  std::vector<int> contacts, limits, newton_iterations, contact_stage, refreshes, failed_refreshes;
  std::vector<std::uint8_t> converged, contacts_dropped, finite;
  std::vector<std::uint64_t> checksum;  // of all other values of the step

  // Tables in which a step has any number of rows: row `end` of the step before up to `end` of the step.
  std::vector<std::int64_t> reduced_end, contact_end, wrench_end, point_spring_end;
  std::vector<double> z, w;  // mechanism after mechanism
  std::vector<int> contact_body_a, contact_body_b;
  std::vector<double> contact_point, contact_normal, contact_force;  // x 3
  std::vector<double> contact_gap, contact_friction;
  std::vector<int> wrench_body;
  std::vector<double> wrench;  // x 9: force, moment, point
  std::vector<int> point_spring_body;
  std::vector<double> point_spring;  // x 11: point, target at start and end, stiffness, damping
};

struct RecorderOptions {
  double flush_interval = 0.5;  // s of wall time after which rows go to the file at the latest
  int flush_steps = 512;        // steps after which they go at the latest
};

/// Writes a recording while the simulation runs.
///
///     auto recorder = Recorder::Create("run.h5", *simulation);
///     for (...) { StepReport report = simulation->Step(); recorder->Append(*simulation, report); }
///     recorder->Finish();
///
/// The file can be opened at any moment, also after the program was killed, up to the last flush. Changes
/// made through Simulation::world() or step_options() are not inputs of a step: a replay shows them as a
/// difference.
class Recorder {
 public:
  /// Overwrites the file. Start before the first step, or the recording can be viewed but not replayed.
  /// Errors: kFile.
  static Expected<Recorder> Create(const std::string& path, const Simulation& simulation,
                                   const RecorderOptions& options = {});
  /// Finishes; failures can no longer be told.
  ~Recorder();
  Recorder(Recorder&&) noexcept;
  Recorder& operator=(Recorder&&) noexcept;

  /// Call after every step, with the wrenches that were applied for it. Errors: kFile, such as a full disk;
  /// the steps already flushed stay readable.
  Expected<void> Append(const Simulation& simulation, const StepReport& report,
                        const std::vector<AppliedWrench>& wrenches = {});
  Expected<void> Flush();
  /// Flushes and closes. Nothing can be appended after it; a second call does nothing.
  Expected<void> Finish();
  std::int64_t steps() const;

 private:
  Recorder();
  struct Detail;
  std::unique_ptr<Detail> detail_;
};

/// What stands in a recording before its steps.
struct RecordingHeader {
  std::string path;
  std::string program;    // that wrote it, with its version
  bool finished = false;  // false: the writer was killed or still runs
  /// False where a version wrote it whose steps were others: it can be read, and not be replayed.
  bool has_steps_of_this_version = true;
  Scene scene;
  SimulationOptions options;  // dt is that of the run
  std::vector<SceneBody> bodies;
  std::vector<std::string> control_names;
  std::vector<std::string> coordinate_names;
  /// Of all values of sensors: NAME, or NAME.0, NAME.1, ... Empty in files up to version 19, which do not have them.
  std::vector<std::string> sensor_names;
  std::int64_t first_step = 0;  // steps made before the recording began
  std::uint64_t initial_hash = 0;
  std::vector<double> initial_poses;  // bodies x 7
  std::vector<double> initial_controls,
      start_controls;  // set before the first step; Simulation::start_controls()
};

/// A recording in memory, checked: every array has its length and every step its checksum.
class Recording {
 public:
  /// Errors: kFile for files that are missing, cut off or no HDF5; kFormat for other content or another
  /// version. A recording whose writer was killed opens up to the last whole step.
  static Expected<Recording> Open(const std::string& path);

  const RecordingHeader& header() const { return header_; }
  const Scene& scene() const { return header_.scene; }
  const std::vector<SceneBody>& bodies() const { return header_.bodies; }
  const RecordedSteps& data() const { return data_; }
  int num_steps() const { return static_cast<int>(data_.time.size()); }

  /// Steps count from 0; step -1 is the state before the first. Out of range throws std::invalid_argument.
  RigidTransform Pose(int step, int body) const;
  VectorX Controls(int step) const;
  /// Simulation::last_step().base_rates after the step.
  VectorX BaseRates(int step) const;
  VectorX Coordinates(int step) const;
  /// Reduced coordinates of a mechanism and their rates.
  VectorX ReducedCoordinates(int step, int mechanism) const;
  VectorX ReducedRates(int step, int mechanism) const;
  std::vector<RecordedContact> Contacts(int step) const;
  std::vector<AppliedWrench> Wrenches(int step) const;
  std::vector<Simulation::BodyPointSpring> PointSprings(int step) const;
  StepReport Report(int step) const;
  /// With what fidelity the step was made.
  Fidelity FidelityOf(int step) const;

 private:
  friend class RecordingReader;
  Recording() = default;
  std::array<std::size_t, 2> ReducedRange(int step, int mechanism) const;

  RecordingHeader header_;
  RecordedSteps data_;
};

/// A recording of any length, a stretch of steps after the other: for files that do not fit into memory.
class RecordingReader {
 public:
  /// `bytes`: about as much as a stretch may hold. Errors: as Recording::Open.
  static Expected<RecordingReader> Open(const std::string& path, std::size_t bytes = std::size_t{32} << 20);
  ~RecordingReader();
  RecordingReader(RecordingReader&&) noexcept;
  RecordingReader& operator=(RecordingReader&&) noexcept;

  const RecordingHeader& header() const;
  /// The next steps as a recording of their own, whose step 0 is the first of them; without steps at the end.
  /// Errors: as Recording::Open, for damage in these steps.
  Expected<Recording> Next();

 private:
  RecordingReader();
  struct Detail;
  std::unique_ptr<Detail> detail_;
};

/// Which of increasing times [s] to show at `fps` frames a second: the first, then the first at or after
/// every further frame, which leaves out times where they are denser than the frames. fps 0: all.
std::vector<std::size_t> FirstOfEachFrame(const std::vector<double>& times, double fps);

/// For programs, before anything else of this room: HDF5 shall not tidy up when the program ends. Files here
/// close themselves, and what HDF5 keeps of a damaged one makes its tidying run in circles and print so.
void DisableHdf5Cleanup();

struct ReplayResult {
  int steps = 0;                   // replayed
  bool identical = false;          // every hash is the recorded one
  int first_difference_step = -1;  // in steps made: 0 the initial state, 1 after the first step; -1: none
  std::uint64_t final_hash = 0;
};

/// Simulates the recorded scene with the recorded inputs and compares the state after every step. The program
/// that wrote the recording gives the same bits; another compiler or instruction set may not. Errors: kUsage
/// for a recording that began in the middle of a run; kFormat, kModel for scenes that cannot be built.
Expected<ReplayResult> Replay(const Recording& recording);
/// The same from the file, whatever its length.
Expected<ReplayResult> Replay(RecordingReader& reader);

}  // namespace fork1s
