#include "server/solver/probes/probe_rays.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/packing.hpp>
#include <numbers>

#include "common/parallel.h"
#include "server/solver/math/sampling.h"
#include "server/solver/rays/ray_order.h"

namespace radiosity::solver {
namespace {

/// Probes that a thread takes at a time: some milliseconds.
constexpr std::size_t kProbesAPart = 32;
constexpr double kAllAround = 4.0 * std::numbers::pi;

/// Uniform over the sphere where u and v are, in [0, 1).
glm::dvec3 onSphere(double u, double v) {
  const double z = 1.0 - 2.0 * u, radius = std::sqrt(std::max(0.0, 1.0 - z * z)), angle = 2.0 * std::numbers::pi * v;
  return {radius * std::cos(angle), radius * std::sin(angle), z};
}

/// An octahedron unfolded (Meyer et al. 2010, "On floating-point normal vectors"): off by less than 1e-4 rad.
std::uint32_t packed(const glm::dvec3& direction) {
  const auto on = direction / (std::abs(direction.x) + std::abs(direction.y) + std::abs(direction.z));
  glm::dvec2 at(on.x, on.y);
  if (on.z < 0.0) at = {std::copysign(1.0 - std::abs(on.y), on.x), std::copysign(1.0 - std::abs(on.x), on.y)};
  return glm::packSnorm2x16(glm::vec2(at));
}

/// Rays whose light is summed up together, so that loops over them vectorise.
constexpr std::size_t kLanes = 8;
using Lanes = std::array<float, kLanes>;

std::array<Lanes, 3> unpacked(const std::array<std::uint32_t, kLanes>& bits) {
  constexpr float kUnit = 1.0F / 32767.0F;
  std::array<Lanes, 3> ways;
  for (std::size_t i = 0; i < kLanes; ++i) {
    const float x = kUnit * static_cast<float>(static_cast<std::int32_t>(bits[i] << 16U) >> 16);
    const float y = kUnit * static_cast<float>(static_cast<std::int32_t>(bits[i]) >> 16);
    const float z = 1.0F - std::abs(x) - std::abs(y), fold = z < 0.0F ? -z : 0.0F;
    const float fx = x < 0.0F ? x + fold : x - fold, fy = y < 0.0F ? y + fold : y - fold;
    const float scale = 1.0F / std::sqrt(fx * fx + fy * fy + z * z);
    ways[0][i] = scale * fx;
    ways[1][i] = scale * fy;
    ways[2][i] = scale * z;
  }
  return ways;
}

/// Harmonics of what some rays bring, by channel; the fourth: what that is off by.
class HarmonicLanes {
 public:
  void add(const std::array<Lanes, 3>& ways, const std::array<Lanes, 4>& light) {
    std::array<Lanes, kHarmonics> harmonics;
    for (std::size_t i = 0; i < kLanes; ++i) {
      const auto of = harmonicsOf<float>(ways[0][i], ways[1][i], ways[2][i]);
      for (std::size_t h = 0; h < kHarmonics; ++h) harmonics[h][i] = of[h];
    }
    for (std::size_t h = 0; h < kHarmonics; ++h)
      for (std::size_t c = 0; c < 4; ++c)
        for (std::size_t i = 0; i < kLanes; ++i) sums_[h][c][i] += harmonics[h][i] * light[c][i];
  }
  [[nodiscard]] glm::dvec4 sum(std::size_t h) const {
    glm::dvec4 sum(0.0);
    for (int c = 0; c < 4; ++c)
      for (const float of : sums_[h][static_cast<std::size_t>(c)]) sum[c] += static_cast<double>(of);
    return sum;
  }

 private:
  std::array<std::array<Lanes, 4>, kHarmonics> sums_{};
};

/// What rays remember: a leaf, a leaf with the lamp there, which only mirrors show, or a cell of the sky.
class Sources {
 public:
  explicit Sources(const PlaceLight& light)
      : leaves_(static_cast<std::uint32_t>(light.radiosity().size())),
        lamps_(static_cast<std::uint32_t>(light.lampEmission().size())) {}

  [[nodiscard]] std::uint32_t leaf(std::uint32_t value) const {
    return LeafRays::isSky(value) ? leaves_ + lamps_ + value - LeafRays::kSky : value;
  }
  [[nodiscard]] std::uint32_t inMirror(std::uint32_t value) const {
    return value < lamps_ ? leaves_ + value : leaf(value);
  }
  [[nodiscard]] std::size_t count() const { return std::size_t{leaves_} + lamps_ + SkyCells::kCount; }

 private:
  std::uint32_t leaves_, lamps_;
};

glm::vec4 radianceOfLeaf(const glm::vec3& radiosity, float off) {
  return static_cast<float>(1.0 / std::numbers::pi) * glm::vec4(radiosity, off);
}

/// Sums of directions by lobe while a probe is traced.
struct LobeSums {
  std::array<double, ProbeSight::kLobes> weight{}, distance{}, square{};

  void add(const glm::dvec3& direction, double far) {
    for (std::size_t lobe = 0; lobe < weight.size(); ++lobe) {
      const double along = direction[static_cast<int>(lobe / 2)] * (lobe % 2 == 0 ? 1.0 : -1.0);
      const double counts = along > 0.0 ? along * along : 0.0;
      weight[lobe] += counts;
      distance[lobe] += counts * far;
      square[lobe] += counts * far * far;
    }
  }
  void tell(ProbeSight& sight) const {
    for (std::size_t lobe = 0; lobe < weight.size(); ++lobe) {
      sight.distance[lobe] = static_cast<float>(distance[lobe] / weight[lobe]);
      sight.square[lobe] = static_cast<float>(square[lobe] / weight[lobe]);
    }
  }
};

}  // namespace

struct ProbeRays::Part {
  std::vector<ProbeSight> sights;
  std::vector<std::uint32_t> from, direction, counts;  ///< counts: by probe and round
  std::vector<glm::vec3> part;                         ///< empty: all of the light, so far
  LobeSums lobes;                                      ///< of the probe that is being traced

  void add(std::uint32_t which, const glm::dvec3& way, const glm::dvec3& left) {
    if (left != glm::dvec3(1.0)) part.resize(from.size(), glm::vec3(1.0F));
    if (left != glm::dvec3(1.0) || !part.empty()) part.emplace_back(left);
    from.push_back(which);
    direction.push_back(packed(way));
  }
};

std::uint64_t ProbeRays::mirrorKeyOf(const PlaceLight& light) {
  return light.mirrors() != nullptr ? mixKeys(light.mirrors()->key(), 1) : 0;
}

ProbeRays::ProbeRays(const PlaceLight& light, std::span<const glm::dvec3> places, std::uint32_t rays, std::uint64_t key,
                     std::size_t most_ends)
    : rays_(rays), mirror_key_(mirrorKeyOf(light)) {
  constexpr std::uint32_t kStep = kRounds * geometry::kPacket;
  while (!cast(light, places, key, most_ends)) {
    if (rays_ <= kLeastRays) {
      rays_ = 0;
      return;
    }
    rays_ = std::max(kLeastRays, rays_ / 2 / kStep * kStep);
  }
}

/// False: there are more ends than that. Whether there are does not depend on which threads find them.
bool ProbeRays::cast(const PlaceLight& light, std::span<const glm::dvec3> places, std::uint64_t key,
                     std::size_t most_ends) {
  std::vector<Part> parts((places.size() + kProbesAPart - 1) / kProbesAPart);
  std::atomic<std::size_t> ends = 0;
  inTurns(parts.size(), [&](std::size_t p) {
    const auto end = std::min(places.size(), (p + 1) * kProbesAPart);
    for (auto i = p * kProbesAPart; i < end && ends <= most_ends; ++i) {
      const auto before = parts[p].from.size();
      trace(light, places[i], mixKeys(key, i), parts[p]);
      ends += parts[p].from.size() - before;
    }
  });
  if (ends > most_ends) return false;
  keep(std::move(parts));
  return true;
}

void ProbeRays::keep(std::vector<Part> parts) {
  std::size_t kept = 0;
  for (const auto& part : parts) kept += part.from.size();
  from_.reserve(kept);
  direction_.reserve(kept);
  const bool has_parts = std::ranges::any_of(parts, [](const Part& part) { return !part.part.empty(); });
  if (has_parts) part_.reserve(kept);
  first_.push_back(0);
  for (auto& part : parts) {
    sights_.insert(sights_.end(), part.sights.begin(), part.sights.end());
    from_.insert(from_.end(), part.from.begin(), part.from.end());
    direction_.insert(direction_.end(), part.direction.begin(), part.direction.end());
    part_.insert(part_.end(), part.part.begin(), part.part.end());
    if (has_parts) part_.resize(from_.size(), glm::vec3(1.0F));
    for (const auto count : part.counts) first_.push_back(first_.back() + count);
    part = {};
  }
}

void ProbeRays::trace(const PlaceLight& light, const glm::dvec3& place, std::uint64_t key, Part& part) const {
  ProbeSight sight;
  sight.nearest = ProbeSight::kFarthest;
  part.lobes = {};
  for (std::uint32_t round = 0; round < kRounds; ++round) {
    const auto before = part.from.size();
    traceRound(light, place, mixKeys(key, round), part, sight);
    part.counts.push_back(static_cast<std::uint32_t>(part.from.size() - before));
  }
  part.lobes.tell(sight);
  sight.backs /= static_cast<float>(rays_);
  part.sights.push_back(sight);
}

void ProbeRays::traceRound(const PlaceLight& light, const glm::dvec3& place, std::uint64_t key, Part& part,
                           ProbeSight& sight) const {
  const Sources sources(light);
  const Sobol4 draws(key);
  RayOrder order;
  for (std::uint32_t k = 0; k < rays_ / kRounds; ++k) order.add(k, draws(k));
  order.sort();
  std::array<LeafRays::Place, geometry::kPacket> from;
  from.fill({place, glm::dvec3(0.0)});
  std::array<glm::dvec3, geometry::kPacket> direction;
  std::array<geometry::Hit, geometry::kPacket> hit;
  for (std::size_t first = 0; first < order.size(); first += geometry::kPacket) {
    for (std::size_t i = 0; i < geometry::kPacket; ++i)
      direction[i] = onSphere(order[first + i].draw.x, order[first + i].draw.y);
    light.rays().meetFirst(from, direction, hit);
    for (std::size_t i = 0; i < geometry::kPacket; ++i) {
      RayEnd at{LeafRays::kNothing, {}, direction[i], mixKeys(key, order[first + i].number)};
      glm::dvec3 tint(1.0);
      at.value = light.tinted().see(from[i], at.direction, at.key, at.end, tint, &hit[i]);
      const auto distance =
          LeafRays::isSky(at.value) ? ProbeSight::kFarthest : static_cast<float>(glm::distance(at.end.position, place));
      sight.nearest = std::min(sight.nearest, distance);
      sight.backs += light.rays().isBack(at.value, at.end, at.direction) ? 1.0F : 0.0F;
      part.lobes.add(direction[i], static_cast<double>(distance));
      if (at.value != LeafRays::kNothing) part.add(sources.leaf(at.value), direction[i], tint);
      followMirrors(light.tinted(), light.mirrors(), at, [&](const RayEnd& there, const glm::dvec3& left, MirrorHop) {
        if (there.value == LeafRays::kNothing || left == glm::dvec3(0.0)) return;
        part.add(sources.inMirror(there.value), direction[i], tint * left);
      });
    }
  }
}

ProbeRays::Radiance ProbeRays::radianceOf(const PlaceLight& light) {
  Radiance radiance;
  radiance.reserve(Sources(light).count());
  const auto& off = light.off();
  for (std::size_t value = 0; value < light.radiosity().size(); ++value)
    radiance.push_back(
        radianceOfLeaf(light.radiosity()[value], off.empty() ? 0.0F : off[value].x + off[value].y + off[value].z));
  for (std::size_t value = 0; value < light.lampEmission().size(); ++value)
    radiance.push_back(radiance[value] + radianceOfLeaf(light.lampEmission()[value], 0.0F));
  for (std::uint32_t cell = 0; cell < SkyCells::kCount; ++cell)
    radiance.push_back(radianceOfLeaf(glm::vec3(light.skyAt(cell)), 0.0F));
  return radiance;
}

/// Of a round of a probe, by number: sums over its rays; lanes that have none bring nothing.
std::array<glm::dvec4, kHarmonics> ProbeRays::gatherRound(std::size_t number, const Radiance& radiance) const {
  HarmonicLanes lanes;
  const auto end = first_[number + 1];
  for (auto first = first_[number]; first < end; first += kLanes) {
    std::array<std::uint32_t, kLanes> direction{};
    std::array<Lanes, 4> light{};
    const auto together = std::min<std::uint64_t>(kLanes, end - first);
    for (std::size_t i = 0; i < together; ++i) {
      direction[i] = direction_[first + i];
      auto of_ray = radiance[from_[first + i]];
      if (!part_.empty()) {
        const auto& part = part_[first + i];
        of_ray *= glm::vec4(part, (part.x + part.y + part.z) / 3.0F);
      }
      for (int c = 0; c < 4; ++c) light[static_cast<std::size_t>(c)][i] = of_ray[c];
    }
    lanes.add(unpacked(direction), light);
  }
  std::array<glm::dvec4, kHarmonics> sums;
  for (std::size_t h = 0; h < kHarmonics; ++h) sums[h] = lanes.sum(h);
  return sums;
}

ProbeSums ProbeRays::gather(std::size_t probe, const Radiance& radiance) const {
  std::array<glm::dvec3, kHarmonics> sum{}, squares{};
  std::array<double, kHarmonics> off{};
  for (std::uint32_t round = 0; round < kRounds; ++round) {
    const auto of_round = gatherRound(probe * kRounds + round, radiance);
    for (std::size_t h = 0; h < kHarmonics; ++h) {
      const glm::dvec3 light(of_round[h]);
      sum[h] += light;
      squares[h] += light * light;
      off[h] += of_round[h].w;
    }
  }
  ProbeSums sums;
  const double weight = kAllAround / rays_;
  double off_square = 0.0;
  for (const double of : off) off_square += weight * weight * of * of / kHarmonics;
  const double all = sum[0].x + sum[0].y + sum[0].z;
  for (std::size_t h = 0; h < kHarmonics; ++h) {
    sums.mean[h] = weight * sum[h];
    // Of a sum of independent rounds; what is left of it is the share of each channel in what the solve is off by.
    const auto scatter = glm::max(glm::dvec3(0.0), squares[h] - sum[h] * sum[h] / double{kRounds});
    sums.variance[h] = weight * weight * double{kRounds} / (kRounds - 1.0) * scatter;
    if (all > 0.0) sums.variance[h] += off_square * (sum[0] / all) * (sum[0] / all);
  }
  return sums;
}

}  // namespace radiosity::solver
