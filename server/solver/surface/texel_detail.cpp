#include "server/solver/surface/texel_detail.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "server/solver/patches/side.h"

namespace radiosity::solver {
namespace {

/// Part of the square of how light bends that lookups are off by: where it bends evenly, and at the edge of a shadow.
constexpr double kEven = 0.003, kEdge = 0.08;
/// The error's square falls with these powers of the size of texels there.
constexpr double kEvenPower = 4.0, kEdgePower = 1.0;
/// One round makes texels at most so many times as fine, or as coarse: what they hide is known no better.
constexpr double kFinest = 8.0, kCoarsest = 0.5;
/// Texels are at most so many times as fine as PatchScene::texel, or as coarse.
constexpr double kMostDetail = 64.0, kLeastDetail = 0.5;
/// With fewer of them nothing would be known of what coarser ones hide.
constexpr double kFewTexels = 64.0;
/// So much of what is measured is texels' own at least, whatever noise there is said to be.
constexpr double kLeastOwn = 0.1;

/// Of one grid of texels, in all: area times the product of what the halves bend by, in which their noise cancels.
struct Bend {
  double sum = 0.0, area = 0.0;
  [[nodiscard]] double mean() const { return area > 0.0 ? sum / area : 0.0; }
};

/// Irradiance of the two halves, and area, of a side's leaves or of blocks of them.
struct Grid {
  std::uint32_t width = 0, height = 0;
  std::array<std::vector<glm::dvec3>, 2> light;
  std::vector<double> area;

  [[nodiscard]] std::size_t at(std::uint32_t x, std::uint32_t y) const { return std::size_t{y} * width + x; }

  /// Along one axis: of all that have a neighbour with area on either side.
  void addBends(std::uint32_t step_x, std::uint32_t step_y, Bend& bend) const {
    for (std::uint32_t y = step_y; y + step_y < height; ++y) {
      for (std::uint32_t x = step_x; x + step_x < width; ++x) {
        const auto here = at(x, y), before = at(x - step_x, y - step_y), after = at(x + step_x, y + step_y);
        if (area[here] <= 0.0 || area[before] <= 0.0 || area[after] <= 0.0) continue;
        const auto of = [&](std::size_t half) {
          return light[half][before] - 2.0 * light[half][here] + light[half][after];
        };
        bend.sum += area[here] * glm::dot(of(0), of(1));
        bend.area += area[here];
      }
    }
  }

  [[nodiscard]] Grid coarser() const {
    Grid coarse;
    coarse.width = (width + 1) / 2;
    coarse.height = (height + 1) / 2;
    const auto count = std::size_t{coarse.width} * coarse.height;
    coarse.area.assign(count, 0.0);
    for (auto& half : coarse.light) half.assign(count, glm::dvec3(0.0));
    for (std::uint32_t y = 0; y < height; ++y) {
      for (std::uint32_t x = 0; x < width; ++x) {
        const auto from = at(x, y), to = coarse.at(x / 2, y / 2);
        coarse.area[to] += area[from];
        for (std::size_t half = 0; half < 2; ++half) coarse.light[half][to] += area[from] * light[half][from];
      }
    }
    for (std::size_t i = 0; i < count; ++i) {
      if (coarse.area[i] <= 0.0) continue;
      for (auto& half : coarse.light) half[i] /= coarse.area[i];
    }
    return coarse;
  }
};

/// What is known of a surface, of both its sides.
struct Need {
  double texels = 0.0;                   ///< with area
  double detail = 1.0;                   ///< Surface::detail
  double square = 0.0;                   ///< area times irradiance squared
  std::array<Bend, 2> along, along_two;  ///< by axis; of texels, and of blocks of two by two
  double power = 0.0;                    ///< of the size of texels
  double error = 0.0;                    ///< area times the square of what lookups are off by

  /// Texels lie too few in a row to tell how light bends.
  [[nodiscard]] bool isNarrow() const { return along[0].area <= 0.0 && along[1].area <= 0.0; }
  [[nodiscard]] double bends() const {
    const double x = along[0].mean(), y = along[1].mean();
    if (along[0].area <= 0.0) return 2.0 * y;
    return along[1].area <= 0.0 ? 2.0 * x : x + y;
  }
  /// Only where both sizes tell.
  void addTo(double& fine, double& coarse) const {
    for (std::size_t axis = 0; axis < 2; ++axis) {
      if (along_two[axis].area <= 0.0) continue;
      fine += along[axis].sum;
      coarse += along_two[axis].sum;
    }
  }
};

double powerOf(double fine, double coarse, double otherwise) {
  if (!(fine > 0.0 && coarse > 0.0)) return otherwise;
  return std::clamp(std::log2(coarse / fine), kEdgePower, kEvenPower);
}

class DetailChooser {
 public:
  DetailChooser(const scene::PatchScene& patches, const TexelLight& light)
      : patches_(patches), light_(light), needs_(patches.surfaces.size()) {
    for (std::size_t s = 0; s < needs_.size(); ++s) {
      const auto& surface = patches.surfaces[s];
      needs_[s].detail = static_cast<double>(surface.detail);
      for (const auto node : surface.first_node)
        if (node != scene::kNone) look(surface, node, light, needs_[s]);
      square_ += needs_[s].square;
    }
    findPowers();
  }

  /// How much it is in all is measured: of surfaces that tell how light bends, and of all others. What lookups have of
  /// noise is told by the halves where they were made: of what each half is off by the product has none.
  void calibrate(std::span<const SurfaceError::Measured> measured) {
    std::array<double, 2> found{}, noise{}, expected{};
    for (const auto& place : measured) {
      const std::size_t kind = needs_[place.lookup.surface].isNarrow() ? 1 : 0;
      found[kind] += place.area * place.square;
      noise[kind] += place.area * noiseAt(place.lookup);
    }
    for (const auto& need : needs_) expected[need.isNarrow() ? 1 : 0] += need.isNarrow() ? need.square : need.error;
    for (auto& need : needs_) {
      const std::size_t kind = need.isNarrow() ? 1 : 0;
      const double own = std::max(found[kind] - noise[kind], kLeastOwn * found[kind]);
      const double part = expected[kind] > 0.0 && own > 0.0 ? own / expected[kind] : 0.0;
      need.error = part * (kind == 1 ? need.square : need.error);
    }
  }

  [[nodiscard]] TexelDetail choose(const DetailGoal& goal) const {
    const double allowed = goal.error * goal.error * square_;
    double low = 0.0, high = 1.0;
    const auto isEnough = [&](double gain) {
      const auto sums = sumsAt(gain);
      return sums.error <= allowed || sums.texels >= goal.most_texels;
    };
    while (!isEnough(high) && high < kMostGain) high *= 16.0;
    for (int i = 0; i < kSteps; ++i) {
      const double middle = low > 0.0 ? std::sqrt(low * high) : high / kMostGain;
      (isEnough(middle) ? high : low) = middle;
    }
    TexelDetail chosen;
    const double gain = sumsAt(high).texels > goal.most_texels && low > 0.0 ? low : high;
    for (const auto& need : needs_) chosen.of_surface.push_back(static_cast<float>(need.detail * detailAt(need, gain)));
    const auto sums = sumsAt(gain);
    chosen.error = relative(sums.error);
    double present = 0.0;
    for (const auto& need : needs_) present += need.error;
    chosen.present = relative(present);
    chosen.texels = sums.texels;
    return chosen;
  }

 private:
  static constexpr double kMostGain = 1e30;
  static constexpr int kSteps = 100;

  void look(const scene::Surface& surface, std::uint32_t node, const TexelLight& light, Need& need) const {
    Grid grid;
    grid.width = surface.width;
    grid.height = surface.height;
    const auto count = std::size_t{surface.width} * surface.height;
    for (std::size_t i = 0; i < count; ++i) {
      const auto area = static_cast<double>(patches_.node_area[node + i]);
      const glm::dvec3 one(light.first[node + i]), other(light.second[node + i]);
      grid.area.push_back(area);
      need.texels += area > 0.0 ? 1.0 : 0.0;
      grid.light[0].push_back(one);
      grid.light[1].push_back(other);
      need.square += area * glm::dot(one, other);
    }
    const auto coarse = grid.coarser();
    for (std::uint32_t axis = 0; axis < 2; ++axis) {
      grid.addBends(axis == 0 ? 1 : 0, axis, need.along[axis]);
      coarse.addBends(axis == 0 ? 1 : 0, axis, need.along_two[axis]);
    }
  }

  /// Square of the noise that a lookup has, and of what both halves are off by: between the middles of leaves, of those
  /// that have area. Fits make it larger where light bends (fitTexels), which is left out: they do where most of the
  /// bend is light.
  [[nodiscard]] double noiseAt(const SurfaceError::Lookup& lookup) const {
    const auto& surface = patches_.surfaces[lookup.surface];
    const auto middle = lookup.texel - 0.5F, low = glm::floor(middle), part = middle - low;
    const auto within = [](float at, std::uint32_t count) {
      return static_cast<std::uint32_t>(std::clamp(at, 0.0F, static_cast<float>(count - 1)));
    };
    glm::vec3 off(0.0F);
    float common = 0.0F, all = 0.0F;
    for (const auto& corner : {glm::vec2(0, 0), glm::vec2(1, 0), glm::vec2(0, 1), glm::vec2(1, 1)}) {
      const auto x = within(low.x + corner.x, surface.width), y = within(low.y + corner.y, surface.height);
      const auto node = surface.first_node[lookup.side] + std::size_t{y} * surface.width + x;
      if (patches_.node_area[node] <= 0.0F) continue;
      const auto weights = glm::mix(1.0F - part, part, corner);
      const float weight = weights.x * weights.y;
      off += weight * 0.5F * (light_.first[node] - light_.second[node]);
      if (!light_.common.empty()) common += weight * glm::dot(light_.common[node], glm::vec3(1.0F));
      all += weight;
    }
    return all > 0.0F ? static_cast<double>(glm::dot(off, off) / (all * all) + common / all) : 0.0;
  }

  void findPowers() {
    double fine = 0.0, coarse = 0.0;
    for (const auto& need : needs_) need.addTo(fine, coarse);
    const double usual = powerOf(fine, coarse, 0.5 * (kEdgePower + kEvenPower));
    for (std::size_t s = 0; s < needs_.size(); ++s) {
      auto& need = needs_[s];
      double of_fine = 0.0, of_coarse = 0.0;
      need.addTo(of_fine, of_coarse);
      need.power = powerOf(of_fine, of_coarse, usual);
      const double evenness = (need.power - kEdgePower) / (kEvenPower - kEdgePower);
      double area = 0.0;
      for (const auto node : patches_.surfaces[s].first_node) {
        if (node == scene::kNone) continue;
        const auto& surface = patches_.surfaces[s];
        area += static_cast<double>(
            patches_.node_area[node + scene::levelGrid(surface.width, surface.height, surface.level_count - 1).offset]);
      }
      need.error = area * std::max(0.0, need.bends()) * kEdge * std::pow(kEven / kEdge, evenness);
    }
  }

  [[nodiscard]] double relative(double error) const { return square_ > 0.0 ? std::sqrt(error / square_) : 0.0; }
  struct Sums {
    double error = 0.0, texels = 0.0;
  };
  /// `gain`: a texel more is worth what lowers the error by one in so many.
  /// Beside those that there are.
  [[nodiscard]] static double detailAt(const Need& need, double gain) {
    if (need.texels <= 0.0) return 1.0;
    const double finest = std::clamp(kMostDetail / need.detail, 1.0, kFinest);
    const double coarsest = need.texels >= kFewTexels ? std::clamp(kLeastDetail / need.detail, kCoarsest, 1.0) : 1.0;
    const auto with = [&](double power) {
      return std::pow(gain * power * need.error / need.texels, 1.0 / (power + 2.0));
    };
    const double finer = with(need.power);
    return finer >= 1.0 ? std::min(finer, finest) : std::clamp(with(kEvenPower), coarsest, 1.0);
  }
  /// Coarser texels begin to hide what these still show.
  [[nodiscard]] static double errorAt(const Need& need, double detail) {
    return need.error * std::pow(detail, detail < 1.0 ? -kEvenPower : -need.power);
  }
  [[nodiscard]] Sums sumsAt(double gain) const {
    Sums sums;
    for (const auto& need : needs_) {
      const double detail = detailAt(need, gain);
      sums.error += errorAt(need, detail);
      sums.texels += need.texels > 0.0 ? std::max(1.0, need.texels * detail * detail) : 0.0;
    }
    return sums;
  }

  const scene::PatchScene& patches_;
  TexelLight light_;
  std::vector<Need> needs_;  ///< by surface
  double square_ = 0.0;      ///< area times irradiance squared, of all
};

}  // namespace

TexelDetail chooseDetail(const scene::PatchScene& patches, const TexelLight& light,
                         std::span<const SurfaceError::Measured> measured, const DetailGoal& goal) {
  DetailChooser chooser(patches, light);
  chooser.calibrate(measured);
  return chooser.choose(goal);
}

}  // namespace radiosity::solver
