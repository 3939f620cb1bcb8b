// Numbers and errors on paper.
#pragma once

#include <fork1s/importer/importer.hpp>
#include <fork1s/spatial/rigid_transform.hpp>
#include <nlohmann/json.hpp>

#include "command.hpp"

namespace fork1s::app {

using Json = nlohmann::ordered_json;

Json ToJson(const MatrixX& m);  // array of rows; null where empty
Json ToJson(const Vector3& v);
Json ToJson(const Quaternion& q);  // w, x, y, z
/// As it is printed: on one line, or with `indent`. Bytes of names that are no UTF-8 become U+FFFD.
std::string ToText(const Json& json, int indent = -1);
/// The notes of an import as strings.
Json NotesJson(const ImportReport& report);
/// Prints notes and warnings to standard error, one line each.
void PrintNotes(const ImportReport& report);

}  // namespace fork1s::app
