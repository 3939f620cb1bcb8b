// The viewer's page, embedded when the program was built.
#pragma once

#include <fork1s/base/error.hpp>
#include <fork1s/record/recording.hpp>
#include <string>
#include <string_view>

namespace fork1s::app {

/// One HTML file with everything in it; empty in a build without npm.
std::string_view ViewerPage();

/// The page that plays a recording by itself. Errors: kFile where there is no page.
Expected<std::string> MakeReplayPage(const Recording& recording);

/// What to say where it is empty.
inline Error NoPage() {
  return {ErrorCode::kFile, "view",
          "this program was built without its page, because npm was not found; install nodejs and npm, run "
          "cmake again and build"};
}

}  // namespace fork1s::app
