// Machines on legs that stand under proportional-derivative control: a hexapod of our own, and a quadruped
// and two bipeds from a folder of models beside the project, which are read from there and not part of it.
#pragma once

#include <fork1s/importer/importer.hpp>
#include <fork1s/sim/simulation.hpp>
#include <string>
#include <vector>

namespace fork1s::examples {

enum class LeggedRobot {
  kHexapod,  ///< scenes/hexapod.xml; on uneven ground scenes/hexapod_terrain.xml, where its ram waits
  kAnymal,   ///< ANYmal C, four legs of three servos: MODELS/anybotics_anymal_c
  kCassie,   ///< Cassie, two legs with leaf springs and four loops: MODELS/agility_cassie
  kDigit,    ///< two legs like those of Digit, with six loops: MODELS/digit_like_2legs
};
enum class LeggedGround {
  kFlat,    ///< the plane z = 0
  kUneven,  ///< tilted tiles, their highest corners at z = 0; for the hexapod its own terrain
};
/// "hexapod", "anymal", "cassie" or "digit"; "flat" or "uneven".
const char* Name(LeggedRobot robot);
const char* Name(LeggedGround ground);

struct LeggedOptions {
  std::string scenes;  // folder of the project's scenes
  std::string models;  // folder of the other models
  LeggedGround ground = LeggedGround::kFlat;
  double gain_scale = 1;  // of what holds every driven joint; dampers go with its root
};

/// A point of a foot that may touch: the centre of a ball, either end of a capsule's axis.
struct FootPoint {
  std::string body;
  Vector3 p_B = Vector3::Zero();  // m, in the frame of the body
};

struct LeggedScene {
  /// Its initial keyframe, where it has one, is "standing": the lowest foot touches z = 0.
  ImportedScene imported;
  std::string trunk;
  Matrix3 R_trunk = Matrix3::Identity();  // attitude of the upright trunk
  std::vector<FootPoint> feet;
};

/// Errors: kFile with the folder that is missing; those of LoadMechanism; kModel where a file is not the one
/// that is known here.
Expected<LeggedScene> LoadLegged(LeggedRobot robot, const LeggedOptions& options);

/// The file of a robot in the folder of models; empty for the hexapod.
std::string ModelFile(LeggedRobot robot, const std::string& models);

/// Tiles of `pitch` [m] that cover a square of 2 `half` [m] about the origin, each tilted by up to `tilt`
/// [rad] each way and up to `depth` [m] lower than the highest. Equal arguments give equal tiles.
std::vector<GeometryDef> UnevenGround(double half, double pitch, double depth, double tilt);

/// Starts it in its keyframe.
SimulationOptions StandingOptions(const LeggedScene& legged);

/// What a robot did while it was to stand.
struct StandMeasurement {
  int steps = 0, unconverged = 0;
  bool finite = true;
  std::vector<double> step_us;
  // After the settling time:
  double foot_motion = 0;    // m, of any foot point from where it was then
  double foot_step = 0;      // m, of any foot point in one step
  double trunk_motion = 0;   // m, of the trunk's origin
  double lean = 0;           // rad, of the trunk from upright
  double swing[2] = {0, 0};  // J, largest kinetic energy in the first and in the second half of that time
  double penetration = 0;    // m
  double joint_gap = 0;      // m, of any joint or loop, from the start on
  int contacts_min = 0;      // that carry force
};

/// Lets it stand for `time` [s], of which `settling` [s] to come to rest.
StandMeasurement Stand(Simulation& simulation, const LeggedScene& legged, double settling, double time);

}  // namespace fork1s::examples
