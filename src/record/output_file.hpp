// Files that appear whole or not at all, and never over what they should not replace.
#pragma once

#include <fork1s/base/error.hpp>
#include <memory>
#include <string>
#include <string_view>

namespace fork1s {

/// How a kind of file is told from others: what it is called in a message, and its first bytes.
struct FileKind {
  const char* name;
  std::string_view begin;
};
inline constexpr FileKind kHdf5File{"an HDF5 file", "\211HDF\r\n\032\n"};
inline constexpr FileKind kHtmlFile{"an HTML page", "<!doctype html"};

/// A file that is written under another name beside its place and takes the place once it is whole: a program
/// that fails or is killed leaves what was there before.
///
/// - A file of another kind is not replaced: `--record model.xml` is a slip of the hand.
/// - A symbolic link stays one; the file that it names is replaced, and keeps its permissions.
/// - Folders are refused; devices and pipes too, as nothing can be renamed onto them.
/// - The file is locked from the beginning until this object goes, whatever name it then has, and one that
/// another
///   program has locked so is refused. (Linux; on file systems that have locks.)
class OutputFile {
 public:
  /// Errors: kFile.
  static Expected<OutputFile> Create(const std::string& path, const FileKind& kind);
  /// Removes the file unless it was kept.
  ~OutputFile();
  OutputFile(OutputFile&&) noexcept;
  OutputFile& operator=(OutputFile&&) noexcept;

  /// The name to write under until it is kept; the file is there and empty.
  const std::string& part() const;
  /// Puts the file in its place. Errors: kFile, and then nothing has changed.
  Expected<void> Commit();
  /// Whether the file that was kept still has its name: no other program removed, renamed or replaced it.
  bool IsInPlace() const;

 private:
  OutputFile();
  struct Detail;
  std::unique_ptr<Detail> detail_;
};

/// Writes a whole file this way. Devices and pipes are allowed here: they get the bytes as they are. Errors:
/// kFile.
Expected<void> WriteFile(const std::string& path, const FileKind& kind, std::string_view bytes);

}  // namespace fork1s
