// importScene: checks, then materials, then a walk over the node tree. After an edit, of that only what it may change.
#include <algorithm>
#include <memory>
#include <utility>

#include "server/scene/document/import_schema.h"
#include "server/scene/document/scene_limit.h"
#include "server/scene/import/import_check.h"
#include "server/scene/import/import_context.h"
#include "server/scene/import/import_lint.h"
#include "server/scene/import/import_material.h"
#include "server/scene/import/import_model.h"
#include "server/scene/import/import_nodes.h"
#include "server/scene/import/import_planes.h"
#include "server/scene/import/import_probes.h"
#include "server/scene/import/import_record.h"
#include "server/scene/import/scene_memory.h"

namespace radiosity::scene {
namespace {

/// Of more nodes, meshes, materials, accessors and instances, a kilobyte each at most, nothing is kept for the next
/// edit.
constexpr std::size_t kMostParsed = 250'000;

/// `former`: null for none.
Result<Scene> importAll(const Document& document, const Document* former, const ImportLimits& limits,
                        ImportRecord& record) {
  const auto* before = former != nullptr ? former->imported.get() : nullptr;
  Scene scene;
  if (auto ok = checkSchema(document.gltf, document.name, scene.warnings); !ok) return tl::unexpected(ok.error());
  if (auto ok = checkExtensions(document.gltf, document.name, scene.warnings); !ok) return tl::unexpected(ok.error());
  const auto claimed = claimOfJson(document, limits);
  if (!claimed) return tl::unexpected(claimed.error());
  auto parsed = parseModel(document, before != nullptr ? &former->gltf : nullptr, before);
  if (!parsed) return tl::unexpected(parsed.error());
  record.materials = std::move(parsed->materials);
  record.model = std::make_shared<const tinygltf::Model>(std::move(*parsed));
  ImportContext context{document,      limits, *record.model, record.materials, before,
                        record.images, scene,  record.webs,   record.skies};
  if (auto ok = checkModel(context); !ok) return tl::unexpected(ok.error());
  if (const auto planes = readPlanes(document); !planes) return tl::unexpected(planes.error());
  if (const auto probes = readProbeGrids(document); !probes) return tl::unexpected(probes.error());
  const auto all = claimOfGeometry(document, *record.model, *claimed, limits);
  if (!all) return tl::unexpected(all.error());
  record.claimed_bytes = context.claimed_bytes = *all;
  record.warnings.checks = scene.warnings.size();
  if (auto ok = importMaterials(context); !ok) return tl::unexpected(ok.error());
  record.warnings.materials = scene.warnings.size();
  if (auto ok = importNodes(context); !ok) return tl::unexpected(ok.error());
  record.warnings.nodes = scene.warnings.size();
  record.extensions = extensionsBesideMaterials(document.gltf);
  warnAboutOddities(context, record.extensions);
  return scene;
}

/// But for materials, of which there are as many, `a` and `b` are the same.
bool differInMaterialsAlone(const Document& a, const Document& b, const TouchedParts& parts) {
  if (a.name != b.name || a.buffers != b.buffers || a.images != b.images) return false;
  if (!parts.all) return touchMaterialsAlone(parts, a.gltf, b.gltf);
  if (a.gltf.size() != b.gltf.size()) return false;
  for (const auto& [member, value] : a.gltf.items()) {
    const auto found = b.gltf.find(member);
    if (found == b.gltf.end()) return false;
    const bool may_differ = member == "materials" && value.is_array() && value.size() == found->size();
    if (!may_differ && !isIdentical(value, *found)) return false;
  }
  return true;
}

/// As importAll() on a document of which nothing but materials differs from what `before` is of. Of those the schema
/// lets nothing pass that it warns of.
Result<Scene> importWithOtherMaterials(const Document& document, const ImportRecord& before, const ImportLimits& limits,
                                       ImportRecord& record) {
  std::vector<std::string> known;
  if (auto ok = checkMaterials(document.gltf, document.name, known); !ok) return tl::unexpected(ok.error());
  auto materials = parseMaterials(document);
  if (!materials) return tl::unexpected(materials.error());
  record.materials = std::move(*materials);
  record.model = before.model;
  record.claimed_bytes = before.claimed_bytes;
  record.warnings = before.warnings;
  const auto warned = [&, from = before.scene.warnings.begin()](std::size_t count) {
    return from + static_cast<std::ptrdiff_t>(count);
  };
  Scene scene = before.scene;
  scene.materials.clear();
  scene.textures = {};
  scene.warnings.assign(warned(0), warned(before.warnings.checks));
  ImportContext context{document,      limits, *record.model, record.materials, &before,
                        record.images, scene,  record.webs,   record.skies};
  context.claimed_bytes = before.claimed_bytes;
  if (auto ok = importMaterials(context); !ok) return tl::unexpected(ok.error());
  if (scene.materials.size() < before.scene.materials.size())  // that of meshes which name none
    scene.materials.push_back(before.scene.materials.back());
  record.warnings.materials = scene.warnings.size();
  scene.warnings.insert(scene.warnings.end(), warned(before.warnings.materials), warned(before.warnings.nodes));
  record.warnings.nodes = scene.warnings.size();
  record.webs = before.webs;
  record.skies = before.skies;
  record.extensions = before.extensions;
  warnAboutOddities(context, record.extensions);
  return scene;
}

}  // namespace

Result<Scene> importScene(const Document& document, const ImportLimits& limits) {
  ImportRecord record;
  return importAll(document, nullptr, limits, record);
}

Result<EditedDocument> importEdited(Document document, const Document* former, const ImportLimits& limits,
                                    const TouchedParts& parts) {
  auto record = std::make_shared<ImportRecord>();
  const bool same_shape = former != nullptr && former->imported && differInMaterialsAlone(document, *former, parts);
  auto scene = same_shape ? importWithOtherMaterials(document, *former->imported, limits, *record)
                          : importAll(document, former, limits, *record);
  if (!scene) return tl::unexpected(scene.error());
  const auto& model = *record->model;
  document.imported.reset();
  if (model.nodes.size() + model.meshes.size() + model.accessors.size() + record->materials.size() +
          scene->instances.size() <=
      kMostParsed) {
    record->scene = *scene;
    document.imported = std::move(record);
  }
  return EditedDocument{std::move(document), std::move(*scene), parts};
}

}  // namespace radiosity::scene
