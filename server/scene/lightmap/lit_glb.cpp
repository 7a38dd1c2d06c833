// withLightmapUvs: the input document with TEXCOORD_1 and the lightmap page on every lit primitive.
#include <algorithm>
#include <map>
#include <set>
#include <string>

#include "common/check.h"
#include "common/task.h"
#include "server/scene/import/import_context.h"
#include "server/scene/import/import_instancing.h"
#include "server/scene/lightmap/lightmap.h"
#include "server/scene/lightmap/lit_glb_animation.h"
#include "server/scene/lightmap/lit_glb_dangling.h"
#include "server/scene/lightmap/lit_glb_mesh.h"
#include "server/scene/lightmap/lit_glb_rules.h"
#include "server/scene/shading/emitters.h"

namespace radiosity::scene {
namespace {

constexpr const char* kInstancing = "EXT_mesh_gpu_instancing";

/// One placement of a mesh: a node, or one element of its EXT_mesh_gpu_instancing.
struct Placement {
  std::uint32_t node;
  std::map<std::uint32_t, LitPrimitive> lit;  ///< by primitive index in the file's mesh
};

/// The importer places a node's primitives behind each other, element by element: a primitive seen again starts the
/// next element. Refers to all that it is given.
std::vector<Placement> placements(const Scene& scene, const PatchScene& patches, const DarkOfEmitters& dark) {
  RAD_CHECK_EQ(scene.instances.size(), patches.instance_uvs.size());
  std::vector<Placement> out;
  std::set<std::uint32_t> seen;
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    const auto& instance = scene.instances[i];
    const auto& primitive = patches.cuts.primitiveOf(scene, static_cast<std::uint32_t>(i));
    if (out.empty() || out.back().node != instance.node || seen.count(primitive.primitive) != 0) {
      out.push_back({instance.node, {}});
      seen.clear();
    }
    seen.insert(primitive.primitive);
    const auto& uv = patches.instance_uvs[i];
    if (uv.side[0].page.empty()) continue;  // not charted
    out.back().lit[primitive.primitive] = {&primitive, patches.cuts.find(static_cast<std::uint32_t>(i)), &uv, &dark, i};
  }
  return out;
}

/// Calls `visit(texcoord)` for each texCoord member in a value.
template <typename Visit>
void forEachTexcoord(Json& value, const Visit& visit) {
  for (auto& [key, child] : value.items()) {
    interruptionPoint();
    if (key == "texCoord" && child.is_number_integer()) visit(child);
    if (child.is_structured()) forEachTexcoord(child, visit);
  }
}

/// Lightmap UVs take TEXCOORD_1. Where materials look up textures with the file's own set 1, that set moves to the
/// first free number, for every primitive and material alike.
void freeTexcoord1(Json& gltf) {
  if (!gltf.contains("materials") || !gltf.contains("meshes")) return;
  bool used = false;
  forEachTexcoord(gltf["materials"], [&](const Json& texcoord) { used |= texcoord == 1; });
  if (!used) return;
  const std::string prefix = "TEXCOORD_";
  std::size_t free = 2;
  const auto taken = [&](const std::string& name) {
    for (const auto& mesh : gltf["meshes"]) {
      for (const auto& primitive : mesh["primitives"]) {
        if (primitive["attributes"].contains(name)) return true;
      }
    }
    return false;
  };
  while (taken(prefix + std::to_string(free))) ++free;
  for (auto& mesh : gltf["meshes"]) {
    for (auto& primitive : mesh["primitives"]) {
      auto& attributes = primitive["attributes"];
      if (!attributes.contains("TEXCOORD_1")) continue;
      attributes[prefix + std::to_string(free)] = attributes["TEXCOORD_1"];
      attributes.erase("TEXCOORD_1");
    }
  }
  forEachTexcoord(gltf["materials"], [&](Json& texcoord) {
    if (texcoord == 1) texcoord = free;
  });
}

/// "lightmap" in extras comes from here alone: what an earlier export left would name pages that are gone.
void dropOldPages(Json& gltf) {
  if (!gltf.contains("meshes")) return;
  for (auto& mesh : gltf["meshes"]) {
    for (auto& primitive : mesh["primitives"]) {
      if (!primitive.contains("extras") || !primitive["extras"].is_object()) continue;
      for (const auto* member : {"lightmap", "lightmapSide", "lightmapEmits"}) primitive["extras"].erase(member);
    }
  }
}

class Exporter {
 public:
  Exporter(const Document& document, const tinygltf::Model& model, Document& out)
      : document_(document), model_(model), out_(out), builder_(document, model, out.gltf, document.buffers.size()) {}

  Result<void> run(const std::vector<Placement>& all) {
    source_meshes_ = out_.gltf.value("meshes", Json::array());
    for (std::size_t i = 0; i < all.size();) {
      interruptionPoint();
      auto end = i;
      while (end < all.size() && all[end].node == all[i].node) ++end;
      if (auto ok =
              place({all.begin() + static_cast<std::ptrdiff_t>(i), all.begin() + static_cast<std::ptrdiff_t>(end)});
          !ok) {
        return ok;
      }
      i = end;
    }
    auto bytes = builder_.takeBytes();
    if (auto filled = fillTexcoordGaps(out_.gltf, document_.buffers.size(), bytes); !filled) return filled;
    if (!bytes.empty()) {
      out_.gltf["buffers"].push_back({{"byteLength", bytes.size()}});
      out_.buffers.push_back(std::make_shared<const Bytes>(std::move(bytes)));
    }
    dropUnusedInstancing();
    if (!moveWeightChannels(out_.gltf, children_, [&](std::size_t bytes) { return builder_.takeJson(bytes); }))
      return builder_.tooMuchJson();
    makeSingleSided();
    return {};
  }

 private:
  /// All placements of one node.
  Result<void> place(std::span<const Placement> placed) {
    const auto node = placed.front().node;
    const auto mesh = document_.gltf["nodes"][node]["mesh"].get<std::size_t>();
    if (extensionOf(document_.gltf["nodes"][node], kInstancing) != nullptr) return expand(node, mesh, placed);
    RAD_CHECK_EQ(placed.size(), std::size_t{1});
    const auto index = litMesh(mesh, placed.front());
    if (!index) return tl::unexpected(index.error());
    out_.gltf["nodes"][node]["mesh"] = *index;
    return {};
  }

  /// An instanced node becomes a node with a child for each element, for each needs UVs of its own.
  Result<void> expand(std::uint32_t node, std::size_t mesh, std::span<const Placement> placed) {
    const auto& attributes = document_.gltf["nodes"][node]["extensions"][kInstancing]["attributes"];
    const auto locals = readInstancing(document_, model_, attributes, "/nodes/" + std::to_string(node));
    if (!locals) return tl::unexpected(locals.error());
    RAD_CHECK_EQ(locals->size(), placed.size());
    const auto name = document_.gltf["nodes"][node].value("name", "node " + std::to_string(node));
    Json children = document_.gltf["nodes"][node].value("children", Json::array());
    for (std::size_t i = 0; i < placed.size(); ++i) {
      const auto index = litMesh(mesh, placed[i]);
      if (!index) return tl::unexpected(index.error());
      if (!builder_.takeJson(name.size())) return builder_.tooMuchJson();
      const auto& [t, q, s] = (*locals)[i];
      Json child = {{"name", name + " #" + std::to_string(i)}, {"mesh", *index}};
      child["translation"] = {t.x, t.y, t.z};
      child["rotation"] = {q.x, q.y, q.z, q.w};
      child["scale"] = {s.x, s.y, s.z};
      if (document_.gltf["nodes"][node].contains("weights"))
        child["weights"] = document_.gltf["nodes"][node]["weights"];
      children.push_back(out_.gltf["nodes"].size());
      children_[node].push_back(out_.gltf["nodes"].size());
      out_.gltf["nodes"].push_back(std::move(child));
    }
    auto& parent = out_.gltf["nodes"][node];
    parent["children"] = std::move(children);
    for (const auto* member : {"mesh", "skin", "weights"}) parent.erase(member);
    parent["extensions"].erase(kInstancing);
    if (parent["extensions"].empty()) parent.erase("extensions");
    return {};
  }

  /// The first placement takes the mesh's own index, so that a scene without instancing keeps its numbering.
  Result<std::size_t> litMesh(std::size_t mesh, const Placement& placement) {
    const bool first = taken_.insert(mesh).second;
    auto built = builder_.build(source_meshes_[mesh], placement.lit, !first);
    if (!built) return tl::unexpected(built.error());
    if (first) {
      out_.gltf["meshes"][mesh] = std::move(*built);
      return mesh;
    }
    out_.gltf["meshes"].push_back(std::move(*built));
    return out_.gltf["meshes"].size() - 1;
  }

  /// Each side of what is lit is there by itself. What is not lit, because it is hidden say, keeps its material as it
  /// was, as a copy where both use it.
  void makeSingleSided() {
    if (!out_.gltf.contains("materials") || !out_.gltf.contains("meshes")) return;
    auto& materials = out_.gltf["materials"];
    std::set<std::size_t> of_lit;
    std::map<std::size_t, std::vector<Json*>> of_others;  // their places
    for (auto& mesh : out_.gltf["meshes"])
      for (auto& primitive : mesh["primitives"]) {
        const bool lit = primitive.contains("extras") && primitive["extras"].contains("lightmap");
        forEachMaterial(primitive, [&](Json& material) {
          const auto index = material.get<std::size_t>();
          if (!materials[index].value("doubleSided", false)) return;
          if (lit) {
            of_lit.insert(index);
          } else {
            of_others[index].push_back(&material);
          }
        });
      }
    for (const auto index : of_lit) {
      if (const auto others = of_others.find(index); others != of_others.end()) {
        const auto copy = materials.size();
        materials.push_back(materials[index]);
        for (auto* place : others->second) *place = copy;
      }
      materials[index].erase("doubleSided");
    }
  }

  /// Calls `visit(index)` for each material that a primitive may have (KHR_materials_variants).
  template <typename Visit>
  static void forEachMaterial(Json& primitive, const Visit& visit) {
    if (primitive.contains("material")) visit(primitive["material"]);
    const auto* variants = extensionOf(primitive, "KHR_materials_variants");
    if (variants == nullptr || !variants->contains("mappings")) return;
    for (auto& mapping : primitive["extensions"]["KHR_materials_variants"]["mappings"])
      if (mapping.contains("material")) visit(mapping["material"]);
  }

  /// Takes the extension off the lists when its last user is gone.
  void dropUnusedInstancing() {
    for (const auto& node : out_.gltf.value("nodes", Json::array())) {
      if (extensionOf(node, kInstancing) != nullptr) return;
    }
    for (const auto* list : {"extensionsUsed", "extensionsRequired"}) {
      if (!out_.gltf.contains(list)) continue;
      auto& names = out_.gltf[list];
      if (const auto found = std::find(names.begin(), names.end(), kInstancing); found != names.end())
        names.erase(found);
      if (names.empty()) out_.gltf.erase(list);
    }
  }

  const Document& document_;
  const tinygltf::Model& model_;
  Document& out_;
  LitMeshBuilder builder_;
  Json source_meshes_;
  std::set<std::size_t> taken_;
  std::map<std::size_t, std::vector<std::size_t>> children_;  ///< by instanced node: one for each of its elements
};

}  // namespace

Result<Document> withLightmapUvs(const Document& document, const Scene& scene, const PatchScene& patches) {
  const auto model = parseModel(document);
  if (!model) return tl::unexpected(model.error());
  Document out = document;
  out.imported.reset();
  dropDanglingTextures(out.gltf);
  freeTexcoord1(out.gltf);
  dropOldPages(out.gltf);
  dropIdleCutoffs(out.gltf);
  separateCones(out.gltf);
  const DarkOfEmitters dark(scene, patches);
  const auto placed = placements(scene, patches, dark);
  if (auto ok = Exporter(document, *model, out).run(placed); !ok) return tl::unexpected(ok.error());
  return out;
}

}  // namespace radiosity::scene
