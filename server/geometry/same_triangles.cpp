#include "server/geometry/same_triangles.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <numeric>
#include <optional>

namespace radiosity::geometry {
namespace {

constexpr std::uint32_t kNone = ~std::uint32_t{0};

using Corners = std::array<glm::vec3, 3>;

/// In a table that is at most half full runs of others hardly ever get this long, unless somebody chose the corners.
constexpr std::uint32_t kLongest = 64;

int compare(const Corners& a, const Corners& b) { return std::memcmp(a.data(), b.data(), sizeof(Corners)); }

class SameSearch {
 public:
  SameSearch(std::span<const Corners> triangles, const std::vector<bool>& kind) : triangles_(triangles), kind_(kind) {}

  /// From the last to the first: the table, of open addressing, holds the first so far. Nothing: a run gets too long.
  std::optional<SameTriangles> byHash() {
    std::vector<std::uint32_t> first(std::bit_ceil(2 * triangles_.size() + 1), kNone);
    const std::uint64_t mask = first.size() - 1;
    for (auto i = static_cast<std::uint32_t>(triangles_.size()); i-- > 0;) {
      auto at = hashOfCorners(triangles_[i]) & mask;
      std::uint32_t run = 0;
      while (first[at] != kNone && !areSame(i, first[at]) && ++run < kLongest) at = (at + 1) & mask;
      if (run == kLongest) return std::nullopt;
      if (first[at] != kNone) join(i, first[at]);
      first[at] = i;
    }
    return std::move(same_);
  }

  SameTriangles byOrder() {
    std::vector<std::uint32_t> order(triangles_.size());
    std::iota(order.begin(), order.end(), 0U);
    std::ranges::sort(order, [&](std::uint32_t a, std::uint32_t b) {
      if (const auto by_corners = compare(triangles_[a], triangles_[b]); by_corners != 0) return by_corners < 0;
      if (!kind_.empty() && kind_[a] != kind_[b]) return !kind_[a];
      return a < b;
    });
    for (std::size_t k = 1; k < order.size(); ++k)
      if (areSame(order[k - 1], order[k])) join(order[k - 1], order[k]);
    return std::move(same_);
  }

 private:
  [[nodiscard]] bool areSame(std::uint32_t a, std::uint32_t b) const {
    return compare(triangles_[a], triangles_[b]) == 0 && (kind_.empty() || kind_[a] == kind_[b]);
  }

  /// `after`: the next one that is the same.
  void join(std::uint32_t triangle, std::uint32_t after) {
    if (same_.next.empty()) {
      same_.next.assign(triangles_.size(), kNone);
      same_.follows.assign(triangles_.size(), false);
    }
    same_.next[triangle] = after;
    same_.follows[after] = true;
  }

  std::span<const Corners> triangles_;
  const std::vector<bool>& kind_;
  SameTriangles same_;
};

}  // namespace

std::uint64_t hashOfCorners(const Corners& corners) {
  std::array<std::uint32_t, sizeof(Corners) / sizeof(std::uint32_t)> words;
  std::memcpy(words.data(), corners.data(), sizeof(corners));
  std::uint64_t hash = 0x9e3779b97f4a7c15ULL;
  for (const auto word : words) {
    hash = (hash ^ word) * 0xff51afd7ed558ccdULL;
    hash ^= hash >> 32U;
  }
  return hash;
}

SameTriangles findSame(std::span<const Corners> triangles, const std::vector<bool>& kind) {
  if (auto same = SameSearch(triangles, kind).byHash()) return *std::move(same);
  return SameSearch(triangles, kind).byOrder();
}

}  // namespace radiosity::geometry
