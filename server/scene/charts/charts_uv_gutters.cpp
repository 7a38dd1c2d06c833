// Whether islands of a file's own layout are so close that light would bleed from one into another.
#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <span>
#include <tuple>
#include <vector>

#include "common/task.h"
#include "server/geometry/triangle_rows.h"
#include "server/scene/charts/atlas.h"
#include "server/scene/charts/build.h"
#include "server/scene/charts/charts.h"

namespace radiosity::scene {
namespace {

using Triangle2 = std::array<glm::dvec2, 3>;

/// A bilinear lookup reads texels whose middles are less than one texel away along either axis. At the very end of that
/// their weight is nothing.
constexpr double kLookupReach = 0.999;
/// Islands that continue each other put the same place of the surface at a texel to within so many texels.
constexpr double kSamePlaceTexels = 1.0;

/// Rows of triangles that are looked at, and pairs of these a row, in the mean: layouts of a million triangles have
/// fewer. Slivers from end to end of a page would take gigabytes, and such a layout is of no use.
constexpr std::size_t kMostSpans = std::size_t{1} << 23U, kPairsASpan = 32;

/// Texels of a row that lookups on a triangle read.
struct Span {
  std::int32_t row, first, last;
  std::uint32_t chart, triangle;  ///< triangle: of its chart
};

std::int32_t firstIndex(double low) { return static_cast<std::int32_t>(std::ceil(low - kLookupReach - 0.5)); }
std::int32_t lastIndex(double high) { return static_cast<std::int32_t>(std::floor(high + kLookupReach - 0.5)); }

class Islands {
 public:
  /// All of one instance.
  Islands(const FlatScene& flat, std::span<const Chart> charts, double texel, const ChartOptions& options)
      : flat_(flat), charts_(charts) {
    double uv_area = 0.0, area = 0.0;
    glm::dvec2 low(std::numeric_limits<double>::infinity()), high(-low);
    for (const Chart& chart : charts) {
      area += chart.area;
      for (const auto& t : chart.corners) {
        const glm::dvec2 a = t[1] - t[0], b = t[2] - t[0];
        uv_area += 0.5 * std::abs(a.x * b.y - a.y * b.x);
        for (const auto& corner : t) {
          low = glm::min(low, corner);
          high = glm::max(high, corner);
        }
      }
    }
    const double density = std::sqrt(uv_area / area);
    resolution_ = uvResolution(high - low, texel, density, options);
    texel_ = 1.0 / (resolution_ * density);
  }

  /// O(n log n) for texels and triangles together. Also true where that would be too much to look at.
  [[nodiscard]] bool bleed() const {
    auto spans = allSpans();
    if (spans.size() > kMostSpans) return true;
    auto left = kPairsASpan * spans.size();
    std::ranges::sort(spans, [](const Span& a, const Span& b) {
      return std::tie(a.row, a.first, a.chart, a.triangle) < std::tie(b.row, b.first, b.chart, b.triangle);
    });
    std::vector<const Span*> open;  // of each chart the one that ends last
    for (const Span& span : spans) {
      interruptionPoint();
      if (left < open.size()) return true;
      left -= open.size();
      std::erase_if(open, [&](const Span* other) { return other->row != span.row || other->last < span.first; });
      bool own = false;
      for (const Span*& other : open) {
        if (other->chart == span.chart) {
          own = true;
          if (other->last < span.last) other = &span;
        } else if (!continues(*other, span)) {
          return true;
        }
      }
      if (!own) open.push_back(&span);
    }
    return false;
  }

 private:
  /// Some of them where they are more than kMostSpans.
  [[nodiscard]] std::vector<Span> allSpans() const {
    std::vector<Span> spans;
    for (std::uint32_t c = 0; c < charts_.size(); ++c)
      for (std::uint32_t i = 0; i < charts_[c].corners.size(); ++i) {
        interruptionPoint();
        Triangle2 t = charts_[c].corners[i];
        for (auto& corner : t) corner *= resolution_;
        const auto [low, high] = std::minmax({t[0].y, t[1].y, t[2].y});
        for (auto row = firstIndex(low); row <= lastIndex(high); ++row) {
          const auto extent = extentWithin(t, row + 0.5 - kLookupReach, row + 0.5 + kLookupReach);
          if (extent.x > extent.y) continue;
          if (spans.size() > kMostSpans) return spans;
          spans.push_back({row, firstIndex(extent.x), lastIndex(extent.y), c, i});
        }
      }
    return spans;
  }

  [[nodiscard]] std::array<glm::dvec3, 3> positionsOf(const Span& span) const {
    const FlatTriangle& triangle = flat_.triangles[charts_[span.chart].triangles[span.triangle]];
    return {flat_.points[triangle.points[0]], flat_.points[triangle.points[1]], flat_.points[triangle.points[2]]};
  }
  [[nodiscard]] const Triangle2& cornersOf(const Span& span) const {
    return charts_[span.chart].corners[span.triangle];
  }

  static glm::dvec3 weightsAt(const Triangle2& t, const glm::dvec2& p) {
    const auto cross = [](const glm::dvec2& a, const glm::dvec2& b) { return a.x * b.y - a.y * b.x; };
    const double twice = cross(t[1] - t[0], t[2] - t[0]);
    const double w1 = cross(p - t[0], t[2] - t[0]) / twice, w2 = cross(t[1] - t[0], p - t[0]) / twice;
    return {1.0 - w1 - w2, w1, w2};
  }
  static glm::dvec3 at(const std::array<glm::dvec3, 3>& positions, const glm::dvec3& w) {
    return positions[0] * w[0] + positions[1] * w[1] + positions[2] * w[2];
  }

  /// A texel that both read shows one place of one surface: what continues in UV does so in space, too.
  [[nodiscard]] bool continues(const Span& a, const Span& b) const {
    const auto normalOf = [&](const Span& s) { return flat_.triangles[charts_[s.chart].triangles[s.triangle]].normal; };
    if (glm::dot(normalOf(a), normalOf(b)) <= 0.0) return false;
    const glm::dvec2 middle = glm::dvec2(std::max(a.first, b.first) + 0.5, b.row + 0.5) / resolution_;
    return extends(a, b, middle) || extends(b, a, middle);
  }
  /// Whether the map of `a` gives for a place of `b` the position that it has.
  [[nodiscard]] bool extends(const Span& a, const Span& b, const glm::dvec2& middle) const {
    glm::dvec3 w = glm::max(weightsAt(cornersOf(b), middle), glm::dvec3(0.0));
    w /= w.x + w.y + w.z;
    const auto& uv = cornersOf(b);
    const auto there = at(positionsOf(b), w);
    const auto expected = at(positionsOf(a), weightsAt(cornersOf(a), uv[0] * w[0] + uv[1] * w[1] + uv[2] * w[2]));
    return glm::distance(there, expected) <= kSamePlaceTexels * texel_;
  }

  const FlatScene& flat_;
  std::span<const Chart> charts_;
  double resolution_ = 1.0;  ///< texels a unit of UV
  double texel_ = 1.0;       ///< unit box
};

}  // namespace

std::vector<std::uint32_t> bleedingLayouts(const Scene& scene, const FlatScene& flat, const std::vector<Chart>& charts,
                                           double texel, const ChartOptions& options) {
  std::vector<std::uint32_t> found;
  for (std::size_t first = 0, end = 0; first < charts.size(); first = end) {
    const auto instance = charts[first].instance;
    while (end < charts.size() && charts[end].instance == instance) ++end;
    if (!charts[first].from_file || end - first < 2) continue;
    const double own = texel / static_cast<double>(scene.instances[instance].texel_scale);
    if (Islands(flat, std::span(charts).subspan(first, end - first), own, options).bleed()) found.push_back(instance);
  }
  return found;
}

}  // namespace radiosity::scene
