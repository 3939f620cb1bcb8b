// sim.sensors and batch.sensors: a mapping from names to measured values.
#include <nanobind/nanobind.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <iomanip>
#include <sstream>

#include "arguments.hpp"
#include "arrays.hpp"
#include "bind.hpp"
#include "errors.hpp"
#include "sensor_values.hpp"
#include "text.hpp"

namespace fork1s::python {
namespace {

// (k,), of a batch (n, k).
Array ValueOf(const SensorValues& s, std::size_t sensor) {
  const std::size_t width = s.first.back(), size = s.first[sensor + 1] - s.first[sensor];
  std::vector<double> values;
  for (std::size_t i = 0; i < s.members.value_or(1); ++i) {
    const auto begin = s.values.begin() + static_cast<std::ptrdiff_t>(i * width + s.first[sensor]);
    values.insert(values.end(), begin, begin + static_cast<std::ptrdiff_t>(size));
  }
  if (s.members) return Own(std::move(values), {*s.members, size});
  return Own(std::move(values), {size});
}

std::size_t FindNamed(const SensorValues& s, const char* kind, const std::string& name) {
  const auto at = std::find(s.names.begin(), s.names.end(), name);
  if (at == s.names.end()) RefuseName(kind, name, s.names);
  return static_cast<std::size_t>(at - s.names.begin());
}

// (), which float() takes.
Array ForceOf(const ActuatorForces& s, std::size_t actuator) {
  return Own({s.values[s.first[actuator]]}, {});
}

Array SensorNamed(const SensorValues& s, const std::string& name) {
  return ValueOf(s, FindNamed(s, "sensor", name));
}

std::map<std::string, std::string> Reasons(const SensorValues& s) {
  std::map<std::string, std::string> reasons;
  for (std::size_t i = 0; i < s.names.size(); ++i)
    if (!s.reasons[i].empty()) reasons[s.names[i]] = s.reasons[i];
  return reasons;
}

}  // namespace

void BindSensors(nb::module_& m) {
  auto type =
      nb::class_<SensorValues>(
          m, "Sensors",
          R"(Sensors of the file by name, read-only: `sim.sensors["gyro"]`, `batch.sensors["gyro"]`.

Values are those of the moment at which `sensors` was asked for; each is an array (k,), of a batch (n, k), in the units of MJCF. A
sensor that has no value is NaN, and `missing` says why. Raises UnknownNameError (a KeyError).)")
          .def("__getitem__", SensorNamed, nb::arg("name"),
               nb::sig("def __getitem__(self, name: str) -> numpy.typing.NDArray[numpy.float64]"))
          .def("__len__", [](const SensorValues& s) { return s.names.size(); })
          .def(
              "__contains__",
              [](const SensorValues& s, const nb::object& given) {
                std::string name;
                return nb::try_cast(given, name) &&
                       std::find(s.names.begin(), s.names.end(), name) != s.names.end();
              },
              nb::arg("name"))
          .def(
              "__iter__", [](const SensorValues& s) { return nb::iter(nb::cast(s.names)); },
              nb::sig("def __iter__(self) -> collections.abc.Iterator[str]"))
          .def(
              "keys", [](const SensorValues& s) { return s.names; }, "Names, in the order of the file.")
          .def(
              "items",
              [](const SensorValues& s) {
                nb::list items;
                for (std::size_t i = 0; i < s.names.size(); ++i)
                  items.append(nb::make_tuple(s.names[i], ValueOf(s, i)));
                return items;
              },
              nb::sig("def items(self) -> list[tuple[str, numpy.typing.NDArray[numpy.float64]]]"))
          .def(
              "values",
              [](const SensorValues& s) {
                nb::list values;
                for (std::size_t i = 0; i < s.names.size(); ++i) values.append(ValueOf(s, i));
                return values;
              },
              nb::sig("def values(self) -> list[numpy.typing.NDArray[numpy.float64]]"))
          .def_prop_ro(
              "array",
              [](const SensorValues& s) {
                if (s.members) return Own(s.values, {*s.members, s.first.back()});
                return ToArray(s.values);
              },
              "(m,), of a batch (n, m): values of all sensors, one after another in the order of the file.",
              kOwn, nb::sig("def array(self) -> numpy.typing.NDArray[numpy.float64]"))
          .def_prop_ro("missing", Reasons, "Name -> why it has no value, of those that have none.")
          .def("__repr__", [](const SensorValues& s) {
            std::string text = "<fork1s.Sensors";
            for (const std::string& name : s.names) text += ' ' + name;
            return text + '>';
          });
  nb::class_<ActuatorForces, SensorValues>(
      m, "ActuatorForces",
      "Forces of actuators by name, read-only, N or N·m: `sim.actuator_forces[\"grip\"]` is an array () of one number, "
      "as `float` takes it. As `Sensors`.")
      .def(
          "__getitem__",
          [](const ActuatorForces& s, const std::string& name) {
            return ForceOf(s, FindNamed(s, "actuator", name));
          },
          nb::arg("name"), nb::sig("def __getitem__(self, name: str) -> numpy.typing.NDArray[numpy.float64]"))
      .def(
          "items",
          [](const ActuatorForces& s) {
            nb::list items;
            for (std::size_t i = 0; i < s.names.size(); ++i)
              items.append(nb::make_tuple(s.names[i], ForceOf(s, i)));
            return items;
          },
          nb::sig("def items(self) -> list[tuple[str, numpy.typing.NDArray[numpy.float64]]]"))
      .def(
          "values",
          [](const ActuatorForces& s) {
            nb::list values;
            for (std::size_t i = 0; i < s.names.size(); ++i) values.append(ForceOf(s, i));
            return values;
          },
          nb::sig("def values(self) -> list[numpy.typing.NDArray[numpy.float64]]"))
      .def("__repr__", [](const ActuatorForces& s) {
        std::ostringstream text;
        text << std::setprecision(4) << "<fork1s.ActuatorForces";
        for (std::size_t i = 0; i < s.names.size(); ++i)
          text << ' ' << s.names[i] << '=' << s.values[s.first[i]];
        return text.str() + '>';
      });
}

}  // namespace fork1s::python
