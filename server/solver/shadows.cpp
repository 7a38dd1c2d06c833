#include "server/solver/shadows.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

namespace radiosity::solver {
namespace {

/// What lies this little (unit box) before a plane may be rounding: it is seen from there.
constexpr float kInFront = -5e-7F;
/// A leaf of a curved surface may reach so much farther than the frame of one of its triangles tells.
constexpr float kCurved = 2.0F;
/// So many leaves in a row are looked at as one first.
constexpr std::uint32_t kChunkLeaves = 64;
/// Half a pixel's diagonal, in widths of a pixel, and room for rounding.
constexpr float kHalfDiagonal = 0.7072F;

constexpr float kMissed = -1.0F;
/// Slopes this small do not leave where they are.
constexpr float kLevel = 1e-20F;

scene::ChangedBox nothing() { return {glm::vec3(1e30F), glm::vec3(-1e30F)}; }

void include(scene::ChangedBox& box, const glm::vec3& centre, float radius) {
  box.low = glm::min(box.low, centre - radius);
  box.high = glm::max(box.high, centre + radius);
}

inline float smaller(float a, float b) { return a < b ? a : b; }
inline float larger(float a, float b) { return a > b ? a : b; }

/// The part of [0, 1] where slope t >= least.
struct Clip {
  float first, last;
};
inline Clip clip(float slope, float least) {
  const bool rises = slope > -kLevel;
  const float t = least / (rises ? larger(slope, kLevel) : slope);
  return {rises ? larger(t, 0.0F) : 0.0F, rises ? 1.0F : smaller(t, 1.0F)};
}

}  // namespace

void Shadows::Balls::add(const glm::vec3& centre, float r) {
  x.push_back(centre.x);
  y.push_back(centre.y);
  z.push_back(centre.z);
  radius.push_back(r);
}

Shadows::Shadows(const scene::PatchScene& patches, const std::vector<Side>& sides, GeometryChange change)
    : patches_(patches), sides_(sides), change_(std::move(change)), all_(change_.boxes) {
  for (std::uint32_t s = 0; s < sides_.size(); ++s) {
    addLeaves(sides_[s]);
    addChunks(s);
  }
  auto altered = nothing();
  for (std::size_t v = 0; v < change_.altered.size(); ++v) {
    if (change_.altered[v] && leaves_.radius[v] >= 0.0F) include(altered, leaves_.centre(v), leaves_.radius[v]);
  }
  if (altered.low.x <= altered.high.x) all_.push_back(altered);
}

void Shadows::addLeaves(const Side& side) {
  const auto& surface = patches_.surfaces[side.surface];
  for (std::uint32_t leaf = 0; leaf < side.leaf_count; ++leaf) {
    const auto triangle = patches_.leaves[surface.first_leaf + leaf].triangle;
    if (triangle == scene::kNone) {
      leaves_.add(glm::vec3(0.0F), -1.0F);
      continue;
    }
    const auto& frame = patches_.triangles[triangle];
    const float x = static_cast<float>(leaf % side.width) + 0.5F, y = static_cast<float>(leaf / side.width) + 0.5F;
    leaves_.add(frame.origin + x * frame.du + y * frame.dv,
                (surface.planar ? 0.5F : 0.5F * kCurved) * (glm::length(frame.du) + glm::length(frame.dv)));
  }
}

void Shadows::addChunks(std::uint32_t s) {
  const Side& side = sides_[s];
  for (std::uint32_t begin = 0; begin < side.leaf_count; begin += kChunkLeaves) {
    Chunk chunk{side.first_value + begin, std::min(kChunkLeaves, side.leaf_count - begin), false};
    auto box = nothing();
    for (auto v = chunk.first; v < chunk.first + chunk.count; ++v) {
      chunk.altered = chunk.altered || change_.altered[v];
      if (leaves_.radius[v] >= 0.0F) include(box, leaves_.centre(v), leaves_.radius[v]);
    }
    chunks_.push_back(chunk);
    const bool empty = box.low.x > box.high.x;
    chunk_balls_.add(empty ? glm::vec3(0.0F) : 0.5F * (box.low + box.high),
                     empty ? -1.0F : 0.5F * glm::distance(box.low, box.high));
  }
}

bool Shadows::sees(const glm::vec3& point, const glm::vec3& normal) const {
  return std::ranges::any_of(all_, [&](const scene::ChangedBox& box) {
    const glm::vec3 farthest(normal.x > 0.0F ? box.high.x : box.low.x, normal.y > 0.0F ? box.high.y : box.low.y,
                             normal.z > 0.0F ? box.high.z : box.low.z);
    return glm::dot(normal, farthest - point) > kInFront;
  });
}

/// Raises the marks of balls that the way meets and that reach before the plane to 0 or more: segments and boxes (Kay
/// and Kajiya 1986). Marks are numbers, and nothing is decided but by smaller and larger, since GCC 12 vectorises
/// neither branches nor flags here. Both clones give the same marks.
__attribute__((target_clones("avx2", "default"))) void Shadows::markMet(const Way& way, const glm::vec4& plane,
                                                                        const Balls& balls, std::size_t begin,
                                                                        std::size_t end, float* marks) {
  const float ox = way.from.x, oy = way.from.y, oz = way.from.z;
  const float lx = way.low.x, ly = way.low.y, lz = way.low.z, hx = way.high.x, hy = way.high.y, hz = way.high.z;
  const float nx = plane.x, ny = plane.y, nz = plane.z, nd = plane.w;
  const float spread = way.spread;
  const float *x = balls.x.data() + begin, *y = balls.y.data() + begin, *z = balls.z.data() + begin;
  const float* radius = balls.radius.data() + begin;
  float* __restrict mark = marks;
  const std::size_t count = end - begin;
  for (std::size_t i = 0; i < count; ++i) {
    const float r = radius[i];
    const float dx = x[i] - ox, dy = y[i] - oy, dz = z[i] - oz;
    const float s = spread * std::sqrt(dx * dx + dy * dy + dz * dz);
    // At part t of the way one is past the low face where t (d + s) >= low - r - o, and so on.
    const Clip a = clip(dx + s, lx - r - ox), b = clip(s - dx, ox - hx - r), c = clip(dy + s, ly - r - oy);
    const Clip d = clip(s - dy, oy - hy - r), e = clip(dz + s, lz - r - oz), f = clip(s - dz, oz - hz - r);
    const float first = larger(larger(larger(a.first, b.first), larger(c.first, d.first)), larger(e.first, f.first));
    const float last = smaller(smaller(smaller(a.last, b.last), smaller(c.last, d.last)), smaller(e.last, f.last));
    const float height = nx * x[i] + ny * y[i] + nz * z[i] - nd;
    mark[i] = larger(mark[i], smaller(smaller(last - first, r), height + r));
  }
}

void Shadows::find(std::span<const glm::vec3> points, const glm::vec3& normal, float radius, std::uint32_t resolution,
                   Scratch& scratch, std::vector<LinkColumn::ValueRun>& runs) const {
  std::vector<Way> ways;
  for (const auto& point : points) {
    for (const auto& box : change_.boxes) {
      // A pixel is 2 / N wide at a depth of one; depths are at most distances.
      ways.push_back(
          {point, box.low - radius, box.high + radius, 2.0F * kHalfDiagonal / static_cast<float>(resolution)});
    }
  }
  const glm::vec4 plane(normal, glm::dot(normal, points.front()));
  scratch.chunks.assign(chunks_.size(), kMissed);
  for (const auto& way : ways) markMet(way, plane, chunk_balls_, 0, chunks_.size(), scratch.chunks.data());
  runs.clear();
  for (std::size_t c = 0; c < chunks_.size(); ++c) {
    const auto& chunk = chunks_[c];
    if (scratch.chunks[c] < 0.0F && !chunk.altered) continue;
    scratch.leaves.assign(chunk.count, kMissed);
    for (const auto& way : ways)
      markMet(way, plane, leaves_, chunk.first, chunk.first + chunk.count, scratch.leaves.data());
    for (std::uint32_t i = 0; i < chunk.count; ++i) {
      if (scratch.leaves[i] < 0.0F && !(chunk.altered && change_.altered[chunk.first + i])) continue;
      const bool joins = i > 0 && !runs.empty() && runs.back().first + runs.back().count == chunk.first + i;
      if (!joins) runs.push_back({chunk.first + i, 0});
      ++runs.back().count;
    }
  }
}

}  // namespace radiosity::solver
