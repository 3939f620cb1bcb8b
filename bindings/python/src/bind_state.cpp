// Setting the state of a simulation from outside.
#include <nanobind/nanobind.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include "text.hpp"

#include <cmath>
#include <limits>

#include "arguments.hpp"
#include "arrays.hpp"
#include "bind.hpp"
#include "errors.hpp"
#include "importer/loop_moves.hpp"
#include "readings.hpp"
#include "runner.hpp"

namespace fork1s::python {
namespace {

using ByName = std::map<std::string, nb::object>;

// Free bodies and bases that move, by name: where a state keeps them.
struct Movers {
  std::map<std::string, std::size_t> bases, free_bodies;
  explicit Movers(const Scene& scene) {
    for (std::size_t i = 0; i < scene.mechanisms.size(); ++i)
      if (scene.mechanisms[i].base != BaseKind::kFixed) bases[scene.mechanisms[i].bodies[0].name] = i;
    for (std::size_t f = 0; f < scene.free_bodies.size(); ++f) free_bodies[scene.free_bodies[f].name] = f;
  }
  [[noreturn]] void Refuse(const std::string& name) const {
    std::vector<std::string> known;
    for (const auto* map : {&bases, &free_bodies})
      for (const auto& [mover, place] : *map) known.push_back(mover);
    RefuseName("free body or moving base", name, known);
  }
};

void SetPoses(const ByName& poses, const Movers& movers, KeyframeDef& state) {
  for (const auto& [name, given] : poses) {
    const RigidTransform X = ReadPose(given, ("pose of '" + name + "'").c_str());
    if (const auto base = movers.bases.find(name); base != movers.bases.end())
      state.mechanisms[base->second].X_WR = X;
    else if (const auto body = movers.free_bodies.find(name); body != movers.free_bodies.end())
      state.free_bodies[body->second].X_WB = X;
    else
      movers.Refuse(name);
  }
}

void SetVelocities(const ByName& velocities, const Movers& movers, KeyframeDef& state) {
  for (const auto& [name, given] : velocities) {
    const VectorX V = ReadVector(given, 6, ("velocity of '" + name + "'").c_str());
    if (const auto base = movers.bases.find(name); base != movers.bases.end()) {
      KeyframeDef::MechanismState& m = state.mechanisms[base->second];
      m.V_R = InAxes(m.X_WR.rotation().transpose(), V);
    } else if (const auto body = movers.free_bodies.find(name); body != movers.free_bodies.end()) {
      state.free_bodies[body->second].omega_W = V.head<3>();
      state.free_bodies[body->second].velocity_W = V.tail<3>();
    } else {
      movers.Refuse(name);
    }
  }
}

// The body that a joint of the file moves freely in the world; empty: it is another joint.
std::string FreelyMoved(const FileJoint& joint, const Scene& scene) {
  if (joint.free_body >= 0) return scene.free_bodies[static_cast<std::size_t>(joint.free_body)].name;
  if (joint.coordinate >= 0) return {};
  return scene.mechanisms[static_cast<std::size_t>(joint.mechanism)].bodies[0].name;
}

// Numbers of each joint from `from` to `to`, but of those whose body is in `named`.
void CopyBut(const ByName& named, const std::vector<FileJoint>& joints, const Scene& scene,
             int (FileJoint::*count)() const, const VectorX& from, VectorX& to) {
  Eigen::Index at = 0;
  for (const FileJoint& joint : joints) {
    const Eigen::Index size = (joint.*count)();
    if (named.count(FreelyMoved(joint, scene)) == 0) to.segment(at, size) = from.segment(at, size);
    at += size;
  }
}

// Numbers of joints that are given by name. Returns those joints.
std::vector<const FileJoint*> SetByName(const ByName& given, const std::vector<FileJoint>& joints,
                                        const char* what, int (FileJoint::*count)() const, VectorX& all) {
  std::vector<const FileJoint*> found;
  for (const auto& [name, value] : given) {
    Eigen::Index at = 0;
    const FileJoint* wanted = nullptr;
    for (const FileJoint& joint : joints) {
      if (joint.name == name) {
        wanted = &joint;
        break;
      }
      at += (joint.*count)();
    }
    if (!wanted) {
      std::vector<std::string> known;
      for (const FileJoint& joint : joints) known.push_back(joint.name);
      RefuseName("joint that moves", name, known);
    }
    const std::string argument = std::string(what) + "['" + name + "']";
    const int size = (wanted->*count)();
    double number = 0;
    if (size == 1 && nb::try_cast<double>(value, number)) {
      if (!std::isfinite(number)) throw nb::value_error((argument + " must be finite").c_str());
      all(at) = number;
    } else {
      all.segment(at, size) = ReadVector(value, static_cast<std::size_t>(size), argument.c_str());
    }
    found.push_back(wanted);
  }
  return found;
}

// The coordinates of joints of one mechanism that are to be where `state` has them.
std::vector<fork1s::internal::WantedCoordinate> WantedOf(const std::vector<const FileJoint*>& joints,
                                                         int mechanism, const MechanismDef& def,
                                                         const VectorX& q) {
  std::vector<fork1s::internal::WantedCoordinate> wanted;
  for (const FileJoint* joint : joints) {
    if (joint->mechanism != mechanism || joint->coordinate < 0) continue;
    int at = 0;
    for (std::size_t j = 0; j < def.joints.size(); ++j) {
      const int size = static_cast<int>(def.joints[j].freedoms.size());
      for (int f = 0; at == joint->coordinate && f < size; ++f)
        wanted.push_back({joint->name, {JointIndex(j), f}, q(at + f)});
      at += size;
    }
  }
  return wanted;
}

void SetState(Runner& runner, const nb::object& qpos, const nb::object& qvel, const nb::object& given_poses,
              const nb::object& given_velocities, const nb::object& given_joints,
              const nb::object& given_joint_velocities) {
  const auto poses = ReadAs<ByName>(given_poses, "poses", "a mapping from names to poses");
  const auto velocities =
      ReadAs<ByName>(given_velocities, "velocities", "a mapping from names to velocities");
  const auto by_joint = ReadAs<ByName>(given_joints, "joints", "a mapping from names of joints to numbers");
  const auto rates_by_joint =
      ReadAs<ByName>(given_joint_velocities, "joint_velocities", "a mapping from names of joints to numbers");
  const Scene& scene = runner.model()->scene();
  const std::vector<FileJoint>& joints = runner.model()->joints();
  KeyframeDef state = runner.With([](Simulation& s) { return s.State(); });
  const FileState before = ComputeFileState(joints, scene, state);
  std::vector<VectorX> q_before;
  for (const auto& m : state.mechanisms) q_before.push_back(m.q);
  const Movers movers(scene);
  SetPoses(poses, movers, state);
  SetVelocities(velocities, movers, state);
  if (!qpos.is_none() || !qvel.is_none() || !by_joint.empty() || !rates_by_joint.empty()) {
    // Numbers that are not given stay as they are, also where the pose beside them changes.
    FileState file = ComputeFileState(joints, scene, state);
    const auto count = [](const VectorX& v) { return static_cast<std::size_t>(v.size()); };
    CopyBut(velocities, joints, scene, &FileJoint::num_velocities,
            qvel.is_none() ? before.velocities : ReadVector(qvel, count(file.velocities), "qvel"),
            file.velocities);
    if (!qpos.is_none())
      CopyBut(poses, joints, scene, &FileJoint::num_positions,
              ReadVector(qpos, count(file.positions), "qpos"), file.positions);
    const auto wanted = SetByName(by_joint, joints, "joints", &FileJoint::num_positions, file.positions);
    SetByName(rates_by_joint, joints, "joint_velocities", &FileJoint::num_velocities, file.velocities);
    ValueOrThrow(ApplyFileState(joints, scene, file, state));
    // The other joints of a loop follow those that are named, unless they are given too.
    for (std::size_t i = 0; qpos.is_none() && i < state.mechanisms.size(); ++i) {
      const MechanismDef& def = scene.mechanisms[i];
      const auto coordinates = WantedOf(wanted, static_cast<int>(i), def, state.mechanisms[i].q);
      if (coordinates.empty()) continue;
      state.mechanisms[i].q = q_before[i];
      if (auto error = fork1s::internal::MoveCoordinates(def, coordinates, "joints", state.mechanisms[i].q))
        throw Refused{std::move(*error)};
    }
  }
  runner.SetState(state);
}

nb::typed<nb::dict, nb::str, nb::typed<nb::dict, nb::str, nb::any>> JointsOf(const Runner& runner) {
  constexpr const char* kKinds[] = {"free", "ball", "slide", "hinge"};
  nb::dict all;
  int position = 0, velocity = 0;
  for (const FileJoint& joint : runner.model()->joints()) {
    nb::dict one;
    one["kind"] = kKinds[static_cast<int>(joint.kind)];
    one["qpos"] = nb::slice(nb::int_(position), nb::int_(position + joint.num_positions()), nb::none());
    one["qvel"] = nb::slice(nb::int_(velocity), nb::int_(velocity + joint.num_velocities()), nb::none());
    position += joint.num_positions();
    velocity += joint.num_velocities();
    all[joint.name.c_str()] = one;
  }
  return all;
}

FileState FileStateOf(Runner& runner) {
  return ComputeFileState(runner.model()->joints(), runner.model()->scene(),
                          runner.With([](Simulation& s) { return s.State(); }));
}

}  // namespace

void BindSnapshot(nb::module_& m) {
  nb::class_<BodyHit>(m, "RayHit", "Where a ray meets a body: `Simulation.ray`.")
      .def_ro("body", &BodyHit::name, "Name of the body, 'world' for the still world.")
      .def_ro("distance", &BodyHit::distance, "m")
      .def_prop_ro(
          "point", [](const BodyHit& h) { return OwnVector(h.point_W); }, "(3,) m, world frame", kOwn)
      .def_prop_ro(
          "normal", [](const BodyHit& h) { return OwnVector(h.normal_W); },
          "(3,) unit normal of the surface, towards where the ray came from", kOwn)
      .def("__repr__", [](const BodyHit& h) {
        return "<fork1s.RayHit '" + h.name + "' at " + std::to_string(h.distance) + " m>";
      });
  nb::class_<Runner::Snapshot>(
      m, "Snapshot",
      "A moment of a simulation, from `Simulation.save`. It is a copy and stays as it "
      "is, whatever the simulation does.")
      .def("__repr__", [](const Runner::Snapshot& s) {
        return "<fork1s.Snapshot after " + std::to_string(s.simulation.steps) + " steps>";
      });
}

void BindState(nb::class_<Runner>& simulation) {
  simulation.def(
      "record", [](Runner& r, const nb::object& path) { r.Record(ReadPath(path, "path")); },
      nb::arg("path").none(),
      "Every step from now on goes into a recording (HDF5), until `stop_recording`: `fork1s replay`, "
      "`export` "
      "and `replay` read it. Begun before the first step it replays bit by bit. A file of another kind is "
      "not replaced. Raises FileError, UsageError.",
      nb::sig("def record(self, path: str | os.PathLike[str]) -> None"));
  simulation.def(
      "stop_recording", &Runner::StopRecording,
      "Ends the recording. A program that is killed leaves what it had written, half a second ago at most. "
      "Raises FileError.");
  simulation.def("_flush_recording", &Runner::FlushRecording);
  simulation.def(
      "replay",
      [](const nb::object& self, int height) {
        return nb::module_::import_("fork1s._show").attr("replay_of")(self, height);
      },
      nb::arg("height") = 480,
      "What was recorded so far as a page that plays it, which a notebook shows in its cell (`Replay`). "
      "Raises "
      "UsageError where `record` was not called.",
      nb::sig("def replay(self, height: int = 480) -> 'fork1s.Replay'"));
  simulation.def(
      "ray",
      [](Runner& r, const nb::object& origin, const nb::object& direction, const Real& given_reach) {
        const double reach = given_reach.Read("reach");
        const Vector3 along = ReadVector3(direction, "direction");
        if (!(along.norm() > 0) || !std::isfinite(along.norm()))
          throw nb::value_error("direction must not be zero, nor so long that its square is infinite");
        if (!(reach >= 0)) throw nb::value_error("reach must be 0 m or more");
        return r.Ray(ReadVector3(origin, "origin"), along, reach);
      },
      nb::arg("origin"), nb::arg("direction"), nb::arg("reach") = std::numeric_limits<double>::infinity(),
      "The first body that a ray meets (`RayHit`), or None.\n\norigin: (3,) m; direction: (3,), of any "
      "length "
      "above 0; reach: m, how far it is followed. All bodies are seen, by the shapes that collide, or by all "
      "of a "
      "body that has none of these; meshes are their convex hulls. Raises ValueError.",
      nb::sig("def ray(self, origin: numpy.typing.ArrayLike, direction: numpy.typing.ArrayLike, reach: float "
              "= float('inf')) -> RayHit | None"));
  simulation.def(
      "set_stiffness",
      [](Runner& r, const nb::object& stiffness) {
        r.SetStiffness(ReadAs<std::map<std::string, double>>(stiffness, "stiffness",
                                                             "a mapping from joint coordinates to numbers"));
      },
      nb::arg("stiffness"),
      "Goes on with other stiffnesses of joints and tendons, from the present state.\n\nstiffness: joint coordinate, tendon or "
      "servo of a tendon -> "
      "what "
      "holds it, springs and servos together, N·m/rad or N/m, as `Model.with_stiffness`. Set-points stay; "
      "contacts "
      "are found again; those of a driven base count from its present pose. A snapshot from before cannot be "
      "restored. Takes milliseconds. Raises UnknownNameError, UsageError, ModelError.",
      nb::sig("def set_stiffness(self, stiffness: collections.abc.Mapping[str, float]) -> None"));
  simulation.def("save", &Runner::Save,
                 "A moment to come back to: state, set-points, pushes of the next call, time and detail.");
  simulation.def("restore", &Runner::Restore, nb::arg("snapshot"),
                 "Goes back to a moment that `save` gave, of this simulation or of another one of the same "
                 "model and dt: the "
                 "same steps from there give the same bits, and `hash` that of then. Raises UsageError and "
                 "leaves everything as it was where the moment is of another model, dt or stiffness.");
  simulation.def_prop_rw(
      "qpos", [](Runner& r) { return OwnVector(FileStateOf(r).positions); },
      [](Runner& r, const nb::object& qpos) {
        SetState(r, qpos, nb::none(), nb::dict(), nb::dict(), nb::dict(), nb::dict());
      },
      nb::for_setter(nb::arg("qpos").none()),
      "(nq,) positions of the joints of the file, in its order and by MuJoCo's conventions: hinge and slide as "
      "the file counts them, rad or m; ball a unit quaternion w x y z; free the position of the body, m, then "
      "its quaternion. `joints` says which numbers are whose. Assign an array to go on from there, as "
      "`set_state(qpos)` does; entries of the array that was read change nothing.",
      kOwn);
  simulation.def_prop_rw(
      "qvel", [](Runner& r) { return OwnVector(FileStateOf(r).velocities); },
      [](Runner& r, const nb::object& qvel) {
        SetState(r, nb::none(), qvel, nb::dict(), nb::dict(), nb::dict(), nb::dict());
      },
      nb::for_setter(nb::arg("qvel").none()),
      "(nv,) velocities of the joints of the file, likewise: hinge and slide rad/s or m/s; ball the angular "
      "velocity in axes of the body; free the velocity of the body's origin in world axes, then its angular "
      "velocity in axes of the body.",
      kOwn);
  simulation.def_prop_ro(
      "joints", JointsOf,
      "Joints of the file that move here, in its order: name -> 'kind' ('hinge', 'slide', "
      "'ball', 'free') and the slices of its numbers in 'qpos' and 'qvel'. A base that floats "
      "without a joint in the file (URDF) has one of the name of its body.");
  simulation.def_prop_ro(
      "state_change", [](Runner& r) { return r.StateChange(); },
      "Largest difference, rad or m, between a joint coordinate as it was set last (`qpos`, `set_state`) and "
      "what it became when loops and couplings were closed; 0 where none was set.");
  simulation.def(
      "set_state", SetState, nb::arg("qpos") = nb::none(), nb::arg("qvel") = nb::none(), nb::kw_only(),
      nb::arg("poses") = nb::dict(), nb::arg("velocities") = nb::dict(), nb::arg("joints") = nb::dict(),
      nb::arg("joint_velocities") = nb::dict(),
      "Goes on from another state; what is not given stays, the time too.\n\nqpos, qvel: (nq,), (nv,) as the "
      "properties of these names. joints, joint_velocities: of single joints by name, numbers as in `qpos` and "
      "`qvel`. poses: of free bodies and bases that move, by name: (7,), (4, 4) or (3,). velocities: (6,) "
      "angular first, world axes.\n"
      "Loops that `qpos` leaves open are closed by the smallest change; of those that `joints` open, the joints "
      "that are named stay and the others follow. `state_change` says how far. Set-points of controls stay; "
      "those of a driven base count from its new pose. Contacts are found again. Takes milliseconds. Raises "
      "UnknownNameError, UsageError where loops stay open with the joints named, ValueError, and as the "
      "constructor does.",
      nb::sig(
          "def set_state(self, qpos: numpy.typing.ArrayLike | None = None, qvel: numpy.typing.ArrayLike "
          "| None = None, *, poses: collections.abc.Mapping[str, numpy.typing.ArrayLike] = {}, velocities: "
          "collections.abc.Mapping[str, numpy.typing.ArrayLike] = {}, joints: collections.abc.Mapping[str, "
          "numpy.typing.ArrayLike] = {}, joint_velocities: collections.abc.Mapping[str, "
          "numpy.typing.ArrayLike] = {}) -> None"));
}

}  // namespace fork1s::python
