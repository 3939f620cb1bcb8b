// The reduced simulation beside another one.
#include <nanobind/nanobind.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/vector.h>
#include "text.hpp"

#include <cmath>
#include <fork1s/study/compare.hpp>
#include <limits>

#include "arguments.hpp"
#include "arrays.hpp"
#include "bind.hpp"
#include "errors.hpp"
#include "model.hpp"
#include "released_gil.hpp"
#include "study/mjcf_file.hpp"
#include "words.hpp"

namespace fork1s::python {
namespace {

using Columns = std::map<std::string, std::vector<double>>;

// A column `time` and one for each control, as in a CSV file of controls.
ControlTrack ReadTrack(const nb::object& given) {
  ControlTrack track;
  if (given.is_none()) return track;
  Columns columns;
  for (const auto& [name, values] :
       ReadAs<std::map<std::string, nb::object>>(given, "controls", "a mapping from names to columns")) {
    const std::string column = "controls['" + name + "']";
    const Numbers numbers = ReadNumbers(values, column);
    const VectorX read = ReadVector(values, numbers.size(), column.c_str());
    columns[name].assign(read.data(), read.data() + read.size());
  }
  const auto refuse = [](const std::string& text) { throw Refused{{ErrorCode::kUsage, "controls", text}}; };
  const auto time = columns.find("time");
  if (time == columns.end()) refuse("needs a column 'time' [s]");
  track.times = time->second;
  for (std::size_t i = 1; i < track.times.size(); ++i)
    if (!(track.times[i] > track.times[i - 1])) refuse("times must increase");
  track.rows.resize(track.times.size());
  for (const auto& [name, values] : columns) {
    if (name == "time") continue;
    if (values.size() != track.times.size())
      refuse("'" + name + "' has " + std::to_string(values.size()) + " values for " +
             std::to_string(track.times.size()) + " times");
    track.names.push_back(name);
    for (std::size_t i = 0; i < values.size(); ++i) track.rows[i].push_back(values[i]);
  }
  return track;
}

Comparison CompareModel(const std::shared_ptr<const Model>& model, const std::string& against,
                        const Real& given_time, const std::optional<Real>& given_dt,
                        const Whole& given_refinements, const nb::object& controls,
                        const std::optional<std::string>& integrator,
                        const std::optional<std::string>& full_integrator) {
  CompareOptions options;
  if (against != "full" && against != "mujoco")
    throw Refused{{ErrorCode::kUsage, "against", "'" + against + "' is none of: full, mujoco"}};
  constexpr int kMaxRefinements = 8;  // each costs as much as all before it
  const int refinements = given_refinements.Within("refinements", 0, kMaxRefinements);
  const double time = given_time.Read("time");
  const std::optional<double> dt = Read(given_dt, "dt");
  if (!(time > 0) || (dt && !(*dt > 0 && std::isfinite(*dt))))
    throw Refused{{ErrorCode::kUsage, "compare", "time and dt must be above 0 s and finite"}};
  if (!(time / dt.value_or(model->scene().timestep) <= std::numeric_limits<int>::max()))
    throw Refused{
        {ErrorCode::kUsage, "time", "is more steps than can be counted; shorten it or lengthen dt"}};
  options.against = against == "full" ? Against::kFull : Against::kMuJoCo;
  if (options.against == Against::kMuJoCo && !model->file_options())
    throw Refused{
        {ErrorCode::kUsage, model->origin(),
         "MuJoCo opens the file of a model: load it from a path, and write stiffnesses and factors into the file"}};
  options.time = time;
  options.dt = dt.value_or(0);
  options.refinements = refinements;
  options.controls = ReadTrack(controls);
  if (integrator) options.integrator = ReadIntegrator(*integrator);
  if (full_integrator) {
    if (*full_integrator != "euler" && *full_integrator != "two-stages")
      throw Refused{
          {ErrorCode::kUsage, "full_integrator", "'" + *full_integrator + "' is none of: euler, two-stages"}};
    options.full_integrator =
        *full_integrator == "two-stages" ? FullIntegrator::kTwoStages : FullIntegrator::kEuler;
  }
  options.model_name = model->origin();
  ReleasedGil gil;
  options.progress = [&](double) {
    if (gil.IsPauseDue() && gil.Pause()) gil.ThrowIfInterrupted();
  };
  const auto compare = [&](const ImportedScene& imported) {
    return ValueOrThrow(Compare(imported, options), model->origin());
  };
  if (options.against == Against::kFull) return compare(model->imported());
  const SharedModel shared = ValueOrThrow(
      ShareWithMuJoCo(model->origin(), *model->file_options(), model->imported()), model->origin());
  options.model_path = shared.path;
  // MuJoCo's handlers of errors are the process's: such comparisons go one at a time, and pause.
  static CallMutex& mutex = *new CallMutex;
  Comparison compared;
  WithCallMutex(mutex, "compare", [&] { compared = compare(shared.imported); });
  return compared;
}

Array Path(const std::vector<Vector3>& path) {
  std::vector<double> rows;
  for (const Vector3& p : path) rows.insert(rows.end(), p.data(), p.data() + 3);
  return Own(std::move(rows), {path.size(), 3});
}

std::map<std::string, BodyDifference> Differences(const Comparison& c) {
  std::map<std::string, BodyDifference> all;
  for (const auto* list : {&c.interface, &c.free_bodies})
    for (const BodyDifference& b : *list) all[b.body] = b;
  return all;
}

std::map<std::string, ComparedTrace> Traces(const Comparison& c) {
  std::map<std::string, ComparedTrace> all;
  for (const ComparedTrace& t : c.traces) all[t.body] = t;
  return all;
}

}  // namespace

void BindCompare(nb::module_& m) {
  nb::class_<BodyDifference>(m, "BodyDifference",
                             "How far a body strays from where the other simulator has it.")
      .def_ro("rms_mm", &BodyDifference::rms_mm, "Position of its origin.")
      .def_ro("max_mm", &BodyDifference::max_mm)
      .def_ro("rms_deg", &BodyDifference::rms_deg, "Rotation.")
      .def_ro("max_deg", &BodyDifference::max_deg)
      .def("__repr__", [](const BodyDifference& b) {
        return "<fork1s.BodyDifference rms_mm=" + std::to_string(b.rms_mm) +
               " rms_deg=" + std::to_string(b.rms_deg) + ">";
      });
  nb::class_<ComparedTrace>(m, "ComparedTrace",
                            "One body's path and load in both runs; a row for each of `times`.")
      .def_prop_ro(
          "reduced", [](const ComparedTrace& t) { return Path(t.reduced_m); }, kOwn, "(t, 3) m")
      .def_prop_ro(
          "other", [](const ComparedTrace& t) { return Path(t.other_m); }, kOwn, "(t, 3) m")
      .def_prop_ro(
          "force_reduced", [](const ComparedTrace& t) { return Path(t.force_reduced_N); }, kOwn,
          "(t, 3) N of contacts on the body, mean over the interval")
      .def_prop_ro(
          "force_other", [](const ComparedTrace& t) { return Path(t.force_other_N); }, kOwn, "(t, 3) N");
  nb::class_<Comparison>(m, "Comparison", "Answer of `fork1s.compare`; docs/compare.md explains the figures.")
      .def_ro("against", &Comparison::other, "'full' or 'mujoco'.")
      .def_prop_ro("bodies", Differences,
                   "Name -> BodyDifference, of interface bodies, floating bases and free bodies.")
      .def_prop_ro(
          "integrators", [](const Comparison& c) { return IntegratorsText(c); },
          "By what the runs were stepped, as in 'reduced by two-stage, full by two-stages'.")
      .def_prop_ro("traces", Traces, "Name -> ComparedTrace.")
      .def_prop_ro(
          "times", [](const Comparison& c) { return ToArray(c.times_s); }, kOwn, "(t,) s")
      .def_ro("dt", &Comparison::dt_s, "s")
      .def_ro("force_rms", &Comparison::force_rms_N,
              "N, of the difference of contact forces, per body and interval.")
      .def_ro("force_max", &Comparison::force_max_N, "N")
      .def_ro("force_rms_percent", &Comparison::force_rms_percent, "Of the other's RMS force.")
      .def_prop_ro(
          "frequencies_reduced", [](const Comparison& c) { return ToArray(c.frequencies_reduced_hz); }, kOwn,
          "(k,) Hz")
      .def_prop_ro(
          "frequencies_full", [](const Comparison& c) { return ToArray(c.frequencies_full_hz); }, kOwn,
          "(k,) Hz")
      .def_ro("wall_ratio", &Comparison::wall_ratio, "Time of the other's steps over that of ours.")
      .def_ro("unconverged_reduced", &Comparison::unconverged_reduced, "Steps.")
      .def_ro("unconverged_other", &Comparison::unconverged_other, "Steps.")
      .def_prop_ro("warnings",
                   [](const Comparison& c) {
                     std::vector<std::string> lines = PairLines(c);
                     lines.insert(lines.end(), c.warnings.begin(), c.warnings.end());
                     return lines;
                   })
      .def(
          "write_report",
          [](const Comparison& c, const nb::object& path) {
            ValueOrThrow(WriteComparisonReport(c, ReadPath(path, "path")));
          },
          nb::arg("path"), "One self-contained HTML page with tables and plots. Raises FileError.")
      .def("__repr__", [](const Comparison& c) {
        double worst = 0;
        for (const auto& [name, b] : Differences(c)) worst = std::max(worst, b.rms_mm);
        return "<fork1s.Comparison against " + c.other + ": " + std::to_string(worst) + " mm RMS at most>";
      });
  m.def("compare", CompareModel, nb::arg("model"), nb::arg("against") = "full", nb::kw_only(),
        nb::arg("time") = 2.0, nb::arg("dt") = nb::none(), nb::arg("refinements") = 0,
        nb::arg("controls") = nb::none(), nb::arg("integrator") = nb::none(),
        nb::arg("full_integrator") = nb::none(),
        R"(Simulates the model beside the full-coordinate simulator ('full') or MuJoCo's mj_step ('mujoco').

time: s to simulate. dt: time step in s, default the model's. refinements: further runs at dt/2, dt/4, ... controls:
columns by name, `time` [s] among them, linear between rows. integrator: of the reduced run, 'euler' or 'two-stage', default as of a Simulation.
full_integrator: of the full one, 'euler' or 'two-stages', default of the same order. Others run while it works. Raises NumericsError, ModelError
for controls that the model does not have, UsageError for a model that is of no file, or has other stiffnesses than it. MuJoCo opens the file; of a URDF, or with
other `load` options than interface, modes and keyframe, one that is written for it.)",
        nb::sig(
            "def compare(model: Model, against: str = 'full', *, time: float = 2.0, dt: float | None = None, "
            "refinements: int = 0, controls: collections.abc.Mapping[str, numpy.typing.ArrayLike] | None = "
            "None, "
            "integrator: str | None = None, full_integrator: str | None = None) -> Comparison"));
}

}  // namespace fork1s::python
