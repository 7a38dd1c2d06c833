// Rest poses: morph targets and skins as a file states them, with animations unplayed. Owned by one importScene call.
#pragma once

#include <cstdint>
#include <glm/mat4x4.hpp>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "server/scene/import/import_context.h"

namespace radiosity::scene {

/// What a node makes of its mesh's vertices.
struct Pose {
  /// By morph target, without zeros at its end; none: those of the mesh.
  std::optional<std::vector<double>> weights;
  int skin = -1;  ///< -1: none
  /// The transform of a skinned mesh's own node does nothing but this: it decides which side of a triangle is its
  /// front. The vertices are then mirrored, too, and the instance mirrors them back.
  bool mirrored = false;

  auto operator<=>(const Pose&) const = default;
};

class PoseImporter {
 public:
  explicit PoseImporter(ImportContext& context) : context_(context), targets_(context.model.meshes.size()) {}

  /// The weights of the node, else of its mesh; `world` is the node's.
  [[nodiscard]] Pose poseOf(const tinygltf::Node& node, const glm::dmat4& world, const std::string& pointer);

  /// Moves the positions and normals of a primitive as it was read. Returns whether they are the world's now, and not
  /// the mesh's: whether a skin was applied.
  [[nodiscard]] Result<bool> apply(const Pose& pose, const tinygltf::Primitive& source, const std::string& pointer,
                                   Primitive& primitive);

 private:
  struct Targets {
    std::size_t count = 0;        ///< of the mesh's primitive that has most
    std::vector<double> weights;  ///< of the mesh, without zeros at its end
  };
  [[nodiscard]] const Targets& targetsOf(std::size_t mesh);
  [[nodiscard]] std::vector<double> fitted(const std::vector<double>& weights, std::size_t count,
                                           const std::string& pointer);
  [[nodiscard]] Result<void> morph(const std::vector<double>& weights, const tinygltf::Primitive& source,
                                   const std::string& pointer, Primitive& primitive);
  [[nodiscard]] Result<void> addTarget(std::size_t accessor, double weight, const std::string& pointer,
                                       Primitive& primitive, bool normals);
  [[nodiscard]] Result<const std::vector<glm::dmat4>*> jointMatrices(std::size_t skin);
  [[nodiscard]] Result<void> checkReach(const std::vector<glm::dvec3>& before, const Primitive& primitive,
                                        const std::string& pointer) const;

  ImportContext& context_;
  std::vector<std::optional<Targets>> targets_;            ///< by mesh
  std::map<std::size_t, std::vector<glm::dmat4>> joints_;  ///< by skin: what each joint makes of a vertex
  std::vector<glm::dmat4> worlds_;                         ///< by node, once a skin needed them
  std::size_t moved_ = 0;                                  ///< vertices, by all targets
};

}  // namespace radiosity::scene
