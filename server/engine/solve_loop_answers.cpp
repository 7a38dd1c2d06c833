// What can be fetched from the solve thread: the document, files in memory, pictures, single texels.
#include <fmt/format.h>
#include <map>
#include <memory>
#include <optional>
#include <utility>

#include "server/engine/exports.h"
#include "server/engine/framing.h"
#include "server/engine/quantity_pages.h"
#include "server/engine/solve_loop_class.h"
#include "server/scene/lightmap.h"

namespace radiosity::engine {
namespace {

/// Stated error from which on a snapshot shows the solver's own light after an edit.
constexpr double kPresentable = 0.5;
/// So many may wait for the pages that single texels are read from.
constexpr std::size_t kMostAwaited = 1024;

}  // namespace

void SolveLoop::sceneText(Callback<SceneText> done) {
  askLit<SceneText>(
      std::move(done),
      [this]() -> Result<SceneText> {
        return SceneText{revision_,
                         lit_->document().gltf.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace)};
      },
      CommandQueue::Kind::kPrompt);
}

/// Who asks while others are still being sent the same shares it with them: a copy for everyone could fill the machine.
Result<SharedBytes> SolveLoop::makeGlb() {
  const std::pair here(publisher_.layout(), revision_);
  if (auto known = glb_.lock(); known != nullptr && glb_of_ == here) return known;
  const auto lit = scene::withLightmapUvs(lit_->document(), lit_->scene(), lit_->patches());
  if (!lit) return tl::unexpected<Error>(lit.error());
  auto glb = scene::writeGlb(*lit);
  if (!glb) return tl::unexpected<Error>(glb.error());
  auto made = std::make_shared<const Bytes>(std::move(*glb));
  glb_ = made;
  glb_of_ = here;
  return made;
}

void SolveLoop::sceneGlb(std::optional<std::uint64_t> layout, Callback<SharedBytes> done) {
  askLit<SharedBytes>(std::move(done), [this, layout]() -> Result<SharedBytes> {
    if (layout && *layout != publisher_.layout())
      return fail(
          ErrorCode::kStaleRevision,
          fmt::format("the lightmaps have another layout, {}: what the newest `lightmaps` names is to be fetched",
                      publisher_.layout()),
          fmt::format("?layout={}", *layout));
    return makeGlb();
  });
}

Result<SharedBytes> SolveLoop::makeUnlit() {
  // What the eye would see: colours and lamps are on the pages, since the materials that showed them are gone. One
  // exposure for all pages.
  std::vector<Image> display;
  auto radiosity = makePages(*lit_, Quantity::kRadiosity);
  for (auto& page : radiosity.values) display.push_back(std::move(page.irradiance));
  for (auto& image : display) {
    for (auto& pixel : image.pixels) pixel *= static_cast<float>(1.0 / 3.14159265358979);
  }
  Image all;
  for (const auto& image : display) all.pixels.insert(all.pixels.end(), image.pixels.begin(), image.pixels.end());
  const float exposure = autoExposure(all);
  for (auto& image : display) image = toneMap(image, exposure);
  auto bytes = scene::writeUnlitGlb(lit_->document(), lit_->scene(), lit_->patches(), display);
  if (!bytes) return tl::unexpected<Error>(bytes.error());
  return std::make_shared<const Bytes>(std::move(*bytes));
}

void SolveLoop::unlitGlb(Callback<SharedBytes> done) {
  askLit<SharedBytes>(std::move(done), [this] { return makeUnlit(); });
}

Result<SharedBytes> SolveLoop::makeExr(std::uint32_t page, Quantity quantity) {
  const auto pages = makePages(*lit_, quantity);
  if (page >= pages.size()) {
    return fail(ErrorCode::kNotFound, "there is no lightmap page " + std::to_string(page) + " (there are " +
                                          std::to_string(pages.size()) + ")");
  }
  auto bytes = holdsIds(quantity) ? encodeExr(pages.ids[page], quantity)
                                  : encodeExr(shown(pages, pages.values[page].irradiance), quantity);
  if (!bytes) return tl::unexpected<Error>(bytes.error());
  return std::make_shared<const Bytes>(std::move(*bytes));
}

void SolveLoop::lightmapExr(std::uint32_t page, Quantity quantity, Callback<SharedBytes> done) {
  askLit<SharedBytes>(std::move(done), [this, page, quantity] { return makeExr(page, quantity); });
}

namespace {

struct SnapshotQuantity {
  gpu::ViewQuantity view;
  Quantity pages;
  bool photometric;  ///< exposed and tone-mapped
};

/// Unshot radiosity is looked at as irradiance is: both are lumens per square metre on the page.
const std::map<std::string, SnapshotQuantity>& snapshotQuantities() {
  static const std::map<std::string, SnapshotQuantity> kAll = {
      {"lit", {gpu::ViewQuantity::kLit, Quantity::kIrradiance, true}},
      {"irradiance", {gpu::ViewQuantity::kIrradiance, Quantity::kIrradiance, true}},
      {"radiosity", {gpu::ViewQuantity::kRadiosity, Quantity::kIrradiance, true}},
      {"unshot", {gpu::ViewQuantity::kIrradiance, Quantity::kUnshot, true}},
      {"error", {gpu::ViewQuantity::kError, Quantity::kError, false}},
      {"patchId", {gpu::ViewQuantity::kPatchId, Quantity::kIrradiance, false}},
      {"mipLevel", {gpu::ViewQuantity::kMipLevel, Quantity::kMipLevel, false}},
      {"normal", {gpu::ViewQuantity::kNormal, Quantity::kIrradiance, false}}};
  return kAll;
}

/// Pages as the view renderer takes them; where there is no number it draws 0.
std::vector<Image> pageImages(QuantityPages pages) {
  std::vector<Image> images;
  for (auto& page : pages.values) images.push_back(shown(pages, std::move(page.irradiance)));
  for (const auto& page : pages.ids) {
    auto& image = images.emplace_back(page.width, page.height);
    for (std::size_t i = 0; i < page.ids.size(); ++i)
      image.pixels[i] = glm::vec3(page.ids[i] == kNoId ? 0.0F : static_cast<float>(page.ids[i]));
  }
  return images;
}

/// A driver that resets the card takes the context away at any time: then once more, on a new one.
Result<Image> draw(std::unique_ptr<gpu::ViewRenderer>& renderer, const LitScene& lit, const std::vector<Image>& pages,
                   const gpu::ViewRequest& view) {
  const bool fresh = renderer == nullptr;
  if (fresh) {
    auto made = gpu::makeViewRenderer();
    if (!made) return tl::unexpected<Error>(made.error());
    renderer = std::move(*made);
  }
  auto image = renderer->render(lit.scene(), lit.patches(), pages, view);
  if (image) return image;
  renderer.reset();
  const bool lost = image.error().code == ErrorCode::kUnavailable;
  return lost && !fresh ? draw(renderer, lit, pages, view) : image;
}

}  // namespace

Result<Snapshot> SolveLoop::renderSnapshot(const SnapshotRequest& request) {
  const auto found = snapshotQuantities().find(request.quantity);
  if (found == snapshotQuantities().end())
    return fail(ErrorCode::kBadUsage, "no quantity \"" + request.quantity + "\"", "quantity");
  const auto& quantity = found->second;
  gpu::ViewRequest view;
  auto camera = chooseCamera(*lit_, request.camera, static_cast<double>(request.width) / request.height);
  if (!camera) return tl::unexpected<Error>(camera.error());
  view.camera = *camera;
  view.width = request.width;
  view.height = request.height;
  view.quantity = quantity.view;
  // Nobody wants a picture of the dark after an edit; but what was waited for must not have a ghost of the old light.
  const bool dark = quantity.pages == Quantity::kIrradiance && lit_->solver().error().total > kPresentable;
  const auto pages =
      dark ? pageImages({quantity.pages, lit_->shownPages(), {}, false}) : pageImages(makePages(*lit_, quantity.pages));
  const auto image = draw(view_, *lit_, pages, view);
  if (!image) return tl::unexpected<Error>(image.error());
  std::optional<double> exposure;
  if (quantity.photometric) exposure = request.exposure ? *request.exposure : autoExposure(*image);
  auto png = encodePng(exposure ? dithered(toneMap(*image, static_cast<float>(*exposure))) : *image);
  if (!png) return tl::unexpected<Error>(png.error());
  return Snapshot{std::make_shared<const Bytes>(std::move(*png)), exposure};
}

void SolveLoop::snapshot(SnapshotRequest request, Callback<Snapshot> done) {
  askLit<Snapshot>(std::move(done), [this, request = std::move(request)] { return renderSnapshot(request); });
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
  if (!queue_.push(look)) (*answer)(tooMany());
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
