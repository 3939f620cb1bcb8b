// Folders that exports are written into.
#pragma once

#include <filesystem>
#include <fork1s/base/error.hpp>
#include <string>

namespace fork1s::internal {

/// Makes the folder if need be. Errors: kFile.
inline Expected<std::filesystem::path> MakeFolder(const std::string& directory) {
  const std::filesystem::path folder(directory);
  std::error_code error;
  std::filesystem::create_directories(folder, error);
  if (!std::filesystem::is_directory(folder, error))
    return Fail(ErrorCode::kFile, directory, "cannot be made a folder; check the path and its permissions");
  return folder;
}

}  // namespace fork1s::internal
