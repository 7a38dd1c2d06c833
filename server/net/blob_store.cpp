#include "server/net/blob_store.h"

#include <openssl/evp.h>

#include <algorithm>
#include <array>
#include <random>
#include <utility>

#include "common/check.h"

namespace radiosity::net {
namespace {

void appendHex(std::string& text, unsigned byte) {
  static constexpr std::string_view kDigits = "0123456789abcdef";
  text += kDigits[(byte >> 4) & 15U];
  text += kDigits[byte & 15U];
}

}  // namespace

std::string sha256Hex(const Bytes& bytes) {
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned length = 0;
  RAD_CHECK(EVP_Digest(bytes.data(), bytes.size(), digest.data(), &length, EVP_sha256(), nullptr) == 1);
  std::string text;
  for (unsigned i = 0; i < length; ++i) appendHex(text, digest[i]);
  return text;
}

std::string randomHex(std::size_t bytes) {
  std::random_device source;
  std::string text;
  for (std::size_t i = 0; i < bytes; ++i) appendHex(text, source());
  return text;
}

std::string BlobStore::put(std::string name, SharedBytes bytes) {
  auto id = naming_ == Naming::kByContent ? sha256Hex(*bytes) : randomHex(16);
  const std::lock_guard lock(mutex_);
  const auto known = std::find_if(blobs_.begin(), blobs_.end(), [&](const Blob& blob) { return blob.id == id; });
  if (known != blobs_.end()) {
    bytes_ -= known->bytes->size();
    blobs_.erase(known);
  }
  bytes_ += bytes->size();
  blobs_.push_back({id, std::move(name), std::move(bytes)});
  while (blobs_.size() > 1 && (blobs_.size() > max_count_ || bytes_ > max_bytes_)) {
    bytes_ -= blobs_.front().bytes->size();
    blobs_.pop_front();
  }
  return id;
}

std::optional<BlobStore::Blob> BlobStore::find(std::string_view id) const {
  const std::lock_guard lock(mutex_);
  for (const auto& blob : blobs_)
    if (blob.id == id) return blob;
  return std::nullopt;
}

}  // namespace radiosity::net
