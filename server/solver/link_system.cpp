#include "server/solver/link_system.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <thread>

#include "common/check.h"
#include "server/solver/unshot_pyramid.h"

namespace radiosity::solver {
namespace {

/// Sweeps end when what they change is this part of all that is sent: far below any sampling error.
constexpr double kSolved = 1e-6;
constexpr int kMaxSweeps = 20'000;
/// No more flux than this many times what is emitted can be on its way (reflectance is at most 0.999).
constexpr double kMostInterreflection = 1e5;
constexpr std::size_t kLanes = 8;

/// Sum of products in kLanes partial sums, so that it vectorises with the same bits everywhere.
__attribute__((target_clones("avx2", "default"))) float dot(const float* a, const float* b, std::size_t count) {
  float sum[kLanes] = {};
  std::size_t i = 0;
  for (; i + kLanes <= count; i += kLanes) {
    for (std::size_t k = 0; k < kLanes; ++k) sum[k] += a[i + k] * b[i + k];
  }
  float rest = 0.0F;
  for (; i < count; ++i) rest += a[i] * b[i];
  for (std::size_t k = 0; k < kLanes; ++k) rest += sum[k];
  return rest;
}

}  // namespace

double Shooter::power() const { return 0.5 * static_cast<double>(channelSum(sent[0] + sent[1])) * area; }

double Shooter::spread() const {
  const glm::dvec3 first = weight[0] * glm::dvec3(sent[0]), second = weight[1] * glm::dvec3(sent[1]);
  return std::max(0.0, products[0] * glm::dot(first, first) - 2.0 * products[1] * glm::dot(first, second) +
                           products[2] * glm::dot(second, second));
}

LinkSystem::LinkSystem(const scene::PatchScene& patches, const std::vector<Side>& sides)
    : patches_(patches),
      sides_(sides),
      shooter_of_node_(patches.nodeCount(), scene::kNone),
      below_(patches.nodeCount(), false),
      members_(sides.size()),
      uniform_(sides.size(), true) {
  for (const auto& side : sides) {
    const auto leaves = patches.node_area.begin() + side.first_node;
    leaf_area_.insert(leaf_area_.end(), leaves, leaves + side.leaf_count);
  }
}

void LinkSystem::addSample(std::uint32_t index, std::size_t half, const LinkExpander& links, const LinkSample& totals,
                           double points) {
  auto& shooter = shooters_[index];
  shooter.column[half].add(links, totals, points, sides_);
  const auto& own = shooter.column[half];
  shooter.products[half == 0 ? 0 : 2] = LinkColumn::product(own, own, leaf_area_);
  shooter.products[1] = LinkColumn::product(shooter.column[0], shooter.column[1], leaf_area_);
  changed_[index] = true;
}

void LinkSystem::setMaterials(const std::vector<glm::vec3>& emission, const std::vector<glm::vec3>& reflectance) {
  emission_ = emission;
  reflectance_ = reflectance;
  for (std::size_t s = 0; s < sides_.size(); ++s) {
    const Side& side = sides_[s];
    std::uint32_t first = scene::kNone;
    uniform_[s] = true;
    for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
      if (patches_.node_area[side.first_node + leaf] <= 0.0F) continue;
      if (first == scene::kNone) first = leaf;
      if (reflectance_[side.first_value + leaf] != reflectance_[side.first_value + first]) uniform_[s] = false;
    }
  }
  known_ = 0;
  rows_.clear();
  for (auto& half : matrix_) half.clear();
}

std::uint32_t LinkSystem::add(const Shooter& shooter) {
  const auto index = static_cast<std::uint32_t>(shooters_.size());
  shooters_.push_back(shooter);
  changed_.push_back(true);
  if (shooter.isLight()) return index;
  const NodePlace& place = shooter.place;
  const Side& side = sides_[place.side];
  const auto node = nodeId(side, place);
  RAD_CHECK(shooter_of_node_[node] == scene::kNone && !below_[node]);
  shooter_of_node_[node] = index;
  members_[place.side].push_back(index);
  for (std::uint32_t level = place.level + 1; level < side.level_count; ++level) {
    const std::uint32_t up = level - place.level;
    const auto above = nodeId(side, {place.side, level, place.x >> up, place.y >> up});
    below_[above] = true;
    if (shooters_[index].parent == scene::kNone) shooters_[index].parent = shooter_of_node_[above];
  }
  return index;
}

void LinkSystem::forget(std::uint32_t index) {
  shooters_[index].column = {};
  shooters_[index].products = {};
  for (auto& half : matrix_) {
    for (auto& row : half) {
      if (index < row.size()) row[index] = 0.0F;
    }
  }
}

void LinkSystem::updateRows() {
  const std::size_t count = shooters_.size();
  emission_mean_.resize(count, glm::vec3(0.0F));
  reflectance_mean_.resize(count, glm::vec3(0.0F));
  rows_.resize(count);
  for (auto m = known_; m < count; ++m) {
    auto& row = rows_[m];
    row = {static_cast<std::uint32_t>(matrix_[0].size()), 0};
    const Shooter& shooter = shooters_[m];
    if (shooter.isLight()) continue;
    const Side& side = sides_[shooter.place.side];
    row.count = uniform_[shooter.place.side] ? 1 : 3;
    for (auto& half : matrix_) half.resize(half.size() + row.count);
    glm::dvec3 emission(0.0), reflectance(0.0);
    double area = 0.0;
    const auto rect = leafRect(side, shooter.place);
    for (auto y = rect.y0; y < rect.y1; ++y) {
      for (auto x = rect.x0; x < rect.x1; ++x) {
        const auto leaf = y * side.width + x;
        const auto a = static_cast<double>(patches_.node_area[side.first_node + leaf]);
        area += a;
        emission += a * glm::dvec3(emission_[side.first_value + leaf]);
        reflectance += a * glm::dvec3(reflectance_[side.first_value + leaf]);
      }
    }
    emission_mean_[m] = side.gathered ? glm::vec3(0.0F) : glm::vec3(emission / area);
    reflectance_mean_[m] = glm::vec3(reflectance / area);
  }
  const auto half = [&](std::size_t h) {
    for (auto& row : matrix_[h]) row.reserve(count), row.resize(count, 0.0F);  // no room to spare: memory is bounded
    for (std::uint32_t n = 0; n < count; ++n) updateRows(h, n, changed_[n] ? 0 : static_cast<std::uint32_t>(known_));
  };
  std::thread other(half, 1);
  half(0);
  other.join();
  known_ = count;
  std::fill(changed_.begin(), changed_.end(), false);
}

/// Entries of one column in the rows of all members from `first_member` on.
void LinkSystem::updateRows(std::size_t half, std::uint32_t column, std::uint32_t first_member) {
  thread_local std::vector<float> links;
  const auto& from = shooters_[column].column[half];
  for (const auto& run : from.runs()) {
    for (std::uint32_t s = run.side; s < run.side + run.side_count; ++s) {
      const auto& members = members_[s];
      const auto first = std::lower_bound(members.begin(), members.end(), first_member);
      if (first == members.end()) continue;
      links.resize(sides_[s].leaf_count);
      (void)from.decode(sides_[s].first_value, links);
      for (auto m = first; m != members.end(); ++m) fillRow(half, *m, column, links.data());
    }
  }
}

void LinkSystem::fillRow(std::size_t half, std::uint32_t member, std::uint32_t column, const float* links) {
  const NodePlace& place = shooters_[member].place;
  const Side& side = sides_[place.side];
  const auto rect = leafRect(side, place);
  const float inverse = 1.0F / patches_.node_area[nodeId(side, place)];
  const float* area = &patches_.node_area[side.first_node];
  const auto& row = rows_[member];
  if (row.count == 1) {
    float sum = 0.0F;
    for (auto y = rect.y0; y < rect.y1; ++y) {
      for (auto x = rect.x0; x < rect.x1; ++x) sum += area[y * side.width + x] * links[y * side.width + x];
    }
    matrix_[half][row.first][column] = sum * inverse;
    return;
  }
  glm::vec3 sum(0.0F);
  for (auto y = rect.y0; y < rect.y1; ++y) {
    for (auto x = rect.x0; x < rect.x1; ++x) {
      const auto leaf = y * side.width + x;
      sum += area[leaf] * links[leaf] * reflectance_[side.first_value + leaf];
    }
  }
  for (int c = 0; c < 3; ++c) matrix_[half][row.first + static_cast<std::uint32_t>(c)][column] = sum[c] * inverse;
}

int LinkSystem::solve() {
  updateRows();
  int other_sweeps = 0;
  std::thread other([&] { other_sweeps = solveHalf(1); });
  const int sweeps = solveHalf(0);
  other.join();
  return std::max(sweeps, other_sweeps);
}

/// Weights above one, of weak shooters that stand for others, can make light grow without end between surfaces that all
/// but touch, which send most of what they have to each other. Then all weights are at most one: a little light is
/// missing, which the balance of energy shows.
int LinkSystem::solveHalf(std::size_t half) {
  const auto clear = [&](double most) {
    for (auto& shooter : shooters_) {
      if (shooter.isLight()) continue;
      shooter.weight[half] = std::min(shooter.weight[half], most);
      shooter.mean[half] = shooter.sent[half] = glm::vec3(0.0F);
    }
  };
  int sweeps = sweepHalf(half);
  if (sweeps == 0) {
    clear(1.0);
    sweeps = sweepHalf(half);
  }
  if (sweeps == 0) clear(0.0);  // not even that: direct light is all that is sure
  return sweeps;
}

/// The most that may be sent, all channels: a thousand times what shines (reflectance is at most 0.999), and room for
/// what children send to correct their parents.
double LinkSystem::mostSent(std::size_t half) const {
  double shining = 0.0;
  for (std::size_t n = 0; n < shooters_.size(); ++n) {
    const auto& shooter = shooters_[n];
    shining +=
        static_cast<double>(channelSum(shooter.isLight() ? shooter.sent[half] : emission_mean_[n])) * shooter.area;
  }
  return kMostInterreflection * shining;
}

/// Number of sweeps; 0: light grew without end.
int LinkSystem::sweepHalf(std::size_t half) {
  const double most = mostSent(half);
  const std::size_t count = shooters_.size();
  std::array<std::vector<float>, 3> sent;
  for (auto& channel : sent) channel.resize(count);
  for (std::size_t n = 0; n < count; ++n) {
    const auto weight = static_cast<float>(shooters_[n].weight[half]);
    for (std::size_t c = 0; c < 3; ++c) sent[c][n] = weight * shooters_[n].sent[half][static_cast<int>(c)];
  }
  for (int sweep = 1; sweep <= kMaxSweeps; ++sweep) {
    double change = 0.0, all = 0.0;
    for (std::size_t m = 0; m < count; ++m) {
      auto& shooter = shooters_[m];
      if (shooter.isLight()) continue;
      glm::vec3 mean = emission_mean_[m];
      for (std::size_t c = 0; c < 3; ++c) {
        const auto i = static_cast<int>(c);
        const auto& row = rows_[m];
        mean[i] += row.count == 1
                       ? reflectance_mean_[m][i] * dot(matrix_[half][row.first].data(), sent[c].data(), count)
                       : dot(matrix_[half][row.first + c].data(), sent[c].data(), count);
      }
      const glm::vec3 above = shooter.parent == scene::kNone ? glm::vec3(0.0F) : shooters_[shooter.parent].mean[half];
      const glm::vec3 next = mean - above;
      change += static_cast<double>(channelSum(next - shooter.sent[half])) * shooter.area;
      all += static_cast<double>(channelSum(next)) * shooter.area;
      shooter.mean[half] = mean;
      shooter.sent[half] = next;
      for (std::size_t c = 0; c < 3; ++c)
        sent[c][m] = static_cast<float>(shooter.weight[half]) * next[static_cast<int>(c)];
    }
    if (!std::isfinite(all) || (all > most && change > 0.0)) return 0;
    if (change <= kSolved * all) return sweep;
  }
  return kMaxSweeps;
}

void LinkSystem::irradiance(std::size_t half, std::vector<glm::vec3>& values) const {
  std::array<std::vector<float>, 3> planes;
  for (auto& plane : planes) plane.assign(reflectance_.size(), 0.0F);
  for (const auto& shooter : shooters_) {
    const glm::vec3 sent = static_cast<float>(shooter.weight[half]) * shooter.sent[half];
    if (sent == glm::vec3(0.0F)) continue;
    shooter.column[half].apply({sent.x, sent.y, sent.z}, {planes[0].data(), planes[1].data(), planes[2].data()});
  }
  values.resize(reflectance_.size());
  for (std::size_t v = 0; v < values.size(); ++v) values[v] = {planes[0][v], planes[1][v], planes[2][v]};
}

std::size_t LinkSystem::bytes() const {
  std::size_t sum = 0;
  for (const auto& shooter : shooters_) sum += shooter.column[0].bytes() + shooter.column[1].bytes();
  for (const auto& half : matrix_) sum += half.size() * shooters_.size() * sizeof(float);
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
