#include "server/scene/lightmap/texel_fit.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>

#include "common/check.h"
#include "common/parallel.h"
#include "server/scene/lightmap/pages.h"

namespace radiosity::scene {
namespace {

/// Places on a leaf that is seen in part, at most, that stand for what is seen of it.
constexpr std::uint32_t kPlaces = 32;
/// Of what lies beyond all neighbours, or for leaves seen in part of the range of these, so much stays.
constexpr float kBeyond = 0.5F, kBeyondInPart = 0.25F;
/// Texels that a thread is worth.
constexpr std::size_t kFittedAThread = 4096;

/// How much a lookup on the visible part of a leaf takes, on average, of the texels beside it.
struct Reach {
  float left = 0.125F, right = 0.125F, up = 0.125F, down = 0.125F;  // of a whole leaf
};

Reach reachOf(const PatchScene& patches, const LeafPoint& leaf, const glm::vec2& middle) {
  if (leaf.full) return {};
  Reach reach{0.0F, 0.0F, 0.0F, 0.0F};
  const std::uint32_t all = leaf.hasSpots() ? patches.spotCount(leaf) : 1, count = std::min(all, kPlaces);
  for (std::uint32_t k = 0; k < count; ++k) {
    const auto at = leaf.hasSpots() ? patches.spot(leaf, k * all / count).texel : leaf.texel;
    const auto off = glm::clamp(at - middle, -0.5F, 0.5F);
    (off.x < 0.0F ? reach.left : reach.right) += std::abs(off.x);
    (off.y < 0.0F ? reach.up : reach.down) += std::abs(off.y);
  }
  for (auto* part : {&reach.left, &reach.right, &reach.up, &reach.down}) *part /= static_cast<float>(count);
  return reach;
}

/// One side of a surface.
class SideFit {
 public:
  SideFit(const PatchScene& patches, const Surface& surface, std::size_t side, const LeafLight& light)
      : surface_(surface),
        first_(surface.first_node[side]),
        count_(surface.width * surface.height),
        mean_(std::span(light.mean).subspan(first_, count_)) {
    if (!light.difference.empty()) difference_ = std::span(light.difference).subspan(first_, count_);
    isKnown_ = trustedLeaves(patches, surface, side);
    reach_.resize(count_);
    for (std::uint32_t i = 0; i < count_; ++i) {
      const glm::vec2 middle(static_cast<float>(i % surface.width) + 0.5F,
                             static_cast<float>(i / surface.width) + 0.5F);
      if (isKnown_[i]) reach_[i] = reachOf(patches, patches.leaves[surface.first_leaf + i], middle);
    }
  }

  void run(const PatchScene& patches, std::span<glm::vec3> out) const {
    const auto share = shares();
    for (std::uint32_t i = 0; i < count_; ++i)
      if (isKnown_[i])
        out[i] = fitted(i, share.empty() ? 1.0F : share[i], patches.leaves[surface_.first_leaf + i].full);
  }

 private:
  [[nodiscard]] bool hasLeft(std::uint32_t i) const { return i % surface_.width > 0 && isKnown_[i - 1]; }
  [[nodiscard]] bool hasRight(std::uint32_t i) const {
    return i % surface_.width + 1 < surface_.width && isKnown_[i + 1];
  }
  [[nodiscard]] bool hasUp(std::uint32_t i) const { return i >= surface_.width && isKnown_[i - surface_.width]; }
  [[nodiscard]] bool hasDown(std::uint32_t i) const {
    return i + surface_.width < count_ && isKnown_[i + surface_.width];
  }

  /// Along one axis, of what lies before and behind; what is not known continues the slope of the other side.
  static glm::vec3 lookedUp(const glm::vec3& here, const glm::vec3* before, const glm::vec3* behind, float reach_before,
                            float reach_behind) {
    if (before == nullptr && behind == nullptr) return glm::vec3(0.0F);
    const auto to_behind = behind != nullptr ? *behind - here : here - *before;
    const auto to_before = before != nullptr ? *before - here : here - *behind;
    return reach_before * to_before + reach_behind * to_behind;
  }

  /// What the leaf's mean is more than that of lookups.
  [[nodiscard]] glm::vec3 lacking(std::span<const glm::vec3> value, std::uint32_t i) const {
    const Reach& reach = reach_[i];
    const auto width = surface_.width;
    return -lookedUp(value[i], hasLeft(i) ? &value[i - 1] : nullptr, hasRight(i) ? &value[i + 1] : nullptr, reach.left,
                     reach.right) -
           lookedUp(value[i], hasUp(i) ? &value[i - width] : nullptr, hasDown(i) ? &value[i + width] : nullptr,
                    reach.up, reach.down);
  }

  /// Calls visit(i) for a leaf and those around it.
  template <typename Visit>
  void around(std::uint32_t i, const Visit& visit) const {
    const std::uint32_t x = i % surface_.width, y = i / surface_.width;
    for (auto ny = y > 0 ? y - 1 : 0; ny <= std::min(y + 1, surface_.height - 1); ++ny)
      for (auto nx = x > 0 ? x - 1 : 0; nx <= std::min(x + 1, surface_.width - 1); ++nx)
        if (const auto n = ny * surface_.width + nx; isKnown_[n]) visit(n);
  }

  /// How much of what is lacking is light and not noise, told by a leaf and those around it. Empty: all.
  [[nodiscard]] std::vector<float> shares() const {
    if (difference_.empty()) return {};
    std::vector<glm::vec2> squares(count_, glm::vec2(0.0F));  // of what is lacking, and of that by noise
    for (std::uint32_t i = 0; i < count_; ++i) {
      if (!isKnown_[i]) continue;
      const auto all = lacking(mean_, i), noise = lacking(difference_, i);
      squares[i] = {glm::dot(all, all), 0.25F * glm::dot(noise, noise)};
    }
    std::vector<float> share(count_, 0.0F);
    for (std::uint32_t i = 0; i < count_; ++i) {
      glm::vec2 sum(0.0F);
      around(i, [&](std::uint32_t n) { sum += squares[n]; });
      if (sum.x > 0.0F) share[i] = std::max(0.0F, 1.0F - sum.y / sum.x);
    }
    return share;
  }

  [[nodiscard]] glm::vec3 fitted(std::uint32_t i, float share, bool whole) const {
    const auto wanted = mean_[i] + share * lacking(mean_, i);
    glm::vec3 least = mean_[i], most = mean_[i];
    around(i, [&](std::uint32_t n) {
      least = glm::min(least, mean_[n]);
      most = glm::max(most, mean_[n]);
    });
    const auto within = glm::clamp(wanted, least, most), range = kBeyondInPart * (most - least);
    const auto held = whole ? glm::mix(within, wanted, kBeyond) : glm::clamp(wanted, least - range, most + range);
    return glm::max(held, glm::vec3(0.0F));
  }

  const Surface& surface_;
  std::uint32_t first_, count_;
  std::span<const glm::vec3> mean_, difference_;
  std::vector<bool> isKnown_;
  std::vector<Reach> reach_;
};

}  // namespace

std::vector<glm::vec3> fitTexels(const PatchScene& patches, const LeafLight& light) {
  RAD_CHECK_EQ(light.mean.size(), patches.nodeCount());
  auto fitted = light.mean;
  if (light.is_shown_as_is) return fitted;
  std::size_t texels = 0;
  for (const auto& surface : patches.surfaces) texels += std::size_t{surface.width} * surface.height;
  const auto fit = [&](std::size_t s) {
    const auto& surface = patches.surfaces[s];
    for (std::size_t side = 0; side < 2; ++side) {
      if (surface.first_node[side] == kNone) continue;
      const std::span out(&fitted[surface.first_node[side]], std::size_t{surface.width} * surface.height);
      SideFit(patches, surface, side, light).run(patches, out);
    }
  };
  inTurns(patches.surfaces.size(), fit, texels / kFittedAThread);
  return fitted;
}

}  // namespace radiosity::scene
