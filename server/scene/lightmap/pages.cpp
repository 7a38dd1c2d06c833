#include "server/scene/lightmap/pages.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>

#include "common/check.h"
#include "common/parallel.h"

namespace radiosity::scene {
namespace {

constexpr float kMinVisible = 0.25F;  // below that a texel's own value is too little light to be trusted
constexpr std::uint8_t kMaxRing = 250;
/// Texels of surfaces that are made side by side before they take their places, and that a thread is worth.
constexpr std::size_t kTexelsAtOnce = std::size_t{1} << 18U, kTexelsAThread = 4096;

/// The texels of one side of a surface with a margin of gutter around them.
struct Patchwork {
  std::int64_t x0 = 0, y0 = 0;  ///< page texel of the buffer's first
  std::int64_t width = 0, height = 0;
  std::vector<glm::vec3> value;
  std::vector<float> visible;      ///< fraction; 0 in the margin
  std::vector<std::uint8_t> ring;  ///< 0: own value; kMaxRing: none yet
  [[nodiscard]] std::size_t at(std::int64_t x, std::int64_t y) const { return static_cast<std::size_t>(y * width + x); }
  [[nodiscard]] bool inside(std::int64_t x, std::int64_t y) const {
    return x >= 0 && y >= 0 && x < width && y < height;
  }
};

/// The margin that no other chart's margin overlaps: pages are packed with `gutter` texels between charts, and a
/// bilinear lookup on a chart reaches one texel beyond it at most.
constexpr std::int64_t kMargin = 1;

std::size_t texelsOf(const Surface& surface) {
  return (std::size_t{surface.width} + 2 * kMargin) * (surface.height + 2 * kMargin);
}

/// What is thin to the eye is no less well known.
float visiblePart(const Surface& surface, float area) {
  if (area <= 0.0F) return 0.0F;
  const bool whole = surface.see_through || surface.texel_area <= 0.0F;
  return whole ? 1.0F : std::min(1.0F, area / surface.texel_area);
}

Patchwork gather(const PatchScene& patches, const Surface& surface, std::size_t side,
                 std::span<const glm::vec3> values) {
  const PagePlace& place = surface.place[side];
  const Page& page = patches.pages[place.page];
  Patchwork p;
  p.x0 = std::max<std::int64_t>(0, std::int64_t{place.x} - kMargin);
  p.y0 = std::max<std::int64_t>(0, std::int64_t{place.y} - kMargin);
  p.width = std::min<std::int64_t>(page.width, std::int64_t{place.x} + surface.width + kMargin) - p.x0;
  p.height = std::min<std::int64_t>(page.height, std::int64_t{place.y} + surface.height + kMargin) - p.y0;
  const auto count = static_cast<std::size_t>(p.width * p.height);
  p.value.assign(count, glm::vec3(0.0F));
  p.visible.assign(count, 0.0F);
  p.ring.assign(count, kMaxRing);
  const auto trusted = trustedLeaves(patches, surface, side);
  for (std::uint32_t y = 0; y < surface.height; ++y)
    for (std::uint32_t x = 0; x < surface.width; ++x) {
      const std::uint32_t leaf = y * surface.width + x, node = surface.first_node[side] + leaf;
      const float area = patches.node_area[node];
      if (area <= 0.0F) continue;
      const std::size_t i = p.at(place.x + x - p.x0, place.y + y - p.y0);
      p.value[i] = values[node];
      p.visible[i] = visiblePart(surface, area);
      if (trusted[leaf]) p.ring[i] = 0;
    }
  return p;
}

/// Continues the slope from `near` (adjacent) and `far` (one further), held to half of the near value either way, so
/// that it is never negative and one noisy texel does not shoot off.
glm::vec3 extrapolate(const glm::vec3& near, const glm::vec3& far) {
  const glm::vec3 bound = 0.5F * glm::abs(near);
  return near + glm::clamp(near - far, -bound, bound);
}

/// What the neighbours of earlier rings say about an unknown texel that has such. Continued slopes count, plain copies
/// only where there is no slope to continue.
glm::vec3 fromNeighbours(const Patchwork& p, std::int64_t x, std::int64_t y, std::uint8_t ring) {
  glm::vec3 sloped(0.0F), plain(0.0F);
  float sloped_weight = 0.0F, plain_weight = 0.0F;
  for (std::int64_t dy = -1; dy <= 1; ++dy)
    for (std::int64_t dx = -1; dx <= 1; ++dx) {
      if ((dx == 0 && dy == 0) || !p.inside(x + dx, y + dy)) continue;
      const std::size_t near = p.at(x + dx, y + dy);
      if (p.ring[near] >= ring) continue;
      const float w = dx == 0 || dy == 0 ? 1.0F : 0.25F;
      plain += p.value[near] * w;
      plain_weight += w;
      if (ring != 1 || !p.inside(x + 2 * dx, y + 2 * dy)) continue;
      const std::size_t far = p.at(x + 2 * dx, y + 2 * dy);
      if (p.ring[far] != 0) continue;
      sloped += extrapolate(p.value[near], p.value[far]) * w;
      sloped_weight += w;
    }
  RAD_CHECK_LT(0.0F, plain_weight);
  return sloped_weight > 0.0F ? sloped / sloped_weight : plain / plain_weight;
}

/// Gives the unknown neighbours of `texels` their ring, and returns them.
std::vector<std::size_t> nextRing(Patchwork& p, const std::vector<std::size_t>& texels, std::uint8_t ring) {
  std::vector<std::size_t> next;
  for (const std::size_t i : texels) {
    const auto x = static_cast<std::int64_t>(i) % p.width, y = static_cast<std::int64_t>(i) / p.width;
    for (std::int64_t ny = std::max<std::int64_t>(0, y - 1); ny <= std::min(p.height - 1, y + 1); ++ny)
      for (std::int64_t nx = std::max<std::int64_t>(0, x - 1); nx <= std::min(p.width - 1, x + 1); ++nx) {
        const std::size_t n = p.at(nx, ny);
        if (p.ring[n] != kMaxRing) continue;
        p.ring[n] = ring;
        next.push_back(n);
      }
  }
  return next;
}

/// Ring by ring outward from texels with a value of their own; the first ring continues slopes, later ones copy. Each
/// texel is looked at once, however wide the gaps are.
void fillUnknown(Patchwork& p) {
  std::vector<std::size_t> texels;
  for (std::size_t i = 0; i < p.ring.size(); ++i)
    if (p.ring[i] == 0) texels.push_back(i);
  for (std::uint8_t ring = 1; ring < kMaxRing && !texels.empty(); ++ring) {
    texels = nextRing(p, texels, ring);
    for (const std::size_t i : texels) {
      interruptionPoint();
      const auto x = static_cast<std::int64_t>(i) % p.width, y = static_cast<std::int64_t>(i) / p.width;
      p.value[i] = fromNeighbours(p, x, y, ring);
    }
  }
}

class PageMaker {
 public:
  PageMaker(const PatchScene& patches, std::span<const glm::vec3> values) : patches_(patches), values_(values) {
    for (const Page& page : patches.pages) {
      const std::size_t count = std::size_t{page.width} * page.height;
      pages_.push_back(
          {Image(static_cast<int>(page.width), static_cast<int>(page.height)), std::vector<float>(count, 0.0F)});
      owners_.push_back({std::vector<std::uint32_t>(count, kNone), std::vector<std::uint8_t>(count, kMaxRing)});
    }
  }

  std::vector<LightmapPage> make(Seams seams) {
    for (std::uint32_t s = 0; s < patches_.surfaces.size(); ++s)
      for (std::size_t side = 0; side < 2; ++side)
        if (patches_.surfaces[s].first_node[side] != kNone) sides_.push_back({s, side});
    for (std::size_t first = 0, last = 0; first < sides_.size(); first = last) {
      std::size_t texels = 0;
      while (last < sides_.size() && texels < kTexelsAtOnce) texels += texelsOf(surfaceOf(sides_[last++]));
      placeAll(first, last, texels);
    }
    // Surfaces may cover each other here and there: once all have their places.
    for (const SideRef& of : sides_) {
      const auto covered = coveredOf(surfaceOf(of));
      if (std::ranges::none_of(covered, [&](const auto& one) { return one.side == of.side; })) continue;
      Patchwork p = gather(patches_, surfaceOf(of), of.side, values_);
      takeFromCovers(of, covered, p);
      fillUnknown(p);
      place(of, p);
    }
    placeBlack();
    if (seams == Seams::kStitched) stitchSeams(patches_, owners_, pages_);
    for (const SideRef& of : hidden_) placeHidden(of);
    for (std::size_t page = 0; page < pages_.size(); ++page) dilate(pages_[page], owners_[page]);
    return std::move(pages_);
  }

 private:
  struct SideRef {
    std::uint32_t surface;
    std::size_t side;
  };
  [[nodiscard]] const Surface& surfaceOf(const SideRef& of) const { return patches_.surfaces[of.surface]; }

  /// Texels of their own, which no neighbour is spread into.
  void placeBlack() {
    const PagePlace& black = patches_.black;
    if (black.page == kNone) return;
    const auto owner = static_cast<std::uint32_t>(2 * patches_.surfaces.size());
    for (std::uint32_t y = 0; y < PatchScene::kBlackSide; ++y)
      for (std::uint32_t x = 0; x < PatchScene::kBlackSide; ++x) {
        const auto at =
            pages_[black.page].irradiance.index(static_cast<int>(black.x + x), static_cast<int>(black.y + y));
        owners_[black.page].owner[at] = owner;
        pages_[black.page].coverage[at] = 1.0F;  // so that coarser mips stay black where they are
      }
  }

  [[nodiscard]] std::span<const PatchScene::Covered> coveredOf(const Surface& surface) const {
    const auto from = [&](std::uint32_t leaf) {
      return std::ranges::lower_bound(patches_.covered, leaf, {}, &PatchScene::Covered::leaf);
    };
    return {from(surface.first_leaf), from(surface.first_leaf + surface.width * surface.height)};
  }

  /// Of surfaces of so many texels in all: one after the other takes its place, so that all cores come to the same.
  void placeAll(std::size_t first, std::size_t last, std::size_t texels) {
    std::vector<Patchwork> made(last - first);
    const auto make = [&](std::size_t i) {
      const SideRef& of = sides_[first + i];
      made[i] = gather(patches_, surfaceOf(of), of.side, values_);
      fillUnknown(made[i]);
    };
    inTurns(made.size(), make, texels / kTexelsAThread);
    for (auto i = first; i < last; ++i) {
      place(sides_[i], made[i - first]);
      if (std::ranges::find(made[i - first].ring, 0) == made[i - first].ring.end()) hidden_.push_back(sides_[i]);
    }
  }

  /// Of what is wholly buried, or empty, nothing is known. It is black, and somebody's: gutters are dilated into what
  /// is nobody's, so that it would have the light of whatever lies beside it on the page. Not stitched: nobody sees the
  /// seam, and black would darken what is beside it.
  void placeHidden(const SideRef& of) {
    const Patchwork p = gather(patches_, surfaceOf(of), of.side, values_);
    PageOwners& owners = owners_[surfaceOf(of).place[of.side].page];
    const Image& page = pages_[surfaceOf(of).place[of.side].page].irradiance;
    for (std::int64_t y = p.y0; y < p.y0 + p.height; ++y)
      for (std::int64_t x = p.x0; x < p.x0 + p.width; ++x) {
        auto& owner = owners.owner[page.index(static_cast<int>(x), static_cast<int>(y))];
        if (owner == kNone) owner = ownerOf(of.surface, of.side);
      }
  }

  /// The light of leaves that other surfaces cover, whose charts have their places already.
  void takeFromCovers(const SideRef& of, std::span<const PatchScene::Covered> all, Patchwork& p) const {
    const Surface& surface = surfaceOf(of);
    const PagePlace& place = surface.place[of.side];
    for (const auto& covered : all) {
      if (covered.side != of.side) continue;
      const auto i = covered.leaf - surface.first_leaf;
      const auto to = p.at(place.x + i % surface.width - p.x0, place.y + i / surface.width - p.y0);
      p.value[to] = lookUp({covered.surface, covered.surface_side}, covered.texel);
      p.ring[to] = 0;
    }
  }

  /// Bilinear, within the chart.
  [[nodiscard]] glm::vec3 lookUp(const SideRef& of, const glm::vec2& texel) const {
    const Surface& surface = surfaceOf(of);
    const PagePlace& place = surface.place[of.side];
    const Image& page = pages_[place.page].irradiance;
    const glm::vec2 most(surface.width - 1, surface.height - 1);
    const glm::vec2 at = glm::clamp(texel - 0.5F, glm::vec2(0.0F), most);
    const glm::vec2 low = glm::floor(at), high = glm::min(low + 1.0F, most), part = at - low;
    const auto pixel = [&](float x, float y) {
      return page.pixels[page.index(static_cast<int>(place.x) + static_cast<int>(x),
                                    static_cast<int>(place.y) + static_cast<int>(y))];
    };
    return glm::mix(glm::mix(pixel(low.x, low.y), pixel(high.x, low.y), part.x),
                    glm::mix(pixel(low.x, high.y), pixel(high.x, high.y), part.x), part.y);
  }

  /// Where charts of a file's own layout share texels: the one that sees more of it wins, then the nearer.
  void place(const SideRef& of, const Patchwork& p) {
    const std::uint32_t page_id = surfaceOf(of).place[of.side].page, owner = ownerOf(of.surface, of.side);
    LightmapPage& page = pages_[page_id];
    PageOwners& owners = owners_[page_id];
    for (std::int64_t y = 0; y < p.height; ++y)
      for (std::int64_t x = 0; x < p.width; ++x) {
        const std::size_t from = p.at(x, y);
        if (p.ring[from] == kMaxRing) continue;
        const std::size_t to = page.irradiance.index(static_cast<int>(p.x0 + x), static_cast<int>(p.y0 + y));
        const bool better = owners.owner[to] == kNone || owners.owner[to] == owner ||
                            p.visible[from] > page.coverage[to] ||
                            (p.visible[from] == page.coverage[to] && p.ring[from] < owners.ring[to]);
        if (!better) continue;
        page.irradiance.pixels[to] = p.value[from];
        page.coverage[to] = p.visible[from];
        owners.owner[to] = owner;
        owners.ring[to] = p.ring[from];
      }
  }

  /// Plain dilation of what is left of the gutters, for coarser mips and imprecise lookups. After the first round only
  /// what lies beside what it found can come next.
  void dilate(LightmapPage& page, PageOwners& owners) const {
    constexpr int kRounds = 4;
    std::vector<std::size_t> empty;
    for (std::size_t i = 0; i < owners.owner.size(); ++i)
      if (owners.owner[i] == kNone) empty.push_back(i);
    for (int round = 0; round < kRounds && !empty.empty(); ++round) {
      std::vector<std::pair<std::size_t, glm::vec3>> found;
      for (const auto i : empty) {
        interruptionPoint();
        glm::vec3 sum(0.0F);
        float weight = 0.0F;
        aroundTexel(page.irradiance, i, [&](std::size_t n) {
          if (owners.owner[n] == kNone) return;
          sum += page.irradiance.pixels[n];
          weight += 1.0F;
        });
        if (weight > 0.0F) found.emplace_back(i, sum / weight);
      }
      empty.clear();
      for (const auto& [i, value] : found) {
        page.irradiance.pixels[i] = value;
        owners.owner[i] = kNone - 1;
      }
      for (const auto& [i, value] : found)
        aroundTexel(page.irradiance, i, [&](std::size_t n) {
          if (owners.owner[n] == kNone) empty.push_back(n);
        });
      std::ranges::sort(empty);
      empty.erase(std::unique(empty.begin(), empty.end()), empty.end());
    }
  }

  /// A texel and its neighbours.
  template <typename Take>
  static void aroundTexel(const Image& image, std::size_t i, const Take& take) {
    const int x = static_cast<int>(i) % image.width, y = static_cast<int>(i) / image.width;
    for (int ny = std::max(0, y - 1); ny <= std::min(image.height - 1, y + 1); ++ny)
      for (int nx = std::max(0, x - 1); nx <= std::min(image.width - 1, x + 1); ++nx) take(image.index(nx, ny));
  }

  const PatchScene& patches_;
  std::span<const glm::vec3> values_;
  std::vector<LightmapPage> pages_;
  std::vector<PageOwners> owners_;
  std::vector<SideRef> sides_;   ///< that have texels
  std::vector<SideRef> hidden_;  ///< of these, no texel has a value
};

}  // namespace

std::vector<bool> trustedLeaves(const PatchScene& patches, const Surface& surface, std::size_t side) {
  const std::uint32_t first = surface.first_node[side], count = surface.width * surface.height;
  float most = 0.0F;
  for (auto node = first; node < first + count; ++node)
    most = std::max(most, visiblePart(surface, patches.node_area[node]));
  // A chart of slivers has nothing better than what it has.
  const float enough = std::min(kMinVisible, most);
  std::vector<bool> trusted(count);
  for (std::uint32_t leaf = 0; leaf < count; ++leaf) {
    const float visible = visiblePart(surface, patches.node_area[first + leaf]);
    trusted[leaf] = visible > 0.0F && visible >= enough;
  }
  return trusted;
}

std::vector<LightmapPage> assemblePages(const PatchScene& patches, std::span<const glm::vec3> node_values,
                                        Seams seams) {
  RAD_CHECK_EQ(node_values.size(), patches.nodeCount());
  return PageMaker(patches, node_values).make(seams);
}

glm::vec3 lookUp(const PatchScene& patches, std::span<const LightmapPage> pages, std::uint32_t surface,
                 std::size_t side, const glm::vec2& texel) {
  const PagePlace& place = patches.surfaces[surface].place[side];
  const Image& page = pages[place.page].irradiance;
  const glm::vec2 most(page.width - 1, page.height - 1);
  const glm::vec2 at = glm::clamp(texel + glm::vec2(place.x, place.y) - 0.5F, glm::vec2(0.0F), most);
  const glm::vec2 low = glm::floor(at), high = glm::min(low + 1.0F, most), part = at - low;
  const auto pixel = [&](float x, float y) {
    return page.pixels[page.index(static_cast<int>(x), static_cast<int>(y))];
  };
  return glm::mix(glm::mix(pixel(low.x, low.y), pixel(high.x, low.y), part.x),
                  glm::mix(pixel(low.x, high.y), pixel(high.x, high.y), part.x), part.y);
}

LightmapPage coarserMip(const LightmapPage& page) {
  const int width = page.irradiance.width, height = page.irradiance.height;
  LightmapPage coarse;
  coarse.irradiance = Image(std::max(1, (width + 1) / 2), std::max(1, (height + 1) / 2));
  coarse.coverage.assign(coarse.irradiance.pixels.size(), 0.0F);
  for (int y = 0; y < coarse.irradiance.height; ++y)
    for (int x = 0; x < coarse.irradiance.width; ++x) {
      glm::vec3 seen(0.0F), plain(0.0F);
      float weight = 0.0F;
      int count = 0;
      for (int cy = 2 * y; cy < std::min(2 * y + 2, height); ++cy)
        for (int cx = 2 * x; cx < std::min(2 * x + 2, width); ++cx) {
          const std::size_t i = page.irradiance.index(cx, cy);
          seen += page.irradiance.pixels[i] * page.coverage[i];
          weight += page.coverage[i];
          plain += page.irradiance.pixels[i];
          ++count;
        }
      if (count == 0) continue;
      const std::size_t to = coarse.irradiance.index(x, y);
      coarse.irradiance.pixels[to] = weight > 0.0F ? seen / weight : plain / static_cast<float>(count);
      coarse.coverage[to] = weight / static_cast<float>(count);
    }
  return coarse;
}

}  // namespace radiosity::scene
