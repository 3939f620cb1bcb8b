#include "hdf5_file.hpp"
#include "base/system_error.hpp"

#include <array>
#include <cerrno>
#include <cstring>
#include <filesystem>
#include <fork1s/record/recording.hpp>
#include <fstream>
#include <utility>

namespace fork1s::internal {
namespace {

Hdf5 Checked(hid_t id, Hdf5::Closer closer, const std::string& what) {
  if (id < 0) throw Hdf5Fault(what + " (" + LastHdf5Message() + ')');
  return {id, closer};
}

void Check(herr_t status, const std::string& what, ErrorCode code = ErrorCode::kFormat) {
  if (status < 0) throw Hdf5Fault(what + " (" + LastHdf5Message() + ')', code);
}

Hdf5 Space(const Dims& dims) {
  return Checked(H5Screate_simple(static_cast<int>(dims.size()), dims.data(), nullptr), H5Sclose,
                 "no dataspace");
}

Hdf5 TextType(std::size_t size) {
  Hdf5 type = Checked(H5Tcopy(H5T_C_S1), H5Tclose, "no text type");
  Check(H5Tset_size(type.id(), std::max<std::size_t>(size, 1)), "no text type");
  Check(H5Tset_strpad(type.id(), H5T_STR_NULLPAD), "no text type");
  Check(H5Tset_cset(type.id(), H5T_CSET_UTF8), "no text type");
  return type;
}

std::string Quoted(const std::string& name) { return "'" + name + "'"; }

// A link may lead to another file, or to a pipe that would be waited for. Recordings stand on their own.
void CheckLinks(hid_t parent, const std::string& name) {
  for (std::size_t end = 0; end != std::string::npos;) {
    end = name.find('/', end + 1);
    const std::string part = name.substr(0, end);
    H5L_info_t link;
    if (H5Lget_info(parent, part.c_str(), &link, H5P_DEFAULT) >= 0 && link.type != H5L_TYPE_HARD)
      throw Hdf5Fault(Quoted(part) + " leads elsewhere, which is refused");
  }
}

// The same for numbers that are stored outside the file.
void CheckStorage(const Hdf5& dataset, const std::string& name) {
  const Hdf5 layout =
      Checked(H5Dget_create_plist(dataset.id()), H5Pclose, "dataset " + Quoted(name) + " is damaged");
  if (H5Pget_external_count(layout.id()) != 0 || H5Pget_layout(layout.id()) == H5D_VIRTUAL)
    throw Hdf5Fault(Quoted(name) + " has its numbers in another file, which is refused");
}

Hdf5 OpenAttribute(hid_t object, const std::string& name) {
  return Checked(H5Aopen(object, name.c_str(), H5P_DEFAULT), H5Aclose,
                 "attribute " + Quoted(name) + " is missing");
}

Hdf5 CreateAttribute(hid_t object, const std::string& name, hid_t type) {
  const Hdf5 space = Checked(H5Screate(H5S_SCALAR), H5Sclose, "no dataspace");
  return Checked(H5Acreate2(object, name.c_str(), type, space.id(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose,
                 "cannot write attribute " + Quoted(name));
}

template <class T>
T ReadScalar(hid_t object, const std::string& name) {
  const Hdf5 attribute = OpenAttribute(object, name);
  const Hdf5 space =
      Checked(H5Aget_space(attribute.id()), H5Sclose, "attribute " + Quoted(name) + " is damaged");
  const Hdf5 type =
      Checked(H5Aget_type(attribute.id()), H5Tclose, "attribute " + Quoted(name) + " is damaged");
  if (H5Sget_simple_extent_npoints(space.id()) != 1 || H5Tget_class(type.id()) != H5T_INTEGER)
    throw Hdf5Fault("attribute " + Quoted(name) + " is no whole number");
  T value = 0;
  Check(H5Aread(attribute.id(), MemoryType<T>(), &value), "attribute " + Quoted(name) + " cannot be read");
  return value;
}

// Size of a fixed-length text type; anything else is refused.
std::size_t FixedTextSize(hid_t type, const std::string& name) {
  if (H5Tget_class(type) != H5T_STRING || H5Tis_variable_str(type) != 0)
    throw Hdf5Fault(Quoted(name) + " is no text");
  return H5Tget_size(type);
}

std::string Unpadded(const char* data, std::size_t size) {
  while (size > 0 && data[size - 1] == '\0') --size;
  return {data, size};
}

herr_t StoreDescription(unsigned, const H5E_error2_t* error, void* out) {
  // Walked from the inside: the first entry is the cause.
  auto& text = *static_cast<std::string*>(out);
  if (text.empty() && error->desc) text = error->desc;
  return 0;
}

}  // namespace

QuietHdf5::QuietHdf5() {
  H5Eget_auto2(H5E_DEFAULT, &function_, &data_);
  H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
}
QuietHdf5::~QuietHdf5() { H5Eset_auto2(H5E_DEFAULT, function_, data_); }

Hdf5& Hdf5::operator=(Hdf5&& other) noexcept {
  if (this != &other) {
    Close();
    id_ = std::exchange(other.id_, -1);
    closer_ = other.closer_;
  }
  return *this;
}

bool Hdf5::Close() {
  const hid_t id = std::exchange(id_, -1);
  return id < 0 || closer_(id) >= 0;
}

std::string LastHdf5Message() {
  std::string text;
  H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, StoreDescription, &text);
  return text.empty() ? "HDF5 gives no reason" : text;
}

Hdf5 CreateGroup(hid_t parent, const std::string& name) {
  return Checked(H5Gcreate2(parent, name.c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Gclose,
                 "cannot write group " + Quoted(name));
}
Hdf5 OpenGroup(hid_t parent, const std::string& name) {
  CheckLinks(parent, name);
  return Checked(H5Gopen2(parent, name.c_str(), H5P_DEFAULT), H5Gclose,
                 "group " + Quoted(name) + " is missing");
}
bool HasAttribute(hid_t object, const std::string& name) {
  const htri_t has = H5Aexists(object, name.c_str());
  Check(has < 0 ? -1 : 0, "attributes cannot be read");
  return has > 0;
}

void WriteAttribute(hid_t object, const std::string& name, const std::string& value) {
  const Hdf5 type = TextType(value.size());
  const Hdf5 attribute = CreateAttribute(object, name, type.id());
  Check(H5Awrite(attribute.id(), type.id(), value.empty() ? "" : value.data()),
        "cannot write " + Quoted(name), ErrorCode::kFile);
}
void WriteAttribute(hid_t object, const std::string& name, std::int64_t value) {
  const Hdf5 attribute =
      HasAttribute(object, name) ? OpenAttribute(object, name) : CreateAttribute(object, name, H5T_STD_I64LE);
  Check(H5Awrite(attribute.id(), H5T_NATIVE_INT64, &value), "cannot write " + Quoted(name), ErrorCode::kFile);
}
void WriteHashAttribute(hid_t object, const std::string& name, std::uint64_t value) {
  const Hdf5 attribute = CreateAttribute(object, name, H5T_STD_U64LE);
  Check(H5Awrite(attribute.id(), H5T_NATIVE_UINT64, &value), "cannot write " + Quoted(name),
        ErrorCode::kFile);
}
std::int64_t ReadNumberAttribute(hid_t object, const std::string& name) {
  return ReadScalar<std::int64_t>(object, name);
}
std::uint64_t ReadHashAttribute(hid_t object, const std::string& name) {
  return ReadScalar<std::uint64_t>(object, name);
}
std::string ReadTextAttribute(hid_t object, const std::string& name) {
  const Hdf5 attribute = OpenAttribute(object, name);
  const Hdf5 type =
      Checked(H5Aget_type(attribute.id()), H5Tclose, "attribute " + Quoted(name) + " is damaged");
  const Hdf5 space =
      Checked(H5Aget_space(attribute.id()), H5Sclose, "attribute " + Quoted(name) + " is damaged");
  const std::size_t size = FixedTextSize(type.id(), name);
  if (H5Sget_simple_extent_npoints(space.id()) != 1 || size > 1000000)
    throw Hdf5Fault("attribute " + Quoted(name) + " is no text");
  std::string text(size, '\0');
  Check(H5Aread(attribute.id(), type.id(), text.data()), "attribute " + Quoted(name) + " cannot be read");
  return Unpadded(text.data(), size);
}

Hdf5 WriteRaw(hid_t parent, const std::string& name, hid_t type, const Dims& dims, const void* data,
              const Note& note) {
  const Hdf5 space = Space(dims);
  Hdf5 dataset =
      Checked(H5Dcreate2(parent, name.c_str(), type, space.id(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT),
              H5Dclose, "cannot write " + Quoted(name));
  static const double kNothing = 0;  // HDF5 wants an address even where there is nothing to write
  Check(H5Dwrite(dataset.id(), type, H5S_ALL, H5S_ALL, H5P_DEFAULT, data ? data : &kNothing),
        "cannot write " + Quoted(name), ErrorCode::kFile);
  if (!note.unit.empty()) WriteAttribute(dataset.id(), "unit", note.unit);
  if (!note.text.empty()) WriteAttribute(dataset.id(), "description", note.text);
  return dataset;
}

void WriteMatrix(hid_t parent, const std::string& name, const Eigen::Ref<const MatrixX>& m,
                 const Note& note) {
  const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> rows = m;
  WriteArray(parent, name, {static_cast<hsize_t>(m.rows()), static_cast<hsize_t>(m.cols())}, rows.data(),
             note);
}
void WriteVector(hid_t parent, const std::string& name, const VectorX& v, const Note& note) {
  WriteArray(parent, name, {static_cast<hsize_t>(v.size())}, v.data(), note);
}
void WriteText(hid_t parent, const std::string& name, const std::string& text, const Note& note) {
  const Hdf5 type = TextType(text.size());
  WriteRaw(parent, name, type.id(), {1}, text.empty() ? "" : text.data(), note);
}
void WriteTexts(hid_t parent, const std::string& name, const std::vector<std::string>& texts,
                const Note& note) {
  std::size_t longest = 1;
  for (const std::string& t : texts) longest = std::max(longest, t.size());
  std::string packed(longest * texts.size(), '\0');
  for (std::size_t i = 0; i < texts.size(); ++i) texts[i].copy(packed.data() + i * longest, longest);
  const Hdf5 type = TextType(longest);
  WriteRaw(parent, name, type.id(), {texts.size()}, packed.data(), note);
}

Hdf5 OpenDataset(hid_t parent, const std::string& name) {
  CheckLinks(parent, name);
  Hdf5 dataset = Checked(H5Dopen2(parent, name.c_str(), H5P_DEFAULT), H5Dclose,
                         "dataset " + Quoted(name) + " is missing");
  CheckStorage(dataset, name);
  return dataset;
}

Dims DimsOf(const Hdf5& dataset) {
  const Hdf5 space = Checked(H5Dget_space(dataset.id()), H5Sclose, "a dataset is damaged");
  const int rank = H5Sget_simple_extent_ndims(space.id());
  if (rank < 0) throw Hdf5Fault("a dataset is damaged");
  Dims dims(static_cast<std::size_t>(rank));
  Check(H5Sget_simple_extent_dims(space.id(), dims.data(), nullptr), "a dataset is damaged");
  return dims;
}

void ReadRows(const Hdf5& dataset, hid_t type, hsize_t first, hsize_t rows, void* out) {
  const Hdf5 stored = Checked(H5Dget_type(dataset.id()), H5Tclose, "a dataset is damaged");
  // HDF5 converts between numbers as asked for; numbers that are of another kind belong to another file.
  if (H5Tget_class(stored.id()) != H5Tget_class(type))
    throw Hdf5Fault("a dataset holds another type of values");
  const Hdf5 file_space = Checked(H5Dget_space(dataset.id()), H5Sclose, "a dataset is damaged");
  Dims count = DimsOf(dataset);
  if (count.empty()) {
    Check(H5Dread(dataset.id(), type, H5S_ALL, H5S_ALL, H5P_DEFAULT, out), "a dataset cannot be read");
    return;
  }
  if (first > count[0] || rows > count[0] - first) throw Hdf5Fault("a dataset is shorter than the others");
  count[0] = rows;
  for (hsize_t c : count)
    if (c == 0) return;
  Dims start(count.size(), 0);
  start[0] = first;
  Check(H5Sselect_hyperslab(file_space.id(), H5S_SELECT_SET, start.data(), nullptr, count.data(), nullptr),
        "a dataset cannot be read");
  const Hdf5 memory = Space(count);
  Check(H5Dread(dataset.id(), type, memory.id(), file_space.id(), H5P_DEFAULT, out),
        "a dataset cannot be read");
}

MatrixX ReadMatrix(hid_t parent, const std::string& name, std::size_t most) {
  Dims dims;
  const auto v = ReadArray<double>(parent, name, dims, most);
  if (dims.size() != 2) throw Hdf5Fault(Quoted(name) + " should have two dimensions");
  return Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>(
      v.data(), static_cast<Eigen::Index>(dims[0]), static_cast<Eigen::Index>(dims[1]));
}
VectorX ReadVector(hid_t parent, const std::string& name, std::size_t most) {
  const auto v = ReadList<double>(parent, name, most);
  return Eigen::Map<const VectorX>(v.data(), static_cast<Eigen::Index>(v.size()));
}

std::vector<std::string> ReadTexts(hid_t parent, const std::string& name, std::size_t most) {
  const Hdf5 dataset = OpenDataset(parent, name);
  const Hdf5 type = Checked(H5Dget_type(dataset.id()), H5Tclose, Quoted(name) + " is damaged");
  const std::size_t size = FixedTextSize(type.id(), name);
  const Dims dims = DimsOf(dataset);
  if (dims.size() != 1 || size == 0 || dims[0] > most / size)
    throw Hdf5Fault(Quoted(name) + " is no list of texts, or is larger than its file");
  std::string packed(size * static_cast<std::size_t>(dims[0]), '\0');
  if (!packed.empty()) ReadRows(dataset, type.id(), 0, dims[0], packed.data());
  std::vector<std::string> texts;
  for (std::size_t at = 0; at < packed.size(); at += size)
    texts.push_back(Unpadded(packed.data() + at, size));
  return texts;
}
std::string ReadText(hid_t parent, const std::string& name, std::size_t most) {
  auto texts = ReadTexts(parent, name, most);
  if (texts.size() != 1) throw Hdf5Fault(Quoted(name) + " should be one text");
  return std::move(texts[0]);
}

FileFacts InspectFile(const std::string& path) {
  std::error_code error;
  if (!std::filesystem::exists(path, error)) throw Hdf5Fault("there is no such file", ErrorCode::kFile);
  if (!std::filesystem::is_regular_file(path, error))
    throw Hdf5Fault("is no regular file; give the path of the file itself", ErrorCode::kFile);
  std::ifstream in(path, std::ios::binary);
  if (!in)
    throw Hdf5Fault("cannot be opened " + CauseAndRemedy(errno, "check its permissions"), ErrorCode::kFile);
  FileFacts facts;
  facts.size = static_cast<std::size_t>(std::filesystem::file_size(path, error));
  std::array<char, 36> head{};
  in.read(head.data(), head.size());
  facts.is_hdf5 = std::memcmp(head.data(), "\211HDF\r\n\032\n", 8) == 0;
  // A superblock of version 3 has its consistency flags in byte 11 (1 open for writing, 4 by a single writer)
  // and the end of the file in bytes 28 to 35. HDF5 itself does not look at the latter while a writer is
  // marked.
  if (facts.is_hdf5 && in.gcount() == static_cast<std::streamsize>(head.size()) && head[8] == 3 &&
      head[9] == 8) {
    facts.is_open_for_writing = (head[11] & 5) != 0;
    std::uint64_t end = 0;
    std::memcpy(&end, head.data() + 28, sizeof end);
    facts.stored_size = static_cast<std::size_t>(end);
  }
  return facts;
}

}  // namespace fork1s::internal

void fork1s::DisableHdf5Cleanup() { H5dont_atexit(); }
