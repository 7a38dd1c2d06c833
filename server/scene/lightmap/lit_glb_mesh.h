// One mesh of the file with lightmap UVs for one placed instance. Used by the exporters; lives for one call.
#pragma once

#include <cstdint>
#include <map>
#include <vector>

#include "server/scene/document/json_text.h"
#include "server/scene/import/import_model.h"
#include "server/scene/lightmap/lit_glb_made.h"
#include "server/scene/shading/emitters.h"
#include "server/scene/values/patch_scene.h"

namespace radiosity::scene {

/// A primitive as imported and where both sides of its triangles lie in the lightmap.
struct LitPrimitive {
  const Primitive* primitive = nullptr;
  const CutPrimitive* cut = nullptr;  ///< null: it is whole
  const PatchScene::InstanceUv* uv = nullptr;
  const DarkOfEmitters* dark = nullptr;
  std::size_t instance = 0;

  /// Such triangles are marked with "lightmapEmits": false.
  [[nodiscard]] bool isDark(std::size_t triangle) const { return dark->has(instance, triangle); }
};

/// Appends accessors, buffer views and bytes to `gltf`; the bytes become buffer `buffer`.
class LitMeshBuilder {
 public:
  LitMeshBuilder(const Document& document, const tinygltf::Model& model, Json& gltf, std::size_t buffer)
      : document_(document), model_(model), gltf_(gltf), buffer_(buffer) {}

  /// `mesh` with each primitive in `lit` (by index in the file's mesh) turned into one triangle list a side and page,
  /// or two where some of it is dark, vertices split where lightmap UVs differ, all other attributes copied byte by
  /// byte; backs are turned around, with their normals and tangents negated. kTooLarge past 1 GiB of new data, or 64
  /// MiB of JSON that is there again. `again`: the mesh was built before; what is the file's own alone (`extras`, which
  /// may be as large as the file) stays with the first.
  [[nodiscard]] Result<Json> build(const Json& mesh, const std::map<std::uint32_t, LitPrimitive>& lit, bool again);
  /// Counts JSON that is there again. False: it is too much.
  [[nodiscard]] bool takeJson(std::size_t bytes) { return (json_bytes_ += bytes) <= kMaxJsonAgain; }
  [[nodiscard]] tl::unexpected<Error> tooMuchJson() const;

  [[nodiscard]] Bytes takeBytes() { return std::move(bytes_); }

 private:
  /// One mesh may stand in a scene a million times.
  static constexpr std::size_t kMaxJsonAgain = std::size_t{64} << 20;
  struct Vertices {
    std::vector<std::uint32_t> source;   ///< vertex of the primitive, as cut
    std::vector<glm::vec2> uv;           ///< lightmap
    std::vector<std::uint32_t> indices;  ///< 3 a triangle
  };

  /// One page of one side of a primitive: 0 front, 1 back.
  struct Part {
    std::size_t side;
    std::uint32_t page;
    bool dark;  ///< LitPrimitive::isDark()

    auto operator<=>(const Part&) const = default;
  };
  struct Copy {
    bool with_bounds = false;  ///< POSITION wants them
    bool negated = false;
    MadeHow made = MadeHow::kBetween;
  };
  /// Vertices of the file's primitive, and of its cut copy, if it has one, those that are made.
  struct Elements {
    const std::vector<std::uint32_t>& vertices;
    const CutPrimitive* cut;
  };

  static std::vector<Part> partsOf(const LitPrimitive& lit);
  static Vertices collect(const LitPrimitive& lit, const Part& part);
  [[nodiscard]] Result<Json> partPrimitive(const Json& source, const LitPrimitive& lit, const Part& part);
  [[nodiscard]] Result<std::size_t> copyAccessor(std::size_t accessor, const Elements& elements, const Copy& how);
  [[nodiscard]] Result<void> checkRoom(std::size_t more) const;
  [[nodiscard]] Result<Json> copyAttributes(const Json& attributes, const Elements& elements, bool turned);
  [[nodiscard]] std::size_t addView(std::size_t first_byte, std::size_t stride);
  [[nodiscard]] std::size_t addAccessor(Json accessor);
  [[nodiscard]] std::size_t addIndices(const std::vector<std::uint32_t>& indices);
  [[nodiscard]] std::size_t addUvs(const std::vector<glm::vec2>& uvs);
  void append(const void* data, std::size_t size);

  const Document& document_;
  const tinygltf::Model& model_;
  Json& gltf_;
  std::size_t buffer_;
  std::size_t json_bytes_ = 0;
  Bytes bytes_;
};

}  // namespace radiosity::scene
