#include "server/gpu/cull/parallel_culler.h"

#include "common/clones.h"

namespace radiosity::gpu {
namespace {

/// As in triangle_culler.cpp: rasterisers may move corners a little.
constexpr float kSampleMargin = 0.0625F;
/// Backs seen from the side are left to the rasteriser.
constexpr float kEdgeOn = 1e-5F;

// By value, so that the loop below vectorises.
inline float smallest(float a, float b, float c) {
  const float ab = a < b ? a : b;
  return ab < c ? ab : c;
}
inline float largest(float a, float b, float c) {
  const float ab = a > b ? a : b;
  return ab > c ? ab : c;
}

struct Triangles {
  std::array<std::array<const float*, 3>, 3> corner;
  std::array<const float*, 3> solid_normal;
};

RADIOSITY_CLONES void classify(const ParallelAxes& axes, const glm::vec3& direction, const Triangles& from,
                               std::size_t count, std::uint32_t* __restrict skipped) {
  const auto [centre, right, up, shift, area] = axes;
  // Samples lie half-way between whole numbers; the sum keeps what is truncated positive.
  const float first_column = shift.x + 1.5F, first_row = shift.y + 1.5F;
  for (std::size_t i = 0; i < count; ++i) {
    float column[3], row[3];
    for (std::size_t c = 0; c < 3; ++c) {
      const float dx = from.corner[c][0][i] - centre.x;
      const float dy = from.corner[c][1][i] - centre.y;
      const float dz = from.corner[c][2][i] - centre.z;
      column[c] = dx * right.x + dy * right.y + dz * right.z + first_column;
      row[c] = dx * up.x + dy * up.y + dz * up.z + first_row;
    }
    const bool no_column = static_cast<int>(smallest(column[0], column[1], column[2]) - kSampleMargin) ==
                           static_cast<int>(largest(column[0], column[1], column[2]) + kSampleMargin);
    const bool no_row = static_cast<int>(smallest(row[0], row[1], row[2]) - kSampleMargin) ==
                        static_cast<int>(largest(row[0], row[1], row[2]) + kSampleMargin);
    const float facing = from.solid_normal[0][i] * direction.x + from.solid_normal[1][i] * direction.y +
                         from.solid_normal[2][i] * direction.z;
    skipped[i] = static_cast<std::uint32_t>(no_column | no_row | (facing < -kEdgeOn));
  }
}

}  // namespace

ParallelCuller::ParallelCuller(const scene::PatchScene& patches) : indices_(patches.indices) {
  const std::size_t count = indices_.size() / 3;
  const auto& solid_of = patches.solids.solid_of;
  skipped_.resize(count);
  for (auto& part : solid_normal_) part.resize(count);
  for (auto& corner : corner_) {
    for (auto& axis : corner) axis.resize(count);
  }
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const auto a = static_cast<int>(axis);
      for (std::size_t c = 0; c < 3; ++c) corner_[c][axis][i] = patches.vertices[indices_[3 * i + c]].position[a];
      const bool solid = i < solid_of.size() && solid_of[i] != scene::kNone;
      solid_normal_[axis][i] = solid ? patches.vertices[indices_[3 * i]].normal[a] : 0.0F;
    }
  }
}

void ParallelCuller::select(const ParallelAxes& axes, const glm::vec3& direction, std::vector<std::uint32_t>& indices) {
  Triangles from{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    for (std::size_t c = 0; c < 3; ++c) from.corner[c][axis] = corner_[c][axis].data();
    from.solid_normal[axis] = solid_normal_[axis].data();
  }
  classify(axes, direction, from, skipped_.size(), skipped_.data());
  for (std::size_t i = 0; i < skipped_.size(); ++i) {
    if (skipped_[i] != 0) continue;
    const std::uint32_t* corners = &indices_[3 * i];
    indices.insert(indices.end(), {corners[0], corners[1], corners[2]});
  }
}

}  // namespace radiosity::gpu
