#include "server/solver/variation/leaf_variation.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>

#include "common/check.h"
#include "common/give_back.h"
#include "server/solver/math/halves.h"
#include "server/solver/math/sampling.h"

namespace radiosity::solver {
namespace {

/// More receivers than these are sampled: then what varies is stated, and not corrected.
constexpr std::size_t kMostReceivers = 131'072;
/// So many paths of each half all receivers have before it must show whether something varies.
constexpr std::uint32_t kEvenPaths = 8;
/// Fewer of them that meet a leaf near by may miss what varies.
constexpr std::size_t kFewestPaths = 512;
/// So many times its standard deviation what was found is not by chance.
constexpr double kSurely = 2.0;
/// So much of a leaf's own noise counts as that of its neighbours: only where it is several times as much.
constexpr double kOwnNoise = 0.25;
/// Where what is doubtful is more than this part of all that is lacking, squared, nothing is corrected.
constexpr double kDoubtful = 0.1;
/// A receiver never has more paths than these; a round of refinement adds no more than those in all.
constexpr std::uint32_t kMostPaths = 4096, kMostAdded = 16'384;
/// And all together never more than these, 32 MB, and 12 MB for lights that shone before.
constexpr std::size_t kMostInAll = 1'000'000;
/// A round of refinement is for the receivers with so much of what it could lower.
constexpr double kRefinedPart = 0.8;

/// The leaves around one, without itself: with it, its share of a signal would be the larger the more of it is chance,
/// and what is left would come out too small. A leaf without neighbours has to do.
class Neighbours {
 public:
  Neighbours(const Side& side, std::uint32_t leaf) : side_(side), leaf_(leaf) {
    const auto x = leaf % side.width, y = leaf / side.width;
    x_ = {x - std::min(x, 1U), std::min(x + 2, side.width)};
    y_ = {y - std::min(y, 1U), std::min(y + 2, side.height)};
  }

  [[nodiscard]] double sumOf(const std::vector<double>& values) const {
    double sum = 0.0;
    for (auto y = y_.first; y < y_.end; ++y)
      for (auto x = x_.first; x < x_.end; ++x) sum += values[y * side_.width + x];
    return side_.leaf_count > 1 ? sum - values[leaf_] : sum;
  }

 private:
  struct Range {
    std::uint32_t first, end;
  };
  const Side& side_;
  std::uint32_t leaf_;
  Range x_{}, y_{};
};

template <typename Lack>
bool finds(const Lack& lack) {
  return lack.sure != glm::vec3(0.0F) || lack.doubtful != glm::vec3(0.0F);
}

template <typename Lack>
glm::dvec3 all(const Lack& lack) {
  return glm::dvec3(lack.sure) + glm::dvec3(lack.doubtful);
}

}  // namespace

LeafVariation::LeafVariation(const scene::PatchScene& patches, const std::vector<Side>& sides, std::uint64_t seed,
                             std::shared_ptr<const LeafRays> rays)
    : sides_(sides),
      rays_(rays ? std::move(rays) : std::make_shared<const LeafRays>(patches, sides)),
      seed_(mixKeys(seed, 0x4c454146ULL)) {
  for (const auto& side : sides) {
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf)
      if (patches.node_area[side.first_node + leaf] > 0.0F) receivers_.push_back(side.first_value + leaf);
  }
  const std::size_t all = receivers_.size();
  if (all <= kMostReceivers) return;
  for (std::size_t i = 0; i < kMostReceivers; ++i)  // one of each stretch
    receivers_[i] = receivers_[static_cast<std::size_t>((static_cast<double>(i) + uniformFromKey(mixKeys(seed_, i))) *
                                                        static_cast<double>(all) / kMostReceivers)];
  receivers_.resize(kMostReceivers);
  stands_for_ = static_cast<double>(all) / kMostReceivers;
}

bool LeafVariation::isWhole() const {
  const auto fits = [](std::uint16_t count) { return count >= 1 && count <= kMostPaths; };
  return (count_.empty() || count_.size() == receivers_.size()) && std::ranges::all_of(count_, fits);
}

/// As many paths as count_ says.
bool LeafVariation::traceAll(const LeafLight& light, Clock::time_point end) {
  const auto shines = [](const PunctualLights::Source& source) { return source.intensity != glm::dvec3(0.0); };
  if (traced_for_ != kept_for_ || std::ranges::any_of(light.sources, shines)) {
    for (auto& half : there_) {
      for (auto& known : half) known.kept = scene::kNone;
    }
  }
  if (count_.empty()) count_.assign(receivers_.size(), 1);
  std::vector<Task> tasks(receivers_.size());
  for (std::size_t r = 0; r < receivers_.size(); ++r) tasks[r] = {receivers_[r], 0, count_[r]};
  if (!trace(tasks, light, end)) return false;
  forgetFormer();
  return true;
}

std::vector<LeafVariation::Task> LeafVariation::twiceAsMany() const {
  std::vector<Task> tasks;
  for (std::size_t r = 0; r < receivers_.size(); ++r)
    if (count_[r] < kEvenPaths) tasks.push_back({receivers_[r], count_[r], 2U * count_[r]});
  return tasks;
}

bool LeafVariation::update(const LeafLight& light, double bound, double seconds) {
  const auto end =
      seconds < kNoEnd
          ? Clock::now() + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds))
          : Clock::time_point::max();
  RAD_CHECK(std::max(light.lights.size(), light.sources.size()) <= std::size_t{1} << 16U);  // paths number them
  std::uint64_t shining = 1;
  for (std::size_t i = 0; i < light.lights.size(); ++i)
    if (light.lights[i].emission != glm::vec3(0.0F)) shining = mixKeys(shining, mixKeys(i, light.lights[i].key));
  for (std::size_t i = 0; i < light.sources.size(); ++i)
    if (light.sources[i].intensity != glm::dvec3(0.0))
      shining = mixKeys(shining, mixKeys(~i, light.sources[i].shapeKey()));
  if (is_traced_ && shining != traced_for_) takeOtherLights(light, shining);
  traced_for_ = shining;
  if (!is_traced_) {
    wanted_.clear();
    if (!traceAll(light, end)) return false;
    is_traced_ = true;  // not where memory ran out: no paths would say that nothing varies
  }
  if (!trace(wanted_, light, end)) return false;
  wanted_.clear();
  forgetCorrections();
  sumUp(light);
  // Until it is known: all receivers get more of them.
  const auto fewest = [&] { return count_.empty() ? kEvenPaths : std::uint32_t{*std::ranges::min_element(count_)}; };
  const auto isUnsure = [&] { return found_ + deviation_ > bound && found_ < kSurely * deviation_; };
  while ((isUnsure() || paths_[0].size() < kFewestPaths) && fewest() < kEvenPaths) {
    if (!trace(twiceAsMany(), light, end)) return false;
    for (auto& count : count_)
      if (count < kEvenPaths) count = static_cast<std::uint16_t>(2 * count);
    sumUp(light);
  }
  // Where nothing varies one half of what is found by chance is below zero, and the other would be stated.
  const bool is_nothing = found_ <= deviation_ && found_ + deviation_ <= bound;
  left_ = is_nothing ? 0.0 : std::max(0.0, found_);
  noise_ = 0.0;
  giveBack(gain_);
  if (stands_for_ == 1.0 && found_ + deviation_ > bound) correct();
  for (auto& half : lacking_) giveBack(half);
  under_way_ = {};
  return true;
}

void LeafVariation::forgetCorrections() {
  corrects_ = false;
  giveBack(corrections_);
}

void LeafVariation::sumUp(const LeafLight& light) {
  inBothHalves([&](std::size_t half) {
    auto& lacking = lacking_[half];
    lacking.assign(light.reflectance.size(), {});
    for (const auto& path : paths_[half]) {
      const auto lack = this->lacking(path, light, half);
      lacking[path.receiver].sure += lack.sure;
      lacking[path.receiver].doubtful += lack.doubtful;
    }
    for (std::size_t r = 0; r < receivers_.size(); ++r) {
      lacking[receivers_[r]].sure /= static_cast<float>(count_[r]);
      lacking[receivers_[r]].doubtful /= static_cast<float>(count_[r]);
    }
  });
  double sum = 0.0, squares = 0.0;
  for (const auto value : receivers_) {
    if (!finds(lacking_[0][value]) || !finds(lacking_[1][value])) continue;
    // The halves are independent, so that their noise cancels in the product.
    const double product = glm::dot(all(lacking_[0][value]), all(lacking_[1][value]));
    if (product == 0.0) continue;
    const double here = rays_->areaOf(value) * product;
    sum += here;
    squares += here * here;
  }
  found_ = sum * stands_for_;
  deviation_ = std::sqrt(squares) * stands_for_;
}

/// Receivers get what they lack, as far as it is more than noise and sure.
void LeafVariation::correct() {
  corrects_ = true;
  gain_.assign(lacking_[0].size(), 0.0F);
  left_ = noise_ = unknown_ = doubtful_ = 0.0;
  for (const auto& side : sides_) weigh(side);
  left_ = std::max(0.0, left_);
}

/// What is found by chance at one leaf is not found at its neighbours too: a leaf gets as much of what it lacks as
/// there is of signal in signal and noise around it (Wiener), and nothing where noise is the larger part.
void LeafVariation::weigh(const Side& side) {
  std::vector<double> signal(side.leaf_count, 0.0), noise(signal), doubt(signal), lacking_area(signal);
  for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
    const auto &first = lacking_[0][side.first_value + leaf], &second = lacking_[1][side.first_value + leaf];
    const glm::dvec3 one = all(first), other = all(second), doubtful(0.5F * (first.doubtful + second.doubtful));
    if (one == glm::dvec3(0.0) && other == glm::dvec3(0.0)) continue;
    const double area = lacking_area[leaf] = rays_->areaOf(side.first_value + leaf);
    signal[leaf] = area * glm::dot(one, other);
    noise[leaf] = 0.25 * area * glm::dot(one - other, one - other);
    doubt[leaf] = area * glm::dot(doubtful, doubtful);
  }
  for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
    const auto value = side.first_value + leaf;
    const Neighbours around(side, leaf);
    const auto &first = lacking_[0][value], &second = lacking_[1][value];
    const double s = around.sumOf(signal), n = around.sumOf(noise);
    const bool found = s > n && s > 0.0, known = found && around.sumOf(doubt) < kDoubtful * s;
    if (!found) unknown_ += noise[leaf];
    if (found && !known) doubtful_ += signal[leaf];
    // A single path that brings much would be a blotch: of what one half alone has found no more is left than the root
    // of the signal around. More of its own noise would prefer leaves whose halves agree by chance.
    const double own =
        noise[leaf] > 0.0 ? kOwnNoise * noise[leaf] * around.sumOf(lacking_area) / lacking_area[leaf] : 0.0;
    const double weight = known ? s / (s + std::max(n, own)) : 0.0;
    if (known) {
      const auto part = static_cast<float>(weight);
      corrections_.push_back({value, {part * glm::vec3(all(first)), part * glm::vec3(all(second))}});
    }
    left_ += (1.0 - weight) * (1.0 - weight) * signal[leaf];
    noise_ += weight * weight * noise[leaf];
    gain_[value] = static_cast<float>(n + noise[leaf]);
  }
}

bool LeafVariation::refine() {
  if (gain_.empty() || paths_[0].size() + paths_[1].size() >= kMostInAll) return false;
  std::vector<std::uint32_t> order;
  double sum = 0.0;
  for (std::uint32_t r = 0; r < receivers_.size(); ++r) {
    if (count_[r] >= kMostPaths || gain_[receivers_[r]] <= 0.0F) continue;
    order.push_back(r);
    sum += static_cast<double>(gain_[receivers_[r]]);
  }
  std::ranges::sort(order, [&](std::uint32_t a, std::uint32_t b) {
    const float first = gain_[receivers_[a]] / count_[a], second = gain_[receivers_[b]] / count_[b];
    return first != second ? first > second : a < b;
  });
  double taken = 0.0;
  std::uint32_t added = 0;
  for (const auto r : order) {
    if (taken >= kRefinedPart * sum || added >= kMostAdded) break;
    taken += static_cast<double>(gain_[receivers_[r]]);
    added += count_[r];
    wanted_.push_back({receivers_[r], count_[r], 2U * count_[r]});
    count_[r] = static_cast<std::uint16_t>(2 * count_[r]);
  }
  return !wanted_.empty();
}

}  // namespace radiosity::solver
