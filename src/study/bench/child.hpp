// Programs that are run and waited for, and what they leave, without files on a disk.
#pragma once

#include <fork1s/base/error.hpp>
#include <string>
#include <vector>

namespace fork1s::internal {

/// A file in memory that other programs of this user can open by a path while it lives.
class MemoryFile {
 public:
  MemoryFile();
  ~MemoryFile();
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  int descriptor() const { return descriptor_; }
  std::string Path() const;
  std::string Read() const;

 private:
  int descriptor_ = -1;
};

/// Where a program of that name lies on the PATH; empty: nowhere.
std::string FindOnPath(const std::string& name);

struct ChildEnd {
  bool done = false;       // it ended by itself with exit code 0
  std::string how;         // else: "ended with exit code 3", "took longer than 300 s"
  std::string out, error;  // what it printed
};

/// Runs a program (by its path) to its end, `seconds` at most.
ChildEnd RunChild(const std::vector<std::string>& command, double seconds);

}  // namespace fork1s::internal
