#include "record/array_file.hpp"

#include <zlib.h>

#include <algorithm>
#include <bit>
#include <concepts>
#include <cstdint>
#include <limits>
#include <string_view>

#include "base/utf8.hpp"
#include "record/output_file.hpp"

namespace fork1s {
namespace {

constexpr FileKind kMatFile{"a MAT-file", "MATLAB "};
constexpr FileKind kNpzFile{"a zip file", "PK\003\004"};
constexpr std::size_t kMostArrayFileBytes = std::numeric_limits<std::int32_t>::max();

// Little-endian, whatever the machine is.
template <std::unsigned_integral T>
void Put(T value, std::string& out) {
  for (std::size_t i = 0; i < sizeof(T); ++i) out += static_cast<char>(value >> 8 * i & 0xFFu);
}
void PutNumber(double value, std::string& out) { Put(std::bit_cast<std::uint64_t>(value), out); }

std::u32string Letters(std::string_view text) {
  std::u32string letters;
  while (!text.empty()) {
    const Letter letter = FirstLetter(text);
    letters += letter.bytes == 0 ? kReplacementLetter : letter.code;
    text.remove_prefix(std::max<std::size_t>(letter.bytes, 1));
  }
  return letters;
}

std::string ToUtf8(std::string_view text) {
  std::string out;
  while (!text.empty()) {
    const Letter letter = FirstLetter(text);
    out += letter.bytes == 0 ? "\xEF\xBF\xBD" : text.substr(0, letter.bytes);
    text.remove_prefix(std::max<std::size_t>(letter.bytes, 1));
  }
  return out;
}

// What follows has the names of the format's description.
enum MatType : std::uint32_t {
  miINT8 = 1,
  miINT32 = 5,
  miUINT32 = 6,
  miDOUBLE = 9,
  miMATRIX = 14,
  miUTF8 = 16
};
enum MatClass : std::uint32_t { mxCELL = 1, mxCHAR = 4, mxDOUBLE = 6 };

void PutElement(MatType type, std::string_view bytes, std::string& out) {
  Put(std::uint32_t{type}, out);
  Put(static_cast<std::uint32_t>(bytes.size()), out);
  out += bytes;
  out.append((8 - bytes.size() % 8) % 8, '\0');
}

// An element of a matrix up to its content.
std::string MatrixBegin(MatClass kind, const std::vector<std::size_t>& shape, const std::string& name) {
  std::string flags, sizes, out;
  Put(std::uint32_t{kind}, flags);
  Put(std::uint32_t{0}, flags);
  for (const std::size_t size : shape) Put(static_cast<std::uint32_t>(size), sizes);
  PutElement(miUINT32, flags, out);
  PutElement(miINT32, sizes, out);
  PutElement(miINT8, name, out);
  return out;
}

void PutMatArray(const std::string& name, const NumberArray& array, std::string& out) {
  std::vector<std::size_t> shape = array.shape;
  while (shape.size() < 2) shape.push_back(1);
  // By columns: the first index runs fastest.
  std::string numbers;
  std::vector<std::size_t> at(shape.size(), 0);
  for (std::size_t count = 0; count < array.values.size(); ++count) {
    std::size_t place = 0;
    for (std::size_t i = 0; i < shape.size(); ++i) place = place * shape[i] + at[i];
    PutNumber(array.values[place], numbers);
    for (std::size_t i = 0; i < shape.size() && ++at[i] == shape[i]; ++i) at[i] = 0;
  }
  std::string content = MatrixBegin(mxDOUBLE, shape, name);
  PutElement(miDOUBLE, numbers, content);
  PutElement(miMATRIX, content, out);
}

void PutMatArray(const std::string& name, const std::vector<std::string>& texts, std::string& out) {
  std::string content = MatrixBegin(mxCELL, {texts.size(), 1}, name);
  for (const std::string& text : texts) {
    const std::size_t length = Letters(text).size();
    std::string cell = MatrixBegin(mxCHAR, {length > 0 ? 1u : 0u, length}, "");
    PutElement(miUTF8, ToUtf8(text), cell);
    PutElement(miMATRIX, cell, content);
  }
  PutElement(miMATRIX, content, out);
}

std::string NpyHeader(const std::string& type, const std::vector<std::size_t>& shape) {
  std::string sizes;
  for (const std::size_t size : shape) sizes += std::to_string(size) + ", ";
  if (shape.size() > 1) sizes.erase(sizes.size() - 2);
  std::string text = "{'descr': '" + type + "', 'fortran_order': False, 'shape': (" + sizes + "), }";
  constexpr std::size_t kBegin = 10, kAlignment = 64;
  text.append(kAlignment - 1 - (kBegin + text.size()) % kAlignment, ' ');
  text += '\n';
  std::string out("\x93NUMPY\x01\x00", 8);
  Put(static_cast<std::uint16_t>(text.size()), out);
  return out + text;
}

std::string NpyFile(const NumberArray& array) {
  std::string out = NpyHeader("<f8", array.shape);
  for (const double value : array.values) PutNumber(value, out);
  return out;
}

std::string NpyFile(const std::vector<std::string>& texts) {
  std::vector<std::u32string> all;
  std::size_t length = 1;  // NumPy has no type of text of length 0
  for (const std::string& text : texts) length = std::max(length, all.emplace_back(Letters(text)).size());
  std::string out = NpyHeader("<U" + std::to_string(length), {texts.size()});
  for (std::u32string& text : all) {
    text.resize(length, U'\0');
    for (const char32_t letter : text) Put(static_cast<std::uint32_t>(letter), out);
  }
  return out;
}

// Fields that a local header and the central directory share.
void PutZipEntry(const std::string& name, std::string_view bytes, std::string& out) {
  constexpr std::uint16_t kVersion = 20,
                          kFirstOfJanuary1980 = 0x21;  // no time of its own: the same bytes each time
  Put(kVersion, out);
  Put(std::uint16_t{0}, out);  // flags
  Put(std::uint16_t{0}, out);  // stored
  Put(std::uint16_t{0}, out);
  Put(kFirstOfJanuary1980, out);
  const auto* data = reinterpret_cast<const Bytef*>(bytes.data());
  Put(static_cast<std::uint32_t>(crc32_z(0, data, bytes.size())), out);
  Put(static_cast<std::uint32_t>(bytes.size()), out);
  Put(static_cast<std::uint32_t>(bytes.size()), out);
  Put(static_cast<std::uint16_t>(name.size()), out);
  Put(std::uint16_t{0}, out);  // no extra field
}

// Upper bounds of what a text takes, and of what a list of them of one length takes.
std::size_t MatSize(const std::vector<std::string>& texts) {
  std::size_t size = 0;
  for (const std::string& text : texts) size += 128 + 3 * text.size();
  return size;
}
std::size_t NpySize(const std::vector<std::string>& texts) {
  std::size_t longest = 0;
  for (const std::string& text : texts) longest = std::max(longest, text.size());
  return 4 * longest * texts.size();
}

template <class F>
Expected<void> RequireSize(const std::vector<NamedArray>& arrays, const F& size_of_texts,
                           const std::string& path) {
  std::size_t size = 0;
  for (const NamedArray& array : arrays) {
    const auto* numbers = std::get_if<NumberArray>(&array.of);
    size += 1024 + (numbers != nullptr ? 8 * numbers->values.size()
                                       : size_of_texts(std::get<std::vector<std::string>>(array.of)));
  }
  if (size <= kMostArrayFileBytes) return {};
  return Fail(
      ErrorCode::kFile, path,
      "would be larger than 2 GB, which this format does not hold; name fewer interface bodies or modes, or "
      "write HDF5 (.h5)");
}

}  // namespace

NumberArray ToNumberArray(const MatrixX& matrix) {
  NumberArray out{{static_cast<std::size_t>(matrix.rows()), static_cast<std::size_t>(matrix.cols())}, {}};
  out.values.reserve(static_cast<std::size_t>(matrix.size()));
  for (Eigen::Index i = 0; i < matrix.rows(); ++i)
    for (Eigen::Index k = 0; k < matrix.cols(); ++k) out.values.push_back(matrix(i, k));
  return out;
}

NumberArray ToNumberArray(const VectorX& vector) {
  return {{static_cast<std::size_t>(vector.size())}, {vector.data(), vector.data() + vector.size()}};
}

Expected<void> SaveMatFile(const std::vector<NamedArray>& arrays, const std::string& path) {
  if (auto fits = RequireSize(arrays, MatSize, path); !fits) return fits;
  std::string out = "MATLAB 5.0 MAT-file, written by fork1s " FORK1S_VERSION;
  out.resize(116, ' ');
  out.append(8, '\0');              // no data of a subsystem
  Put(std::uint16_t{0x100}, out);   // version
  Put(std::uint16_t{0x4D49}, out);  // "MI", which a reader of the other byte order sees turned
  for (const NamedArray& array : arrays)
    std::visit([&](const auto& of) { PutMatArray(array.name, of, out); }, array.of);
  return WriteFile(path, kMatFile, out);
}

Expected<void> SaveNpzFile(const std::vector<NamedArray>& arrays, const std::string& path) {
  if (auto fits = RequireSize(arrays, NpySize, path); !fits) return fits;
  std::string out, directory;
  for (const NamedArray& array : arrays) {
    const std::string name = array.name + ".npy",
                      bytes = std::visit([](const auto& of) { return NpyFile(of); }, array.of);
    const std::size_t offset = out.size();
    out += "PK\003\004";
    PutZipEntry(name, bytes, out);
    out += name;
    out += bytes;
    directory += "PK\001\002";
    Put(std::uint16_t{20}, directory);
    PutZipEntry(name, bytes, directory);
    Put(std::uint16_t{0}, directory);  // no comment
    Put(std::uint16_t{0}, directory);  // the first disk
    Put(std::uint16_t{0}, directory);  // attributes
    Put(std::uint32_t{0}, directory);
    Put(static_cast<std::uint32_t>(offset), directory);
    directory += name;
  }
  const std::size_t begin = out.size();
  out += directory;
  out += "PK\005\006";
  Put(std::uint32_t{0}, out);  // one disk
  Put(static_cast<std::uint16_t>(arrays.size()), out);
  Put(static_cast<std::uint16_t>(arrays.size()), out);
  Put(static_cast<std::uint32_t>(directory.size()), out);
  Put(static_cast<std::uint32_t>(begin), out);
  Put(std::uint16_t{0}, out);  // no comment
  return WriteFile(path, kNpzFile, out);
}

}  // namespace fork1s
