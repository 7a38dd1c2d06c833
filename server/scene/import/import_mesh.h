// Meshes to triangle lists. Owned by one importScene call.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/scene/import/import_context.h"
#include "server/scene/import/import_pose.h"

namespace radiosity::scene {

class MeshImporter {
 public:
  explicit MeshImporter(ImportContext& context) : context_(context), poses_(context) {}

  struct Posed {
    std::uint32_t primitive;  ///< index into Scene::primitives
    glm::dmat4 world;         ///< the node's, unless a skin places the vertices
  };
  /// The primitives of a node's mesh that have triangles, as the node poses them; imported on first use. Nodes that
  /// pose a mesh alike share them. `world` is the node's, `pointer` names it. Skins are left aside where `skinned` is
  /// false.
  [[nodiscard]] Result<std::vector<Posed>> primitivesOf(const tinygltf::Node& node, const glm::dmat4& world,
                                                        const std::string& pointer, bool skinned);

 private:
  struct Imported {
    std::uint32_t primitive;
    bool skinned;  ///< its vertices are where the joints put them
  };
  [[nodiscard]] Result<std::optional<Imported>> importPrimitive(std::size_t mesh, std::size_t index, const Pose& pose);
  [[nodiscard]] Result<void> readVertices(const tinygltf::Primitive& source, Primitive& primitive,
                                          const std::string& pointer);
  [[nodiscard]] Result<void> readNormals(const tinygltf::Primitive& source, Primitive& primitive);
  [[nodiscard]] Result<void> readTriangles(const tinygltf::Primitive& source, Primitive& primitive,
                                           const std::string& pointer);
  [[nodiscard]] std::uint32_t materialOf(const tinygltf::Primitive& source);

  ImportContext& context_;
  PoseImporter poses_;
  std::map<std::pair<int, Pose>, std::vector<Imported>> done_;  ///< by mesh, and how it is posed
  std::size_t vertices_ = 0;
  std::uint32_t default_material_ = kNone;
};

}  // namespace radiosity::scene
