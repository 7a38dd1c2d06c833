// Places on leaves within which light changes much: those that something covers, or passes, in part. Plain values.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec2.hpp>
#include <span>
#include <vector>

namespace radiosity::scene {

/// Point `i` of `count`, a power of two, lies in column i and this row: each has its own. From 16 on a rank-1 lattice
/// (32, 128 and 512 lie less evenly); no generator spreads fewer, which are Hammersley's.
[[nodiscard]] constexpr std::uint32_t latticeRow(std::uint32_t i, std::uint32_t count) {
  if (count >= 16) {
    const std::uint32_t generator = count == 1024 ? 275 : count == 256 ? 75 : count == 64 ? 19 : 5;
    return i * generator & (count - 1);
  }
  std::uint32_t row = 0;
  for (std::uint32_t bit = 1; bit < count; bit *= 2) row = 2 * row + ((i & bit) != 0 ? 1 : 0);
  return row;
}
/// In [0, 1)^2: axis-parallel borders are placed within 1/count.
template <typename Vec = glm::dvec2>
[[nodiscard]] constexpr Vec latticePoint(std::uint32_t i, std::uint32_t count) {
  using Number = typename Vec::value_type;
  const Number step = Number(1) / static_cast<Number>(count);
  return {(static_cast<Number>(i) + Number(0.5)) * step,
          (static_cast<Number>(latticeRow(i, count)) + Number(0.5)) * step};
}

/// A place on a leaf: texel coordinates, and the triangle whose frame they belong to.
struct LeafSpot {
  glm::vec2 texel{0.0F};
  std::uint32_t triangle = ~std::uint32_t{0};
};

/// Of a leaf's spots so many are looked at together, which lie in different quarters of it ...
inline constexpr std::uint32_t kSpotQuarters = 4;
/// ... and of those in a quarter one for each of so many rows.
inline constexpr std::uint32_t kSpotRows = 16;

/// Which spots are looked at: a row of them, and which of those that the row stands for.
struct SpotDraw {
  std::uint32_t row = 0;
  float at = 0.5F;  ///< in [0, 1)

  /// From a number in [0, 1), so that evenly spread numbers draw all spots evenly.
  [[nodiscard]] static SpotDraw from(double number) {
    const double rows = number * kSpotRows;
    const auto row = std::min(kSpotRows - 1, static_cast<std::uint32_t>(rows));
    return {row, static_cast<float>(std::min(rows - row, 0.999999))};
  }
  bool operator==(const SpotDraw&) const = default;
};

/// Lists of places, each of one leaf: points of a lattice over a box, of two bytes each, and four more where they are
/// in several frames. As many as there are, since along the edge of what hides a part of a leaf a sixty-fourth of it is
/// a tenth of the light of what is left.
class LeafSpots {
 public:
  /// A box in texels, and how many points a lattice over it has.
  struct Lattice {
    glm::vec2 low{0.0F}, size{1.0F};
    std::uint32_t points = 1;

    [[nodiscard]] glm::vec2 at(std::uint32_t number) const {
      return low + size * latticePoint<glm::vec2>(number, points);
    }
    bool operator==(const Lattice&) const = default;
  };
  struct Place {
    std::uint16_t number;
    std::uint32_t triangle;
  };
  /// One list, to look at several of its spots; until another is added.
  struct View {
    Lattice lattice;
    const std::uint16_t* numbers;
    const std::uint32_t* triangles;  ///< null: all are in the frame of the leaf's own

    [[nodiscard]] LeafSpot at(std::uint32_t k, std::uint32_t own) const {
      return {lattice.at(numbers[k]), triangles == nullptr ? own : triangles[k]};
    }
  };

  /// Puts places of a lattice of so many points into the order that lists have, of which each part is a part of the
  /// leaf: the same, whatever order they come in. O(n log n), 15 us for 256.
  static void order(std::uint32_t points, std::span<Place> places);
  /// A leaf's spots, in order. `in_one_frame`: texel coordinates mean the same on all of their triangles. Returns the
  /// list's number. O(n).
  std::uint32_t add(const Lattice& lattice, std::span<const Place> places, bool in_one_frame);
  [[nodiscard]] std::uint32_t countOf(std::uint32_t list) const { return lists_[list].count; }
  [[nodiscard]] bool isInOneFrame(std::uint32_t list) const { return lists_[list].first_triangle == kOneFrame; }
  [[nodiscard]] View of(std::uint32_t list) const {
    const auto& of = lists_[list];
    return {of.lattice, numbers_.data() + of.first_number,
            of.first_triangle == kOneFrame ? nullptr : triangles_.data() + of.first_triangle};
  }
  /// Spot k < countOf(list); `own`: the leaf's triangle.
  [[nodiscard]] LeafSpot at(std::uint32_t list, std::uint32_t k, std::uint32_t own) const {
    return of(list).at(k, own);
  }
  /// Whether one of the lattice's points around a place of the leaf is a spot. At the corners of the box, 2 % of it,
  /// there may be none.
  [[nodiscard]] bool isNear(std::uint32_t list, const glm::vec2& texel) const;
  /// Which of `count` spots is in a row and quarter; in the mean over `at`, each as often as any other.
  [[nodiscard]] static std::uint32_t indexOf(std::uint32_t count, std::uint32_t row, std::uint32_t quarter, float at) {
    const float part = static_cast<float>(quarter) + (static_cast<float>(row) + at) / static_cast<float>(kSpotRows);
    return std::min(count - 1, static_cast<std::uint32_t>(part * static_cast<float>(count) / kSpotQuarters));
  }
  [[nodiscard]] std::size_t listCount() const { return lists_.size(); }
  [[nodiscard]] std::size_t bytes() const;
  void shrinkToFit();
  /// Calls visit(vector) for each part, of plain values.
  template <typename Self, typename Visit>
  static void visitParts(Self& self, const Visit& visit) {
    visit(self.lists_);
    visit(self.numbers_);
    visit(self.triangles_);
  }

 private:
  static constexpr std::uint64_t kOneFrame = ~std::uint64_t{0};
  struct List {
    Lattice lattice;
    std::uint32_t count = 0;
    std::uint64_t first_number = 0, first_triangle = kOneFrame;
  };
  std::vector<List> lists_;
  std::vector<std::uint16_t> numbers_;
  std::vector<std::uint32_t> triangles_;  ///< by place, of lists in several frames
};

/// Full leaves have all the same, so that none is kept of any: kLeafLattice points, in order.
inline constexpr std::uint32_t kLeafLattice = 256;
extern const std::array<glm::vec2, kLeafLattice> kSpotsOfFull;

}  // namespace radiosity::scene
