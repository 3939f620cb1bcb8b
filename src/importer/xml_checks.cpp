#include "xml_checks.hpp"

#include <fmt/format.h>
#include <tinyxml2.h>

#include <algorithm>
#include <cerrno>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <utility>

#include "base/lower_case.hpp"
#include "base/system_error.hpp"
#include "names.hpp"

namespace fork1s::internal {
namespace {

using tinyxml2::XMLAttribute;
using tinyxml2::XMLDocument;
using tinyxml2::XMLElement;

// Attributes that hold names or paths, where "inf" and "nan" may be meant.
bool HoldsText(const std::string& attribute) {
  static const std::set<std::string> texts = {
      "name",   "class",    "childclass", "model",         "file",      "filename",   "joint",
      "joint1", "joint2",   "body",       "body1",         "body2",     "geom",       "geom1",
      "geom2",  "site",     "site1",      "site2",         "tendon",    "mesh",       "data",
      "key",    "material", "link",       "texture",       "tendon1",   "target",     "meshdir",
      "hfield", "prefix",   "type",       "texturedir",    "cranksite", "slidersite", "actuator",
      "camera", "objname",  "refname",    "jointinparent", "tendon2",   "sidesite"};
  return texts.count(attribute) > 0;
}

bool IsNotFinite(const std::string& text) {
  std::string word = LowerCase(text);
  if (!word.empty() && (word[0] == '-' || word[0] == '+')) word.erase(0, 1);
  return word == "nan" || word == "inf" || word == "infinity" || word.rfind("nan(", 0) == 0;
}

// One walk over a file and what it includes. Each file counts once: the reader refuses a file that is
// included twice, and files that include each other would multiply.
class XmlWalk {
 public:
  XmlWalk(const std::string& path, bool attached, const XmlVisitor& visit)
      : folder_(std::filesystem::path(path).parent_path()), attached_(attached), visit_(visit) {}

  bool File(const std::string& path, const std::string& text) {
    std::error_code unresolved;
    if (!seen_.insert(std::filesystem::weakly_canonical(path, unresolved).string()).second) return false;
    XMLDocument document;
    if (text.empty()) {
      const auto read = ReadFile(path);
      if (!read || document.Parse(read->data(), read->size()) != tinyxml2::XML_SUCCESS) return false;
    } else if (document.Parse(text.data(), text.size()) != tinyxml2::XML_SUCCESS) {
      return false;
    }
    return Elements(document.RootElement(), path);
  }

 private:
  bool Elements(const XMLElement* element, const std::string& file) {
    for (; element != nullptr; element = element->NextSiblingElement()) {
      if (visit_(*element, file)) return true;
      const std::string name = element->Name();
      const char* other = element->Attribute("file");
      if (name == "include" && other != nullptr && File((folder_ / other).string(), "")) return true;
      if (name == "model" && other != nullptr && attached_ && Model(folder_ / other)) return true;
      if (Elements(element->FirstChildElement(), file)) return true;
    }
    return false;
  }

  // A model that is attached looks for its files from where it lies.
  bool Model(const std::filesystem::path& path) {
    const std::filesystem::path before = std::exchange(folder_, path.parent_path());
    const bool done = File(path.string(), "");
    folder_ = before;
    return done;
  }

  std::filesystem::path folder_;  // the reader looks for files from here
  const bool attached_;
  const XmlVisitor& visit_;
  std::set<std::string> seen_;
};

}  // namespace

Expected<void> CheckReadable(const std::string& path) {
  std::error_code ignored;
  const auto status = std::filesystem::status(path, ignored);
  if (!std::filesystem::exists(status)) return Fail(ErrorCode::kFile, path, "there is no such file");
  if (std::filesystem::is_directory(status))
    return Fail(ErrorCode::kFile, path, "this is a folder; name the file in it");
  if (!std::filesystem::is_regular_file(status))
    return Fail(ErrorCode::kFile, path,
                "this is a pipe or a device, which may never end; copy what it gives to a file");
  constexpr std::uintmax_t kMost = std::uintmax_t{1} << 30;
  if (std::filesystem::file_size(path, ignored) > kMost)
    return Fail(ErrorCode::kFile, path, "the file is larger than 1 GiB; simplify what it holds");
  return {};
}

Expected<std::string> ReadFile(const std::string& path) {
  if (auto ok = CheckReadable(path); !ok) return tl::unexpected<Error>(ok.error());
  std::ifstream stream(path, std::ios::binary);
  if (!stream)
    return Fail(ErrorCode::kFile, path,
                "the file cannot be read " + CauseAndRemedy(errno, "check its permissions"));
  return std::string((std::istreambuf_iterator<char>(stream)), std::istreambuf_iterator<char>());
}

void VisitXml(const std::string& path, const std::string& text, const XmlVisitor& visit) {
  XmlWalk(path, true, visit).File(path, text);
}

void VisitOneModel(const std::string& path, const std::string& text, const XmlVisitor& visit) {
  XmlWalk(path, false, visit).File(path, text);
}

Expected<std::string> RootElement(const std::string& path, const std::string& text) {
  XMLDocument document;
  const tinyxml2::XMLError status = document.Parse(text.data(), text.size());
  if (status == tinyxml2::XML_ERROR_EMPTY_DOCUMENT ||
      (status == tinyxml2::XML_SUCCESS && document.RootElement() == nullptr)) {  // a comment alone
    return Fail(ErrorCode::kFormat, path, "the file holds no XML element; MJCF or URDF is expected");
  }
  if (status == tinyxml2::XML_ELEMENT_DEPTH_EXCEEDED) {
    return Fail(ErrorCode::kFormat, fmt::format("{}, line {}", path, document.ErrorLineNum()),
                "bodies are nested too deeply: the reader stops at about 96 in a chain; split the chain into "
                "two trees joined by a weld equality, or give it as URDF, which is not nested");
  }
  if (status == tinyxml2::XML_ERROR_PARSING_DECLARATION) {
    return Fail(ErrorCode::kFormat, fmt::format("{}, line {}", path, document.ErrorLineNum()),
                "the XML declaration <?xml ...?> must stand on the first line, before any comment; move it "
                "there or remove it");
  }
  if (status != tinyxml2::XML_SUCCESS || document.RootElement() == nullptr) {
    return Fail(ErrorCode::kFormat, fmt::format("{}, line {}", path, document.ErrorLineNum()),
                fmt::format("this is not well-formed XML ({}); close or correct the element at that line",
                            document.ErrorName()));
  }
  return std::string(document.RootElement()->Name());
}

int RemoveLateDeclaration(std::string& text) {
  const std::size_t begin = text.find("<?xml ", 1);
  if (begin == std::string::npos) return 0;
  const std::size_t end = text.find("?>", begin);
  if (end == std::string::npos) return 0;
  for (std::size_t i = begin; i < end + 2; ++i) {
    if (text[i] != '\n') text[i] = ' ';
  }
  return 1 +
         static_cast<int>(std::count(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(begin), '\n'));
}

std::optional<Error> CheckNumbers(const std::string& path, const std::string& text) {
  std::optional<Error> error;
  VisitXml(path, text, [&](const XMLElement& element, const std::string& file) {
    for (const XMLAttribute* a = element.FirstAttribute(); a != nullptr; a = a->Next()) {
      if (HoldsText(a->Name())) continue;
      for (const std::string& word : SplitWords(a->Value())) {
        if (!IsNotFinite(word)) continue;
        const char* name = element.Attribute("name");
        error =
            Error{ErrorCode::kModel, fmt::format("{}, line {}", file, a->GetLineNum()),
                  fmt::format("<{}{}> has {}=\"{}\", which is no finite number; write a number or remove it",
                              element.Name(), name != nullptr ? fmt::format(" '{}'", name) : "", a->Name(),
                              a->Value())};
        return true;
      }
    }
    return false;
  });
  return error;
}

std::optional<XmlPlace> FindInXml(const std::string& path, const std::string& text,
                                  const std::string& element, const std::optional<std::string>& attribute,
                                  const std::optional<std::string>& value) {
  std::optional<XmlPlace> place;
  VisitXml(path, text, [&](const XMLElement& e, const std::string& file) {
    if (element != e.Name()) return false;
    for (const XMLAttribute* a = e.FirstAttribute(); a != nullptr; a = a->Next()) {
      if ((!attribute || *attribute == a->Name()) && (!value || *value == a->Value())) {
        place = XmlPlace{file, a->GetLineNum()};
        return true;
      }
    }
    return false;
  });
  return place;
}

}  // namespace fork1s::internal
