#include <fork1s/base/error.hpp>

#include <string_view>

namespace fork1s::internal {
namespace {

// "Simulation::SetControl" of "void fork1s::Simulation::SetControl(int, double)".
std::string_view NameOf(const std::source_location& place) {
  std::string_view name = place.function_name();
  for (const std::string_view unnamed : {"{anonymous}::", "(anonymous namespace)::"})
    if (const auto at = name.find(unnamed); at != std::string_view::npos)
      name.remove_prefix(at + unnamed.size());
  name = name.substr(0, name.find('('));
  if (const auto type = name.rfind(' '); type != std::string_view::npos) name.remove_prefix(type + 1);
  if (name.starts_with("fork1s::")) name.remove_prefix(8);
  return name;
}

}  // namespace

void ThrowMisuse(const std::source_location& place, const std::string& text) {
  std::string message = std::string(NameOf(place)) + ": " + text;
#ifndef NDEBUG  // whoever runs a release has no use for a place in our sources
  message += " (" + std::string(place.file_name()) + ':' + std::to_string(place.line()) + ')';
#endif
  throw std::invalid_argument(message);
}

}  // namespace fork1s::internal
