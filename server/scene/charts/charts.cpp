#include "server/scene/charts/charts.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <optional>
#include <unordered_map>
#include <utility>

#include "common/parallel.h"
#include "server/scene/burial/burial_record.h"
#include "server/scene/burial/coverage.h"
#include "server/scene/burial/solid_finder.h"
#include "server/scene/charts/atlas.h"
#include "server/scene/charts/build.h"
#include "server/scene/charts/wall_cutter.h"
#include "server/scene/shading/emitters.h"
#include "server/scene/shading/lit_sides.h"
#include "server/scene/shading/opacity.h"
#include "server/scene/values/lineage.h"
#include "server/scene/values/material_of.h"

namespace radiosity::scene {
namespace {

/// A facet at least this many texels across stays a planar chart even beside smooth neighbours.
constexpr double kPlanarTexels = 8.0;
/// Curved charts may bend up to 45 degrees until they are this many texels large.
constexpr double kSmallTexels = 4.0;
/// Texels of the former scene are kept unless they are so many times too coarse, or too fine, for the budget.
constexpr double kCoarsest = 1.25;
/// Of the progress that is told: about a tenth of the time each, in a room of 300,000 triangles.
constexpr std::size_t kBuildSteps = 10;

class Builder {
 public:
  Builder(const Scene& scene, const ChartOptions& options, const FormerScene* former, const BurialRecord* record,
          const SideBits* sides = nullptr)
      : scene_(scene), options_(options), former_(former), record_(record), sides_(sides) {}

  /// Nothing: the former scene's unit box or texels do not suit.
  Result<std::optional<BuiltScene>> build() {
    if (former_ != nullptr) {
      const UnitFrame frame{former_->patches.centre, former_->patches.scale};
      if (frameFor(scene_, &frame) != frame) return std::nullopt;
      flat_ = flatten(scene_, frame);
    } else {
      flat_ = flatten(scene_, frameFor(scene_));
    }
    patches_.centre = flat_.centre;
    patches_.scale = flat_.scale;
    patches_.triangles_dropped = flat_.dropped;
    patches_.warnings = flat_.warnings;
    neighbours_ = edgeNeighbours(flat_);
    checkOwnLayouts();
    cutWalls();
    makeCharts();
    if (auto chosen = chooseSides(); !chosen) return tl::unexpected(chosen.error());
    patches_.texel = texelSize();
    if (former_ != nullptr && options_.texel_size_m <= 0.0) {
      const double ratio = former_->patches.texel / patches_.texel;
      if (ratio > kCoarsest || ratio < 1.0 / kCoarsest) return std::nullopt;
      patches_.texel = former_->patches.texel;
    }
    if (auto shared = shareDetail(); !shared) return tl::unexpected(shared.error());
    interruptionPoint(2, kBuildSteps);
    auto atlas = layOut(scene_, charts_, patches_.texel, options_, formerPlaces());
    if (!atlas) return tl::unexpected(atlas.error());
    atlas_ = std::move(*atlas);
    patches_.pages = atlas_.pages;
    patches_.black = atlas_.black;
    patches_.warnings.insert(patches_.warnings.end(), atlas_.warnings.begin(), atlas_.warnings.end());
    for (std::uint32_t c = 0; c < charts_.size(); ++c) addSurface(c);
    if (auto sized = numberNodes(); !sized) return tl::unexpected(sized.error());
    std::vector<Hides> hides;
    for (Surface& surface : patches_.surfaces) {
      const Material& material = materialOf(scene_, surface);
      surface.see_through = isSeeThrough(material);
      const bool two_sided = surface.first_node[1] != kNone;
      hides.push_back(surface.see_through ? Hides::kNothing : two_sided ? Hides::kSheet : Hides::kSolid);
    }
    findEmitters(scene_, patches_);
    std::vector<LeafPiece> pieces;
    ClosedSolids solids;
    const auto measure = [&](std::size_t part) {  // each reads what the other does not write
      if (part == 0) pieces = measureCoverage(patches_);
      if (part == 1) solids = findClosedSolids(patches_);
    };
    doShares(2, ShareOfWork(measure));
    patches_.solids = std::move(solids);
    setTexelAreas();
    burial_ = removeBuried(patches_, pieces, hides, [&]() -> std::unique_ptr<const FormerBurial> {
      if (former_ == nullptr) return nullptr;
      surface_before_ = matchSurfaces(former_->scene, former_->patches, scene_, patches_);
      if (record_ == nullptr) return nullptr;
      return std::make_unique<const FormerBurial>(former_->patches, *record_, patches_, surface_before_, hides);
    });
    emptyHidden();
    interruptionPoint(7, kBuildSteps);
    placeSpots(patches_, pieces);
    if (former_ != nullptr) {
      placeSpotsInGaps(patches_, former_->patches, surface_before_);
    } else {
      placeSpotsInGaps(patches_);
    }
    patches_.spots.shrinkToFit();
    measureOpacity(scene_, patches_);
    applyOpacity(patches_);
    sumAncestors(patches_);
    writeInstanceUvs();
    auto normals = std::make_shared<const ShadingNormals>(scene_, patches_);
    findSeams(flat_, neighbours_, sources_, 2.0 * options_.curve_angle_deg, *normals, patches_);
    return BuiltScene{std::move(patches_), std::move(burial_), std::move(normals)};
  }

 private:
  /// Whether an instance's TEXCOORD_1 may be its layout, as far as it says itself.
  void checkOwnLayouts() {
    own_layout_.assign(scene_.instances.size(), false);
    for (std::uint32_t i = 0; i < scene_.instances.size(); ++i) {
      if (flat_.first_triangle[i] == flat_.first_triangle[i + 1]) continue;
      if (scene_.primitives[scene_.instances[i].primitive].texcoord1.empty()) continue;
      const std::string fault = lightmapUvFault(scene_, flat_, i);
      own_layout_[i] = fault.empty();
      if (!fault.empty())
        patches_.warnings.push_back(fmt::format("{}: TEXCOORD_1 is no lightmap layout ({}); charts were made instead",
                                                describeInstance(scene_, i), fault));
    }
  }

  void cutWalls() {
    facets_ = findFacets(flat_, neighbours_, std::vector<bool>(flat_.triangles.size(), true));
    patches_.cuts = cutAlongWalls(scene_, flat_, neighbours_, *facets_, roughTexel(), own_layout_);
    if (patches_.cuts.leavesSomeWhole())
      patches_.warnings.emplace_back(
          "faces meet more walls than a building has: some are not cut along them, so that light of one side may be "
          "seen on the other");
    if (patches_.cuts.empty()) return;
    facets_.reset();
    flat_ = flatten(scene_, {flat_.centre, flat_.scale}, patches_.cuts);
    neighbours_ = edgeNeighbours(flat_);
  }

  /// Charts of our own change the size of texels a little, and with it how far lookups reach: until none bleeds.
  void makeCharts() {
    constexpr int kMostRounds = 8;
    std::vector<std::uint32_t> replaced;
    for (int round = 1;; ++round) {
      chartAll();
      auto bleeding = round < kMostRounds ? bleedingNow() : allOwnLayouts();
      if (bleeding.empty()) break;
      for (const auto instance : bleeding) own_layout_[instance] = false;
      replaced.insert(replaced.end(), bleeding.begin(), bleeding.end());
    }
    if (replaced.empty()) return;
    flat_ = flatten(scene_, {flat_.centre, flat_.scale});  // these were left whole
    neighbours_ = edgeNeighbours(flat_);
    cutWalls();
    chartAll();
    const auto others = replaced.size() - 1;
    patches_.warnings.push_back(
        fmt::format("{}{}: islands of TEXCOORD_1 are so close that light would bleed between them at these texels; "
                    "charts were made "
                    "instead",
                    describeInstance(scene_, *std::ranges::min_element(replaced)),
                    others == 0 ? "" : fmt::format(" and {} other{}", others, others == 1 ? "" : "s")));
  }

  [[nodiscard]] std::vector<std::uint32_t> allOwnLayouts() const {
    std::vector<std::uint32_t> all;
    for (std::uint32_t i = 0; i < own_layout_.size(); ++i)
      if (own_layout_[i]) all.push_back(i);
    return all;
  }

  [[nodiscard]] std::vector<std::uint32_t> bleedingNow() const {
    if (allOwnLayouts().empty()) return {};
    const bool keeps_texel = former_ != nullptr && options_.texel_size_m <= 0.0;
    if (keeps_texel) return bleedingLayouts(scene_, flat_, charts_, former_->patches.texel, options_);
    // Texels are widest where both sides of all that is double-sided turn out to be lit.
    auto charts = charts_;
    for (Chart& chart : charts) chart.back_lit = materialOf(scene_, scene_.instances[chart.instance]).double_sided;
    const bool is_given = options_.texel_size_m > 0.0 || !options_.layout.empty();
    const double texel = is_given ? texelSize() : texelSizeFor(charts, options_.texel_budget);
    return bleedingLayouts(scene_, flat_, charts_, texel, options_);
  }

  void chartAll() {
    std::vector<bool> own(flat_.triangles.size(), true);
    std::vector<Chart> from_file;
    for (std::uint32_t i = 0; i < scene_.instances.size(); ++i) {
      if (!own_layout_[i]) continue;
      std::fill(own.begin() + flat_.first_triangle[i], own.begin() + flat_.first_triangle[i + 1], false);
      for (Chart& chart : uvCharts(scene_, flat_, neighbours_, i)) from_file.push_back(std::move(chart));
    }
    if (!facets_ || !from_file.empty()) facets_ = findFacets(flat_, neighbours_, own);
    const Facets facets = *std::exchange(facets_, std::nullopt);
    patches_.polygons = facets.facets.size() + from_file.size();
    const double texel = patches_.rough_texel = roughTexel();
    const auto groups = groupFacets(flat_, neighbours_, facets, kPlanarTexels * texel, kSmallTexels * texel * texel,
                                    options_.curve_angle_deg);
    charts_ = fitCharts(flat_, facets, groups);
    charts_.insert(charts_.end(), std::make_move_iterator(from_file.begin()), std::make_move_iterator(from_file.end()));
    std::ranges::stable_sort(charts_, {}, &Chart::instance);
  }

  /// Which sides of double-sided charts get patches: those that light can reach, or those that had some in another
  /// process.
  Result<void> chooseSides() {
    const SidedCharts sided{scene_, scene_.sky.value_or(options_.sky), patches_.rough_texel, patches_.cuts, flat_,
                            charts_};
    if (sides_ != nullptr) {
      if (auto taken = takeSides(sided, *sides_); !taken) return taken;
    } else {
      litSides(sided, former_, former_ != nullptr ? formerSurfaces() : std::vector<const Surface*>());
    }
    for (Chart& chart : charts_) chart.dark = chart.dark || flat_.triangles[chart.triangles.front()].hidden;
    if (std::ranges::any_of(charts_, &Chart::flipped)) neighbours_ = edgeNeighbours(flat_);
    return {};
  }

  /// Before there are charts: as if all area were covered by whole texels.
  [[nodiscard]] double roughTexelSize() const {
    if (!options_.layout.empty()) return options_.layout.rough_texel_m / flat_.scale;
    if (options_.texel_size_m > 0.0) return options_.texel_size_m / flat_.scale;
    double area = 0.0;
    for (const FlatTriangle& triangle : flat_.triangles) area += triangle.area;
    return std::sqrt(area / static_cast<double>(std::max<std::uint64_t>(options_.texel_budget, 1)));
  }

  [[nodiscard]] double roughTexel() const {
    return former_ != nullptr ? former_->patches.rough_texel : roughTexelSize();
  }

  [[nodiscard]] double texelSize() const {
    if (!options_.layout.empty()) return options_.layout.texel_m / flat_.scale;
    if (options_.texel_size_m > 0.0) return options_.texel_size_m / flat_.scale;
    return texelSizeFor(charts_, options_.texel_budget);
  }

  /// By chart: the surface that it was before an edit, or null.
  [[nodiscard]] std::vector<const Surface*> formerSurfaces() const {
    std::vector<const Surface*> former(charts_.size(), nullptr);
    if (former_ == nullptr) return former;
    const PatchScene& before = former_->patches;
    std::vector<std::vector<std::uint32_t>> surfaces(former_->scene.instances.size());
    for (std::uint32_t s = 0; s < before.surfaces.size(); ++s) surfaces[before.surfaces[s].instance].push_back(s);
    const auto source = matchInstances(former_->scene, scene_);
    for (std::size_t first = 0, end = 0; first < charts_.size(); first = end) {
      const std::uint32_t instance = charts_[first].instance, old_one = source[instance];
      while (end < charts_.size() && charts_[end].instance == instance) ++end;
      if (old_one == kNone) continue;
      InstanceCharts now{{}, patches_.cuts.find(instance) != nullptr}, then{{}, before.cuts.find(old_one) != nullptr};
      for (auto c = first; c < end; ++c)
        now.keys.push_back({patches_.cuts.sourceOf(instance, flat_.triangles[charts_[c].triangles.front()].source),
                            static_cast<std::uint32_t>(charts_[c].triangles.size())});
      for (const auto s : surfaces[old_one])
        then.keys.push_back({before.cuts.sourceOf(old_one, before.triangle_source[before.surfaces[s].first_triangle]),
                             before.surfaces[s].triangle_count});
      const auto match = matchCharts(then, now);
      for (auto c = first; c < end; ++c)
        if (match[c - first] != kNone) former[c] = &before.surfaces[surfaces[old_one][match[c - first]]];
    }
    return former;
  }

  /// What an edit left alone keeps the texels that it has.
  [[nodiscard]] Result<void> shareDetail() {
    const auto& given = options_.layout.detail;
    if (former_ == nullptr && !given.empty() && given.size() != charts_.size())
      return fail(ErrorCode::kInternal, "texels are wanted for other charts than the scene has");
    const auto former = formerSurfaces();
    for (std::size_t c = 0; c < charts_.size(); ++c) {
      if (former[c] != nullptr) charts_[c].detail = static_cast<double>(former[c]->detail);
      if (former_ == nullptr && !given.empty()) charts_[c].detail = static_cast<double>(given[c]);
    }
    shareDetailOfLayouts(charts_);
    return {};
  }

  [[nodiscard]] FormerPlaces formerPlaces() const {
    FormerPlaces places;
    if (former_ == nullptr) return places;
    places.pages = former_->patches.pages;
    places.black = former_->patches.black;
    for (const Surface* old_one : formerSurfaces()) {
      places.of_chart.emplace_back();
      if (old_one != nullptr) places.of_chart.back() = {old_one->place, old_one->width, old_one->height};
    }
    return places;
  }

  void addSurface(std::uint32_t c) {
    const Chart& chart = charts_[c];
    const ChartGrid& grid = atlas_.grids[c];
    const auto id = static_cast<std::uint32_t>(patches_.surfaces.size());
    Surface surface;
    surface.instance = chart.instance;
    surface.material = scene_.primitives[scene_.instances[chart.instance].primitive].material;
    surface.width = grid.width;
    surface.height = grid.height;
    surface.level_count = levelCount(grid.width, grid.height);
    surface.place = grid.place;
    surface.detail = static_cast<float>(chart.detail);
    surface.flipped = chart.flipped;
    surface.shows_back = chart.shows_back;
    surface.first_triangle = static_cast<std::uint32_t>(patches_.triangles.size());
    surface.triangle_count = static_cast<std::uint32_t>(chart.triangles.size());
    surface.planar = chart.planar;
    std::unordered_map<std::uint32_t, std::uint32_t> shared;  // welded point -> vertex, for planar charts of our own
    glm::vec3 low(std::numeric_limits<float>::infinity()), high(-low);
    for (std::size_t i = 0; i < chart.triangles.size(); ++i) {
      const FlatTriangle& triangle = flat_.triangles[chart.triangles[i]];
      const std::array<glm::dvec2, 3> texels = texelsOf(chart.corners[i], grid);
      const TriangleFrame frame = frameOf(chart, grid, triangle, texels);
      for (std::size_t k = 0; k < 3; ++k) {
        const glm::vec3 position(flat_.points[triangle.points[k]]);
        low = glm::min(low, position);
        high = glm::max(high, position);
        auto vertex = static_cast<std::uint32_t>(patches_.vertices.size());
        if (chart.planar && !chart.from_file) vertex = shared.try_emplace(triangle.points[k], vertex).first->second;
        if (vertex == patches_.vertices.size())
          patches_.vertices.push_back({position, id, glm::vec2(texels[k]), frame.normal});
        patches_.indices.push_back(vertex);
      }
      patches_.triangles.push_back(frame);
      patches_.triangle_surface.push_back(id);
      patches_.triangle_source.push_back(triangle.source);
      sources_.push_back(chart.triangles[i]);
    }
    surface.bounds_min = low;
    surface.bounds_max = high;
    patches_.surfaces.push_back(surface);
  }

  [[nodiscard]] static std::array<glm::dvec2, 3> texelsOf(const std::array<glm::dvec2, 3>& corners,
                                                          const ChartGrid& grid) {
    std::array<glm::dvec2, 3> texels;
    for (std::size_t k = 0; k < 3; ++k)
      texels[k] = glm::clamp(corners[k] * grid.texels_per_unit - grid.offset, glm::dvec2(0.0),
                             glm::dvec2(grid.width, grid.height));
    return texels;
  }

  /// Own charts: one texel step in the chart's plane, slid along the plane's normal onto the triangle; well-conditioned
  /// even for slivers. File's charts: the triangle's own inverse.
  [[nodiscard]] TriangleFrame frameOf(const Chart& chart, const ChartGrid& grid, const FlatTriangle& triangle,
                                      const std::array<glm::dvec2, 3>& texels) const {
    const glm::dvec3 p0 = flat_.points[triangle.points[0]];
    glm::dvec3 du, dv, normal = triangle.normal;
    if (chart.from_file) {
      const glm::dmat2 inverse = glm::inverse(glm::dmat2(texels[1] - texels[0], texels[2] - texels[0]));
      const glm::dvec3 e1 = flat_.points[triangle.points[1]] - p0, e2 = flat_.points[triangle.points[2]] - p0;
      du = e1 * inverse[0][0] + e2 * inverse[0][1];
      dv = e1 * inverse[1][0] + e2 * inverse[1][1];
    } else {
      if (chart.planar) normal = chart.normal;
      const double facing = glm::dot(normal, chart.normal);
      du = (chart.axis_u - chart.normal * (glm::dot(normal, chart.axis_u) / facing)) / grid.texels_per_unit.x;
      dv = (chart.axis_v - chart.normal * (glm::dot(normal, chart.axis_v) / facing)) / grid.texels_per_unit.y;
    }
    const glm::dvec3 origin = p0 - texels[0].x * du - texels[0].y * dv;
    return {glm::vec3(origin), glm::vec3(du), glm::vec3(dv), glm::vec3(normal)};
  }

  Result<void> numberNodes() {
    std::uint64_t leaves = 0, nodes = 0;
    for (std::uint32_t s = 0; s < patches_.surfaces.size(); ++s) {
      Surface& surface = patches_.surfaces[s];
      const LevelGrid last = levelGrid(surface.width, surface.height, surface.level_count - 1);
      const std::uint64_t per_side = std::uint64_t{last.offset} + 1;
      surface.first_leaf = static_cast<std::uint32_t>(leaves);
      leaves += std::uint64_t{surface.width} * surface.height;
      const int sides = charts_[s].back_lit ? 2 : 1;
      for (int side = 0; side < sides; ++side) {
        surface.first_node[static_cast<std::size_t>(side)] = static_cast<std::uint32_t>(nodes);
        nodes += per_side;
      }
      if (nodes >= (std::uint64_t{1} << 31))
        return fail(ErrorCode::kTooLarge, "more than 2^31 patches: ask for fewer or larger texels");
    }
    patches_.leaves.resize(leaves);
    patches_.node_area.resize(nodes, 0.0F);
    return {};
  }

  /// What lies under walls keeps nothing that could be lit: rounding takes places at its rim for such beside it.
  void emptyHidden() {
    for (std::uint32_t s = 0; s < patches_.surfaces.size(); ++s) {
      if (!flat_.triangles[charts_[s].triangles.front()].hidden) continue;
      const Surface& surface = patches_.surfaces[s];
      const auto leaves = std::size_t{surface.width} * surface.height;
      std::fill_n(patches_.leaves.begin() + surface.first_leaf, leaves, LeafPoint{});
      for (const auto first : surface.first_node)
        if (first != kNone) std::fill_n(patches_.node_area.begin() + first, leaves, 0.0F);
    }
  }

  /// Mean over the surface: exact where it is planar.
  void setTexelAreas() {
    for (Surface& surface : patches_.surfaces) {
      double area = 0.0, texels = 0.0;
      for (std::uint32_t t = surface.first_triangle; t < surface.first_triangle + surface.triangle_count; ++t) {
        std::array<glm::dvec2, 3> c;
        for (std::size_t k = 0; k < 3; ++k)
          c[k] = glm::dvec2(patches_.vertices[patches_.indices[std::size_t{3} * t + k]].texel);
        const glm::dvec2 a = c[1] - c[0], b = c[2] - c[0];
        texels += 0.5 * std::abs(a.x * b.y - a.y * b.x);
        area += flat_.triangles[sources_[t]].area;
      }
      surface.texel_area = static_cast<float>(texels > 0.0 ? area / texels : 0.0);
    }
  }

  void writeInstanceUvs() {
    patches_.instance_uvs.resize(scene_.instances.size());
    for (std::uint32_t t = 0; t < patches_.triangles.size(); ++t) {
      const Surface& surface = patches_.surfaces[patches_.triangle_surface[t]];
      for (std::size_t side = 0; side < 2; ++side) {
        if (side == 1 && !surface.shows_back) continue;
        const bool black = surface.place[side].page == kNone;
        writeUv(t, surface.flipped ? 1 - side : side, black ? patches_.black : surface.place[side], black);
      }
    }
    // Of an instance that is charted every triangle has an entry in front.
    for (std::size_t i = 0; i < scene_.instances.size(); ++i) reserveUvs(static_cast<std::uint32_t>(i), 0);
  }

  PatchScene::SideUv& reserveUvs(std::uint32_t instance, std::size_t side) {
    auto& uvs = patches_.instance_uvs[instance].side[side];
    const std::uint32_t primitive = scene_.instances[instance].primitive;
    const std::size_t count =
        primitive < scene_.primitives.size() ? patches_.cuts.primitiveOf(scene_, instance).indices.size() / 3 : 0;
    uvs.corners.resize(count);
    uvs.page.resize(count, kNone);
    return uvs;
  }

  /// `black`: the place is that of the black texels, and all of the triangle lies in their middle.
  void writeUv(std::uint32_t t, std::size_t side, const PagePlace& place, bool black) {
    const FlatTriangle& source = flat_.triangles[sources_[t]];
    const Page& page = patches_.pages[place.page];
    PatchScene::SideUv& uvs = reserveUvs(source.instance, side);
    uvs.page[source.source] = place.page;
    for (std::size_t k = 0; k < 3; ++k) {
      const glm::vec2 texel = black ? glm::vec2(0.5F * PatchScene::kBlackSide)
                                    : patches_.vertices[patches_.indices[std::size_t{3} * t + k]].texel;
      uvs.corners[source.source][source.source_corner[k]] =
          (texel + glm::vec2(place.x, place.y)) / glm::vec2(page.width, page.height);
    }
  }

  const Scene& scene_;
  const ChartOptions& options_;
  const FormerScene* former_;
  const BurialRecord* record_;
  const SideBits* sides_;  ///< null: light decides
  PatchScene patches_;
  std::shared_ptr<const BurialRecord> burial_;
  std::vector<std::uint32_t> surface_before_;  ///< after an edit, as of matchSurfaces()
  FlatScene flat_;
  std::vector<std::uint32_t> neighbours_;
  std::vector<bool> own_layout_;  ///< by instance: TEXCOORD_1 is its layout
  std::optional<Facets> facets_;  ///< of all triangles, until they are charted or cut
  std::vector<Chart> charts_;
  Atlas atlas_;
  std::vector<std::uint32_t> sources_;  ///< flat triangle of each patch triangle
};

}  // namespace

Result<BuiltScene> buildWithRecord(const Scene& scene, const ChartOptions& options, const FormerScene* former,
                                   const BurialRecord* record) {
  if (former != nullptr) {
    auto built = Builder(scene, options, former, record).build();
    if (!built) return tl::unexpected(built.error());
    if (*built) return std::move(**built);
  }
  auto built = Builder(scene, options, nullptr, nullptr).build();
  if (!built) return tl::unexpected(built.error());
  return std::move(**built);
}

Result<BuiltScene> buildAgain(const Scene& scene, const ChartOptions& options, const SideBits& sides) {
  auto built = Builder(scene, options, nullptr, nullptr, &sides).build();
  if (!built) return tl::unexpected(built.error());
  return std::move(**built);
}

Result<PatchScene> buildPatchScene(const Scene& scene, const ChartOptions& options, const FormerScene* former) {
  auto built = buildWithRecord(scene, options, former);
  if (!built) return tl::unexpected(built.error());
  return std::move(built->patches);
}

}  // namespace radiosity::scene
