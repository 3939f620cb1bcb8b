// Model and Mechanism: what a file is before anything moves.
#include <nanobind/nanobind.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>
#include "text.hpp"

#include <fork1s/reduction/frequencies.hpp>

#include "arguments.hpp"
#include "arrays.hpp"
#include "bind.hpp"
#include "errors.hpp"
#include "mechanism/names.hpp"
#include "mechanism_view.hpp"
#include "point_view.hpp"
#include "released_gil.hpp"
#include "study/linear_model.hpp"
#include "words.hpp"

namespace fork1s::python {
namespace {

using ModelPtr = std::shared_ptr<const Model>;

// A property that a model with one mechanism lends from it.
#define FORK1S_OF_ONLY(function) [](const ModelPtr& s) { return function(OnlyMechanism(s)); }

Array ComplianceOf(const MechanismView& v, const std::vector<std::string>& bodies, bool lock_free) {
  return OwnMatrix(v.Compliance(bodies, lock_free).C);
}

nb::object StiffnessOf(const MechanismView& v, const std::vector<std::string>& bodies, bool lock_free) {
  const MatrixX K = StiffnessFromCompliance(v.Compliance(bodies, lock_free), v.mechanism().length_scale());
  return K.size() == 0 ? nb::none() : nb::cast(OwnMatrix(K));
}

Array ResponseOf(const MechanismView& v, const std::vector<std::string>& bodies, bool lock_free) {
  const std::vector<BodyIndex> found = v.FindBodies(bodies);
  return OwnMatrix(
      InterfaceResponse(v.mechanism(), v.posed().q, found, v.CoordinatesToLock(found, lock_free)));
}

Array FullFrequenciesOf(const MechanismView& v) {
  const int count = std::max(8, std::min(v.model->Reduction(v.index)->size(), 16));
  return ToArray(FullFrequencies(v.mechanism(), v.posed().q, count));
}

Array ReducedFrequenciesOf(const MechanismView& v) {
  const auto reduction = v.model->Reduction(v.index);
  return ToArray(ReducedFrequencies(*reduction, std::max(8, std::min(reduction->size(), 16))));
}

PointView PointStiffnessOf(const MechanismView& v, const std::string& body, const nb::object& point,
                           const nb::object& gravity, bool lock_free) {
  if (!v.mechanism().FindBody(body).valid()) RefuseName("body", body, v.Bodies());
  const Vector3 p_B = ReadOrZero(point, "point"),
                g = gravity.is_none() ? v.model->scene().gravity : ReadVector3(gravity, "gravity");
  const ReleasedGil others_run;
  return MeasureStiffness(v, {body, p_B}, g, lock_free);
}

std::shared_ptr<const ReducedModel> MatricesOf(const MechanismView& v) { return v.model->Reduction(v.index); }

LinearModel LinearModelOf(const MechanismView& v) {
  return ComputeLinearModel(v.posed(), *v.model->Reduction(v.index));
}

StateSpace StateSpaceOf(const MechanismView& v) {
  return ValueOrThrow(ToStateSpace(LinearModelOf(v)), v.model->origin());
}

// name -> (lower, upper, initial)
std::map<std::string, std::tuple<double, double, double>> ControlsOf(const MechanismView& v) {
  std::map<std::string, std::tuple<double, double, double>> controls;
  for (const Mechanism::Control& c : v.mechanism().controls())
    controls[c.name] = {c.lower, c.upper, c.initial};
  return controls;
}

std::vector<std::string> NotesOf(const ModelPtr& s) {
  std::vector<std::string> notes;
  for (const ImportNote& n : s->imported().report.notes) notes.push_back(n.Text());
  return notes;
}

MechanismView MechanismOfAll(const ModelPtr& s, const std::vector<std::string>& bodies) {
  return bodies.empty() ? OnlyMechanism(s) : MechanismOf(s, bodies.front());
}

constexpr const char* kCompliance =
    R"(Compliance that the named bodies (all interface bodies if none is named) feel with the base held.

(6e, 6e): displacements [rotation; translation of the body's origin] of each body per load [moment about that origin;
force], world axes; rad/(N·m), m/N. Taken at the pose where the simulation starts. Where a motion that no spring
resists moves one of the bodies it has no bound: lock_free=True locks a joint of each such motion.

Raises UnknownNameError; without lock_free UnderdeterminedError, which names the joint.)";
constexpr const char* kStiffness =
    R"(Inverse of `compliance` of the same bodies (6e, 6e), or None where they cannot be pushed elastically in every
way. lock_free and errors as of `compliance`.)";
constexpr const char* kResponse =
    R"(How the named bodies (all interface bodies if none is named) move per force along each joint coordinate.

(6e, n): rows as of `compliance`, columns as of `coordinates`; rad/(N·m), m/(N·m) of hinges, rad/N, m/N of slides.
Column j is y_j, and the compliance changes with the stiffness of coordinate j by -outer(y_j, y_j), exactly.
lock_free and errors as of `compliance`.)";
constexpr const char* kPointStiffness =
    R"(Stiffness at a point of a body, the base held: of the springs alone, and about the equilibrium under gravity,
controls at their initial values and the preload of springs (`PointStiffness`).

point: (3,) m from the body's origin, in its axes; the origin by default. gravity: (3,) m/s² instead of the model's.
Where a motion that nothing resists moves the point along a direction its stiffness is 0 there, and `free` names the
joint; lock_free=True locks a joint of each motion that no spring resists and that moves the body or an interface body.

Raises UnknownNameError.)";
constexpr const char* kPointStiffnessSignature =
    "def point_stiffness(self, body: str, point: numpy.typing.ArrayLike | None = None, *, gravity: "
    "numpy.typing.ArrayLike | None = None, lock_free: bool = False) -> PointStiffness";
constexpr const char* kFrequencies =
    R"((k,) lowest undamped natural frequencies [Hz] of all joint coordinates, about the starting pose and unloaded; a
floating base moves along. Motions that no spring resists are left out.)";
constexpr const char* kReducedFrequencies =
    R"((k,) the same frequencies [Hz] within the reduced coordinates.)";
constexpr const char* kMatrices =
    R"(M, D, K, T, Q of the reduced model (`Matrices`). Raises UnderdeterminedError, ModelError, NumericsError.)";

constexpr const char* kLinearModel =
    R"(M, D, K, B, C of the equations of motion to first order about the start (`LinearModel`): what `fork1s reduce --out
FILE.npz` writes. Raises as `matrices`.)";
constexpr const char* kStateSpace =
    R"(A, B, C, D of the same as first-order equations (`StateSpace`), with names and units: what python-control and SciPy
take. Raises as `matrices`.)";

void BindMechanism(nb::module_& m) {
  nb::class_<MechanismView>(m, "Mechanism", "One mechanism of a model: bodies on joints, springs and loops.")
      .def_prop_ro("name", [](const MechanismView& v) { return v.mechanism().name(); })
      .def_prop_ro(
          "base", [](const MechanismView& v) { return Name(v.mechanism().base()); },
          "'fixed', 'floating' or 'driven'.")
      .def_prop_ro(
          "mass", [](const MechanismView& v) { return v.mechanism().total_mass(); }, "kg")
      .def_prop_ro(
          "length_scale", [](const MechanismView& v) { return v.mechanism().length_scale(); },
          "m; mean distance between successive joints, by which turns and shifts compare.")
      .def_prop_ro("bodies", &MechanismView::Bodies, "Names; the first is the base.")
      .def_prop_ro("interfaces", &MechanismView::Interfaces, "Names of the bodies that may touch.")
      .def_prop_ro("coordinates", &MechanismView::Coordinates, "Names of the n joint coordinates.")
      .def_prop_ro("controls", ControlsOf, "Name -> (lower, upper, initial).")
      .def(
          "compliance",
          [](const MechanismView& v, const nb::args& b, bool lock_free) {
            return ComplianceOf(v, Words(b), lock_free);
          },
          nb::arg("bodies"), nb::arg("lock_free") = false, kCompliance,
          nb::sig("def compliance(self, *bodies: str, lock_free: bool = False) -> "
                  "numpy.typing.NDArray[numpy.float64]"))
      .def(
          "stiffness",
          [](const MechanismView& v, const nb::args& b, bool lock_free) {
            return StiffnessOf(v, Words(b), lock_free);
          },
          nb::arg("bodies"), nb::arg("lock_free") = false, kStiffness,
          nb::sig("def stiffness(self, *bodies: str, lock_free: bool = False) -> "
                  "numpy.typing.NDArray[numpy.float64] | None"))
      .def(
          "response",
          [](const MechanismView& v, const nb::args& b, bool lock_free) {
            return ResponseOf(v, Words(b), lock_free);
          },
          nb::arg("bodies"), nb::arg("lock_free") = false, kResponse,
          nb::sig("def response(self, *bodies: str, lock_free: bool = False) -> "
                  "numpy.typing.NDArray[numpy.float64]"))
      .def("point_stiffness", PointStiffnessOf, nb::arg("body"), nb::arg("point") = nb::none(), nb::kw_only(),
           nb::arg("gravity") = nb::none(), nb::arg("lock_free") = false, kPointStiffness,
           nb::sig(kPointStiffnessSignature))
      .def_prop_ro("frequencies", FullFrequenciesOf, kFrequencies, kOwn)
      .def_prop_ro("reduced_frequencies", ReducedFrequenciesOf, kReducedFrequencies, kOwn)
      .def_prop_ro("matrices", MatricesOf, kMatrices)
      .def("linear_model", LinearModelOf, kLinearModel)
      .def("state_space", StateSpaceOf, kStateSpace)
      .def("__repr__", [](const MechanismView& v) {
        return "<fork1s.Mechanism '" + v.mechanism().name() +
               "': " + std::to_string(v.mechanism().num_bodies()) + " bodies, " +
               std::to_string(v.mechanism().num_coordinates()) + " joint coordinates>";
      });
}

}  // namespace

void BindModel(nb::module_& m) {
  BindMechanism(m);
  // With attributes of its own, for fork1s._load notes there how it was read: so it can go to other
  // processes.
  nb::class_<Model>(m, "Model", nb::dynamic_attr(),
                    R"(A model file as it was read; never changes. Made by `fork1s.load`.

Where it has one mechanism, `compliance`, `frequencies`, `matrices` and so on are that mechanism's; where it has
several, ask `mechanisms[i]`, or name a body.)")
      .def_prop_ro("path", &Model::origin, "Where it came from.")
      .def_prop_ro("name", [](const ModelPtr& s) { return s->scene().name; })
      .def_prop_ro(
          "format", [](const ModelPtr& s) { return s->imported().report.format; }, "'MJCF' or 'URDF'.")
      .def_prop_ro("notes", NotesOf, "What was dropped, changed or chosen on reading, a sentence each.")
      .def_prop_ro(
          "holds",
          [](const ModelPtr& s) {
            std::map<std::string, std::string> holds;
            for (const JointHold& h : s->imported().report.holds) holds[h.joint] = h.held_by;
            return holds;
          },
          "What holds each joint coordinate: name -> 'spring 2 N·m/rad', \"closed by 'loop'\", 'nothing', "
          "...")
      .def_prop_ro(
          "bodies", &Model::BodyNames,
          "Names of all bodies, in the order of Simulation.poses: mechanism by mechanism, then free bodies.")
      .def_prop_ro("mechanisms",
                   [](const ModelPtr& s) {
                     std::vector<MechanismView> views;
                     for (std::size_t i = 0; i < s->mechanisms().size(); ++i) views.push_back({s, i});
                     return views;
                   })
      .def_prop_ro(
          "keyframes",
          [](const ModelPtr& s) {
            std::vector<std::string> names;
            for (const KeyframeDef& key : s->scene().keyframes) names.push_back(key.name);
            return names;
          },
          "Names of the initial states that the file has; after them 'start' where load() starts the model "
          "elsewhere (q, hold, limits and loops), which is none of the file.")
      .def_prop_ro(
          "gravity", [](const ModelPtr& s) { return OwnVector(s->scene().gravity); },
          "(3,) m/s², world axes.", kOwn)
      .def_prop_ro(
          "timestep", [](const ModelPtr& s) { return s->scene().timestep; },
          "s, of a Simulation that names none.")
      .def_prop_ro("interfaces", FORK1S_OF_ONLY([](const MechanismView& v) { return v.Interfaces(); }),
                   "Names of the bodies that may touch.")
      .def_prop_ro("coordinates", FORK1S_OF_ONLY([](const MechanismView& v) { return v.Coordinates(); }),
                   "Names of the n joint coordinates.")
      .def_prop_ro(
          "controls",
          [](const ModelPtr& s) {
            std::map<std::string, std::tuple<double, double, double>> all;
            for (std::size_t i = 0; i < s->mechanisms().size(); ++i) all.merge(ControlsOf({s, i}));
            return all;
          },
          "Name -> (lower, upper, initial), of all mechanisms.")
      .def(
          "compliance",
          [](const ModelPtr& s, const nb::args& args, bool lock_free) {
            const auto bodies = Words(args);
            return ComplianceOf(MechanismOfAll(s, bodies), bodies, lock_free);
          },
          nb::arg("bodies"), nb::arg("lock_free") = false, kCompliance,
          nb::sig("def compliance(self, *bodies: str, lock_free: bool = False) -> "
                  "numpy.typing.NDArray[numpy.float64]"))
      .def(
          "stiffness",
          [](const ModelPtr& s, const nb::args& args, bool lock_free) {
            const auto bodies = Words(args);
            return StiffnessOf(MechanismOfAll(s, bodies), bodies, lock_free);
          },
          nb::arg("bodies"), nb::arg("lock_free") = false, kStiffness,
          nb::sig("def stiffness(self, *bodies: str, lock_free: bool = False) -> "
                  "numpy.typing.NDArray[numpy.float64] | None"))
      .def(
          "response",
          [](const ModelPtr& s, const nb::args& args, bool lock_free) {
            const auto bodies = Words(args);
            return ResponseOf(MechanismOfAll(s, bodies), bodies, lock_free);
          },
          nb::arg("bodies"), nb::arg("lock_free") = false, kResponse,
          nb::sig("def response(self, *bodies: str, lock_free: bool = False) -> "
                  "numpy.typing.NDArray[numpy.float64]"))
      .def(
          "point_stiffness",
          [](const ModelPtr& s, const std::string& body, const nb::object& point, const nb::object& gravity,
             bool lock_free) {
            return PointStiffnessOf(MechanismOf(s, body), body, point, gravity, lock_free);
          },
          nb::arg("body"), nb::arg("point") = nb::none(), nb::kw_only(), nb::arg("gravity") = nb::none(),
          nb::arg("lock_free") = false, kPointStiffness, nb::sig(kPointStiffnessSignature))
      .def_prop_ro(
          "stiffnesses", [](const ModelPtr& s) { return s->Stiffnesses(); },
          "Joint coordinate -> what holds it, its spring and the servos on it together, tendon with a spring and servo of a tendon "
          "by its name -> its own: N·m/rad or N/m.")
      .def("_with_stiffness",
           [](const ModelPtr& s, const nb::object& k) {
             return s->WithStiffness(ReadAs<std::map<std::string, double>>(
                 k, "stiffness", "a mapping from joint coordinates to numbers"));
           })
      .def(
          "with_stiffness",
          [](const nb::object& self, const nb::object& stiffness) {
            return nb::module_::import_("fork1s._load").attr("with_stiffness")(self, stiffness);
          },
          nb::arg("stiffness"),
          "The same model with other stiffnesses of joints.\n\nstiffness: joint coordinate -> what holds it, "
          "its spring and the servos that pull it alone together, N·m/rad or N/m; their shares stay, damping "
          "goes with the root. Or a tendon with a spring, or the servo of a tendon or of several joints, by its name -> its "
          "own stiffness, above 0, with its gain and the bounds of its force. Raises UnknownNameError, UsageError.",
          nb::sig("def with_stiffness(self, stiffness: collections.abc.Mapping[str, float]) -> Model"))
      .def("_with_factors",
           [](const ModelPtr& s, const nb::object& factors) {
             return s->WithFactors(ReadAs<std::map<std::string, double>>(factors, "factors",
                                                                         "a mapping from names to numbers"));
           })
      .def(
          "with_factors",
          [](const nb::object& self, const nb::object& factors) {
            return nb::module_::import_("fork1s._load").attr("with_factors")(self, factors);
          },
          nb::arg("factors"),
          "The same model with parts scaled, as a member of a `Batch` with these factors has them.\n\nfactors: name -> "
          "factor of 0 or more, of mass and of one stiffness above 0. `mass`, `friction`, `stiffness`, `damping`, `frictionloss` of all, `gravity`; `mass:BODY`, "
          "`friction:BODY`, `stiffness:NAME`, `damping:NAME`, `frictionloss:NAME` of one, which multiply with those of "
          "all (`Batch` explains them). Raises UsageError, with near names.",
          nb::sig("def with_factors(self, factors: collections.abc.Mapping[str, float]) -> Model"))
      .def(
          "fit_stiffness",
          [](const nb::object& self, const nb::args& given, const nb::kwargs& named) {
            return nb::module_::import_("fork1s._fit").attr("fit_stiffness")(self, *given, **named);
          },
          "Stiffnesses of joints with which bodies have a wanted compliance; needs scipy. "
          "`fork1s.fit_stiffness` "
          "explains its arguments.",
          nb::sig("def fit_stiffness(self, target: numpy.typing.ArrayLike | collections.abc.Mapping[str, "
                  "numpy.typing.ArrayLike], joints: collections.abc.Sequence[str] | None = None, *, bounds: "
                  "tuple[float, float] | collections.abc.Mapping[str, tuple[float, float]] = (0.01, 100), "
                  "tolerance: float = 0.01) -> 'fork1s.StiffnessFit'"))
      .def_prop_ro("frequencies", FORK1S_OF_ONLY(FullFrequenciesOf), kFrequencies, kOwn)
      .def_prop_ro("reduced_frequencies", FORK1S_OF_ONLY(ReducedFrequenciesOf), kReducedFrequencies, kOwn)
      .def_prop_ro("matrices", FORK1S_OF_ONLY(MatricesOf), kMatrices)
      .def("linear_model", FORK1S_OF_ONLY(LinearModelOf), kLinearModel)
      .def("state_space", FORK1S_OF_ONLY(StateSpaceOf), kStateSpace)
      .def("__repr__", [](const ModelPtr& s) {
        return "<fork1s.Model '" + s->scene().name + "' of " + s->origin() + ": " +
               std::to_string(s->mechanisms().size()) + " mechanisms, " +
               std::to_string(s->scene().free_bodies.size()) + " free bodies>";
      });
}

#undef FORK1S_OF_ONLY

}  // namespace fork1s::python
