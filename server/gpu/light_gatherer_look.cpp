// What item buffers tell LightGatherer: which receivers a point on the light sees, and what of its light is lost.
#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>

#include "server/gpu/light_gatherer.h"
#include "server/gpu/scatter_accumulator.h"

namespace radiosity::gpu {
namespace {

/// What few points in front of a receiver's plane stand for is multiplied by this at most.
constexpr double kMostForOthers = 4.0;

/// A single pixel through which one looks out of the scene, between four that show something: where a corner of one
/// wall meets the middle of another's edge, rounding leaves such holes, and no light must leave by them.
bool isCrack(std::span<const std::uint32_t> items, std::size_t first, std::size_t end, std::size_t width) {
  if (end - first != 1 || first < width || first + width >= items.size()) return false;
  for (const auto neighbour : {first - 1, first + 1, first - width, first + width}) {
    if (items[neighbour] == RAD_ITEM_NONE) return false;
  }
  return true;
}

/// What the kernel below needs of a hemicube and of the receivers.
struct PointView {
  glm::vec3 o, t, b, n;
  int resolution;
  float shift_x, shift_y;
};

/// For every receiver: the pixel of the hemicube's image in which it lies (the cells of hemicube_weights.h), and cos
/// cos / r^2. Branch-free, so that it vectorises; one clone for processors with 256-bit vectors, same bits in both.
__attribute__((target_clones("avx2", "default"))) void projectReceivers(const PointView& view, std::size_t count,
                                                                        const float* x, const float* y, const float* z,
                                                                        const float* nx, const float* ny,
                                                                        const float* nz, std::uint32_t* pixel,
                                                                        float* weight) {
  const int size = view.resolution, half_size = size / 2;
  const float half = static_cast<float>(size) / 2.0F;
  for (std::size_t i = 0; i < count; ++i) {
    const float dx = x[i] - view.o.x, dy = y[i] - view.o.y, dz = z[i] - view.o.z;
    const float lx = dx * view.t.x + dy * view.t.y + dz * view.t.z;
    const float ly = dx * view.b.x + dy * view.b.y + dz * view.b.z;
    const float lz = std::max(dx * view.n.x + dy * view.n.y + dz * view.n.z, 1.0e-9F);
    const float ax = std::abs(lx), ay = std::abs(ly), side = std::max(ax, ay);
    const bool top = lz >= side;
    const bool along_x = ax >= ay;
    const float depth = std::max(lz, side);
    const float across = top || !along_x ? lx : ly;
    const float up = top ? ly + depth : lz;  // top rows start at -1, side rows at the horizon
    const float scale = half / depth;
    const int column = std::clamp(static_cast<int>((across + depth) * scale + view.shift_x), 0, size - 1);
    const int row = std::clamp(static_cast<int>(up * scale + view.shift_y), 0, (top ? size : half_size) - 1);
    const int face = along_x ? (lx > 0.0F ? 0 : 1) : (ly > 0.0F ? 2 : 3);
    const int first_row = top ? 0 : size + face * half_size;
    pixel[i] = static_cast<std::uint32_t>((first_row + row) * size + column);
    const float square = dx * dx + dy * dy + dz * dz;
    const float cosine = std::max(0.0F, -(dx * nx[i] + dy * ny[i] + dz * nz[i]));
    weight[i] = lz * cosine / (square * square);
  }
}

}  // namespace

void LightGatherer::testPoint(const solver::GatherShot& shot, const solver::HemicubeFrame& point,
                              std::span<const std::uint32_t> items, std::size_t half) {
  const auto [o, t, b, n] = hemicubeAxes(point);
  const auto [across, up] = latticePhase(point.lattice);
  const PointView view{
      o, t, b, n, static_cast<int>(shot.resolution), static_cast<float>(0.5 - across), static_cast<float>(0.5 - up)};
  projectReceivers(view, lit_count_, lit_.x.data(), lit_.y.data(), lit_.z.data(), lit_.nx.data(), lit_.ny.data(),
                   lit_.nz.data(), lit_.pixel.data(), lit_.point_weight.data());
  const auto size = static_cast<std::size_t>(shot.resolution);
  float* weight = lit_.weight[half].data();
  float* visible_weight = lit_.visible_weight[half].data();
  for (std::size_t i = 0; i < lit_count_; ++i) {
    const auto item = items[lit_.pixel[i]];
    bool visible = true;
    if (item == RAD_ITEM_NONE) {
      visible = !hiddenAtSilhouette(i, o, items, size);
    } else {
      const auto& plane = receivers_->plane(item);
      const glm::vec3 at(lit_.x[i], lit_.y[i], lit_.z[i]);
      const float light = glm::dot(plane.normal, o) - plane.distance;
      const float receiver = glm::dot(plane.normal, at) - plane.distance;
      const float before = light > 0.0F ? receiver : -receiver;
      visible =
          before >= -kInPlane || !receivers_->risesBefore(item, at, glm::vec3(lit_.nx[i], lit_.ny[i], lit_.nz[i]));
    }
    weight[i] += lit_.point_weight[i];
    visible_weight[i] += visible ? lit_.point_weight[i] : 0.0F;
  }
}

/// The middle of a receiver's pixel misses everything, the receiver too. Where the ray to it meets a wide facet that a
/// neighbouring pixel shows, that hides it: along the edges of a closed room, what lies behind its walls.
bool LightGatherer::hiddenAtSilhouette(std::size_t i, const glm::vec3& light, std::span<const std::uint32_t> items,
                                       std::size_t size) const {
  const std::size_t pixel = lit_.pixel[i], column = pixel % size, row = pixel / size;
  const std::size_t first_row = row < size ? 0 : size + (row - size) / (size / 2) * (size / 2);
  const std::size_t rows = row < size ? size : size / 2;
  std::array<std::uint32_t, 9> around{};
  for (std::size_t k = 0; k < around.size(); ++k) {
    const auto x = std::clamp<std::size_t>(column + k % 3, 1, size) - 1;
    const auto y = std::clamp<std::size_t>(row - first_row + k / 3, 1, rows) - 1;
    around[k] = items[(first_row + y) * size + x];
  }
  const glm::vec3 at(lit_.x[i], lit_.y[i], lit_.z[i]), normal(lit_.nx[i], lit_.ny[i], lit_.nz[i]);
  const float pixel_size = 2.0F * glm::distance(light, at) / static_cast<float>(size);
  return receivers_->anyMeets(around, {at, normal, light - at, 1.0F, pixel_size});
}

void LightGatherer::weighLost(const solver::HemicubeFrame& point, std::span<const std::uint32_t> items,
                              std::uint32_t resolution, const HemicubeWeights& weights, Lost& lost) {
  starts_.resize(items.size() + 1);
  const auto runs = findRuns(items, starts_);
  for (std::size_t run = 0; run < runs; ++run) {
    const auto item = items[starts_[run]];
    const std::uint64_t weight = weights.before[starts_[run + 1]] - weights.before[starts_[run]];
    if (item == RAD_ITEM_NONE) {
      if (!isCrack(items, starts_[run], starts_[run + 1], resolution)) lost.escaped += weight;
      continue;
    }
    const bool back = glm::dot(receivers_->plane(item).normal, point.origin) <= receivers_->plane(item).distance;
    if (receivers_->absorbs(item, back)) lost.absorbed += weight;
  }
}

void LightGatherer::weighLostInside(const ViewWindow& window, const solver::HemicubeFrame& point,
                                    std::span<const std::uint32_t> items, std::uint32_t resolution,
                                    const HemicubeWeights& weights, Lost& lost) const {
  for (std::uint32_t row = 0; row < 3 * resolution; ++row) {
    const auto inside = pixelsInside(window, point, resolution, row);
    for (std::size_t i = std::size_t{row} * resolution + inside.first; i < std::size_t{row} * resolution + inside.end;
         ++i) {
      const auto item = items[i];
      if (item == RAD_ITEM_NONE) {
        if (!isCrack(items, i, i + 1, resolution)) lost.escaped += weights.pixel(i);
        continue;
      }
      const bool back = glm::dot(receivers_->plane(item).normal, point.origin) <= receivers_->plane(item).distance;
      if (receivers_->absorbs(item, back)) lost.absorbed += weights.pixel(i);
    }
  }
}

/// By the points before the receiver's plane, which decide alone: those behind it see nothing of what the form factor
/// stands for. Where there happen to be none, others stand for them, so that the mean over all samples is right. Where
/// so little lies in front that they would have to stand for very many, the receiver is taken to see the rest.
float LightGatherer::visibility(std::size_t sums, std::size_t i, std::size_t points) const {
  const float weight = lit_.weight[sums][i];
  if (lit_.front[i] >= 1.0F) return weight > 0.0F ? lit_.visible_weight[sums][i] / weight : 0.0F;
  // The points are spread evenly: of `points`, one at least lies in front of all planes that cut off a larger part.
  const double some = std::min(1.0, static_cast<double>(points) * static_cast<double>(lit_.front[i]));
  const double factor = std::min(1.0 / some, kMostForOthers);
  if (weight > 0.0F) return static_cast<float>(factor) * lit_.visible_weight[sums][i] / weight;
  return some < 1.0 ? static_cast<float>(std::max(0.0, 1.0 - factor * some) / (1.0 - some)) : 0.0F;
}

}  // namespace radiosity::gpu
