// Questions asked of the raw XML: what MuJoCo lets pass, and where a word stands.
#pragma once

#include <fork1s/base/error.hpp>
#include <optional>
#include <string>

namespace fork1s::internal {

struct XmlPlace {
  std::string file;
  int line = 0;
};

/// Reads a whole file; kFile if it cannot be read or is a folder.
Expected<std::string> ReadFile(const std::string& path);

/// Name of the root element; kFormat with line if the text is no XML.
Expected<std::string> RootElement(const std::string& path, const std::string& text);

/// Takes away an XML declaration that does not stand at the beginning, which no parser takes; lines keep
/// their numbers. Returns its line, 0 if there is none.
int RemoveLateDeclaration(std::string& text);

/// Refuses nan and inf in any numeric attribute, included files too, with file and line: MuJoCo would
/// simulate them.
std::optional<Error> CheckNumbers(const std::string& path, const std::string& text);

/// First element of that name with an attribute of that name, that value, or both, in the file or in those it
/// includes. `text` may be empty: the file is read.
std::optional<XmlPlace> FindInXml(const std::string& path, const std::string& text,
                                  const std::string& element, const std::optional<std::string>& attribute,
                                  const std::optional<std::string>& value);

}  // namespace fork1s::internal
