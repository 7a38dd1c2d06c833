#include "server/solver/reflected/caustic_light.h"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <glm/geometric.hpp>
#include <utility>

#include "common/give_back.h"
#include "common/parallel.h"
#include "common/take_first.h"
#include "server/solver/math/sampling.h"

namespace radiosity::solver {
namespace {

using Clock = std::chrono::steady_clock;

/// Paths of each half for each leaf that there is, of all lamps together, at first: so many that the noise is likely to
/// be this part of the light of lamps, but no more than kFirstPaths.
constexpr double kFirstPaths = 2.0, kFirstNoise = 0.01;
/// And of each lamp.
constexpr std::uint32_t kLeastPaths = 4096, kMostFirst = std::uint32_t{1} << 23U;
/// Those that are followed in one go, by one thread and by all: a few milliseconds, and some tens of them.
constexpr std::uint32_t kAtOnce = 1024, kGoesAtOnce = 16;
/// Rays of a path: from the lamp, and on from what reflects.
constexpr std::uint32_t kRaysAPath = 3;
/// In a step there come to be at most so many times as many paths.
constexpr double kMostTimesAStep = 4.0;
/// Of all room, what lamps may take that are no longer there.
constexpr std::size_t kSpareRoom = 4;
/// Light that grazes the surface counts for a shading normal as if it came at this cosine.
constexpr double kLeastCosine = 0.02;
constexpr std::uint64_t kCausticSeed = 0x43415553544943ULL;

}  // namespace

/// Of light that is spread evenly the square of the noise is that of the mirrored part, times the leaves, by paths.
std::uint32_t CausticLight::firstPathsOf(const CausticPaths& paths, std::size_t lamp, std::uint32_t leaves) {
  const double part = paths.partOf(lamp) / kFirstNoise, a_leaf = std::min(kFirstPaths, part * part);
  const double all = a_leaf * leaves / static_cast<double>(paths.lampCount());
  const auto each = std::clamp(static_cast<std::uint32_t>(std::min(all, double{kMostFirst})), kLeastPaths, kMostFirst);
  return std::bit_ceil(each);
}

const CausticLight::OfLamp* CausticLight::findKnown(std::uint64_t key) const {
  for (const auto* lamps : {&known_, &spare_}) {
    const auto found = std::ranges::find(*lamps, key, &OfLamp::key);
    if (found != lamps->end()) return &*found;
  }
  return nullptr;
}

void CausticLight::begin(Lamps lamps, const LeafShading* shading, std::uint32_t leaves) {
  if (is_given_up_) lamps = {};
  if (shading != std::exchange(shading_, shading)) known_.clear(), spare_.clear();
  std::vector<OfLamp> next;
  const auto count = lamps.paths ? lamps.paths->lampCount() : 0;
  for (std::size_t i = 0; i < count; ++i) {
    const auto key = lamps.paths->keyOf(i);
    auto same = takeFirst({&known_, &spare_}, [&](const OfLamp& lamp) { return lamp.key == key; });
    // However many other lamps there are by then, that it comes back changes no bit.
    next.push_back(same ? std::move(*same) : OfLamp{key, firstPathsOf(*lamps.paths, i, leaves)});
  }
  open_.reset();
  keepSpare();
  known_ = std::move(next);
  lamps_ = std::move(lamps);
}

/// What is known of lamps that are not there any more, as far as there is room: those that are switched off come back.
void CausticLight::keepSpare() {
  std::ranges::move(known_, std::back_inserter(spare_));
  known_.clear();
  while (!spare_.empty() && bytes() > most_bytes_ / kSpareRoom) spare_.erase(spare_.begin());
}

bool CausticLight::isBehind() const {
  return std::ranges::any_of(known_, [&](const OfLamp& lamp) { return lamp.followed < wantedOf(lamp); });
}

std::uint64_t CausticLight::raysFor(const Lamps& lamps, std::uint32_t leaves) const {
  if (!lamps.paths || is_given_up_) return 0;
  std::uint64_t paths = 0;
  for (std::size_t i = 0; i < lamps.paths->lampCount(); ++i) {
    const auto* known = findKnown(lamps.paths->keyOf(i));
    if (known == nullptr) paths += std::uint64_t{firstPathsOf(*lamps.paths, i, leaves)} * times_;
    if (known != nullptr) paths += wantedOf(*known) - std::min(known->followed, wantedOf(*known));
  }
  return paths * 2 * kRaysAPath;
}

bool CausticLight::refine(double times) {
  if (!lamps_.paths) return false;
  const auto before = times_;
  while (times_ < kMostTimes && times_ < std::min(times, kMostTimesAStep) * before) times_ *= 2;
  return times_ > before;
}

bool CausticLight::advance(double seconds) {
  const auto begin = Clock::now();
  for (std::size_t i = 0; i < known_.size(); ++i) {
    if (known_[i].followed >= wantedOf(known_[i])) {  // those that were given up before the last may be enough now
      for (std::size_t half = 0; half < 2; ++half)
        if (!known_[i].fresh[half].empty()) merge(known_[i].leaves[half], known_[i].fresh[half]);
      continue;
    }
    if (!open_ || open_->lamp != i) open_.emplace(OpenLamp{i, lamps_.paths->startsOf(i)});
    if (open_->starts.empty()) known_[i].followed = wantedOf(known_[i]);
    while (known_[i].followed < wantedOf(known_[i])) {
      followSome(known_[i], *open_);
      if (bytes() > most_bytes_) spare_.clear();
      if (bytes() > most_bytes_) {
        giveUp();
        return true;
      }
      if (std::chrono::duration<double>(Clock::now() - begin).count() >= seconds) return !isBehind();
    }
  }
  open_.reset();
  return true;
}

/// There is no room for what they bring: whoever asked for them has to do without.
void CausticLight::giveUp() {
  is_given_up_ = true;
  lamps_ = {};
  open_.reset();
  known_.clear();
  spare_.clear();
}

/// In the order of paths, whoever followed them.
void CausticLight::followSome(OfLamp& known, const OpenLamp& open) {
  const auto first = known.followed, wanted = wantedOf(known),
             goes = std::min(kGoesAtOnce, (wanted - first + kAtOnce - 1) / kAtOnce);
  std::array<std::vector<Leaves>, 2> brought;
  for (auto& half : brought) half.resize(goes);
  inTurns(std::size_t{2} * goes, [&](std::size_t turn) {
    const auto from = first + static_cast<std::uint32_t>(turn / 2) * kAtOnce;
    brought[turn % 2][turn / 2] = follow(open, turn % 2, from, std::min(wanted, from + kAtOnce));
  });
  const auto followed = std::min(wanted, first + goes * kAtOnce);
  for (std::size_t half = 0; half < 2; ++half) {
    auto& fresh = known.fresh[half];
    for (const auto& some : brought[half]) fresh.insert(fresh.end(), some.begin(), some.end());
    if (followed == wanted || fresh.size() > known.leaves[half].size()) merge(known.leaves[half], fresh);
  }
  known.followed = followed;
}

/// `into` is by value; in `fresh`, which is empty then, there may be several of one leaf.
void CausticLight::merge(Leaves& into, Leaves& fresh) {
  std::ranges::stable_sort(fresh, {}, &Leaf::value);
  Leaves merged;
  merged.reserve(into.size() + fresh.size());
  const auto add = [&](const Leaf& leaf) {
    if (merged.empty() || merged.back().value != leaf.value) return merged.push_back(leaf);
    merged.back().light += leaf.light;
    merged.back().shaded += leaf.shaded;
  };
  auto known = into.begin();
  for (const auto& leaf : fresh) {
    while (known != into.end() && known->value <= leaf.value) add(*known++);
    add(leaf);
  }
  merged.insert(merged.end(), known, into.end());
  merged.shrink_to_fit();
  into = std::move(merged);
  giveBack(fresh);
}

CausticLight::Leaves CausticLight::follow(const OpenLamp& open, std::size_t half, std::uint32_t first,
                                          std::uint32_t end) const {
  const auto& [lamp, starts] = open;
  const auto key = mixKeys(mixKeys(seed_ ^ kCausticSeed, lamps_.paths->keyOf(lamp)), half);
  const Sobol4 towards(key), anywhere(mixKeys(key, 1));
  std::array<CausticPaths::Arrival, CausticPaths::kMostArrivals> arrivals;
  Leaves brought;
  for (auto i = first; i < end; ++i) {
    const auto turn = i / CausticPaths::kOneAnywhere, within = i % CausticPaths::kOneAnywhere;
    const auto way = within == 0 ? CausticPaths::Way::kAnywhere : CausticPaths::Way::kTowards;
    const auto draw = within == 0 ? anywhere(turn) : towards(turn * (CausticPaths::kOneAnywhere - 1) + within - 1);
    const auto count = lamps_.paths->follow(lamp, starts, way, draw, mixKeys(key, i + std::uint64_t{2}), arrivals);
    for (std::size_t k = 0; k < count; ++k) brought.push_back(broughtTo(arrivals[k]));
  }
  return brought;
}

CausticLight::Leaf CausticLight::broughtTo(const CausticPaths::Arrival& arrival) const {
  Leaf leaf{arrival.place.value, scene::kNone};
  const auto area = rays_->areaOf(leaf.value);
  if (!(area > 0.0)) return leaf;
  leaf.light = glm::vec3(arrival.flux / area);
  if (shading_ == nullptr || shading_->empty()) return leaf;
  leaf.number = shading_->numberOf(leaf.value);
  if (leaf.number == scene::kNone) return leaf;
  const double cosine = std::max(kLeastCosine, -glm::dot(arrival.place.normal, arrival.direction));
  const double shaded = std::max(0.0, -glm::dot(glm::dvec3(shading_->normal(leaf.number)), arrival.direction));
  leaf.shaded = glm::vec3(arrival.flux * (shaded / cosine / area));
  return leaf;
}

void CausticLight::addTo(std::size_t half, std::vector<glm::vec3>& irradiance) const {
  for (std::size_t i = 0; i < known_.size(); ++i) {
    if (known_[i].followed == 0) continue;
    const auto light = lamps_.light[i] / static_cast<float>(known_[i].followed);
    for (const auto& leaf : known_[i].leaves[half]) irradiance[leaf.value] += light * leaf.light;
  }
}

void CausticLight::addShadedTo(std::size_t half, std::vector<glm::vec3>& irradiance) const {
  for (std::size_t i = 0; i < known_.size(); ++i) {
    if (known_[i].followed == 0) continue;
    const auto light = lamps_.light[i] / static_cast<float>(known_[i].followed);
    for (const auto& leaf : known_[i].leaves[half])
      if (leaf.number != scene::kNone) irradiance[leaf.number] += light * leaf.shaded;
  }
}

std::size_t CausticLight::bytes() const {
  std::size_t bytes = 0;
  for (const auto* lamps : {&known_, &spare_})
    for (const auto& lamp : *lamps)
      for (const auto* leaves : {&lamp.leaves, &lamp.fresh})
        bytes += ((*leaves)[0].size() + (*leaves)[1].size()) * sizeof(Leaf);
  return bytes;
}

}  // namespace radiosity::solver
