// COLLADA: what Assimp 5.2 takes on trust. It reads beyond a list of numbers that is shorter than its
// accessor says, and never ends on nodes that show each other.
#include <fmt/format.h>
#include <tinyxml2.h>

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <cstring>
#include <limits>
#include <map>
#include <string_view>

#include "mesh_file.hpp"

namespace fork1s::internal {
namespace {

using DaeElement = tinyxml2::XMLElement;

struct DaeFault {
  const DaeElement* element;
  std::string what;
};

// A number from 0 up of an attribute.
std::uint64_t Count(const DaeElement& element, const char* attribute, std::optional<std::uint64_t> missing) {
  const char* text = element.Attribute(attribute);
  if (text == nullptr && missing) return *missing;
  const std::string_view word = text != nullptr ? text : "";
  std::uint64_t value = 0;
  const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
  constexpr std::uint64_t kMost = std::uint64_t{1} << 31;  // no product of two wraps round
  if (error != std::errc() || end != word.data() + word.size() || value > kMost)
    throw DaeFault{&element, fmt::format("<{}> has no usable {}, but '{}'", element.Name(), attribute, word)};
  return value;
}

constexpr const char* kSpace = " \t\r\n";

std::uint64_t CountWords(const char* text) {
  std::uint64_t count = 0;
  while (text != nullptr && *(text += std::strspn(text, kSpace)) != '\0') {
    text += std::strcspn(text, kSpace);
    ++count;
  }
  return count;
}

// Corners and sides are whole numbers; of any other word Assimp makes zeros until memory is full.
void CheckWholeNumbers(const DaeElement& list) {
  const char* text = list.GetText();
  while (text != nullptr && *(text += std::strspn(text, kSpace)) != '\0') {
    const std::string_view word(text, std::strcspn(text, kSpace));
    std::uint32_t value = 0;
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    if (error != std::errc() || end != word.data() + word.size())
      throw DaeFault{
          &list, fmt::format("<{}> holds '{}', which is no whole number", list.Name(), word.substr(0, 40))};
    text += word.size();
  }
}

bool EndsWith(std::string_view text, std::string_view end) {
  return text.size() >= end.size() && text.substr(text.size() - end.size()) == end;
}

class DaeCheck {
 public:
  explicit DaeCheck(const DaeElement& root) {
    Gather(root);
    for (const DaeElement* accessor : accessors_) CheckAccessor(*accessor);
    for (const auto& [node, open] : nodes_) Expand(*node);
  }

 private:
  void Gather(const DaeElement& element) {
    const std::string_view kind = element.Name();
    if (kind == "skew" || kind == "instance_controller")
      throw DaeFault{&element,
                     fmt::format("<{}> is not read; apply it in the program the mesh comes from", kind)};
    if (EndsWith(kind, "_array")) {
      const std::uint64_t said = Count(element, "count", std::nullopt), there = CountWords(element.GetText());
      if (said != there)
        throw DaeFault{&element,
                       fmt::format("<{}> says that it has {} values and has {}", kind, said, there)};
      if (const char* id = element.Attribute("id")) arrays_[id] = there;
    } else if (kind == "accessor") {
      accessors_.push_back(&element);
    } else if (kind == "triangles" || kind == "polylist" || kind == "polygons") {
      CheckFaces(element);
    } else if (kind == "p" || kind == "vcount") {
      CheckWholeNumbers(element);
    } else if (kind == "node") {
      nodes_[&element] = false;
      for (const char* attribute : {"id", "name", "sid"})
        if (const char* name = element.Attribute(attribute)) named_nodes_.emplace(name, &element);
    }
    for (const DaeElement* e = element.FirstChildElement(); e != nullptr; e = e->NextSiblingElement())
      Gather(*e);
  }

  // Of polygons each has its own <p>, of the others all share one.
  static void CheckFaces(const DaeElement& faces) {
    const std::uint64_t count = Count(faces, "count", std::nullopt);
    std::uint64_t lists = 0;
    for (const DaeElement* e = faces.FirstChildElement("p"); e != nullptr; e = e->NextSiblingElement("p"))
      ++lists;
    const bool each = std::strcmp(faces.Name(), "polygons") == 0;
    if (lists != (each ? count : 1))
      throw DaeFault{&faces, fmt::format("<{}> says that it has {} faces and has {} lists <p>", faces.Name(),
                                         count, lists)};
    const DaeElement* sides = faces.FirstChildElement("vcount");
    const std::uint64_t there = sides != nullptr ? CountWords(sides->GetText()) : 0;
    if (std::strcmp(faces.Name(), "polylist") == 0 && there != count)
      throw DaeFault{&faces, fmt::format("<polylist> says that it has {} faces and tells the corners of {}",
                                         count, there)};
  }

  void CheckAccessor(const DaeElement& accessor) const {
    const std::uint64_t count = Count(accessor, "count", std::nullopt), stride = Count(accessor, "stride", 1),
                        offset = Count(accessor, "offset", 0);
    std::uint64_t params = 0;
    for (const DaeElement* e = accessor.FirstChildElement("param"); e != nullptr;
         e = e->NextSiblingElement("param"))
      ++params;
    const char* source = accessor.Attribute("source");
    const auto array = arrays_.find(source != nullptr && source[0] == '#' ? source + 1 : "");
    if (array == arrays_.end())
      throw DaeFault{&accessor, fmt::format("<accessor> names the source '{}', which is not there",
                                            source != nullptr ? source : "")};
    if (count > 0 && offset + (count - 1) * stride + std::max(stride, params) > array->second)
      throw DaeFault{&accessor,
                     fmt::format("<accessor> reaches past the {} values of its source", array->second)};
  }

  // How many nodes this one becomes; throws where it shows itself.
  double Expand(const DaeElement& node) {
    if (const auto known = expanded_.find(&node); known != expanded_.end()) return known->second;
    constexpr double kMost = 1e6;
    if (nodes_[&node]) throw DaeFault{&node, "<node> shows itself by <instance_node>"};
    nodes_[&node] = true;
    const double count = 1 + ExpandChildren(node);
    if (count > kMost) throw DaeFault{&node, "<node> shows more than a million others"};
    nodes_[&node] = false;
    return expanded_[&node] = count;
  }

  double ExpandChildren(const DaeElement& node) {
    double count = 0;
    for (const DaeElement* e = node.FirstChildElement(); e != nullptr; e = e->NextSiblingElement()) {
      if (std::strcmp(e->Name(), "node") == 0) count += Expand(*e);
      if (std::strcmp(e->Name(), "instance_node") != 0) continue;
      const char* url = e->Attribute("url");
      const auto range = named_nodes_.equal_range(url != nullptr && url[0] == '#' ? url + 1 : "");
      for (auto it = range.first; it != range.second; ++it) count += Expand(*it->second);
    }
    return count;
  }

  std::map<std::string, std::uint64_t> arrays_;  // values by id
  std::vector<const DaeElement*> accessors_;
  std::map<const DaeElement*, bool> nodes_;  // whether it is being expanded
  std::multimap<std::string, const DaeElement*> named_nodes_;
  std::map<const DaeElement*, double> expanded_;
};

// Removes all but the geometry and the scene that places it.
void RemoveAllButGeometry(DaeElement& root) {
  static constexpr std::string_view kKept[] = {"asset", "library_geometries", "library_nodes",
                                               "library_visual_scenes", "scene"};
  for (DaeElement* e = root.FirstChildElement(); e != nullptr;) {
    DaeElement* next = e->NextSiblingElement();
    if (std::find(std::begin(kKept), std::end(kKept), e->Name()) == std::end(kKept)) root.DeleteChild(e);
    e = next;
  }
}

void RemoveAll(DaeElement& element, std::string_view name) {
  for (DaeElement* e = element.FirstChildElement(); e != nullptr;) {
    DaeElement* next = e->NextSiblingElement();
    if (name == e->Name()) {
      element.DeleteChild(e);
    } else {
      RemoveAll(*e, name);
    }
    e = next;
  }
}

// Exporters write lists of no faces, too, whose <p> may be missing.
void RemoveEmptyLists(DaeElement& element) {
  for (DaeElement* e = element.FirstChildElement(); e != nullptr;) {
    DaeElement* next = e->NextSiblingElement();
    const std::string_view kind = e->Name();
    const bool faces = kind == "triangles" || kind == "polylist" || kind == "polygons";
    if (faces && e->Attribute("count", "0") != nullptr) {
      element.DeleteChild(e);
    } else {
      RemoveEmptyLists(*e);
    }
    e = next;
  }
}

}  // namespace

tl::expected<std::string, MeshFault> CleanDae(const std::string& content) {
  const auto damaged = [](int line, const std::string& what) {
    return tl::unexpected<MeshFault>(MeshFault{ErrorCode::kFormat, fmt::format("its line {}: {}", line, what),
                                               "write the mesh again from the program it comes from"});
  };
  tinyxml2::XMLDocument document;
  if (document.Parse(content.data(), content.size()) != tinyxml2::XML_SUCCESS ||
      document.RootElement() == nullptr)
    return damaged(document.ErrorLineNum(), "this is not well-formed XML");
  RemoveAllButGeometry(*document.RootElement());
  for (const char* name : {"bind_material", "extra", "instance_camera", "instance_light"})
    RemoveAll(*document.RootElement(), name);
  RemoveEmptyLists(*document.RootElement());
  try {
    DaeCheck(*document.RootElement());
  } catch (const DaeFault& fault) {
    return damaged(fault.element->GetLineNum(), fault.what);
  }
  tinyxml2::XMLPrinter printer(nullptr, true);
  document.Print(&printer);
  return std::string(printer.CStr(), static_cast<std::size_t>(printer.CStrSize() - 1));
}

}  // namespace fork1s::internal
