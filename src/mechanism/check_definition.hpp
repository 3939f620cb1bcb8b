// Whether a definition is of a mechanism.
#pragma once

#include <fork1s/base/error.hpp>
#include <fork1s/mechanism/definition.hpp>
#include <string>

namespace fork1s::internal {

/// Bodies, joints, and what acts between them, each by itself: numbers, references, names. Errors: kModel, by the name
/// of the first that is wrong.
Expected<void> CheckDefinition(const MechanismDef& definition);

/// An error of kModel.
tl::unexpected<Error> Refuse(std::string where, std::string message);
/// "joint 'elbow'"
std::string Named(const char* kind, const std::string& name);
/// Place among the controls; -1: none.
int FindControl(const MechanismDef& definition, const std::string& name);

}  // namespace fork1s::internal
