// SHA-256, by OpenSSL. Pure; any thread.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "common/bytes.h"

namespace radiosity {

/// 64 hexadecimal digits. About 1 s a GiB.
[[nodiscard]] std::string sha256Hex(std::span<const std::uint8_t> bytes);
[[nodiscard]] std::string sha256Hex(std::string_view text);

/// The first 8 bytes of it as a number: the same in every build, unlike std::hash.
[[nodiscard]] std::uint64_t fingerprintOf(std::string_view text);

/// `bytes` random bytes from the system, as hexadecimal.
[[nodiscard]] std::string randomHex(std::size_t bytes);

}  // namespace radiosity
