// What can be fetched: the document, files in memory, pictures, single texels. Files and pictures are made on the
// thread of long work, of what is read here, on the solve thread, when their turn has come.
#include <fmt/format.h>
#include <memory>
#include <optional>
#include <utility>

#include "server/engine/loop/solve_loop_class.h"
#include "server/engine/publish/exports.h"
#include "server/engine/publish/framing.h"
#include "server/engine/publish/picture.h"
#include "server/engine/publish/plane_report.h"
#include "server/engine/publish/probe_report.h"
#include "server/engine/publish/quantity_pages.h"
#include "server/engine/publish/sky_file.h"
#include "server/scene/import/light_web_of.h"
#include "server/scene/lightmap/lightmap.h"

namespace radiosity::engine {
namespace {

/// So many may wait for the pages that single texels are read from.
constexpr std::size_t kMostAwaited = 1024;

Result<SharedBytes> shared(Result<Bytes> bytes) {
  if (!bytes) return tl::unexpected<Error>(bytes.error());
  return std::make_shared<const Bytes>(std::move(*bytes));
}

/// The document, the scene and the charts that belong together, for another thread.
struct GlbParts {
  std::shared_ptr<const scene::Document> document;
  std::shared_ptr<const scene::Scene> scene;
  std::shared_ptr<const scene::PatchScene> patches;
  std::pair<std::uint64_t, std::uint64_t> moment;  ///< layout and revision
  QuantityValues values;                           ///< what is on its pages, where it has any
};

/// What the eye would see: colours and lamps are on the pages, since the materials that showed them are gone. One
/// exposure for all pages.
std::vector<Image> displayPages(QuantityPages radiosity) {
  std::vector<Image> display;
  for (auto& page : radiosity.values) display.push_back(std::move(page.irradiance));
  Image all;
  for (auto& image : display) {
    interruptionPoint();
    for (auto& pixel : image.pixels) pixel *= static_cast<float>(1.0 / 3.14159265358979);
    all.pixels.insert(all.pixels.end(), image.pixels.begin(), image.pixels.end());
  }
  const float exposure = autoExposure(all);
  for (auto& image : display) image = toneMap(image, exposure);
  return display;
}

double statedError(const LitScene& lit) { return lit.showsOwnLight() ? lit.shownError() : lit.solver().error().total; }

}  // namespace

/// Light on finer texels is not shown before it is as good, and not measured either.
const LitScene& SolveLoop::measuredScene() const { return coarser_ && !lit_->showsOwnLight() ? *coarser_ : *lit_; }

void SolveLoop::sceneText(Callback<SceneText> done) {
  askOf<SceneText>(Needs::kScene, 0, std::move(done), [this]() -> Result<SceneText> {
    if (!lit_) return noScene();
    return SceneText{revision_, lit_->document().gltf.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace)};
  });
}

/// Who asks while others are still being sent the same shares it with them: a copy for everyone could fill the machine.
Result<SharedBytes> SolveLoop::makeGlb(std::optional<std::uint64_t> layout) {
  const auto parts = fromSolveThread([this, layout]() -> Result<GlbParts> {
    if (layout && *layout != publisher_.layout())
      return fail(
          ErrorCode::kStaleRevision,
          fmt::format("the lightmaps have another layout, {}: what the newest `lightmaps` names is to be fetched",
                      publisher_.layout()),
          fmt::format("?layout={}", *layout));
    return GlbParts{lit_->sharedDocument(),
                    lit_->sharedScene(),
                    lit_->sharedPatches(),
                    std::pair(publisher_.layout(), revision_),
                    {}};
  });
  if (!parts) return tl::unexpected<Error>(parts.error());
  if (auto known = glb_.lock(); known != nullptr && glb_of_ == parts->moment) return known;
  const auto lit = scene::withLightmapUvs(*parts->document, *parts->scene, *parts->patches);
  if (!lit) return tl::unexpected<Error>(lit.error());
  auto made = shared(scene::writeGlb(*lit));
  if (!made) return made;
  glb_ = *made;
  glb_of_ = parts->moment;
  return made;
}

void SolveLoop::sceneGlb(std::optional<std::uint64_t> layout, Client client, Callback<SharedBytes> done) {
  askLong<SharedBytes>(client, std::move(done), [this, layout] { return makeGlb(layout); });
}

Result<SharedBytes> SolveLoop::makeUnlit() {
  auto parts = fromSolveThread([this]() -> Result<GlbParts> {
    return GlbParts{lit_->sharedDocument(), lit_->sharedScene(), lit_->sharedPatches(),
                    std::pair(publisher_.layout(), revision_), readQuantity(*lit_, Quantity::kRadiosity)};
  });
  if (!parts) return tl::unexpected<Error>(parts.error());
  const auto display = displayPages(assemble(*parts->patches, std::move(parts->values)));
  return shared(scene::writeUnlitGlb(*parts->document, *parts->scene, *parts->patches, display));
}

void SolveLoop::unlitGlb(Client client, Callback<SharedBytes> done) {
  askLong<SharedBytes>(client, std::move(done), [this] { return makeUnlit(); });
}

void SolveLoop::skyPicture(Client client, Callback<SharedBytes> done) {
  askLong<SharedBytes>(client, std::move(done), [this]() -> Result<SharedBytes> {
    const auto sky = fromSolveThread([this]() -> Result<scene::Sky> { return lit_->sky(); });
    if (!sky) return tl::unexpected<Error>(sky.error());
    if (!sky->picture && !sky->sun) return fail(ErrorCode::kNotFound, "the sky is no picture");
    return std::make_shared<const Bytes>(hdrOfSky(*sky));
  });
}

void SolveLoop::lightWeb(std::size_t light, Client client, Callback<ShownWeb> done) {
  askLong<ShownWeb>(client, std::move(done), [this, light]() -> Result<ShownWeb> {
    using Moment = std::pair<std::shared_ptr<const scene::Document>, std::uint64_t>;
    const auto now = fromSolveThread([this]() -> Result<Moment> { return Moment(lit_->sharedDocument(), revision_); });
    if (!now) return tl::unexpected<Error>(now.error());
    const auto web = scene::lightWebOf(*now->first, light);
    if (!web) return tl::unexpected<Error>(web.error());
    return ShownWeb{now->second, web->lumens, web->most_candela, web->axis,
                    web->across, web->polar,  web->azimuth,      web->candela};
  });
}

Result<SharedBytes> SolveLoop::makeExr(std::uint32_t page, Quantity quantity) {
  auto parts = fromSolveThread([this, page, quantity]() -> Result<GlbParts> {
    const auto pages = lit_->patches().pages.size();
    if (page >= pages)
      return fail(ErrorCode::kNotFound,
                  "there is no lightmap page " + std::to_string(page) + " (there are " + std::to_string(pages) + ")");
    return GlbParts{nullptr, nullptr, lit_->sharedPatches(), {}, readQuantity(*lit_, quantity)};
  });
  if (!parts) return tl::unexpected<Error>(parts.error());
  auto pages = assemble(*parts->patches, std::move(parts->values));
  return shared(holdsIds(quantity) ? encodeExr(pages.ids[page], quantity)
                                   : encodeExr(shown(pages, std::move(pages.values[page].irradiance)), quantity));
}

void SolveLoop::lightmapExr(std::uint32_t page, Quantity quantity, Client client, Callback<SharedBytes> done) {
  askLong<SharedBytes>(client, std::move(done), [this, page, quantity] { return makeExr(page, quantity); });
}

void SolveLoop::snapshot(SnapshotRequest request, Client client, Callback<Snapshot> done) {
  askLong<Snapshot>(client, std::move(done), [this, request = std::move(request)]() -> Result<Snapshot> {
    auto parts = fromSolveThread([this, request] { return readPicture(*lit_, request); });
    if (!parts) return tl::unexpected<Error>(parts.error());
    return makePicture(view_, std::move(*parts), request);
  });
}

void SolveLoop::measure(MeasureRequest request, Client client, Callback<MeasureReport> done) {
  askLong<MeasureReport>(client, std::move(done), [this, request = std::move(request)]() -> Result<MeasureReport> {
    // By value: whoever is interrupted does not wait for the look.
    auto found = fromSolveThread([this, request]() -> Result<std::pair<MeasureReport, PlaneParts>> {
      const auto& lit = measuredScene();
      auto parts = readPlanes(lit, request);
      if (!parts) return tl::unexpected<Error>(parts.error());
      return std::pair(MeasureReport{revision_, state_, statedError(lit), {}}, std::move(*parts));
    });
    if (!found) return tl::unexpected<Error>(found.error());
    found->first.planes = measurePlanes(found->second, request);
    return std::move(found->first);
  });
}

void SolveLoop::probes(ProbeRequest request, Client client, Callback<ProbeReport> done) {
  askLong<ProbeReport>(client, std::move(done), [this, request]() -> Result<ProbeReport> {
    auto found = fromSolveThread([this, request]() -> Result<std::pair<ProbeReport, ProbeParts>> {
      const auto& lit = measuredScene();
      auto parts = readProbes(lit, request);
      if (!parts) return tl::unexpected<Error>(parts.error());
      return std::pair(ProbeReport{revision_, state_, statedError(lit), {}}, std::move(*parts));
    });
    if (!found) return tl::unexpected<Error>(found.error());
    auto grids = request.light ? probes_.light(found->second) : ProbeKeeper::places(found->second);
    if (!grids) return tl::unexpected<Error>(grids.error());
    found->first.grids = std::move(*grids);
    return std::move(found->first);
  });
}

/// A version of irradiance that is published stands for all steps until the next. What nobody watches has no versions:
/// what was published of it last may be of any time.
std::optional<Result<Texel>> SolveLoop::readTexel(const TexelRequest& request, bool may_make) {
  const auto version = publisher_.version();
  const auto published = [&](Quantity quantity) {
    const bool is_watched = watches_.wants(quantity) && !watches_.hasAdded(quantity);
    const auto& latest = publisher_.latest(quantity);
    return is_watched && latest && latest->tile_version == version ? latest : nullptr;
  };
  const PublishedTexels pages{published(Quantity::kIrradiance), published(Quantity::kError)};
  const PagesMoment now{publisher_.layout(), revision_, version, pages.irradiance ? 0 : steps_};
  return texels_.read(request, *lit_, now, pages, may_make);
}

/// What is there is told at once. Pages that must be made for it wait for all else, as files and pictures do, and are
/// made once for all who ask.
void SolveLoop::texel(TexelRequest request, Callback<Texel> done) {
  const auto answer = std::make_shared<Callback<Texel>>(std::move(done));
  const auto look = [this, request, answer] {
    if (!lit_) return (*answer)(noScene());
    if (auto known = readTexel(request, false)) return (*answer)(std::move(*known));
    const bool is_first = awaited_texels_.empty();
    if (awaited_texels_.size() < kMostAwaited &&
        (!is_first || queue_.push([this] { answerTexels(); }, CommandQueue::Kind::kLong)))
      return awaited_texels_.push_back({request, answer});
    (*answer)(tooMany());
  };
  const auto refuse = [answer] { (*answer)(tooMany()); };
  if (!queue_.push([this, look, refuse] { whenLoaded(Needs::kScene, 0, look, refuse); })) refuse();
}

void SolveLoop::answerTexels() {
  for (const auto& awaited : std::exchange(awaited_texels_, {})) {
    const auto read = [&]() -> Result<Texel> {
      if (!lit_) return noScene();
      return *readTexel(awaited.request, true);
    };
    (*awaited.answer)(withinMemory(read));
  }
}

}  // namespace radiosity::engine
