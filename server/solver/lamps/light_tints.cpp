#include "server/solver/lamps/light_tints.h"

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <optional>
#include <utility>

#include "common/parallel.h"
#include "common/task.h"
#include "server/solver/math/sampling.h"

namespace radiosity::solver {
namespace {

using Clock = std::chrono::steady_clock;

/// Looks of each half from every leaf, and from one that sees several colours, or beside which another one is seen.
constexpr std::uint32_t kFirstLooks = 4, kAllLooks = 16;
/// In a step there come to be at most so many times as many looks.
constexpr double kMostAStep = 4.0;
/// Where the first agree the others are made with this chance.
constexpr double kAskAgain = 0.25;
/// Leaves, or blocks of them, that are looked from together at first: a few tenths of a second at most.
constexpr std::uint32_t kLeavesAtOnce = 2048;
/// Of these, between two points where the work may be interrupted.
constexpr std::uint32_t kLeavesBetween = 16;
/// Looks that differ by no more see one colour.
constexpr float kSameTint = 0.01F;
/// Of the width of a leaf: a ball around its middle.
constexpr double kAroundLeaf = 1.5;
/// What is left of a number that drew one of many lamps is as good as another number.
constexpr double kManyLamps = 65536.0;
/// Farther than the unit box is wide.
constexpr double kFar = 4.0;
/// What clocks can add, seconds.
constexpr double kLongest = 1e6;
constexpr std::uint64_t kTintSeed = 0x54494e54ULL;

/// From a point of a surface with this normal, for an emission of one.
SourceLook lookAtPoint(const LeafRays::Place& place, const glm::dvec3& point, const glm::dvec3& normal) {
  const auto way = point - place.position;
  const double square = glm::dot(way, way), arrives = glm::dot(place.normal, way), leaves = -glm::dot(normal, way);
  if (!(arrives > 0.0 && leaves > 0.0)) return {way, 0.0};
  return {way, arrives * leaves / (square * square)};
}

/// So that a pane of one colour makes one run of links.
glm::vec3 rounded(const glm::dvec3& tint) {
  constexpr double kSteps = 65536.0;
  return glm::vec3(glm::round(glm::max(tint, 0.0) * kSteps) / kSteps);
}

}  // namespace

void LightTints::Seen::add(double brings, const LeafRays::Passage& passage) {
  if (!(brings * passage.part > 0.0)) return;
  part += brings * passage.part;
  light += brings * passage.light();
  least = glm::min(least, passage.tint);
  most = glm::max(most, passage.tint);
}

bool LightTints::Seen::differs() const {
  const auto range = most - least;
  return part > 0.0 && std::max({range.x, range.y, range.z}) > static_cast<double>(kSameTint);
}

LightTints::Sender LightTints::of(const LightPolygon& lamp) {
  return {lamp.key, ballOf(lamp), [lamp](const LeafRays::Place& place, const glm::dvec2& at) {
            return lookAtPoint(place, glm::dvec3(lamp.point(at.x, at.y)), glm::dvec3(lamp.normal));
          }};
}

LightTints::Sender LightTints::of(const PunctualLights::Source& source) {
  return {mixKeys(source.shapeKey(), 1), ballOf(source),
          [source](const LeafRays::Place& place, const glm::dvec2& at) { return lookAt(source, place, at); }};
}

LightTints::Sender LightTints::of(const Crowd& crowd) {
  return {mixKeys(crowd.key, 2),
          {glm::dvec3(0.0), HUGE_VAL, false},
          [lamps = crowd.lamps](const LeafRays::Place& place, const glm::dvec2& at) {
            // As light arrives at the place: a lamp near by counts for more than all others.
            const auto drawn = lamps->draw(LeafRays::startOf(place), glm::vec3(place.normal), at.x);
            if (drawn.light == scene::kNone) return SourceLook{};
            const auto& lamp = lamps->lights()[drawn.light];
            const double again = at.x * kManyLamps, u = again - std::floor(again);
            auto look = lookAtPoint(place, glm::dvec3(lamp.point(u, at.y)), glm::dvec3(lamp.normal));
            look.brings *= lamps->strength(drawn.light) * lamp.area / drawn.chance;
            return look;
          }};
}

LightTints::Sender LightTints::of(const Side& side, const NodePlace& node, std::shared_ptr<const LeafRays> rays) {
  struct Leaf {
    std::uint32_t value;
    double area;
  };
  std::vector<Leaf> leaves;
  const auto rect = leafRect(side, node);
  glm::dvec3 low(HUGE_VAL), high(-HUGE_VAL);
  for (auto y = rect.y0; y < rect.y1; ++y) {
    for (auto x = rect.x0; x < rect.x1; ++x) {
      const auto value = side.first_value + y * side.width + x;
      if (!(rays->areaOf(value) > 0.0)) continue;
      leaves.push_back({value, rays->areaOf(value)});
      const auto middle = rays->placeOn(value, {0.5, 0.5}).position;
      low = glm::min(low, middle - kAroundLeaf * rays->widthOf(value));
      high = glm::max(high, middle + kAroundLeaf * rays->widthOf(value));
    }
  }
  const auto key = mixKeys(mixKeys(side.key, 3), mixKeys(node.level, std::uint64_t{node.x} << 32U | node.y));
  if (leaves.empty()) return {key, {}, [](const auto&, const auto&) { return SourceLook{}; }};
  return {key,
          {0.5 * (low + high), 0.5 * glm::distance(low, high), false},
          [leaves = std::move(leaves), rays = std::move(rays)](const LeafRays::Place& place, const glm::dvec2& at) {
            const double along = at.x * static_cast<double>(leaves.size());
            const auto& leaf = leaves[std::min(leaves.size() - 1, static_cast<std::size_t>(along))];
            const auto there = rays->placeOn(leaf.value, {along - std::floor(along), at.y});
            auto look = lookAtPoint(place, there.position, there.normal);
            look.brings *= leaf.area;
            return look;
          }};
}

LightTints::LightTints(const scene::PatchScene& patches, const std::vector<Side>& sides, std::uint64_t seed,
                       std::size_t most_bytes)
    : patches_(patches), sides_(sides), seed_(mixKeys(seed, kTintSeed)), most_bytes_(most_bytes) {
  for (const auto& surface : patches.surfaces)
    if (surface.first_tint != scene::kNone) boxes_.push_back({surface.bounds_min, surface.bounds_max});
  scene::joinBoxes(boxes_);
}

/// Whether a way from the ball to the sender meets the box of something coloured.
bool LightTints::mayTint(const Sender& sender, const glm::dvec3& centre, double radius) const {
  const auto& ball = sender.ball;
  if (!std::isfinite(ball.radius)) return true;
  const auto way = ball.is_far ? kFar * ball.centre : ball.centre - centre;
  const glm::dvec3 half(radius + (ball.is_far ? kFar : 1.0) * ball.radius);
  return std::ranges::any_of(boxes_, [&](const auto& box) { return scene::sweeps(centre, half, way, 1.0, box); });
}

bool LightTints::mayTint(const Sender& sender, const Side& side) const {
  const auto& surface = patches_.surfaces[side.surface];
  const glm::dvec3 low(surface.bounds_min), high(surface.bounds_max);
  return mayTint(sender, 0.5 * (low + high), 0.5 * glm::distance(low, high));
}

bool LightTints::refine(double times) {
  const auto before = times_;
  while (times_ < kMostTimes && times_ < std::min(times, kMostAStep) * before) times_ *= 2;
  return times_ > before;
}

void LightTints::begin(std::vector<Sender> senders, std::shared_ptr<const LeafRays> rays) {
  senders_ = std::move(senders);
  rays_ = std::move(rays);
  at_ = next_ = 0;
  pending_.clear();
  parts_.clear();
  auto before = std::exchange(known_, {});
  for (const auto& sender : senders_) {
    const auto same = std::ranges::find_if(
        before, [&](const Known& known) { return known.key == sender.key && known.times == times_ && known.is_whole; });
    known_.push_back(same != before.end() ? *same : Known{sender.key, times_, 0, false, {}});
  }
}

/// Of the sender at at_: where to look from. So many leaves in a row have one colour that all senders have room.
void LightTints::plan() {
  const auto& sender = senders_[at_];
  std::vector<std::uint32_t> sides;
  std::uint64_t leaves = 0;
  for (std::uint32_t s = 0; s < sides_.size(); ++s) {
    if (s % kLeavesAtOnce == 0) interruptionPoint();
    if (!mayTint(sender, sides_[s])) continue;
    sides.push_back(s);
    leaves += sides_[s].leaf_count;
  }
  const auto most = std::max<std::uint64_t>(1, most_bytes_ / (2 * LinkTint::kRunBytes * senders_.size()));
  auto& block = known_[at_].block;
  block = static_cast<std::uint32_t>(std::clamp<std::uint64_t>((leaves + most - 1) / most, 1, 1U << 20U));
  for (const auto s : sides) {
    const auto width = std::max(1U, sides_[s].width), together = std::max(1U, kLeavesAtOnce / times_) * block;
    const auto down = std::max(1U, block / width), rows = std::max(1U, together / width / down) * down;
    for (std::uint32_t first = 0; first < sides_[s].height; first += rows)
      pending_.push_back({s, first, std::min(sides_[s].height, first + rows)});
  }
  parts_.assign(pending_.size(), {});
  next_ = 0;
}

/// Each thread makes one of the looks at least.
bool LightTints::advance(double seconds) {
  const auto end = Clock::now() + std::chrono::duration_cast<Clock::duration>(
                                      std::chrono::duration<double>(std::min(seconds, kLongest)));
  for (; at_ < senders_.size(); ++at_) {
    if (known_[at_].is_whole) continue;
    if (known_[at_].block == 0) plan();
    std::atomic<std::size_t> next{next_};
    inShares(pending_.size() - next_, [&](std::size_t, std::size_t) {
      do {
        const auto at = next++;
        if (at >= pending_.size()) return;
        parts_[at] = lookFrom(pending_[at]);
      } while (Clock::now() < end);
    });
    next_ = std::min(pending_.size(), next.load());
    if (next_ < pending_.size()) return false;
    finish();
    if (Clock::now() >= end) return ++at_ == senders_.size();
  }
  return true;
}

void LightTints::finish() {
  auto& known = known_[at_];
  for (std::size_t half = 0; half < 2; ++half) {
    LinkTint all;
    for (const auto& part : parts_) all.add(part[half]);
    known.tint[half] = all.empty() ? nullptr : std::make_shared<const LinkTint>(std::move(all));
  }
  known.is_whole = true;
  pending_.clear();
  parts_.clear();
  next_ = 0;
}

/// Looks first to end - 1 of a leaf.
void LightTints::look(std::uint32_t value, std::uint64_t key, std::uint32_t first, std::uint32_t end,
                      Seen& seen) const {
  const Sobol4 draws(key);
  for (auto k = first; k < end; ++k) {
    const auto draw = draws(k);
    const auto place = rays_->placeOn(value, {draw.x, draw.y});
    const auto at = senders_[at_].look(place, {draw.z, draw.w});
    if (at.brings > 0.0 && glm::dot(place.normal, at.way) > 0.0)
      seen.add(at.brings, rays_->passageTo(place, place.position + at.way));
  }
}

std::uint64_t LightTints::keyOf(std::uint32_t value, std::size_t half) const {
  const auto& side = rays_->sideOf(value);
  const auto of_leaf = mixKeys(mixKeys(seed_, side.key), std::uint64_t{value - side.first_value});
  return mixKeys(mixKeys(of_leaf, senders_[at_].key), half);
}

/// Of a leaf whose first looks are done. Those at edges are looked from as often as there is reason to; of others of
/// which the first looks agree some are, and stand for the others: else what takes a small part of the light would
/// count for less than it is. Nothing: no look sees anything of the sender.
std::optional<glm::vec3> LightTints::ask(std::uint32_t value, std::size_t half, bool is_edge, Seen seen) const {
  const auto key = keyOf(value, half);
  const double chance = std::min(1.0, kAskAgain * times_);
  const bool asks_all = is_edge || seen.differs();
  if (!asks_all && (!(seen.part > 0.0) || uniformFromKey(mixKeys(key, kTintSeed)) >= chance))
    return seen.part > 0.0 ? std::optional(rounded(seen.tint())) : std::nullopt;
  const auto first = seen.part > 0.0 ? seen.tint() : glm::dvec3(1.0);
  look(value, key, kFirstLooks, times_ * kAllLooks, seen);
  if (!(seen.part > 0.0)) return std::nullopt;
  return rounded(!asks_all && seen.differs() ? first + (seen.tint() - first) / chance : seen.tint());
}

std::array<LinkTint, 2> LightTints::lookFrom(const Rows& rows) const { return {lookFrom(rows, 0), lookFrom(rows, 1)}; }

/// Leaves that see nothing, though their links may say that something arrives, have the mean of those beside them that
/// do, or else of all of these rows.
LinkTint LightTints::lookFrom(const Rows& rows, std::size_t half) const {
  const auto& side = sides_[rows.side];
  const auto block = known_[at_].block;
  // Blocks are parts of a row, or whole rows.
  const auto across = std::min(block, side.width), down = std::max(1U, block / side.width);
  const auto columns = (side.width + across - 1) / across, height = (rows.end - rows.first + down - 1) / down;
  struct Block {
    std::uint32_t value = scene::kNone;  ///< the leaf that is asked; kNone: none has area
    bool may_tint = false;
    Seen first;
  };
  std::vector<Block> blocks(std::size_t{columns} * height);
  const auto rowOf = [&](std::uint32_t i) { return rows.first + i / columns * down; };
  for (std::uint32_t i = 0; i < blocks.size(); ++i) {
    if (i % kLeavesBetween == 0) interruptionPoint();
    auto& one = blocks[i];
    const auto begin = i % columns * across, end = std::min(side.width, begin + across);
    for (auto x = begin; x < end && one.value == scene::kNone; ++x) {
      const auto value = side.first_value + rowOf(i) * side.width + x;
      if (rays_->areaOf(value) > 0.0) one.value = value;
    }
    if (one.value == scene::kNone) continue;
    const auto middle = rays_->placeOn(one.value, {0.5, 0.5});
    one.may_tint = mayTint(senders_[at_], middle.position, kAroundLeaf * rays_->widthOf(one.value));
    if (one.may_tint) look(one.value, keyOf(one.value, half), 0, kFirstLooks, one.first);
  }
  const auto firstTint = [&](const Block& one) { return one.may_tint ? one.first.tint() : glm::dvec3(1.0); };
  const auto isEdge = [&](std::uint32_t i) {
    const auto differs = [&](bool is_there, std::uint32_t other) {
      if (!is_there || blocks[i].value == scene::kNone || blocks[other].value == scene::kNone) return false;
      const auto sees = [](const Block& one) { return !one.may_tint || one.first.part > 0.0; };
      return sees(blocks[i]) && sees(blocks[other]) &&
             glm::distance(firstTint(blocks[i]), firstTint(blocks[other])) > static_cast<double>(kSameTint);
    };
    const auto x = i % columns, y = i / columns;
    return differs(x > 0, i - 1) || differs(x + 1 < columns, i + 1) || differs(y > 0, i - columns) ||
           differs(y + 1 < height, i + columns);
  };
  std::vector<std::optional<glm::vec3>> found(blocks.size());
  glm::vec3 sum(0.0F);
  float count = 0.0F;
  for (std::uint32_t i = 0; i < blocks.size(); ++i) {
    if (i % kLeavesBetween == 0) interruptionPoint();
    const auto& one = blocks[i];
    if (one.value == scene::kNone) continue;
    found[i] = one.may_tint ? ask(one.value, half, isEdge(i), one.first) : glm::vec3(1.0F);
    if (!found[i]) continue;
    sum += *found[i];
    count += 1.0F;
  }
  const auto beside = [&](std::uint32_t i) {
    glm::vec3 mean(0.0F);
    float known = 0.0F;
    const auto row = i / columns, column = i % columns;
    for (auto y = row - std::min(row, 1U); y < std::min(row + 2, height); ++y) {
      for (auto x = column - std::min(column, 1U); x < std::min(column + 2, columns); ++x) {
        const auto& near = found[std::size_t{y} * columns + x];
        if (!near) continue;
        known += 1.0F;
        mean += *near;
      }
    }
    return known > 0.0F ? mean / known : sum / count;
  };
  LinkTint tint;
  for (std::uint32_t i = 0; i < found.size() && count > 0.0F; ++i) {
    const auto x = i % columns * across, lines = std::min(down, rows.end - rowOf(i));
    tint.add(side.first_value + rowOf(i) * side.width + x,
             down > 1 ? lines * side.width : std::min(across, side.width - x), found[i] ? *found[i] : beside(i));
  }
  return tint;
}

}  // namespace radiosity::solver
