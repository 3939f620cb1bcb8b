// Errors of data from outside become exceptions with the sentence that the command line prints.
#pragma once

#include <nanobind/nanobind.h>

#include <fork1s/base/error.hpp>
#include <string>
#include <utility>
#include <vector>

#include "base/refused.hpp"

namespace fork1s::python {

namespace nb = nanobind;

// On its way to Python the code of an error chooses the class (fork1s/_errors.py).
using internal::Refused;
using internal::ValueOrThrow;

/// fork1s.UnknownNameError: "there is no WHAT 'NAME'; there are: ...".
[[noreturn]] void RefuseName(const char* what, const std::string& name,
                             const std::vector<std::string>& known);

void BindErrors(nb::module_& m);

}  // namespace fork1s::python
