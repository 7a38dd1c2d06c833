#include "server/solver/reflected/imaged_light.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <glm/common.hpp>
#include <utility>

#include "common/parallel.h"
#include "common/task.h"
#include "server/solver/math/sampling.h"

namespace radiosity::solver {
namespace {

using Clock = std::chrono::steady_clock;

/// Looks of each half from a leaf, and from one at the edge of what is seen.
constexpr std::uint32_t kFirstLooks = 4, kAllLooks = 16;
/// Of the width of a leaf: a ball around its middle, with room for leaves that are no squares.
constexpr double kAround = 1.0;
constexpr std::uint64_t kSeed = 0x494d414745ULL;

}  // namespace

void ImagedLight::begin(Lamps lamps, const LeafShading* shading) {
  auto before = std::exchange(known_, {});
  if (shading != std::exchange(shading_, shading)) before.clear();
  lamps_ = std::move(lamps);
  pending_.clear();
  next_ = 0;
  for (std::uint32_t i = 0; lamps_.images && i < lamps_.images->images().size(); ++i) {
    const auto key = lamps_.images->images()[i].key;
    const auto same = std::ranges::find_if(
        before, [&](const OfImage& old) { return old.key == key && old.times == times_ && old.is_whole; });
    if (same != before.end()) {
      known_.push_back(std::move(*same));
      continue;
    }
    known_.push_back({key, times_, false, std::vector<std::vector<Leaf>>(sides_.size())});
    for (std::uint32_t s = 0; s < sides_.size(); ++s) pending_.push_back({i, s});
  }
}

bool ImagedLight::isBehind() const {
  return std::ranges::any_of(known_, [&](const OfImage& image) { return !image.is_whole || image.times != times_; });
}

bool ImagedLight::refine(double times) {
  if (!lamps_.images) return false;
  const auto before = times_;
  while (times_ < kMostTimes && times_ < times * before) times_ *= 2;
  return times_ > before;
}

/// Each thread looks from one side at least.
bool ImagedLight::advance(double seconds) {
  const auto begin = Clock::now();
  std::atomic<std::size_t> next{next_};
  inShares(pending_.size() - next_, [&](std::size_t, std::size_t) {
    do {
      const auto at = next++;
      if (at >= pending_.size()) return;
      interruptionPoint();
      const auto [image, side] = pending_[at];
      known_[image].of_side[side] = look(lamps_.images->images()[image], sides_[side]);
    } while (std::chrono::duration<double>(Clock::now() - begin).count() < seconds);
  });
  next_ = std::min(pending_.size(), next.load());
  if (bytes() > most_bytes_) giveUp();
  if (next_ < pending_.size()) return false;
  for (auto& image : known_) image.is_whole = true;
  return true;
}

/// There is no room for what they bring: rays find the lamps in mirrors.
void ImagedLight::giveUp() {
  lamps_ = {};
  known_.clear();
  pending_.clear();
  next_ = 0;
}

/// Those that get some. Where the first looks of a leaf differ, or those of one beside it, it takes more.
std::vector<ImagedLight::Leaf> ImagedLight::look(const LampImages::Image& image, const Side& side) const {
  std::vector<Leaf> leaves(side.leaf_count);
  std::vector<std::uint32_t> seen(side.leaf_count, 0);
  for (std::uint32_t i = 0; i < side.leaf_count; ++i) {
    auto& leaf = leaves[i];
    leaf.value = side.first_value + i;
    if (rays_->areaOf(leaf.value) <= 0.0) continue;
    const auto middle = rays_->placeOn(leaf.value, {0.5, 0.5});
    if (!lamps_.images->maySee(image, middle.position, kAround * rays_->widthOf(leaf.value))) continue;
    leaf.number = shading_ != nullptr && !shading_->empty() ? shading_->numberOf(leaf.value) : scene::kNone;
    seen[i] = lookFrom(image, times_ * kFirstLooks, leaf);
  }
  const auto isEdge = [&](std::uint32_t i) {
    const auto x = i % side.width, y = i / side.width;
    const auto differs = [&](bool is_there, std::uint32_t beside) { return is_there && seen[beside] != seen[i]; };
    return (seen[i] > 0 && seen[i] < 2 * times_ * kFirstLooks) || differs(x > 0, i - 1) ||
           differs(x + 1 < side.width, i + 1) || differs(y > 0, i - side.width) ||
           differs(y + 1 < side.height, i + side.width);
  };
  std::vector<Leaf> found;
  for (std::uint32_t i = 0; i < side.leaf_count; ++i) {
    auto& leaf = leaves[i];
    if (rays_->areaOf(leaf.value) <= 0.0) continue;
    if (isEdge(i)) (void)lookFrom(image, times_ * kAllLooks, leaf);
    if (leaf.light[0] != glm::vec3(0.0F) || leaf.light[1] != glm::vec3(0.0F)) found.push_back(leaf);
  }
  return found;
}

std::uint32_t ImagedLight::lookFrom(const LampImages::Image& image, std::uint32_t looks, Leaf& leaf) const {
  const auto& side = rays_->sideOf(leaf.value);
  const auto of_leaf = mixKeys(mixKeys(seed_ ^ kSeed, side.key), leaf.value - side.first_value);
  std::uint32_t seen = 0;
  for (std::size_t half = 0; half < 2; ++half) {
    const Sobol4 draws(mixKeys(mixKeys(of_leaf, image.key), half));
    LampImages::Looks geometric, shading;
    for (std::uint32_t i = 0; i < looks; ++i) {
      const auto draw = draws(i);
      const auto place = rays_->placeOn(leaf.value, {draw.x, draw.y});
      const auto look = lamps_.images->look(image, place, place.normal, {draw.z, draw.w});
      geometric.add(look);
      if (leaf.number != scene::kNone)
        shading.add(lamps_.images->look(image, place, glm::dvec3(shading_->normal(leaf.number)), {draw.z, draw.w}));
    }
    seen += geometric.seenCount();
    leaf.light[half] = glm::vec3(geometric.irradiance());
    leaf.shaded[half] = glm::vec3(shading.irradiance());
  }
  return seen;
}

/// Calls visit(leaf, what its lamp shines with).
template <typename Visit>
void ImagedLight::forEachLeaf(const Visit& visit) const {
  for (std::size_t i = 0; i < known_.size(); ++i) {
    const auto& light = lamps_.light[lamps_.images->images()[i].lamp];
    for (const auto& of_side : known_[i].of_side)
      for (const auto& leaf : of_side) visit(leaf, light);
  }
}

void ImagedLight::addTo(std::size_t half, std::vector<glm::vec3>& irradiance) const {
  forEachLeaf([&](const Leaf& leaf, const glm::vec3& light) { irradiance[leaf.value] += light * leaf.light[half]; });
}

void ImagedLight::addShadedTo(std::size_t half, std::vector<glm::vec3>& irradiance) const {
  forEachLeaf([&](const Leaf& leaf, const glm::vec3& light) {
    if (leaf.number != scene::kNone) irradiance[leaf.number] += light * leaf.shaded[half];
  });
}

std::size_t ImagedLight::bytes() const {
  std::size_t bytes = 0;
  for (const auto& image : known_)
    for (const auto& of_side : image.of_side) bytes += of_side.size() * sizeof(Leaf);
  return bytes;
}

}  // namespace radiosity::solver
