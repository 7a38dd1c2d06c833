#include "server/engine/lit/carried_light.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <map>
#include <optional>
#include <type_traits>
#include <utility>

#include "common/check.h"
#include "server/scene/values/lineage.h"

namespace radiosity::engine {
namespace {

using scene::kNone;
using scene::LightmapPage;
using scene::PatchScene;
using scene::Scene;

/// Mean over what is covered.
glm::vec3 meanOf(const std::vector<LightmapPage>& pages) {
  glm::dvec3 sum(0.0);
  double weight = 0.0;
  for (const auto& page : pages) {
    for (std::size_t i = 0; i < page.coverage.size(); ++i) {
      sum += glm::dvec3(page.irradiance.pixels[i]) * static_cast<double>(page.coverage[i]);
      weight += static_cast<double>(page.coverage[i]);
    }
  }
  return weight > 0.0 ? glm::vec3(sum / weight) : glm::vec3(0.0F);
}

/// Bilinear; pages are dilated, so a lookup anywhere on a chart is sound. `uv`: page coordinates in [0, 1].
glm::vec3 lookUp(const Image& image, glm::dvec2 uv) {
  const glm::dvec2 size(image.width, image.height);
  const glm::dvec2 at = glm::clamp(uv * size - 0.5, glm::dvec2(0.0), size - 1.0);
  const int x = static_cast<int>(at.x), y = static_cast<int>(at.y);
  const int x1 = std::min(x + 1, image.width - 1), y1 = std::min(y + 1, image.height - 1);
  const glm::vec2 f(at - glm::dvec2(x, y));
  return glm::mix(glm::mix(image.at(x, y), image.at(x1, y), f.x), glm::mix(image.at(x, y1), image.at(x1, y1), f.x),
                  f.y);
}

/// Weights of the second and third corner; nothing where the triangle has no area.
std::optional<glm::dvec2> weightsIn(const std::array<glm::vec2, 3>& corners, const glm::dvec2& point) {
  const glm::dvec2 a(corners[0]), u = glm::dvec2(corners[1]) - a, v = glm::dvec2(corners[2]) - a, p = point - a;
  const double area = u.x * v.y - u.y * v.x;
  if (std::abs(area) < 1e-14) return std::nullopt;
  return glm::dvec2((p.x * v.y - p.y * v.x) / area, (u.x * p.y - u.y * p.x) / area);
}

template <typename Vector>
auto between(const std::array<Vector, 3>& corners, const glm::dvec2& weights) {
  using Place = std::conditional_t<std::is_same_v<Vector, glm::vec2>, glm::dvec2, glm::dvec3>;
  const Place a(corners[0]);
  return a + weights.x * (Place(corners[1]) - a) + weights.y * (Place(corners[2]) - a);
}

/// A primitive, as a scene has it: perhaps cut.
struct Cut {
  const scene::Primitive* primitive;
  const scene::CutPrimitive* cut;  ///< null: it is whole

  [[nodiscard]] std::uint32_t sourceOf(std::uint32_t triangle) const {
    return cut != nullptr ? cut->source[triangle] : triangle;
  }
  [[nodiscard]] std::array<glm::dvec3, 3> corners(std::uint32_t triangle) const {
    const auto* index = &primitive->indices[std::size_t{3} * triangle];
    return {primitive->positions[index[0]], primitive->positions[index[1]], primitive->positions[index[2]]};
  }
};

/// Where places of a primitive lie in the same one as it was cut before.
class FormerCut {
 public:
  FormerCut(const Cut& before, const Cut& after) : before_(before), after_(after) {
    const auto count = before.primitive->indices.size() / 3;
    for (std::uint32_t t = 0; t < count; ++t) triangles_.emplace_back(before.sourceOf(t), t);
    std::ranges::sort(triangles_);
  }

  struct Place {
    std::uint32_t triangle;
    glm::dvec2 weights;  ///< of its second and third corner
  };
  /// The triangle that holds it, or comes nearest to that.
  [[nodiscard]] std::optional<Place> find(std::uint32_t triangle, const glm::dvec2& weights) const {
    const auto at = between(after_.corners(triangle), weights);
    const auto source = after_.sourceOf(triangle);
    std::optional<Place> best;
    double least = 0.0;
    const auto first = std::lower_bound(triangles_.begin(), triangles_.end(), std::pair(source, 0U));
    for (auto one = first; one != triangles_.end() && one->first == source; ++one) {
      const auto t = one->second;
      const auto [a, b, c] = before_.corners(t);
      const auto u = b - a, v = c - a, normal = glm::cross(u, v);
      const double area = glm::dot(normal, normal);
      if (!(area > 0.0)) continue;
      const glm::dvec2 found(glm::dot(glm::cross(at - a, v), normal) / area,
                             glm::dot(glm::cross(u, at - a), normal) / area);
      const double within = std::min({found.x, found.y, 1.0 - found.x - found.y});
      if (best && within <= least) continue;
      best = Place{t, found};
      least = within;
    }
    return best;
  }

 private:
  Cut before_, after_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>> triangles_;  ///< by the file's triangle
};

/// 1 up to `good`, 0 from `bad` on, smooth.
double shareBetween(double error, double good, double bad) {
  if (!(error < bad)) return 0.0;
  if (error <= good) return 1.0;
  const double t = std::log(bad / error) / std::log(bad / good);
  return t * t * (3.0 - 2.0 * t);
}

class Carrier {
 public:
  Carrier(const ShownScene& before, const Scene& scene, const PatchScene& patches)
      : before_(before),
        patches_(patches),
        mean_(meanOf(before.pages)),
        source_(scene::matchInstances(before.scene, scene)) {
    const auto cutOf = [](const Scene& of, const PatchScene& in, std::uint32_t instance) {
      return Cut{&in.cuts.primitiveOf(of, instance), in.cuts.find(instance)};
    };
    for (std::uint32_t i = 0; i < source_.size(); ++i) {
      if (source_[i] == kNone) continue;
      const auto now = cutOf(scene, patches, i), then = cutOf(before.scene, before.patches, source_[i]);
      const bool same = now.cut == nullptr || then.cut == nullptr ? now.cut == then.cut : *now.cut == *then.cut;
      if (!same) former_cuts_.emplace(i, FormerCut(then, now));
    }
  }

  [[nodiscard]] std::vector<LightmapPage> run() const {
    std::vector<glm::vec3> values(patches_.nodeCount(), mean_);
    for (const auto& surface : patches_.surfaces) {
      for (std::uint32_t leaf = 0; leaf < surface.width * surface.height; ++leaf) {
        for (std::size_t side = 0; side < 2; ++side) {
          const auto first = surface.first_node[side];
          if (first == kNone) continue;
          if (const auto value = carried(surface, leaf, side)) values[first + leaf] = *value;
        }
      }
    }
    return scene::assemblePages(patches_, values);
  }

 private:
  [[nodiscard]] std::optional<glm::vec3> carried(const scene::Surface& surface, std::uint32_t leaf,
                                                 std::size_t side) const {
    const auto& place = patches_.leaves[surface.first_leaf + leaf];
    const auto instance = source_[surface.instance];
    if (place.triangle == kNone || instance == kNone) return std::nullopt;
    const auto triangle = patches_.triangle_source[place.triangle];
    const std::size_t of_file = surface.flipped ? 1 - side : side;
    const auto& at = surface.place[side];
    const auto& page = patches_.pages[at.page];
    const glm::dvec2 uv = (glm::dvec2(place.texel) + glm::dvec2(at.x, at.y)) / glm::dvec2(page.width, page.height);
    const auto& uvs = patches_.instance_uvs[surface.instance].side[of_file];
    const auto weights = weightsIn(uvs.corners[triangle], uv);
    if (!weights) return std::nullopt;
    std::optional<FormerCut::Place> then{{triangle, *weights}};
    if (const auto found = former_cuts_.find(surface.instance); found != former_cuts_.end())
      then = found->second.find(triangle, *weights);
    const auto& old_uvs = before_.patches.instance_uvs[instance].side[of_file];
    if (!then || !old_uvs.shows(then->triangle)) return std::nullopt;
    const auto old_uv = between(old_uvs.corners[then->triangle], then->weights);
    return lookUp(before_.pages[old_uvs.page[then->triangle]].irradiance, old_uv);
  }

  const ShownScene& before_;
  const PatchScene& patches_;
  glm::vec3 mean_;
  std::vector<std::uint32_t> source_;               ///< by instance of the new scene: the old one, or kNone
  std::map<std::uint32_t, FormerCut> former_cuts_;  ///< by instance of the new scene: such as are cut otherwise now
};

}  // namespace

std::vector<LightmapPage> carryLight(const ShownScene& before, const Scene& scene, const PatchScene& patches) {
  return Carrier(before, scene, patches).run();
}

double newLightShare(double error, double target_error) {
  // An edit seldom changes more than a third of the light of what it leaves in place; above that the old is nearer.
  const double good = std::max(0.05, target_error);
  return shareBetween(error, good, std::max(0.3, 4.0 * good));
}

double refinedLightShare(double error, double old_error) {
  constexpr double kNoisy = 2.0;  // so many times as far off, noise is seen before what is sharper
  return shareBetween(error, old_error, kNoisy * old_error);
}

std::vector<LightmapPage> replacePart(std::vector<LightmapPage> shown, const std::vector<LightmapPage>& part,
                                      const std::vector<LightmapPage>& fresh) {
  RAD_CHECK_EQ(part.size(), shown.size());
  RAD_CHECK_EQ(fresh.size(), shown.size());
  for (std::size_t p = 0; p < shown.size(); ++p) {
    auto& pixels = shown[p].irradiance.pixels;
    RAD_CHECK_EQ(part[p].irradiance.pixels.size(), pixels.size());
    RAD_CHECK_EQ(fresh[p].irradiance.pixels.size(), pixels.size());
    for (std::size_t i = 0; i < pixels.size(); ++i)
      pixels[i] = glm::max(pixels[i] - part[p].irradiance.pixels[i] + fresh[p].irradiance.pixels[i], 0.0F);
  }
  return shown;
}

std::vector<LightmapPage> blendPages(const std::vector<LightmapPage>& carried, std::vector<LightmapPage> fresh,
                                     double share) {
  RAD_CHECK_EQ(carried.size(), fresh.size());
  for (std::size_t p = 0; p < fresh.size(); ++p) {
    auto& pixels = fresh[p].irradiance.pixels;
    RAD_CHECK_EQ(carried[p].irradiance.pixels.size(), pixels.size());
    for (std::size_t i = 0; i < pixels.size(); ++i)
      pixels[i] = glm::mix(carried[p].irradiance.pixels[i], pixels[i], static_cast<float>(share));
  }
  return fresh;
}

}  // namespace radiosity::engine
