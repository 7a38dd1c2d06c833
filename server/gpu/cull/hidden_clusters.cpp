// TriangleCuller::takeHidden: clusters against the depth of what was drawn first.
#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "server/gpu/cull/triangle_culler.h"

namespace radiosity::gpu {
namespace {

/// Side of the blocks whose farthest depth is kept, pixels.
constexpr std::uint32_t kBlock = 8;
/// A cluster must be farther than what is drawn by this part of its distance, for rounding.
constexpr float kBehind = 1e-4F;
/// Pixels around a cluster's image that must be covered too, since rasterisers may move corners a little.
constexpr float kAround = 0.125F;

/// Depth image of one face with its blocks.
class FaceDepth {
 public:
  FaceDepth(std::span<const float> depth, std::uint32_t width, std::uint32_t height)
      : depth_(depth), width_(width), height_(height), columns_((width + kBlock - 1) / kBlock) {
    farthest_.assign(std::size_t{columns_} * ((height + kBlock - 1) / kBlock), 1e30F);
    for (std::uint32_t y = 0; y < height; ++y) {
      for (std::uint32_t x = 0; x < width; ++x) {
        auto& block = farthest_[y / kBlock * columns_ + x / kBlock];
        block = std::min(block, depth[std::size_t{y} * width + x]);
      }
    }
  }

  /// Whether every pixel of columns x0 to x1 and rows y0 to y1, both included, shows something nearer than `nearest`.
  [[nodiscard]] bool covers(std::uint32_t x0, std::uint32_t x1, std::uint32_t y0, std::uint32_t y1,
                            float nearest) const {
    for (auto by = y0 / kBlock; by <= y1 / kBlock; ++by) {
      for (auto bx = x0 / kBlock; bx <= x1 / kBlock; ++bx) {
        if (farthest_[by * columns_ + bx] > nearest) continue;
        for (auto y = std::max(y0, by * kBlock); y <= std::min(y1, by * kBlock + kBlock - 1); ++y) {
          for (auto x = std::max(x0, bx * kBlock); x <= std::min(x1, bx * kBlock + kBlock - 1); ++x) {
            if (depth_[std::size_t{y} * width_ + x] <= nearest) return false;
          }
        }
      }
    }
    return true;
  }
  [[nodiscard]] std::uint32_t width() const { return width_; }
  [[nodiscard]] std::uint32_t height() const { return height_; }

 private:
  std::span<const float> depth_;
  std::uint32_t width_, height_, columns_;
  std::vector<float> farthest_;
};

/// A face's axes: clip space as hemicube.vert makes it, without the lattice's shift.
struct FaceAxes {
  glm::vec3 across, up, depth;
  bool top;
};

std::array<FaceAxes, RAD_FACES> faceAxes(const HemicubeAxes& axes) {
  const auto t = axes.tangent, b = axes.bitangent, n = axes.normal;
  return {{{t, b, n, true}, {b, n, t, false}, {b, n, -t, false}, {t, n, b, false}, {t, n, -b, false}}};
}

/// Bounds of v / w for v and w > 0 in intervals.
std::array<float, 2> quotient(float v_low, float v_high, float w_low, float w_high) {
  return {v_low < 0.0F ? v_low / w_low : v_low / w_high, v_high < 0.0F ? v_high / w_high : v_high / w_low};
}

/// First and last pixel whose sample lies in an interval, clamped to the image; false when there is none.
bool pixelsIn(float low, float high, std::uint32_t size, std::uint32_t& first, std::uint32_t& last) {
  const auto limit = static_cast<float>(size) - 1.0F;
  const float from = std::ceil(low - 0.5F - kAround), to = std::floor(high - 0.5F + kAround);
  if (from > to || to < 0.0F || from > limit) return false;
  first = static_cast<std::uint32_t>(std::max(from, 0.0F));
  last = static_cast<std::uint32_t>(std::min(to, limit));
  return true;
}

struct Pose {
  glm::vec3 origin;
  float half, shift_x, shift_y;
};

bool isHidden(const TriangleClusters::Cluster& cluster, const Pose& pose, const FaceAxes& face,
              const FaceDepth& image) {
  const auto centre = cluster.centre - pose.origin;
  const auto span = [&](const glm::vec3& along) {
    const float middle = glm::dot(centre, along), reach = glm::dot(cluster.extent, glm::abs(along));
    return std::array{middle - reach, middle + reach};
  };
  const auto [w_low, w_high] = span(face.depth);
  if (w_low <= 1e-5F) return false;
  const auto [across_low, across_high] = span(face.across);
  const auto [up_low, up_high] = span(face.up);
  const auto columns = quotient(across_low, across_high, w_low, w_high),
             rows = quotient(up_low, up_high, w_low, w_high);
  const float from_edge = face.top ? 1.0F : 0.0F;  // rows of a side begin at the horizon
  std::uint32_t x0 = 0, x1 = 0, y0 = 0, y1 = 0;
  if (!pixelsIn((columns[0] + 1.0F) * pose.half + pose.shift_x, (columns[1] + 1.0F) * pose.half + pose.shift_x,
                image.width(), x0, x1) ||
      !pixelsIn((rows[0] + from_edge) * pose.half + pose.shift_y, (rows[1] + from_edge) * pose.half + pose.shift_y,
                image.height(), y0, y1)) {
    return true;  // no sample could show it
  }
  return image.covers(x0, x1, y0, y1, static_cast<float>(RAD_NEAR) / w_low * (1.0F + kBehind));
}

}  // namespace

std::uint32_t TriangleCuller::takeHidden(const solver::HemicubeFrame& frame, std::uint32_t resolution,
                                         std::span<const float> depth, Selection& selection) const {
  const auto axes = hemicubeAxes(frame);
  const auto [across, up] = latticePhase(frame.lattice);
  const Pose pose{axes.origin, 0.5F * static_cast<float>(resolution), static_cast<float>(0.5 - across),
                  static_cast<float>(0.5 - up)};
  const auto faces = faceAxes(axes);
  std::uint32_t taken = 0;
  for (std::uint32_t face = 0; face < RAD_FACES; ++face) {
    if (selection.second[2 * face].runs.empty() && selection.second[2 * face + 1].runs.empty()) continue;
    const std::uint32_t first_row = face == 0 ? 0 : resolution + (face - 1) * resolution / 2;
    const FaceDepth image(depth.subspan(std::size_t{first_row} * resolution), resolution,
                          face == 0 ? resolution : resolution / 2);
    for (auto* list : {&selection.second[2 * face], &selection.second[2 * face + 1]}) {
      std::uint32_t kept = 0, begin = 0;
      for (const auto& run : list->runs) {
        if (!isHidden(clusters_.clusters[run.cluster], pose, faces[face], image)) {
          std::copy(list->indices.begin() + begin, list->indices.begin() + run.end, list->indices.begin() + kept);
          kept += run.end - begin;
        }
        begin = run.end;
      }
      taken += (begin - kept) / 3;
      list->count = kept;
    }
  }
  return taken;
}

}  // namespace radiosity::gpu
