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

struct Sha256::State {
  std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context{EVP_MD_CTX_new(), &EVP_MD_CTX_free};
};

Sha256::Sha256() : state_(std::make_unique<State>()) {
  RAD_CHECK(state_->context != nullptr);
  RAD_CHECK(EVP_DigestInit_ex(state_->context.get(), EVP_sha256(), nullptr) == 1);
}
Sha256::~Sha256() = default;
Sha256::Sha256(Sha256&&) noexcept = default;
Sha256& Sha256::operator=(Sha256&&) noexcept = default;

void Sha256::add(std::span<const std::uint8_t> bytes) {
  RAD_CHECK(EVP_DigestUpdate(state_->context.get(), bytes.data(), bytes.size()) == 1);
}

std::string Sha256::finish() {
  std::array<unsigned char, kDigestBytes> digest{};
  unsigned length = 0;
  RAD_CHECK(EVP_DigestFinal_ex(state_->context.get(), digest.data(), &length) == 1);
  RAD_CHECK_EQ(length, kDigestBytes);
  return hexOf(digest);
}

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
