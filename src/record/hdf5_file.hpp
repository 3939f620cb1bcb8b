// The part of HDF5 that recordings and reduced-model files need, with handles that close themselves.
//
// Failures throw Hdf5Fault, caught where the public functions return an Expected; HDF5's own printing to
// stderr is off while a QuietHdf5 lives.
#pragma once

#include <hdf5.h>

#include <cstdint>
#include <fork1s/base/error.hpp>
#include <fork1s/base/types.hpp>
#include <stdexcept>
#include <string>
#include <vector>

namespace fork1s::internal {

class Hdf5Fault : public std::runtime_error {
 public:
  explicit Hdf5Fault(const std::string& what, ErrorCode code = ErrorCode::kFormat)
      : std::runtime_error(what), code_(code) {}
  ErrorCode code() const { return code_; }

 private:
  ErrorCode code_;
};

class QuietHdf5 {
 public:
  QuietHdf5();
  ~QuietHdf5();
  QuietHdf5(const QuietHdf5&) = delete;
  QuietHdf5& operator=(const QuietHdf5&) = delete;

 private:
  H5E_auto2_t function_ = nullptr;
  void* data_ = nullptr;
};

/// Any HDF5 object.
class Hdf5 {
 public:
  using Closer = herr_t (*)(hid_t);
  Hdf5() = default;
  Hdf5(hid_t id, Closer closer) : id_(id), closer_(closer) {}
  Hdf5(Hdf5&& other) noexcept : id_(std::exchange(other.id_, -1)), closer_(other.closer_) {}
  Hdf5& operator=(Hdf5&& other) noexcept;
  ~Hdf5() { Close(); }

  hid_t id() const { return id_; }
  explicit operator bool() const { return id_ >= 0; }
  /// False where closing failed, such as on a full disk.
  bool Close();

 private:
  hid_t id_ = -1;
  Closer closer_ = nullptr;
};

using Dims = std::vector<hsize_t>;

template <class T>
hid_t MemoryType();
template <>
inline hid_t MemoryType<double>() {
  return H5T_NATIVE_DOUBLE;
}
template <>
inline hid_t MemoryType<float>() {
  return H5T_NATIVE_FLOAT;
}
template <>
inline hid_t MemoryType<int>() {
  return H5T_NATIVE_INT;
}
template <>
inline hid_t MemoryType<std::int64_t>() {
  return H5T_NATIVE_INT64;
}
template <>
inline hid_t MemoryType<std::uint64_t>() {
  return H5T_NATIVE_UINT64;
}
template <>
inline hid_t MemoryType<std::uint8_t>() {
  return H5T_NATIVE_UINT8;
}

/// What HDF5 says of its last failure, in brief.
std::string LastHdf5Message();

Hdf5 CreateGroup(hid_t parent, const std::string& name);
Hdf5 OpenGroup(hid_t parent, const std::string& name);
bool HasAttribute(hid_t object, const std::string& name);

void WriteAttribute(hid_t object, const std::string& name, const std::string& value);
void WriteAttribute(hid_t object, const std::string& name, std::int64_t value);
std::string ReadTextAttribute(hid_t object, const std::string& name);
std::int64_t ReadNumberAttribute(hid_t object, const std::string& name);
std::uint64_t ReadHashAttribute(hid_t object, const std::string& name);
void WriteHashAttribute(hid_t object, const std::string& name, std::uint64_t value);

/// Units and meaning of a dataset.
struct Note {
  std::string unit;  // empty: none
  std::string text;
};

Hdf5 WriteRaw(hid_t parent, const std::string& name, hid_t type, const Dims& dims, const void* data,
              const Note& note);
template <class T>
void WriteArray(hid_t parent, const std::string& name, const Dims& dims, const T* data, const Note& note) {
  WriteRaw(parent, name, MemoryType<T>(), dims, data, note);
}
template <class T>
void WriteArray(hid_t parent, const std::string& name, const std::vector<T>& v, const Note& note) {
  WriteRaw(parent, name, MemoryType<T>(), {v.size()}, v.data(), note);
}
/// Rows first, as h5py and the page read it; MATLAB shows the transpose, as it does for every file.
void WriteMatrix(hid_t parent, const std::string& name, const Eigen::Ref<const MatrixX>& m, const Note& note);
void WriteVector(hid_t parent, const std::string& name, const VectorX& v, const Note& note);
/// One text, and a list of texts, as UTF-8 of fixed length padded with zeros.
void WriteText(hid_t parent, const std::string& name, const std::string& text, const Note& note);
void WriteTexts(hid_t parent, const std::string& name, const std::vector<std::string>& texts,
                const Note& note);

/// Dimensions of a dataset that is already open.
Dims DimsOf(const Hdf5& dataset);
Hdf5 OpenDataset(hid_t parent, const std::string& name);
/// Rows [first, first + rows) of a dataset into `out`, which must have room: see ReadArray.
void ReadRows(const Hdf5& dataset, hid_t type, hsize_t first, hsize_t rows, void* out);
/// The whole dataset. Refuses to allocate more than `most` bytes, which a damaged file may ask for.
template <class T>
std::vector<T> ReadArray(hid_t parent, const std::string& name, Dims& dims, std::size_t most) {
  const Hdf5 dataset = OpenDataset(parent, name);
  dims = DimsOf(dataset);
  hsize_t count = 1;
  for (hsize_t d : dims) {
    if (d > 0 && count > most / sizeof(T) / d)
      throw Hdf5Fault("'" + name + "' says that it is larger than its file");
    count *= d;
  }
  std::vector<T> values(static_cast<std::size_t>(count));
  if (count > 0) ReadRows(dataset, MemoryType<T>(), 0, dims.empty() ? 1 : dims[0], values.data());
  return values;
}
template <class T>
std::vector<T> ReadList(hid_t parent, const std::string& name, std::size_t most) {
  Dims dims;
  auto values = ReadArray<T>(parent, name, dims, most);
  if (dims.size() != 1) throw Hdf5Fault("'" + name + "' should have one dimension");
  return values;
}
MatrixX ReadMatrix(hid_t parent, const std::string& name, std::size_t most);
VectorX ReadVector(hid_t parent, const std::string& name, std::size_t most);
std::string ReadText(hid_t parent, const std::string& name, std::size_t most);
std::vector<std::string> ReadTexts(hid_t parent, const std::string& name, std::size_t most);

/// Length of a file [bytes], and whether it begins as HDF5 does. Throws Hdf5Fault kFile where it cannot be
/// read.
struct FileFacts {
  std::size_t size = 0;
  bool is_hdf5 = false;
  bool is_open_for_writing = false;  // a writer is at it, or was killed
  std::size_t stored_size = 0;       // that it should have at least, 0 where it does not say
  /// What a damaged file may make us allocate.
  std::size_t MostBytes() const { return size + (std::size_t{16} << 20); }
};
FileFacts InspectFile(const std::string& path);

}  // namespace fork1s::internal
