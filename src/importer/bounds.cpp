#include "bounds.hpp"

#include <fmt/format.h>
#include <tinyxml2.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <set>

#include "attached.hpp"
#include "names.hpp"
#include "xml_checks.hpp"

namespace fork1s::internal {
namespace {

namespace fs = std::filesystem;
using tinyxml2::XMLElement;

constexpr double kMostCells = 1 << 24;   // of a height field: 4096 x 4096
constexpr double kMostPixels = 1 << 26;  // of a picture: 8192 x 8192
constexpr double kMostCopies = 1e5;
constexpr double kMostCounted = 1e5;  // keyframes, numbers of the user on a body, ...
constexpr double kMostRoom = 1e8;     // contacts, constraints and stack of older files: only room

// Product of the numbers of an attribute; 1 without it. What is no number is left to the reader.
double Product(const XMLElement& element, const char* attribute) {
  const char* text = element.Attribute(attribute);
  double product = 1;
  for (const std::string& word : SplitWords(text != nullptr ? text : "")) {
    const double value = std::strtod(word.c_str(), nullptr);
    if (value > 0) product *= value;
  }
  return product;
}

// With all copies of what it stands in.
double Copies(const XMLElement& element) {
  double copies = 1;
  for (const tinyxml2::XMLNode* node = &element; node != nullptr; node = node->Parent())
    if (const XMLElement* e = node->ToElement()) {
      const std::string name = e->Name();
      if (name == "replicate" || name == "composite" || name == "flexcomp") copies *= Product(*e, "count");
    }
  return copies;
}

struct Excess {
  const char* what;
  double asked, most;
};

std::optional<Excess> FindExcess(const XMLElement& element) {
  const std::string name = element.Name();
  if (name == "hfield") {
    const double cells = Product(element, "nrow") * Product(element, "ncol");
    if (cells > kMostCells) return Excess{"cells", cells, kMostCells};
  }
  if (name == "texture") {
    const double pixels = Product(element, "width") * Product(element, "height");
    if (pixels > kMostPixels) return Excess{"pixels", pixels, kMostPixels};
  }
  if (const double copies = Copies(element); copies > kMostCopies)
    return Excess{"copies", copies, kMostCopies};
  if (name != "size") return std::nullopt;
  for (const auto* a = element.FirstAttribute(); a != nullptr; a = a->Next()) {
    const std::string attribute = a->Name();
    if (attribute.empty() || attribute[0] != 'n') continue;
    const bool room = attribute == "njmax" || attribute == "nconmax" || attribute == "nstack";
    const double most = room ? kMostRoom : kMostCounted;
    if (Product(element, a->Name()) > most) return Excess{a->Name(), Product(element, a->Name()), most};
  }
  return std::nullopt;
}

double BigEndian(const unsigned char* bytes) {
  return ((bytes[0] * 256.0 + bytes[1]) * 256.0 + bytes[2]) * 256.0 + bytes[3];
}

// Width and height of a picture or height field, whose first bytes say it.
std::optional<Excess> FindExcessInFile(const std::string& element, const std::string& path) {
  if (element != "hfield" && element != "texture") return std::nullopt;
  std::array<unsigned char, 24> head{};
  std::ifstream stream(path, std::ios::binary);
  if (!stream.read(reinterpret_cast<char*>(head.data()), head.size())) return std::nullopt;
  const bool picture = std::memcmp(head.data(), "\211PNG\r\n\032\n", 8) == 0;
  const double most = element == "hfield" ? kMostCells : kMostPixels;
  double size = 0;
  if (picture) {
    size = BigEndian(head.data() + 16) * BigEndian(head.data() + 20);
  } else if (element == "hfield") {
    std::array<std::int32_t, 2> dimensions{};
    std::memcpy(dimensions.data(), head.data(), sizeof dimensions);
    size = std::max(0.0, 1.0 * dimensions[0]) * std::max(0.0, 1.0 * dimensions[1]);
  }
  if (size > most) return Excess{picture ? "pixels" : "cells", size, most};
  return std::nullopt;
}

// Folders in which the reader may look, beside that of the file.
std::set<std::string> AssetFolders(const std::string& path, const std::string& text) {
  std::set<std::string> folders = {""};
  VisitXml(path, text, [&](const XMLElement& element, const std::string& file) {
    for (const char* attribute : {"meshdir", "texturedir", "assetdir"})
      if (const char* folder = element.Attribute(attribute)) folders.insert(folder);
    folders.insert(fs::absolute(file).parent_path().string());  // of a model that is attached
    return false;
  });
  return folders;
}

}  // namespace

std::optional<Error> CheckBounds(const std::string& path, const std::string& text) {
  std::optional<Error> error;
  const auto refuse = [&](const std::string& file, const XMLElement& element, std::string sentence) {
    error =
        Error{ErrorCode::kModel, fmt::format("{}, line {}", file, element.GetLineNum()), std::move(sentence)};
    return true;
  };
  const auto too_many = [](const Excess& e) {
    return fmt::format("asks for {:.6g} {}, and {:.6g} is the most; make it smaller", e.asked, e.what,
                       e.most);
  };
  if (auto circle = CheckAttached(path, text)) return circle;
  const std::set<std::string> folders = AssetFolders(path, text);
  const fs::path here = fs::path(path).parent_path();
  VisitXml(path, text, [&](const XMLElement& element, const std::string& file) {
    if (const auto excess = FindExcess(element))
      return refuse(file, element, fmt::format("<{}> {}", element.Name(), too_many(*excess)));
    for (const auto* a = element.FirstAttribute(); a != nullptr; a = a->Next()) {
      if (std::strncmp(a->Name(), "file", 4) != 0) continue;  // a cube has one for each side
      const fs::path named(a->Value());
      for (const std::string& folder : folders)
        for (const fs::path& candidate : {here / folder / named, here / folder / named.filename()}) {
          std::error_code ignored;
          if (!fs::exists(candidate, ignored) || fs::is_directory(candidate, ignored)) continue;
          if (const auto readable = CheckReadable(candidate.string()); !readable)
            return refuse(
                file, element,
                fmt::format("<{}> names '{}': {}", element.Name(), a->Value(), readable.error().message));
          if (const auto excess = FindExcessInFile(element.Name(), candidate.string()))
            return refuse(
                file, element,
                fmt::format("<{}> names '{}', which {}", element.Name(), a->Value(), too_many(*excess)));
        }
    }
    return false;
  });
  return error;
}

}  // namespace fork1s::internal
