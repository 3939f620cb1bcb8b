// Writes the control tables of scenes/, and the ground of one: scene_motions FOLDER.
//
// Each motion is given by a function of time; rows stand 1/30 s apart, and values between rows are linear.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <fstream>
#include <functional>
#include <map>
#include <numbers>
#include <string>
#include <vector>

#include "broken_ground.hpp"
#include "motions.hpp"

namespace {

using fork1s::examples::LegAngles;
using fork1s::examples::Ramp;
using fork1s::examples::Reach;
using fork1s::examples::Row;

constexpr double kPi = std::numbers::pi;

struct Motion {
  std::string scene;
  std::string comment;
  double end;  // s
  std::function<Row(double)> at;
};

// ---- hexapod_terrain: a tripod gait. ----

Row Walk(double t) {
  constexpr double kStart = 4, kPeriod = 1.2, kStride = 0.05, kLift = 0.03;
  const struct {
    const char* name;
    double azimuth;
    int tripod;
  } legs[] = {{"front_left", kPi / 4, 0},   {"middle_left", kPi / 2, 1},   {"rear_left", 3 * kPi / 4, 0},
              {"front_right", -kPi / 4, 1}, {"middle_right", -kPi / 2, 0}, {"rear_right", -3 * kPi / 4, 1}};
  Row row;
  const double fade = Ramp(t, kStart, kStart + 0.5);
  for (const auto& leg : legs) {
    const double phase = std::fmod(std::max(t - kStart, 0.0) / kPeriod + 0.5 * leg.tripod, 1.0);
    double forward = 0, up = 0;
    if (phase < 0.5) {  // swing, from behind to the front
      forward = kStride * (Ramp(phase, 0, 0.5) - 0.5);
      up = kLift * std::pow(std::sin(2 * kPi * phase), 2);
    } else {
      forward = kStride * (0.5 - 2 * (phase - 0.5));
    }
    const double c = std::cos(leg.azimuth), s = std::sin(leg.azimuth);
    const LegAngles q = Reach(0.12 + fade * forward * c, -fade * forward * s, -0.08 + fade * up);
    row[std::string(leg.name) + "_yaw"] = q.yaw;
    row[std::string(leg.name) + "_hip"] = q.hip;
    row[std::string(leg.name) + "_knee"] = q.knee;
  }
  row["ram"] = 0.38 * (Ramp(t, 2, 2.5) - Ramp(t, 2.7, 3.4));
  return row;
}

// ---- hammer: one blow on the anvil, one on the nail. ----

Row Swing(double t) {
  // 1: raised; 0: the pose of the blow; a little below it, so that the hammer is pressed on.
  const double raised = Ramp(t, 0.2, 1.0) - 1.06 * Ramp(t, 1.1, 1.35) + 1.06 * Ramp(t, 1.8, 2.6) -
                        1.06 * Ramp(t, 3.0, 3.25) + 0.6 * Ramp(t, 3.25, 3.9);
  return {{"shoulder_flex", 0.45 * raised},
          {"elbow_flex", 0.9 * raised},
          {"wrist_deviate", 0.35 * raised},
          {"shoulder_turn", -0.35 * Ramp(t, 2.0, 2.7)}};
}

// ---- peg_in_hole: the peg goes straight down, by the shoulder, elbow and wrist of an arm in its plane. ----

Row Insert(double t) {
  // Upper arm from the shoulder at the origin to the elbow, forearm level from there.
  const double upper = std::hypot(0.1, 0.28), fore = 0.26;
  const double x = 0.36, z = -0.28 - 0.025 * Ramp(t, 0.2, 1.2) - 0.05 * Ramp(t, 1.5, 4);
  const double d = std::hypot(x, z);
  const double at_shoulder = std::acos((upper * upper + d * d - fore * fore) / (2 * upper * d));
  const double at_elbow = std::acos((upper * upper + fore * fore - d * d) / (2 * upper * fore));
  const double upper_angle = std::atan2(z, x) - at_shoulder, fore_angle = upper_angle + kPi - at_elbow;
  const double flex = upper_angle - std::atan2(-0.28, 0.1), bend = fore_angle - flex;
  return {{"shoulder_flex", flex}, {"elbow_flex", bend}, {"wrist_deviate", -fore_angle}};
}

// ---- grasp_sphere, grasp_box, grasp_mug: close, squeeze, lift, shake, turn over, hold, turn back. ----

struct Finger {
  const char* name;
  double y;                      // m, of its plane in the palm
  double proximal, middle, tip;  // m, lengths
  double radius;                 // m, of the pad
  double kp[3];                  // N m/rad, of knuckle, middle and tip joint
  double share;                  // of the grip
};

const Finger kFingers[] = {{"index", 0.033, 0.045, 0.025, 0.02, 0.008, {2, 1.5, 1}, 0.25},
                           {"middle", 0.011, 0.048, 0.028, 0.021, 0.008, {2, 1.5, 1}, 0.25},
                           {"ring", -0.011, 0.045, 0.026, 0.02, 0.008, {2, 1.5, 1}, 0.25},
                           {"little", -0.033, 0.038, 0.021, 0.018, 0.0075, {2, 1.5, 1}, 0.25},
                           {"thumb", 0, 0.04, 0.032, 0.025, 0.009, {5, 4, 3}, 1}};

// Fingers stand beside an object whose middle is `below` the palm, pads upright: a round one of `radius`, or
// a flat one of that half width.
Row Grasp(double t, double radius, double below, double grip, bool flat = false) {
  constexpr double kKnuckle = 0.035;  // m, from the middle of the palm
  Row row;
  const double close = Ramp(t, 0, 1.2), squeeze = Ramp(t, 1.2, 1.8);
  for (const Finger& f : kFingers) {
    const double reach = radius + f.radius;
    const double x = (flat ? reach : std::sqrt(reach * reach - f.y * f.y)) - kKnuckle,
                 down = below - 0.5 * f.tip;
    const double d = std::hypot(x, down), a = f.proximal, b = f.middle;
    const double first = std::atan2(down, x) - std::acos((a * a + d * d - b * b) / (2 * a * d));
    const double bend = kPi - std::acos((a * a + b * b - d * d) / (2 * a * b));
    // A level force at the middle of the pad turns the joints by its arm below each of them.
    const double force = squeeze * grip * f.share;
    const double arms[3] = {below, below - a * std::sin(first), 0.5 * f.tip};
    const double angles[3] = {first, bend, kPi / 2 - first - bend};
    const char* joints[3] = {"_knuckle_flex", "_middle_flex", "_tip_flex"};
    for (int i = 0; i < 3; ++i)
      row[std::string(f.name) + joints[i]] = close * angles[i] + force * arms[i] / f.kp[i];
  }
  const double shake = Ramp(t, 3, 3.3) - Ramp(t, 4.7, 5),
               wave = 0.02 * shake * std::sin(2 * kPi * 3 * (t - 3));
  row["palm.z"] = 0.25 * Ramp(t, 2, 3) + (t < 4 ? wave : 0);
  row["palm.x"] = t < 4 ? 0 : wave;
  row["palm.rx"] = kPi * (Ramp(t, 5.5, 7.5) - Ramp(t, 8.5, 10.5));
  return row;
}

Row GraspSphere(double t) { return Grasp(t, 0.045, 0.063, 12); }
Row GraspBox(double t) { return Grasp(t, 0.04, 0.063, 12, true); }
Row GraspMug(double t) { return Grasp(t, 0.04, 0.066, 12); }

bool Write(const std::string& folder, const Motion& motion) {
  const std::string path = folder + "/" + motion.scene + ".csv";
  std::ofstream out(path);
  out << "# " << motion.comment << "\ntime";
  for (const auto& [name, value] : motion.at(0)) out << ',' << name;
  out << '\n';
  for (int i = 0; i <= static_cast<int>(std::lround(30 * motion.end)); ++i) {
    const double t = i / 30.0;
    out << std::round(t * 1e6) * 1e-6;
    for (const auto& [name, value] : motion.at(t)) out << ',' << std::round(value * 1e6) * 1e-6 + 0.0;
    out << '\n';
  }
  if (!out) std::fprintf(stderr, "%s cannot be written\n", path.c_str());
  return static_cast<bool>(out);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 2) return std::fprintf(stderr, "usage: scene_motions FOLDER\n"), 2;
  const std::vector<Motion> motions = {
      {"hexapod_terrain", "Set-points in rad: stands, is pushed by the ram, walks in a tripod gait.", 12,
       Walk},
      {"hammer", "Set-points in rad: one blow on the anvil, one on the nail.", 5, Swing},
      {"peg_in_hole", "Set-points in rad: the peg goes straight down by 75 mm.", 5, Insert},
      {"grasp_sphere", "Set-points in rad, palm in m and rad: close, lift, shake, turn over and back.", 12,
       GraspSphere},
      {"grasp_box", "Set-points in rad, palm in m and rad: close, lift, shake, turn over and back.", 12,
       GraspBox},
      {"grasp_mug", "Set-points in rad, palm in m and rad: close, lift, shake, turn over and back.", 12,
       GraspMug},
      {"beam_walkers", "Set-points in rad: two machines stand, walk 1.26 m and up a step, stand.",
       fork1s::examples::kBeamWalkEnd, fork1s::examples::CarryBeam},
      {"excavator", "Set-points in m and rad: digs, lifts, swings, lets fall, comes back.",
       fork1s::examples::kDigEnd, fork1s::examples::Dig},
  };
  for (const Motion& motion : motions)
    if (!Write(argv[1], motion)) return 1;
  const std::string ground = std::string(argv[1]) + "/hexapod_terrain.hfield";
  if (fork1s::examples::WriteBrokenGround(ground)) return 0;
  return std::fprintf(stderr, "%s cannot be written\n", ground.c_str()), 1;
}
