#include "server/engine/lit/lit_scene.h"

#include <algorithm>
#include <glm/common.hpp>
#include <optional>
#include <utility>

#include "common/give_back.h"
#include "common/task.h"
#include "server/engine/lit/carried_light.h"
#include "server/scene/burial/burial_record.h"
#include "server/scene/charts/build.h"
#include "server/scene/shading/emitters.h"
#include "server/scene/shading/shade.h"
#include "server/solver/pipeline/make_solver.h"

namespace radiosity::engine {
namespace {

constexpr std::size_t kMakeSteps = 10;  ///< of the progress that is told

std::uint64_t leavesWithArea(const scene::PatchScene& patches) {
  std::uint64_t count = 0;
  for (const auto& surface : patches.surfaces) {
    for (const auto first : surface.first_node) {
      if (first == scene::kNone) continue;
      const auto leaves = patches.node_area.begin() + first;
      count += static_cast<std::uint64_t>(std::count_if(leaves, leaves + std::int64_t{surface.width} * surface.height,
                                                        [](const float area) { return area > 0.0F; }));
    }
  }
  return count;
}

}  // namespace

Result<std::unique_ptr<LitScene>> LitScene::make(scene::Document document, const SolveSettings& settings,
                                                 solver::Transport& transport, const scene::ImportLimits& limits,
                                                 scene::TexelLayout layout) {
  auto imported = scene::importScene(document, limits);
  if (!imported) return tl::unexpected<Error>(imported.error());
  scene::EditedDocument edited{std::move(document), std::move(*imported)};
  return build(std::move(edited), settings, transport, nullptr, std::move(layout));
}

Result<std::unique_ptr<LitScene>> LitScene::make(scene::EditedDocument edited, const SolveSettings& settings,
                                                 solver::Transport& transport, const LitScene* former) {
  return build(std::move(edited), settings, transport, former, {});
}

Result<std::unique_ptr<LitScene>> LitScene::build(scene::EditedDocument edited, const SolveSettings& settings,
                                                  solver::Transport& transport, const LitScene* former,
                                                  scene::TexelLayout layout) {
  configureScene(edited.scene, settings);
  auto lit = std::unique_ptr<LitScene>(new LitScene(std::move(edited), settings, transport));
  std::optional<scene::FormerScene> before;
  if (former != nullptr) before.emplace(scene::FormerScene{*former->scene_, *former->patches_});
  lit->reproducible_ = former == nullptr;
  auto options = lit->chartOptions();
  options.layout = layout;
  if (former != nullptr) {
    lit->layout_ = former->layout_;
    lit->draft_error_ = former->draft_error_;
  } else {
    lit->setLayout(std::move(layout));
  }
  auto built = scene::buildWithRecord(*lit->scene_, options, before ? &*before : nullptr,
                                      former != nullptr ? former->burial_.get() : nullptr);
  if (!built) return tl::unexpected<Error>(built.error());
  interruptionPoint(9, kMakeSteps);
  lit->take(std::move(*built));
  return lit;
}

Result<std::unique_ptr<LitScene>> LitScene::makeAgain(scene::Document document, const SolveSettings& settings,
                                                      solver::Transport& transport, const scene::SideBits& sides,
                                                      scene::TexelLayout layout, const scene::ImportLimits& limits) {
  auto imported = scene::importScene(document, limits);
  if (!imported) return tl::unexpected<Error>(imported.error());
  configureScene(*imported, settings);
  auto lit = std::unique_ptr<LitScene>(new LitScene({std::move(document), std::move(*imported)}, settings, transport));
  auto options = lit->chartOptions();
  options.layout = layout;
  lit->setLayout(std::move(layout));
  auto built = scene::buildAgain(*lit->scene_, options, sides);
  if (!built) return tl::unexpected<Error>(built.error());
  lit->take(std::move(*built));
  return lit;
}

scene::ChartOptions LitScene::chartOptions() const {
  scene::ChartOptions charts;
  charts.texel_budget = texelBudget(settings_);
  charts.texel_size_m = settings_.texel_size_m;
  charts.sky = skyOf(*scene_);
  return charts;
}

/// Texels alike are a draft where others are to be chosen.
void LitScene::setLayout(scene::TexelLayout layout) {
  layout_ = std::move(layout);
  draft_error_ = settings_.choosesTexels() && layout_.empty() ? kPilotDraft : 0.0;
}

WantedTexels LitScene::wantedTexels(double aim) const {
  return engine::wantedTexels(*patches_, *solver_, surface_probe_.measured(), aim, settings_.texels, patch_count_);
}

std::optional<double> LitScene::enoughTexels(double aim) const {
  return engine::enoughTexels(*patches_, *solver_, surface_probe_.measured(), aim);
}

void LitScene::take(scene::BuiltScene built) {
  patches_ = std::make_shared<const scene::PatchScene>(std::move(built.patches));
  burial_ = std::move(built.burial);
  normals_ = std::move(built.normals);
  patch_count_ = leavesWithArea(*patches_);
  materials_ = scene::shadePatches(*scene_, *patches_);
  light_report_.findDark(litParts());
}

void LitScene::prepareUpload() {
  if (auto prepared = transport_.prepareScene(*patches_)) prepared_ = std::move(*prepared);
}

void configureScene(scene::Scene& scene, const SolveSettings& settings) {
  if (!settings.double_sided) return;
  for (auto& material : scene.materials) material.double_sided = true;
}

SceneChange LitScene::changeTo(const scene::Scene& next) const {
  auto change = changeBetween(*scene_, next);
  change.geometry = change.geometry || mayUncover(*patches_, change.switched) || reachesDarkSides(next, skyOf(next));
  return change;
}

bool LitScene::reachesDarkSides(const scene::Scene& next, const scene::Sky& sky) const {
  const auto tree = [this] {
    if (!tree_) tree_ = std::make_shared<const geometry::RayScene>(scene::raySceneOf(*patches_));
    return tree_;
  };
  return scene::reachesDarkSides(*patches_, *scene_, sources_.sky, next, sky, tree);
}

bool LitScene::outgrows(const SolveSettings& settings) const {
  if (scene_->sky) return false;
  const auto sky = settings.sky.value_or(SkySetting{});
  return reachesDarkSides(*scene_, {sky.upper, sky.lower});
}

scene::SideBits LitScene::sides() const { return scene::sidesOf(*scene_, *patches_); }

LitParts LitScene::litParts() const { return {*document_, *scene_, *patches_, materials_, sources_}; }

void LitScene::reportLight() { light_report_.findLost(litParts(), *solver_); }

std::string LitScene::unlit(const solver::EnergyParts& energy) const {
  if (patches_->surfaces.empty()) return {};
  return light_report_.unlit(power_, energy, solver_->error().total <= settings_.target_error);
}

/// Nothing where all was laid out anew.
std::optional<scene::PatchMap> LitScene::mapFrom(const LitScene& former) const {
  const bool related = former.patches_->centre == patches_->centre && former.patches_->scale == patches_->scale &&
                       former.patches_->texel == patches_->texel;
  if (!related) return std::nullopt;
  return scene::matchPatches(*former.scene_, *former.patches_, *scene_, *patches_);
}

LitScene::Affected LitScene::succeed(const LitScene& former) {
  former_map_ = mapFrom(former);
  return {touchedSurfaces(former.patches_->surfaces.size(), former_map_), former.solver_->shots()};
}

std::uint64_t LitScene::surfacesTouchedSince(const LitScene& former) const {
  return touchedSurfaces(former.patches_->surfaces.size(), mapFrom(former));
}

bool LitScene::keepsLayoutOf(const LitScene& former) const {
  const auto samePage = [](const scene::Page& a, const scene::Page& b) {
    return a.width == b.width && a.height == b.height;
  };
  return former.patches_->centre == patches_->centre && former.patches_->scale == patches_->scale &&
         std::ranges::equal(former.patches_->pages, patches_->pages, samePage) &&
         former.patches_->instance_uvs == patches_->instance_uvs && former.patches_->cuts == patches_->cuts &&
         onlyNodesMoved(*former.scene_, *scene_) &&
         scene::DarkOfEmitters(*former.scene_, *former.patches_) == scene::DarkOfEmitters(*scene_, *patches_);
}

std::uint64_t LitScene::startSolve(LitScene* former, bool keep_former) {
  if (former == nullptr || !former_map_ || former_map_->nothingKept()) {
    if (former != nullptr || solver_ == nullptr) makeSolver();
    former_map_.reset();
    return former == nullptr ? 0 : former->solver_->shots();
  }
  const auto shots_before = former->solver_->shots();
  const solver::FormerSolver before{*former->solver_, *former_map_, keep_former};
  makeSolver(&before);
  former_map_.reset();
  const bool keeps = solver_->linkCounters().kept + solver_->affectedSamples() > 0;
  return keeps ? solver_->affectedSamples() : shots_before;
}

/// Those that are new, or gone, or elsewhere, and those of which more or less is left.
std::uint64_t LitScene::touchedSurfaces(std::size_t before, const std::optional<scene::PatchMap>& matched) const {
  if (!matched) return std::max(patches_->surfaces.size(), before);
  const auto& map = *matched;
  std::uint64_t touched = 0, found = 0;
  for (std::size_t s = 0; s < patches_->surfaces.size(); ++s) {
    const auto& surface = patches_->surfaces[s];
    const auto first = map.leaf_altered.begin() + surface.first_leaf;
    touched += std::find(first, first + std::int64_t{surface.width} * surface.height, true) !=
                       first + std::int64_t{surface.width} * surface.height
                   ? 1
                   : 0;
    found += map.surface_before[s] != scene::kNone ? 1 : 0;
  }
  return touched + before - found;
}

scene::Sky LitScene::skyOf(const scene::Scene& scene) const {
  if (scene.sky) return *scene.sky;
  const auto sky = settings_.sky.value_or(SkySetting{});
  return {sky.upper, sky.lower};
}

solver::LightSources LitScene::lightSources(const scene::Scene& scene) const { return {scene.lights, skyOf(scene)}; }

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

void LitScene::makeSolver(const solver::FormerSolver* former) {
  solver::SolverSettings settings;
  settings.target_error = solverTarget(settings_, draft_error_, closer_);
  settings.seed = settings_.seed;
  settings.method = settings_.method;
  settings.link_memory = settings_.link_memory_bytes;
  sources_ = lightSources(*scene_);
  light_report_.forgetLost();
  forgetSurface();
  solver_ = solver::makeSolver(patches_, materials_, transport_, settings, sources_, former, normals_);
  solver_power_ = power_ = emittedPower();
}

void LitScene::restart(const SolveSettings& settings) {
  settings_ = settings;
  old_error_ = closer_ = 1.0;
  if (stale_) materials_ = scene::shadePatches(*scene_, *patches_);
  makeSolver();
  stale_ = false;
}

bool LitScene::save(ArchiveWriter& to) const {
  to(solver_power_);
  return solver_->save(to);
}

bool LitScene::restore(ArchiveReader& from) {
  from(solver_power_);
  return from.ok() && solver_->restore(from);
}

std::uint64_t LitScene::affectedBy(const SceneChange& change, const scene::Scene& next) const {
  const auto& surfaces = patches_->surfaces;
  if (change.geometry || sources_ != lightSources(next)) return surfaces.size();
  return static_cast<std::uint64_t>(std::ranges::count_if(surfaces, [&](const scene::Surface& surface) {
    return std::ranges::find(change.materials, surface.material) != change.materials.end();
  }));
}

std::shared_ptr<const scene::Document> LitScene::reshade(scene::Document document,
                                                         std::shared_ptr<const scene::Scene> next,
                                                         const SceneChange& change) {
  auto before = std::exchange(document_, std::make_shared<const scene::Document>(std::move(document)));
  scene_ = std::move(next);
  old_error_ = closer_ = 1.0;
  const bool was_stale = std::exchange(stale_, true);
  for (const auto material : change.materials) {
    const std::string place = "/materials/" + std::to_string(material) + " ";  // what was said of its former self
    std::erase_if(materials_.warnings, [&](const auto& warning) { return warning.starts_with(place); });
    (void)scene::reshadeMaterial(*scene_, *patches_, material, materials_);
  }
  if (!change.materials.empty()) light_report_.findDark(litParts());
  const bool other_lights = sources_ != lightSources(*scene_);
  // A material that no lit surface has leaves the light, and what is known of its error, as they are.
  // A solver of which only a part knows of an edit is told of no other: it will be made anew.
  if (!was_stale && affectedBy(change, *scene_) > 0) updateSolver(!change.materials.empty(), other_lights);
  stale_ = was_stale;
  return before;
}

double LitScene::shownError() const {
  if (const auto& measured = surface_probe_.stated()) return measured->total;
  const auto& error = solver_->error();
  const double between = std::isfinite(error.discretization) ? error.discretization : 0.0;
  return std::min(old_error_, std::hypot(error.total, between));
}

void LitScene::fadeFrom(LitScene& before, bool same_layout) {
  endFade();
  new_share_ = 0.0;
  // Only of links that are taken over is the lights' part known before all else.
  const bool known = former_map_ && !former_map_->nothingKept();
  if (before.showsOwnLight()) {
    former_light_.emplace(FormerLight{before.scene_, before.patches_, same_layout, before.shownLight(), {}, false});
    if (known) former_light_->direct = before.directLight();
    return;
  }
  const auto carried = [&](std::vector<scene::LightmapPage> pages) {
    return same_layout ? std::move(pages) : carryLight({*before.scene_, *before.patches_, pages}, *scene_, *patches_);
  };
  old_light_ = carried(before.shownPages());
  if (!known) return;
  before.makeOldDirectPages();
  auto direct = before.old_direct_.empty() ? before.directPages() : before.old_direct_;
  if (!direct.empty()) old_direct_ = carried(std::move(direct));
}

std::vector<scene::LightmapPage> LitScene::FormerLight::pages(const std::vector<glm::vec3>& texels,
                                                              const LitScene& to) const {
  auto made = scene::assemblePages(*patches, texels);
  return same_layout ? std::move(made) : carryLight({*scene, *patches, made}, *to.scene_, *to.patches_);
}

void LitScene::makeOldPages() {
  if (!former_light_ || former_light_->has_pages) return;
  // Of a scene without pages: none.
  old_light_ = former_light_->pages(scene::fitTexels(*former_light_->patches, former_light_->all), *this);
  giveBack(former_light_->all.mean);
  giveBack(former_light_->all.difference);
  former_light_->has_pages = true;
  if (former_light_->direct.empty()) former_light_.reset();
}

/// Where the solve takes so long that direct light is shown first, or the next edit comes before its end.
void LitScene::makeOldDirectPages() {
  makeOldPages();
  if (!former_light_) return;
  if (!former_light_->direct.empty()) old_direct_ = former_light_->pages(former_light_->direct, *this);
  former_light_.reset();
}

void LitScene::forgetOldDirect() {
  makeOldPages();
  former_light_.reset();
  old_direct_.clear();
}

/// Empty: not known.
std::vector<scene::LightmapPage> LitScene::directPages() const {
  const auto direct = directLight();
  if (direct.empty()) return {};
  return scene::assemblePages(*patches_, direct);
}

/// The light over few links and rays is solved for sooner than anyone sees that it is late.
bool LitScene::showDirectLight() {
  const bool is_slow = solver_->isUnsettled() && solver_->linkCounters().bytes >= slow_links_;
  if (showsOwnLight() || !(solver_->isRepairing() || is_slow)) return false;
  makeOldDirectPages();
  if (old_direct_.empty()) return false;
  const auto fresh = directPages();
  if (fresh.empty()) return false;
  old_light_ = replacePart(std::move(old_light_), old_direct_, fresh);
  old_direct_.clear();
  return true;
}

/// Goes on with what changed: materials_, or the sources of light that are no surfaces.
void LitScene::updateSolver(bool materials, bool lights) {
  sources_ = lightSources(*scene_);
  light_report_.forgetLost();
  forgetSurface();
  const double power_before = std::exchange(power_, emittedPower());
  // Integers have a scale that was chosen for the power at the start. Far outside it they could overflow or lose the
  // small lights.
  if (solver_->hasFluxScale() && (power_ > 4.0 * solver_power_ || power_ < solver_power_ / 64.0)) {
    old_light_ = shownPages();
    forgetOldDirect();
    new_share_ = 0.0;
    makeSolver();
    return;
  }
  std::vector<glm::vec3> direct;
  if ((lights || power_ != power_before) && !solver_->isRepairing() && solver_->linkCounters().bytes >= slow_links_)
    direct = directLight();
  if (materials) solver_->setMaterials(materials_);
  if (lights) solver_->setLights(sources_);
  if (!direct.empty()) showLightsFirst(direct);
}

/// Until the solver has the light over all its links.
void LitScene::showLightsFirst(const std::vector<glm::vec3>& direct_before) {
  const auto direct = directLight();
  if (direct.empty()) return;
  if (showsOwnLight()) {
    auto light = shownLight();
    for (std::size_t n = 0; n < light.mean.size(); ++n)
      light.mean[n] = glm::max(light.mean[n] + direct[n] - direct_before[n], 0.0F);
    old_light_ = scene::assemblePages(*patches_, scene::fitTexels(*patches_, light));
    until_settled_ = true;
  } else {
    old_light_ = replacePart(pagesOfNow(), scene::assemblePages(*patches_, direct_before),
                             scene::assemblePages(*patches_, direct));
  }
  forgetOldDirect();
  new_share_ = 0.0;
}

bool LitScene::setSky(const SolveSettings& settings) {
  settings_ = settings;
  if (sources_ == lightSources(*scene_)) return false;
  old_error_ = closer_ = 1.0;
  const bool was_stale = std::exchange(stale_, true);
  if (!was_stale) updateSolver(false, true);
  stale_ = was_stale;
  return true;
}

std::vector<std::string> LitScene::warnings(std::size_t most) const {
  std::vector<std::string> first;
  for (const auto* some :
       {&light_report_.dark(), &light_report_.lost(), &scene_->warnings, &patches_->warnings, &materials_.warnings}) {
    const auto count = static_cast<std::ptrdiff_t>(std::min(some->size(), most - first.size()));
    first.insert(first.end(), some->begin(), some->begin() + count);
  }
  if (hasNoLamp() && first.size() < most) {
    const char* of_sky = scene_->sky ? "its sky is dark" : "no sky; --sky 1000 adds one";
    first.emplace_back(std::string("nothing shines: the scene has no emissive surface, no light, and ") + of_sky);
  }
  if (settings_.method == Method::kPaper && first.size() < most) {
    first.emplace_back(
        "method paper: the stated error is that of light which is still unshot; the method does not know what its "
        "samples are off by");
  }
  return first;
}

std::size_t LitScene::warningCount() const {
  return light_report_.dark().size() + light_report_.lost().size() + scene_->warnings.size() +
         patches_->warnings.size() + materials_.warnings.size() + (hasNoLamp() ? 1 : 0) +
         (settings_.method == Method::kPaper ? 1 : 0);
}

scene::LeafLight LitScene::ownLight() const { return leafLight(*solver_, settings_); }

void LitScene::probeSurface(double seconds, bool is_late) {
  if (!surface_probe_.hasBegun()) {
    const auto light = ownLight();
    surface_probe_.begin({*patches_, solver_->rays(), normals_, materials_, sources_, light.mean}, settings_.seed,
                         scene::assemblePages(*patches_, scene::fitTexels(*patches_, light)), settings_.target_error);
  }
  surface_probe_.advance(seconds, is_late);
}

std::vector<scene::LightmapPage> LitScene::pages() const {
  return scene::assemblePages(*patches_, scene::fitTexels(*patches_, shownLight()));
}

/// What is shown of a fade as long as nothing new is known.
std::vector<scene::LightmapPage> LitScene::pagesOfNow() {
  makeOldPages();
  return new_share_ > 0.0 ? blendPages(old_light_, pages(), new_share_) : old_light_;
}

std::vector<scene::LightmapPage> LitScene::shownPages() {
  if (showsOwnLight()) return pages();
  if (new_share_ <= 0.0 && solver_->isUnsettled()) {  // its next slices settle it
    makeOldPages();
    return old_light_;
  }
  if (until_settled_) {
    endFade();
    return pages();
  }
  solver_->assess();
  const double error = solver_->error().total;
  new_share_ = std::max(new_share_, old_error_ < 1.0 ? refinedLightShare(error, old_error_)
                                                     : newLightShare(error, settings_.target_error));
  if (new_share_ >= 1.0) {
    endFade();
    return pages();
  }
  return pagesOfNow();
}

}  // namespace radiosity::engine
