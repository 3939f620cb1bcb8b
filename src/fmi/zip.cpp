#include "zip.hpp"

#include <minizip/zip.h>
#include <zlib.h>

#include <algorithm>
#include <limits>

#include "record/output_file.hpp"

namespace fork1s::fmi {
namespace {

bool Write(zipFile archive, const ZipEntry& entry) {
  zip_fileinfo facts{};
  facts.tmz_date = {0, 0, 0, 1, 0, 1980};
  constexpr unsigned long kRegularFile = 0100000, kExecutable = 0755, kReadable = 0644;
  facts.external_fa = (kRegularFile | (entry.is_program ? kExecutable : kReadable)) << 16;
  constexpr int kMadeByUnix = 3 << 8, kNoFlags = 0, kWithoutPassword = 0;
  constexpr std::size_t kNeeds64 = 0xffffffffu;
  if (zipOpenNewFileInZip4_64(archive, entry.name.c_str(), &facts, nullptr, 0, nullptr, 0, nullptr,
                              Z_DEFLATED, Z_DEFAULT_COMPRESSION, 0, -MAX_WBITS, DEF_MEM_LEVEL,
                              Z_DEFAULT_STRATEGY, nullptr, kWithoutPassword, kMadeByUnix, kNoFlags,
                              entry.bytes.size() >= kNeeds64) != ZIP_OK)
    return false;
  bool ok = true;
  constexpr std::size_t kPart = 1u << 30;  // the length of one call is 32 bits
  for (std::size_t at = 0; ok && at < entry.bytes.size(); at += kPart)
    ok = zipWriteInFileInZip(archive, entry.bytes.data() + at,
                             static_cast<unsigned>(std::min(kPart, entry.bytes.size() - at))) == ZIP_OK;
  return (zipCloseFileInZip(archive) == ZIP_OK) && ok;
}

}  // namespace

Expected<void> WriteZip(const std::string& path, const std::vector<ZipEntry>& entries) {
  auto out = OutputFile::Create(path, {"a ZIP archive", "PK\3\4"});
  if (!out) return tl::unexpected(out.error());
  const zipFile archive = zipOpen64(out->part().c_str(), APPEND_STATUS_CREATE);
  bool ok = archive != nullptr;
  for (const ZipEntry& entry : entries) ok = ok && Write(archive, entry);
  if (archive) ok = (zipClose(archive, nullptr) == ZIP_OK) && ok;
  if (!ok) return Fail(ErrorCode::kFile, path, "cannot be written; see that its folder exists and has room");
  return out->Commit();
}

}  // namespace fork1s::fmi
