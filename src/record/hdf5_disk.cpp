#include "hdf5_disk.hpp"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <limits>
#include <memory>
#include <utility>
#include <vector>

namespace fork1s::internal {
namespace {

// A copy of this goes through HDF5's property list.
struct Settings {
  DiskState* state = nullptr;
};

struct Disk {
  H5FD_t head{};  // must come first: HDF5 knows the file by it
  int file = -1;
  dev_t device = 0;
  ino_t inode = 0;
  haddr_t end_of_allocation = 0, end_of_file = 0;
  haddr_t on_disk = 0;  // the least that the file's size must be
  DiskState* state = nullptr;
  // What was written after the failure, in order: HDF5 may read it again before it closes.
  std::vector<std::pair<haddr_t, std::vector<char>>> later;
};

Disk& Of(H5FD_t* file) { return *reinterpret_cast<Disk*>(file); }
const Disk& Of(const H5FD_t* file) { return *reinterpret_cast<const Disk*>(file); }

H5FD_t* Open(const char* name, unsigned flags, hid_t access, haddr_t) {
  const auto* settings = static_cast<const Settings*>(H5Pget_driver_info(access));
  if (settings == nullptr || settings->state == nullptr) return nullptr;
  int how = (flags & H5F_ACC_RDWR) != 0 ? O_RDWR : O_RDONLY;
  if ((flags & H5F_ACC_TRUNC) != 0) how |= O_TRUNC;
  if ((flags & H5F_ACC_CREAT) != 0) how |= O_CREAT;
  if ((flags & H5F_ACC_EXCL) != 0) how |= O_EXCL;
  auto disk = std::make_unique<Disk>();
  disk->state = settings->state;
  disk->file = open(name, how | O_CLOEXEC, 0666);
  struct stat facts {};
  if (disk->file < 0 || fstat(disk->file, &facts) != 0) {
    if (disk->file >= 0) close(disk->file);
    return nullptr;
  }
  disk->device = facts.st_dev;
  disk->inode = facts.st_ino;
  disk->end_of_file = disk->on_disk = static_cast<haddr_t>(facts.st_size);
  return &disk.release()->head;
}

herr_t Close(H5FD_t* file) {
  const std::unique_ptr<Disk> disk(&Of(file));
  // Some file systems tell of a full disk only here.
  if (close(disk->file) != 0 && !disk->state->failed()) disk->state->error = errno;
  return 0;
}

int Compare(const H5FD_t* first, const H5FD_t* second) {
  const Disk &a = Of(first), &b = Of(second);
  const auto key = [](const Disk& d) { return std::pair(d.device, d.inode); };
  return key(a) < key(b) ? -1 : key(b) < key(a) ? 1 : 0;
}

// The same as of HDF5's own driver for plain files.
herr_t Query(const H5FD_t*, unsigned long* flags) {
  if (flags != nullptr)
    *flags = H5FD_FEAT_AGGREGATE_METADATA | H5FD_FEAT_ACCUMULATE_METADATA | H5FD_FEAT_DATA_SIEVE |
             H5FD_FEAT_AGGREGATE_SMALLDATA | H5FD_FEAT_SUPPORTS_SWMR_IO | H5FD_FEAT_DEFAULT_VFD_COMPATIBLE;
  return 0;
}

haddr_t EndOfAllocation(const H5FD_t* file, H5FD_mem_t) { return Of(file).end_of_allocation; }
herr_t SetEndOfAllocation(H5FD_t* file, H5FD_mem_t, haddr_t address) {
  Of(file).end_of_allocation = address;
  return 0;
}
haddr_t EndOfFile(const H5FD_t* file, H5FD_mem_t) { return Of(file).end_of_file; }

herr_t Read(H5FD_t* file, H5FD_mem_t, hid_t, haddr_t address, size_t size, void* out) {
  const Disk& disk = Of(file);
  auto* bytes = static_cast<char*>(out);
  size_t done = 0;
  while (done < size) {
    const ssize_t got = pread(disk.file, bytes + done, size - done, static_cast<off_t>(address + done));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return -1;
    if (got == 0) break;
    done += static_cast<size_t>(got);
  }
  std::fill(bytes + done, bytes + size, '\0');  // beyond the end, as HDF5 wants it
  for (const auto& [at, written] : disk.later) {
    const haddr_t first = std::max(at, address), last = std::min(at + written.size(), address + size);
    if (first < last) std::memcpy(bytes + (first - address), written.data() + (first - at), last - first);
  }
  return 0;
}

herr_t Write(H5FD_t* file, H5FD_mem_t, hid_t, haddr_t address, size_t size, const void* in) {
  Disk& disk = Of(file);
  const auto* bytes = static_cast<const char*>(in);
  size_t done = 0;
  struct stat facts {};
  if (!disk.state->failed() && fstat(disk.file, &facts) == 0 &&
      static_cast<haddr_t>(facts.st_size) < disk.on_disk)
    disk.state->error = DiskState::kCutOff;
  while (done < size && !disk.state->failed()) {
    const ssize_t wrote = pwrite(disk.file, bytes + done, size - done, static_cast<off_t>(address + done));
    if (wrote < 0 && errno == EINTR) continue;
    if (wrote > 0)
      done += static_cast<size_t>(wrote);
    else
      disk.state->error = wrote < 0 ? errno : ENOSPC;
  }
  if (done > 0) disk.on_disk = std::max(disk.on_disk, address + done);
  if (done < size) disk.later.emplace_back(address + done, std::vector<char>(bytes + done, bytes + size));
  disk.end_of_file = std::max(disk.end_of_file, address + size);
  return 0;
}

herr_t Truncate(H5FD_t* file, hid_t, hbool_t) {
  Disk& disk = Of(file);
  if (disk.end_of_allocation == disk.end_of_file) return 0;
  if (!disk.state->failed() && ftruncate(disk.file, static_cast<off_t>(disk.end_of_allocation)) != 0)
    disk.state->error = errno;
  if (!disk.state->failed()) disk.on_disk = disk.end_of_allocation;
  disk.end_of_file = disk.end_of_allocation;
  return 0;
}

// The writer has a lock of its own, see OutputFile.
herr_t Lock(H5FD_t*, hbool_t) { return 0; }
herr_t Unlock(H5FD_t*) { return 0; }

hid_t Driver() {
  static const hid_t driver = [] {
    H5FD_class_t c{};  // by name: the members differ between versions of HDF5
    c.name = "fork1s_disk";
    c.maxaddr = static_cast<haddr_t>(std::numeric_limits<off_t>::max());
    c.fc_degree = H5F_CLOSE_WEAK;
    c.fapl_size = sizeof(Settings);
    c.open = Open;
    c.close = Close;
    c.cmp = Compare;
    c.query = Query;
    c.get_eoa = EndOfAllocation;
    c.set_eoa = SetEndOfAllocation;
    c.get_eof = EndOfFile;
    c.read = Read;
    c.write = Write;
    c.truncate = Truncate;
    c.lock = Lock;
    c.unlock = Unlock;
    const H5FD_mem_t map[] = H5FD_FLMAP_DICHOTOMY;
    std::copy(std::begin(map), std::end(map), std::begin(c.fl_map));
#if H5_VERSION_GE(1, 13, 0)
    c.version = H5FD_CLASS_VERSION;
    c.value = static_cast<H5FD_class_value_t>(513);  // of those that HDF5 leaves to programs
#endif
    return H5FDregister(&c);
  }();
  return driver;
}

}  // namespace

std::string DiskState::Reason() const {
  if (error == kCutOff)
    return "another program cut it off while it was written, and what it held is lost; record it again";
  const std::string what = std::strerror(error);
  if (error == ENOSPC || error == EDQUOT) return what + "; make room or choose another disk";
  if (error == EFBIG) return what + "; files may not grow further here, see 'ulimit -f'";
  return what;
}

Hdf5 DiskAccess(DiskState& state) {
  Hdf5 list(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  const Settings settings{&state};
  if (H5Pset_driver(list.id(), Driver(), &settings) < 0 ||
      H5Pset_libver_bounds(list.id(), H5F_LIBVER_V110, H5F_LIBVER_V110) < 0)
    throw Hdf5Fault("this HDF5 library is too old", ErrorCode::kFile);
  return list;
}

}  // namespace fork1s::internal
