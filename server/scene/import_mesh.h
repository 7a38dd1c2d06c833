// Meshes to triangle lists. Owned by one importScene call.
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "server/scene/import_context.h"

namespace radiosity::scene {

class MeshImporter {
 public:
  explicit MeshImporter(ImportContext& context) : context_(context), done_(context.model.meshes.size()) {}

  /// Indices into Scene::primitives of the mesh's primitives that have triangles; imported on first use.
  [[nodiscard]] Result<const std::vector<std::uint32_t>*> primitivesOf(std::size_t mesh);

 private:
  [[nodiscard]] Result<std::optional<std::uint32_t>> importPrimitive(std::size_t mesh, std::size_t index);
  [[nodiscard]] Result<void> readVertices(const tinygltf::Primitive& source, Primitive& primitive,
                                          const std::string& pointer);
  [[nodiscard]] Result<void> readNormals(const tinygltf::Primitive& source, Primitive& primitive);
  [[nodiscard]] Result<void> readTriangles(const tinygltf::Primitive& source, Primitive& primitive,
                                           const std::string& pointer);
  [[nodiscard]] std::uint32_t materialOf(const tinygltf::Primitive& source);

  ImportContext& context_;
  std::vector<std::optional<std::vector<std::uint32_t>>> done_;
  std::size_t vertices_ = 0;
  std::uint32_t default_material_ = kNone;
};

}  // namespace radiosity::scene
