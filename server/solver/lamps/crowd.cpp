#include "server/solver/lamps/crowd.h"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <numbers>
#include <utility>

#include "common/parallel.h"
#include "server/solver/math/polygon_directions.h"
#include "server/solver/math/polygon_form_factor.h"
#include "server/solver/math/sampling.h"
#include "server/solver/transport/link_column.h"

namespace radiosity::solver {
namespace {

/// Lamps that are shooters whatever they send, at most and at least, and the part of the memory that their links may
/// take between the two. Each has links of its own then, which edits of its light keep. In closed rooms 1,000 take two
/// thirds of the time of a crowd and come to a smaller error, 2,000 as long, of which all is dark until the last is
/// measured.
constexpr std::size_t kMostFew = 1024, kLeastFew = 256, kFewPart = 4;
/// Of more lamps only those are that send this part of the whole or more.
constexpr double kStrong = 1.0 / 32.0;
/// Colours that differ by no more than rounding are one.
constexpr float kSameColour = 1e-5F;
/// Lamps that may bring so much of what they emit are asked one by one, by directions that bring the same light each:
/// the tree knows too little of what is near, and points would bring more the nearer they are, without bound. Where
/// these are more than so many, only still nearer ones are.
constexpr float kNear = 0.02F, kNearest = 1.0F;
constexpr std::size_t kMostNear = 32;
/// Ways end so far before a lamp (unit box), as those of LightSight.
constexpr float kSpare = 2e-6F;
/// A way that is followed by see() is open if it ends no farther than this before the lamp.
constexpr double kAtLamp = 1e-5;
/// Rays that say how much of the light is lost, in a sample.
constexpr std::uint32_t kLostRays = 4096;
/// Leaves that a thread takes at a time, and those between two looks at the clock.
constexpr std::size_t kBlock = 128, kSlice = 16'384;
/// Who is in a hurry takes one leaf for as many by as many.
constexpr std::uint32_t kCoarse = 8;

constexpr std::uint64_t kPlaces = 0x43524f31ULL, kLamps = 0x43524f32ULL, kNearby = 0x43524f33ULL,
                        kStarts = 0x43524f34ULL, kDirections = 0x43524f35ULL, kBlocks = 0x43524f36ULL;

float strongest(const glm::vec3& colour) { return std::max({colour.x, colour.y, colour.z}); }
double powerOf(const LightPolygon& light) {
  return light.area * static_cast<double>(light.emission.x + light.emission.y + light.emission.z);
}

/// Whether it is of these lamps, of the same strengths but for rounding: as those of lamps that are dimmed alike are.
bool isOf(const Crowd& crowd, std::span<const LightPolygon> lamps, std::span<const float> strengths) {
  if (!crowd.lamps || crowd.lamps->lights().size() != lamps.size()) return false;
  for (std::uint32_t i = 0; i < lamps.size(); ++i) {
    const auto strength = static_cast<float>(crowd.lamps->strength(i));
    if (crowd.lamps->lights()[i].key != lamps[i].key ||
        !(std::abs(strength - strengths[i]) <= kSameColour * strengths[i]))
      return false;
  }
  return true;
}

bool isOneColour(std::span<const LightPolygon> lights) {
  const auto unit = [](const glm::vec3& colour) { return colour / strongest(colour); };
  const auto first = unit(lights.front().emission);
  return std::ranges::all_of(lights, [&](const LightPolygon& light) {
    const auto off = glm::abs(unit(light.emission) - first);
    return strongest(off) <= kSameColour;
  });
}

/// Of the lamps that emit what `emission` says; `colour`: of a strength of one.
std::optional<Crowd> makeCrowd(std::span<const LightPolygon> lights, float (*emission)(const glm::vec3&),
                               const glm::vec3& colour, std::span<const Crowd> known) {
  std::vector<LightPolygon> lamps;
  std::vector<float> strengths;
  for (const auto& light : lights) {
    if (const float strength = emission(light.emission); strength > 0.0F) {
      lamps.push_back(light);
      strengths.push_back(strength);
    }
  }
  if (lamps.empty()) return std::nullopt;
  Crowd crowd;
  const float most = *std::ranges::max_element(strengths);
  crowd.emission = most * colour;
  for (std::size_t i = 0; i < lamps.size(); ++i) {
    strengths[i] /= most;
    crowd.key = mixKeys(mixKeys(crowd.key, lamps[i].key), std::bit_cast<std::uint32_t>(strengths[i]));
  }
  const auto same = std::ranges::find_if(known, [&](const Crowd& of) { return isOf(of, lamps, strengths); });
  if (same != known.end()) crowd.key = same->key;
  crowd.lamps = same != known.end() ? same->lamps : std::make_shared<const LightTree>(std::move(lamps), strengths);
  crowd.area = crowd.lamps->flux();
  return crowd;
}

std::vector<Crowd> makeCrowds(std::span<const LightPolygon> lights, std::span<const Crowd> known) {
  std::vector<Crowd> crowds;
  const auto add = [&](std::optional<Crowd> crowd) {
    if (crowd) crowds.push_back(std::move(*crowd));
  };
  if (isOneColour(lights)) {
    const auto colour = lights.front().emission / strongest(lights.front().emission);
    add(makeCrowd(lights, strongest, colour, known));
    return crowds;
  }
  add(makeCrowd(
      lights, [](const glm::vec3& e) { return e.x; }, {1.0F, 0.0F, 0.0F}, known));
  add(makeCrowd(
      lights, [](const glm::vec3& e) { return e.y; }, {0.0F, 1.0F, 0.0F}, known));
  add(makeCrowd(
      lights, [](const glm::vec3& e) { return e.z; }, {0.0F, 0.0F, 1.0F}, known));
  return crowds;
}

}  // namespace

std::size_t fewLights(std::size_t leaves, std::size_t link_memory) {
  const auto bytes = 2 * LinkColumn::kLeafBytes * std::max<std::size_t>(1, leaves);
  return std::clamp(link_memory / kFewPart / bytes, kLeastFew, kMostFew);
}

DividedLights divideLights(std::vector<LightPolygon> lights, std::size_t few, std::span<const Crowd> known) {
  DividedLights divided;
  if (lights.size() <= few) {
    divided.shooters = std::move(lights);
    return divided;
  }
  double power = 0.0;
  for (const auto& light : lights) power += powerOf(light);
  std::vector<LightPolygon> many;
  for (auto& light : lights) (powerOf(light) >= kStrong * power ? divided.shooters : many).push_back(light);
  if (!many.empty()) divided.crowds = makeCrowds(many, known);
  return divided;
}

/// A place on a leaf, and what it looks at: lamps near by, each, and draws of the others.
class CrowdSample::Receiver {
 public:
  Receiver(const LeafRays& rays, const LeafRays::Place& place, const LightTree& lamps, bool sees_through,
           std::uint64_t key)
      : rays_(rays), place_(place), lamps_(lamps), key_(key), from_(rays.startOf(place)), sees_through_(sees_through) {
    auto near = kNear;
    while (near <= kNearest && !lamps_.findNear(from_, near, kMostNear, near_)) near *= 2.0F;
    if (near > kNearest) near_.clear();
    for (const auto light : near_) lookNear(light);
  }

  /// What one of kDraws draws brings, if nothing hides it.
  void look(const glm::dvec4& draw) {
    const auto chosen = lamps_.draw(from_, glm::vec3(place_.normal), draw.x);
    if (chosen.light == scene::kNone || std::ranges::find(near_, chosen.light) != near_.end()) return;
    const auto& lamp = lamps_.lights()[chosen.light];
    const glm::dvec3 point(lamp.point(draw.y, draw.z));
    const auto way = point - place_.position;
    const double arrives = glm::dot(place_.normal, way), leaves = -glm::dot(glm::dvec3(lamp.normal), way);
    if (!(arrives > 0.0 && leaves > 0.0)) return;
    const double square = glm::dot(way, way);
    add(glm::vec3(point) + kSpare * lamp.normal, lamps_.strength(chosen.light) / chosen.chance / kDraws * lamp.area *
                                                     arrives * leaves / (std::numbers::pi * square * square));
  }

  [[nodiscard]] double arriving() {
    if (sees_through_) return arrivingThrough();
    const auto count = brings_.size();
    while (points_.x.size() % geometry::kPacket != 0) aim(from_ + glm::vec3(place_.normal));  // and is not looked at
    std::vector<std::int32_t> hidden(points_.x.size());
    rays_.hide(from_, points_, hidden.data());
    double sum = 0.0;
    for (std::size_t i = 0; i < count; ++i) sum += hidden[i] == 0 ? brings_[i] : 0.0;
    return sum;
  }

 private:
  void aim(const glm::vec3& point) {
    points_.x.push_back(point.x);
    points_.y.push_back(point.y);
    points_.z.push_back(point.z);
  }
  void add(const glm::vec3& point, double brings) {
    aim(point);
    brings_.push_back(brings);
  }

  void lookNear(std::uint32_t light) {
    const auto& lamp = lamps_.lights()[light];
    const glm::dvec3 normal(lamp.normal);
    const double height = glm::dot(place_.position - glm::dvec3(lamp.corners[0]), normal);
    if (!(height > 0.0)) return;
    const auto above = cornersAbove(place_.position, place_.normal, std::span(lamp.corners.data(), lamp.corner_count));
    if (above.count < 3) return;
    const std::span corners(above.corner.data(), above.count);
    std::uint64_t drawn = 0;
    const auto uniform = [&] { return uniformFromKey(mixKeys(mixKeys(key_, kNearby + light), drawn++)); };
    const auto direction = PolygonDirections(place_.position, place_.normal, corners).draw(uniform);
    const double slope = -glm::dot(direction, normal);
    if (!(slope > 0.0)) return;
    add(glm::vec3(place_.position + (height / slope) * direction) + kSpare * lamp.normal,
        lamps_.strength(light) * polygonFormFactor(place_.position, place_.normal, corners));
  }

  [[nodiscard]] double arrivingThrough() const {
    double sum = 0.0;
    for (std::size_t i = 0; i < brings_.size(); ++i) {
      const auto way = glm::dvec3(points_.x[i], points_.y[i], points_.z[i]) - glm::dvec3(from_);
      const double distance = glm::length(way);
      auto end = place_;
      const auto value = rays_.see(place_, way / distance, mixKeys(key_, i), end);
      const bool open = LeafRays::isSky(value) || glm::distance(end.position, glm::dvec3(from_)) >= distance - kAtLamp;
      sum += open ? brings_[i] : 0.0;
    }
    return sum;
  }

  const LeafRays& rays_;
  const LeafRays::Place& place_;
  const LightTree& lamps_;
  std::uint64_t key_;
  glm::vec3 from_;
  bool sees_through_;
  std::vector<std::uint32_t> near_;
  LeafRays::Points points_;
  std::vector<double> brings_;
};

CrowdSample::CrowdSample(const scene::PatchScene& patches, const std::vector<Side>& sides, const LeafRays& rays,
                         std::uint64_t seed, Crowd crowd, std::size_t half, std::uint32_t index)
    : patches_(patches),
      sides_(sides),
      rays_(rays),
      crowd_(std::move(crowd)),
      half_(half),
      index_(index),
      key_(mixKeys(mixKeys(seed, crowd_.key), half)) {
  std::size_t leaves = 0;
  for (const auto& side : sides_) leaves += side.leaf_count;
  values_.resize(leaves, 0.0F);
  orderLeaves();
}

/// Calls visit() with the leaf values of each block that have an area.
template <typename Visit>
void CrowdSample::forBlocks(Visit visit) const {
  std::vector<std::uint32_t> block;
  for (const auto& side : sides_) {
    for (std::uint32_t top = 0; top < side.height; top += kCoarse) {
      for (std::uint32_t left = 0; left < side.width; left += kCoarse) {
        block.clear();
        for (auto y = top; y < std::min(top + kCoarse, side.height); ++y) {
          for (auto x = left; x < std::min(left + kCoarse, side.width); ++x) {
            const auto value = side.first_value + y * side.width + x;
            if (rays_.areaOf(value) > 0.0) block.push_back(value);
          }
        }
        if (!block.empty()) visit(std::span<const std::uint32_t>(block));
      }
    }
  }
}

/// In each half another leaf stands for its block, so that the halves differ by what varies within blocks.
void CrowdSample::orderLeaves() {
  std::vector<bool> stands(values_.size(), false);
  forBlocks([&](std::span<const std::uint32_t> block) {
    order_.push_back(block[mixKeys(mixKeys(key_, kBlocks), block.front()) % block.size()]);
    stands[order_.back()] = true;
  });
  some_ = order_.size();
  for (std::uint32_t value = 0; value < values_.size(); ++value)
    if (!stands[value] && rays_.areaOf(value) > 0.0) order_.push_back(value);
}

float CrowdSample::arriving(std::uint32_t value) const {
  const Side& side = rays_.sideOf(value);
  const auto key = mixKeys(key_, std::uint64_t{side.key} << 32U | (value - side.first_value));
  const auto at = sobol4(index_, mixKeys(key, kPlaces));
  const Sobol4 draws(mixKeys(key, kLamps));
  const auto place = rays_.placeOn(value, {at.x, at.y});
  Receiver receiver(rays_, place, *crowd_.lamps, !patches_.opacity.empty(), mixKeys(key, index_));
  for (std::uint32_t i = 0; i < kDraws; ++i) receiver.look(draws(index_ * kDraws + i));
  return static_cast<float>(receiver.arriving());
}

bool CrowdSample::advance(double seconds, Leaves leaves) {
  const auto start = std::chrono::steady_clock::now();
  const auto has_time = [&] {
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count() < seconds;
  };
  const auto wanted = leaves == Leaves::kAll ? order_.size() : some_;
  while (done_ < wanted) {
    const auto first = done_, end = std::min(first + kSlice, wanted);
    const auto take = [&](std::size_t block) {
      const auto from = first + block * kBlock;
      for (auto i = from; i < std::min(from + kBlock, end); ++i) values_[order_[i]] = arriving(order_[i]);
    };
    inTurns((end - first + kBlock - 1) / kBlock, take);
    done_ = end;
    if (!has_time()) break;
  }
  return done_ >= wanted;
}

std::vector<float> CrowdSample::filled() const {
  auto values = values_;
  std::vector<bool> is_done(values.size(), false);
  for (std::size_t i = 0; i < done_; ++i) is_done[order_[i]] = true;
  std::size_t number = 0;
  forBlocks([&](std::span<const std::uint32_t> block) {
    const float value = values_[order_[number++]];
    for (const auto leaf : block)
      if (!is_done[leaf]) values[leaf] = value;
  });
  return values;
}

/// Where nothing is lost all arrives, to the last digit; else what is due is what the leaves say.
void CrowdSample::findLost(LinkSample& links) const {
  const auto& lamps = *crowd_.lamps;
  const Sobol4 starts(mixKeys(key_, kStarts)), directions(mixKeys(key_, kDirections));
  std::uint32_t escaped = 0, absorbed = 0;
  for (std::uint32_t i = index_ * kLostRays; i < (index_ + 1) * kLostRays; ++i) {
    const auto start = starts(i), direction = directions(i);
    double u = start.x;
    const auto& lamp = lamps.lights()[lamps.byFlux(u)];
    const LeafRays::Place from{glm::dvec3(lamp.point(start.y, start.z)), glm::dvec3(lamp.normal), LeafRays::kNothing,
                               scene::kNone};
    auto end = from;
    const auto seen = rays_.see(from, cosineDirection(from.normal, direction.x, direction.y), mixKeys(key_, i), end);
    if (LeafRays::isSky(seen)) ++escaped;
    if (seen == LeafRays::kNothing) ++absorbed;
  }
  links.escaped = crowd_.area * escaped / kLostRays;
  links.absorbed = crowd_.area * absorbed / kLostRays;
  if (escaped + absorbed == 0 && !patches_.hasGlass()) links.due = crowd_.area;
}

LinkSample CrowdSample::links() const {
  LinkSample links;
  const auto coarse = isWhole() ? std::vector<float>() : filled();
  const auto& values = isWhole() ? values_ : coarse;
  for (const auto& side : sides_) {
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      const auto area = static_cast<double>(patches_.node_area[side.first_node + leaf]);
      if (area <= 0.0) continue;
      const float value = values[side.first_value + leaf];
      links.add(side.first_node + leaf, value);
      links.delivered += area * static_cast<double>(value);
    }
  }
  findLost(links);
  return links;
}

}  // namespace radiosity::solver
