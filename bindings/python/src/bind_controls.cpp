// sim.controls: a mapping from names to set-points.
#include <nanobind/make_iterator.h>
#include <nanobind/nanobind.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/vector.h>
#include "text.hpp"

#include "arguments.hpp"
#include "arrays.hpp"
#include "bind.hpp"
#include "controls.hpp"
#include "errors.hpp"

namespace fork1s::python {
namespace {

double Get(const Controls& c, const std::string& name) {
  const int at = c.runner->FindControl(name);
  return c.runner->With([&](Simulation& s) { return s.controls()(at); });
}

std::vector<std::string> Names(const Controls& c) {
  return c.runner->With([](Simulation& s) { return s.control_names(); });
}

}  // namespace

void SetControl(Runner& runner, const std::string& name, const Real& given) {
  const double value = given.Read("control '" + name + "'");
  const int at = runner.FindControl(name);
  if (!std::isfinite(value))
    throw nb::value_error(("control '" + name + "' must be finite, not " + std::to_string(value)).c_str());
  runner.With([&](Simulation& s) { s.SetControl(at, value); });
}

std::string Kind(const Controls& c, const std::string& name) {
  const int at = c.runner->FindControl(name);
  return c.runner->With([&](Simulation& s) {
    if (s.DrivesBase(at)) return "base";
    for (const MechanismDef& m : s.scene().mechanisms)
      for (const SwitchedClosureDef& closure : m.switched_closures)
        if (closure.control == name) return "switch";
    return "actuator";
  });
}

void SetRate(const Controls& c, const std::string& name, const Real& given) {
  const double rate = given.Read("rate of '" + name + "'");
  const int at = c.runner->FindControl(name);
  if (!std::isfinite(rate))
    throw nb::value_error(("rate of '" + name + "' must be finite, not " + std::to_string(rate)).c_str());
  const bool drives_base = c.runner->With([&](Simulation& s) {
    if (s.DrivesBase(at)) s.SetBaseRate(at, rate);
    return s.DrivesBase(at);
  });
  if (!drives_base) throw nb::value_error(("'" + name + "' is no coordinate of a driven base").c_str());
}

void BindControls(nb::module_& m) {
  auto type =
      nb::class_<Controls>(m, "Controls", R"(Set-points by name, as a dict: `sim.controls["thumb"] = 0.4`.

Values hold until changed; those outside a control's limits move to the nearest limit. Units are those of the actuator:
rad or m for position servos, N or N·m for motors. A driven base has six of its own, BASE.x .y .z (m) and .rx .ry .rz
(rotation vector, rad), from where it started. Raises UnknownNameError (a KeyError) and ValueError.)")
          .def("__getitem__", Get, nb::arg("name"))
          .def(
              "__setitem__",
              [](const Controls& c, const std::string& name, const Real& value) {
                SetControl(*c.runner, name, value);
              },
              nb::arg("name"), nb::arg("value"))
          .def("__len__", [](const Controls& c) { return Names(c).size(); })
          .def(
              "__contains__",
              [](const Controls& c, const nb::object& given) {
                std::string name;
                return nb::try_cast(given, name) &&
                       c.runner->With([&](Simulation& s) { return s.FindControl(name) >= 0; });
              },
              nb::arg("name"))
          .def(
              "__iter__", [](const Controls& c) { return nb::iter(nb::cast(Names(c))); },
              nb::sig("def __iter__(self) -> collections.abc.Iterator[str]"))
          .def("keys", Names, "Names, in the order of `Simulation.control_values`.")
          .def(
              "items",
              [](const Controls& c) {
                nb::list items;
                for (const std::string& name : Names(c)) items.append(nb::make_tuple(name, Get(c, name)));
                return items;
              },
              nb::sig("def items(self) -> list[tuple[str, float]]"))
          .def(
              "values",
              [](const Controls& c) {
                std::vector<double> values;
                for (const std::string& name : Names(c)) values.push_back(Get(c, name));
                return values;
              },
              "In the order of `keys`.")
          .def(
              "get",
              [](const Controls& c, const std::string& name, const nb::object& otherwise) {
                const bool is_there = c.runner->With([&](Simulation& s) { return s.FindControl(name) >= 0; });
                return is_there ? nb::cast(Get(c, name)) : otherwise;
              },
              nb::arg("name"), nb::arg("default") = nb::none(),
              nb::sig("def get(self, name: str, default: object = None) -> object"))
          .def(
              "update",
              [](const Controls& c, const nb::dict& values) {
                for (const auto& [name, value] : values)
                  SetControl(*c.runner, ReadAs<std::string>(name, "a name", "text"), Real{nb::borrow(value)});
              },
              nb::arg("values"), "Sets several at once.",
              nb::sig("def update(self, values: dict[str, float]) -> None"))
          .def(
              "kind", Kind, nb::arg("name"),
              "'actuator', 'base', a coordinate of a driven base, or 'switch', of a weld or connect that is switched.")
          .def(
              "set_rate", SetRate, nb::arg("name"), nb::arg("rate"),
              "The rate, m/s or that of the rotation vector in rad/s, that a coordinate of a driven base has "
              "at the end of the next step, or of the next call of `step` with move=True, where its path is "
              "known; to be set after the value. Else steps of two stages estimate it from the steps before. "
              "Raises UnknownNameError, ValueError.")
          .def("__repr__", [](const Controls& c) {
            std::string text = "<fork1s.Controls";
            for (const std::string& name : Names(c)) text += " " + name + "=" + std::to_string(Get(c, name));
            return text + ">";
          });
}

}  // namespace fork1s::python
