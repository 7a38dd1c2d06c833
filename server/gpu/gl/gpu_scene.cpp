#include "server/gpu/gl/gpu_scene.h"

#include <algorithm>
#include <array>
#include <glm/vec4.hpp>
#include <vector>

#include "common/check.h"
#include "server/gpu/gl/shader_constants.h"

namespace radiosity::gpu {
namespace {

struct Vertex {
  glm::vec4 position_area;
  glm::vec3 normal;
  glm::vec2 texel;
  std::array<std::uint32_t, 4> nodes;  // front, back, level table, triangle
  std::uint32_t surface;
};

struct LevelEntry {
  std::uint32_t offset, size;  // size: width | height << 16
};

/// The level table of all surfaces; table[s] is what the shaders take as a reference to surface s's levels.
Result<std::vector<LevelEntry>> makeLevels(const scene::PatchScene& patches, std::vector<std::uint32_t>& table) {
  std::vector<LevelEntry> levels{{0, 1U | 1U << 16U}};
  for (const auto& surface : patches.surfaces) {
    if (surface.width > 0xFFFF || surface.height > 0xFFFF || surface.level_count > RAD_LEVEL_MASK ||
        levels.size() >= std::size_t{1} << (32U - RAD_LEVEL_BITS)) {
      return fail(ErrorCode::kTooLarge, "a chart is larger than 65535 texels, or there are too many charts");
    }
    table.push_back(static_cast<std::uint32_t>(levels.size()) << RAD_LEVEL_BITS | surface.level_count);
    for (std::uint32_t level = 0; level < surface.level_count; ++level) {
      const auto grid = scene::levelGrid(surface.width, surface.height, level);
      levels.push_back({grid.offset, grid.width | grid.height << 16U});
    }
  }
  return levels;
}

}  // namespace

Result<GpuScene> GpuScene::upload(const EglContext& context, std::shared_ptr<const scene::PatchScene> patches) {
  GpuScene gpu;
  gpu.patches_ = std::move(patches);
  const auto& scene = *gpu.patches_;
  if (scene.nodeCount() >= scene::kNone - 2) return fail(ErrorCode::kTooLarge, "more than 2^32 - 3 nodes");
  std::vector<std::uint32_t> table;
  const auto levels = makeLevels(scene, table);
  if (!levels) return tl::unexpected(levels.error());

  std::vector<Vertex> vertices(scene.vertices.size());
  const auto side = [&](std::uint32_t first) { return first == scene::kNone ? gpu.absorbedId() : first; };
  for (std::size_t i = 0; i < vertices.size(); ++i) {
    const auto& from = scene.vertices[i];
    const auto& surface = scene.surfaces[from.surface];
    vertices[i] = {{from.position, surface.texel_area},
                   from.normal,
                   from.texel,
                   {side(surface.first_node[0]), side(surface.first_node[1]), table[from.surface], 0},
                   from.surface};
  }
  // Corners are shared only within a plane, so any triangle of a vertex stands for the plane in an item buffer.
  for (std::size_t i = 0; i < scene.indices.size(); ++i) {
    vertices[scene.indices[i]].nodes[3] = static_cast<std::uint32_t>(i / 3);
  }

  gpu.vertices_ = Buffer(context, "scene vertices");
  fill(gpu.vertices_, std::span<const Vertex>(vertices), GL_STATIC_DRAW);
  gpu.levels_ = Buffer(context, "level table");
  fill(gpu.levels_, std::span<const LevelEntry>(*levels), GL_STATIC_DRAW);
  if (gpu.seeThrough()) {
    if (auto done = gpu.uploadOpacity(context); !done) return tl::unexpected(done.error());
  }
  gpu.vertex_array_ = VertexArray(context, "scene");

  const auto array = gpu.vertex_array_.name();
  glVertexArrayVertexBuffer(array, 0, gpu.vertices_.name(), 0, sizeof(Vertex));
  const auto attribute = [&](GLuint index, GLint size, std::size_t offset) {
    glEnableVertexArrayAttrib(array, index);
    glVertexArrayAttribFormat(array, index, size, GL_FLOAT, GL_FALSE, static_cast<GLuint>(offset));
    glVertexArrayAttribBinding(array, index, 0);
  };
  attribute(RAD_ATTRIBUTE_POSITION, 4, offsetof(Vertex, position_area));
  attribute(RAD_ATTRIBUTE_NORMAL, 3, offsetof(Vertex, normal));
  attribute(RAD_ATTRIBUTE_TEXEL, 2, offsetof(Vertex, texel));
  glEnableVertexArrayAttrib(array, RAD_ATTRIBUTE_NODES);
  glVertexArrayAttribIFormat(array, RAD_ATTRIBUTE_NODES, 4, GL_UNSIGNED_INT, offsetof(Vertex, nodes));
  glVertexArrayAttribBinding(array, RAD_ATTRIBUTE_NODES, 0);
  glEnableVertexArrayAttrib(array, RAD_ATTRIBUTE_SURFACE);
  glVertexArrayAttribIFormat(array, RAD_ATTRIBUTE_SURFACE, 1, GL_UNSIGNED_INT, offsetof(Vertex, surface));
  glVertexArrayAttribBinding(array, RAD_ATTRIBUTE_SURFACE, 0);
  for (GLuint i = 0; i < 5; ++i) {  // binding 1: the renderer's FaceViews
    attribute(RAD_ATTRIBUTE_VIEW + i, 4, i * sizeof(glm::vec4));
    glVertexArrayAttribBinding(array, RAD_ATTRIBUTE_VIEW + i, 1);
  }
  glVertexArrayBindingDivisor(array, 1, 1);
  return gpu;
}

Result<void> GpuScene::uploadOpacity(const EglContext& context) {
  const auto& scene = *patches_;
  std::vector<std::array<std::uint32_t, 4>> grids;
  for (const auto& surface : scene.surfaces) {
    const auto scale = surface.opacity_scale;
    const auto facing = static_cast<std::uint32_t>(std::lround(surface.glass.facing * 65535.0F));
    const std::uint32_t looks = scale | facing << 16U;
    grids.push_back(
        {surface.first_opacity, surface.width * scale, surface.height * scale, surface.see_through ? looks : 0});
  }
  auto cells = scene.opacity;
  cells.resize((cells.size() + 3) / 4 * 4, 255);
  GLint64 most = 0;
  glGetInteger64v(GL_MAX_SHADER_STORAGE_BLOCK_SIZE, &most);
  if (static_cast<GLint64>(std::max(cells.size(), grids.size() * sizeof(grids[0]))) > most) {
    return fail(ErrorCode::kTooLarge, "the opacity of surfaces does not fit the graphics memory; ask for fewer texels");
  }
  opacity_grids_ = Buffer(context, "opacity grids");
  fill(opacity_grids_, std::span<const std::array<std::uint32_t, 4>>(grids), GL_STATIC_DRAW);
  opacity_ = Buffer(context, "opacity");
  fill(opacity_, std::span<const std::uint8_t>(cells), GL_STATIC_DRAW);
  return {};
}

void GpuScene::bindOpacity() const {
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, RAD_BINDING_OPACITY_GRIDS, opacity_grids_.name());
  glBindBufferBase(GL_SHADER_STORAGE_BUFFER, RAD_BINDING_OPACITY, opacity_.name());
}

void GpuScene::bindLevels() const { glBindBufferBase(GL_SHADER_STORAGE_BUFFER, RAD_BINDING_LEVELS, levels_.name()); }

}  // namespace radiosity::gpu
