#include "description.hpp"

#include <fmt/format.h>
#include <tinyxml2.h>

#include <string_view>

#include "base/utf8.hpp"

namespace fork1s::fmi {
namespace {

// What XML has no place for becomes a question mark: control characters, and bytes that are no UTF-8.
std::string Printable(std::string_view text) {
  std::string out;
  while (!text.empty()) {
    const Letter letter = FirstLetter(text);
    const bool is_plain =
        letter.bytes > 0 && letter.code >= 0x20 && letter.code != 0xFFFE && letter.code != 0xFFFF;
    out += is_plain ? std::string(text.substr(0, letter.bytes)) : "?";
    text.remove_prefix(letter.bytes == 0 ? 1 : letter.bytes);
  }
  return out;
}

class Xml {
 public:
  Xml() { printer_.PushHeader(false, true); }

  Xml& Open(const char* name) {
    printer_.OpenElement(name);
    return *this;
  }
  Xml& With(const char* name, const std::string& value) {
    printer_.PushAttribute(name, Printable(value).c_str());
    return *this;
  }
  Xml& With(const char* name, const char* value) { return With(name, std::string(value)); }
  Xml& With(const char* name, bool value) { return With(name, value ? "true" : "false"); }
  Xml& With(const char* name, int value) { return With(name, std::to_string(value)); }
  // With the digits that give the same bits back.
  Xml& With(const char* name, double value) { return With(name, fmt::format("{}", value)); }
  void Close() { printer_.CloseElement(); }
  std::string Text() const { return printer_.CStr(); }

 private:
  tinyxml2::XMLPrinter printer_;
};

const char* Word(Causality causality) {
  switch (causality) {
    case Causality::kIndependent:
      return "independent";
    case Causality::kConstant:
      return "local";
    case Causality::kInput:
      return "input";
    case Causality::kOutput:
      return "output";
  }
  return "";
}

bool HasStart(const Variable& v) {
  return v.causality == Causality::kInput || v.causality == Causality::kConstant;
}

void AddUnits(Xml& xml) {
  xml.Open("UnitDefinitions");
  for (const Unit& unit : kUnits) {
    xml.Open("Unit").With("name", unit.name).Open("BaseUnit");
    for (const auto& [name, exponent] :
         {std::pair{"kg", unit.kg}, {"m", unit.m}, {"s", unit.s}, {"rad", unit.rad}})
      if (exponent != 0) xml.With(name, exponent);
    xml.Close();
    xml.Close();
  }
  xml.Close();
}

void AddCategories(Xml& xml) {
  xml.Open("LogCategories");
  for (const auto& [name, description] :
       {std::pair{"logStatusError", "calls that failed, and why"},
        {"logStatusWarning", "doubtful decisions of the reduction, and inputs outside their range"}})
    xml.Open("Category").With("name", name).With("description", description).Close();
  xml.Close();
}

// Attributes that are the same in both versions but for where they stand.
void AddValue(Xml& xml, const Variable& v) {
  if (!v.unit.empty()) xml.With("unit", v.unit);
  if (v.lower < v.upper) xml.With("min", v.lower).With("max", v.upper);
  if (HasStart(v)) xml.With("start", v.start);
}

void AddIdentity(Xml& xml, const Variable& v, int reference) {
  xml.With("name", v.name).With("valueReference", reference).With("description", v.description);
  xml.With("causality", Word(v.causality));
  xml.With("variability", v.causality == Causality::kConstant ? "constant" : "continuous");
  if (v.causality == Causality::kConstant) xml.With("initial", "exact");
  if (v.causality == Causality::kOutput) xml.With("initial", "calculated");
}

template <class F>
void ForOutputs(const VariableList& variables, const F& add) {
  for (std::size_t i = 0; i < variables.all.size(); ++i)
    if (variables.all[i].causality == Causality::kOutput) add(static_cast<int>(i), variables.all[i]);
}

void AddVariables(Xml& xml, const VariableList& variables, int version) {
  xml.Open("ModelVariables");
  for (std::size_t i = 0; i < variables.all.size(); ++i) {
    const Variable& v = variables.all[i];
    xml.Open(version == 2 ? "ScalarVariable" : "Float64");
    AddIdentity(xml, v, static_cast<int>(i));
    if (version == 2) xml.Open("Real");
    AddValue(xml, v);
    if (version == 2) xml.Close();
    xml.Close();
  }
  xml.Close();
}

// Poses and velocities at the start depend on no input; what sensors measure may.
void AddStructure(Xml& xml, const VariableList& variables, int version) {
  const char* reference = version == 2 ? "index" : "valueReference";
  const int first = version == 2 ? 1 : 0;
  xml.Open("ModelStructure");
  if (version == 2) xml.Open("Outputs");
  ForOutputs(variables, [&](int i, const Variable&) {
    xml.Open(version == 2 ? "Unknown" : "Output").With(reference, i + first).Close();
  });
  if (version == 2) {
    xml.Close();
    xml.Open("InitialUnknowns");
  }
  ForOutputs(variables, [&](int i, const Variable& v) {
    xml.Open(version == 2 ? "Unknown" : "InitialUnknown").With(reference, i + first);
    if (!v.depends_on_inputs) xml.With("dependencies", "");
    xml.Close();
  });
  if (version == 2) xml.Close();
  xml.Close();
}

}  // namespace

std::string WriteDescription(const DescriptionText& text, const VariableList& variables) {
  const bool is_2 = text.version == 2;
  Xml xml;
  xml.Open("fmiModelDescription").With("fmiVersion", is_2 ? "2.0" : "3.0").With("modelName", text.name);
  xml.With(is_2 ? "guid" : "instantiationToken", text.token);
  xml.With("description", fmt::format("steps of {} s; communication steps are multiples of them", text.dt));
  xml.With("generationTool", text.tool).With("variableNamingConvention", "structured");
  xml.Open("CoSimulation").With("modelIdentifier", text.identifier);
  xml.With("canHandleVariableCommunicationStepSize", true);
  if (is_2) {
    xml.With("canInterpolateInputs", true).With("canGetAndSetFMUstate", true);
    xml.With("canSerializeFMUstate", true);
  } else {
    xml.With("fixedInternalStepSize", text.dt).With("canGetAndSetFMUState", true);
    xml.With("canSerializeFMUState", true);
  }
  xml.Close();
  AddUnits(xml);
  AddCategories(xml);
  xml.Open("DefaultExperiment").With("startTime", 0.0).With("stepSize", text.dt).Close();
  AddVariables(xml, variables, text.version);
  AddStructure(xml, variables, text.version);
  xml.Close();
  return xml.Text();
}

}  // namespace fork1s::fmi
