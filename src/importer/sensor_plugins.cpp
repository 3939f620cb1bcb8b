#include "sensor_plugins.hpp"

#include <fmt/format.h>
#include <tinyxml2.h>

#include <set>

#include "names.hpp"
#include "xml_checks.hpp"
#include "xml_tags.hpp"

namespace fork1s::internal {
namespace {

const std::string kSensor = "sensor";

// Blanks what the reader would refuse; ends of lines stay.
std::string WithoutSensorPlugins(std::string text) {
  const std::vector<XmlTag> tags = FindTags(text);
  for (const XmlTag& tag : tags) {
    if (tag.name != "plugin" || tag.parent < 0) continue;
    const std::string& parent = tags[static_cast<std::size_t>(tag.parent)].name;
    const auto name = tag.attributes.find("plugin");
    const bool is_unknown = name != tag.attributes.end() &&
                            !IsKnownPlugin(text.substr(name->second.value_begin,
                                                       name->second.value_end - name->second.value_begin));
    if (parent != kSensor && !(parent == "extension" && is_unknown)) continue;
    const std::size_t end = tag.closes_itself ? tag.end : text.find('>', tag.close) + 1;
    for (std::size_t i = tag.begin; i < end; ++i)
      if (text[i] != '\n') text[i] = ' ';
  }
  return text;
}

}  // namespace

std::optional<Error> RemoveSensorPlugins(const std::string& path, const std::string& text,
                                         PreparedModel& prepared) {
  std::vector<std::string> sensors;
  std::set<std::string> files;
  VisitXml(path, text, [&](const tinyxml2::XMLElement& e, const std::string& file) {
    files.insert(file);
    for (const auto* sensor = e.FirstChildElement("plugin"); sensor != nullptr && e.Name() == kSensor;
         sensor = sensor->NextSiblingElement("plugin"))
      sensors.push_back(sensor->Attribute("name") != nullptr ? sensor->Attribute("name") : "");
    return false;
  });
  if (sensors.empty()) return std::nullopt;
  // All of them: MuJoCo takes a text for a file of the same name in another folder, where that has none.
  for (const std::string& file : files) {
    const bool is_given = file == path && !text.empty();
    const Expected<std::string> content = is_given ? Expected<std::string>(text) : ReadFile(file);
    if (!content) return content.error();
    prepared.source.buffers[file] = WithoutSensorPlugins(*content);
  }
  const bool is_one = sensors.size() == 1;
  prepared.notes.push_back(
      {ImportNote::Kind::kDropped,
       is_one ? fmt::format("sensor '{}'", sensors[0]) : fmt::format("{} x sensor", sensors.size()),
       fmt::format("{}computed by a plugin; recordings hold every pose and force instead",
                   is_one ? "it is " : fmt::format("{} are ", Quoted(sensors)))});
  return std::nullopt;
}

}  // namespace fork1s::internal
