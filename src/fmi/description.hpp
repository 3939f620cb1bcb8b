// modelDescription.xml of FMI 2.0 and 3.0, for co-simulation.
#pragma once

#include <string>

#include "variables.hpp"

namespace fork1s::fmi {

struct DescriptionText {
  int version = 3;         // of FMI: 2 or 3
  std::string name;        // of the model
  std::string identifier;  // of the program of the unit: its file name without extension
  std::string token;       // instantiation token, or GUID
  std::string tool;        // that wrote it
  double dt = 0;           // s
};

std::string WriteDescription(const DescriptionText& text, const VariableList& variables);

}  // namespace fork1s::fmi
