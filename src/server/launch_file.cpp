
#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>
#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <utility>

#include "base/system_error.hpp"
#include "server/launch_file.hpp"

namespace fork1s {
namespace {

std::string Escaped(const std::string& address) {
  std::string out;
  for (const char c : address) out += c == '&' ? "&amp;" : c == '"' ? "&quot;" : std::string(1, c);
  return out;
}

}  // namespace

Expected<LaunchFile> LaunchFile::Create(const std::string& folder, const std::string& address) {
  constexpr std::string_view kSuffix = ".html";
  std::string path = folder + "/fork1s-open-XXXXXX.html";
  const int file = mkostemps(path.data(), static_cast<int>(kSuffix.size()), O_CLOEXEC);  // mode 0600
  const std::string page = fmt::format(
      "<!doctype html><meta http-equiv=\"refresh\" content=\"0;url={0}\"><a href=\"{0}\">fork1s</a>\n",
      Escaped(address));
  const bool written =
      file >= 0 && write(file, page.data(), page.size()) == static_cast<ssize_t>(page.size());
  const int error = errno;
  if (file >= 0) close(file);
  LaunchFile out(file >= 0 ? path : std::string());
  if (!written)
    return Fail(ErrorCode::kFile, path,
                "cannot be written " + CauseAndRemedy(error, "the browser is started with it"));
  return out;
}

LaunchFile::~LaunchFile() {
  if (!path_.empty()) unlink(path_.c_str());
}

LaunchFile::LaunchFile(LaunchFile&& other) noexcept : path_(std::exchange(other.path_, {})) {}

LaunchFile& LaunchFile::operator=(LaunchFile&& other) noexcept {
  std::swap(path_, other.path_);
  return *this;
}

}  // namespace fork1s
