// Where a file lies that a URDF names: in a ROS package, beside the URDF or above it.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>

namespace fork1s::internal {

struct FileSearch {
  std::string urdf;                             // the file that names others
  std::map<std::string, std::string> packages;  // folders that the user gave, by package
};

struct FileFound {
  std::string package;  // that the name speaks of; empty for a plain name
  std::optional<std::filesystem::path> file;
  std::string reason, remedy;  // where it was looked for, if there is none
};

/// `name` is package://PACKAGE/FILE, model://PACKAGE/FILE, file://FILE or a plain path. The first of: the
/// user's folder for the package, PREFIX/share/PACKAGE for each of AMENT_PREFIX_PATH, ENTRY/PACKAGE or an
/// ENTRY that is the package for each of ROS_PACKAGE_PATH, the URDF's folder and those above it.
FileFound FindNamedFile(const FileSearch& search, const std::string& name);

}  // namespace fork1s::internal
