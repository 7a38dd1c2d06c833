// What item buffers tell LightGatherer: which receivers a point on the light sees, and what of its light is lost.
#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>

#include "common/clones.h"
#include "server/gpu/gather/light_gatherer.h"
#include "server/gpu/gather/scatter_accumulator.h"

namespace radiosity::gpu {
namespace {

/// What few points in front of a receiver's plane stand for is multiplied by this at most.
constexpr float kMostForOthers = 8.0F;

/// A single pixel through which one looks out of the scene, between four that show something: where a corner of one
/// wall meets the middle of another's edge, rounding leaves such holes, and no light must leave by them.
/// Of a pixel at the edge of its face those on the face tell.
bool isCrack(std::span<const std::uint32_t> items, std::size_t first, std::size_t end, std::size_t width) {
  if (end - first != 1) return false;
  const auto column = first % width, row = first / width;
  const auto rows = row < width ? width : width / 2, row_of_face = row < width ? row : (row - width) % rows;
  const auto shows = [&](std::size_t pixel) { return items[pixel] != RAD_ITEM_NONE; };
  return (column == 0 || shows(first - 1)) && (column + 1 == width || shows(first + 1)) &&
         (row_of_face == 0 || shows(first - width)) && (row_of_face + 1 == rows || shows(first + width));
}

/// What the kernel below needs of a hemicube and of the receivers.
struct PointView {
  glm::vec3 o, t, b, n;
  int resolution;
  float shift_x, shift_y;
};

/// For every receiver: the pixel of the hemicube's image in which it lies (the cells of hemicube_weights.h), and cos
/// cos / r^2. Branch-free, so that it vectorises; one clone for processors with 256-bit vectors, same bits in both.
RADIOSITY_CLONES void projectReceivers(const PointView& view, std::size_t count, const float* x, const float* y,
                                       const float* z, const float* nx, const float* ny, const float* nz,
                                       std::uint32_t* pixel, float* weight) {
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

/// What of a doubt is not of the receiver (Receivers::Care): what its pixel shows may hide the light from it.
constexpr std::uint32_t kHides = 4;

/// Planes of triangles, by triangle: normal and distance. Items of a hemicube, by pixel.
struct Seen {
  const float* planes;
  const std::int32_t* items;
};

/// What questions a receiver's pixel leaves: a receiver in a gap has one in any case, one of a surface with two sides
/// where the pixel shows what lies behind it, all where the pixel shows nothing, or an item behind whose plane they
/// lie, on the side that the light at `o` does not see. Most have none, and see the light. Indices have signs so that
/// it vectorises.
RADIOSITY_CLONES void findDoubts(const glm::vec3& o, const Seen& seen, std::size_t count, const std::uint32_t* pixel,
                                 const float* x, const float* y, const float* z, const std::uint32_t* care,
                                 std::uint32_t* doubt) {
  static_assert(sizeof(Receivers::Plane) == 4 * sizeof(float) && static_cast<std::int32_t>(RAD_ITEM_NONE) < 0);
  const float ox = o.x, oy = o.y, oz = o.z;
  const auto [planes, items] = seen;
  for (std::size_t i = 0; i < count; ++i) {
    const auto item = items[static_cast<std::int32_t>(pixel[i])];
    const std::int32_t k = 4 * (item < 0 ? 0 : item);
    const float nx = planes[k], ny = planes[k + 1], nz = planes[k + 2], distance = planes[k + 3];
    const float light = nx * ox + ny * oy + nz * oz - distance;
    const float receiver = nx * x[i] + ny * y[i] + nz * z[i] - distance;
    const float before = light > 0.0F ? receiver : -receiver;
    const std::uint32_t asks = before > kApart ? care[i] : care[i] & Receivers::kInGap;
    doubt[i] = before < -kInPlane || item < 0 ? kHides | asks : asks;
  }
}

/// To look around so many pixels takes as long as to ask what the nine of one receiver in a gap show.
constexpr std::size_t kPixelsAGap = 50;

/// Rows of pixels that belong together: [first, end).
struct Rows {
  std::size_t first, end;
};

/// By pixel of some rows: whether the pixels around it do not all show what it shows. `along` is room for a row's
/// worth each: whether its two neighbours in the row do not.
RADIOSITY_CLONES void findUneven(const std::uint32_t* items, std::size_t size, Rows rows, std::uint8_t* along,
                                 std::uint8_t* uneven) {
  for (auto y = rows.first; y < rows.end; ++y) {
    const auto* row = items + y * size;
    auto* differs = along + y * size;
    differs[0] = row[0] != row[1] ? 1 : 0;
    for (std::size_t x = 1; x + 1 < size; ++x) differs[x] = (row[x] != row[x - 1] || row[x] != row[x + 1]) ? 1 : 0;
    differs[size - 1] = row[size - 1] != row[size - 2] ? 1 : 0;
  }
  for (auto y = rows.first; y < rows.end; ++y) {
    const std::size_t below = y > rows.first ? y - 1 : y, above = y + 1 < rows.end ? y + 1 : y;
    const auto *row = items + y * size, *low = items + below * size, *high = items + above * size;
    const auto *differs = along + y * size, *low_differs = along + below * size, *high_differs = along + above * size;
    auto* into = uneven + y * size;
    for (std::size_t x = 0; x < size; ++x) {
      const bool same = row[x] == low[x] && row[x] == high[x];
      into[x] = static_cast<std::uint8_t>(differs[x] | low_differs[x] | high_differs[x] | (same ? 0 : 1));
    }
  }
}

/// The part of what was weighed that was visible; see LightGatherer::findVisibility.
RADIOSITY_CLONES void weighVisible(std::size_t count, float points, const float* weight, const float* visible_weight,
                                   const float* front, float* visibility) {
  for (std::size_t i = 0; i < count; ++i) {
    const float seen = weight[i] > 0.0F ? visible_weight[i] / weight[i] : 0.0F;
    // The points are spread evenly: of `points`, one at least lies in front of all planes that cut off a larger part.
    const float some = std::min(1.0F, points * front[i]);
    visibility[i] = seen * (front[i] >= 1.0F ? 1.0F : std::min(1.0F / some, kMostForOthers));
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
  const Seen seen{&receivers_->planes()->normal.x, reinterpret_cast<const std::int32_t*>(items.data())};
  findDoubts(o, seen, lit_count_, lit_.pixel.data(), lit_.x.data(), lit_.y.data(), lit_.z.data(), lit_.care.data(),
             lit_.doubt.data());
  settleEvenGaps(items, size);
  for (std::size_t i = 0; i < lit_count_; ++i) {
    weight[i] += lit_.point_weight[i];
    visible_weight[i] += lit_.doubt[i] == 0 ? lit_.point_weight[i] : 0.0F;
  }
  std::size_t doubts = 0;
  for (std::size_t i = 0; i < lit_count_; ++i) {
    lit_.doubtful[doubts] = static_cast<std::uint32_t>(i);
    doubts += lit_.doubt[i] == 0 ? 0 : 1;
  }
  for (const auto i : std::span(lit_.doubtful.data(), doubts)) {
    if (!hidden(i, o, items, size)) visible_weight[i] += lit_.point_weight[i];
  }
  asked_ = {};
  lookFromEdges(shot, point, half);
}

/// Of a receiver whose pixel leaves doubts.
bool LightGatherer::hidden(std::size_t i, const glm::vec3& light, std::span<const std::uint32_t> items,
                           std::size_t size) const {
  const auto item = items[lit_.pixel[i]];
  if (item == RAD_ITEM_NONE) return hiddenAtSilhouette(i, light, items, size);
  if ((lit_.doubt[i] & Receivers::kInGap) != 0) return hiddenFromGap(i, light, items, size);
  // Beside a silhouette one looks past what closes a hollow whose inside is a surface as well.
  if ((lit_.doubt[i] & kHides) == 0) return hiddenAtSilhouette(i, light, items, size);
  const auto ray = rayTo(i, light, size);
  return receivers_->hidesBefore(item, ray) ||
         ((lit_.care[i] & Receivers::kTwoSided) != 0 && receivers_->isBlocked(ray));
}

/// Of receivers in gaps whose pixel, and all around it, show the same item, nothing is left to ask unless that hides
/// them. In furnished rooms half of all that is lit lies in gaps.
void LightGatherer::settleEvenGaps(std::span<const std::uint32_t> items, std::size_t size) {
  if (kPixelsAGap * gaps_ < items.size()) return;
  along_.resize(items.size());
  uneven_.resize(items.size());
  for (std::size_t face = 0, first = 0; face < RAD_FACES; ++face) {
    const auto end = first + (face == 0 ? size : size / 2);
    findUneven(items.data(), size, {first, end}, along_.data(), uneven_.data());
    first = end;
  }
  for (std::size_t i = 0; i < lit_count_; ++i) {
    const bool settled =
        (lit_.doubt[i] & (kHides | Receivers::kInGap)) == Receivers::kInGap && uneven_[lit_.pixel[i]] == 0;
    if (settled) lit_.doubt[i] = 0;
  }
}

/// The receiver's pixel and those around it, on the same face.
std::array<std::uint32_t, 9> LightGatherer::itemsAround(std::size_t i, std::span<const std::uint32_t> items,
                                                        std::size_t size) const {
  const std::size_t pixel = lit_.pixel[i], column = pixel % size, row = pixel / size;
  const std::size_t first_row = row < size ? 0 : size + (row - size) / (size / 2) * (size / 2);
  const std::size_t rows = row < size ? size : size / 2;
  std::array<std::uint32_t, 9> around{};
  const bool inside = column > 0 && column + 1 < size && row > first_row && row + 1 < first_row + rows;
  for (std::size_t k = 0; k < 3; ++k) {
    if (inside) {
      const auto* three = &items[pixel + k * size - size - 1];
      std::copy(three, three + 3, &around[3 * k]);
      continue;
    }
    const auto y = std::clamp<std::size_t>(row - first_row + k, 1, rows) - 1;
    for (std::size_t x = 0; x < 3; ++x)
      around[3 * k + x] = items[(first_row + y) * size + std::clamp<std::size_t>(column + x, 1, size) - 1];
  }
  return around;
}

Receivers::Ray LightGatherer::rayTo(std::size_t i, const glm::vec3& light, std::size_t size) const {
  const glm::vec3 at(lit_.x[i], lit_.y[i], lit_.z[i]), normal(lit_.nx[i], lit_.ny[i], lit_.nz[i]);
  const float pixel_size = 2.0F * glm::distance(light, at) / static_cast<float>(size);
  return {at, normal, light - at, 1.0F, pixel_size};
}

/// The middle of a receiver's pixel misses the receiver, and perhaps everything. Where the ray to it meets a wide facet
/// that a neighbouring pixel shows, that hides it: along the edges of a closed room, what lies behind its walls. Of a
/// surface with two sides one may be the inside of a thin shell, whose bevels no pixel need show: there all is asked.
bool LightGatherer::hiddenAtSilhouette(std::size_t i, const glm::vec3& light, std::span<const std::uint32_t> items,
                                       std::size_t size) const {
  const auto ray = rayTo(i, light, size);
  if ((lit_.care[i] & Receivers::kTwoSided) != 0 && receivers_->isBlocked(ray)) return true;
  return receivers_->anyMeets(itemsAround(i, items, size), ray);
}

/// Pixels blur the edges of shadows, which is right in the mean: what one leaf loses its neighbour gains. Not beside
/// what hovers right before a surface: the neighbour is dark.
bool LightGatherer::hiddenFromGap(std::size_t i, const glm::vec3& light, std::span<const std::uint32_t> items,
                                  std::size_t size) const {
  const auto own = items[lit_.pixel[i]];
  const auto around = itemsAround(i, items, size);
  if (std::any_of(around.begin(), around.end(), [own](std::uint32_t item) { return item != own; })) {
    const auto hidden = receivers_->hiddenAmong(around, rayTo(i, light, size));
    if (hidden) return *hidden;
  }
  return (lit_.doubt[i] & kHides) != 0 && receivers_->hidesBefore(own, rayTo(i, light, size));
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
/// stands for. Where there happen to be none, others stand for them, so that the mean over all samples is right; but
/// for the light of a last sliver, which would need too many.
void LightGatherer::findVisibility(std::size_t sums, std::size_t points) {
  weighVisible(lit_count_, static_cast<float>(points), lit_.weight[sums].data(), lit_.visible_weight[sums].data(),
               lit_.front.data(), lit_.visibility.data());
  takeEdges(sums, points);
}

}  // namespace radiosity::gpu
