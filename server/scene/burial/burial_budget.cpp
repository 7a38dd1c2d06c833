#include "server/scene/burial/burial_budget.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>

#include "server/scene/burial/finer_places.h"

namespace radiosity::scene {
namespace {

constexpr BurialPlaces kAll;
/// Of a scene: places of the first look, so that there is a bound on what is held of them, and of the look beside.
constexpr std::uint64_t kMaxPlaces = 2'000'000, kMaxBeside = 8'000'000;
/// Hits::work: 2.5 s of one core, or 4 s where trees are larger than its cache. Three times what a model of 60,000
/// triangles takes, all of which touch. It is counted and not measured, so that a scene is the same whoever builds it,
/// and from few leaves, so that it is also the same after an edit, when most are remembered.
constexpr double kMaxWork = 400e6;
/// Of a place at least, where one of each leaf takes more than that.
constexpr std::uint64_t kLeastWorkOfPlace = 2'000;
constexpr std::size_t kLeavesATry = 32, kMostTried = 128;
/// Of all leaves, about a second of one core; and of a leaf, at least and at most.
constexpr std::size_t kMostLooks = std::size_t{1} << 27U, kLeastLooksOfLeaf = 512, kMostLooksOfLeaf = 65'536;

/// Of the work of all places; a power of two, so that after most edits it is the same.
std::uint64_t shareOf(std::uint64_t places) {
  const auto each = static_cast<std::uint64_t>(kMaxWork) / std::max<std::uint64_t>(1, places);
  return std::clamp(std::bit_floor(each), kLeastWorkOfPlace, kMostWorkOfPlace);
}

}  // namespace

std::size_t triedLeaves(std::size_t leaves) { return std::min(kMostTried, leaves / kLeavesATry); }

BurialPlaces affordablePlaces(std::size_t leaves, std::span<const TriedLeaf> tried) {
  auto places = kAll;
  const auto most = kMaxPlaces / std::max<std::uint64_t>(1, leaves);
  places.few = std::bit_floor(static_cast<std::uint32_t>(std::clamp<std::uint64_t>(most, 1, kAll.few)));
  double first = 0.0, again = 0.0;  // work of a place of each of the tried
  for (const auto& leaf : tried) {
    const double work = static_cast<double>(leaf.work) / TriedLeaf::kPlaces;
    first += work;
    if (leaf.buried && leaf.visible) again += work;
  }
  const double each = static_cast<double>(leaves) / static_cast<double>(std::max<std::size_t>(1, tried.size()));
  const auto work = [&](std::uint32_t many) { return (places.few * first + many * again) * each; };
  places.finer = work(places.many + kFinerAsked) <= kMaxWork;
  while (places.many > 1 && work(places.many) > kMaxWork) {
    places.few = std::max(1U, places.few / 2);
    places.many /= 2;
  }
  places.beside = places.many;
  if (work(places.many) > kMaxWork) places.work_each = shareOf(leaves * places.few);
  return places;
}

std::uint32_t affordableBeside(std::size_t beside, const BurialPlaces& places, std::span<const TriedLeaf> tried) {
  double work = 0.0;
  std::size_t count = 0;
  for (const auto& leaf : tried) {
    if (leaf.buried) continue;
    work += static_cast<double>(leaf.work) / TriedLeaf::kPlaces;
    ++count;
  }
  if (count > 0) work /= static_cast<double>(count);
  const auto leaves = static_cast<double>(beside);
  auto each = places.beside;
  while (each > 1 && (leaves * each > static_cast<double>(kMaxBeside) || leaves * each * work > kMaxWork)) each /= 2;
  return each;
}

std::uint64_t affordableWork(std::size_t surfaces) { return shareOf(surfaces); }

std::size_t affordableLooks(std::size_t leaves) {
  const auto each = std::bit_floor(kMostLooks / std::max<std::size_t>(1, leaves));
  return std::clamp(each, kLeastLooksOfLeaf, kMostLooksOfLeaf);
}

std::string budgetWarning(const BurialPlaces& places, std::size_t undecided) {
  if (undecided > 0)
    return fmt::format(
        "So many solids lie through each other that {} sides of texels were taken as what the first of their rays "
        "told, "
        "or as visible: those that are hidden within a solid may be lit. Fewer solids, or materials with doubleSided "
        "true, which bound no solid, help",
        undecided);
  if (places.few == kAll.few && places.many == kAll.many && places.beside == kAll.beside) return {};
  return fmt::format(
      "So much touches that only {} places of each texel beside something else, {} at edges, were asked whether they "
      "are hidden within a solid ({} and {} otherwise): next to such edges texels may be too dark or too bright. "
      "Larger texels, or materials with doubleSided true, which bound no solid, help",
      places.few, std::min(places.many, places.beside), kAll.few, kAll.many);
}

}  // namespace radiosity::scene
