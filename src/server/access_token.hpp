// A secret in the address of the page: on a machine with several users, whoever reaches the port is not its
// owner.
#pragma once

#include <fork1s/base/error.hpp>
#include <string>
#include <string_view>

namespace fork1s::internal {

/// 128 random bits of the kernel, as 32 hexadecimal digits.
Expected<std::string> MakeAccessToken();

/// True where the query of `target` has `token=` with this token, or the token is empty. The time of the
/// comparison does not depend on where the two differ. The token travels in addresses and in no cookie:
/// browsers send cookies of 127.0.0.1 to every port, those of other users' programs too.
bool IsAuthorized(std::string_view target, std::string_view token);

}  // namespace fork1s::internal
