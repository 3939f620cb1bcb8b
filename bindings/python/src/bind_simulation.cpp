// Simulation: a model in motion.
#include <nanobind/nanobind.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/vector.h>
#include "text.hpp"

#include "bind.hpp"
#include "controls.hpp"
#include "errors.hpp"
#include "readings.hpp"
#include "words.hpp"

namespace fork1s::python {
namespace {

using RunnerPtr = std::shared_ptr<Runner>;

// Joint coordinates or their rates, as fork1s.NamedValues.
nb::object MakeNamedValues(Runner& runner, std::vector<double> (*read)(const Simulation&)) {
  const auto names = runner.With([](Simulation& s) { return s.CoordinateNames(); });
  return nb::module_::import_("fork1s._named").attr("by_name")(ToArray(runner.With(read)), names);
}

void PushBody(Runner& runner, const std::string& body, const nb::object& force, const nb::object& torque,
              const nb::object& point) {
  internal::BodyPush push;
  push.body = runner.FindBody(body);
  push.force_W = ReadOrZero(force, "force");
  push.moment_W = ReadOrZero(torque, "torque");
  push.point_B = Vector3::Zero();
  if (!point.is_none()) {
    const Vector3 point_W = ReadVector3(point, "point");
    push.point_B = runner.With([&](Simulation& s) { return s.Pose(push.body).inverse() * point_W; });
  }
  runner.AddPush(push);
}

void PullBody(Runner& runner, const std::string& body, const nb::object& point, const nb::object& target,
              const Real& stiffness, const std::optional<Real>& damping) {
  const int at = runner.FindBody(body);
  const auto point_W = point.is_none() ? std::nullopt : std::optional(ReadVector3(point, "point"));
  runner.Pull(at, point_W, ReadVector3(target, "target"), stiffness.Read("stiffness"),
              Read(damping, "damping"));
}

void ReleaseBody(Runner& runner, const std::optional<std::string>& body) {
  runner.Release(body ? std::optional(runner.FindBody(*body)) : std::nullopt);
}

internal::StepTotals StepMany(Runner& runner, const Whole& steps, bool move) {
  return runner.Step(steps.Within("steps", 0), move);
}

void StartFromControls(Runner& runner) {
  const bool begun = runner.With([](Simulation& s) {
    if (s.steps() == 0) s.StartFromControls();
    return s.steps() > 0;
  });
  if (begun)
    throw Refused{{ErrorCode::kUsage, "start_from_controls",
                   "steps have been made; where a path jumps, make a step without move"}};
}

void SetDetail(Runner& runner, const std::optional<std::string>& level, const std::optional<Whole>& modes,
               const std::optional<std::string>& recovery) {
  const std::optional<int> kept = modes ? std::optional(modes->Within("modes", 0)) : std::nullopt;
  runner.SetDetail(level ? std::optional(ReadDetail(*level)) : std::nullopt, kept,
                   recovery ? std::optional(ReadRecovery(*recovery)) : std::nullopt);
}

void BindStepReport(nb::module_& m) {
  nb::class_<internal::StepTotals>(m, "StepReport",
                                   "What the steps of one call of `Simulation.step` were like.")
      .def_ro("steps", &internal::StepTotals::steps,
              "Steps made: fewer than asked for where one was not finite.")
      .def_ro("contacts", &internal::StepTotals::contacts, "Contact points in the last step.")
      .def_ro("limits", &internal::StepTotals::limits, "Joint limits that acted in the last step.")
      .def_ro("forces_at_bound", &internal::StepTotals::forces_at_bound,
              "Servos and motors that gave all they can in the last step.")
      .def_ro("max_penetration", &internal::StepTotals::max_penetration, "m, the deepest of all steps.")
      .def_ro("residual", &internal::StepTotals::residual,
              "Of the contact solver, relative; the worst of all steps.")
      .def_ro("unconverged", &internal::StepTotals::unconverged,
              "Steps whose contacts or stages were not solved to tolerance.")
      .def_ro("halved_steps", &internal::StepTotals::halved,
              "Two-stage: steps that were taken as two of half the length or more, for an impact, a force "
              "that came to its "
              "limit or from it, or a stage that did not converge.")
      .def_ro("halved_by", &internal::StepTotals::halved_by,
              "What the last of them was halved for, by name; empty: none.")
      .def_prop_ro("newton_iterations", &internal::StepTotals::mean_newton_iterations,
                   "Two-stage: mean over all stages; 0 for other integrators.")
      .def_ro("max_newton_iterations", &internal::StepTotals::max_newton_iterations,
              "Two-stage: of the stage that took most.")
      .def_ro(
          "stage_residual", &internal::StepTotals::stage_residual,
          "Two-stage, m: by how much another Newton iteration would move something; the worst of all stages.")
      .def_ro("stage_residual_of", &internal::StepTotals::stage_residual_of,
              "Whose residual that is, by name.")
      .def_ro("refreshes", &internal::StepTotals::refreshes, "Relinearizations.")
      .def_prop_ro(
          "refreshes_by_cause",
          [](const internal::StepTotals& r)
              -> nb::typed<nb::dict, nb::str, nb::typed<nb::dict, nb::str, nb::any>> {
            nb::dict out;
            for (std::size_t i = 0; i < r.refreshes_by_cause.size(); ++i) {
              const RelinearizationTotal& total = r.refreshes_by_cause[i];
              nb::dict one;
              one["count"] = total.count;
              one["largest"] = total.largest.amount;
              one["unit"] = total.largest.is_angle ? "rad" : "m";
              one["of"] = total.of;
              out[kDriftCauseNames[i]] = one;
            }
            return out;
          },
          "Why: 'turned_joint', since the last time; 'missing_load', a load whose displacement the "
          "coordinates lack; 'loop_gap', by curved recovery. Each has its 'count', the 'largest' "
          "displacement with its 'unit' and, by name, whose it was ('of').")
      .def_ro("failed_refreshes", &internal::StepTotals::failed_refreshes,
              "Times that it could not be; the old one stays.")
      .def_ro(
          "expanded_steps", &internal::StepTotals::expanded_steps,
          "Steps in which a mechanism went by an expansion (recovery 'expanded'); the others went by exact "
          "poses.")
      .def_ro("expansions", &internal::StepTotals::expansions,
              "Times that one was expanded again, beside those with a refresh.")
      .def_ro("contacts_dropped", &internal::StepTotals::contacts_dropped,
              "The collision detector ran out of room.")
      .def_ro("finite", &internal::StepTotals::finite,
              "False: a step gave numbers that are not finite, or could not be solved even in its shortest "
              "parts, and was "
              "undone; the state is that before it.")
      .def("__repr__", [](const internal::StepTotals& r) {
        return "<fork1s.StepReport steps=" + std::to_string(r.steps) +
               " contacts=" + std::to_string(r.contacts) + " unconverged=" + std::to_string(r.unconverged) +
               (r.finite ? ">" : " NOT FINITE>");
      });
}

ErrorFigureReport ErrorEstimateOf(Runner& runner) {
  auto figure = runner.ErrorFigureSoFar();
  if (!figure)
    throw Refused{{ErrorCode::kUsage, "error_estimate",
                   "is known where the simulation estimates it; make it by Simulation(model, error=True)"}};
  return std::move(*figure);
}

void BindErrorEstimate(nb::module_& m) {
  using Body = fork1s::internal::ErrorFigure::Body;
  nb::class_<Body>(
      m, "BodyErrorEstimate",
      "How far a body's origin is estimated to be from the truth, in m, and by which angle it is turned wrongly. A point "
      "at a distance r from the origin is off by up to `max` + r `angle_max`. Infinite where a shorter step could not be "
      "solved.")
      .def_ro("max", &Body::total, "m, the largest of all steps.")
      .def_ro("last", &Body::last, "m, the largest of the last quarter of a second: errors swing.")
      .def_ro("time_step_max", &Body::time, "m, what the time step alone leaves at most; a smaller dt helps.")
      .def_ro("interior_max", &Body::interior,
              "m, what the reduction and recovery alone leave at most; more modes help.")
      .def_ro("angle_max", &Body::angle, "rad, of its orientation, the largest of all steps.")
      .def_ro("angle_last", &Body::angle_last, "rad, the largest of the last quarter of a second.")
      .def_ro("motion", &Body::motion, "m, its largest distance from the start.")
      .def("__repr__", [](const Body& b) {
        return "<fork1s.BodyErrorEstimate max=" + std::to_string(1e3 * b.total) + " mm of " +
               std::to_string(1e3 * b.motion) + " mm>";
      });
  nb::class_<ErrorFigureReport>(
      m, "ErrorEstimate",
      "How far a simulation is estimated to be from the truth: `Simulation.error_estimate`. The truth is the whole model "
      "with steps that are short enough; docs/error_figure.md says when not to believe it. Figures are those of "
      "the moment at which it was asked for.")
      .def_prop_ro(
          "bodies",
          [](const ErrorFigureReport& r) {
            nb::dict out;
            for (const Body& b : r.bodies) out[nb::cast(b.name)] = nb::cast(b);
            return out;
          },
          "Name -> BodyErrorEstimate, of interface bodies, floating bases and free bodies; empty before the first step.",
          nb::sig("def bodies(self) -> dict[str, BodyErrorEstimate]"))
      .def_prop_ro(
          "max", [](const ErrorFigureReport& r) { return r.largest.total; }, "m, the largest of all bodies.")
      .def_prop_ro(
          "angle_max", [](const ErrorFigureReport& r) { return r.largest.angle; },
          "rad, of orientation: the largest of all bodies.")
      .def_prop_ro(
          "time_step_max", [](const ErrorFigureReport& r) { return r.largest.time; },
          "m, the part of the time step: the largest of all bodies.")
      .def_prop_ro(
          "interior_max", [](const ErrorFigureReport& r) { return r.largest.interior; },
          "m, the part of what is left out: the largest of all bodies.")
      .def_prop_ro(
          "motion", [](const ErrorFigureReport& r) { return r.largest.motion; },
          "m, the largest distance of a body from its start.")
      .def_prop_ro(
          "percent",
          [](const ErrorFigureReport& r) {
            return r.largest.finite && r.largest.motion > 0
                       ? std::optional(100 * r.largest.total / r.largest.motion)
                       : std::nullopt;
          },
          "`max` in percent of `motion`; None where nothing moved or it is not quantified.")
      .def_prop_ro(
          "quantified", [](const ErrorFigureReport& r) { return r.largest.finite; },
          "False: there is no estimate from some step on; `warnings` says why.")
      .def_prop_ro(
          "within_range", [](const ErrorFigureReport& r) { return r.largest.IsWithinRange(); },
          "False: the figures mean no more than that the error is above 10 % of the motion, or are not quantified.")
      .def_ro("warnings", &ErrorFigureReport::warnings,
              "Sentences where the figures mean nothing, or less than they say.")
      .def("__repr__", [](const ErrorFigureReport& r) {
        return r.largest.finite ? "<fork1s.ErrorEstimate max=" + std::to_string(1e3 * r.largest.total) +
                                      " mm of " + std::to_string(1e3 * r.largest.motion) + " mm>"
                                : std::string("<fork1s.ErrorEstimate NOT QUANTIFIED>");
      });
}

}  // namespace

void BindSimulation(nb::module_& m) {
  BindStepReport(m);
  BindErrorEstimate(m);
  BindSnapshot(m);
  auto simulation =
      nb::class_<Runner>(m, "Simulation", R"(A model in motion, stepped implicitly with contacts.

    sim = fork1s.Simulation(model, dt=1/60)
    sim.controls["grip"] = 0.4
    report = sim.step(10)
    position = sim.pose("fingertip")[:3, 3]

dt: time step in s (default: the model's, 1/60 s unless the file's format says otherwise). keyframe: name of an initial
state of the file. recovery: 'exact', 'expanded', 'curved' or 'twist', how poses follow from reduced coordinates. detail: 'interface',
'parents' or 'all', which bodies may touch. integrator: 'two-stage', of second order
(default), or 'euler', backward Euler of first order. 'twist' draws poses by one exponential a body; steps are those of 'exact'.
error: whether `error_estimate` tells how far off it is; steps then take five times as long, nine where the reduction leaves something out.
watch: whether `warnings` tells of steps that were undone and what steps show that no machine does (wedged bodies, energy from no source, deep overlap, bodies that are no
interface and go into others), in the sentences of `fork1s run`; a step then takes a pass of collision detection more.

All quantities are in the world frame and in m, kg, s, rad, N unless a line says otherwise. Arrays that it returns are
those of the moment, and the caller's own. Several Python threads may use one simulation: all calls let other threads
run, and a call made while another thread is in `step` takes effect between two steps. Ctrl-C ends `step` after the step
at hand.

Raises ModelError, UnderdeterminedError, NumericsError, UsageError, UnknownNameError.)")
          .def(
              "__init__",
              [](Runner* self, const GivenModel& given_model, const std::optional<Real>& dt,
                 const std::optional<std::string>& keyframe, const std::string& recovery,
                 const std::string& detail, const std::optional<std::string>& integrator, bool error,
                 bool watch) {
                const RunOptions options = ReadRunOptions(dt, keyframe, recovery, detail, integrator);
                const std::shared_ptr<const Model> model = given_model.Read("model");
                const ReleasedGil others_run;
                new (self) Runner(model, options, error, watch);
              },
              nb::arg("model"), nb::kw_only(), nb::arg("dt") = nb::none(), nb::arg("keyframe") = nb::none(),
              nb::arg("recovery") = "exact", nb::arg("detail") = "interface",
              nb::arg("integrator") = nb::none(), nb::arg("error") = false, nb::arg("watch") = false)
          .def(
              "step", StepMany, nb::arg("steps") = 1, nb::kw_only(), nb::arg("move") = false,
              "Advances by `steps` time steps of dt. What went wrong numerically stands in the report; the "
              "state stays finite.\n\n"
              "move: controls move linearly over the steps of the call, from where the last step left them "
              "(at first their initial values) to those set, as samples of a path do; default: they are held "
              "at those set, as the output of a controller is. With move=True a path set step by step gives "
              "what the same path as a table of `fork1s run --controls` gives. Driven bases move within a "
              "single step in both cases. A control that another thread sets meanwhile is where it moves to "
              "from then on.")
          .def("start_from_controls", StartFromControls,
               "The first step with move=True starts at the set-points as they are now, rather than at their "
               "initial values: for a path that begins elsewhere. Raises UsageError after the first step, "
               "where a jump is a step without move.")
          .def("push", PushBody, nb::arg("body"), nb::arg("force") = nb::none(),
               nb::arg("torque") = nb::none(), nb::arg("point") = nb::none(),
               "Force (3,) [N] and torque (3,) [N·m] on a body, world axes, through all steps of the next "
               "call "
               "of `step`.\n\n"
               "point: (3,) m, where it acts now in the world; it then moves with the body. Default: the "
               "body's "
               "origin.\n"
               "Pushes add up. Raises UnknownNameError, ValueError.",
               nb::sig("def push(self, body: str, force: numpy.typing.ArrayLike | None = None, torque: "
                       "numpy.typing.ArrayLike | None = None, point: numpy.typing.ArrayLike | None = None) "
                       "-> None"))
          .def(
              "pull", PullBody, nb::arg("body"), nb::arg("point").none(), nb::arg("target"),
              nb::arg("stiffness"), nb::kw_only(), nb::arg("damping") = nb::none(),
              "A spring with a damper from a point of a body to a target in the world, as a hand that guides it: the "
              "force stiffness (target - x) - damping dx/dt [N] acts at the point x in all steps until `release`, or "
              "until another call takes its place.\n\n"
              "point: (3,) m, where it is now in the world; it then moves with the body. None: the body's origin.\n"
              "target: (3,) m, world; it stays there until the next call.\n"
              "stiffness: N/m, above 0. damping: N·s/m; default: critical for what the point moves.\n"
              "The force is implicit in the step, with its stiffness: it stays calm at any stiffness and dt, where a "
              "`push` with a computed force would not. A mechanism or free body has one: a pull on another of its "
              "bodies ends the one before. Pulls are recorded, part of `save` and of the state, and no part of "
              "`potential_energy`. Raises UnknownNameError, UsageError, ValueError.",
              nb::sig("def pull(self, body: str, point: numpy.typing.ArrayLike | None, target: "
                      "numpy.typing.ArrayLike, stiffness: float, *, damping: float | None = None) -> None"))
          .def("release", ReleaseBody, nb::arg("body") = nb::none(),
               "Ends the pull on a body; default: all of them. One that is not pulled stays as it is. Raises "
               "UnknownNameError.")
          .def("set_detail", SetDetail, nb::arg("level") = nb::none(), nb::kw_only(),
               nb::arg("modes") = nb::none(), nb::arg("recovery") = nb::none(),
               "Goes on with more or less detail from the present state.\n\nlevel: 'object' (contacts that "
               "hold "
               "a free "
               "body are frozen), 'interface', 'parents' or 'all'. What is not given stays. Takes "
               "milliseconds. "
               "Raises "
               "ModelError and leaves everything as it was where that cannot be.")
          .def_prop_ro("model", [](const Runner& r) { return r.model(); })
          .def_prop_ro(
              "controls", [](const RunnerPtr& r) { return Controls{r}; }, "Set-points by name (`Controls`).")
          .def_prop_rw(
              "control_values",
              [](Runner& r) { return OwnVector(r.With([](Simulation& s) { return s.controls(); })); },
              [](Runner& r, const nb::object& values) {
                const std::size_t count = r.With([](Simulation& s) { return s.control_names().size(); });
                const VectorX read = ReadVector(values, count, "control_values");
                r.With([&](Simulation& s) { s.SetControls(read); });
              },
              nb::for_setter(nb::arg("values").none()),
              "(c,) all set-points, in the order of `controls.keys()`. Assign an array to set them; entries "
              "of "
              "the array "
              "that was read change nothing.",
              kOwn)
          .def_prop_ro(
              "control_limits",
              [](Runner& r) {
                return OwnMatrix(r.With([](Simulation& s) {
                  MatrixX limits(s.controls().size(), 2);
                  limits << s.control_lower(), s.control_upper();
                  return limits;
                }));
              },
              "(c, 2) least and largest value of each set-point, infinite where there is no limit.", kOwn)
          .def_prop_ro(
              "start_controls",
              [](Runner& r) { return OwnVector(r.With([](Simulation& s) { return s.start_controls(); })); },
              "(c,) where the next step with move=True starts: all set-points at the end of the last step.",
              kOwn)
          .def_prop_ro(
              "time", [](Runner& r) { return r.Time(); }, "s")
          .def_prop_ro("steps", [](Runner& r) { return r.With([](Simulation& s) { return s.steps(); }); })
          .def_prop_ro(
              "dt", [](Runner& r) { return r.With([](Simulation& s) { return s.dt(); }); }, "s")
          .def_prop_rw(
              "newton_tolerance",
              [](Runner& r) {
                return r.With([](Simulation& s) { return s.step_options().newton_tolerance; });
              },
              [](Runner& r, const Real& tolerance) {
                r.SetNewtonTolerance(tolerance.Read("newton_tolerance"));
              },
              "Share of the motion of a step that its solution may be off by, 1e-6 by default. 1e-15 solves steps "
              "as far as rounding lets them, for differences of runs; it takes some more iterations. Raises UsageError "
              "for numbers that are not above 0 and up to 0.01, and while a recording goes on.")
          .def_prop_ro(
              "bodies", [](const Runner& r) { return r.model()->BodyNames(); },
              "Names, in the order of `poses`.")
          .def_prop_ro(
              "poses", [](Runner& r) { return Own(r.With(Poses)); },
              "(b, 7) of every body: position of its origin [m], unit quaternion w x y z with w >= 0.", kOwn)
          .def_prop_ro(
              "velocities", [](Runner& r) { return Own(r.With(Velocities)); },
              "(b, 6) of every body: angular velocity [rad/s], velocity of its origin [m/s].", kOwn)
          .def(
              "pose",
              [](Runner& r, const std::string& body) {
                const int at = r.FindBody(body);
                return OwnMatrix(Homogeneous(r.With([&](Simulation& s) { return s.Pose(at); })));
              },
              nb::arg("body"), "(4, 4) homogeneous pose of a body. Raises UnknownNameError.")
          .def_prop_ro(
              "joint_displacements", [](Runner& r) { return MakeNamedValues(r, JointCoordinates); },
              "(n,) joint coordinates of all mechanisms from the file's reference pose, rad or m, in the order "
              "of `coordinates`, or by one of these names; a base that moves and free bodies stand in `poses`.",
              nb::sig("def joint_displacements(self) -> 'fork1s.NamedValues'"))
          .def_prop_ro(
              "joint_rates", [](Runner& r) { return MakeNamedValues(r, JointRates); },
              "(n,) their rates, rad/s or m/s.", nb::sig("def joint_rates(self) -> 'fork1s.NamedValues'"))
          .def_prop_ro(
              "coordinates",
              [](Runner& r) { return r.With([](Simulation& s) { return s.CoordinateNames(); }); },
              "Names of the n joint coordinates.")
          .def_prop_ro(
              "sensors", [](Runner& r) { return r.ReadSensors(); },
              "What the sensors of the file measure at the end of the last step, by name (`Sensors`).")
          .def_prop_ro(
              "actuator_forces", [](Runner& r) { return r.ReadActuatorForces(); },
              "What each actuator of the file gives along its length at the present state, by name (`ActuatorForces`): "
              "N, N·m of angles, with the set-points that the last step ended with; within its bounds.")
          .def_prop_ro(
              "contacts", [](Runner& r) { return ToArray(r.With(Contacts)); },
              "Structured array of the contacts that bear force: `fork1s.CONTACT` has the fields.",
              nb::sig("def contacts(self) -> numpy.typing.NDArray[numpy.void]"))
          .def_prop_ro(
              "kinetic_energy",
              [](Runner& r) { return r.With([](Simulation& s) { return s.KineticEnergy(); }); }, "J")
          .def_prop_ro(
              "potential_energy",
              [](Runner& r) { return r.With([](Simulation& s) { return s.PotentialEnergy(); }); },
              "J, of springs, servos and gravity.")
          .def_prop_ro(
              "error_estimate", ErrorEstimateOf,
              "How far the steps so far are estimated to be from the truth (`ErrorEstimate`), as `fork1s run "
              "--error` tells. `set_state` starts it afresh, `restore` goes back to that of the moment. Raises "
              "UsageError where the simulation was made without error=True.")
          .def_prop_ro(
              "joint_gap", [](Runner& r) { return r.With([](Simulation& s) { return s.JointGap(); }); },
              "Largest opening of any joint or loop [m].")
          .def_prop_ro(
              "warnings", [](Runner& r) { return r.Warnings(); },
              "Sentences about the model's reduction and its start; with watch=True about the steps since then, too, or "
              "since `set_state` or `restore`.")
          .def(
              "hash", [](Runner& r) { return r.With([](Simulation& s) { return s.HashState(); }); },
              "64 bits over all that the next step reads, warm starts and set-points included: equal where "
              "every "
              "bit of those is.")
          .def("__repr__", [](Runner& r) {
            return "<fork1s.Simulation '" + r.model()->scene().name + "' at " + std::to_string(r.Time()) +
                   " s>";
          });
  BindDynamics(simulation);
  BindState(simulation);
  BindLinearize(m, simulation);
}

}  // namespace fork1s::python
