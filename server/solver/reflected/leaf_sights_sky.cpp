// LeafSights and the sky: its rays come to tell by which cell they left the scene.
#include <array>
#include <optional>
#include <utility>

#include "server/solver/math/halves.h"
#include "server/solver/reflected/leaf_sights.h"

namespace radiosity::solver {

void LeafSights::tellCells() {
  if (tells_cells_) return;
  constexpr std::uint32_t kMore = SkyCells::kCount - 2;
  std::array<PackedNumbers, 2> seen;
  inBothHalves([&](std::size_t half) { seen[half] = withCells(half, kMore); });
  if (isTraced()) before_ = count_;
  slice_.reset();  // its rays that have steps are traced anew
  cursor_ = 0;
  for (auto& half : steps_) {
    for (auto& step : half) {
      if (isSky(step.next)) {
        step.next = absorbed();  // its rays are traced anew: nobody follows it any more
      } else if (step.next >= endCount()) {
        step.next += kMore;
      }
    }
  }
  seen_ = std::move(seen);
  tells_cells_ = true;
}

/// The same ends, of which `more` are told apart, or not traced where a ray went on before it left the scene.
PackedNumbers LeafSights::withCells(std::size_t half, std::uint32_t more) const {
  const auto& old = seen_[half];
  PackedNumbers room(old.size(), endCount() + more + static_cast<std::uint32_t>(steps_[half].size()));
  std::size_t ray = 0;
  for (std::uint32_t value = 0; value < leaf_count_; ++value) {
    std::optional<Sobol4> draw;  // few leaves of a room need it
    std::uint32_t number = 0;
    for (const auto end : ends(half, ray, count_[value])) {
      const auto at = ray++;
      const auto k = number++;
      if (end == old.most()) continue;
      auto last = end;
      while (last >= endCount()) last = steps_[half][last - endCount()].next;
      if (!isSky(last)) {
        room.set(at, end < endCount() ? end : end + more);
      } else if (end < endCount()) {
        if (!draw) draw.emplace(draws(value, rays_->sideOf(value), half));
        const auto of_ray = (*draw)(k);
        const auto place = rays_->placeOn(value, {of_ray.z, of_ray.w});
        room.set(at, firstOfSky() + SkyCells::of(cosineDirection(place.normal, of_ray.x, of_ray.y)));
      }
    }
  }
  return room;
}

}  // namespace radiosity::solver
