#include "server/solver/repair/rough_lights.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numeric>
#include <utility>

#include "common/parallel.h"
#include "server/solver/lamps/light_sight.h"

namespace radiosity::solver {
namespace {

/// The square of what points are wrong by falls as this power of how many there are: from 8 to 16 under a table as the
/// power 1.7, behind a chair as 1.65. (Independent ones: 1.)
constexpr double kFalls = 1.5;
/// Of what shall be left this part may be that of leaves that do not look for themselves, which those that do do from
/// so many places.
constexpr double kUnsure = 0.5;
constexpr std::uint32_t kPlaces = 16;
/// Leaves that a thread takes at a time.
constexpr std::size_t kLooksAtOnce = 16;

/// Of a leaf and the eight around it; `values`: by leaf value.
float meanAround(const Side& side, std::uint32_t leaf, std::span<const float> values) {
  const auto x = leaf % side.width, y = leaf / side.width;
  const auto x0 = x - std::min(x, 1U), x1 = std::min(x + 2, side.width);
  const auto y0 = y - std::min(y, 1U), y1 = std::min(y + 2, side.height);
  float sum = 0.0F;
  for (auto ny = y0; ny < y1; ++ny)
    for (auto nx = x0; nx < x1; ++nx) sum += values[side.first_value + ny * side.width + nx];
  return sum / static_cast<float>((x1 - x0) * (y1 - y0));
}

}  // namespace

/// Where both halves of a light have looked at these leaves: the square of what their mean is wrong by, times area, in
/// the order of the leaves.
std::vector<float> RoughLights::noiseOfLeaves(std::uint32_t light, std::span<const LinkColumn::ValueRun> leaves) const {
  const auto& shooter = parts_.system.shooters()[light];
  const auto radiosity = [&](std::size_t half) {
    return static_cast<float>(0.5 * shooter.carried(half)) * glm::length(shooter.sent[half]);
  };
  const std::array<float, 2> sent{radiosity(0), radiosity(1)};
  std::array<std::vector<float>, 2> links;
  std::vector<float> noise;
  for (const auto& run : leaves) {
    for (std::size_t half = 0; half < 2; ++half) {
      links[half].assign(run.count, 0.0F);
      (void)shooter.column[half].decode(run.first, links[half]);
    }
    for (std::uint32_t i = 0; i < run.count; ++i) {
      const float differ = sent[0] * links[0][i] - sent[1] * links[1][i];
      noise.push_back(parts_.system.leafAreas()[run.first + i] * differ * differ);
    }
  }
  return noise;
}

/// Most of what is unsure is a few leaves, at the edges of shadows (behind a table, at 8 points, 74 of 436 hold 85 % of
/// it): these look.
std::size_t RoughLights::weigh(std::array<Repair*, 2> halves, std::span<const LinkColumn::ValueRun> leaves, double most,
                               std::span<float> room) {
  auto& repair = *halves[1];
  const auto noise = noiseOfLeaves(repair.shooter, leaves);
  const double sum = std::reduce(noise.begin(), noise.end(), 0.0);
  const double share = static_cast<double>(repair.looked) / repair.samples;
  repair.noise = sum;
  if (sum * (1.0 - share) <= most) return 0;
  const double by_all = std::pow(share, kFalls) * sum;
  auto looks = chooseUnsure(leaves, noise, kUnsure * (by_all + most), room);
  std::erase_if(looks, [&](const LeafLook& look) {
    return std::ranges::binary_search(repair.by_points, look.value, {}, &Repair::LeafLink::value);
  });
  look(repair.shooter, looks);
  for (auto* half : halves) takeLooks(*half, leaves, looks, room);
  const auto left = noiseOfLeaves(repair.shooter, leaves);
  repair.noise = std::max(0.0, std::reduce(left.begin(), left.end(), 0.0) - by_all) / (1.0 - share);
  return 2 * looks.size();
}

/// Only looks that both halves can take stay.
void RoughLights::look(std::uint32_t shooter, std::vector<LeafLook>& looks) const {
  const LightSight sight(rays_(), parts_.lights[parts_.system.shooters()[shooter].light], parts_.settings.seed);
  const auto lookFrom = [&](std::size_t part) {
    const auto first = part * kLooksAtOnce, count = std::min(kLooksAtOnce, looks.size() - first);
    for (auto& look : std::span(looks).subspan(first, count)) {
      for (std::size_t half = 0; half < 2; ++half) look.link[half] = sight.link(look.value, half, kPlaces);
    }
  };
  inTurns((looks.size() + kLooksAtOnce - 1) / kLooksAtOnce, lookFrom);
  std::erase_if(looks, [](const LeafLook& look) { return !look.link[0] || !look.link[1]; });
}

/// The fewest leaves without which no more than `wanted` of the noise is left. What it is around a leaf counts: were
/// those taken whose halves differ by chance, those that agree by chance would be thought to be right.
std::vector<RoughLights::LeafLook> RoughLights::chooseUnsure(std::span<const LinkColumn::ValueRun> leaves,
                                                             std::span<const float> noise, double wanted,
                                                             std::span<float> room) const {
  std::size_t first = 0;
  for (const auto& run : leaves) {
    std::copy_n(&noise[first], run.count, &room[run.first]);
    first += run.count;
  }
  std::vector<std::pair<float, std::uint32_t>> unsure;
  const auto& sides = parts_.sides;
  std::uint32_t s = 0;
  for (const auto& run : leaves) {
    while (sides[s].first_value + sides[s].leaf_count <= run.first) ++s;
    for (auto value = run.first; value < run.first + run.count; ++value) {
      const float around = meanAround(sides[s], value - sides[s].first_value, room);
      if (around > 0.0F && parts_.system.leafAreas()[value] > 0.0F) unsure.emplace_back(around, value);
    }
  }
  for (const auto& run : leaves) std::fill_n(&room[run.first], run.count, 0.0F);
  std::ranges::sort(unsure);
  double left = 0.0;
  std::vector<LeafLook> looks;
  for (const auto& [around, value] : unsure) {
    left += static_cast<double>(around);
    if (left > wanted) looks.push_back({value, {}});
  }
  std::ranges::sort(looks, {}, &LeafLook::value);
  return looks;
}

void RoughLights::takeLooks(Repair& repair, std::span<const LinkColumn::ValueRun> leaves,
                            std::span<const LeafLook> looks, std::span<float> room) const {
  const auto& column = parts_.system.shooters()[repair.shooter].column[repair.half];
  for (const auto& run : leaves) {
    const auto links = room.subspan(run.first, run.count);
    if (!column.decode(run.first, links)) continue;
    for (auto& link : links) link /= static_cast<float>(column.gain());
  }
  for (const auto& look : looks)
    repair.by_points.push_back({look.value, std::exchange(room[look.value], *look.link[repair.half])});
  std::ranges::sort(repair.by_points, {}, &Repair::LeafLink::value);
  parts_.system.replaceLinks(repair.shooter, repair.half, leaves, room, column.totals());
  for (const auto& run : leaves) std::fill_n(&room[run.first], run.count, 0.0F);
}

}  // namespace radiosity::solver
