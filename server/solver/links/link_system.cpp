#include "server/solver/links/link_system.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numeric>
#include <utility>

#include "common/check.h"
#include "common/parallel.h"
#include "server/solver/patches/unshot_pyramid.h"

namespace radiosity::solver {
namespace {

/// A sample of links is off by its rounding alone when its sum is as near as this to what was sent.
constexpr double kOnlyRounding = 1e-4;

/// Rows of translucent sides hold it.
bool isSameTransmittance(const scene::SideColours& a, const scene::SideColours& b) {
  return a.sideCount() == b.sideCount() && (a.sideCount() == 0 || a == b);
}

}  // namespace

double Shooter::power() const { return 0.5 * static_cast<double>(channelSum(sent[0] + sent[1])) * area; }

double Shooter::spread() const {
  const glm::dvec3 first = carried(0) * glm::dvec3(sent[0]), second = carried(1) * glm::dvec3(sent[1]);
  return std::max(0.0, products[0] * glm::dot(first, first) - 2.0 * products[1] * glm::dot(first, second) +
                           products[2] * glm::dot(second, second));
}

LinkSystem::LinkSystem(const scene::PatchScene& patches, const std::vector<Side>& sides)
    : patches_(patches),
      sides_(sides),
      nodes_(sides.size()),
      members_(sides.size()),
      leaf_area_(solver::leafAreas(patches, sides)),
      uniform_(sides.size(), true) {}

void LinkSystem::addSample(std::uint32_t index, std::size_t half, const LinkExpander& links, const LinkSample& totals,
                           double points) {
  auto& shooter = shooters_[index];
  const double factor =
      roundingOf(shooter, totals.due > 0.0 ? totals.due : links.flux(), totals.escaped, totals.absorbed);
  shooter.column[half].add(links, totals, points, leaf_area_, sides_, factor);
  noteChange(index, half);
}

void LinkSystem::replaceLinks(std::uint32_t index, std::size_t half, std::span<const LinkColumn::ValueRun> leaves,
                              std::span<const float> values, const LinkColumn::Totals& totals) {
  auto& shooter = shooters_[index];
  const double factor = roundingOf(shooter, totals.due, totals.escaped, totals.absorbed);
  shooter.column[half].replace(
      leaves, values,
      {factor * totals.due, factor * totals.escaped, factor * totals.absorbed, totals.open_looks, totals.presumed},
      leaf_area_, sides_);
  noteChange(index, half);
}

double LinkSystem::roundingOf(const Shooter& shooter, double due, double escaped, double absorbed) {
  const double all = (due + escaped + absorbed) / shooter.area;
  return std::abs(all - 1.0) < kOnlyRounding ? 1.0 / all : 1.0;
}

void LinkSystem::noteChange(std::uint32_t index, std::size_t half) {
  auto& shooter = shooters_[index];
  const auto& own = shooter.column[half];
  shooter.products[half == 0 ? 0 : 2] = LinkColumn::product(own, own, leaf_area_);
  shooter.products[1] = LinkColumn::product(shooter.column[0], shooter.column[1], leaf_area_);
  changed_[half][index] = true;
}

bool LinkSystem::letsThrough(const Side& side) const { return !passingTo(passing_, side).empty(); }

void LinkSystem::setMaterials(const scene::SideColours& emission, const scene::SideColours& reflectance,
                              const scene::SideColours& transmittance) {
  bool same_rows =
      reflectance_.sideCount() == reflectance.sideCount() && isSameTransmittance(transmittance_, transmittance);
  transmittance_ = transmittance;
  passing_ = passingLeaves(transmittance, sides_, leaf_area_);
  for (std::size_t s = 0; s < sides_.size(); ++s) {
    const Side& side = sides_[s];
    const auto now = reflectance.side(s), before = same_rows ? reflectance_.side(s) : now;
    std::uint32_t first = scene::kNone;
    bool uniform = !letsThrough(side), same = same_rows;
    for (std::uint32_t leaf = 0; leaf < side.leaf_count && !(uniform && now.isUniform()); ++leaf) {
      if (patches_.node_area[side.first_node + leaf] <= 0.0F) continue;
      if (first == scene::kNone) first = leaf;
      if (now[leaf] != now[first]) uniform = false;
      if (same && now[leaf] != before[leaf]) same = false;
    }
    // Rows of a side of one reflectance do not hold it.
    same_rows = same_rows && uniform == uniform_[s] && (uniform || same);
    uniform_[s] = uniform;
  }
  emission_ = emission;
  reflectance_ = reflectance;
  emission_mean_.clear();
  if (same_rows) return;
  known_ = 0;
  rows_.clear();
  for (auto& half : halves_) half.matrix.clear();
}

std::uint32_t LinkSystem::add(const Shooter& shooter) {
  const auto index = static_cast<std::uint32_t>(shooters_.size());
  if (!shooter.isLight() && nodes_[shooter.place.side].empty())
    nodes_[shooter.place.side].assign(sides_[shooter.place.side].node_count, kNobody);
  shooters_.push_back(shooter);
  for (auto& changed : changed_) changed.push_back(true);
  if (shooter.isLight()) return index;
  const NodePlace& place = shooter.place;
  const Side& side = sides_[place.side];
  const auto node = nodeId(side, place);
  // The sum of its leaves to the last digit: what the area of a node rounds off would be lost at every bounce.
  shooters_[index].area = areaOf(shooters_[index]);
  RAD_CHECK(at(place.side, node) == scene::kNone && !hasBelow(place.side, node));
  auto& nodes = nodes_[place.side];
  nodes[node - side.first_node] = index;
  members_[place.side].push_back(index);
  for (std::uint32_t level = place.level + 1; level < side.level_count; ++level) {
    const std::uint32_t up = level - place.level;
    const auto above = nodeId(side, {place.side, level, place.x >> up, place.y >> up});
    nodes[above - side.first_node] |= kHasBelow;
  }
  return index;
}

void LinkSystem::forget(std::uint32_t index) {
  shooters_[index].column = {};
  shooters_[index].tint = {};
  shooters_[index].products = {};
  for (auto& half : halves_) {
    for (auto& row : half.matrix) {
      if (index < row.size()) row[index] = 0.0F;
    }
  }
}

void LinkSystem::forget(std::uint32_t index, std::size_t half) {
  shooters_[index].column[half] = {};
  noteChange(index, half);
  for (auto& row : halves_[half].matrix) {
    if (index < row.size()) row[index] = 0.0F;
  }
}

double LinkSystem::areaOf(const Shooter& shooter) const {
  const Side& side = sides_[shooter.place.side];
  const auto rect = leafRect(side, shooter.place);
  double area = 0.0;
  for (auto y = rect.y0; y < rect.y1; ++y) {
    for (auto x = rect.x0; x < rect.x1; ++x)
      area += static_cast<double>(patches_.node_area[side.first_node + y * side.width + x]);
  }
  return area;
}

/// Of the shooters that are new, or of all after an edit.
void LinkSystem::updateMeans() {
  const std::size_t count = shooters_.size();
  const std::size_t known = emission_mean_.size();
  emission_mean_.resize(count, glm::vec3(0.0F));
  reflectance_mean_.resize(count, glm::vec3(0.0F));
  for (auto m = known; m < count; ++m) {
    const Shooter& shooter = shooters_[m];
    if (shooter.isLight()) continue;
    const Side& side = sides_[shooter.place.side];
    const auto emissions = emission_.side(side.number), reflectances = reflectance_.side(side.number);
    glm::dvec3 emission(0.0), reflectance(0.0);
    const auto rect = leafRect(side, shooter.place);
    for (auto y = rect.y0; y < rect.y1; ++y) {
      for (auto x = rect.x0; x < rect.x1; ++x) {
        const auto leaf = y * side.width + x;
        const auto a = static_cast<double>(patches_.node_area[side.first_node + leaf]);
        emission += a * glm::dvec3(emissions[leaf]);
        reflectance += a * glm::dvec3(reflectances[leaf]);
      }
    }
    emission_mean_[m] = side.gathered ? glm::vec3(0.0F) : glm::vec3(emission / shooter.area);
    reflectance_mean_[m] = glm::vec3(reflectance / shooter.area);
  }
}

void LinkSystem::irradiance(std::size_t half, std::vector<glm::vec3>& values, From from) const {
  std::array<std::vector<float>, 3> planes, tinted;
  for (auto& plane : planes) plane.assign(leaf_area_.size(), 0.0F);
  const auto pointers = [](auto& of) { return std::array<float*, 3>{of[0].data(), of[1].data(), of[2].data()}; };
  for (const auto& shooter : shooters_) {
    if (from == From::kLights && !shooter.isLight()) continue;
    if (from == From::kSources && shooter.source == scene::kNone) continue;
    const glm::vec3 sent = static_cast<float>(shooter.carried(half)) * shooter.sent[half];
    if (sent == glm::vec3(0.0F)) continue;
    const auto& column = shooter.column[half];
    if (!shooter.tint[half]) {
      column.apply({sent.x, sent.y, sent.z}, pointers(planes));
      continue;
    }
    for (auto& plane : tinted) plane.resize(leaf_area_.size(), 0.0F);  // all 0
    column.apply({sent.x, sent.y, sent.z}, pointers(tinted));
    shooter.tint[half]->apply(pointers(tinted));
    for (std::size_t c = 0; c < 3; ++c) {
      for (const auto& run : column.runs()) {
        for (auto v = run.first_value; v < run.first_value + run.count; ++v)
          planes[c][v] += std::exchange(tinted[c][v], 0.0F);
      }
    }
  }
  values.resize(leaf_area_.size());
  for (std::size_t v = 0; v < values.size(); ++v) values[v] = {planes[0][v], planes[1][v], planes[2][v]};
}

double LinkSystem::tintNoise() const {
  std::vector<const Shooter*> tinted;
  for (const auto& shooter : shooters_)
    if (shooter.tint[0] || shooter.tint[1]) tinted.push_back(&shooter);
  std::vector<double> squares(tinted.size());
  inTurns(tinted.size(), [&](std::size_t i) {
    const auto& shooter = *tinted[i];
    const auto& column = shooter.column[shooter.column[0].points() > 0.0 ? 0 : 1];
    std::vector<float> links;
    const auto tintOf = [&](std::size_t half, std::uint32_t value) {
      return shooter.tint[half] ? shooter.tint[half]->at(value) : glm::vec3(1.0F);
    };
    const glm::vec3 sent = 0.5F * (static_cast<float>(shooter.carried(0)) * shooter.sent[0] +
                                   static_cast<float>(shooter.carried(1)) * shooter.sent[1]);
    for (const auto& run : column.runs()) {
      for (auto s = run.side; s < run.side + run.side_count; ++s) {
        links.assign(sides_[s].leaf_count, 0.0F);
        if (!column.decode(sides_[s].first_value, links)) continue;
        for (std::uint32_t leaf = 0; leaf < sides_[s].leaf_count; ++leaf) {
          if (!(links[leaf] > 0.0F)) continue;
          const auto value = sides_[s].first_value + leaf;
          const glm::dvec3 off(0.5F * links[leaf] * sent * (tintOf(0, value) - tintOf(1, value)));
          squares[i] += static_cast<double>(leaf_area_[value]) * glm::dot(off, off);
        }
      }
    }
  });
  return std::reduce(squares.begin(), squares.end());
}

std::size_t LinkSystem::bytes() const {
  std::size_t sum = 0;
  for (const auto& shooter : shooters_) sum += shooter.column[0].bytes() + shooter.column[1].bytes();
  for (const auto& half : halves_) sum += half.matrix.size() * shooters_.size() * sizeof(float);
  return sum;
}

void LinkSystem::standIn(std::uint32_t s, std::vector<glm::vec3>& leaves) const {
  const Side& side = sides_[s];
  leaves.assign(side.leaf_count, glm::vec3(0.0F));
  for (const auto m : members_[s]) {
    const auto rect = leafRect(side, shooters_[m].place);
    const glm::vec3 mean = 0.5F * (shooters_[m].mean[0] + shooters_[m].mean[1]);
    for (auto y = rect.y0; y < rect.y1; ++y) {
      for (auto x = rect.x0; x < rect.x1; ++x) leaves[y * side.width + x] = mean;
    }
  }
}

}  // namespace radiosity::solver
