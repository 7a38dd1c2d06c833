#include "server/solver/paper/patch_trees.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/solver/patches/unshot_pyramid.h"

namespace radiosity::solver {
namespace {

bool isNone(const Flux3& flux) { return flux[0] == 0 && flux[1] == 0 && flux[2] == 0; }

void add(Flux3& sum, const Flux3& flux) {
  for (std::size_t c = 0; c < flux.size(); ++c) sum[c] += flux[c];
}

glm::dvec3 scaled(const Flux3& flux, double scale) {
  return glm::dvec3(static_cast<double>(flux[0]), static_cast<double>(flux[1]), static_cast<double>(flux[2])) / scale;
}

}  // namespace

PatchTrees::PatchTrees(std::shared_ptr<const scene::PatchScene> patches, const scene::PatchMaterials& materials,
                       double other_flux)
    : patches_(std::move(patches)),
      materials_(materials),
      sides_(makeSides(*patches_)),
      unpushed_(patches_->nodeCount(), glm::dvec3(0.0)),
      irradiance_(unpushed_),
      unshot_(unpushed_),
      power_(patches_->nodeCount(), 0.0) {
  for (auto& side : sides_) {
    const auto& mean = materials_.reflectance.side(side.number)[side.node_count - 1];
    side.mean_reflectance = (mean.r + mean.g + mean.b) / 3.0F;
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf)
      unshot_[side.first_node + leaf] = glm::dvec3(emission(side, leaf));
    pull(side);
    side.dirty = false;
  }
  chooseFluxScale(other_flux);
}

/// 2^40 quanta for all that is emitted leave 2^22 in a 64-bit sum for interreflection.
void PatchTrees::chooseFluxScale(double other_flux) {
  const double emitted = other_flux + totalPower();
  flux_scale_ = std::exp2(emitted > 0.0 ? 40.0 - std::ceil(std::log2(emitted)) : 0.0);
}

double PatchTrees::totalPower() const {
  double sum = 0.0;
  for (const auto& side : sides_) sum += side.unshot_power;
  return sum;
}

/// Or the root, where nothing of the side has area.
std::uint32_t PatchTrees::nodeWithArea(const Side& side, std::uint32_t level, std::uint32_t x, std::uint32_t y) const {
  for (;; ++level, x /= 2, y /= 2) {
    const auto node = nodeId(side, {0, level, x, y});
    if (patches_->node_area[node] > 0.0F || level + 1 == side.level_count) return node;
  }
}

void PatchTrees::receive(const FluxAccumulators& shot) {
  for (auto& side : sides_) {
    double arrived = 0.0;
    for (std::uint32_t level = 0; level < side.level_count; ++level) {
      const auto grid = scene::levelGrid(side.width, side.height, level);
      for (std::uint32_t i = 0; i < grid.width * grid.height; ++i) {
        Flux3 flux = shot.node[0][side.first_node + grid.offset + i];
        add(flux, shot.node[1][side.first_node + grid.offset + i]);
        if (isNone(flux)) continue;
        const auto node = nodeWithArea(side, level, i % grid.width, i / grid.width);
        if (!(patches_->node_area[node] > 0.0F)) {
          add(backface_, flux);  // the whole side is buried: it can only absorb
          continue;
        }
        const auto light = scaled(flux, flux_scale_);
        unpushed_[node] += light;
        arrived += channelSum(light);
      }
    }
    if (arrived <= 0.0) continue;
    side.dirty = true;
    side.unshot_power += arrived * static_cast<double>(side.mean_reflectance);
    if (letsThrough(side)) {
      auto& other = sides_[side.other];
      other.unshot_power += arrived * channelSum(transmittance(other, other.node_count - 1)) / 3.0;
    }
  }
  add(escaped_, shot.escaped);
  add(backface_, shot.backface);
}

void PatchTrees::pushPull(std::uint32_t number) {
  auto& side = sides_[number];
  const bool lets_through = letsThrough(side);
  bool arrived = false;
  for (auto* pushed : {&side, lets_through ? &sides_[side.other] : nullptr}) {
    if (pushed == nullptr || !std::exchange(pushed->dirty, false)) continue;
    arrived = true;
    smooth(*pushed);
    push(*pushed);
  }
  if (!arrived) return;
  pull(side);
  if (lets_through) pull(sides_[side.other]);  // what arrived on one side is unshot on both
}

void PatchTrees::pushPullAll() {
  for (std::uint32_t side = 0; side < sides_.size(); ++side) pushPull(side);
}

/// "A 3 by 3 Gaussian filter" on the unpushed light (sections 4.3 and 5), level by level. Two neighbours exchange in
/// proportion to how their light differs, by the weight of the filter and the smaller area: no flux is lost, and even
/// light stays even up to the rim, where a filter that only normalises its weights would darken or brighten it.
void PatchTrees::smooth(const Side& side) {
  std::vector<glm::dvec3> change;
  for (std::uint32_t level = 0; level < side.level_count; ++level) {
    const auto grid = scene::levelGrid(side.width, side.height, level);
    const auto first = side.first_node + grid.offset;
    change.assign(std::size_t{grid.width} * grid.height, glm::dvec3(0.0));
    const auto exchange = [&](std::uint32_t a, std::uint32_t b, double weight) {
      const auto area_a = static_cast<double>(patches_->node_area[first + a]);
      const auto area_b = static_cast<double>(patches_->node_area[first + b]);
      if (!(area_a > 0.0 && area_b > 0.0)) return;
      const auto flux =
          weight * std::min(area_a, area_b) * (unpushed_[first + a] / area_a - unpushed_[first + b] / area_b);
      change[a] -= flux;
      change[b] += flux;
    };
    constexpr double kBeside = 2.0 / 16.0, kAcross = 1.0 / 16.0;
    for (std::uint32_t y = 0; y < grid.height; ++y)
      for (std::uint32_t x = 0; x < grid.width; ++x) {
        const auto at = y * grid.width + x;
        const bool has_right = x + 1 < grid.width, has_below = y + 1 < grid.height;
        if (has_right) exchange(at, at + 1, kBeside);
        if (has_below) exchange(at, at + grid.width, kBeside);
        if (has_right && has_below) exchange(at, at + grid.width + 1, kAcross);
        if (has_right && has_below) exchange(at + 1, at + grid.width, kAcross);
      }
    for (std::uint32_t i = 0; i < change.size(); ++i) unpushed_[first + i] += change[i];
  }
}

/// What higher nodes received holds all over them (Hanrahan, Salzman and Aupperle 1991).
void PatchTrees::push(const Side& side) {
  std::vector<glm::dvec3> above, here;
  for (std::uint32_t level = side.level_count; level-- > 0;) {
    const auto grid = scene::levelGrid(side.width, side.height, level);
    const auto coarser_width = (grid.width + 1) / 2;
    here.assign(std::size_t{grid.width} * grid.height, glm::dvec3(0.0));
    for (std::uint32_t i = 0; i < here.size(); ++i) {
      const auto node = side.first_node + grid.offset + i;
      if (!above.empty()) here[i] = above[std::size_t{i / grid.width / 2} * coarser_width + i % grid.width / 2];
      const auto area = static_cast<double>(patches_->node_area[node]);
      if (area > 0.0) here[i] += unpushed_[node] / area;
      unpushed_[node] = glm::dvec3(0.0);
    }
    above.swap(here);
  }
  for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
    if (!(patches_->node_area[side.first_node + leaf] > 0.0F)) continue;
    irradiance_[side.first_node + leaf] += above[leaf];
    unshot_[side.first_node + leaf] += glm::dvec3(reflectance(side, leaf)) * above[leaf];
    if (!letsThrough(side)) continue;
    const auto& other = sides_[side.other];
    if (patches_->node_area[other.first_node + leaf] > 0.0F)
      unshot_[other.first_node + leaf] += transmittance(other, leaf) * above[leaf];
  }
}

double PatchTrees::leafPower(std::uint32_t node) const {
  return channelSum(unshot_[node]) * static_cast<double>(patches_->node_area[node]);
}

void PatchTrees::pull(Side& side) {
  for (std::uint32_t level = 0; level < side.level_count; ++level) {
    const auto grid = scene::levelGrid(side.width, side.height, level);
    for (std::uint32_t i = 0; i < grid.width * grid.height; ++i) pullNode(side, level, i % grid.width, i / grid.width);
  }
  side.unshot_power = power_[side.first_node + side.node_count - 1];
}

void PatchTrees::pullNode(const Side& side, std::uint32_t level, std::uint32_t x, std::uint32_t y) {
  const auto node = nodeId(side, {0, level, x, y});
  if (level == 0) {
    power_[node] = leafPower(node);
    return;
  }
  const auto below = scene::levelGrid(side.width, side.height, level - 1);
  power_[node] = 0.0;
  for (auto cy = 2 * y; cy < std::min(2 * y + 2, below.height); ++cy)
    for (auto cx = 2 * x; cx < std::min(2 * x + 2, below.width); ++cx)
      power_[node] += power_[side.first_node + below.offset + cy * below.width + cx];
}

glm::dvec3 PatchTrees::takeUnshot(const NodePlace& node) {
  auto& side = sides_[node.side];
  const auto leaves = leafRect(side, node);
  glm::dvec3 flux(0.0);
  for (auto y = leaves.y0; y < leaves.y1; ++y)
    for (auto x = leaves.x0; x < leaves.x1; ++x) {
      auto& unshot = unshot_[side.first_node + y * side.width + x];
      flux += static_cast<double>(patches_->node_area[side.first_node + y * side.width + x]) * unshot;
      unshot = glm::dvec3(0.0);
    }
  for (std::uint32_t level = 0; level <= node.level; ++level)
    for (auto y = leaves.y0 >> level; y <= (leaves.y1 - 1) >> level; ++y)
      for (auto x = leaves.x0 >> level; x <= (leaves.x1 - 1) >> level; ++x)
        power_[nodeId(side, {node.side, level, x, y})] = 0.0;
  auto x = node.x, y = node.y;
  for (auto level = node.level + 1; level < side.level_count; ++level) pullNode(side, level, x /= 2, y /= 2);
  side.unshot_power = power_[side.first_node + side.node_count - 1];
  return flux;
}

glm::dvec3 PatchTrees::escaped() const { return scaled(escaped_, flux_scale_); }
glm::dvec3 PatchTrees::backface() const { return scaled(backface_, flux_scale_); }

bool PatchTrees::isWhole() const {
  const auto nodes = patches_->nodeCount();
  return unpushed_.size() == nodes && irradiance_.size() == nodes && unshot_.size() == nodes && power_.size() == nodes;
}

}  // namespace radiosity::solver
