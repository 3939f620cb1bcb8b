// Opens a page in a browser without its address in a command line, which every user of the machine can read.
#pragma once

#include <fork1s/base/error.hpp>
#include <string>

namespace fork1s {

/// A file that only its owner reads, whose page goes on to an address. Removed with this object.
class LaunchFile {
 public:
  /// In `folder`, which exists. Errors (kFile): it cannot be written.
  static Expected<LaunchFile> Create(const std::string& folder, const std::string& address);
  ~LaunchFile();
  LaunchFile(LaunchFile&& other) noexcept;
  LaunchFile& operator=(LaunchFile&& other) noexcept;

  /// file://...
  std::string address() const { return "file://" + path_; }

 private:
  explicit LaunchFile(std::string path) : path_(std::move(path)) {}
  std::string path_;
};

}  // namespace fork1s
