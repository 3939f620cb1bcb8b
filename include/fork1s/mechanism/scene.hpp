// A scene: mechanisms, free rigid bodies and the still world, as data.
#pragma once

#include <fork1s/mechanism/definition.hpp>
#include <fork1s/mechanism/sensor.hpp>
#include <string>
#include <utility>
#include <vector>

namespace fork1s {

/// A rigid body that is not part of a mechanism.
struct FreeBodyDef {
  std::string name;
  RigidTransform X_WB;
  SpatialInertia inertia;  // in B
  std::vector<GeometryDef> geometries;
  double gravity_compensation = 0;  // share of the weight that is compensated, as in MJCF; 1: all of it
};

/// A named initial state.
struct KeyframeDef {
  struct MechanismState {
    VectorX q;  // displacements of the mechanism's coordinates, in the order of its definition
    VectorX q_dot;
    RigidTransform X_WR;
    Vector6 V_R = Vector6::Zero();  // base twist in R about R's origin
    VectorX controls;
    VectorX activation =
        {};  // as controls, read of those with dynamics; empty: ControlDef::initial_activation
  };
  struct FreeBodyState {
    RigidTransform X_WB;
    Vector3 omega_W = Vector3::Zero();     // rad/s, world axes
    Vector3 velocity_W = Vector3::Zero();  // m/s, of the body's origin
  };
  std::string name;
  std::vector<MechanismState> mechanisms;
  std::vector<FreeBodyState> free_bodies;
};

struct Scene {
  std::string name;
  Vector3 gravity = Vector3(0, 0, -9.81);  // m/s²
  double timestep = 1.0 / 60;              // s
  std::vector<MechanismDef> mechanisms;
  std::vector<FreeBodyDef> free_bodies;
  std::vector<GeometryDef> world;  // still geometry
  std::vector<std::pair<std::string, std::string>>
      excluded_pairs;                         // bodies that never touch; "world" is the world
  std::vector<ContactPairDef> contact_pairs;  // shapes that touch by a law of their own
  std::vector<KeyframeDef> keyframes;
  std::vector<SensorDef> sensors;  // in the order of the file; names differ
};

}  // namespace fork1s
