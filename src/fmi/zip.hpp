// ZIP archives.
#pragma once

#include <fork1s/base/error.hpp>
#include <string>
#include <vector>

namespace fork1s::fmi {

struct ZipEntry {
  std::string name, bytes;
  bool is_program = false;  // may be executed
};

/// Writes an archive, compressed, with the dates of 1980, so that the same entries give the same bytes. Errors: kFile.
Expected<void> WriteZip(const std::string& path, const std::vector<ZipEntry>& entries);

}  // namespace fork1s::fmi
