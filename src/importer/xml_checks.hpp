// Questions asked of the raw XML: what MuJoCo lets pass, and where a word stands.
#pragma once

#include <fork1s/base/error.hpp>
#include <functional>
#include <optional>
#include <string>

namespace tinyxml2 {
class XMLElement;
}

namespace fork1s::internal {

struct XmlPlace {
  std::string file;
  int line = 0;
};

/// Refuses (kFile) what is no file, such as a pipe that would be waited for, and files of more than 1 GiB.
Expected<void> CheckReadable(const std::string& path);
/// Reads a whole file, after CheckReadable; kFile if it cannot be read.
Expected<std::string> ReadFile(const std::string& path);

/// Name of the root element; kFormat with line if the text is no XML.
Expected<std::string> RootElement(const std::string& path, const std::string& text);

/// Takes away an XML declaration that does not stand at the beginning, which no parser takes; lines keep
/// their numbers. Returns its line, 0 if there is none.
int RemoveLateDeclaration(std::string& text);

/// Shows every element of the file and of those it includes or attaches, each file once, until one returns
/// true. `text` may be empty: the file is read.
using XmlVisitor = std::function<bool(const tinyxml2::XMLElement&, const std::string& file)>;
void VisitXml(const std::string& path, const std::string& text, const XmlVisitor& visit);
/// The same without the models that are attached (<model file>).
void VisitOneModel(const std::string& path, const std::string& text, const XmlVisitor& visit);

/// Refuses nan and inf in any numeric attribute, included files too, with file and line: MuJoCo would
/// simulate them.
std::optional<Error> CheckNumbers(const std::string& path, const std::string& text);

/// First element of that name with an attribute of that name, that value, or both, in the file or in those it
/// includes. `text` may be empty: the file is read.
std::optional<XmlPlace> FindInXml(const std::string& path, const std::string& text,
                                  const std::string& element, const std::optional<std::string>& attribute,
                                  const std::optional<std::string>& value);

}  // namespace fork1s::internal
