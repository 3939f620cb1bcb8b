// A step to first order.
#include <nanobind/nanobind.h>
#include <nanobind/stl/vector.h>
#include <fork1s/sim/linearize.hpp>

#include "arguments.hpp"
#include "arrays.hpp"
#include "bind.hpp"
#include "errors.hpp"
#include "runner.hpp"
#include "text.hpp"

namespace fork1s::python {
namespace {

LinearizedStep LinearizeStep(Runner& runner, const nb::object& outputs, const Real& change) {
  LinearizeOptions options;
  options.change = change.Read("change");
  for (const std::string& body :
       ReadAs<std::vector<std::string>>(outputs, "outputs", "a sequence of body names"))
    options.outputs.push_back(runner.FindBody(body));
  return ValueOrThrow(runner.With([&](Simulation& s) { return Linearize(s, options); }));
}

VectorX Deviation(const LinearizedStep& step, Runner& runner) {
  const auto dx = runner.With([&](Simulation& s) -> Expected<VectorX> {
    if (!step.IsOf(s))
      return Fail(ErrorCode::kUsage, "simulation", "is of another model than the one that was linearized");
    return step.Deviation(s);
  });
  return ValueOrThrow(dx);
}

}  // namespace

void BindLinearize(nb::module_& m, nb::class_<Runner>& simulation) {
  using Switch = LinearizedStep::Switch;
  nb::class_<Switch>(m, "Switch",
                     "A coordinate, rate or input in which a step bends: `LinearizedStep.switches`.")
      .def_ro("of", &Switch::of, "Its name.")
      .def_ro("share", &Switch::share, "By which differences to both sides differ.")
      .def_ro("change", &Switch::change, "What differs in the steps.")
      .def("__repr__", [](const Switch& s) { return "<fork1s.Switch '" + s.of + "': " + s.change + ">"; });
  nb::class_<LinearizedStep>(m, "LinearizedStep",
                             R"(A step x' = f(x, u) about the state x* and held controls u* of a simulation:

    dx' = c + A dx + B du,    dy = C dx,    c = f(x*, u*) - x*

dx = [dp, dv, da] counts from x*. dp: of every mechanism independent joint coordinates, rad or m, as many as it has
freedoms, then of a floating base its rotation vector and the displacement of its origin, world axes; of every
free body the same six. dv: their rates, of rotations the angular velocity. da: activations of controls with
dynamics, k of them; N = 2n + k.)")
      .def_ro("dt", &LinearizedStep::dt, "s")
      .def_ro("coordinates", &LinearizedStep::coordinates, "(n) names, of dp and of dv.")
      .def_ro("activations", &LinearizedStep::activations, "(k) names of controls, of da.")
      .def_ro("inputs", &LinearizedStep::inputs, "(m) names of controls.")
      .def_ro("outputs", &LinearizedStep::outputs, "(l) names, six of every body asked for.")
      .def_prop_ro(
          "A", [](const LinearizedStep& s) { return OwnMatrix(s.A); }, "(N, N)", kOwn)
      .def_prop_ro(
          "B", [](const LinearizedStep& s) { return OwnMatrix(s.B); }, "(N, m)", kOwn)
      .def_prop_ro(
          "c", [](const LinearizedStep& s) { return OwnVector(s.c); }, "(N,) 0 at rest.", kOwn)
      .def_prop_ro(
          "C", [](const LinearizedStep& s) { return OwnMatrix(s.C); },
          "(l, N): rotation vector [rad] and displacement [m] of the bodies asked for, world axes.", kOwn)
      .def_prop_ro(
          "controls", [](const LinearizedStep& s) { return OwnVector(s.controls); }, "(m,) u*", kOwn)
      .def_ro(
          "switches", &LinearizedStep::switches,
          "Columns on a switch, where a contact or stop opens, friction begins to slide, or a force meets its "
          "bound: they are the mean of both sides.")
      .def_ro(
          "difference", &LinearizedStep::difference,
          "Share by which the derivative along a direction through all coordinates and inputs, by two steps of its own, "
          "differs from that by A and B; nan on a switch.")
      .def(
          "deviation", [](const LinearizedStep& s, Runner& r) { return OwnVector(Deviation(s, r)); },
          nb::arg("simulation"),
          "(N,) dx of the present state of a simulation of the same model: a feedback sets u* - K dx. Raises "
          "UsageError.",
          kOwn)
      .def("__repr__", [](const LinearizedStep& s) {
        return "<fork1s.LinearizedStep of " + std::to_string(s.coordinates.size()) + " coordinates, " +
               std::to_string(s.inputs.size()) + " inputs>";
      });
  simulation.def(
      "linearize", LinearizeStep, nb::arg("outputs") = nb::make_tuple(), nb::kw_only(),
      nb::arg("change") = 1e-6,
      R"(The next step to first order about the present state and controls (`LinearizedStep`), pushes left out.

outputs: names of bodies whose poses are outputs. change: by how much coordinates are moved, rad or shares of a
length. By central differences of whole steps, each solved to rounding: 2 N + 2 m + 3
steps. The simulation is left bit by bit as it was. Raises UnknownNameError, UsageError, and NumericsError where
a step is not solved.)",
      nb::sig("def linearize(self, outputs: collections.abc.Sequence[str] = (), *, change: float = 1e-06) -> "
              "LinearizedStep"));
}

}  // namespace fork1s::python
