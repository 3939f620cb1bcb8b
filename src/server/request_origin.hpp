// Who may ask the server for something.
#pragma once

#include <string_view>

namespace fork1s::internal {

// A browser says who sent it (Origin) and whom it believes to talk to (Host). Both must be this machine: else
// any page on the web could drive the simulation, by itself or through a name that it lets point here.
inline bool IsLocal(std::string_view host) {
  const auto colon = host.rfind(':');
  if (colon != std::string_view::npos && host.find(']') == std::string_view::npos)
    host = host.substr(0, colon);
  return host == "127.0.0.1" || host == "localhost";
}

// With its port: another program of this machine may serve pages too.
inline bool IsOwnOrigin(std::string_view origin, std::string_view host) {
  constexpr std::string_view kScheme = "http://";
  return origin.empty() ||
         (origin.substr(0, kScheme.size()) == kScheme && origin.substr(kScheme.size()) == host);
}

}  // namespace fork1s::internal
