// Cases with expected numbers beside the sources, each by three methods: the reduced model, the full-coordinate
// simulator and MuJoCo.
//
// A case is NAME.xml, a model, and NAME.json, its numbers at the reference pose (keys: compliance_world,
// frequencies_hz, statics, gravity_static, refused, ...).
#pragma once

#include <fork1s/base/error.hpp>
#include <optional>
#include <string>
#include <vector>

namespace fork1s {

/// How far one method is from the oracle, as a share of the largest number compared.
struct OracleDeviation {
  std::optional<double> value;  // none: this method cannot compute the quantity
  std::string why_not;
};

struct OracleRow {
  std::string case_name, quantity;
  std::string oracle;  // the largest or lowest of the expected numbers, with its unit
  OracleDeviation reduced, full, mujoco;
};

/// Names of the cases in a folder, sorted; empty where there is none.
std::vector<std::string> OracleCases(const std::string& folder);

/// Errors: kFile and kFormat for the case's files; as of Reduce, FullSimulation::Create; kNumerics.
Expected<std::vector<OracleRow>> CompareWithOracle(const std::string& folder, const std::string& case_name);

}  // namespace fork1s
