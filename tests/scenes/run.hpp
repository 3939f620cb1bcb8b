// A scene of scenes/ with its control table, stepped at 1/60 s, and what went on meanwhile.
#pragma once

#include <demo/support.hpp>
#include <filesystem>
#include <fork1s/record/csv.hpp>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include <functional>
#include <ostream>

namespace fork1s::examples {

/// What a stretch of a run met.
struct Course {
  bool finite = true;
  int unconverged = 0;
  int contacts_max = 0;
  double gap = 0;          // m, of any loop
  double penetration = 0;  // m
  double force_max = 0;    // N, of one contact
  double rise_max = 0;     // J that a step ends with above its start, after the controls of the step were set
  double kinetic_max = 0;  // J
};

class SceneRun {
 public:
  /// `controls`: name of the control table, where it is not that of the scene.
  explicit SceneRun(const std::string& name, double stiffness = 1, double damping = 1,
                    const std::string& controls = "")
      : simulation_(Start(Definition(name, stiffness, damping))) {
    const std::string table = FORK1S_SOURCE_DIR "/scenes/" + (controls.empty() ? name : controls) + ".csv";
    if (std::filesystem::exists(table)) {
      auto track = ReadControls(table);
      if (!track) throw std::runtime_error(track.error().Text());
      if (!track->FindMissing(simulation_).empty()) throw std::runtime_error(table + " has unknown names");
      track_ = std::move(*track);
    }
    track_.Apply(0, simulation_);
  }

  Simulation& simulation() { return simulation_; }
  Vector3 Position(const std::string& body) const { return simulation_.Pose(body).translation(); }

  /// Steps until `time` [s].
  Course Until(double time, const std::function<void(const StepReport&)>& after_step = {}) {
    Course course;
    while (simulation_.time() < time - 1e-9 && course.finite) {
      track_.Apply(simulation_.time() + simulation_.dt(), simulation_);
      const double before = EnergyUnderNewControls();
      const StepReport report = simulation_.Step(!track_.times.empty());
      course.finite = report.finite;
      course.unconverged += report.IsSolved() ? 0 : 1;
      course.contacts_max = std::max(course.contacts_max, report.contacts);
      course.gap = std::max(course.gap, simulation_.ClosureGap());
      course.penetration = std::max(course.penetration, report.max_penetration);
      for (const ContactRecord& c : simulation_.world().contacts())
        course.force_max = std::max(course.force_max, c.impulse.norm() / simulation_.dt());
      course.rise_max = std::max(course.rise_max, simulation_.Energy() - before);
      course.kinetic_max = std::max(course.kinetic_max, simulation_.KineticEnergy());
      if (after_step) after_step(report);
    }
    return course;
  }

  /// The scene with its springs and dampers scaled.
  static Scene Definition(const std::string& name, double stiffness, double damping) {
    ImportOptions options;
    options.stiffness_scale = stiffness;
    Scene scene = Load(name, options).scene;
    for (MechanismDef& m : scene.mechanisms)
      for (JointDef& joint : m.joints)
        for (FreedomDef& freedom : joint.freedoms) freedom.damping *= damping;
    return scene;
  }

 private:
  // A moved set-point does its work on the spring at the pose that is, before the step; a changed torque too.
  double EnergyUnderNewControls() {
    Eigen::Index next = 0;
    for (MechanismDynamics& m : simulation_.world().mechanisms()) {
      m.controls() = simulation_.controls().segment(next, m.controls().size());
      next += m.controls().size();
    }
    return simulation_.Energy();
  }

  Simulation simulation_;
  ControlTrack track_;
};

/// Force on `body` by contact in the last step, N.
inline Vector3 ContactForce(const Simulation& simulation, const std::string& body) {
  Vector3 sum = Vector3::Zero();
  const World& world = simulation.world();
  for (const ContactRecord& c : world.contacts()) {
    const Vector3 on_b = c.point.frame.transpose() * c.impulse / simulation.dt();
    if (world.collision_bodies()[static_cast<std::size_t>(c.point.body_b)].name == body) sum += on_b;
    if (world.collision_bodies()[static_cast<std::size_t>(c.point.body_a)].name == body) sum -= on_b;
  }
  return sum;
}

}  // namespace fork1s::examples
