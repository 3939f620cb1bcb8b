// Mass matrix, Jacobians and forces of a simulation, for controllers.
#include <nanobind/nanobind.h>
#include <nanobind/stl/vector.h>
#include <fork1s/stepping/mechanism_dynamics.hpp>
#include "text.hpp"

#include "arrays.hpp"
#include "bind.hpp"
#include "runner.hpp"
#include "study/file_dynamics.hpp"

namespace fork1s::python {
namespace {

// f of the dynamics at the present state.
template <class F>
auto Ask(Runner& runner, F&& f) {
  const std::vector<FileJoint>& joints = runner.model()->joints();
  return runner.With([&](Simulation& s) { return f(FileDynamics(s, joints)); });
}

Array JacobianOf(Runner& runner, const std::string& body, const nb::object& point) {
  const int index = runner.FindBody(body);
  const Vector3 point_B = ReadOrZero(point, "point");
  return OwnMatrix(Ask(runner, [&](const FileDynamics& d) { return d.ComputeJacobian(index, point_B); }));
}

nb::dict ActivationsOf(Runner& runner) {
  const auto all = runner.With([](Simulation& s) {
    std::vector<std::pair<std::string, double>> found;
    for (const MechanismDynamics& m : s.world().mechanisms())
      for (Eigen::Index k = 0; k < m.controls().size(); ++k)
        if (m.HasDynamics(k))
          found.emplace_back(m.mechanism().controls()[static_cast<std::size_t>(k)].name, m.activation()(k));
    return found;
  });
  nb::dict out;
  for (const auto& [name, value] : all) out[name.c_str()] = value;
  return out;
}

nb::tuple HoldingControlsOf(Runner& runner) {
  const HoldingControls found = Ask(runner, [](const FileDynamics& d) { return d.ComputeHoldingControls(); });
  const std::vector<std::string> names = runner.With([](Simulation& s) { return s.control_names(); });
  nb::dict controls;
  for (Eigen::Index i = 0; i < found.controls.size(); ++i)
    controls[names[static_cast<std::size_t>(i)].c_str()] = found.controls(i);
  return nb::make_tuple(controls, OwnVector(found.residual));
}

std::vector<std::string> VelocityNames(const Runner& runner) {
  std::vector<std::string> names;
  for (const FileJoint& joint : runner.model()->joints()) {
    const bool is_free = joint.kind == FileJoint::Kind::kFree;
    if (joint.num_velocities() == 1) names.push_back(joint.name);
    if (is_free)
      for (const char* axis : {".x", ".y", ".z"}) names.push_back(joint.name + axis);
    if (is_free || joint.kind == FileJoint::Kind::kBall)
      for (const char* axis : {".rx", ".ry", ".rz"}) names.push_back(joint.name + axis);
  }
  return names;
}

// name -> (7,) of all sites or all cameras.
nb::dict FramePoses(Runner& runner, FileFrame::Kind kind) {
  const ImportedScene& imported = runner.model()->imported();
  const auto poses = runner.With([&](Simulation& s) {
    std::vector<std::pair<std::string, std::vector<double>>> all;
    for (const FileFrame& f : imported.frames) {
      if (f.kind != kind) continue;
      RigidTransform X_WB;
      const SensorBody& body = f.frame.body;
      if (body.mechanism >= 0) {
        const MechanismDef& def = imported.scene.mechanisms[static_cast<std::size_t>(body.mechanism)];
        X_WB = s.Pose(def.bodies[body.body.u()].name);
      } else if (body.free_body >= 0) {
        X_WB = s.Pose(imported.scene.free_bodies[static_cast<std::size_t>(body.free_body)].name);
      }
      std::vector<double> row(7);
      WritePose(X_WB * f.frame.X_BF, row.data());
      all.emplace_back(f.name, std::move(row));
    }
    return all;
  });
  nb::dict out;
  for (const auto& [name, row] : poses) out[name.c_str()] = ToArray(row);
  return out;
}

}  // namespace

void BindDynamics(nb::class_<Runner>& simulation) {
  simulation.def_prop_ro(
      "velocity_names", VelocityNames,
      "Names of the nv entries of `qvel`, of rows of `mass_matrix` and columns of `jacobian`: the "
      "joint, and of a free joint .x .y .z (world axes), of free and ball joints .rx .ry .rz (axes "
      "of the body).");
  simulation.def_prop_ro(
      "activations", ActivationsOf,
      "Name -> activation of the controls that have dynamics: what their force is proportional to, in units of the "
      "control, or of the control times s where it is integrated.",
      nb::sig("def activations(self) -> dict[str, float]"));
  simulation.def_prop_ro(
      "mass_matrix",
      [](Runner& r) {
        return OwnMatrix(Ask(r, [](const FileDynamics& d) { return d.ComputeMassMatrix(); }));
      },
      "(nv, nv) mass matrix of all joint coordinates at the present state, in the velocities `qvel`: kinetic energy is "
      "qvel @ mass_matrix @ qvel / 2. Armature included, loops open, as MuJoCo's `mj_fullM`. Of the reduced coordinates: "
      "`Model.matrices`.",
      kOwn);
  simulation.def_prop_ro(
      "site_poses", [](Runner& r) { return FramePoses(r, FileFrame::Kind::kSite); },
      "Name -> (7,) of the sites of the file: position [m], unit quaternion w x y z with w >= 0, world frame.",
      nb::sig("def site_poses(self) -> dict[str, numpy.typing.NDArray[numpy.float64]]"));
  simulation.def_prop_ro(
      "camera_poses", [](Runner& r) { return FramePoses(r, FileFrame::Kind::kCamera); },
      "Name -> (7,) of the cameras of the file, as they are fixed to their bodies; they look along -z. Cameras "
      "that track or target a body have no pose here.",
      nb::sig("def camera_poses(self) -> dict[str, numpy.typing.NDArray[numpy.float64]]"));
  simulation.def(
      "jacobian", JacobianOf, nb::arg("body"), nb::arg("point") = nb::none(),
      "(6, nv) of a point of a body: angular velocity, then velocity of the point, world axes, per entry of `qvel`; "
      "columns of floating bases and free bodies included.\n\npoint: (3,) m from the body's origin, in its axes; the "
      "origin by default. Raises UnknownNameError, ValueError.",
      nb::sig("def jacobian(self, body: str, point: numpy.typing.ArrayLike | None = None) -> "
              "numpy.typing.NDArray[numpy.float64]"));
  simulation.def_prop_ro(
      "gravity_forces",
      [](Runner& r) {
        return OwnVector(Ask(r, [](const FileDynamics& d) { return d.ComputeGravityForce(); }));
      },
      "(nv,) generalized forces of gravity, N and N·m.", kOwn);
  simulation.def_prop_ro(
      "spring_and_control_forces",
      [](Runner& r) {
        return OwnVector(Ask(r, [](const FileDynamics& d) { return d.ComputeSpringAndControlForce(); }));
      },
      "(nv,) generalized forces of springs, servos and motors at the set-points of now, or the activations of those with "
      "dynamics, within their bounds of force, "
      "without dampers; N and N·m. Springs and the stiffness of servos act as one; `actuator_forces` has single "
      "actuators.",
      kOwn);
  simulation.def(
      "holding_controls", HoldingControlsOf,
      "Which set-points hold the present pose at rest against gravity and springs, without contact: (controls, "
      "residual).\n\ncontrols: name -> value within its limits, of mechanisms, not of driven bases, by least squares; the "
      "smallest where several do; of controls with dynamics the activation that does. residual: (nv,) N and N·m that no control and no closed loop balances: 0 where the pose "
      "is held. Bounds of force are counted in the residual.",
      nb::sig("def holding_controls(self) -> tuple[dict[str, float], numpy.typing.NDArray[numpy.float64]]"));
}

}  // namespace fork1s::python
