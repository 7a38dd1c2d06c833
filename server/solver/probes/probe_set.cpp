#include "server/solver/probes/probe_set.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/exponential.hpp>
#include <glm/geometric.hpp>

#include "common/parallel.h"
#include "server/solver/math/sampling.h"

namespace radiosity::solver {
namespace {

/// Whose light is summed up by a thread at a time: a millisecond.
constexpr std::size_t kProbesAtOnce = 256;
constexpr std::uint64_t kLampSeed = 0x4c414d50ULL;

std::vector<glm::dvec3> placesOf(const ProbeLattice& lattice) {
  std::vector<glm::dvec3> places;
  places.reserve(lattice.probeCount());
  for (std::size_t i = 0; i < lattice.probeCount(); ++i) places.push_back(lattice.placeOf(i));
  return places;
}

/// The share of one grid.
std::size_t endsFor(std::size_t probes, std::size_t in_all) {
  const double share = static_cast<double>(probes) / static_cast<double>(std::max<std::size_t>({1, probes, in_all}));
  return static_cast<std::size_t>(share * static_cast<double>(ProbeRays::kMostEnds));
}

/// What is missing need not come from where other light does: coefficients that are 0 may be off by it, too.
void addSystematic(double part, ProbeSums& sums) {
  glm::dvec3 square(0.0);
  for (const auto& mean : sums.mean) square += mean * mean / static_cast<double>(kHarmonics);
  for (std::size_t h = 0; h < kHarmonics; ++h)
    sums.variance[h] += part * part * glm::max(square, sums.mean[h] * sums.mean[h]);
}

ProbeLight toLight(const ProbeSums& sums) {
  ProbeLight light;
  for (std::size_t h = 0; h < kHarmonics; ++h) {
    light.light[h] = glm::vec3(sums.mean[h]);
    light.error[h] = glm::vec3(glm::sqrt(sums.variance[h]));
  }
  return light;
}

/// Calls visit(number, distance squared) for those of the 26 around a probe that are in the grid.
template <typename Visit>
void forEachBeside(const ProbeLattice& lattice, std::size_t probe, const Visit& visit) {
  const auto cell = lattice.cellOf(probe);
  for (int turn = 0; turn < 27; ++turn) {
    const std::array<int, 3> by{turn % 3 - 1, turn / 3 % 3 - 1, turn / 9 - 1};
    std::array<std::uint32_t, 3> beside{};
    glm::dvec3 way(0.0);
    bool is_there = turn != 13;  // the probe itself
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto at = static_cast<std::int64_t>(cell[axis]) + by[axis];
      is_there = is_there && at >= 0 && at < lattice.counts[axis];
      beside[axis] = static_cast<std::uint32_t>(at);
      way += static_cast<double>(by[axis]) * lattice.steps[axis];
    }
    if (is_there) visit(lattice.numberOf(beside), glm::dot(way, way));
  }
}

/// Of those beside it that have light by then.
void fill(const ProbeLattice& lattice, std::vector<ProbeLight>& probes, std::size_t probe, std::uint32_t ring) {
  ProbeSums sums;
  double weights = 0.0;
  forEachBeside(lattice, probe, [&](std::size_t beside, double square) {
    if (probes[beside].ring >= ring) return;
    const double weight = 1.0 / square;
    weights += weight;
    for (std::size_t h = 0; h < kHarmonics; ++h) {
      const glm::dvec3 error(probes[beside].error[h]);
      sums.mean[h] += weight * glm::dvec3(probes[beside].light[h]);
      sums.variance[h] += weight * error * error;
    }
  });
  for (std::size_t h = 0; h < kHarmonics; ++h) {
    sums.mean[h] /= weights;
    sums.variance[h] /= weights;
  }
  probes[probe] = toLight(sums);
  probes[probe].ring = ring;
}

}  // namespace

std::array<std::uint32_t, 3> ProbeLattice::cellOf(std::size_t probe) const {
  const auto row = probe / counts[0];
  return {static_cast<std::uint32_t>(probe % counts[0]), static_cast<std::uint32_t>(row % counts[1]),
          static_cast<std::uint32_t>(row / counts[1])};
}

std::size_t ProbeLattice::numberOf(const std::array<std::uint32_t, 3>& cell) const {
  return cell[0] + std::size_t{counts[0]} * (cell[1] + std::size_t{counts[1]} * cell[2]);
}

glm::dvec3 ProbeLattice::placeOf(std::size_t probe) const {
  const auto cell = cellOf(probe);
  auto place = first;
  for (std::size_t axis = 0; axis < 3; ++axis) place += static_cast<double>(cell[axis]) * steps[axis];
  return place;
}

std::uint32_t ProbeSet::raysFor(std::size_t probes) {
  constexpr std::uint32_t kStep = ProbeRays::kRounds * geometry::kPacket;
  const auto rays = std::min<std::size_t>(kMostRays, kRaysInAll / std::max<std::size_t>(1, probes));
  return std::max(kLeastRays, static_cast<std::uint32_t>(rays) / kStep * kStep);
}

ProbeSet::ProbeSet(const PlaceLight& light, const ProbeLattice& lattice, std::uint32_t rays, std::uint64_t key,
                   std::size_t in_all)
    : lattice_(lattice),
      rays_(light, placesOf(lattice), rays, key, endsFor(lattice.probeCount(), in_all)),
      lamps_(placesOf(lattice), mixKeys(key, kLampSeed), in_all) {}

std::vector<ProbeLight> ProbeSet::light(const PlaceLight& light, double systematic) {
  lamps_.update(light);
  const auto radiance = ProbeRays::radianceOf(light);
  std::vector<ProbeLight> probes(rays_.probeCount());
  inTurns((probes.size() + kProbesAtOnce - 1) / kProbesAtOnce, [&](std::size_t part) {
    const auto end = std::min(probes.size(), (part + 1) * kProbesAtOnce);
    for (auto i = part * kProbesAtOnce; i < end; ++i) {
      if (rays_.sightOf(i).backs > kMostBacks) {
        probes[i].ring = ProbeLight::kUnfilled;
        continue;
      }
      auto sums = rays_.gather(i, radiance);
      lamps_.addTo(i, sums);
      addSystematic(systematic, sums);
      probes[i] = toLight(sums);
    }
  });
  fillProbes(lattice_, probes);
  return probes;
}

void fillProbes(const ProbeLattice& lattice, std::vector<ProbeLight>& probes) {
  std::vector<std::size_t> last;
  std::vector<bool> is_met(probes.size());
  for (std::size_t i = 0; i < probes.size(); ++i) {
    is_met[i] = probes[i].ring == 0;
    if (is_met[i]) last.push_back(i);
  }
  for (std::uint32_t ring = 1; !last.empty(); ++ring) {
    std::vector<std::size_t> next;
    for (const auto probe : last) {
      forEachBeside(lattice, probe, [&](std::size_t beside, double) {
        if (!is_met[beside]) next.push_back(beside);
        is_met[beside] = true;
      });
    }
    for (const auto probe : next) fill(lattice, probes, probe, ring);
    last = std::move(next);
  }
}

}  // namespace radiosity::solver
