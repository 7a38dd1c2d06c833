#include "server/gpu/triangle_culler.h"

#include <algorithm>
#include <bit>
#include <glm/vector_relational.hpp>

namespace radiosity::gpu {
namespace {

/// Heights above the shooter's plane that are taken for the plane itself: rounding puts neighbours in the same plane up
/// to 1e-7 above it, where they would cover everything.
constexpr float kCoplanar = 1.0e-6F;

/// The shooter must be this far (unit box) outside a solid's bounds to count as outside.
constexpr float kOutside = 1.0e-6F;
constexpr int kBackBit = 7;

struct Corners {
  const float* x;
  const float* y;
  const float* z;
};

std::uint16_t bit(bool set, int place) { return static_cast<std::uint16_t>(static_cast<int>(set) << place); }

/// A face's pyramid is cut by planes through the origin; a triangle is out when all corners lie outside one of them.
void classify(const HemicubeAxes& axes, const std::array<Corners, 3>& corners, const std::array<const float*, 4>& plane,
              std::size_t count, std::uint16_t* __restrict faces) {
  const auto [o, t, b, n] = axes;
  for (std::size_t i = 0; i < count; ++i) {
    float x[3], y[3], z[3];
    for (int c = 0; c < 3; ++c) {
      const float dx = corners[c].x[i] - o.x;
      const float dy = corners[c].y[i] - o.y;
      const float dz = corners[c].z[i] - o.z;
      x[c] = dx * t.x + dy * t.y + dz * t.z;
      y[c] = dx * b.x + dy * b.y + dz * b.z;
      z[c] = dx * n.x + dy * n.y + dz * n.z;
    }
    const auto low = [](const float(&v)[3], const float(&w)[3], float s) {
      return std::min({v[0] + s * w[0], v[1] + s * w[1], v[2] + s * w[2]});
    };
    const auto high = [](const float(&v)[3], const float(&w)[3], float s) {
      return std::max({v[0] + s * w[0], v[1] + s * w[1], v[2] + s * w[2]});
    };
    const bool above = std::max({z[0], z[1], z[2]}) > kCoplanar;
    // highest and lowest of z -+ x, z -+ y, x -+ y over the corners
    const float zx_high = high(z, x, -1), zx_low = low(z, x, -1), zpx_high = high(z, x, 1), zpx_low = low(z, x, 1);
    const float zy_high = high(z, y, -1), zy_low = low(z, y, -1), zpy_high = high(z, y, 1), zpy_low = low(z, y, 1);
    const float xy_high = high(x, y, -1), xy_low = low(x, y, -1), xpy_high = high(x, y, 1), xpy_low = low(x, y, 1);
    const bool top = above & (zx_high > 0) & (zpx_high > 0) & (zy_high > 0) & (zpy_high > 0);
    const bool px = above & (zx_low < 0) & (xy_high > 0) & (xpy_high > 0);
    const bool mx = above & (zpx_low < 0) & (xpy_low < 0) & (xy_low < 0);
    const bool py = above & (zy_low < 0) & (xy_low < 0) & (xpy_high > 0);
    const bool my = above & (zpy_low < 0) & (xpy_low < 0) & (xy_high > 0);
    const bool risen = std::min({z[0], z[1], z[2]}) > 0;
    const bool top_in = top & (zx_low > 0) & (zpx_low > 0) & (zy_low > 0) & (zpy_low > 0);
    const bool px_in = px & risen & (zx_high < 0) & (xy_low > 0) & (xpy_low > 0);
    const bool mx_in = mx & risen & (zpx_high < 0) & (xpy_high < 0) & (xy_high < 0);
    const bool py_in = py & risen & (zy_high < 0) & (xy_high < 0) & (xpy_low > 0);
    const bool my_in = my & risen & (zpy_high < 0) & (xpy_high < 0) & (xy_low > 0);
    const bool back = plane[0][i] * o.x + plane[1][i] * o.y + plane[2][i] * o.z < plane[3][i];
    faces[i] = static_cast<std::uint16_t>(bit(back, kBackBit) | bit(top, 0) | bit(px, 1) | bit(mx, 2) | bit(py, 3) |
                                          bit(my, 4) | bit(top_in, 8) | bit(px_in, 9) | bit(mx_in, 10) |
                                          bit(py_in, 11) | bit(my_in, 12));
  }
}

}  // namespace

TriangleCuller::TriangleCuller(const scene::PatchScene& patches)
    : triangle_count_(patches.indices.size() / 3),
      solids_(findClosedSolids(patches)),
      outside_(solids_.bounds.size()),
      indices_(patches.indices),
      faces_(triangle_count_) {
  for (auto& part : plane_) part.resize(triangle_count_);
  for (std::size_t i = 0; i < triangle_count_; ++i) {
    const auto& corner = patches.vertices[indices_[3 * i]];
    for (int axis = 0; axis < 3; ++axis) plane_[static_cast<std::size_t>(axis)][i] = corner.normal[axis];
    plane_[3][i] = glm::dot(corner.normal, corner.position);
  }
  for (int c = 0; c < 3; ++c) {
    for (auto& axis : corner_[c]) axis.resize(triangle_count_);
    for (std::size_t i = 0; i < triangle_count_; ++i) {
      const auto& position = patches.vertices[indices_[3 * i + c]].position;
      for (int axis = 0; axis < 3; ++axis) corner_[c][axis][i] = position[axis];
    }
  }
  for (auto& list : seen_) list.resize(3 * triangle_count_);
}

TriangleCuller::Counts TriangleCuller::cull(const HemicubeAxes& axes, std::vector<std::uint32_t>& indices) {
  std::array<Corners, 3> corners{};
  for (int c = 0; c < 3; ++c) corners[c] = {corner_[c][0].data(), corner_[c][1].data(), corner_[c][2].data()};
  classify(axes, corners, {plane_[0].data(), plane_[1].data(), plane_[2].data(), plane_[3].data()}, triangle_count_,
           faces_.data());
  for (std::size_t i = 0; i < outside_.size(); ++i) {
    const auto& [low, high] = solids_.bounds[i];
    outside_[i] = static_cast<std::uint8_t>(glm::any(glm::lessThan(axes.origin, low - kOutside)) ||
                                            glm::any(glm::greaterThan(axes.origin, high + kOutside)));
  }
  std::array<std::uint32_t, std::size_t{2} * RAD_FACES> count{};
  for (std::size_t i = 0; i < triangle_count_; ++i) {
    if ((faces_[i] >> kBackBit & 1) != 0 && backHidden(i)) continue;
    for (auto faces = faces_[i] & 0x1FU; faces != 0; faces &= faces - 1) {
      const auto face = static_cast<unsigned>(std::countr_zero(faces));
      const auto list = 2 * face + 1 - (faces_[i] >> (8 + face) & 1U);
      std::copy_n(&indices_[3 * i], 3, &seen_[list][count[list]]);
      count[list] += 3;
    }
  }
  Counts counts{};
  for (std::size_t list = 0; list < seen_.size(); ++list) {
    indices.insert(indices.end(), seen_[list].begin(), seen_[list].begin() + count[list]);
    (list % 2 == 0 ? counts[list / 2].inside : counts[list / 2].crossing) = count[list];
  }
  return counts;
}

}  // namespace radiosity::gpu
