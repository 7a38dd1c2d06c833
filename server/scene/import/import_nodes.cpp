#include "server/scene/import/import_nodes.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <utility>

#include "common/task.h"
#include "server/scene/import/import_instancing.h"
#include "server/scene/import/import_lights.h"
#include "server/scene/import/import_lint.h"
#include "server/scene/import/import_mesh.h"
#include "server/scene/import/import_sky.h"
#include "server/scene/import/node_transform.h"

namespace radiosity::scene {
namespace {

constexpr double kMinTexelScale = 1.0 / 64.0, kMaxTexelScale = 64.0;

class NodeWalk {
 public:
  explicit NodeWalk(ImportContext& context) : context_(context), meshes_(context) {}

  Result<void> run() {
    const auto roots = rootNodes();
    for (auto root = roots.rbegin(); root != roots.rend(); ++root)
      stack_.push_back({*root, glm::dmat4(1.0), true, 1.0F});
    while (!stack_.empty()) {
      const auto place = stack_.back();
      stack_.pop_back();
      if (auto ok = visit(place); !ok) return ok;
    }
    return {};
  }

 private:
  struct Place {
    int node;
    glm::dmat4 parent;
    bool visible;
    float texel_scale;
  };

  /// Nodes of the scene to show: /scene, else the first of /scenes, else every node without a parent.
  [[nodiscard]] std::vector<int> rootNodes() const {
    const auto& model = context_.model;
    if (!model.scenes.empty()) return model.scenes[static_cast<std::size_t>(std::max(model.defaultScene, 0))].nodes;
    std::vector<bool> has_parent(model.nodes.size(), false);
    for (const auto& node : model.nodes) {
      for (const auto child : node.children) has_parent[static_cast<std::size_t>(child)] = true;
    }
    std::vector<int> roots;
    for (std::size_t n = 0; n < model.nodes.size(); ++n) {
      if (!has_parent[n]) roots.push_back(static_cast<int>(n));
    }
    return roots;
  }

  Result<void> visit(const Place& at) {
    const auto index = static_cast<std::size_t>(at.node);
    const auto& node = context_.model.nodes[index];
    const auto& json = context_.document.gltf["nodes"][index];
    pointer_ = "/nodes/" + std::to_string(index);
    const auto world = at.parent * localMatrix(node);
    if (!isFinite(world)) return context_.bad(pointer_, "world transform is not finite");
    if (!node.matrix.empty()) {
      context_.warn(pointer_ + "/matrix",
                    "shears or flattens, so it cannot be edited as translation, rotation and scale");
    }
    const auto* visibility = extensionOf(json, "KHR_node_visibility");
    const bool visible = at.visible && (visibility == nullptr || visibility->value("visible", true));
    const auto texel_scale = texelScale(json, at.texel_scale);
    if (!texel_scale) return tl::unexpected(texel_scale.error());
    if (node.mesh >= 0) {
      if (auto ok = placeMesh(node, json, {static_cast<std::uint32_t>(index), kNone, world, visible, *texel_scale});
          !ok)
        return ok;
    }
    if (node.camera >= 0) {
      if (auto ok = placeCamera(static_cast<std::size_t>(node.camera), cameraPose(at.parent, node)); !ok) return ok;
    }
    if (visible)
      if (auto ok = placeLights(context_, json, world, pointer_); !ok) return ok;
    for (auto child = node.children.rbegin(); child != node.children.rend(); ++child) {
      stack_.push_back({*child, world, visible, *texel_scale});
    }
    return {};
  }

  /// /nodes/N/extras/radiosityTexelScale: our own; glTF has no word for how fine a lightmap should be. Holds for the
  /// nodes below, unless they say otherwise.
  Result<float> texelScale(const Json& node, float inherited) const {
    const auto extras = node.find("extras");
    if (extras == node.end() || !extras->is_object() || !extras->contains("radiosityTexelScale")) return inherited;
    const auto& scale = (*extras)["radiosityTexelScale"];
    if (scale.is_number() && scale.get<double>() >= kMinTexelScale && scale.get<double>() <= kMaxTexelScale)
      return scale.get<float>();
    return context_.bad(pointer_ + "/extras/radiosityTexelScale", "must be a number in [1/64, 64]");
  }

  /// `placed`: all but the primitive.
  Result<void> placeMesh(const tinygltf::Node& node, const Json& json, Instance placed) {
    const auto* instancing = extensionOf(json, "EXT_mesh_gpu_instancing");
    if (instancing != nullptr && node.skin >= 0)
      context_.warn(pointer_ + "/skin", "is ignored beside EXT_mesh_gpu_instancing, whose elements it cannot place");
    const auto world = placed.world;
    const auto primitives = meshes_.primitivesOf(node, world, pointer_, instancing == nullptr);
    if (!primitives) return tl::unexpected(primitives.error());
    if (instancing == nullptr) {
      for (const auto& posed : *primitives) {
        interruptionPoint();
        placed.primitive = posed.primitive;
        placed.world = posed.world;
        if (auto ok = addInstance(placed); !ok) return ok;
      }
      return {};
    }
    return placeElements(*primitives, (*instancing)["attributes"], placed);
  }

  /// Of EXT_mesh_gpu_instancing.
  Result<void> placeElements(const std::vector<MeshImporter::Posed>& primitives, const Json& attributes,
                             Instance placed) {
    const auto world = placed.world;
    const auto pointer = pointer_ + "/extensions/EXT_mesh_gpu_instancing/attributes";
    const auto locals = readInstancing(context_.document, context_.model, attributes, pointer);
    if (!locals) return tl::unexpected(locals.error());
    warnAboutElements(context_, *locals, pointer);
    for (const auto& local : *locals) {
      interruptionPoint();
      placed.world = world * local.matrix();
      if (!isFinite(placed.world)) return context_.bad(pointer_, "world transform is not finite");
      for (const auto& posed : primitives) {
        placed.primitive = posed.primitive;
        if (auto ok = addInstance(placed); !ok) return ok;
      }
    }
    return {};
  }

  Result<void> addInstance(const Instance& instance) {
    triangles_ += context_.scene.primitives[instance.primitive].indices.size() / 3;
    if (triangles_ > context_.limits.max_triangles) {
      return context_.tooLarge(pointer_, "more than " + std::to_string(context_.limits.max_triangles) + " triangles");
    }
    if (context_.scene.instances.size() >= context_.limits.max_nodes) {
      return context_.tooLarge(pointer_, "more than " + std::to_string(context_.limits.max_nodes) + " instances");
    }
    context_.scene.instances.push_back(instance);
    return {};
  }

  Result<void> placeCamera(std::size_t index, const glm::dmat4& world) {
    const auto& source = context_.model.cameras[index];
    const auto pointer = "/cameras/" + std::to_string(index);
    if (source.type != "perspective") {
      context_.warn(pointer, "only perspective cameras are used; skipped");
      return {};
    }
    if (!(source.perspective.yfov > 0 && source.perspective.yfov < std::numbers::pi)) {
      return context_.bad(pointer + "/perspective/yfov", "must be between 0 and pi");
    }
    if (!(source.perspective.znear > 0)) return context_.bad(pointer + "/perspective/znear", "must be above 0");
    Camera camera;
    camera.name = source.name;
    camera.world = world;
    camera.yfov_rad = source.perspective.yfov;
    camera.aspect = source.perspective.aspectRatio;
    camera.znear = source.perspective.znear;
    context_.scene.cameras.push_back(std::move(camera));
    return {};
  }

  ImportContext& context_;
  MeshImporter meshes_;
  std::vector<Place> stack_;
  std::string pointer_;
  std::size_t triangles_ = 0;
};

}  // namespace

Result<void> importNodes(ImportContext& context) {
  if (auto ok = NodeWalk(context).run(); !ok) return ok;
  return importSky(context);
}

}  // namespace radiosity::scene
