#include "server/scene/charts/atlas.h"

#include <fmt/format.h>
#include <stb_rect_pack.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <map>
#include <numeric>
#include <optional>
#include <unordered_map>

#include "common/check.h"
#include "common/memory_limit.h"
#include "common/task.h"
#include "server/scene/charts/build.h"
#include "server/scene/charts/page_space.h"
#include "server/scene/shading/lit_sides.h"

namespace radiosity::scene {
namespace {

double triangleArea(const std::array<glm::dvec2, 3>& t) {
  const glm::dvec2 a = t[1] - t[0], b = t[2] - t[0];
  return 0.5 * std::abs(a.x * b.y - a.y * b.x);
}

/// Measured with a whole server, a Cornell box: 0.2 GiB with 200,000 leaf patches, 1.0 GiB with 2,000,000. Links are
/// bounded elsewhere.
constexpr std::uint64_t kBytesOfLeaf = 512;

/// Cells of pages that are looked at for free places, times blocks to be placed.
constexpr std::uint64_t kMostLooks = std::uint64_t{1} << 27U;
/// Waste of so many texels is none.
constexpr double kSmallPage = 64.0 * 64.0;

std::uint32_t texelsAlong(double length, double texel) {
  return static_cast<std::uint32_t>(std::clamp(std::round(length / texel), 1.0, 1e9));
}

/// What is needed to predict how many leaves a chart covers at a given texel size, without rasterising it: of a random
/// grid's cells, a shape touches area + half of its outline's extent along either axis.
struct ChartMeasure {
  double area = 0.0;             ///< plane coordinates
  glm::dvec2 border{0.0};        ///< sum of |dx|, |dy| over outline edges that do not lie on the rectangle
  glm::dvec2 size{0.0};          ///< of the rectangle (file's charts: of the bounds)
  double units_per_length{1.0};  ///< plane coordinates a unit-box length
};

std::uint64_t edgeKey(std::uint32_t a, std::uint32_t b) {
  return (std::uint64_t{std::min(a, b)} << 32) | std::max(a, b);
}

/// Outline edges are those that occur once; found by the corners' coordinates, which neighbours share exactly.
ChartMeasure measure(const Chart& chart) {
  ChartMeasure result;
  glm::dvec2 low(std::numeric_limits<double>::infinity()), high(-std::numeric_limits<double>::infinity());
  std::map<std::pair<double, double>, std::uint32_t> ids;
  std::unordered_map<std::uint64_t, std::pair<int, std::array<glm::dvec2, 2>>> edges;
  for (const auto& t : chart.corners) {
    result.area += triangleArea(t);
    std::array<std::uint32_t, 3> id{};
    for (std::size_t c = 0; c < 3; ++c) {
      low = glm::min(low, t[c]);
      high = glm::max(high, t[c]);
      id[c] = ids.try_emplace({t[c].x, t[c].y}, static_cast<std::uint32_t>(ids.size())).first->second;
    }
    for (std::size_t e = 0; e < 3; ++e) {
      auto& edge = edges[edgeKey(id[e], id[(e + 1) % 3])];
      ++edge.first;
      edge.second = {t[e], t[(e + 1) % 3]};
    }
  }
  result.size = chart.from_file ? high - low : chart.size;
  for (const auto& [key, edge] : edges) {
    if (edge.first != 1) continue;
    const glm::dvec2 &a = edge.second[0], &b = edge.second[1];
    for (int axis = 0; axis < 2; ++axis) {
      const int across = 1 - axis;
      const double slack = 1e-6 * result.size[across];
      const auto on = [&](double side) {
        return std::abs(a[across] - side) < slack && std::abs(b[across] - side) < slack;
      };
      if (!chart.from_file && (on(0.0) || on(result.size[across]))) continue;
      result.border[axis] += std::abs(b[axis] - a[axis]);
    }
  }
  return result;
}

double predictedLeaves(const ChartMeasure& m, bool from_file, double texel) {
  if (from_file) {
    const double t = texel * m.units_per_length;
    return std::max(1.0, m.area / (t * t) + 0.5 * (m.border.x + m.border.y) / t);
  }
  const double w = texelsAlong(m.size.x, texel), h = texelsAlong(m.size.y, texel);
  const double covered =
      m.area / (m.size.x * m.size.y) * w * h + 0.5 * (m.border.x / m.size.x * w + m.border.y / m.size.y * h);
  return std::clamp(covered, 1.0, w * h);
}

/// Plane coordinates (UV) a unit-box length, over all of an instance's file charts.
std::unordered_map<std::uint32_t, double> uvDensities(const std::vector<Chart>& charts) {
  std::unordered_map<std::uint32_t, std::pair<double, double>> sums;
  for (const Chart& chart : charts) {
    interruptionPoint();
    if (!chart.from_file) continue;
    auto& [uv, world] = sums[chart.instance];
    for (const auto& t : chart.corners) uv += triangleArea(t);
    world += chart.area;
  }
  std::unordered_map<std::uint32_t, double> densities;
  for (const auto& [instance, sum] : sums) densities[instance] = std::sqrt(sum.first / sum.second);
  return densities;
}

/// One rectangle to pack: one side of a chart of our own, or of all charts of an instance that keeps its TEXCOORD_1
/// layout. Without charts: the black texels.
struct Block {
  std::uint32_t width = 1, height = 1;
  std::vector<std::uint32_t> charts;
  std::size_t side = 0;
  std::uint32_t page = 0, x = 0, y = 0;
};

class LayoutMaker {
 public:
  LayoutMaker(const Scene& scene, const std::vector<Chart>& charts, double texel, const ChartOptions& options,
              const FormerPlaces& former)
      : scene_(scene),
        charts_(charts),
        former_(former),
        options_(options),
        texel_(texel),
        gutter_(options.gutter),
        max_page_(mostPageTexels(options)),
        max_chart_(mostChartTexels(options)) {}

  Result<Atlas> make() {
    atlas_.grids.resize(charts_.size());
    const auto densities = uvDensities(charts_);
    for (std::uint32_t c = 0; c < charts_.size();) {
      if (charts_[c].from_file) {
        c = addRegion(c, densities.at(charts_[c].instance));
      } else {
        addChart(c++);
      }
    }
    addBlack();
    std::uint64_t leaves = 0;
    for (std::size_t c = 0; c < charts_.size(); ++c) {
      const std::uint64_t sides = charts_[c].back_lit ? 2 : 1;
      leaves += sides * atlas_.grids[c].width * atlas_.grids[c].height;
    }
    if (leaves > mostLeaves())
      return fail(ErrorCode::kTooLarge,
                  fmt::format("{} leaf patches, more than the {} that there is memory for: ask for "
                              "fewer or larger texels",
                              leaves, mostLeaves()));
    if (clamped_ > 0)
      atlas_.warnings.push_back(
          fmt::format("{} charts would be wider than a page of {} texels and got coarser texels (the first: {}); raise "
                      "the page size "
                      "or split the mesh",
                      clamped_, max_page_, first_clamped_));
    if (auto packed = packAll(); !packed) return tl::unexpected(packed.error());
    for (const Block& block : blocks_) {
      if (block.charts.empty()) atlas_.black = {block.page, block.x, block.y};
      for (const std::uint32_t c : block.charts) {
        auto& place = atlas_.grids[c].place[block.side];
        place = {block.page, place.x + block.x, place.y + block.y};
      }
    }
    return std::move(atlas_);
  }

 private:
  void noteClamped(std::uint32_t chart) {
    if (clamped_++ == 0) first_clamped_ = describeInstance(scene_, charts_[chart].instance);
  }

  /// The budget is shared out as if all scales were 1: one object's scale leaves the others as they are.
  [[nodiscard]] double texelOf(const Chart& chart) const {
    return texel_ / static_cast<double>(scene_.instances[chart.instance].texel_scale) / chart.detail;
  }

  void addChart(std::uint32_t c) {
    const Chart& chart = charts_[c];
    ChartGrid& grid = atlas_.grids[c];
    const double texel = texelOf(chart);
    if (!chart.dark || chart.size.x * chart.size.y <= kCoarse * texel * texel) {
      grid.width = texelsAlong(chart.size.x, texel);
      grid.height = texelsAlong(chart.size.y, texel);
    }
    if (grid.width > max_chart_ || grid.height > max_chart_) {
      noteClamped(c);
      grid.width = std::min(grid.width, max_chart_);
      grid.height = std::min(grid.height, max_chart_);
    }
    grid.texels_per_unit = glm::dvec2(grid.width, grid.height) / chart.size;
    blocks_.push_back({grid.width, grid.height, {c}});
    if (chart.back_lit) blocks_.push_back({grid.width, grid.height, {c}, 1});
  }

  void addBlack() {
    const auto needsBlack = [](const Chart& chart) { return chart.shows_back && !chart.back_lit; };
    if (std::ranges::any_of(charts_, needsBlack))
      blocks_.push_back({PatchScene::kBlackSide, PatchScene::kBlackSide, {}});
  }

  struct Bounds {
    glm::dvec2 low{std::numeric_limits<double>::infinity()}, high{-std::numeric_limits<double>::infinity()};
    void add(const Chart& chart) {
      for (const auto& t : chart.corners)
        for (const auto& p : t) {
          low = glm::min(low, p);
          high = glm::max(high, p);
        }
    }
  };

  /// Consecutive charts of one instance; returns the first chart after them.
  std::uint32_t addRegion(std::uint32_t first, double density) {
    Block block;
    Bounds all;
    std::uint32_t end = first;
    for (; end < charts_.size() && charts_[end].from_file && charts_[end].instance == charts_[first].instance; ++end) {
      all.add(charts_[end]);
      block.charts.push_back(end);
    }
    const double texel = texelOf(charts_[first]);
    const double resolution = uvResolution(all.high - all.low, texel, density, options_);
    if (resolution < 1.0 / (texel * density)) noteClamped(first);
    const glm::dvec2 origin = glm::floor(all.low * resolution + 1e-6);
    for (std::uint32_t c = first; c < end; ++c) {
      Bounds bounds;
      bounds.add(charts_[c]);
      const glm::dvec2 low = glm::max(glm::floor(bounds.low * resolution + 1e-6), origin);
      const glm::dvec2 high = glm::max(glm::ceil(bounds.high * resolution - 1e-6), low + 1.0);
      ChartGrid& grid = atlas_.grids[c];
      grid.width = static_cast<std::uint32_t>(high.x - low.x);
      grid.height = static_cast<std::uint32_t>(high.y - low.y);
      grid.texels_per_unit = glm::dvec2(resolution);
      grid.offset = low;
      for (auto& place : grid.place) {
        place.x = static_cast<std::uint32_t>(low.x - origin.x);
        place.y = static_cast<std::uint32_t>(low.y - origin.y);
      }
      block.width = std::max(block.width, grid.place[0].x + grid.width);
      block.height = std::max(block.height, grid.place[0].y + grid.height);
    }
    Block backs{block.width, block.height, {}, 1};
    std::ranges::copy_if(block.charts, std::back_inserter(backs.charts),
                         [&](std::uint32_t c) { return charts_[c].back_lit; });
    blocks_.push_back(std::move(block));
    if (!backs.charts.empty()) blocks_.push_back(std::move(backs));
    return end;
  }

  [[nodiscard]] bool packInto(std::vector<stbrp_rect>& rects, std::uint32_t width, std::uint32_t height) const {
    std::vector<stbrp_node> nodes(width);
    stbrp_context context;
    stbrp_init_target(&context, static_cast<int>(width), static_cast<int>(height), nodes.data(),
                      static_cast<int>(nodes.size()));
    return stbrp_pack_rects(&context, rects.data(), static_cast<int>(rects.size())) != 0;
  }

  Result<void> packAll() {
    std::vector<std::size_t> all(blocks_.size());
    std::iota(all.begin(), all.end(), std::size_t{0});
    if (former_.of_chart.empty()) return pack(all);
    atlas_.pages = former_.pages;
    const auto left = keepPlaces();
    if (auto packed = pack(left); !packed) return packed;
    dropEmptyPages();
    if (!isWasteful()) return {};
    atlas_.pages.clear();
    return pack(all);
  }

  /// Returns the blocks that found no place on the pages there are.
  std::vector<std::size_t> keepPlaces() {
    std::vector<PageSpace> space;
    for (const Page& page : atlas_.pages) space.emplace_back(page);
    std::vector<std::size_t> fresh, left;
    for (std::size_t i = 0; i < blocks_.size(); ++i) {
      if (takeFormer(blocks_[i])) {
        space[blocks_[i].page].take(outer(blocks_[i]));
      } else {
        fresh.push_back(i);
      }
    }
    std::ranges::stable_sort(fresh, std::greater{}, [&](std::size_t i) { return blocks_[i].height; });
    std::uint64_t looks = 0;  // what looking everywhere costs is bounded; a new page is always free
    for (const std::size_t i : fresh) {
      interruptionPoint();
      Block& block = blocks_[i];
      bool found = false;
      for (std::uint32_t p = 0; p < space.size() && !found; ++p) {
        if ((looks += space[p].cells()) > kMostLooks) break;
        const auto at = space[p].findFree(block.width + gutter_, block.height + gutter_);
        if (!at) continue;
        found = true;
        block.page = p;
        block.x = at->x + gutter_ / 2;
        block.y = at->y + gutter_ / 2;
        space[p].take(outer(block));
      }
      if (!found) left.push_back(i);
    }
    return left;
  }

  [[nodiscard]] TexelRect outer(const Block& block) const {
    return {block.x - gutter_ / 2, block.y - gutter_ / 2, block.width + gutter_, block.height + gutter_};
  }

  /// All its charts have the size they had, and lie to each other as they lay.
  bool takeFormer(Block& block) const {
    if (block.charts.empty() && !moveTo(former_.black, block)) return false;
    for (const std::uint32_t c : block.charts) {
      const auto& former = former_.of_chart[c];
      const ChartGrid& grid = atlas_.grids[c];
      const PagePlace &place = former.side[block.side], &inside = grid.place[block.side];
      if (former.width != grid.width || former.height != grid.height || place.page == kNone || place.x < inside.x ||
          place.y < inside.y)
        return false;
      const PagePlace here{place.page, place.x - inside.x, place.y - inside.y};
      const bool agrees = here == PagePlace{block.page, block.x, block.y};
      if ((c != block.charts.front() && !agrees) || !moveTo(here, block)) return false;
    }
    const TexelRect rect = outer(block);
    const Page& page = atlas_.pages[block.page];
    return rect.x + rect.width <= page.width && rect.y + rect.height <= page.height;
  }

  [[nodiscard]] bool moveTo(const PagePlace& place, Block& block) const {
    if (place.page == kNone || place.x < gutter_ / 2 || place.y < gutter_ / 2) return false;
    block.page = place.page;
    block.x = place.x;
    block.y = place.y;
    return true;
  }

  void dropEmptyPages() {
    std::size_t used = 0;
    for (const Block& block : blocks_) used = std::max<std::size_t>(used, block.page + 1);
    atlas_.pages.resize(used);
  }

  [[nodiscard]] bool isWasteful() const {
    double used = 0.0, all = 0.0;
    for (const Block& block : blocks_) used += static_cast<double>(block.width + gutter_) * (block.height + gutter_);
    for (const Page& page : atlas_.pages) all += static_cast<double>(page.width) * page.height;
    return all > 2.0 * used + kSmallPage;
  }

  /// The smallest near-square page that holds everything, or a page of the largest size and what is left over.
  Result<void> pack(const std::vector<std::size_t>& which) {
    std::vector<stbrp_rect> rects;
    for (const std::size_t i : which)
      rects.push_back({static_cast<int>(i), static_cast<int>(blocks_[i].width + gutter_),
                       static_cast<int>(blocks_[i].height + gutter_), 0, 0, 0});
    while (!rects.empty()) {
      if (atlas_.pages.size() >= kMaxPages)
        return fail(ErrorCode::kTooLarge,
                    fmt::format("more than {} lightmap pages of {} texels: ask for fewer or larger "
                                "texels, or for larger pages",
                                kMaxPages, max_page_));
      packPage(rects);
      commitPage(rects);
    }
    return {};
  }

  void packPage(std::vector<stbrp_rect>& rects) const {
    double area = 0.0;
    std::uint32_t widest = 0;
    for (const auto& rect : rects) {
      interruptionPoint();
      area += static_cast<double>(rect.w) * rect.h;
      widest = std::max({widest, static_cast<std::uint32_t>(rect.w), static_cast<std::uint32_t>(rect.h)});
    }
    const auto up = [](double v) { return (static_cast<std::uint32_t>(std::ceil(v)) + 3U) & ~3U; };
    auto side = std::max(up(std::sqrt(area)), up(widest));
    for (; side < max_page_; side = std::max(side + 4, up(side * 1.04)))
      if (packInto(rects, side, side)) return;
    static_cast<void>(packInto(rects, max_page_, max_page_));
  }

  void commitPage(std::vector<stbrp_rect>& rects) {
    const auto page = static_cast<std::uint32_t>(atlas_.pages.size());
    Page size;
    std::vector<stbrp_rect> left;
    for (const auto& rect : rects) {
      interruptionPoint();
      if (rect.was_packed == 0) {
        left.push_back(rect);
        continue;
      }
      Block& block = blocks_[static_cast<std::size_t>(rect.id)];
      block.page = page;
      block.x = static_cast<std::uint32_t>(rect.x) + gutter_ / 2;
      block.y = static_cast<std::uint32_t>(rect.y) + gutter_ / 2;
      size.width = std::max(size.width, static_cast<std::uint32_t>(rect.x + rect.w));
      size.height = std::max(size.height, static_cast<std::uint32_t>(rect.y + rect.h));
    }
    RAD_CHECK_LT(left.size(), rects.size());
    size.width = (size.width + 3U) & ~3U;
    size.height = (size.height + 3U) & ~3U;
    atlas_.pages.push_back(size);
    std::ranges::sort(left, [](const auto& a, const auto& b) { return a.id < b.id; });
    rects = std::move(left);
  }

  const Scene& scene_;
  const std::vector<Chart>& charts_;
  const FormerPlaces& former_;
  const ChartOptions& options_;
  double texel_;
  std::uint32_t gutter_, max_page_, max_chart_;
  Atlas atlas_;
  std::vector<Block> blocks_;
  std::uint64_t clamped_ = 0;
  std::string first_clamped_;
};

}  // namespace

std::uint64_t mostLeaves() { return std::min(kMaxLeaves, memoryLimitBytes() / 4 * 3 / kBytesOfLeaf); }

double texelSizeFor(const std::vector<Chart>& charts, std::uint64_t texel_budget) {
  std::vector<ChartMeasure> measures;
  const auto densities = uvDensities(charts);
  for (const Chart& chart : charts) {
    interruptionPoint();
    measures.push_back(measure(chart));
    if (chart.from_file) measures.back().units_per_length = densities.at(chart.instance);
  }
  const auto leavesAt = [&](double texel) {
    double sum = 0.0;
    for (std::size_t i = 0; i < charts.size(); ++i)
      sum += charts[i].dark
                 ? 1.0
                 : (charts[i].back_lit ? 2.0 : 1.0) * predictedLeaves(measures[i], charts[i].from_file, texel);
    return sum;
  };
  const auto budget = static_cast<double>(std::max<std::uint64_t>(texel_budget, 1));
  double fine = 1e-7, coarse = 4.0;
  for (int i = 0; i < 60; ++i) {
    const double middle = std::sqrt(fine * coarse);
    (leavesAt(middle) > budget ? fine : coarse) = middle;
  }
  return std::abs(leavesAt(fine) - budget) < std::abs(leavesAt(coarse) - budget) ? fine : coarse;
}

double uvResolution(const glm::dvec2& extent, double texel, double density, const ChartOptions& options) {
  return std::min(1.0 / (texel * density), (mostChartTexels(options) - 1.0) / std::max(extent.x, extent.y));
}

Result<Atlas> layOut(const Scene& scene, const std::vector<Chart>& charts, double texel_size,
                     const ChartOptions& options, const FormerPlaces& former) {
  return LayoutMaker(scene, charts, texel_size, options, former).make();
}

}  // namespace radiosity::scene
