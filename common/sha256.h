// SHA-256, by OpenSSL. Pure; any thread.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <string_view>

#include "common/bytes.h"

namespace radiosity {

/// 64 hexadecimal digits. About 1 s a GiB.
[[nodiscard]] std::string sha256Hex(std::span<const std::uint8_t> bytes);
[[nodiscard]] std::string sha256Hex(std::string_view text);

/// Of bytes that come in parts.
class Sha256 {
 public:
  Sha256();
  ~Sha256();
  Sha256(Sha256&&) noexcept;
  Sha256& operator=(Sha256&&) noexcept;

  void add(std::span<const std::uint8_t> bytes);
  /// 64 hexadecimal digits; once, after which there is nothing to add to.
  [[nodiscard]] std::string finish();

 private:
  struct State;
  std::unique_ptr<State> state_;
};

/// The first 8 bytes of it as a number: the same in every build, unlike std::hash.
[[nodiscard]] std::uint64_t fingerprintOf(std::string_view text);

/// `bytes` random bytes from the system, as hexadecimal.
[[nodiscard]] std::string randomHex(std::size_t bytes);

}  // namespace radiosity
