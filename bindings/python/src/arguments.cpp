#include "arguments.hpp"

#include <nanobind/stl/shared_ptr.h>

#include "errors.hpp"
#include "model.hpp"
#include "text.hpp"

namespace fork1s::python {
namespace {

std::string Shown(nb::handle given) {
  constexpr std::size_t kMaxLength = 60;
  const auto text = nb::steal<nb::object>(PyObject_ASCII(given.ptr()));
  if (!text.is_valid()) PyErr_Clear();  // an int of more digits than Python prints, or a __repr__ that raises
  const std::string shown = text.is_valid() ? nb::cast<std::string>(text) : "";
  if (!shown.empty() && shown.size() <= kMaxLength) return shown;
  return "a value of type " + nb::cast<std::string>(given.type().attr("__name__"));
}

}  // namespace

void RefuseType(const std::string& argument, const char* wanted, nb::handle given) {
  throw nb::type_error((argument + " must be " + wanted + ", not " + Shown(given)).c_str());
}

std::shared_ptr<const Model> GivenModel::Read(const std::string& argument) const {
  std::shared_ptr<const Model> model;
  if (nb::try_cast(given, model) && model) return model;
  if (!nb::isinstance<nb::str>(given) && !nb::hasattr(given, "__fspath__"))
    RefuseType(argument, "a fork1s.Model", given);
  const std::string shown = Shown(given);
  throw nb::type_error((argument + " must be a fork1s.Model, not " + shown + "; pass fork1s.load(" +
                        (shown.rfind("a value", 0) == 0 ? "..." : shown) + ")")
                           .c_str());
}

int Whole::Within(const std::string& argument, int least, int most) const {
  const auto whole = nb::steal<nb::object>(PyNumber_Index(given.ptr()));
  if (!whole.is_valid()) {
    PyErr_Clear();
    RefuseType(argument, "a whole number", given);
  }
  int overflow = 0;
  const long value = PyLong_AsLongAndOverflow(whole.ptr(), &overflow);
  if (overflow != 0 || value < least || value > most)
    throw Refused{{ErrorCode::kUsage, argument,
                   "must be a whole number from " + std::to_string(least) + " to " + std::to_string(most) +
                       ", not " + Shown(given)}};
  return static_cast<int>(value);
}

double Real::Read(const std::string& argument) const { return ReadAs<double>(given, argument, "a number"); }

std::string ReadPath(nb::handle given, const char* argument) {
  std::string path;
  try {
    path = nb::cast<std::string>(nb::module_::import_("os").attr("fsdecode")(given));
  } catch (const nb::python_error&) {
    RefuseType(argument, "a path", given);
  }
  if (path.find('\0') != std::string::npos)
    throw nb::value_error(
        (std::string(argument) + " must not hold a null character, as " + Shown(given) + " does").c_str());
  return path;
}

}  // namespace fork1s::python
