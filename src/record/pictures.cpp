#include "pictures.hpp"
#include "record/png.hpp"

#include <zlib.h>

#include <fork1s/base/error.hpp>

namespace fork1s {
namespace {

void AppendBigEndian(std::uint32_t value, std::string& out) {
  for (int shift = 24; shift >= 0; shift -= 8) out.push_back(static_cast<char>(value >> shift & 255));
}

void AppendChunk(const std::string& kind, const std::string& data, std::string& out) {
  AppendBigEndian(static_cast<std::uint32_t>(data.size()), out);
  const std::string body = kind + data;
  out += body;
  AppendBigEndian(static_cast<std::uint32_t>(
                      crc32(0, reinterpret_cast<const Bytef*>(body.data()), static_cast<uInt>(body.size()))),
                  out);
}

}  // namespace

namespace internal {

std::vector<std::uint8_t> Deflated(const std::vector<std::uint8_t>& bytes) {
  uLongf size = compressBound(static_cast<uLong>(bytes.size()));
  std::vector<std::uint8_t> packed(size);
  constexpr int kQuick = 1;
  if (compress2(packed.data(), &size, bytes.data(), static_cast<uLong>(bytes.size()), kQuick) != Z_OK)
    return {};
  packed.resize(size);
  return packed;
}

std::vector<std::uint8_t> Inflated(const std::vector<std::uint8_t>& packed, std::size_t size) {
  std::vector<std::uint8_t> bytes(size);
  uLongf found = static_cast<uLongf>(size);
  if (uncompress(bytes.data(), &found, packed.data(), static_cast<uLong>(packed.size())) != Z_OK ||
      found != size)
    return {};
  return bytes;
}

}  // namespace internal

std::string Png(const Picture& picture) {
  const auto row = 3 * static_cast<std::size_t>(picture.width);
  FORK1S_REQUIRE(picture.width > 0 && picture.height > 0 &&
                     picture.rgb.size() == row * static_cast<std::size_t>(picture.height),
                 picture.name, picture.width, picture.height, picture.rgb.size());
  std::string header;
  AppendBigEndian(static_cast<std::uint32_t>(picture.width), header);
  AppendBigEndian(static_cast<std::uint32_t>(picture.height), header);
  header += std::string("\x08\x02\0\0\0", 5);  // 8 bits, RGB, the only methods there are, not interlaced
  // Every row as what it differs by from the one above (filter 2): pictures of few tones nearly vanish.
  std::vector<std::uint8_t> rows;
  rows.reserve(picture.rgb.size() + static_cast<std::size_t>(picture.height));
  for (std::size_t i = 0; i < picture.rgb.size(); ++i) {
    if (i % row == 0) rows.push_back(2);
    rows.push_back(static_cast<std::uint8_t>(picture.rgb[i] - (i < row ? 0 : picture.rgb[i - row])));
  }
  const std::vector<std::uint8_t> packed = internal::Deflated(rows);
  std::string out = "\x89PNG\r\n\x1a\n";
  AppendChunk("IHDR", header, out);
  AppendChunk("IDAT", std::string(packed.begin(), packed.end()), out);
  AppendChunk("IEND", "", out);
  return out;
}

}  // namespace fork1s
