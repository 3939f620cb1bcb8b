// A ball between two fingertips that do not turn: the grasp whose critical force has a closed form.
#pragma once

#include <fork1s/mechanism/builder.hpp>
#include <stepping/support.hpp>

namespace fork1s::testing {

/// Two spheres on three slides each press a ball from either side.
struct Squeeze {
  double radius, tip;  // m
  double k_t;          // N/m
  double share;        // of the critical force with which each finger presses
  double k_n = 2000;   // N/m

  /// Normal force [N] above which the ball is ejected.
  double Critical() const { return k_t * (radius + tip); }
  /// Turns the ball by some hundredth of a radian.
  double SmallTorque() const { return 0.02 * k_t * radius * radius; }

  Scene Make(double tilt = 0) const {
    constexpr double kSlop = 1e-4;
    Scene scene;
    scene.free_bodies.push_back(BallBody("ball", 0.1, radius, Vector3::Zero(), 2));
    MechanismBuilder builder("gripper");
    const Matrix3 R = Eigen::AngleAxisd(tilt, Vector3(1, 2, 3).normalized()).toRotationMatrix();
    for (int side : {-1, 1}) {
      BodyDef body;
      body.name = side < 0 ? "left" : "right";
      body.parent = builder.base();
      body.X_PB = RigidTransform(R, R * Vector3(side * (radius + tip), 0, 0));
      body.inertia.mass = 0.02;
      body.inertia.rotational = 1e-6 * Matrix3::Identity();
      body.geometries.push_back(Geometry(body.name + "_pad", Sphere{tip}, 2));
      const BodyIndex b = builder.AddBody(body);
      JointDef slides = JointDef::General(body.name + "_slides", b, Matrix6X::Identity(6, 6).rightCols(3));
      for (FreedomDef& f : slides.freedoms) {
        f.stiffness = k_t;
        f.damping = k_t / 50;  // overdamped: what is unstable leaves slowly, what is stable returns
      }
      slides.freedoms[0].stiffness = k_n;
      slides.freedoms[0].damping = k_n / 50;
      slides.freedoms[0].rest = -side * (share * Critical() / k_n + kSlop / 2);
      builder.AddJoint(slides);
    }
    builder.SetInterfaces({"left", "right"});
    scene.mechanisms.push_back(builder.definition());
    return scene;
  }
};

/// Soft in the normal direction: stiff springs would lose force as the tips roll off and stop the ejection at
/// a new balance.
inline Squeeze SoftSqueeze(double share) { return {0.045, 0.015, 300, share, 50}; }

/// Of a pose, from the world's axes [rad].
inline double Turn(const RigidTransform& X) { return Eigen::AngleAxisd(Matrix3(X.rotation())).angle(); }

}  // namespace fork1s::testing
