#include "access_token.hpp"

#include <fmt/format.h>
#include <unistd.h>
#include <array>
#include <cerrno>
#include <cstring>

namespace fork1s::internal {
namespace {

std::string_view TokenOf(std::string_view target) {
  constexpr std::string_view kName = "token=";
  std::size_t at = target.find('?');
  while (at != std::string_view::npos) {
    const std::size_t end = target.find('&', ++at);
    const std::string_view pair = target.substr(at, end == std::string_view::npos ? end : end - at);
    if (pair.substr(0, kName.size()) == kName) return pair.substr(kName.size());
    at = end;
  }
  return {};
}

}  // namespace

Expected<std::string> MakeAccessToken() {
  std::array<unsigned char, 16> bytes{};
  if (getentropy(bytes.data(), bytes.size()) != 0)
    return Fail(
        ErrorCode::kModel, "token",
        fmt::format("no random numbers for the page's address ({}); try again, or serve it without a token",
                    std::strerror(errno)));
  return fmt::format("{:02x}", fmt::join(bytes, ""));
}

bool IsAuthorized(std::string_view target, std::string_view token) {
  const std::string_view given = TokenOf(target);
  if (given.size() != token.size()) return token.empty();
  unsigned difference = 0;
  for (std::size_t i = 0; i < token.size(); ++i)
    difference |= static_cast<unsigned char>(given[i]) ^ static_cast<unsigned char>(token[i]);
  return difference == 0;
}

}  // namespace fork1s::internal
