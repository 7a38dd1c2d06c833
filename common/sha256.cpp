#include "common/sha256.h"

#include <openssl/evp.h>

#include <array>
#include <random>

#include "common/check.h"

namespace radiosity {
namespace {

constexpr std::size_t kDigestBytes = 32;

std::array<unsigned char, kDigestBytes> digestOf(const void* data, std::size_t size) {
  std::array<unsigned char, kDigestBytes> digest{};
  unsigned length = 0;
  RAD_CHECK(EVP_Digest(data, size, digest.data(), &length, EVP_sha256(), nullptr) == 1);
  RAD_CHECK_EQ(length, kDigestBytes);
  return digest;
}

void appendHex(std::string& text, unsigned byte) {
  static constexpr std::string_view kDigits = "0123456789abcdef";
  text += kDigits[(byte >> 4) & 15U];
  text += kDigits[byte & 15U];
}

std::string hexOf(const std::array<unsigned char, kDigestBytes>& digest) {
  std::string text;
  for (const auto byte : digest) appendHex(text, byte);
  return text;
}

}  // namespace

std::string sha256Hex(std::span<const std::uint8_t> bytes) { return hexOf(digestOf(bytes.data(), bytes.size())); }
std::string sha256Hex(std::string_view text) { return hexOf(digestOf(text.data(), text.size())); }

std::uint64_t fingerprintOf(std::string_view text) {
  std::uint64_t value = 0;
  const auto digest = digestOf(text.data(), text.size());
  for (std::size_t i = 0; i < sizeof(value); ++i) value = value << 8U | digest[i];
  return value;
}

std::string randomHex(std::size_t bytes) {
  std::random_device source;
  std::string text;
  for (std::size_t i = 0; i < bytes; ++i) appendHex(text, source());
  return text;
}

}  // namespace radiosity
