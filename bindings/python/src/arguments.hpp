// Arguments of Python that are refused by name, with what was given and what is wanted.
#pragma once

#include <nanobind/nanobind.h>

#include <limits>
#include <memory>
#include <optional>
#include <string>

namespace fork1s::python {

namespace nb = nanobind;

/// Throws TypeError: "ARGUMENT must be WANTED, not GIVEN".
[[noreturn]] void RefuseType(const std::string& argument, const char* wanted, nb::handle given);

/// A whole number of any size, checked where its argument has a name.
struct Whole {
  nb::object given;
  /// Throws TypeError, or Refused outside of [least, most].
  int Within(const std::string& argument, int least, int most = std::numeric_limits<int>::max()) const;
};

/// A number, checked where its argument has a name.
struct Real {
  nb::object given;
  /// Throws TypeError.
  double Read(const std::string& argument) const;
};
inline std::optional<double> Read(const std::optional<Real>& number, const char* argument) {
  if (!number) return std::nullopt;
  return number->Read(argument);
}

class Model;
/// A model, and where a file is given in its place an error that says how to read it.
struct GivenModel {
  nb::object given;
  /// Throws TypeError.
  std::shared_ptr<const Model> Read(const std::string& argument) const;
};

/// Throws TypeError. wanted: as in "a number".
template <class T>
T ReadAs(nb::handle given, const std::string& argument, const char* wanted) {
  T read{};
  if (!nb::try_cast<T>(given, read)) RefuseType(argument, wanted, given);
  return read;
}

/// str, bytes or os.PathLike. Throws TypeError, and ValueError for what no file can be called.
std::string ReadPath(nb::handle given, const char* argument);

}  // namespace fork1s::python

namespace nanobind::detail {

// They take anything: the function that gets it says what it is not.
template <>
struct type_caster<fork1s::python::Whole> {
  NB_TYPE_CASTER(fork1s::python::Whole, const_name("int"))
  bool from_python(handle source, std::uint32_t, cleanup_list*) noexcept {
    value.given = borrow(source);
    return true;
  }
};
template <>
struct type_caster<fork1s::python::Real> {
  NB_TYPE_CASTER(fork1s::python::Real, const_name("float"))
  bool from_python(handle source, std::uint32_t, cleanup_list*) noexcept {
    value.given = borrow(source);
    return true;
  }
};
template <>
struct type_caster<fork1s::python::GivenModel> {
  NB_TYPE_CASTER(fork1s::python::GivenModel, const_name("Model"))
  bool from_python(handle source, std::uint32_t, cleanup_list*) noexcept {
    value.given = borrow(source);
    return true;
  }
};

}  // namespace nanobind::detail
