// A step to first order.
#include <nanobind/nanobind.h>
#include <nanobind/stl/vector.h>

#include "arguments.hpp"
#include "arrays.hpp"
#include "bind.hpp"
#include "errors.hpp"
#include "runner.hpp"
#include "sim/linearization.hpp"
#include "text.hpp"

namespace fork1s::python {
namespace {

using internal::Linearization;

// Numbers that a function of the simulation returns: one, or an array of any shape.
VectorX Measure(const nb::object& outcome, nb::handle simulation) {
  const nb::module_ numpy = nb::module_::import_("numpy");
  const nb::object numbers = numpy.attr("ravel")(numpy.attr("asarray")(outcome(simulation), "float64"));
  return ReadVector(numbers, nb::len(numbers), "outcome");
}

LinearizedStep LinearizeStep(nb::handle_t<Runner> self, const nb::object& outputs, const nb::object& inputs,
                             const Real& change, bool move, const Runner::Snapshot* end, bool friction_forces,
                             bool start_controls, const nb::object& outcome) {
  Runner& runner = nb::cast<Runner&>(self);
  LinearizeOptions options;
  options.change = change.Read("change");
  options.controls_move = move;
  options.friction_forces = friction_forces;
  options.start_controls = start_controls;
  if (end) {
    ValueOrThrow(runner.With([&](Simulation& s) { return FitsStep(end->dt, s); }));
    options.end = end->simulation;
  }
  for (const std::string& body :
       ReadAs<std::vector<std::string>>(outputs, "outputs", "a sequence of body names"))
    options.outputs.push_back(runner.FindBody(body));
  if (!inputs.is_none()) {
    options.inputs.emplace();
    for (const std::string& control :
         ReadAs<std::vector<std::string>>(inputs, "inputs", "a sequence of names of controls"))
      options.inputs->push_back(runner.FindControl(control));
  }
  if (outcome.is_none())
    return ValueOrThrow(runner.With([&](Simulation& s) { return Linearize(s, options); }));
  std::unique_ptr<Linearization> steps =
      ValueOrThrow(runner.With([&](Simulation& s) { return Linearization::Begin(s, options); }));
  const auto put_back = [&] { runner.With([&](Simulation&) { steps.reset(); }); };
  try {
    while (ValueOrThrow(runner.With([&](Simulation&) { return steps->Advance(); })))
      steps->SetOutcome(Measure(outcome, self));
    LinearizedStep out = runner.With([&](Simulation&) { return steps->Finish(); });
    put_back();
    return out;
  } catch (...) {
    put_back();
    throw;
  }
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
      .def_ro("forces", &LinearizedStep::forces, "(q) names, where `linearize` was asked for them.")
      .def_ro("inputs", &LinearizedStep::inputs, "(m) names of controls.")
      .def_ro("outputs", &LinearizedStep::outputs, "(l) names, six of every body asked for.")
      .def_prop_ro(
          "A", [](const LinearizedStep& s) { return OwnMatrix(s.A); }, "(N, N)", kOwn)
      .def_prop_ro(
          "B", [](const LinearizedStep& s) { return OwnMatrix(s.B); }, "(N, m)", kOwn)
      .def_prop_ro(
          "B_start", [](const LinearizedStep& s) { return OwnMatrix(s.B_start); },
          "(N, m) by controls at the start of the step, where asked for, else (N, 0).", kOwn)
      .def_prop_ro(
          "outcome", [](const LinearizedStep& s) { return OwnVector(s.outcome); },
          "(o,) What was measured after the step from x* with u*.", kOwn)
      .def_prop_ro(
          "outcome_A", [](const LinearizedStep& s) { return OwnMatrix(s.outcome_A); },
          "(o, N) Its derivative by dx.", kOwn)
      .def_prop_ro(
          "outcome_B", [](const LinearizedStep& s) { return OwnMatrix(s.outcome_B); },
          "(o, m) Its derivative by du.", kOwn)
      .def_prop_ro(
          "outcome_B_start", [](const LinearizedStep& s) { return OwnMatrix(s.outcome_B_start); },
          "(o, m) Its derivative by controls at the start of the step, where asked for, else (o, 0).", kOwn)
      .def_prop_ro(
          "c", [](const LinearizedStep& s) { return OwnVector(s.c); }, "(N,) 0 at rest.", kOwn)
      .def_prop_ro(
          "C", [](const LinearizedStep& s) { return OwnMatrix(s.C); },
          "(l, N): rotation vector [rad] and displacement [m] of the bodies asked for, world axes.", kOwn)
      .def_prop_ro(
          "controls", [](const LinearizedStep& s) { return OwnVector(s.controls); },
          "(c,) u* of all controls.", kOwn)
      .def_ro(
          "switches", &LinearizedStep::switches,
          "Columns on a switch, where a contact or stop opens, friction begins to slide, or a force meets its "
          "bound: they are the mean of both sides.")
      .def_ro(
          "stuck", &LinearizedStep::stuck,
          "Names of joints and tendons that their dry friction holds at x*: no small change of a control, or of "
          "anything else, moves them.")
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
      nb::arg("inputs") = nb::none(), nb::arg("change") = 1e-6, nb::arg("move") = false,
      nb::arg("end") = nb::none(), nb::arg("friction_forces") = false, nb::arg("start_controls") = false,
      nb::arg("outcome") = nb::none(),
      R"(The next step to first order about the present state and controls (`LinearizedStep`), pushes left out.

outputs: names of bodies whose poses are outputs. inputs: names of the controls that are inputs, by default all.
change: by how much coordinates are moved, rad or shares of a length. move: controls move within the step, as of
`step(move=True)`, from those of the last step. start_controls: these are inputs too, of which `B_start` is; a step with
held controls depends on them where stiff servos jump. end: what dx' counts from instead of x*, the state
after the step as `save` gave it in a run, so that matrices of the steps of that run can be multiplied. friction_forces: contacts and joints with dry
friction start a step from the forces that they bore, which the springs of their material remember; these count as q more
entries of dx at x*, and as many of dx' as there are at `end`: A is (N + q', N + q). outcome: a function of the simulation that
returns a number or an array, forces of contact, sensors, a cost; it is called after every step that is taken here, is to
change nothing, and its derivatives are `outcome_A`, `outcome_B`.

By central differences of whole steps, each solved to rounding: 2 N + 2 m + 3 steps, 2 m more for controls at the start, 2 q for forces. The
simulation is left bit by bit as it was; while an outcome is measured no other thread may use it. Raises UnknownNameError,
UsageError, NumericsError where a step is not solved, and what `outcome` raises.)",
      nb::sig(
          "def linearize(self, outputs: collections.abc.Sequence[str] = (), *, inputs: "
          "collections.abc.Sequence[str] | None = None, change: float = 1e-06, move: bool = False, end: "
          "Snapshot | None = None, friction_forces: bool = False, start_controls: bool = False, outcome: collections.abc.Callable[[Simulation], numpy.typing.ArrayLike] | None = "
          "None) -> LinearizedStep"));
}

}  // namespace fork1s::python
