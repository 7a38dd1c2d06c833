#include "server/solver/transport/link_expander.h"

#include <algorithm>

#include "common/clones.h"
#include "common/give_back.h"

namespace radiosity::solver {
namespace {

/// In double precision, so that sums over all leaves keep their digits.
RADIOSITY_CLONES double sumOf(const float* value, const float* area, std::size_t count) {
  constexpr std::size_t kLanes = 8;
  double sum[kLanes] = {};
  std::size_t i = 0;
  for (; i + kLanes <= count; i += kLanes) {
    for (std::size_t k = 0; k < kLanes; ++k)
      sum[k] += static_cast<double>(value[i + k]) * static_cast<double>(area[i + k]);
  }
  double rest = 0.0;
  for (; i < count; ++i) rest += static_cast<double>(value[i]) * static_cast<double>(area[i]);
  for (std::size_t k = 0; k < kLanes; ++k) rest += sum[k];
  return rest;
}

}  // namespace

double fluxOf(std::span<const float> values, const float* areas) { return sumOf(values.data(), areas, values.size()); }

LinkExpander::LinkExpander(const scene::PatchScene& patches, const std::vector<Side>& sides)
    : patches_(patches), sides_(sides), is_reached_(sides.size(), false), has_coarse_(sides.size(), false) {}

void LinkExpander::prepare() {
  if (!side_of_node_.empty()) return;
  coarse_.assign(patches_.nodeCount(), 0.0F);
  if (!sides_.empty()) values_.resize(sides_.back().first_value + sides_.back().leaf_count);
  side_of_node_.resize(patches_.nodeCount());  // the last: that it is there says that all are
  for (const auto& side : sides_) std::fill_n(side_of_node_.begin() + side.first_node, side.node_count, side.number);
}

void LinkExpander::forget() {
  for (const auto side : reached_) is_reached_[side] = false;
  giveBack(reached_);
  giveBack(side_of_node_);
  giveBack(values_);
  giveBack(coarse_);
}

/// What reaches a leaf and the slivers that share with it arrives at all of them alike.
void LinkExpander::shareSlivers() {
  if (!slivers_) slivers_ = findSlivers(patches_, sides_);
  for (auto first = slivers_->begin(); first != slivers_->end();) {
    const auto [leaf, leaf_side, sliver, sliver_side] = *first;
    double area = static_cast<double>(areaOf(leaf, leaf_side)), flux = fluxTo(leaf, leaf_side);
    auto last = first;
    for (; last != slivers_->end() && last->leaf == leaf; ++last) {
      area += static_cast<double>(areaOf(last->sliver, last->sliver_side));
      flux += fluxTo(last->sliver, last->sliver_side);
    }
    if (flux > 0.0) {
      const auto mean = static_cast<float>(flux / area);
      reach(leaf_side);
      values_[leaf] = mean;
      for (auto shares = first; shares != last; ++shares) {
        reach(shares->sliver_side);
        values_[shares->sliver] = mean;
      }
    }
    first = last;
  }
  std::sort(reached_.begin(), reached_.end());
}

double LinkExpander::fluxTo(std::uint32_t value, std::uint32_t side) const {
  return is_reached_[side] ? static_cast<double>(areaOf(value, side)) * static_cast<double>(values_[value]) : 0.0;
}

double LinkExpander::flux() const {
  double sum = 0.0;
  for (const auto s : reached_) {
    const auto first = sides_[s].first_value;
    sum += fluxOf(std::span(values_).subspan(first, sides_[s].leaf_count), &patches_.node_area[sides_[s].first_node]);
  }
  return sum;
}

void LinkExpander::reach(std::uint32_t side) {
  if (is_reached_[side]) return;
  is_reached_[side] = true;
  reached_.push_back(side);
  std::fill_n(values_.begin() + sides_[side].first_value, sides_[side].leaf_count, 0.0F);
}

void LinkExpander::expand(const LinkSample& sample, bool by_pixels) {
  prepare();
  for (const auto side : reached_) is_reached_[side] = false;
  reached_.clear();
  const float* value = sample.irradiance.data();
  for (const auto& run : sample.runs) {
    for (std::uint32_t node = run.first_node; node < run.first_node + run.count; ++node, ++value) {
      const std::uint32_t s = side_of_node_[node];
      const Side& side = sides_[s];
      reach(s);
      const std::uint32_t local = node - side.first_node;
      if (local < side.leaf_count) {
        values_[side.first_value + local] += *value;
      } else {
        coarse_[node] += *value;
        has_coarse_[s] = true;
      }
    }
  }
  std::sort(reached_.begin(), reached_.end());
  for (const auto side : reached_) {
    if (has_coarse_[side]) pushDown(side);
  }
  if (by_pixels) shareSlivers();
}

void LinkExpander::pushDown(std::uint32_t s) {
  const Side& side = sides_[s];
  has_coarse_[s] = false;
  for (std::uint32_t level = side.level_count; level-- > 1;) {
    const auto grid = scene::levelGrid(side.width, side.height, level);
    const auto child = scene::levelGrid(side.width, side.height, level - 1);
    for (std::uint32_t y = 0; y < child.height; ++y) {
      for (std::uint32_t x = 0; x < child.width; ++x) {
        const float value = coarse_[side.first_node + grid.offset + (y >> 1U) * grid.width + (x >> 1U)];
        if (level > 1) {
          coarse_[side.first_node + child.offset + y * child.width + x] += value;
        } else if (patches_.node_area[side.first_node + y * child.width + x] > 0.0F) {
          values_[side.first_value + y * child.width + x] += value;
        }
      }
    }
    std::fill_n(coarse_.begin() + side.first_node + grid.offset, grid.width * grid.height, 0.0F);
  }
}

}  // namespace radiosity::solver
