#include "server/engine/lit_scene.h"

#include <algorithm>
#include <glm/common.hpp>
#include <set>

namespace radiosity::engine {
namespace {

void eraseLabels(nlohmann::json& object) {
  if (!object.is_object()) return;  // the document is compared before it is checked
  object.erase("name");
  object.erase("extras");
}

bool sameButLabels(nlohmann::json a, nlohmann::json b) {
  eraseLabels(a);
  eraseLabels(b);
  return a == b;
}

/// What of a material decides where one can see through it; null where it is opaque.
nlohmann::json opacityOf(const nlohmann::json& material) {
  const auto mode = material.find("alphaMode");
  const auto reflection = material.find("pbrMetallicRoughness");
  if (mode == material.end() || *mode == "OPAQUE" || reflection == material.end() || !reflection->is_object())
    return {};
  const nlohmann::json color = reflection->value("baseColorFactor", nlohmann::json());
  const bool has_alpha = color.is_array() && color.size() == 4;
  return {reflection->value("baseColorTexture", nlohmann::json()), has_alpha ? color[3] : nlohmann::json()};
}

/// Whether two materials differ only in how bright or how reflecting they are.
bool sameButShading(nlohmann::json a, nlohmann::json b) {
  for (auto* material : {&a, &b}) {
    if (!material->is_object()) continue;
    eraseLabels(*material);
    const auto opacity = opacityOf(*material);
    material->erase("emissiveFactor");
    material->erase("emissiveTexture");
    const auto extensions = material->find("extensions");
    if (extensions != material->end() && extensions->is_object()) extensions->erase("KHR_materials_emissive_strength");
    const auto reflection = material->find("pbrMetallicRoughness");
    if (reflection != material->end() && reflection->is_object()) *reflection = {{"opacity", opacity}};
  }
  return a == b;
}

/// For each node of a document that may not have been checked yet: whether it or a descendant has a mesh.
std::vector<bool> nodesWithMeshes(const nlohmann::json& nodes) {
  constexpr std::size_t kNoParent = static_cast<std::size_t>(-1);
  std::vector<std::size_t> parent(nodes.size(), kNoParent);
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    if (!nodes[n].is_object() || !nodes[n].contains("children") || !nodes[n]["children"].is_array()) continue;
    for (const auto& child : nodes[n]["children"]) {
      if (child.is_number_unsigned() && child.get<std::size_t>() < nodes.size()) parent[child.get<std::size_t>()] = n;
    }
  }
  std::vector<bool> found(nodes.size(), false);
  for (std::size_t n = 0; n < nodes.size(); ++n) {
    if (!nodes[n].is_object() || !nodes[n].contains("mesh")) continue;
    for (auto up = n; up != kNoParent && !found[up]; up = parent[up]) found[up] = true;
  }
  return found;
}

/// Lights, where they are, and where nothing else is: the imported lights tell of them better.
void eraseLights(nlohmann::json& gltf) {
  if (const auto found = gltf.find("extensions"); found != gltf.end() && found->is_object()) {
    found->erase("KHR_lights_punctual");
    if (found->empty()) gltf.erase(found);
  }
  const auto nodes = gltf.find("nodes");
  if (nodes == gltf.end() || !nodes->is_array()) return;
  const auto with_mesh = nodesWithMeshes(*nodes);
  for (std::size_t n = 0; n < nodes->size(); ++n) {
    auto& node = (*nodes)[n];
    if (!node.is_object()) continue;
    if (const auto found = node.find("extensions"); found != node.end() && found->is_object()) {
      found->erase("KHR_lights_punctual");
      if (found->empty()) node.erase(found);
    }
    if (with_mesh[n]) continue;
    for (const char* member : {"translation", "rotation", "scale", "matrix", "camera"}) node.erase(member);
  }
}

/// Members of the document that do not touch surfaces at all.
void eraseHarmless(nlohmann::json& gltf) {
  for (const char* member : {"asset", "extras", "cameras", "animations", "extensionsUsed"}) gltf.erase(member);
  for (const char* member : {"nodes", "meshes", "scenes"}) {
    if (!gltf.contains(member)) continue;
    for (auto& object : gltf[member]) eraseLabels(object);
  }
  eraseLights(gltf);
}

}  // namespace

Result<std::unique_ptr<LitScene>> LitScene::make(scene::Document document, const SolveSettings& settings,
                                                 solver::Transport& transport) {
  auto lit = std::unique_ptr<LitScene>(new LitScene(std::move(document), settings, transport));
  auto imported = scene::importScene(lit->document_);
  if (!imported) return tl::unexpected<Error>(imported.error());
  lit->scene_ = std::make_shared<const scene::Scene>(std::move(*imported));
  scene::ChartOptions charts;
  charts.texel_budget = settings.texels;
  charts.texel_size_m = settings.texel_size_m;
  auto patches = scene::buildPatchScene(*lit->scene_, charts);
  if (!patches) return tl::unexpected<Error>(patches.error());
  lit->patches_ = std::make_shared<const scene::PatchScene>(std::move(*patches));
  lit->materials_ = scene::shadePatches(*lit->scene_, *lit->patches_);
  lit->makeSolver();
  return lit;
}

solver::LightSources LitScene::lightSources() const {
  if (scene_->sky) return {scene_->lights, *scene_->sky};
  const auto sky = settings_.sky.value_or(SkySetting{});
  return {scene_->lights, {sky.upper, sky.lower}};
}

double LitScene::emittedPower() const {
  double power = solver::totalFlux(*patches_, sources_);
  for (const auto& surface : patches_->surfaces) {
    for (const auto first : surface.first_node) {
      if (first == scene::kNone) continue;
      const auto root = first + scene::levelGrid(surface.width, surface.height, surface.level_count - 1).offset;
      const glm::vec3 e = materials_.emission[root];
      power += static_cast<double>(e.x + e.y + e.z) * static_cast<double>(patches_->node_area[root]);
    }
  }
  return power;
}

void LitScene::makeSolver() {
  solver::SolverSettings settings;
  settings.target_error = settings_.target_error;
  settings.seed = settings_.seed;
  settings.paper_mode = settings_.paper_mode;
  settings.link_memory = settings_.link_memory_bytes;
  sources_ = lightSources();
  solver_ = solver::makeSolver(patches_, materials_, transport_, settings, sources_);
  solver_power_ = power_ = emittedPower();
}

void LitScene::restart(const SolveSettings& settings) {
  settings_ = settings;
  makeSolver();
}

LitScene::Change LitScene::changeTo(const scene::Document& next) const {
  nlohmann::json before = document_.gltf, after = next.gltf;
  eraseHarmless(before);
  eraseHarmless(after);
  if (before == after) return Change::kNothing;
  const nlohmann::json none = nlohmann::json::array();
  const nlohmann::json materials = before.value("materials", none), changed = after.value("materials", none);
  before.erase("materials");
  after.erase("materials");
  if (before != after || materials.size() != changed.size()) return Change::kGeometry;
  for (std::size_t i = 0; i < materials.size(); ++i) {
    if (!sameButShading(materials[i], changed[i])) return Change::kGeometry;
  }
  return Change::kShading;
}

Result<std::uint64_t> LitScene::reshade(scene::Document next, Change change) {
  auto imported = scene::importScene(next);
  if (!imported) return tl::unexpected<Error>(imported.error());
  std::set<std::uint32_t> affected;
  if (change == Change::kShading) {
    const auto& before = document_.gltf["materials"];
    const auto& after = next.gltf["materials"];
    for (std::uint32_t m = 0; m < before.size(); ++m) {
      if (sameButLabels(before[m], after[m])) continue;
      const std::string place = "/materials/" + std::to_string(m) + " ";  // what was said of its former self
      std::erase_if(materials_.warnings, [&](const auto& warning) { return warning.starts_with(place); });
      for (const auto surface : scene::reshadeMaterial(*imported, *patches_, m, materials_)) affected.insert(surface);
    }
  }
  document_ = std::move(next);
  scene_ = std::make_shared<const scene::Scene>(std::move(*imported));
  const bool other_lights = sources_ != lightSources();
  if (affected.empty() && !other_lights) return std::uint64_t{0};
  updateSolver(!affected.empty(), other_lights);
  return other_lights ? patches_->surfaces.size() : affected.size();  // a light may reach them all
}

/// Goes on with what changed: materials_, or the sources of light that are no surfaces.
void LitScene::updateSolver(bool materials, bool lights) {
  sources_ = lightSources();
  power_ = emittedPower();
  // Integers have a scale that was chosen for the power at the start. Far outside it they could overflow or lose the
  // small lights.
  if (solver_->hasFluxScale() && (power_ > 4.0 * solver_power_ || power_ < solver_power_ / 64.0)) {
    makeSolver();
    return;
  }
  if (materials) solver_->setMaterials(materials_);
  if (lights) solver_->setLights(sources_);
}

bool LitScene::setSky(const SolveSettings& settings) {
  settings_ = settings;
  if (sources_ == lightSources()) return false;
  updateSolver(false, true);
  return true;
}

std::vector<std::string> LitScene::warnings() const {
  std::vector<std::string> all = scene_->warnings;
  all.insert(all.end(), patches_->warnings.begin(), patches_->warnings.end());
  all.insert(all.end(), materials_.warnings.begin(), materials_.warnings.end());
  if (power_ <= 0.0 && !patches_->surfaces.empty()) {
    all.emplace_back("nothing shines: the scene has no emissive surface, no light and no sky; --sky 1000 adds one");
  }
  return all;
}

std::vector<scene::LightmapPage> LitScene::pages() const {
  return scene::assemblePages(*patches_, solver_->irradiance());
}

std::vector<scene::LightmapPage> LitScene::errorPages() const {
  std::vector<glm::vec3> error(patches_->nodeCount(), glm::vec3(0.0F));
  const auto first = solver_->halfIrradiance(0), second = solver_->halfIrradiance(1);
  for (std::size_t node = 0; node < error.size(); ++node) {
    const glm::vec3 mean = 0.5F * (first[node] + second[node]);
    error[node] = 0.5F * glm::abs(first[node] - second[node]) / glm::max(mean, glm::vec3(1e-30F));
  }
  return scene::assemblePages(*patches_, error);
}

}  // namespace radiosity::engine
