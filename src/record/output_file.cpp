#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cstdio>
#include <cstring>
#include <filesystem>
#include <utility>

#include "base/system_error.hpp"
#include "descriptor.hpp"
#include "record/output_file.hpp"

namespace fork1s {
namespace {

using internal::Descriptor;
namespace fs = std::filesystem;

tl::unexpected<Error> CannotWrite(const std::string& path, int error) {
  return Fail(
      ErrorCode::kFile, path,
      "cannot be written " + CauseAndRemedy(error, "check the folder, its permissions and the disk's room"));
}

// Follows symbolic links, also one to a file that is not there yet.
fs::path Place(const std::string& path) {
  fs::path place(path);
  std::error_code error;
  for (int i = 0; i < 40 && fs::is_symlink(place, error); ++i) {
    const fs::path target = fs::read_symlink(place, error);
    if (error) break;
    place = target.is_absolute() ? target : place.parent_path() / target;
  }
  return place;
}

// A lock of this open file, which ends with it and is not the one that HDF5 takes. It stands on a byte where
// no file has any. False where another has it; a file system without locks has no other.
bool Lock(const Descriptor& file) {
#ifdef F_OFD_SETLK
  struct flock lock {};
  lock.l_type = F_WRLCK;
  lock.l_whence = SEEK_SET;
  lock.l_start = off_t{1} << 60;
  lock.l_len = 1;
  return fcntl(file.get(), F_OFD_SETLK, &lock) == 0 || (errno != EAGAIN && errno != EACCES);
#else
  static_cast<void>(file);
  return true;
#endif
}

bool IsAt(const struct stat& facts, const fs::path& path) {
  struct stat now {};
  return stat(path.c_str(), &now) == 0 && now.st_dev == facts.st_dev && now.st_ino == facts.st_ino;
}

bool Begins(const Descriptor& file, std::string_view begin) {
  char head[16] = {};
  begin = begin.substr(0, sizeof head);
  const ssize_t got = pread(file.get(), head, begin.size(), 0);
  return got == static_cast<ssize_t>(begin.size()) &&
         std::equal(begin.begin(), begin.end(), head, [](char a, char b) {
           return std::tolower(static_cast<unsigned char>(a)) == std::tolower(static_cast<unsigned char>(b));
         });
}

// RENAME_NOREPLACE by other means: a link is never made over a file.
bool MoveToFreePlace(const std::string& from, const fs::path& to) {
  if (link(from.c_str(), to.c_str()) == 0) return unlink(from.c_str()), true;
  if (errno == EEXIST) return false;
  return rename(from.c_str(), to.c_str()) == 0;  // a file system without links
}

}  // namespace

struct OutputFile::Detail {
  std::string path;  // as it was given
  fs::path place;
  std::string part;
  internal::Descriptor file, replaced;  // that are locked
  struct stat replaced_facts {};
  bool kept = false;

  Expected<void> LockReplaced(const FileKind& kind);
  Expected<void> MakePart();
};

// The file that is to go, if there is one.
Expected<void> OutputFile::Detail::LockReplaced(const FileKind& kind) {
  struct stat facts {};
  if (stat(place.c_str(), &facts) != 0) return {};
  if (S_ISDIR(facts.st_mode)) return Fail(ErrorCode::kFile, path, "is a folder; name a file in it");
  if (!S_ISREG(facts.st_mode))
    return Fail(ErrorCode::kFile, path, "is a device or a pipe; only a file on a disk can hold this");
  for (int attempt = 0; attempt < 10; ++attempt) {
    replaced = Descriptor(open(place.c_str(), O_RDWR | O_CLOEXEC));
    if (!replaced && errno == ENOENT) return {};
    if (!replaced || fstat(replaced.get(), &replaced_facts) != 0) return CannotWrite(path, errno);
    if (!Lock(replaced))
      return Fail(ErrorCode::kFile, path,
                  "is being written by another run; wait until it has ended, or choose another name");
    // Whoever had the lock before may have put another file there.
    if (IsAt(replaced_facts, place)) break;
  }
  if (replaced_facts.st_size > 0 && !Begins(replaced, kind.begin))
    return Fail(ErrorCode::kFile, path,
                std::string("is no file that may be overwritten: it is not ") + kind.name +
                    "; choose another name, or remove it first");
  return {};
}

Expected<void> OutputFile::Detail::MakePart() {
  const mode_t mode = replaced ? replaced_facts.st_mode & 0777 : 0666;
  for (int i = 0; i < 1000; ++i) {
    // The extension stays at the end: some programs go by it.
    part = (place.parent_path() / ("." + place.stem().string() + "." + std::to_string(getpid()) + "-" +
                                   std::to_string(i) + ".part" + place.extension().string()))
               .string();
    file = Descriptor(open(part.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, mode));
    if (file || errno != EEXIST) break;
  }
  if (!file) {
    const int error = errno;
    part.clear();
    return CannotWrite(path, error);
  }
  if (replaced) static_cast<void>(fchmod(file.get(), mode));  // as far as the file system has permissions
  static_cast<void>(Lock(file));
  return {};
}

OutputFile::OutputFile() : detail_(std::make_unique<Detail>()) {}
OutputFile::OutputFile(OutputFile&&) noexcept = default;
OutputFile& OutputFile::operator=(OutputFile&& other) noexcept {
  std::swap(detail_, other.detail_);
  return *this;
}
OutputFile::~OutputFile() {
  if (detail_ && !detail_->kept && !detail_->part.empty()) unlink(detail_->part.c_str());
}

Expected<OutputFile> OutputFile::Create(const std::string& path, const FileKind& kind) {
  OutputFile out;
  Detail& d = *out.detail_;
  d.path = path;
  d.place = Place(path);
  if (path.empty() || !d.place.has_filename())
    return Fail(ErrorCode::kFile, path, "is no name for a file; name one");
  if (auto ok = d.LockReplaced(kind); !ok) return tl::unexpected(ok.error());
  if (auto ok = d.MakePart(); !ok) return tl::unexpected(ok.error());
  return out;
}

const std::string& OutputFile::part() const { return detail_->part; }

Expected<void> OutputFile::Commit() {
  Detail& d = *detail_;
  FORK1S_REQUIRE(!d.kept, "kept before");
  const bool as_found = d.replaced ? IsAt(d.replaced_facts, d.place) : !fs::exists(d.place);
  bool moved = false;
  if (as_found)
    moved = d.replaced ? rename(d.part.c_str(), d.place.c_str()) == 0 : MoveToFreePlace(d.part, d.place);
  if (!as_found || (!moved && errno == EEXIST))
    return Fail(ErrorCode::kFile, d.path,
                "was made or changed by another program meanwhile; choose another name");
  if (!moved) return CannotWrite(d.path, errno);
  d.kept = true;
  d.replaced.Close();
  return {};
}

bool OutputFile::IsInPlace() const {
  struct stat facts {};
  return detail_->kept && fstat(detail_->file.get(), &facts) == 0 && IsAt(facts, detail_->place);
}

Expected<void> WriteFile(const std::string& path, const FileKind& kind, std::string_view bytes) {
  const auto write_to = [&](const std::string& name, int more) -> Expected<void> {
    Descriptor file(open(name.c_str(), O_WRONLY | O_CLOEXEC | more));
    if (!file) return CannotWrite(path, errno);
    for (std::size_t done = 0; done < bytes.size();) {
      const ssize_t wrote = write(file.get(), bytes.data() + done, bytes.size() - done);
      if (wrote < 0 && errno == EINTR) continue;
      if (wrote <= 0) return CannotWrite(path, wrote < 0 ? errno : ENOSPC);
      done += static_cast<std::size_t>(wrote);
    }
    if (!file.Close()) return CannotWrite(path, errno);
    return {};
  };
  struct stat facts {};
  if (stat(path.c_str(), &facts) == 0 && !S_ISREG(facts.st_mode) && !S_ISDIR(facts.st_mode))
    return write_to(path, 0);
  auto out = OutputFile::Create(path, kind);
  if (!out) return tl::unexpected(out.error());
  if (auto ok = write_to(out->part(), O_TRUNC); !ok) return ok;
  return out->Commit();
}

}  // namespace fork1s
