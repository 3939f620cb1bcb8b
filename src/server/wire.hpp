// What travels between the simulation and a viewer. docs/wire.md describes every byte.
//
// Geometry, screws and maps are told once; after that a frame is the base pose, z and the contacts.
#pragma once

#include <cstdint>
#include <fork1s/record/recording.hpp>
#include <fork1s/sim/simulation.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "server/full_ghost.hpp"

namespace fork1s {

/// Counts on whenever a message changes its meaning; a page of another version asks to be loaded again.
inline constexpr int kWireVersion = 7;

/// First word of every binary message.
enum class WireKind : std::uint32_t { kMaps = 1, kFrame = 2, kMeshes = 3, kGhost = 4 };

/// A pull or a push on a body as it acts.
struct ShownPull {
  int body = -1;                      // place in Simulation::bodies()
  Vector3 point_W = Vector3::Zero();  // m, where it acts
  Vector3 target_W = Vector3::Zero();
  Vector3 force_W = Vector3::Zero();  // N
};

/// Numbers of a frame that are no part of the state. Those that nobody computed are NaN.
struct FrameScalars {
  double time = 0;              // s
  double real_time_factor = 0;  // simulated s per s, while running
  double step_us = 0;           // mean of the frame
  double steps = 0;
  double kinetic_energy = 0;    // J
  double potential_energy = 0;  // J
  double joint_gap = 0;         // m
  double penetration = 0;       // m
  double residual = 0;          // of the contact solver
  double load_factor = 0;  // of the grasp: smallest multiple of the contact forces that ejects the object
  double refreshes = 0;    // since the start
  double reduce_ms = 0;    // what the last building of the reduced model took
  double viewers = 0;
  double error = 0;  // m, largest estimated error of a body; NaN while nobody asks for it
};
inline constexpr int kNumScalars = 14;
/// Their names, in the order in which a frame holds them.
const std::vector<std::string>& ScalarNames();

/// Shapes of all bodies and of the still world: JSON; triangles stand in EncodeMeshes, in the order of the
/// JSON's "mesh" numbers. `version`: tells the geometries of one stream apart.
std::string EncodeGeometry(const Simulation& simulation, std::uint32_t version);
std::string EncodeMeshes(const Simulation& simulation);

/// The maps of one mechanism about its present reference: q_ref and Q, in twist mode T and the poses at
/// q_ref, and the compliance of the interface bodies.
std::string EncodeMaps(const MechanismDynamics& dynamics, std::uint32_t epoch, std::uint32_t root,
                       std::uint32_t version);

/// What moves. `versions`: of the maps, one a mechanism. `signals`: as the scene lists them, or none.
std::string EncodeFrame(const Simulation& simulation, std::uint32_t epoch, std::uint32_t sequence,
                        bool paused, const FrameScalars& scalars, const std::vector<std::uint32_t>& versions,
                        const std::vector<ShownPull>& pulls, const std::vector<double>& signals = {});

/// Where the full simulation beside `simulation` has its bodies.
std::string EncodeGhost(const GhostView& view, const Simulation& simulation, std::uint32_t epoch);

/// A recording as the messages of a stream, sixty frames a second: for each message a word that is 1 for
/// binary ones, a word for its length, then its bytes. Frames hold joint displacements (with `exact`
/// recovery) or the poses of all bodies (with `twist`), as the recording does. Errors as of
/// Simulation::Create.
Expected<std::string> EncodeRecording(const Recording& recording, const std::string& title);
/// The viewer's page with such a stream in it: one HTML file that plays without a server.
std::string ReplayPage(std::string_view page, std::string_view stream);

}  // namespace fork1s
