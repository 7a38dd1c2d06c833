#include "server/scene/side_colours.h"

#include <algorithm>
#include <utility>

#include "common/check.h"
#include "server/scene/patch_scene.h"

namespace radiosity::scene {

SideColours::Shared SideColours::one(const glm::vec3& colour) {
  return std::make_shared<const std::vector<glm::vec3>>(1, colour);
}

SideColours::SideColours(const PatchScene& patches) {
  const Shared black = one(glm::vec3(0.0F));
  for (const auto& surface : patches.surfaces) {
    const auto nodes = levelGrid(surface.width, surface.height, surface.level_count).offset;
    for (const auto first : surface.first_node)
      if (first != kNone) sides_.push_back({first, nodes, black});
  }
}

std::size_t SideColours::sideOf(std::uint32_t node) const {
  const auto after = std::ranges::upper_bound(sides_, node, {}, &Side::first_node);
  RAD_CHECK(after != sides_.begin());
  return static_cast<std::size_t>(after - sides_.begin()) - 1;
}

glm::vec3 SideColours::operator[](std::uint32_t node) const {
  const auto s = sideOf(node);
  return side(s)[node - sides_[s].first_node];
}

/// Of a material that many sides are of there is one.
void SideColours::fill(std::size_t side, const glm::vec3& colour) {
  if (!last_filled_ || last_filled_->front() != colour) last_filled_ = one(colour);
  sides_[side].colours = last_filled_;
}

void SideColours::fill(const glm::vec3& colour) {
  const Shared shared = one(colour);
  for (auto& side : sides_) side.colours = shared;
}

void SideColours::scale(const glm::vec3& factor) {
  for (std::size_t s = 0; s < sides_.size(); ++s) {
    auto colours = *sides_[s].colours;
    for (auto& colour : colours) colour *= factor;
    sides_[s].colours = std::make_shared<const std::vector<glm::vec3>>(std::move(colours));
  }
}

void SideColours::assign(std::size_t side, std::vector<glm::vec3> colours) {
  RAD_CHECK(colours.size() == sides_[side].node_count && !colours.empty());
  if (std::ranges::all_of(colours, [&](const glm::vec3& colour) { return colour == colours[0]; }))
    return fill(side, colours[0]);
  sides_[side].colours = std::make_shared<const std::vector<glm::vec3>>(std::move(colours));
}

void SideColours::set(std::uint32_t node, const glm::vec3& colour) {
  const auto s = sideOf(node);
  const auto before = side(s);
  std::vector<glm::vec3> colours(sides_[s].node_count);
  for (std::size_t n = 0; n < colours.size(); ++n) colours[n] = before[n];
  colours[node - sides_[s].first_node] = colour;
  assign(s, std::move(colours));
}

bool SideColours::operator==(const SideColours& other) const {
  return std::ranges::equal(sides_, other.sides_, [](const Side& a, const Side& b) {
    return a.first_node == b.first_node && a.node_count == b.node_count &&
           (a.colours == b.colours || *a.colours == *b.colours);
  });
}

}  // namespace radiosity::scene
