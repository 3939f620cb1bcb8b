// Words of the API for enumerations, as the command line has them.
#pragma once

#include "text.hpp"

#include <array>
#include <cmath>
#include <cstdio>
#include <fork1s/sim/fidelity.hpp>
#include <optional>
#include <string>
#include <vector>

#include "arguments.hpp"
#include "errors.hpp"
#include "runner.hpp"

namespace fork1s::python {

inline DetailLevel ReadDetail(const std::string& word) {
  for (const DetailLevel level :
       {DetailLevel::kObject, DetailLevel::kInterface, DetailLevel::kParents, DetailLevel::kAll})
    if (word == Name(level)) return level;
  throw Refused{{ErrorCode::kUsage, "detail", "'" + word + "' is none of: object, interface, parents, all"}};
}

inline Recovery ReadRecovery(const std::string& word) {
  if (const auto recovery = RecoveryNamed(word)) return *recovery;
  throw Refused{{ErrorCode::kUsage, "recovery", "'" + word + "' is none of: exact, expanded, curved, twist"}};
}

inline Integrator ReadIntegrator(const std::string& word) {
  if (const auto integrator = IntegratorNamed(word)) return *integrator;
  if (word == "theta") throw Refused{{ErrorCode::kUsage, "integrator", kThetaIsGone}};
  throw Refused{{ErrorCode::kUsage, "integrator", "'" + word + "' is none of: euler, two-stage"}};
}

/// Steps above that [s] leave nothing of the motion of grippers, legs and arms.
inline constexpr double kLongStep = 0.5;

inline void WarnOfLongStep(double dt) {
  if (dt <= kLongStep) return;
  std::array<char, 128> text;
  std::snprintf(text.data(), text.size(),
                "dt is %.4g s: motion that is quicker than a few steps is lost; 1/60 s is usual", dt);
  if (PyErr_WarnEx(PyExc_UserWarning, text.data(), 1) < 0) throw nb::python_error();
}

/// Options that Simulation and Batch share.
inline RunOptions ReadRunOptions(const std::optional<Real>& given_dt,
                                 const std::optional<std::string>& keyframe, const std::string& recovery,
                                 const std::string& detail, const std::optional<std::string>& integrator) {
  const std::optional<double> dt = Read(given_dt, "dt");
  if (dt && !(*dt > 0 && std::isfinite(*dt)))
    throw Refused{{ErrorCode::kUsage, "dt", std::to_string(*dt) + " is no time step above 0 s"}};
  WarnOfLongStep(dt.value_or(0));
  RunOptions options{dt.value_or(0), keyframe.value_or(""), ReadRecovery(recovery), ReadDetail(detail)};
  if (!integrator) return options;
  options.integrator = ReadIntegrator(*integrator);
  return options;
}

/// Names given one by one.
inline std::vector<std::string> Words(const nb::args& args) {
  std::vector<std::string> words;
  for (nb::handle word : args) words.push_back(ReadAs<std::string>(word, "a name", "text"));
  return words;
}

}  // namespace fork1s::python
