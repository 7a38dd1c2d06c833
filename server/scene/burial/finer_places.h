// Which of a leaf's places tell what is around others, four times as dense: along the edge of what hides a part of a
// leaf a sixty-fourth of it is a tenth of the light of what is left, and far from the edge there is nothing to ask.
// Plain values; any thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "server/scene/values/leaf_spots.h"

namespace radiosity::scene {

/// That all leaves are asked for which something covers in part: as of latticePoint().
inline constexpr std::uint32_t kCoarsePlaces = 64;
/// Where no more of them are buried, or visible, and most of these lie apart from each other, all of kLeafLattice are
/// asked: in a strip narrower than 0.05 its points are farther apart than what is asked beside others, and of walls
/// 0.03 thick two thirds were missed. Two such strips may lie on a leaf.
inline constexpr std::size_t kMostOfStrips = 6;
/// Of kLeafLattice places so many are asked, in the mean over where an edge may cross a leaf.
inline constexpr std::uint32_t kFinerAsked = 50;

/// Those of kCoarsePlaces that lie around one of kLeafLattice: where they agree it is as they are, as it seems.
/// Ascending.
[[nodiscard]] std::span<const std::uint8_t> coarseAround(std::uint32_t finer);
/// Those of kCoarsePlaces right beside one of them.
[[nodiscard]] std::span<const std::uint8_t> coarseBeside(std::uint32_t coarse);
/// Those of kLeafLattice right beside one of them: where they do not agree, it seemed wrong.
[[nodiscard]] std::span<const std::uint8_t> finerAround(std::uint32_t finer);

}  // namespace radiosity::scene
