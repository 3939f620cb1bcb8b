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

// Joint numbers of all mechanisms one after the other.
void Spread(const VectorX& all, VectorX KeyframeDef::MechanismState::*part, KeyframeDef& state) {
  Eigen::Index next = 0;
  for (KeyframeDef::MechanismState& m : state.mechanisms) {
    const Eigen::Index size = m.q.size();
    m.*part = all.segment(next, size);
    next += size;
  }
}

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

void SetState(Runner& runner, const nb::object& qpos, const nb::object& qvel, const nb::object& given_poses,
              const nb::object& given_velocities) {
  const auto poses = ReadAs<ByName>(given_poses, "poses", "a mapping from names to poses");
  const auto velocities =
      ReadAs<ByName>(given_velocities, "velocities", "a mapping from names to velocities");
  KeyframeDef state = runner.With([](Simulation& s) { return s.State(); });
  const Movers movers(runner.model()->scene());
  std::size_t count = 0;
  for (const auto& m : state.mechanisms) count += static_cast<std::size_t>(m.q.size());
  if (!qpos.is_none()) Spread(ReadVector(qpos, count, "qpos"), &KeyframeDef::MechanismState::q, state);
  if (!qvel.is_none()) Spread(ReadVector(qvel, count, "qvel"), &KeyframeDef::MechanismState::q_dot, state);
  SetPoses(poses, movers, state);
  SetVelocities(velocities, movers, state);
  runner.SetState(std::move(state));
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
      "Goes on with other stiffnesses of joints, from the present state.\n\nstiffness: joint coordinate -> "
      "what "
      "holds it, springs and servos together, N·m/rad or N/m, as `Model.with_stiffness`. Set-points stay; "
      "contacts "
      "are found anew; those of a driven base count from its present pose. A snapshot from before cannot be "
      "restored. Takes milliseconds. Raises UnknownNameError, UsageError, ModelError.",
      nb::sig("def set_stiffness(self, stiffness: collections.abc.Mapping[str, float]) -> None"));
  simulation.def("save", &Runner::Save,
                 "A moment to come back to: state, set-points, pushes of the next call, time and detail.");
  simulation.def("restore", &Runner::Restore, nb::arg("snapshot"),
                 "Goes back to a moment that `save` gave, of this simulation or of another one of the same "
                 "model and dt: the "
                 "same steps from there give the same bits, and `hash` that of then. Raises UsageError and "
                 "leaves everything as it was where the moment is of another model.");
  simulation.def(
      "set_state", SetState, nb::arg("qpos") = nb::none(), nb::arg("qvel") = nb::none(), nb::kw_only(),
      nb::arg("poses") = nb::dict(), nb::arg("velocities") = nb::dict(),
      "Goes on from another state; what is not given stays, the time too.\n\nqpos, qvel: (n,) as the "
      "properties of "
      "these names; loops that they leave open are closed. poses: of free bodies and bases that move, by "
      "name: (7,), "
      "(4, 4) or (3,). velocities: (6,) angular first, world axes. Set-points of controls stay; those of a "
      "driven base "
      "count from its new pose. Contacts are found anew. Takes milliseconds. Raises UnknownNameError, "
      "ValueError, and "
      "as the constructor does.",
      nb::sig("def set_state(self, qpos: numpy.typing.ArrayLike | None = None, qvel: numpy.typing.ArrayLike "
              "| None = "
              "None, *, poses: collections.abc.Mapping[str, numpy.typing.ArrayLike] = {}, velocities: "
              "collections.abc.Mapping[str, numpy.typing.ArrayLike] = {}) -> None"));
}

}  // namespace fork1s::python
