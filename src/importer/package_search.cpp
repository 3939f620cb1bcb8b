#include "package_search.hpp"

#include <fmt/format.h>
#include <tinyxml2.h>

#include <cstdlib>
#include <sstream>
#include <vector>

namespace fork1s::internal {
namespace {

namespace fs = std::filesystem;

bool IsFile(const fs::path& path) {
  std::error_code ignored;
  return fs::is_regular_file(path, ignored);
}

bool IsFolder(const fs::path& path) {
  std::error_code ignored;
  return fs::is_directory(path, ignored);
}

// The entries of a variable such as PATH; none where it is not set.
std::vector<fs::path> EntriesOf(const char* variable) {
  std::vector<fs::path> entries;
  const char* value = std::getenv(variable);
  std::istringstream stream(value != nullptr ? value : "");
  for (std::string entry; std::getline(stream, entry, ':');) {
    if (!entry.empty()) entries.emplace_back(entry);
  }
  return entries;
}

// A folder is a package by its name, or by what its package.xml calls itself.
bool IsPackage(const fs::path& folder, const std::string& package) {
  const fs::path clean = (folder / "").lexically_normal().parent_path();
  if (clean.filename() == package) return true;
  tinyxml2::XMLDocument document;
  if (document.LoadFile((folder / "package.xml").c_str()) != tinyxml2::XML_SUCCESS) return false;
  const tinyxml2::XMLElement* root = document.RootElement();
  const tinyxml2::XMLElement* name = root != nullptr ? root->FirstChildElement("name") : nullptr;
  return name != nullptr && name->GetText() != nullptr && package == name->GetText();
}

std::vector<fs::path> FoldersOfPackage(const std::string& package) {
  std::vector<fs::path> folders;
  for (const fs::path& prefix : EntriesOf("AMENT_PREFIX_PATH")) folders.push_back(prefix / "share" / package);
  for (const fs::path& entry : EntriesOf("ROS_PACKAGE_PATH")) {
    folders.push_back(entry / package);
    if (IsPackage(entry, package)) folders.push_back(entry);
  }
  std::vector<fs::path> there;
  for (fs::path& folder : folders) {
    if (IsFolder(folder)) there.push_back(std::move(folder));
  }
  return there;
}

// The folder of the URDF may be the package, or lie a few levels below it or beside it.
std::optional<fs::path> FindAbove(const std::string& urdf, const std::string& package,
                                  const std::string& name) {
  constexpr int kLevels = 6;
  std::error_code ignored;
  fs::path folder = fs::absolute(fs::path(urdf), ignored).parent_path();
  for (int level = 0; level < kLevels; ++level) {
    if (!package.empty() && IsFile(folder / package / name)) return folder / package / name;
    if (IsFile(folder / name)) return folder / name;
    if (folder == folder.parent_path()) break;
    folder = folder.parent_path();
  }
  return std::nullopt;
}

FileFound FindInPackage(const FileSearch& search, const std::string& package, const std::string& name) {
  FileFound found;
  found.package = package;
  if (const auto given = search.packages.find(package); given != search.packages.end()) {
    // The user's word is final: a file of that name elsewhere would be another one.
    const fs::path file = fs::path(given->second) / name;
    if (IsFile(file)) found.file = file;
    found.reason = fmt::format("the folder given for package '{}' is {}, where no file '{}' is", package,
                               given->second, name);
    found.remedy = "mend the option or put the file there";
    return found;
  }
  const std::vector<fs::path> folders = FoldersOfPackage(package);
  for (const fs::path& folder : folders) {
    if (!IsFile(folder / name)) continue;
    found.file = folder / name;
    return found;
  }
  found.file = FindAbove(search.urdf, package, name);
  found.reason =
      folders.empty()
          ? fmt::format(
                "package '{}' was not found below AMENT_PREFIX_PATH and ROS_PACKAGE_PATH, and "
                "the file not above the URDF",
                package)
          : fmt::format("package '{}' is {}, where no file '{}' is", package, folders.front().string(), name);
  found.remedy = fmt::format("name the folder by the option package, {}=DIR", package);
  return found;
}

}  // namespace

FileFound FindNamedFile(const FileSearch& search, const std::string& name) {
  for (const std::string scheme : {"package://", "model://"}) {
    if (name.rfind(scheme, 0) != 0) continue;
    const std::string rest = name.substr(scheme.size());
    const std::size_t slash = rest.find('/');
    if (slash == std::string::npos) {
      return {rest, std::nullopt, "the name has a package and no file", "write package://PACKAGE/FILE"};
    }
    if (slash > 0) return FindInPackage(search, rest.substr(0, slash), rest.substr(slash + 1));
    return {"", FindAbove(search.urdf, "", rest.substr(1)),
            "the name has no package, and the file is not above the URDF", "write package://PACKAGE/FILE"};
  }
  const std::string plain = name.rfind("file://", 0) == 0 ? name.substr(7) : name;
  FileFound found;
  found.reason = "the file was not found beside the URDF or above it";
  found.remedy = "put it there or mend the path";
  if (!fs::path(plain).is_absolute()) {
    found.file = FindAbove(search.urdf, "", plain);
  } else if (IsFile(plain)) {
    found.file = plain;
  } else {
    found.reason = "there is no such file";
  }
  return found;
}

}  // namespace fork1s::internal
