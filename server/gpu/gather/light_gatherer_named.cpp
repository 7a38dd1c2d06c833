// LightGatherer for shots that want links to some receivers only: which these are, and what of a look can show them.
#include <algorithm>
#include <array>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "server/gpu/gather/light_gatherer.h"
#include "server/gpu/gather/receiver_places.h"

namespace radiosity::gpu {
namespace {

/// So many pixels around the places of named receivers are drawn: their own pixel's middle lies within, and those of
/// its neighbours, which receivers that want care ask too.
constexpr float kPixelsAround = 0.8F, kPixelsAroundMore = 2.2F;
/// So many receivers in a row, of one triangle, are looked at by the corners of their rectangle.
constexpr std::size_t kFewestAsOne = 5;

}  // namespace

/// The parts of groups that runs of leaves name.
template <typename Take>
void LightGatherer::forEachGroup(std::span<const solver::NodeRun> named, const Take& take) const {
  const auto& all = receivers_->all();
  auto group = receivers_->groups().begin();
  const auto end = receivers_->groups().end();
  for (const auto& run : named) {
    const auto before = [](const Receivers::Receiver& receiver, std::uint32_t node) { return receiver.node < node; };
    while (group != end && (group->count == 0 || all[group->first + group->count - 1].node < run.first_node)) ++group;
    for (auto part = group; part != end; ++part) {
      if (part->count == 0) continue;
      const auto first = all.begin() + static_cast<std::ptrdiff_t>(part->first);
      const auto last = first + static_cast<std::ptrdiff_t>(part->count);
      if (first->node >= run.first_node + run.count) break;
      const auto low = std::lower_bound(first, last, run.first_node, before);
      const auto high = std::lower_bound(low, last, run.first_node + run.count, before);
      if (low == high) continue;
      take(Receivers::Group{part->surface, static_cast<std::size_t>(low - all.begin()),
                            static_cast<std::size_t>(high - low), part->side, part->first_block});
    }
  }
}

/// The corners of the rectangle of some receivers of one triangle, all full, in the place of all places on them. False:
/// it reaches behind the polygon's plane.
bool LightGatherer::addCorners(const solver::GatherShot& shot, std::size_t first, std::size_t end) {
  const auto& all = receivers_->all();
  glm::vec2 low = all[first].texel, high = low;
  for (auto i = first + 1; i < end; ++i) {
    low = glm::min(low, all[i].texel);
    high = glm::max(high, all[i].texel);
  }
  high += 1.0F;
  const auto& frame = receivers_->patches().triangles[all[first].triangle];
  const std::array<glm::vec2, 4> texels{low, {high.x, low.y}, {low.x, high.y}, high};
  std::array<glm::vec3, 4> corners;
  for (std::size_t k = 0; k < 4; ++k) corners[k] = frame.origin + texels[k].x * frame.du + texels[k].y * frame.dv;
  const auto isBefore = [&](const glm::vec3& c) { return glm::dot(shot.normal, c - shot.corners[0]) > kInPlane; };
  if (!std::all_of(corners.begin(), corners.end(), isBefore)) return false;
  places_.insert(places_.end(), corners.begin(), corners.end());
  return true;
}

void LightGatherer::findWanted(const solver::GatherShot& shot, std::span<const solver::NodeRun> named) {
  places_.clear();
  pixels_around_ = kPixelsAround;
  forEachGroup(named, [&](const Receivers::Group& group) {
    const auto& surface = receivers_->patches().surfaces[group.surface];
    if (behind(shot, surface)) return;
    const auto ball = nearBall(std::span(shot.corners.data(), shot.corner_count), surface,
                               receivers_->patches().triangles[surface.first_triangle].du);
    const auto& all = receivers_->all();
    for (std::size_t i = group.first, end = i, last = i + group.count; i < last; i = end) {
      const auto joins = [&](const Receivers::Receiver& next) {
        return next.full && next.triangle == all[i].triangle && all[i].full;
      };
      for (end = i; end == i || (end < last && joins(all[end])); ++end) {
        if (receivers_->careOf(all[end]) != 0) pixels_around_ = kPixelsAroundMore;
      }
      if (end - i >= kFewestAsOne && surface.planar && addCorners(shot, i, end)) continue;
      for (auto k = i; k < end; ++k) {
        const auto take = [&](const Receivers::Place& place, float /*share*/) { places_.push_back(place.point); };
        forEachPlace(shot, ball, *receivers_, all[k], take, false, [](const auto& /*others*/) {});
      }
    }
  });
}

std::optional<ViewWindow> LightGatherer::windowOf(const solver::GatherShot& shot, const solver::HemicubeFrame& point,
                                                  std::span<const scene::ChangedBox> boxes) const {
  return windowAround(point, places_, boxes, pixels_around_ * 2.0F / static_cast<float>(shot.resolution));
}

void LightGatherer::beginLinks(const solver::GatherShot& shot, std::span<const solver::NodeRun> named) {
  if (named.empty()) {
    findLit(shot);
  } else {
    clearLit();
    forEachGroup(named, [&](const Receivers::Group& group) {
      if (!behind(shot, receivers_->patches().surfaces[group.surface])) findLitGroup(shot, group);
    });
    weighWhole(shot);
  }
  for (auto* sum : {&lit_.weight[0], &lit_.visible_weight[0]}) {
    std::fill_n(sum->begin(), lit_count_, 0.0F);
  }
  beginEdges();
  look_lost_ = {};
  open_looks_ = {};
  look_count_ = 0;
  asked_ = {};
}

}  // namespace radiosity::gpu
