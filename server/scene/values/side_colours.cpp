#include "server/scene/values/side_colours.h"

#include <algorithm>
#include <utility>

#include "common/check.h"
#include "common/task.h"
#include "server/scene/values/patch_scene.h"

namespace radiosity::scene {

SideColours::Shared SideColours::one(const glm::vec3& colour) {
  return std::make_shared<const std::vector<glm::vec3>>(1, colour);
}

SideColours::SideColours(const PatchScene& patches) {
  const Shared black = one(glm::vec3(0.0F));
  std::vector<std::uint32_t> first_nodes;
  for (const auto& surface : patches.surfaces) {
    interruptionPoint();
    for (const auto first : surface.first_node)
      if (first != kNone) first_nodes.push_back(first);
  }
  colours_.assign(first_nodes.size(), black);
  first_nodes.push_back(static_cast<std::uint32_t>(patches.nodeCount()));
  first_nodes_ = std::make_shared<const std::vector<std::uint32_t>>(std::move(first_nodes));
}

std::size_t SideColours::sideOf(std::uint32_t node) const {
  const auto after = std::ranges::upper_bound(*first_nodes_, node);
  RAD_CHECK(after != first_nodes_->begin() && after != first_nodes_->end());
  return static_cast<std::size_t>(after - first_nodes_->begin()) - 1;
}

glm::vec3 SideColours::operator[](std::uint32_t node) const {
  const auto s = sideOf(node);
  return side(s)[node - (*first_nodes_)[s]];
}

/// Of a material that many sides are of there is one.
void SideColours::fill(std::size_t side, const glm::vec3& colour) {
  if (!last_filled_ || last_filled_->front() != colour) last_filled_ = one(colour);
  colours_[side] = last_filled_;
}

void SideColours::fill(const glm::vec3& colour) {
  const Shared shared = one(colour);
  for (auto& colours : colours_) colours = shared;
}

void SideColours::scale(const glm::vec3& factor) {
  for (auto& shared : colours_) {
    auto colours = *shared;
    for (auto& colour : colours) colour *= factor;
    shared = std::make_shared<const std::vector<glm::vec3>>(std::move(colours));
  }
}

void SideColours::assign(std::size_t side, std::vector<glm::vec3> colours) {
  RAD_CHECK(colours.size() == nodeCount(side) && !colours.empty());
  if (std::ranges::all_of(colours, [&](const glm::vec3& colour) { return colour == colours[0]; }))
    return fill(side, colours[0]);
  colours_[side] = std::make_shared<const std::vector<glm::vec3>>(std::move(colours));
}

void SideColours::set(std::uint32_t node, const glm::vec3& colour) {
  const auto s = sideOf(node);
  const auto before = side(s);
  std::vector<glm::vec3> colours(nodeCount(s));
  for (std::size_t n = 0; n < colours.size(); ++n) colours[n] = before[n];
  colours[node - (*first_nodes_)[s]] = colour;
  assign(s, std::move(colours));
}

bool SideColours::operator==(const SideColours& other) const {
  if (sideCount() == 0 || other.sideCount() == 0) return sideCount() == other.sideCount();
  return *first_nodes_ == *other.first_nodes_ &&
         std::ranges::equal(colours_, other.colours_,
                            [](const Shared& a, const Shared& b) { return a == b || *a == *b; });
}

}  // namespace radiosity::scene
