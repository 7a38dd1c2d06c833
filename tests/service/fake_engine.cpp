#include "tests/service/fake_engine.h"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>
#include <utility>

namespace radiosity::testing {
namespace {

SharedBytes bytesOf(const std::string& text) { return std::make_shared<const Bytes>(text.begin(), text.end()); }

int across(int texels) {
  return (texels + static_cast<int>(engine::kTileSize) - 1) / static_cast<int>(engine::kTileSize);
}

/// Calls `set(x, y)` for the texels of a tile.
template <typename Set>
void overTile(glm::ivec2 size, int tile, const Set& set) {
  const int side = static_cast<int>(engine::kTileSize);
  const int x0 = tile % across(size.x) * side;
  const int y0 = tile / across(size.x) * side;
  for (int y = y0; y < std::min(y0 + side, size.y); ++y)
    for (int x = x0; x < std::min(x0 + side, size.x); ++x) set(x, y);
}

void fillTile(engine::PageSnapshot& page, std::size_t mip, int tile, std::uint64_t version, float brightest) {
  overTile(page.size(mip), tile, [&](int x, int y) {
    if (!page.mips.empty()) {
      page.mips[mip].at(x, y) = FakeEngine::pattern(x, y, version, brightest);
    } else {
      auto& ids = page.id_mips[mip];
      ids.ids[static_cast<std::size_t>(y * ids.width + x)] = FakeEngine::idPattern(x, y, version);
    }
  });
}

}  // namespace

glm::vec3 FakeEngine::pattern(int x, int y, std::uint64_t version, float brightest) {
  // Random to the eye, so that deflate cannot make it small; 1 somewhere in every tile.
  auto hash = static_cast<std::uint32_t>(x) * 2654435761U ^ static_cast<std::uint32_t>(y) * 2246822519U ^
              static_cast<std::uint32_t>(version) * 3266489917U;
  hash ^= hash >> 15;
  hash *= 2246822519U;
  hash ^= hash >> 13;
  const float value = (x % 64 == 0 && y % 64 == 0) ? 1.0F : static_cast<float>(hash & 0xffffU) / 65536.0F;
  return glm::vec3(value, 0.5F * value, 0.25F * value) * brightest;
}

std::uint32_t FakeEngine::idPattern(int x, int y, std::uint64_t version) {
  return static_cast<std::uint32_t>(x * 1000 + y) * 100U + static_cast<std::uint32_t>(version);
}

FakeEngine::FakeEngine(Layout layout) : layout_(layout) {
  status_.gl_renderer = "none (fake)";
  status_.patches = 1000;
  status_.pages = static_cast<std::uint64_t>(layout.pages);
  status_.counters["skipped_shots"] = 7;
}

std::shared_ptr<engine::PageSnapshot> FakeEngine::emptyPage(engine::Quantity quantity) const {
  auto page = std::make_shared<engine::PageSnapshot>();
  for (int m = 0; m < layout_.mips; ++m) {
    const int width = std::max(1, layout_.width >> m);
    const int height = std::max(1, layout_.height >> m);
    if (engine::holdsIds(quantity)) {
      page->id_mips.push_back(
          {width, height, std::vector<std::uint32_t>(static_cast<std::size_t>(width * height), engine::kNoId)});
    } else {
      page->mips.emplace_back(width, height);
    }
    const auto tiles = static_cast<std::size_t>(across(width)) * static_cast<std::size_t>(across(height));
    page->tile_version.emplace_back(tiles, 0);
    page->tile_change.emplace_back(tiles, 0.0F);
  }
  return page;
}

std::uint64_t FakeEngine::publish(float brightest, engine::Quantity quantity) {
  std::uint64_t version = 0;
  {
    const std::lock_guard lock(mutex_);
    version = ++status_.tile_version;
    auto next = std::make_shared<engine::Lightmaps>();
    for (int p = 0; p < layout_.pages; ++p) {
      auto page = emptyPage(quantity);
      for (std::size_t m = 0; m < page->mipCount(); ++m)
        for (std::size_t t = 0; t < page->tile_version[m].size(); ++t) {
          fillTile(*page, m, static_cast<int>(t), version, brightest);
          page->tile_version[m][t] = version;
          page->tile_change[m][t] = 1.0F;
        }
      next->pages.push_back(std::move(page));
    }
    next->quantity = quantity;
    next->layout = layout_number_;
    next->revision = status_.revision;
    next->tile_version = version;
    next->shots = static_cast<std::uint32_t>(status_.shots);
    next->error = static_cast<float>(status_.error.total);
    next->final = status_.state == engine::SolveState::kConverged;
    lightmaps_[static_cast<std::size_t>(quantity)] = std::move(next);
  }
  announceLightmaps(quantity);
  return version;
}

std::uint64_t FakeEngine::publishTile(std::uint32_t page, std::uint32_t tile) {
  std::uint64_t version = 0;
  {
    const std::lock_guard lock(mutex_);
    version = ++status_.tile_version;
    auto next = std::make_shared<engine::Lightmaps>(*lightmaps_[0]);
    auto changed = std::make_shared<engine::PageSnapshot>(*next->pages.at(page));
    fillTile(*changed, 0, static_cast<int>(tile), version, 100.0F);
    changed->tile_version[0].at(tile) = version;
    changed->tile_change[0].at(tile) = 0.5F;
    next->pages[page] = std::move(changed);
    next->tile_version = version;
    lightmaps_[0] = std::move(next);
  }
  announceLightmaps(engine::Quantity::kIrradiance);
  return version;
}

void FakeEngine::changeLayout(Layout layout) {
  const std::lock_guard lock(mutex_);
  layout_ = layout;
  ++layout_number_;
  status_.pages = static_cast<std::uint64_t>(layout.pages);
  status_.layout_since = status_.tile_version + 1;
}

std::shared_ptr<void> FakeEngine::watch(engine::Quantity quantity) {
  const auto i = static_cast<std::size_t>(quantity);
  ++(*watchers_)[i];
  if (lightmaps(quantity)) announceLightmaps(quantity);
  return {watchers_.get(), [watchers = watchers_, i](void*) { --(*watchers)[i]; }};
}

void FakeEngine::announceLightmaps(engine::Quantity quantity) {
  const auto now = lightmaps(quantity);
  for (const auto& listener : listeners()) listener->onLightmaps(now);
}

void FakeEngine::surface(std::optional<double> total) {
  const std::lock_guard lock(mutex_);
  status_.probes_surface = !total;
  status_.surface_error.reset();
  if (total) status_.surface_error = engine::SurfaceEstimate{*total, 0.0, 3.0 * *total};
}

void FakeEngine::progress(double error, engine::SolveState state) {
  {
    const std::lock_guard lock(mutex_);
    status_.state = state;
    status_.error.total = status_.error.texels = error;
    status_.shots += 100;
    status_.seconds += 0.1;
    status_.load_fraction.reset();
    if (state == engine::SolveState::kLoading) status_.load_fraction = 0.25;
  }
  const auto now = status();
  for (const auto& listener : listeners()) listener->onProgress(now);
}

void FakeEngine::notice(const engine::Notice& notice) {
  for (const auto& listener : listeners()) listener->onNotice(notice);
}

void FakeEngine::loseRenderer(bool lost) {
  const std::lock_guard lock(mutex_);
  status_.renderer_lost = lost;
  status_.failure = lost ? "the driver is gone" : "";
}

void FakeEngine::loseIdle(std::uint64_t missing, std::uint64_t renderers, std::string why) {
  const std::lock_guard lock(mutex_);
  status_.renderers_missing = missing;
  status_.renderers = renderers;
  status_.renderer_trouble = std::move(why);
}

void FakeEngine::loseState(std::string why) {
  const std::lock_guard lock(mutex_);
  status_.state_trouble = std::move(why);
}

void FakeEngine::holdAnswers() {
  const std::lock_guard lock(mutex_);
  holding_ = true;
}

void FakeEngine::release() {
  std::vector<std::function<void()>> calls;
  {
    const std::lock_guard lock(mutex_);
    holding_ = false;
    calls.swap(held_);
  }
  for (const auto& call : calls) call();
}

void FakeEngine::answer(std::function<void()> call) {
  {
    const std::lock_guard lock(mutex_);
    if (holding_) return held_.push_back(std::move(call));
  }
  call();
}

void FakeEngine::ask(const engine::Client& client) {
  const std::lock_guard lock(mutex_);
  clients_.push_back(client);
}

std::vector<engine::Client> FakeEngine::clients() const {
  const std::lock_guard lock(mutex_);
  return clients_;
}

void FakeEngine::setSceneText(std::string gltf) {
  const std::lock_guard lock(mutex_);
  scene_text_ = std::move(gltf);
}

void FakeEngine::setGlb(SharedBytes glb) {
  const std::lock_guard lock(mutex_);
  glb_ = std::move(glb);
}

std::uint64_t FakeEngine::patchesSeen() const {
  const std::lock_guard lock(mutex_);
  return patches_;
}

std::string FakeEngine::lastLoad() const {
  const std::lock_guard lock(mutex_);
  return last_load_;
}

void FakeEngine::loaded(std::string what, const engine::Client& client, Callback<engine::LoadOutcome> done) {
  ask(client);
  std::uint64_t revision = 0;
  {
    const std::lock_guard lock(mutex_);
    last_load_ = std::move(what);
    revision = ++status_.revision;
    status_.state = engine::SolveState::kSolving;
    ++layout_number_;
    status_.layout_since = status_.tile_version + 1;
  }
  for (const auto& listener : listeners()) listener->onSceneLoaded(revision);
  answer([done = std::move(done), revision] {
    done(engine::LoadOutcome{revision, {"room.glb: /materials/0: clamped"}});
  });
}

void FakeEngine::loadBytes(std::string name, SharedBytes bytes, engine::Client client,
                           Callback<engine::LoadOutcome> done) {
  if (bytes->size() >= 3 && std::equal(bytes->begin(), bytes->begin() + 3, "bad"))
    return answer([done, name] {
      done(fail(ErrorCode::kInvalidScene, "count is larger than the buffer view", name + ": /accessors/4/count"));
    });
  loaded(fmt::format("{}: {} bytes by {}", name, bytes->size(), client.name), client, std::move(done));
}

void FakeEngine::loadFile(std::string path, engine::Client client, Callback<engine::LoadOutcome> done) {
  loaded("file " + path + " by " + client.name, client, std::move(done));
}

void FakeEngine::patch(engine::PatchRequest request, Callback<engine::PatchOutcome> done) {
  std::uint64_t revision = 0;
  bool stale = false;
  {
    const std::lock_guard lock(mutex_);
    ++patches_;
    stale = request.base_revision && *request.base_revision != status_.revision;
    if (!stale) revision = request.dry_run ? status_.revision : ++status_.revision;
  }
  if (stale)
    return answer([done] { done(fail(ErrorCode::kStaleRevision, "another edit came first; fetch it and try again")); });
  if (!request.dry_run)
    for (const auto& listener : listeners()) listener->onScenePatched(revision, request.patch, request.by);
  answer([done = std::move(done), revision] { done(engine::PatchOutcome{revision, 3, 40}); });
}

void FakeEngine::step(engine::StepRequest request, Callback<engine::PatchOutcome> done) {
  patch({.patch = R"([{"op":"replace","path":"/asset/generator","value":"a step"}])",
         .base_revision = request.base_revision,
         .by = request.by},
        [done = std::move(done)](Result<engine::PatchOutcome> outcome) {
          if (outcome) outcome->stepped = outcome->revision - 1;
          done(std::move(outcome));
        });
}

void FakeEngine::history(Callback<engine::HistoryReport> done) {
  const auto revision = status().revision;
  engine::HistoryReport report{revision, revision, 0, {}};
  for (std::uint64_t r = 1; r <= revision; ++r)
    report.revisions.push_back({r, engine::PastRevision::Kind::kPatch, "somebody", "replace /asset/generator"});
  answer([done = std::move(done), report = std::move(report)] { done(report); });
}

void FakeEngine::configure(ChangeSettings change, Callback<engine::SolveSettings> done) {
  answer([this, change = std::move(change), done = std::move(done)] {
    engine::SolveSettings settings;
    {
      const std::lock_guard lock(mutex_);
      settings = status_.settings = change(status_.settings);
    }
    done(settings);
  });
}

void FakeEngine::setState(engine::SolveState state, Callback<engine::SolveState> done) {
  {
    const std::lock_guard lock(mutex_);
    status_.state = state;
  }
  answer([done = std::move(done), state] { done(state); });
}

void FakeEngine::pause(Callback<engine::SolveState> done) { setState(engine::SolveState::kPaused, std::move(done)); }
void FakeEngine::resume(Callback<engine::SolveState> done) { setState(engine::SolveState::kSolving, std::move(done)); }
void FakeEngine::restart(Callback<engine::SolveState> done) { setState(engine::SolveState::kSolving, std::move(done)); }

engine::Status FakeEngine::status() const {
  std::unique_lock lock(mutex_);
  auto status = status_;
  const auto meanwhile = std::exchange(meanwhile_, nullptr);
  lock.unlock();
  if (meanwhile) meanwhile();
  return status;
}

engine::SolveHistory FakeEngine::solveHistory() const {
  const std::lock_guard lock(mutex_);
  return {status_.revision, {{0.5 * status_.seconds, {}}, {status_.seconds, status_.error}}};
}

void FakeEngine::overtakeStatus(std::function<void()> meanwhile) {
  const std::lock_guard lock(mutex_);
  meanwhile_ = std::move(meanwhile);
}

std::shared_ptr<const engine::Lightmaps> FakeEngine::lightmaps(engine::Quantity quantity) const {
  const std::lock_guard lock(mutex_);
  return lightmaps_[static_cast<std::size_t>(quantity)];
}

void FakeEngine::sceneText(Callback<SceneText> done) {
  SceneText text;
  {
    const std::lock_guard lock(mutex_);
    text = {status_.revision, scene_text_};
  }
  answer([done = std::move(done), text = std::move(text)] { done(text); });
}
void FakeEngine::sceneGlb(std::optional<std::uint64_t> layout, engine::Client client, Callback<SharedBytes> done) {
  ask(client);
  std::uint64_t here = 0;
  SharedBytes glb;
  {
    const std::lock_guard lock(mutex_);
    here = layout_number_;
    glb = glb_;
  }
  answer([done, layout, here, glb] {
    if (layout && *layout != here) return done(fail(ErrorCode::kStaleRevision, "the layout is another"));
    done(glb);
  });
}
void FakeEngine::unlitGlb(engine::Client client, Callback<SharedBytes> done) {
  ask(client);
  answer([done] { done(bytesOf("glTF unlit")); });
}
void FakeEngine::lightmapExr(std::uint32_t page, engine::Quantity quantity, engine::Client client,
                             Callback<SharedBytes> done) {
  ask(client);
  answer([done, page, quantity] {
    if (page > 0) return done(fail(ErrorCode::kNotFound, "there is one lightmap page", fmt::format("page {}", page)));
    done(
        bytesOf(quantity == engine::Quantity::kIrradiance ? "exr" : fmt::format("exr {}", static_cast<int>(quantity))));
  });
}
void FakeEngine::snapshot(engine::SnapshotRequest request, engine::Client client, Callback<engine::Snapshot> done) {
  ask(client);
  answer([done, request] {
    if (request.quantity == "colour") return done(fail(ErrorCode::kBadUsage, "no quantity \"colour\"", "quantity"));
    if (request.camera == "nobody") return done(fail(ErrorCode::kNotFound, "there is no camera \"nobody\""));
    const auto exposure = request.exposure.value_or(0.25);
    done(engine::Snapshot{bytesOf(fmt::format("png {}x{} {} {} {}", request.width, request.height, request.quantity,
                                              request.camera, exposure)),
                          exposure});
  });
}

void FakeEngine::texel(engine::TexelRequest request, Callback<engine::Texel> done) {
  engine::Status now;
  Layout layout;
  {
    const std::lock_guard lock(mutex_);
    now = status_;
    layout = layout_;
  }
  answer([done, request, now, layout] {
    const auto outside = [&](std::uint32_t value, int count, const char* member) {
      const bool is = value >= static_cast<std::uint32_t>(count);
      if (is) done(fail(ErrorCode::kNotFound, "there is no such texel", member));
      return is;
    };
    if (outside(request.page, layout.pages, "page") || outside(request.x, layout.width, "x") ||
        outside(request.y, layout.height, "y"))
      return;
    const auto x = static_cast<float>(request.x), y = static_cast<float>(request.y);
    done(engine::Texel{now.revision, now.tile_version, {x, y, 0.5F}, {0.125F, 0.25F, x + y}});
  });
}

/// A desk of 3 x 2 points with 100, 101 ... lux, and, where asked for as "long", one of more than a message holds.
void FakeEngine::lightWeb(std::size_t light, engine::Client /*client*/, Callback<engine::ShownWeb> done) {
  answer([light, done] {
    if (light != 2) return done(fail(ErrorCode::kNotFound, "there is no such light"));
    done(engine::ShownWeb{1, 12.0, 500.0, {0, 0, -1}, {1, 0, 0}, {0, 30, 60}, {0}, {500, 250, 0}});
  });
}

void FakeEngine::measure(engine::MeasureRequest request, engine::Client /*client*/,
                         Callback<engine::MeasureReport> done) {
  const auto now = status();
  answer([done, request, now] {
    if (request.plane != "" && request.plane != "desk" && request.plane != "long")
      return done(fail(ErrorCode::kNotFound, "there is no such plane", "plane"));
    engine::MeasuredPlane plane;
    plane.node = 4;
    plane.name = request.plane == "long" ? "long" : "desk";
    plane.columns = 3;
    plane.rows = request.plane == "long" ? 2000 : 2;
    plane.place = {glm::dvec3(1, 2, 3), glm::dvec3(0.5, 0, 0), glm::dvec3(0, 0, 0.25)};
    plane.normal = {0, 1, 0};
    for (std::uint32_t i = 0; i < plane.columns * plane.rows; ++i) {
      plane.illuminance.light.push_back(100.0 + i);
      plane.illuminance.error.push_back(0.5);
    }
    plane.illuminance.mean = 102.5;
    plane.wanted_lux = 90.0;
    plane.lux_verdict = plane.verdict = engine::PlaneVerdict::kPasses;
    if (request.daylight_factor) plane.daylight_factor = plane.illuminance;
    done(engine::MeasureReport{now.revision, now.state, 0.01, {plane}});
  });
}

void FakeEngine::probes(engine::ProbeRequest request, engine::Client /*client*/, Callback<engine::ProbeReport> done) {
  const auto now = status();
  answer([done, request, now] {
    const double spacing = request.spacing.value_or(1.0);
    if (spacing < 1e-3) return done(fail(ErrorCode::kTooLarge, "too many probes", "spacing"));
    engine::ProbeGridLight grid;
    if (!request.spacing) grid.node = 4;
    grid.counts = {2, 1, 1};
    grid.steps = {glm::dvec3(spacing, 0, 0), glm::dvec3(0, spacing, 0), glm::dvec3(0, 0, spacing)};
    for (std::size_t i = 0; request.light && i < 2 * engine::kProbeValues; ++i)
      grid.values.push_back(static_cast<float>(i));
    done(engine::ProbeReport{now.revision, now.state, 0.01, {grid}});
  });
}

void FakeEngine::addListener(std::weak_ptr<engine::Listener> listener) {
  const std::lock_guard lock(mutex_);
  listeners_.push_back(std::move(listener));
}

std::vector<std::shared_ptr<engine::Listener>> FakeEngine::listeners() const {
  std::vector<std::shared_ptr<engine::Listener>> alive;
  const std::lock_guard lock(mutex_);
  for (const auto& weak : listeners_)
    if (auto listener = weak.lock()) alive.push_back(std::move(listener));
  return alive;
}

}  // namespace radiosity::testing
