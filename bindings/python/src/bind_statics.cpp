// Deflection under a dead load, and stiffness at points.
#include <nanobind/nanobind.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/vector.h>
#include "text.hpp"

#include "arguments.hpp"
#include "arrays.hpp"
#include "bind.hpp"
#include "errors.hpp"
#include "model.hpp"
#include "point_view.hpp"
#include "released_gil.hpp"
#include "study/deflection.hpp"

namespace fork1s::python {
namespace {

LoadedBody Statics(const std::shared_ptr<const Model>& model, const std::string& body,
                   const nb::object& force, const nb::object& torque, const nb::object& gravity,
                   bool lock_free, const nb::object& point, const nb::object& points) {
  BodyLoad load{body};
  load.point_B = ReadOrZero(point, "point");
  std::vector<NamedPoint> named;
  if (!points.is_none())
    for (const auto& [of, at] : ReadAs<std::vector<std::pair<std::string, nb::object>>>(
             points, "points", "a sequence of pairs (body, point)"))
      named.push_back({of, ReadVector3(at, "points")});
  load.force_W = ReadOrZero(force, "force");
  load.moment_W = ReadOrZero(torque, "torque");
  const Vector3 g = gravity.is_none() ? model->scene().gravity : ReadVector3(gravity, "gravity");
  const ReleasedGil others_run;
  const OnFreeMotion on_free = lock_free ? OnFreeMotion::kLock : OnFreeMotion::kRefuse;
  return ValueOrThrow(Deflect(model->mechanisms(), load, g, {on_free, 0, named}), model->origin());
}

double Along(const StiffnessView& s, const nb::object& direction) {
  const Vector3 d = ReadVector3(direction, "direction");
  if (d.norm() == 0)
    throw Refused{{ErrorCode::kUsage, "direction", "is none: its length is 0; give one that is not"}};
  return s.at.Along(d);
}

Array AlongAxes(const StiffnessView& s) {
  return OwnVector(
      Vector3(s.at.Along(Vector3::UnitX()), s.at.Along(Vector3::UnitY()), s.at.Along(Vector3::UnitZ())));
}

nb::object MatrixOrNone(const MatrixX& matrix) {
  return matrix.size() == 0 ? nb::none() : nb::cast(OwnMatrix(matrix));
}

void BindPoints(nb::module_& m) {
  nb::class_<StiffnessView>(m, "Stiffness", R"(What a load meets at a point of a body, the base held.

Of the springs alone at the pose where the simulation starts, or about the equilibrium under load, where weight, dead
loads, controls, prestress and loop reactions stiffen or soften it.)")
      .def(
          "along", Along, nb::arg("direction"),
          R"(Force per displacement [N/m] along a direction, all else free: 0 where a motion that nothing resists moves
the point along it (`free` names its joint), inf where the point is rigid.

direction: (3,) world axes, of any length but 0.)",
          nb::sig("def along(self, direction: numpy.typing.ArrayLike) -> float"))
      .def_prop_ro("along_axes", AlongAxes, "(3,) N/m, `along` the world's x, y and z.", kOwn)
      .def_prop_ro(
          "compliance", [](const StiffnessView& s) { return MatrixOrNone(s.at.Compliance()); },
          nb::sig("def compliance(self) -> numpy.typing.NDArray[numpy.float64] | None"),
          "(6, 6): displacement [rotation; translation of the point] per load [moment about the point; force], "
          "world axes; rad/(N·m), m/N. None where a motion that nothing resists moves the body, so that it has no "
          "bound.")
      .def_prop_ro(
          "stiffness", [](const StiffnessView& s) { return MatrixOrNone(s.at.Stiffness()); },
          nb::sig("def stiffness(self) -> numpy.typing.NDArray[numpy.float64] | None"),
          "(6, 6) inverse of `compliance`, or None where the body cannot be pushed elastically in every way.")
      .def_prop_ro(
          "free", [](const StiffnessView& s) { return s.at.free; },
          "Sentences on motions that nothing resists and that move the point, with the joints that make them.")
      .def_prop_ro(
          "frequencies", [](const StiffnessView& s) { return ToArray(s.frequencies_hz); },
          "(k,) lowest natural frequencies [Hz] of the mechanism, motions that nothing resists left out. Of the springs "
          "alone a floating base moves along and no joint is locked; about the equilibrium the base is held, and there "
          "are none where it is unstable.",
          kOwn)
      .def_prop_ro(
          "stable", [](const StiffnessView& s) { return s.stable; },
          "False: about an unstable equilibrium; a slight push makes the mechanism leave it.");
  nb::class_<PointView>(m, "PointStiffness", "Stiffness at a point of a body, without and under load.")
      .def_prop_ro("body", [](const PointView& p) { return p.point.body; })
      .def_prop_ro(
          "point", [](const PointView& p) { return OwnVector(p.point.p_B); },
          "(3,) m, from the body's origin, in its axes.", kOwn)
      .def_prop_ro(
          "reference", [](const PointView& p) { return OwnVector(p.reference_W); },
          "(3,) m, its position where the simulation starts.", kOwn)
      .def_prop_ro(
          "springs", [](const PointView& p) { return p.springs; }, "Of the springs alone.")
      .def_prop_ro("loaded", &PointView::Loaded,
                   "About the equilibrium under load. Raises NumericsError where none was found.")
      .def_prop_ro(
          "locked", [](const PointView& p) { return p.locked; },
          "Joint coordinates that lock_free held where they were.");
}

}  // namespace

void BindStatics(nb::module_& m) {
  BindPoints(m);
  nb::class_<Deflection>(m, "Deflection", "Where the loaded point of a body is, world axes.")
      .def_prop_ro(
          "position", [](const Deflection& d) { return OwnVector(d.position_W); }, "(3,) m", kOwn)
      .def_prop_ro(
          "rotation", [](const Deflection& d) { return OwnVector(d.rotation_W); },
          "(3,) rotation vector from the unloaded pose, rad", kOwn)
      .def_ro("max_joint_rotation", &Deflection::max_joint_rotation, "rad, of any hinge or ball");
  nb::class_<LoadedBody>(m, "Statics", "Answer of `fork1s.statics`.")
      .def_prop_ro(
          "reference", [](const LoadedBody& s) { return OwnVector(s.reference_position_W); },
          "(3,) m, position of the loaded point without load", kOwn)
      .def_ro("linear", &LoadedBody::linear, "To first order.")
      .def_ro("nonlinear", &LoadedBody::nonlinear, "In full.")
      .def_prop_ro(
          "moved",
          [](const LoadedBody& s) { return OwnVector(s.nonlinear.position_W - s.reference_position_W); },
          "(3,) m, of the nonlinear answer", kOwn)
      .def_ro("locked", &LoadedBody::locked, "Joint coordinates that lock_free held where they were.")
      .def_ro("iterations", &LoadedBody::iterations)
      .def_ro("residual", &LoadedBody::residual, "Relative to the forces.")
      .def_ro("stable", &LoadedBody::stable,
              "False: a slight push makes the mechanism leave this equilibrium.")
      .def_prop_ro(
          "limit_shares", [](const LoadedBody& s) { return ToArray(s.limit_shares); },
          "(k,) shares of the load at the limit points that the path of equilibria passed. Empty: the answer is on the "
          "branch that begins without load; else the mechanism snaps through.",
          kOwn)
      .def_prop_ro(
          "warnings", [](const LoadedBody& s) { return s.beyond_stops; },
          "Sentences on joints that the load bends beyond their stops, which statics does not know.")
      .def_prop_ro("points", PointsOf,
                   "Stiffness at the loaded point, then at `points`, a PointStiffness each.")
      .def_prop_ro(
          "spring_frequencies", [](const LoadedBody& s) { return ToArray(s.spring_frequencies_hz); },
          "(k,) lowest natural frequencies [Hz] of the springs alone, as `Model.frequencies`.", kOwn)
      .def_prop_ro(
          "frequencies", [](const LoadedBody& s) { return ToArray(s.frequencies_hz); },
          "(k,) lowest natural frequencies [Hz] about the equilibrium, the base held; none where it is unstable.",
          kOwn);
  m.def(
      "statics", Statics, nb::arg("model"), nb::arg("body"), nb::arg("force") = nb::none(), nb::kw_only(),
      nb::arg("torque") = nb::none(), nb::arg("gravity") = nb::none(), nb::arg("lock_free") = false,
      nb::arg("point") = nb::none(), nb::arg("points") = nb::none(),
      R"(Linear and nonlinear deflection of a body under a load of fixed direction at a point of it, the base held.

force: (3,) N, torque: (3,) N·m, world axes. gravity: (3,) m/s² instead of the model's. Controls have their initial
values. lock_free: a joint of each motion that no spring resists is locked. point: (3,) m from the body's origin, in its axes,
where the load acts and whose motion is meant; the origin by default. points: pairs (body, (3,) m), where stiffness is
measured besides (`Statics.points`). Raises UnderdeterminedError where nothing
resists the load, NumericsError where no equilibrium is found,
ModelError for a body that no mechanism has, or of `points` that is of another mechanism.)",
      nb::sig("def statics(model: Model, body: str, force: numpy.typing.ArrayLike | None = None, *, torque: "
              "numpy.typing.ArrayLike | None = None, gravity: numpy.typing.ArrayLike | None = None, "
              "lock_free: bool = False, point: numpy.typing.ArrayLike | None = None, points: "
              "collections.abc.Sequence[tuple[str, numpy.typing.ArrayLike]] | None = None) -> Statics"));
}

}  // namespace fork1s::python
