#include "server/gpu/cull/triangle_culler.h"

#include <algorithm>
#include <bit>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>

#include "common/clones.h"

namespace radiosity::gpu {
namespace {

constexpr auto kCoplanar = static_cast<float>(RAD_COPLANAR);
/// The shooter must be this far (unit box) outside a solid's bounds to count as outside.
constexpr float kOutside = 1.0e-6F;
/// Fewer make more boxes to look at, more make larger ones.
constexpr std::uint32_t kClusterTriangles = 64;
/// Below so many triangles of a scene nothing is gained by drawing in two steps.
constexpr std::size_t kManyTriangles = 2048;
/// Triangles of at least this solid angle, about, are drawn first: 12 pixels of a hemicube of N = 64. So are clusters
/// nearer than their own size.
constexpr float kLargeSteradian = 0.006F;
/// Half a pixel's part by which rasterisers may move corners (OpenGL asks for 4 bits of subpixel precision), and more.
constexpr float kSampleMargin = 0.0625F;

/// Of heights above the planes of a window (unit box): rounding.
constexpr float kWindowMargin = 1e-6F;

constexpr std::uint32_t kFaces = 0x1FU;  // bit f: face f may see it
constexpr int kBackBit = 7;              // it shows its back
constexpr int kInsideBit = 8;            // bit 8 + f: it lies wholly inside face f's pyramid
constexpr int kLargeBit = 16;
constexpr int kBetweenBit = 17;  // lies inside and between the sample points

/// What the kernel reads of a cluster's triangles.
struct Triangles {
  std::array<std::array<const float*, 3>, 3> corner;
  std::array<const float*, 4> plane;
  const float* area;
};

struct View {
  HemicubeAxes axes;
  float half, shift_x, shift_y;  ///< N / 2; of the lattice, pixels
};

View viewOf(const solver::HemicubeFrame& frame, std::uint32_t resolution) {
  const auto [across, up] = latticePhase(frame.lattice);
  return {hemicubeAxes(frame), 0.5F * static_cast<float>(resolution), static_cast<float>(0.5 - across),
          static_cast<float>(0.5 - up)};
}

// By value and without initializer lists, so that the loop below vectorises.
inline float smaller(float a, float b) { return a < b ? a : b; }
inline float larger(float a, float b) { return a > b ? a : b; }
inline float smallest(float a, float b, float c) { return smaller(smaller(a, b), c); }
inline float largest(float a, float b, float c) { return larger(larger(a, b), c); }

inline std::uint32_t bit(bool set, int place) { return static_cast<std::uint32_t>(static_cast<int>(set) << place); }

/// Smallest and largest of z -+ x, z -+ y, x -+ y over what is looked at, which place it among the planes between the
/// faces, and the greatest and smallest height.
struct Spans {
  float zx_low, zx_high, zpx_low, zpx_high, zy_low, zy_high, zpy_low, zpy_high, xy_low, xy_high, xpy_low, xpy_high;
  float z_low, z_high;
};

/// A face's pyramid is cut by planes through the origin; something is out when all of it lies outside one of them.
inline std::uint32_t facesOf(const Spans& s) {
  const bool above = s.z_high > kCoplanar;
  const bool top = above & (s.zx_high > 0) & (s.zpx_high > 0) & (s.zy_high > 0) & (s.zpy_high > 0);
  const bool px = above & (s.zx_low < 0) & (s.xy_high > 0) & (s.xpy_high > 0);
  const bool mx = above & (s.zpx_low < 0) & (s.xpy_low < 0) & (s.xy_low < 0);
  const bool py = above & (s.zy_low < 0) & (s.xy_low < 0) & (s.xpy_high > 0);
  const bool my = above & (s.zpy_low < 0) & (s.xpy_low < 0) & (s.xy_high > 0);
  return bit(top, 0) | bit(px, 1) | bit(mx, 2) | bit(py, 3) | bit(my, 4);
}

/// Whether a triangle of these corners, in pixels, covers none of the samples at whole numbers: it lies between two
/// columns or rows of them, or has four at most in its bounds and is beside each. Without branches, as the loop that
/// calls it.
inline bool showsNoSample(const float (&column)[3], const float (&row)[3]) {
  const int left = static_cast<int>(smallest(column[0], column[1], column[2]) - kSampleMargin);
  const int right = static_cast<int>(largest(column[0], column[1], column[2]) + kSampleMargin);
  const int below = static_cast<int>(smallest(row[0], row[1], row[2]) - kSampleMargin);
  const int above = static_cast<int>(largest(row[0], row[1], row[2]) + kSampleMargin);
  const int columns = right - left, rows = above - below;
  float du[3], dv[3], slack[3];
  for (std::size_t c = 0; c < 3; ++c) {
    du[c] = column[(c + 1) % 3] - column[c];
    dv[c] = row[(c + 1) % 3] - row[c];
    slack[c] = -kSampleMargin * (std::abs(du[c]) + std::abs(dv[c]));
  }
  const float turn = du[0] * dv[1] - dv[0] * du[1] < 0.0F ? -1.0F : 1.0F;
  bool hit = (columns > 2) | (rows > 2);
  for (int k = 0; k < 4; ++k) {
    const float u = static_cast<float>(right - (k & 1)), v = static_cast<float>(above - (k >> 1));
    bool in = (columns > (k & 1)) & (rows > (k >> 1));
    for (std::size_t c = 0; c < 3; ++c) in = in & (turn * (du[c] * (v - row[c]) - dv[c] * (u - column[c])) >= slack[c]);
    hit = hit | in;
  }
  return (columns == 0) | (rows == 0) | !hit;
}

RADIOSITY_CLONES void classify(const View& view, const Triangles& from, std::size_t first, std::size_t end,
                               std::uint32_t* __restrict seen) {
  const auto [o, t, b, n] = view.axes;
  for (std::size_t i = first; i < end; ++i) {
    float x[3], y[3], z[3];
    float nearest = 1e30F;
    for (std::size_t c = 0; c < 3; ++c) {
      const float dx = from.corner[c][0][i] - o.x;
      const float dy = from.corner[c][1][i] - o.y;
      const float dz = from.corner[c][2][i] - o.z;
      x[c] = dx * t.x + dy * t.y + dz * t.z;
      y[c] = dx * b.x + dy * b.y + dz * b.z;
      z[c] = dx * n.x + dy * n.y + dz * n.z;
      nearest = smaller(nearest, dx * dx + dy * dy + dz * dz);
    }
    const auto low = [](const float(&v)[3], const float(&w)[3], float s) {
      return smallest(v[0] + s * w[0], v[1] + s * w[1], v[2] + s * w[2]);
    };
    const auto high = [](const float(&v)[3], const float(&w)[3], float s) {
      return largest(v[0] + s * w[0], v[1] + s * w[1], v[2] + s * w[2]);
    };
    const Spans s{low(z, x, -1),
                  high(z, x, -1),
                  low(z, x, 1),
                  high(z, x, 1),
                  low(z, y, -1),
                  high(z, y, -1),
                  low(z, y, 1),
                  high(z, y, 1),
                  low(x, y, -1),
                  high(x, y, -1),
                  low(x, y, 1),
                  high(x, y, 1),
                  smallest(z[0], z[1], z[2]),
                  largest(z[0], z[1], z[2])};
    const std::uint32_t faces = facesOf(s);
    const bool risen = s.z_low > 0;
    const bool top_in = risen & (s.zx_low > 0) & (s.zpx_low > 0) & (s.zy_low > 0) & (s.zpy_low > 0);
    const bool px_in = risen & (s.zx_high < 0) & (s.xy_low > 0) & (s.xpy_low > 0);
    const bool mx_in = risen & (s.zpx_high < 0) & (s.xpy_high < 0) & (s.xy_high < 0);
    const bool py_in = risen & (s.zy_high < 0) & (s.xy_high < 0) & (s.xpy_low > 0);
    const bool my_in = risen & (s.zpy_high < 0) & (s.xpy_high < 0) & (s.xy_low > 0);
    // What stands on the shooter's plane is as good as above it, except to the rasteriser, which must clip it.
    const bool stands = s.z_low > -kCoplanar;
    const bool along_x = stands & (((s.zx_high < 0) & (s.xy_low > 0) & (s.xpy_low > 0)) |
                                   ((s.zpx_high < 0) & (s.xpy_high < 0) & (s.xy_high < 0)));
    const bool along_y = stands & (((s.zy_high < 0) & (s.xy_high < 0) & (s.xpy_low > 0)) |
                                   ((s.zpy_high < 0) & (s.xpy_high < 0) & (s.xy_low > 0)));
    // Corners on the one face that holds it, in pixels such that samples are whole numbers and what is truncated
    // positive (the cells of hemicube_weights.h).
    float column[3], row[3];
    float rounding = 0.0F;
    for (std::size_t c = 0; c < 3; ++c) {
      const float depth = larger(largest(z[c], std::abs(x[c]), std::abs(y[c])), 1e-20F);
      const float across = along_x ? y[c] : x[c];
      const float up = top_in ? y[c] + depth : z[c];
      const float scale = view.half / depth;
      column[c] = (across + depth) * scale + (view.shift_x + 1.5F);
      row[c] = larger(up, 0.0F) * scale + (view.shift_y + 1.5F);
      rounding = larger(rounding, kCoplanar * scale);
    }
    const bool on_one_face = (top_in | along_x | along_y) & (rounding < 0.25F * kSampleMargin);
    const bool no_sample = on_one_face & showsNoSample(column, row);
    const bool back = from.plane[0][i] * o.x + from.plane[1][i] * o.y + from.plane[2][i] * o.z < from.plane[3][i];
    seen[i] = faces | bit(back, kBackBit) | bit(top_in, kInsideBit) | bit(px_in, kInsideBit + 1) |
              bit(mx_in, kInsideBit + 2) | bit(py_in, kInsideBit + 3) | bit(my_in, kInsideBit + 4) |
              bit(from.area[i] > kLargeSteradian * nearest, kLargeBit) | bit(no_sample, kBetweenBit);
  }
}

/// Takes from all faces what lies wholly outside one plane of a window.
RADIOSITY_CLONES void cutAway(const glm::vec3& o, const ViewWindow& window, const Triangles& from, std::size_t first,
                              std::size_t end, std::uint32_t* __restrict seen) {
  const auto planes = window.planes;
  for (std::size_t i = first; i < end; ++i) {
    bool out = false;
    for (std::size_t k = 0; k < 4; ++k) {
      float h[3];
      for (std::size_t c = 0; c < 3; ++c) {
        h[c] = (from.corner[c][0][i] - o.x) * planes[k].x + (from.corner[c][1][i] - o.y) * planes[k].y +
               (from.corner[c][2][i] - o.z) * planes[k].z;
      }
      out |= largest(h[0], h[1], h[2]) < -kWindowMargin;
    }
    seen[i] &= ~(out ? kFaces : 0U);
  }
}

/// Faces of which some pixel may lie in a window. Of what crosses a window, the rest of the hemicube is not looked at.
std::uint32_t facesInside(const HemicubeAxes& axes, const ViewWindow& window) {
  const auto [o, t, b, n] = axes;
  const std::array<std::array<glm::vec3, 4>, RAD_FACES> corners = {{{n + t + b, n + t - b, n - t + b, n - t - b},
                                                                    {t + b, t - b, t + b + n, t - b + n},
                                                                    {-t + b, -t - b, -t + b + n, -t - b + n},
                                                                    {b + t, b - t, b + t + n, b - t + n},
                                                                    {-b + t, -b - t, -b + t + n, -b - t + n}}};
  std::uint32_t faces = 0;
  for (int face = 0; face < RAD_FACES; ++face) {
    const auto& corner = corners[static_cast<std::size_t>(face)];
    const bool out = std::ranges::any_of(window.planes, [&](const glm::vec3& plane) {
      return std::ranges::all_of(corner, [&](const glm::vec3& c) { return glm::dot(plane, c) < -kWindowMargin; });
    });
    faces |= bit(!out, face);
  }
  return faces;
}

/// As classify() finds them of triangles, of a box.
Spans spansOf(const HemicubeAxes& axes, const TriangleClusters::Cluster& cluster) {
  const auto centre = cluster.centre - axes.origin;
  const auto place = [&](const glm::vec3& along, float& low, float& high) {
    const float middle = glm::dot(centre, along), reach = glm::dot(cluster.extent, glm::abs(along));
    // Room for rounding, or a box could be out whose triangles are not.
    const float slack = 1e-6F;
    low = middle - reach - slack;
    high = middle + reach + slack;
  };
  Spans s{};
  place(axes.normal - axes.tangent, s.zx_low, s.zx_high);
  place(axes.normal + axes.tangent, s.zpx_low, s.zpx_high);
  place(axes.normal - axes.bitangent, s.zy_low, s.zy_high);
  place(axes.normal + axes.bitangent, s.zpy_low, s.zpy_high);
  place(axes.tangent - axes.bitangent, s.xy_low, s.xy_high);
  place(axes.tangent + axes.bitangent, s.xpy_low, s.xpy_high);
  place(axes.normal, s.z_low, s.z_high);
  return s;
}

}  // namespace

TriangleCuller::TriangleCuller(const scene::PatchScene& patches, const Culling& culling)
    : culling_(culling),
      clusters_(makeClusters(patches, kClusterTriangles)),
      solids_(patches.solids),
      outside_(solids_.bounds.size()) {
  const std::size_t count = clusters_.order.size();
  solids_.solid_of.resize(count, scene::kNone);
  culling_.hidden = culling.hidden && count >= kManyTriangles;
  for (auto& part : plane_) part.resize(count);
  for (auto& corner : corner_) {
    for (auto& axis : corner) axis.resize(count);
  }
  area_.resize(count);
  solid_.resize(count);
  indices_.resize(3 * count);
  seen_.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t triangle = clusters_.order[i];
    std::array<glm::vec3, 3> at;
    for (std::size_t c = 0; c < 3; ++c) {
      const auto index = indices_[3 * i + c] = patches.indices[3 * triangle + c];
      at[c] = patches.vertices[index].position;
      for (int axis = 0; axis < 3; ++axis) corner_[c][static_cast<std::size_t>(axis)][i] = at[c][axis];
    }
    const auto& first = patches.vertices[indices_[3 * i]];
    for (int axis = 0; axis < 3; ++axis) plane_[static_cast<std::size_t>(axis)][i] = first.normal[axis];
    plane_[3][i] = glm::dot(first.normal, first.position);
    area_[i] = 0.5F * glm::length(glm::cross(at[1] - at[0], at[2] - at[0]));
    solid_[i] = solids_.solid_of[triangle];
  }
}

void TriangleCuller::select(const solver::HemicubeFrame& frame, std::uint32_t resolution, Selection& selection,
                            const ViewWindow* window) {
  for (auto* lists : {&selection.first, &selection.second}) {
    for (auto& list : *lists) list.count = 0, list.runs.clear();
  }
  selection.between = 0;
  const auto view = viewOf(frame, resolution);
  const auto& axes = view.axes;
  for (std::size_t i = 0; i < outside_.size(); ++i) {
    const auto& [low, high] = solids_.bounds[i];
    outside_[i] =
        static_cast<std::uint8_t>(culling_.backs && (glm::any(glm::lessThan(axes.origin, low - kOutside)) ||
                                                     glm::any(glm::greaterThan(axes.origin, high + kOutside))));
  }
  Triangles from{};
  for (std::size_t c = 0; c < 3; ++c) {
    for (std::size_t axis = 0; axis < 3; ++axis) from.corner[c][axis] = corner_[c][axis].data();
  }
  for (std::size_t part = 0; part < 4; ++part) from.plane[part] = plane_[part].data();
  from.area = area_.data();
  const std::uint32_t of_interest = window != nullptr ? facesInside(axes, *window) : kFaces;
  for (std::uint32_t number = 0; number < clusters_.clusters.size(); ++number) {
    const auto& cluster = clusters_.clusters[number];
    const std::uint32_t faces = of_interest & (culling_.faces ? facesOf(spansOf(axes, cluster)) : kFaces);
    if (faces == 0) continue;
    if (window != nullptr && window->excludes(cluster.centre - axes.origin, cluster.extent + kWindowMargin)) continue;
    classify(view, from, cluster.first, cluster.first + cluster.count, seen_.data());
    if (window != nullptr)
      cutAway(axes.origin, *window, from, cluster.first, cluster.first + cluster.count, seen_.data());
    const auto away = glm::max(glm::abs(axes.origin - cluster.centre) - cluster.extent, glm::vec3(0.0F));
    const bool near = !culling_.hidden || glm::dot(away, away) < glm::dot(cluster.extent, cluster.extent);
    emit(cluster, number, faces, near, selection);
  }
}

/// Triangles of one cluster, face by face, to the lists.
void TriangleCuller::emit(const TriangleClusters::Cluster& cluster, std::uint32_t number, std::uint32_t faces,
                          bool near, Selection& selection) {
  for (auto* lists : {&selection.first, &selection.second}) {  // room for all, so that the loop below need not look
    for (auto& list : *lists) {
      const std::size_t most = list.count + 3 * std::size_t{cluster.count};
      if (list.indices.size() < most) list.indices.resize(2 * most);
    }
  }
  for (std::size_t i = cluster.first; i < cluster.first + cluster.count; ++i) {
    const auto seen = seen_[i];
    if ((seen >> kBackBit & 1U) != 0 && solid_[i] != scene::kNone && outside_[solid_[i]] != 0) continue;
    auto in = culling_.faces ? seen & faces : faces;
    if (culling_.samples && (seen >> kBetweenBit & 1U) != 0) {
      selection.between += static_cast<std::uint32_t>(std::popcount(in));
      continue;
    }
    auto& lists = near || (seen >> kLargeBit & 1U) != 0 ? selection.first : selection.second;
    for (; in != 0; in &= in - 1) {
      const auto face = static_cast<unsigned>(std::countr_zero(in));
      auto& list = lists[2 * face + 1 - (seen >> (kInsideBit + face) & 1U)];
      for (std::size_t c = 0; c < 3; ++c) list.indices[list.count + c] = indices_[3 * i + c];
      list.count += 3;
    }
  }
  if (near) return;
  for (auto& list : selection.second) {
    if (list.count > (list.runs.empty() ? 0 : list.runs.back().end)) list.runs.push_back({number, list.count});
  }
}

}  // namespace radiosity::gpu
