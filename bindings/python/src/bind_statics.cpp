// Deflection under a dead load.
#include <nanobind/nanobind.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/vector.h>
#include "text.hpp"

#include "arrays.hpp"
#include "bind.hpp"
#include "errors.hpp"
#include "model.hpp"
#include "released_gil.hpp"
#include "study/deflection.hpp"

namespace fork1s::python {
namespace {

LoadedBody Statics(const std::shared_ptr<const Model>& model, const std::string& body,
                   const nb::object& force, const nb::object& torque, const nb::object& gravity,
                   bool lock_free) {
  BodyLoad load{body};
  load.force_W = ReadOrZero(force, "force");
  load.moment_W = ReadOrZero(torque, "torque");
  const Vector3 g = gravity.is_none() ? model->scene().gravity : ReadVector3(gravity, "gravity");
  const ReleasedGil others_run;
  const OnFreeMotion on_free = lock_free ? OnFreeMotion::kLock : OnFreeMotion::kRefuse;
  return Take(Deflect(model->mechanisms(), load, g, {on_free, 0, {}}), model->origin());
}

}  // namespace

void BindStatics(nb::module_& m) {
  nb::class_<Deflection>(m, "Deflection", "Where a body's origin is under load, world axes.")
      .def_prop_ro(
          "position", [](const Deflection& d) { return OwnVector(d.position_W); }, "(3,) m", kOwn)
      .def_prop_ro(
          "rotation", [](const Deflection& d) { return OwnVector(d.rotation_W); },
          "(3,) rotation vector from the unloaded pose, rad", kOwn)
      .def_ro("max_joint_rotation", &Deflection::max_joint_rotation, "rad, of any hinge or ball");
  nb::class_<LoadedBody>(m, "Statics", "Answer of `fork1s.statics`.")
      .def_prop_ro(
          "reference", [](const LoadedBody& s) { return OwnVector(s.reference_position_W); },
          "(3,) m, position of the body's origin without load", kOwn)
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
              "False: a slight push makes the mechanism leave this equilibrium.");
  m.def(
      "statics", Statics, nb::arg("model"), nb::arg("body"), nb::arg("force") = nb::none(), nb::kw_only(),
      nb::arg("torque") = nb::none(), nb::arg("gravity") = nb::none(), nb::arg("lock_free") = false,
      R"(Linear and nonlinear deflection of a body under a load of fixed direction at its origin, the base held.

force: (3,) N, torque: (3,) N·m, world axes. gravity: (3,) m/s² instead of the model's. Controls have their initial
values. lock_free: a joint of each motion that no spring resists is locked. Raises UnderdeterminedError where nothing
resists the load, NumericsError where no equilibrium is found,
ModelError for a body that no mechanism has.)",
      nb::sig("def statics(model: Model, body: str, force: numpy.typing.ArrayLike | None = None, *, torque: "
              "numpy.typing.ArrayLike | None = None, gravity: numpy.typing.ArrayLike | None = None, "
              "lock_free: bool = "
              "False) -> Statics"));
}

}  // namespace fork1s::python
