#include "server/solver/shooting/state.h"

#include <algorithm>
#include <cmath>

#include "server/solver/patches/unshot_pyramid.h"

#include "common/check.h"

namespace radiosity::solver {
namespace {

void addTo(Flux3& sum, const Flux3& term) {
  for (std::size_t c = 0; c < 3; ++c) sum[c] += term[c];
}

}  // namespace

void FluxAccumulators::reset(std::size_t node_count) {
  for (auto& half : node) half.assign(node_count, Flux3{});
  escaped = backface = scattered = gathered = Flux3{};
}

RadiosityState::RadiosityState(std::shared_ptr<const scene::PatchScene> patches, const scene::PatchMaterials& materials,
                               double other_flux)
    : patches_(std::move(patches)), sides_(makeSides(*patches_)) {
  std::size_t values = 0;
  for (const auto& side : sides_) values += side.leaf_count;
  shot_.assign(values, glm::vec3(0.0F));
  shot_level_.assign(values, 255);
  irradiance_.assign(values, glm::vec3(0.0F));
  unshot_.assign(values, glm::vec3(0.0F));
  node_rough_.assign(patches_->nodeCount(), 0.0F);
  node_flux_.assign(patches_->nodeCount(), glm::vec3(0.0F));
  for (auto& half : received_) half.assign(patches_->nodeCount(), Flux3{});
  setMaterials(materials);
  chooseFluxScale(other_flux);
}

void RadiosityState::setMaterials(const scene::PatchMaterials& materials) {
  emission_ = materials.emission;
  reflectance_ = materials.reflectance;
  transmittance_ = materials.transmittance;
  for (auto& side : sides_) {
    side.mean_reflectance = channelSum(reflectance_.side(side.number)[side.node_count - 1]) / 3.0F;
    side.dirty = true;
    side.unshot_power = HUGE_VAL;  // unknown until pulled; infinite makes sure that it is
  }
}

void RadiosityState::chooseFluxScale(double other_flux) {
  // 2^40 quanta for the emitted flux leave 2^22 in a 64-bit sum: for interreflection (at most 1 / (1 - 0.999) = 2^10),
  // rounds (2^10), and lamps made brighter by edits before a new scale is chosen (2^2).
  double emitted = other_flux;
  for (const auto& side : sides_) {
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      emitted += static_cast<double>(channelSum(emission(side, leaf))) * static_cast<double>(leafArea(side, leaf));
    }
  }
  const double exponent = emitted > 0.0 ? 40.0 - std::ceil(std::log2(emitted)) : 0.0;
  flux_scale_ = std::exp2(exponent);
}

void RadiosityState::startRound() {
  ++rounds_;
  for (auto& side : sides_) {
    side.dirty = true;
    side.unshot_power = HUGE_VAL;
  }
}

void RadiosityState::receive(const FluxAccumulators& batch) {
  for (auto& side : sides_) {
    double arrived = 0.0;
    for (std::size_t half = 0; half < 2; ++half) {
      for (std::uint32_t level = 0; level < side.level_count; ++level) {
        const auto grid = scene::levelGrid(side.width, side.height, level);
        for (std::uint32_t i = 0; i < grid.width * grid.height; ++i) {
          const std::uint32_t node = side.first_node + grid.offset + i;
          const Flux3& flux = batch.node[half][node];
          if (flux[0] == 0 && flux[1] == 0 && flux[2] == 0) continue;
          std::uint32_t target = node;
          std::uint32_t x = i % grid.width, y = i / grid.width;
          for (std::uint32_t up = level; patches_->node_area[target] <= 0.0F && up + 1 < side.level_count;) {
            ++up, x >>= 1, y >>= 1;
            const auto coarser = scene::levelGrid(side.width, side.height, up);
            target = side.first_node + coarser.offset + y * coarser.width + x;
          }
          if (patches_->node_area[target] <= 0.0F) {
            addTo(backface_, flux);  // the whole side is buried: it can only absorb
            continue;
          }
          addTo(received_[half][target], flux);
          for (const auto f : flux) arrived += std::abs(static_cast<double>(f));
        }
      }
    }
    if (arrived > 0.0) {
      side.dirty = true;
      side.unshot_power += arrived / flux_scale_ * static_cast<double>(side.mean_reflectance);
      if (side.other != scene::kNone && transmittance_.sideCount() > 0) {
        auto& other = sides_[side.other];
        const auto passing = channelSum(transmittance_.side(other.number)[other.node_count - 1]) / 3.0F;
        other.dirty = other.dirty || passing > 0.0F;
        other.unshot_power += arrived / flux_scale_ * static_cast<double>(passing);
      }
    }
  }
  addTo(escaped_, batch.escaped);
  addTo(backface_, batch.backface);
  addTo(gathered_, batch.gathered);
  addTo(scattered_, batch.scattered);
}

glm::vec3 RadiosityState::scatterRadiosity(const Side& side, std::uint32_t leaf) const {
  const glm::vec3 reflected = reflectance(side, leaf) * irradiance(side, leaf) + passed(side, leaf);
  return side.gathered ? reflected : emission(side, leaf) + reflected;
}

void RadiosityState::pushHalf(const Side& side, std::uint32_t half, std::vector<glm::dvec3>& density) const {
  density.assign(side.node_count, glm::dvec3(0.0));
  for (std::uint32_t level = side.level_count; level-- > 0;) {
    const auto grid = scene::levelGrid(side.width, side.height, level);
    const auto parent = scene::levelGrid(side.width, side.height, level + 1);
    for (std::uint32_t y = 0; y < grid.height; ++y) {
      for (std::uint32_t x = 0; x < grid.width; ++x) {
        const std::uint32_t local = grid.offset + y * grid.width + x;
        const std::uint32_t node = side.first_node + local;
        glm::dvec3 value(0.0);
        if (level + 1 < side.level_count) value = density[parent.offset + (y >> 1) * parent.width + (x >> 1)];
        const double area = static_cast<double>(patches_->node_area[node]);
        if (area > 0.0) {
          const Flux3& flux = received_[half][node];
          value +=
              glm::dvec3(static_cast<double>(flux[0]), static_cast<double>(flux[1]), static_cast<double>(flux[2])) /
              area;
        }
        density[local] = value;
      }
    }
  }
}

/// Irradiance of the leaves.
void RadiosityState::push(const Side& side) {
  thread_local std::vector<glm::dvec3> first, second;
  pushHalf(side, 0, first);
  pushHalf(side, 1, second);
  const double unit = 1.0 / (flux_scale_ * static_cast<double>(rounds_));
  for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
    const bool empty = leafArea(side, leaf) <= 0.0F;
    irradiance_[side.first_value + leaf] = empty ? glm::vec3(0.0F) : glm::vec3((first[leaf] + second[leaf]) * unit);
  }
}

void RadiosityState::pushPull(Side& side) {
  if (!side.dirty) return;
  push(side);
  // What arrives on the other side makes this one dirty, too. The other stays so until its own turn.
  if (side.other != scene::kNone && transmittance_.sideCount() > 0 && sides_[side.other].dirty)
    push(sides_[side.other]);
  const auto rounds = static_cast<float>(rounds_);
  for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
    const std::uint32_t v = side.first_value + leaf;
    const bool empty = leafArea(side, leaf) <= 0.0F;
    unshot_[v] = empty ? glm::vec3(0.0F) : rounds * scatterRadiosity(side, leaf) - shot_[v];
  }
  pull(side);
  side.dirty = false;
}

float RadiosityState::nodePower(std::uint32_t node) const {
  // Light that only differs between the leaves of a node cancels at a distance and counts near by. How much is an
  // estimate that has not been tuned: less blurs corners, more spends shots on noise.
  constexpr float kVariationWorth = 0.1F;
  const float net = channelSum(node_flux_[node]);
  return net + kVariationWorth * std::max(0.0F, node_rough_[node] - net);
}

void RadiosityState::pullNode(const Side& side, std::uint32_t level, std::uint32_t x, std::uint32_t y) {
  const auto grid = scene::levelGrid(side.width, side.height, level);
  const std::uint32_t node = side.first_node + grid.offset + y * grid.width + x;
  if (level == 0) {
    node_flux_[node] = unshot_[side.first_value + y * side.width + x] * patches_->node_area[node];
    node_rough_[node] = channelSum(node_flux_[node]);
    return;
  }
  const auto child = scene::levelGrid(side.width, side.height, level - 1);
  glm::vec3 flux(0.0F);
  float rough = 0.0F;
  for (std::uint32_t cy = 2 * y; cy < std::min(2 * y + 2, child.height); ++cy) {
    for (std::uint32_t cx = 2 * x; cx < std::min(2 * x + 2, child.width); ++cx) {
      const std::uint32_t below = side.first_node + child.offset + cy * child.width + cx;
      flux += node_flux_[below];
      rough += node_rough_[below];
    }
  }
  node_flux_[node] = flux;
  node_rough_[node] = rough;
}

void RadiosityState::pull(Side& side) { pullAround(side, side.level_count - 1, 0, 0); }

/// Recomputes the subtree of a node, and its ancestors.
void RadiosityState::pullAround(Side& side, std::uint32_t level, std::uint32_t x, std::uint32_t y) {
  for (std::uint32_t l = 0; l <= level; ++l) {
    const auto grid = scene::levelGrid(side.width, side.height, l);
    const std::uint32_t shift = level - l;
    for (std::uint32_t ny = y << shift; ny < std::min((y + 1) << shift, grid.height); ++ny) {
      for (std::uint32_t nx = x << shift; nx < std::min((x + 1) << shift, grid.width); ++nx) pullNode(side, l, nx, ny);
    }
  }
  for (std::uint32_t l = level + 1; l < side.level_count; ++l) pullNode(side, l, x >> (l - level), y >> (l - level));
  side.unshot_power = static_cast<double>(nodePower(side.first_node + side.node_count - 1));
}

void RadiosityState::pushPullAll() {
  for (auto& side : sides_) pushPull(side);
}

glm::dvec3 RadiosityState::markShot(Side& side, std::uint32_t level, std::uint32_t x, std::uint32_t y) {
  RAD_CHECK(!side.dirty);
  const auto rounds = static_cast<float>(rounds_);
  glm::dvec3 flux(0.0);
  for (std::uint32_t ly = y << level; ly < std::min((y + 1) << level, side.height); ++ly) {
    for (std::uint32_t lx = x << level; lx < std::min((x + 1) << level, side.width); ++lx) {
      const std::uint32_t leaf = ly * side.width + lx, v = side.first_value + leaf;
      if (leafArea(side, leaf) <= 0.0F) continue;
      flux += glm::dvec3(unshot_[v]) * static_cast<double>(leafArea(side, leaf));
      shot_[v] = rounds * scatterRadiosity(side, leaf);
      unshot_[v] = glm::vec3(0.0F);
      shot_level_[v] = static_cast<std::uint8_t>(level);
    }
  }
  pullAround(side, level, x, y);
  return flux;
}

glm::dvec3 RadiosityState::markMeanShot(Side& side, std::uint32_t level, std::uint32_t x, std::uint32_t y) {
  RAD_CHECK(!side.dirty);
  const auto grid = scene::levelGrid(side.width, side.height, level);
  const std::uint32_t node = side.first_node + grid.offset + y * grid.width + x;
  const glm::vec3 mean = node_flux_[node] / patches_->node_area[node];
  const auto rounds = static_cast<float>(rounds_);
  glm::dvec3 flux(0.0);
  for (std::uint32_t ly = y << level; ly < std::min((y + 1) << level, side.height); ++ly) {
    for (std::uint32_t lx = x << level; lx < std::min((x + 1) << level, side.width); ++lx) {
      const std::uint32_t leaf = ly * side.width + lx, v = side.first_value + leaf;
      shot_[v] += mean;
      flux += glm::dvec3(mean) * static_cast<double>(leafArea(side, leaf));
      unshot_[v] = rounds * scatterRadiosity(side, leaf) - shot_[v];
      shot_level_[v] = static_cast<std::uint8_t>(level);
    }
  }
  pullAround(side, level, x, y);
  return flux;
}

std::vector<glm::vec3> RadiosityState::nodeIrradiance() const {
  std::vector<glm::vec3> values(patches_->nodeCount(), glm::vec3(0.0F));
  for (const auto& side : sides_) {
    std::copy_n(irradiance_.begin() + side.first_value, side.leaf_count, values.begin() + side.first_node);
  }
  return values;
}

void RadiosityState::halfIrradiance(const Side& side, std::uint32_t half, std::span<glm::vec3> out) const {
  thread_local std::vector<glm::dvec3> density;
  pushHalf(side, half, density);
  const double unit = 2.0 / (flux_scale_ * static_cast<double>(rounds_));
  for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) out[leaf] = glm::vec3(density[leaf] * unit);
}

}  // namespace radiosity::solver
