// How many places of each leaf are asked whether they are buried: as many as can be paid for. Plain values.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

namespace radiosity::scene {

/// Of one place, Hits::work or 1.5 ms: a hundred times what one takes in a furnished room.
inline constexpr std::uint64_t kMostWorkOfPlace = 250'000;

/// Powers of two, by which latticePoint() spreads them.
struct BurialPlaces {
  std::uint32_t few = 16;     ///< of each leaf that something touches
  std::uint32_t many = 64;    ///< instead, where these do not agree
  std::uint32_t beside = 64;  ///< of those beside leaves where something was buried
  bool finer = true;          ///< edges that cross a leaf are looked at more closely (finer_places.h)
  /// Of one place, then what its rays have said until then is the answer.
  std::uint64_t work_each = kMostWorkOfPlace;
};

/// What a few places of a leaf told.
struct TriedLeaf {
  static constexpr std::uint32_t kPlaces = 4;
  std::uint64_t work = 0;  ///< of its rays (Hits)
  bool buried = false;     ///< some of it
  bool visible = false;    ///< likewise
};

/// Of so many leaves that something touches, so many are tried: for a hundredth of what all cost.
[[nodiscard]] std::size_t triedLeaves(std::size_t leaves);

/// For so many leaves, of which these were tried.
[[nodiscard]] BurialPlaces affordablePlaces(std::size_t leaves, std::span<const TriedLeaf> tried);

/// BurialPlaces::beside when it is known how many leaves are beside others; no more than BurialPlaces::few: it is not
/// worth it.
[[nodiscard]] std::uint32_t affordableBeside(std::size_t beside, const BurialPlaces& places,
                                             std::span<const TriedLeaf> tried);

/// Of a place on each of so many surfaces that nothing comes near.
[[nodiscard]] std::uint64_t affordableWork(std::size_t surfaces);

/// Of the question what comes near a leaf, and of others of its kind, where a scene has so many leaves: at so many
/// boxes and triangles (Bvh). Those of long triangles that lean every way all lie in each other, and then it is taken
/// that something is near, which costs more to light and is no less right.
[[nodiscard]] std::size_t affordableLooks(std::size_t leaves);

/// `undecided`: sides of texels of which a place took more work than it might. Empty: nothing was left out.
[[nodiscard]] std::string budgetWarning(const BurialPlaces& places, std::size_t undecided);

}  // namespace radiosity::scene
