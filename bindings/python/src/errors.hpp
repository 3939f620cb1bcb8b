// Errors of data from outside become exceptions with the sentence that the command line prints.
#pragma once

#include <nanobind/nanobind.h>

#include <fork1s/base/error.hpp>
#include <string>
#include <utility>
#include <vector>

namespace fork1s::python {

namespace nb = nanobind;

/// An Error on its way to Python, where its code chooses the class (fork1s/_errors.py).
struct Refused {
  Error error;
};

/// The value, or the exception. `file`: what the command line would put before the sentence.
template <class T>
T Take(Expected<T> expected, const std::string& file = {}) {
  if (!expected) {
    Error error = std::move(expected.error());
    if (!file.empty() && error.where.rfind(file, 0) != 0)
      error.where = error.where.empty() ? file : file + ": " + error.where;
    throw Refused{std::move(error)};
  }
  if constexpr (!std::is_void_v<T>) return std::move(*expected);
}

/// fork1s.UnknownNameError: "there is no WHAT 'NAME'; there are: ...".
[[noreturn]] void RefuseName(const char* what, const std::string& name,
                             const std::vector<std::string>& known);

void BindErrors(nb::module_& m);

}  // namespace fork1s::python
