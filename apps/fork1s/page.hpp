// The viewer's page, embedded when the program was built.
#pragma once

#include <string_view>

namespace fork1s::app {

/// One HTML file with everything in it; empty in a build without npm.
std::string_view ViewerPage();

}  // namespace fork1s::app
