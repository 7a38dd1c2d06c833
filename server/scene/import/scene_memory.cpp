#include "server/scene/import/scene_memory.h"

#include <algorithm>
#include <set>
#include <tuple>
#include <utility>
#include <vector>

#include "server/scene/document/scene_limit.h"
#include "server/scene/import/import_context.h"

namespace radiosity::scene {
namespace {

/// A placed triangle as it is flattened, charted and held in trees; an instance, with its surface.
constexpr std::uint64_t kTriangleBytes = 900, kInstanceBytes = 1'000;
/// The same in each process that draws: of a triangle a fifth is what Embree makes of it, at its peak.
constexpr std::uint64_t kDrawnTriangleBytes = 850, kDrawnInstanceBytes = 300;
constexpr std::uint64_t kElementBytes = 240;  ///< of EXT_mesh_gpu_instancing: transform and instance
/// A vertex as it is read, with maps that find doubled triangles; its attributes; a corner of a triangle.
constexpr std::uint64_t kVertexBytes = 36, kCornerBytes = 40;

/// Never wraps round: claims are products of what a file says.
std::uint64_t times(std::uint64_t a, std::uint64_t b) {
  constexpr auto kMost = ~std::uint64_t{0} / 4;
  return b != 0 && a > kMost / b ? kMost : std::min(a * b, kMost);
}

struct MeshClaim {
  std::uint64_t vertex_bytes = 0, triangles = 0, primitives = 0;
};

class GeometryClaim {
 public:
  GeometryClaim(const Document& document, const tinygltf::Model& model, std::uint64_t claimed,
                const ImportLimits& limits)
      : document_(document),
        model_(model),
        limits_(limits),
        limit_(sceneMemoryLimit(limits)),
        bytes_(claimed),
        of_server_(claimed) {
    likely_ = likelySceneMemory(limits, bytesOfData(document));
    for (const auto& mesh : model.meshes) {
      MeshClaim claim;
      for (const auto& primitive : mesh.primitives) add(primitive, claim);
      meshes_.push_back(claim);
    }
  }

  Result<std::uint64_t> run() {
    std::vector<int> waiting = rootNodes();
    std::ranges::reverse(waiting);
    while (!waiting.empty()) {
      const auto node = static_cast<std::size_t>(waiting.back());
      waiting.pop_back();
      if (auto ok = addNode(node); !ok) return tl::unexpected(ok.error());
      const auto& children = model_.nodes[node].children;
      waiting.insert(waiting.end(), children.rbegin(), children.rend());
    }
    return bytes_;
  }

 private:
  void add(const tinygltf::Primitive& primitive, MeshClaim& claim) const {
    const auto position = primitive.attributes.find("POSITION");
    if (primitive.mode < TINYGLTF_MODE_TRIANGLES || position == primitive.attributes.end()) return;
    const std::uint64_t vertices = model_.accessors[static_cast<std::size_t>(position->second)].count;
    const std::uint64_t corners =
        primitive.indices < 0 ? vertices : model_.accessors[static_cast<std::size_t>(primitive.indices)].count;
    std::uint64_t each = kVertexBytes;
    for (const auto& [name, accessor] : primitive.attributes) {
      if (name.starts_with("TEXCOORD_")) each += sizeof(glm::vec2);
      if (name == "COLOR_0") each += sizeof(glm::vec4);
    }
    const bool is_list = primitive.mode == TINYGLTF_MODE_TRIANGLES;
    claim.vertex_bytes += times(vertices, each) + times(corners, is_list ? kCornerBytes : 3 * kCornerBytes);
    claim.triangles += is_list ? corners / 3 : corners;
    ++claim.primitives;
  }

  [[nodiscard]] std::vector<int> rootNodes() const {
    if (!model_.scenes.empty()) return model_.scenes[static_cast<std::size_t>(std::max(model_.defaultScene, 0))].nodes;
    std::vector<bool> has_parent(model_.nodes.size(), false);
    for (const auto& node : model_.nodes)
      for (const auto child : node.children) has_parent[static_cast<std::size_t>(child)] = true;
    std::vector<int> roots;
    for (std::size_t n = 0; n < has_parent.size(); ++n)
      if (!has_parent[n]) roots.push_back(static_cast<int>(n));
    return roots;
  }

  Result<void> addNode(std::size_t index) {
    const auto& node = model_.nodes[index];
    if (node.mesh < 0) return {};
    const auto& mesh = meshes_[static_cast<std::size_t>(node.mesh)];
    const auto pointer = "/nodes/" + std::to_string(index);
    if (poses_.emplace(node.mesh, node.skin, node.weights).second)
      if (auto ok = spend(mesh.vertex_bytes, "/meshes/" + std::to_string(node.mesh), "its vertices"); !ok) return ok;
    const auto* instancing = extensionOf(document_.gltf["nodes"][index], "EXT_mesh_gpu_instancing");
    if (instancing == nullptr) return place(1, mesh, pointer);
    for (const auto& [name, accessor] : (*instancing)["attributes"].items()) {
      if (name != "TRANSLATION" && name != "ROTATION" && name != "SCALE") continue;
      const std::uint64_t count = model_.accessors[accessor.get<std::size_t>()].count;
      const auto where = pointer + "/extensions/EXT_mesh_gpu_instancing/attributes/" + name;
      return place(count, mesh, where);
    }
    return {};
  }

  /// So many elements of a mesh.
  Result<void> place(std::uint64_t count, const MeshClaim& mesh, const std::string& pointer) {
    if (auto ok = spend(times(count, kElementBytes), pointer, "its instances"); !ok) return ok;
    instances_ += times(count, mesh.primitives);
    if (instances_ > limits_.max_nodes) {
      return fail(ErrorCode::kTooLarge, "more than " + std::to_string(limits_.max_nodes) + " instances",
                  radiosity::scene::place(document_.name, pointer));
    }
    const auto each = mesh.primitives * kInstanceBytes + times(mesh.triangles, kTriangleBytes);
    const auto drawn = mesh.primitives * kDrawnInstanceBytes + times(mesh.triangles, kDrawnTriangleBytes);
    bytes_ += times(times(count, drawn), limits_.renderers);
    return spend(times(count, each), pointer, "its triangles");
  }

  Result<void> spend(std::uint64_t bytes, const std::string& pointer, std::string_view what) {
    bytes_ += bytes;
    of_server_ += bytes;
    const auto where = [&] { return radiosity::scene::place(document_.name, pointer); };
    if (of_server_ > likely_.bytes)
      return fail(ErrorCode::kTooLarge, sceneMemoryFault(of_server_, likely_, what), where());
    if (bytes_ > limit_.bytes) return fail(ErrorCode::kTooLarge, sceneMemoryFault(bytes_, limit_, what), where());
    return {};
  }

  const Document& document_;
  const tinygltf::Model& model_;
  const ImportLimits& limits_;
  SceneLimit limit_, likely_;
  std::uint64_t bytes_, of_server_, instances_ = 0;
  std::vector<MeshClaim> meshes_;
  std::set<std::tuple<int, int, std::vector<double>>> poses_;  ///< mesh, skin, weights
};

}  // namespace

Result<std::uint64_t> claimOfGeometry(const Document& document, const tinygltf::Model& model, std::uint64_t claimed,
                                      const ImportLimits& limits) {
  return GeometryClaim(document, model, claimed, limits).run();
}

}  // namespace radiosity::scene
