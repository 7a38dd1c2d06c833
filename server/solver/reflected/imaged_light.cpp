#include "server/solver/reflected/imaged_light.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <glm/common.hpp>
#include <utility>

#include "common/parallel.h"
#include "common/take_first.h"
#include "common/task.h"
#include "server/solver/math/sampling.h"

namespace radiosity::solver {
namespace {

using Clock = std::chrono::steady_clock;

/// Looks of each half from a leaf, and from one at the edge of what is seen.
constexpr std::uint32_t kFirstLooks = 4, kAllLooks = 16;
/// Where the first agree the others are made with this chance.
constexpr double kAskAgain = 0.25;
/// Rays of a look: to the mirror, and from there to the lamp.
constexpr std::uint32_t kRays = 2;
/// Of the width of a leaf: a ball around its middle, which may be a spot at the corner of one that is covered in part.
constexpr double kAroundLeaf = 1.5;
/// First looks of leaves that are looked from together: a few hundredths of a second.
constexpr std::uint32_t kLeavesAtOnce = 4096;
/// Of the rows that are looked from together two are so for their neighbours alone.
constexpr std::uint32_t kLeastRows = 8;
/// In a step there come to be at most so many times as many looks.
constexpr double kMostAStep = 4.0;
/// Of all room, what images may take that are no longer there.
constexpr std::size_t kSparePart = 4;
constexpr std::uint64_t kSeed = 0x494d414745ULL;

}  // namespace

bool ImagedLight::isKnown(const OfImage& image, std::uint64_t key) const {
  return image.key == key && image.times == times_ && image.is_whole;
}

bool ImagedLight::isKnown(std::uint64_t key) const {
  const auto is_it = [&](const OfImage& image) { return isKnown(image, key); };
  return std::ranges::any_of(known_, is_it) || std::ranges::any_of(spare_, is_it);
}

std::uint64_t ImagedLight::looksFor(const Lamps& lamps) const {
  if (!lamps.images || is_given_up_) return 0;
  std::uint64_t leaves = 0, unknown = 0;
  for (const auto& side : sides_) leaves += side.leaf_count;
  for (const auto& image : lamps.images->images()) unknown += isKnown(image.key) ? 0 : 1;
  return unknown * leaves * 2 * kFirstLooks * kRays * times_;
}

void ImagedLight::begin(Lamps lamps, const LeafShading* shading) {
  if (is_given_up_) lamps = {};
  pending_ = {};
  next_ = 0;
  if (shading != std::exchange(shading_, shading)) known_.clear(), spare_.clear();
  std::vector<OfImage> next;
  std::vector<std::uint32_t> unknown;
  for (std::uint32_t i = 0; lamps.images && i < lamps.images->images().size(); ++i) {
    const auto key = lamps.images->images()[i].key;
    if (auto same = takeFirst({&known_, &spare_}, [&](const OfImage& one) { return isKnown(one, key); })) {
      next.push_back(std::move(*same));
    } else {
      next.push_back({key, times_, false, {}});
      unknown.push_back(i);
    }
  }
  keepSpare();
  known_ = std::move(next);
  lamps_ = std::move(lamps);
  for (const auto image : unknown) plan(image);
}

/// What is known of images that are not there any more, as far as there is room: lamps that are switched off come back.
void ImagedLight::keepSpare() {
  std::ranges::move(known_, std::back_inserter(spare_));
  known_.clear();
  std::erase_if(spare_, [&](const OfImage& image) { return !image.is_whole || image.times != times_; });
  while (!spare_.empty() && bytes() > most_bytes_ / kSparePart) spare_.erase(spare_.begin());
}

void ImagedLight::plan(std::uint32_t image) {
  std::uint32_t parts = 0;
  for (std::uint32_t s = 0; s < sides_.size(); ++s) {
    const auto& side = sides_[s];
    const auto rows = std::max(kLeastRows, kLeavesAtOnce / (times_ * std::max(1U, side.width)));
    for (std::uint32_t first = 0; first < side.height; first += rows, ++parts)
      pending_.push_back({image, s, first, std::min(side.height, first + rows)});
  }
  known_[image].parts.resize(parts);
}

bool ImagedLight::isBehind() const {
  return std::ranges::any_of(known_, [&](const OfImage& image) { return !image.is_whole || image.times != times_; });
}

bool ImagedLight::refine(double times) {
  if (!lamps_.images) return false;
  const auto before = times_;
  while (times_ < kMostTimes && times_ < std::min(times, kMostAStep) * before) times_ *= 2;
  return times_ > before;
}

/// Each thread makes one of the looks at least.
bool ImagedLight::advance(double seconds) {
  const auto begin = Clock::now();
  std::vector<std::size_t> first(known_.size(), 0);  // of the pending looks of an image
  for (std::size_t i = pending_.size(); i-- > 0;) first[pending_[i].image] = i;
  std::atomic<std::size_t> next{next_};
  inShares(pending_.size() - next_, [&](std::size_t, std::size_t) {
    do {
      const auto at = next++;
      if (at >= pending_.size()) return;
      const auto image = pending_[at].image;
      known_[image].parts[at - first[image]] = look(pending_[at]);
    } while (std::chrono::duration<double>(Clock::now() - begin).count() < seconds);
  });
  next_ = std::min(pending_.size(), next.load());
  if (bytes() > most_bytes_) spare_.clear();
  if (bytes() > most_bytes_) giveUp();
  const auto unfinished = next_ < pending_.size() ? pending_[next_].image : known_.size();
  for (std::size_t i = 0; i < unfinished; ++i) known_[i].is_whole = true;
  return next_ == pending_.size();
}

/// There is no room for what they bring: whoever asked for them has to do without.
void ImagedLight::giveUp() {
  is_given_up_ = true;
  lamps_ = {};
  known_.clear();
  spare_.clear();
  pending_.clear();
  next_ = 0;
}

/// Those that get some. Where the first looks of a leaf differ, or those of one beside it, it takes more. Rows beside
/// those asked for are looked from as well, for the leaves at their edges.
std::vector<ImagedLight::Leaf> ImagedLight::look(const Look& look) const {
  const auto& image = lamps_.images->images()[look.image];
  const auto& side = sides_[look.side];
  const auto low = look.first - std::min(look.first, 1U), high = std::min(side.height, look.end + 1);
  const auto count = (high - low) * side.width;
  std::vector<Leaf> leaves(count);
  std::vector<std::uint32_t> seen(count, 0);
  std::vector<bool> may_see(count, false);
  for (std::uint32_t i = 0; i < count; ++i) {
    if (i % side.width == 0) interruptionPoint();
    auto& leaf = leaves[i];
    leaf.value = side.first_value + low * side.width + i;
    if (rays_->areaOf(leaf.value) <= 0.0) continue;
    leaf.number = shading_ != nullptr && !shading_->empty() ? shading_->numberOf(leaf.value) : scene::kNone;
    const auto middle = rays_->placeOn(leaf.value, {0.5, 0.5});
    may_see[i] = lamps_.images->maySee(image, middle.position, kAroundLeaf * rays_->widthOf(leaf.value));
    if (may_see[i]) seen[i] = lookFrom(image, times_ * kFirstLooks, leaf);
  }
  const auto isEdge = [&](std::uint32_t i) {
    const auto x = i % side.width, y = i / side.width;
    const auto differs = [&](bool is_there, std::uint32_t beside) { return is_there && seen[beside] != seen[i]; };
    return (seen[i] > 0 && seen[i] < 2 * times_ * kFirstLooks) || differs(x > 0, i - 1) ||
           differs(x + 1 < side.width, i + 1) || differs(y > 0, i - side.width) ||
           differs(low + y + 1 < high, i + side.width);
  };
  std::vector<Leaf> found;
  for (auto i = (look.first - low) * side.width; i < (look.end - low) * side.width; ++i) {
    auto& leaf = leaves[i];
    if (i % side.width == 0) interruptionPoint();
    if (rays_->areaOf(leaf.value) <= 0.0) continue;
    if (isEdge(i)) {
      (void)lookFrom(image, times_ * kAllLooks, leaf);
    } else if (may_see[i]) {
      askAgain(image, leaf);
    }
    if (leaf.light[0] != glm::vec3(0.0F) || leaf.light[1] != glm::vec3(0.0F)) found.push_back(leaf);
  }
  return found;
}

/// Of leaves whose first looks agree some are asked all the same, and stand for the others: else what is narrower than
/// a leaf would count as all dark, or all lit, too often.
void ImagedLight::askAgain(const LampImages::Image& image, Leaf& leaf) const {
  if (uniformFromKey(mixKeys(mixKeys(seed_, image.key), leaf.value)) >= kAskAgain) return;
  auto all = leaf;
  const auto looks = times_ * kAllLooks, seen = lookFrom(image, looks, all);
  if (seen == 0 || seen == 2 * looks) return;  // what they differ by is the noise of the first
  const auto stand = [](glm::vec3& first, const glm::vec3& of_all) {
    first = glm::max(glm::vec3(0.0F), first + (of_all - first) / static_cast<float>(kAskAgain));
  };
  for (std::size_t half = 0; half < 2; ++half) {
    stand(leaf.light[half], all.light[half]);
    stand(leaf.shaded[half], all.shaded[half]);
  }
}

std::uint32_t ImagedLight::lookFrom(const LampImages::Image& image, std::uint32_t looks, Leaf& leaf) const {
  const auto& side = rays_->sideOf(leaf.value);
  const auto of_leaf = mixKeys(mixKeys(seed_ ^ kSeed, side.key), leaf.value - side.first_value);
  const auto& images = *lamps_.images;
  thread_local std::vector<LeafRays::Place> places;
  places.resize(looks);
  std::uint32_t seen = 0;
  for (std::size_t half = 0; half < 2; ++half) {
    const Sobol4 draws(mixKeys(mixKeys(of_leaf, image.key), half));
    LampImages::Looks geometric, shaded;
    for (std::uint32_t i = 0; i < looks; ++i) {
      const auto draw = draws(i);
      auto& place = places[i];
      place = rays_->placeOn(leaf.value, {draw.x, draw.y});
      geometric.add(images.look(image, place, place.normal, {draw.z, draw.w}));
      if (leaf.number != scene::kNone)
        shaded.add(images.look(image, place, glm::dvec3(shading_->normal(leaf.number)), {draw.z, draw.w}));
    }
    seen += geometric.seen_count;
    leaf.light[half] = glm::vec3(images.irradiance(image, geometric, places));
    if (leaf.number == scene::kNone) continue;
    const glm::dvec3 normal(shading_->normal(leaf.number));
    leaf.shaded[half] = glm::vec3(images.irradiance(image, shaded, places, &normal));
  }
  return seen;
}

/// Calls visit(leaf, what its lamp shines with).
template <typename Visit>
void ImagedLight::forEachLeaf(const Visit& visit) const {
  for (std::size_t i = 0; i < known_.size(); ++i) {
    const auto& light = lamps_.light[lamps_.images->images()[i].lamp];
    for (const auto& part : known_[i].parts)
      for (const auto& leaf : part) visit(leaf, light);
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
  std::size_t bytes = pending_.size() * sizeof(Look);
  for (const auto* images : {&known_, &spare_}) {
    for (const auto& image : *images) {
      bytes += image.parts.size() * sizeof(std::vector<Leaf>);
      for (const auto& part : image.parts) bytes += part.size() * sizeof(Leaf);
    }
  }
  return bytes;
}

}  // namespace radiosity::solver
