#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "server/scene/lightmap/pages.h"

namespace radiosity::scene {
namespace {

constexpr int kSweeps = 12;
constexpr float kPointsATexel = 2.0F;
/// How much a texel gives way: gutter ones fully, visible ones little, and all the more the smaller they are beside
/// those on the other side. What is left of a face between others is a thousandth of a texel, and as uncertain: one
/// must not see its value beyond it.
constexpr float kMobile = 1.0F, kMobileVisible = 0.05F, kMostMobile = 1000.0F;

/// One bilinear lookup: four texels of a page.
struct Lookup {
  std::uint32_t page = 0;
  std::array<std::uint32_t, 4> texel{};
  std::array<float, 4> weight{};
  std::array<float, 4> reach{};  ///< weight times mobility
};

/// Two lookups that should agree.
struct Tie {
  std::array<Lookup, 2> side;
  float inverse_norm = 0.0F;  ///< of the weights, mobility included
};

class Stitcher {
 public:
  Stitcher(const PatchScene& patches, const std::vector<PageOwners>& owners, std::vector<LightmapPage>& pages)
      : patches_(patches), owners_(owners), pages_(pages) {}

  void run() {
    for (const PatchScene::Seam& seam : patches_.seams)
      for (std::size_t side = 0; side < 2; ++side) {
        const auto hasTexels = [&](std::uint32_t s) { return patches_.surfaces[s].first_node[side] != kNone; };
        if (std::ranges::all_of(seam.surface, hasTexels)) addTies(seam, side);
      }
    for (int sweep = 0; sweep < kSweeps; ++sweep)
      for (const Tie& tie : ties_) project(tie);
  }

 private:
  /// Of a texel on one side of a seam; `larger`: the texel's area on the side where they are larger.
  [[nodiscard]] float mobility(const Surface& surface, std::uint32_t page, std::uint32_t texel, float larger) const {
    const bool visible = owners_[page].ring[texel] == 0;
    const float coverage = visible ? pages_[page].coverage[texel] : 1.0F, area = surface.texel_area * coverage;
    const float smaller = area > 0.0F ? std::clamp(larger / area, 1.0F, kMostMobile) : 1.0F;
    return smaller * (visible ? kMobileVisible : kMobile);
  }

  /// False when the lookup would touch texels of another chart: those must not be pulled.
  bool lookUp(std::uint32_t surface, std::size_t side, const glm::vec2& texel, Lookup& lookup) const {
    const PagePlace& place = patches_.surfaces[surface].place[side];
    const Image& image = pages_[place.page].irradiance;
    const glm::vec2 at = texel + glm::vec2(place.x, place.y) - 0.5F;
    const glm::vec2 base = glm::floor(at);
    const glm::vec2 f = at - base;
    lookup.page = place.page;
    for (std::size_t k = 0; k < 4; ++k) {
      const int dx = static_cast<int>(k & 1U), dy = static_cast<int>(k >> 1U);
      const int x = std::clamp(static_cast<int>(base.x) + dx, 0, image.width - 1);
      const int y = std::clamp(static_cast<int>(base.y) + dy, 0, image.height - 1);
      lookup.weight[k] = (dx == 1 ? f.x : 1.0F - f.x) * (dy == 1 ? f.y : 1.0F - f.y);
      lookup.texel[k] = static_cast<std::uint32_t>(image.index(x, y));
      if (lookup.weight[k] > 1e-4F && owners_[place.page].owner[lookup.texel[k]] != ownerOf(surface, side))
        return false;
    }
    return true;
  }

  void addTies(const PatchScene::Seam& seam, std::size_t face) {
    const float length =
        std::max(glm::distance(seam.texel[0][0], seam.texel[0][1]), glm::distance(seam.texel[1][0], seam.texel[1][1]));
    const int count = std::max(1, static_cast<int>(std::ceil(length * kPointsATexel)));
    const float larger =
        std::max(patches_.surfaces[seam.surface[0]].texel_area, patches_.surfaces[seam.surface[1]].texel_area);
    for (int i = 0; i < count; ++i) {
      const float where = (static_cast<float>(i) + 0.5F) / static_cast<float>(count);
      Tie tie;
      float norm = 0.0F;
      bool usable = true;
      for (std::size_t s = 0; s < 2 && usable; ++s) {
        usable = lookUp(seam.surface[s], face, glm::mix(seam.texel[s][0], seam.texel[s][1], where), tie.side[s]);
        for (std::size_t k = 0; k < 4; ++k) {
          auto& lookup = tie.side[s];
          lookup.reach[k] =
              lookup.weight[k] * mobility(patches_.surfaces[seam.surface[s]], lookup.page, lookup.texel[k], larger);
          norm += lookup.weight[k] * lookup.reach[k];
        }
      }
      if (!usable || !(norm > 0.0F)) continue;
      tie.inverse_norm = 1.0F / norm;
      ties_.push_back(tie);
    }
  }

  [[nodiscard]] glm::vec3 valueOf(const Lookup& lookup) const {
    glm::vec3 sum(0.0F);
    for (std::size_t k = 0; k < 4; ++k)
      sum += pages_[lookup.page].irradiance.pixels[lookup.texel[k]] * lookup.weight[k];
    return sum;
  }

  void project(const Tie& tie) {
    const glm::vec3 step = (valueOf(tie.side[1]) - valueOf(tie.side[0])) * tie.inverse_norm;
    for (std::size_t s = 0; s < 2; ++s)
      for (std::size_t k = 0; k < 4; ++k) {
        const Lookup& lookup = tie.side[s];
        glm::vec3& value = pages_[lookup.page].irradiance.pixels[lookup.texel[k]];
        value = glm::max(value + step * (s == 0 ? lookup.reach[k] : -lookup.reach[k]), glm::vec3(0.0F));
      }
  }

  const PatchScene& patches_;
  const std::vector<PageOwners>& owners_;
  std::vector<LightmapPage>& pages_;
  std::vector<Tie> ties_;
};

}  // namespace

void stitchSeams(const PatchScene& patches, const std::vector<PageOwners>& owners, std::vector<LightmapPage>& pages) {
  Stitcher(patches, owners, pages).run();
}

}  // namespace radiosity::scene
