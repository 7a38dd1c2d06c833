#include "server/geometry/same_triangles.h"

#include <bit>
#include <cstring>

namespace radiosity::geometry {
namespace {

constexpr std::uint32_t kNone = ~std::uint32_t{0};

using Corners = std::array<glm::vec3, 3>;

/// Nothing is gained by choosing corners whose hashes are the same: a run of kLongest is left as it is.
constexpr std::uint32_t kLongest = 64;

std::uint64_t hashOf(const Corners& corners) {
  std::array<std::uint32_t, sizeof(Corners) / sizeof(std::uint32_t)> words;
  std::memcpy(words.data(), corners.data(), sizeof(corners));
  std::uint64_t hash = 0x9e3779b97f4a7c15ULL;
  for (const auto word : words) {
    hash = (hash ^ word) * 0xff51afd7ed558ccdULL;
    hash ^= hash >> 32U;
  }
  return hash;
}

bool areSame(const Corners& a, const Corners& b) { return std::memcmp(a.data(), b.data(), sizeof(Corners)) == 0; }

}  // namespace

/// From the last to the first: the table, of open addressing, holds the first so far.
SameTriangles findSame(std::span<const Corners> triangles, const std::vector<bool>& kind) {
  std::vector<std::uint32_t> first(std::bit_ceil(2 * triangles.size() + 1), kNone);
  const std::uint64_t mask = first.size() - 1;
  SameTriangles same;
  for (auto i = static_cast<std::uint32_t>(triangles.size()); i-- > 0;) {
    auto at = hashOf(triangles[i]) & mask;
    const auto isOther = [&](std::uint32_t j) {
      return !areSame(triangles[i], triangles[j]) || (!kind.empty() && kind[i] != kind[j]);
    };
    std::uint32_t run = 0;
    while (first[at] != kNone && isOther(first[at]) && ++run < kLongest) at = (at + 1) & mask;
    if (run == kLongest) continue;
    if (first[at] != kNone) {
      if (same.next.empty()) {
        same.next.assign(triangles.size(), kNone);
        same.follows.assign(triangles.size(), false);
      }
      same.next[i] = first[at];
      same.follows[first[at]] = true;
    }
    first[at] = i;
  }
  return same;
}

}  // namespace radiosity::geometry
