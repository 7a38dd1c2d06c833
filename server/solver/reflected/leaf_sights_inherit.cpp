// LeafSights after an edit of geometry: rays that pass nothing that changed see what they saw.
#include <algorithm>
#include <array>
#include <numeric>
#include <optional>

#include "server/solver/math/halves.h"
#include "server/solver/reflected/leaf_sights.h"

namespace radiosity::solver {
namespace {

/// Rays and boxes are held against each other with so much to spare (unit box).
constexpr double kMargin = 1e-5;
/// Farther than the unit box is wide.
constexpr double kFar = 4.0;
/// After an edit new leaves never have more rays of a half than these where all new ones together would have more than
/// the scene had, or than these.
constexpr std::uint16_t kMostOfNew = 32;
constexpr std::size_t kFewForNew = 65'536;

}  // namespace

bool LeafSights::passes(std::span<const scene::ChangedBox> boxes, std::uint32_t value, const glm::dvec4& draw) const {
  const auto place = rays_->placeOn(value, {draw.z, draw.w});
  const auto direction = cosineDirection(place.normal, draw.x, draw.y);
  return std::ranges::any_of(boxes, [&](const scene::ChangedBox& box) {
    return scene::sweeps(place.position, glm::dvec3(kMargin), direction, kFar, box);
  });
}

/// A step of the scene before and those that it goes on to; kUntraced: where it passes may have changed, or is not
/// known. Where a ray into the sky passes never is.
std::uint32_t LeafSights::inheritStep(std::size_t half, std::uint32_t end, const Inheritance& from) {
  const auto& former = from.former;
  const auto& step = former.steps_[half][end - former.endCount()];
  const bool is_last = step.next < former.endCount();
  const auto then = is_last ? step.next : leafOf(former.steps_[half][step.next - former.endCount()]);
  const auto by = from.value_after[leafOf(step)], to = from.value_after[then];
  if (by == kUntraced || to == kUntraced || to >= leaf_count_) return kUntraced;
  if (from.stands_in[by] || from.stands_in[to] || from.change.mayHide(by, to)) return kUntraced;
  const auto next = is_last ? to : inheritStep(half, step.next, from);
  if (next == kUntraced) return kUntraced;
  auto code = by;
  if (SpecularStep::is(step.by)) {
    auto mirror = SpecularStep::of(step.by);
    mirror.leaf = by;
    code = mirror.code();
  }
  steps_[half].push_back({code, next});
  return endCount() + static_cast<std::uint32_t>(steps_[half].size() - 1);
}

/// Who was seen in the place of a leaf without area, and is no longer: which rays saw that is not known, so none that
/// ended there are.
void LeafSights::forgetStandIns(const LeafSights& former, std::vector<std::uint32_t>& value_after) const {
  const auto after = value_after;
  for (std::uint32_t before = 0; before < former.leaf_count_; ++before) {
    const auto stood_in = former.rays_->standInOf(before);
    if (stood_in == before) continue;
    const auto seen = stood_in == LeafRays::kNothing ? former.absorbed() : stood_in;
    const auto here = after[before];
    const auto now = here == kUntraced ? LeafRays::kNothing : rays_->standInOf(here);
    const bool is_same = here != kUntraced && (now == LeafRays::kNothing ? absorbed() : now) == after[seen];
    if (!is_same) value_after[seen] = kUntraced;
  }
}

/// How many rays of it are known.
std::uint64_t LeafSights::inheritHalf(std::size_t half, const Inheritance& from) {
  const auto& former = from.former;
  std::uint64_t known = 0;
  widen(half, former.steps_[half].size());
  FirstMet met;
  std::size_t first_ray = 0;
  for (std::uint32_t value = 0; value < leaf_count_; first_ray += count_[value++]) {
    const auto before = from.value_before[value];
    if (count_[value] == 0 || before == scene::kNone || former.count_[before] == 0) continue;
    const auto old = former.ends(half, former.firstOf(before), std::min(former.count_[before], count_[value]));
    const auto look = from.change.lookFrom(value);
    findFirstMet(half, old, look, from, met);
    known += inheritLeaf({value, half, first_ray}, old, look, from, met);
  }
  return known;
}

void LeafSights::findFirstMet(std::size_t half, const PackedNumbers::Run& old, const Shadows::Look& look,
                              const Inheritance& from, FirstMet& met) const {
  const auto& former = from.former;
  const auto untraced = former.seen_[half].most(), ends = former.endCount();
  met.resize(old.size());
  std::size_t k = 0;
  for (const auto end : old) {
    const bool goes_on = end >= ends && end != untraced;
    const auto by = goes_on ? leafOf(former.steps_[half][end - ends]) : end;
    const auto after = end == untraced ? kUntraced : from.value_after[by];
    met.end[k] = after;
    met.leaf[k++] = after < leaf_count_ ? static_cast<std::int32_t>(after) : 0;
  }
  look.screen(met.leaf, met.may_hide.data());
}

std::uint64_t LeafSights::inheritLeaf(const LeafRun& leaf, const PackedNumbers::Run& old, const Shadows::Look& look,
                                      const Inheritance& from, const FirstMet& met) {
  const auto& former = from.former;
  const auto [value, half, first_ray] = leaf;
  std::uint64_t known = 0;
  const auto& change = from.change.change();
  std::optional<Sobol4> draw;  // few leaves need it
  for (std::uint32_t k = 0; k < old.size(); ++k) {
    const auto first = met.end[k];
    if (first == kUntraced) continue;  // it saw what is gone, or moved
    // What is gone had hidden nothing from a ray whose end is known, and may be what another ended on.
    const bool is_known = first < leaf_count_ || isSky(first);
    const bool may_pass =
        first >= leaf_count_ || from.stands_in[first] || (met.may_hide[k] != 0 && look.mayHideScreened(first));
    if (may_pass && !draw) draw.emplace(draws(value, rays_->sideOf(value), half));
    if (may_pass && passes(is_known ? change.came : change.boxes, value, (*draw)(k))) continue;
    const auto end = old[k] >= former.endCount() ? inheritStep(half, old[k], from) : first;
    if (end == kUntraced) continue;
    seen_[half].set(first_ray + k, end);
    ++known;
  }
  return known;
}

void LeafSights::inherit(const LeafSights& former, std::span<const std::uint32_t> value_before, const Shadows& change,
                         std::uint16_t most) {
  tells_cells_ = former.tells_cells_;
  // New leaves get as many rays as most have: in the middle of all.
  auto sorted = former.count_;
  std::erase(sorted, 0);
  if (sorted.empty()) return;
  std::ranges::nth_element(sorted, sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2));
  auto usual = std::min(sorted[sorted.size() / 2], most);
  // In a scene of a few leaves, of thousands of rays each, they might be thousands.
  const auto before = std::reduce(sorted.begin(), sorted.end(), std::size_t{0});
  const auto news = static_cast<std::size_t>(std::ranges::count(value_before, scene::kNone));
  while (usual > kMostOfNew && usual * news > std::max(before, kFewForNew)) usual /= 2;
  std::vector<std::uint16_t> counts(leaf_count_, usual);
  std::vector<std::uint32_t> value_after(former.endCount(), kUntraced);
  value_after[former.absorbed()] = absorbed();
  value_after[former.absorbedAtOnce()] = absorbedAtOnce();
  for (std::uint32_t i = 0; i < skyCount(); ++i) value_after[former.firstOfSky() + i] = firstOfSky() + i;
  for (std::uint32_t value = 0; value < leaf_count_; ++value) {
    if (value_before[value] == scene::kNone) continue;
    if (SpecularLeaves::goOnAlike(mirrors_.get(), value, former.mirrors_.get(), value_before[value]))
      value_after[value_before[value]] = value;
    if (former.count_[value_before[value]] > 0) counts[value] = std::min(most, former.count_[value_before[value]]);
  }
  forgetStandIns(former, value_after);
  ask(counts);
  for (std::uint32_t value = 0; value < leaf_count_ && !former.partly_inside_.empty(); ++value) {
    partly_inside_.resize(leaf_count_);
    partly_inside_[value] = value_before[value] != scene::kNone && former.partly_inside_[value_before[value]];
  }
  before_.assign(leaf_count_, 0);
  std::vector<bool> stands_in(leaf_count_, false);
  for (std::uint32_t value = 0; value < leaf_count_; ++value) {
    const auto seen = rays_->standInOf(value);
    if (seen != value && seen < leaf_count_) stands_in[seen] = true;
  }
  const Inheritance from{former, value_before, value_after, stands_in, change};
  std::array<std::uint64_t, 2> known{};
  inBothHalves([&](std::size_t half) { known[half] = inheritHalf(half, from); });
  is_short_ = former.is_short_;
  kept_ = former.kept_ + known[0] + known[1];
  traced_ = former.traced_;
}

}  // namespace radiosity::solver
