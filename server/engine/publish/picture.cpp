#include "server/engine/publish/picture.h"

#include <map>
#include <string>
#include <utility>

#include "common/task.h"
#include "server/engine/publish/exports.h"
#include "server/engine/publish/framing.h"
#include "server/gpu/picture/view_sky.h"

namespace radiosity::engine {
namespace {

/// Stated error from which on a snapshot shows the solver's own light after an edit.
constexpr double kPresentable = 0.5;

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

/// A driver that resets the card takes the context away at any time: then once more, on a new one.
Result<gpu::ViewPicture> draw(std::unique_ptr<gpu::ViewRenderer>& renderer, const PictureParts& parts,
                              const std::vector<Image>& pages, const gpu::ViewRequest& view) {
  const bool fresh = renderer == nullptr;
  if (fresh) {
    auto made = gpu::makeViewRenderer();
    if (!made) return tl::unexpected<Error>(made.error());
    renderer = std::move(*made);
  }
  auto picture = renderer->render(*parts.scene, *parts.patches, pages, view);
  if (picture) return picture;
  renderer.reset();
  const bool lost = picture.error().code == ErrorCode::kUnavailable;
  return lost && !fresh ? draw(renderer, parts, pages, view) : picture;
}

/// The irradiance by which a camera is found; `pages` where they hold it.
scene::Camera findCamera(const PictureParts& parts, const std::vector<Image>& pages, double aspect) {
  if (!parts.light) return frameScene(*parts.scene, *parts.patches, pages, aspect);
  const auto lit = pageImages(assemble(*parts.patches, *parts.light));
  return frameScene(*parts.scene, *parts.patches, lit, aspect);
}

}  // namespace

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

Result<PictureParts> readPicture(LitScene& lit, const SnapshotRequest& request) {
  const auto found = snapshotQuantities().find(request.quantity);
  if (found == snapshotQuantities().end())
    return fail(ErrorCode::kBadUsage, "no quantity \"" + request.quantity + "\"", "quantity");
  auto camera = chooseCamera(lit.scene(), request.camera);
  if (!camera) return tl::unexpected<Error>(camera.error());
  const auto quantity = found->second.pages;
  PictureParts parts{lit.sharedScene(), lit.sharedPatches(), lit.sky(),   *camera, {},
                     std::nullopt,      std::nullopt,        std::nullopt};
  // Nobody wants a picture of the dark after an edit; but what was waited for must not have a ghost of the old light.
  const bool dark = quantity == Quantity::kIrradiance && lit.solver().error().total > kPresentable;
  if (dark && !lit.showsOwnLight()) {
    parts.values.quantity = quantity;
    parts.faded = lit.shownPages();
  } else {
    parts.values = readQuantity(lit, quantity);
    if (found->second.view == gpu::ViewQuantity::kLit && lit.materials().specular.sideCount() > 0)
      parts.mirrors = MirrorScene{parts.patches, lit.materials(), lit.solver().irradiance(), lit.sky()};
  }
  if (!*camera && (quantity != Quantity::kIrradiance || parts.faded))
    parts.light = readQuantity(lit, Quantity::kIrradiance);
  return parts;
}

Result<Snapshot> makePicture(std::unique_ptr<gpu::ViewRenderer>& renderer, PictureParts parts,
                             const SnapshotRequest& request) {
  const auto& quantity = snapshotQuantities().at(request.quantity);
  auto light = parts.faded ? QuantityPages{quantity.pages, std::move(*parts.faded), {}, false}
                           : assemble(*parts.patches, std::move(parts.values));
  const auto pages = pageImages(std::move(light));
  gpu::ViewRequest view;
  view.camera =
      parts.camera ? *parts.camera : findCamera(parts, pages, static_cast<double>(request.width) / request.height);
  view.width = request.width;
  view.height = request.height;
  view.quantity = quantity.view;
  auto picture = draw(renderer, parts, pages, view);
  if (!picture) return tl::unexpected<Error>(picture.error());
  if (parts.mirrors) addMirrors(*picture, view.camera, *parts.mirrors);
  // By the surfaces alone: a sky behind a small window is brighter than all of the room.
  std::optional<float> of_surfaces;
  if (quantity.photometric && !request.exposure) of_surfaces = exposureOf(picture->image);
  if (quantity.view == gpu::ViewQuantity::kLit) gpu::addSky(*picture, view.camera, parts.sky);
  std::optional<double> exposure;
  if (quantity.photometric)
    exposure = request.exposure ? *request.exposure : of_surfaces ? *of_surfaces : autoExposure(picture->image);
  const auto& image = picture->image;
  auto png = encodePng(exposure ? dithered(toneMap(image, static_cast<float>(*exposure))) : image);
  return Snapshot{std::make_shared<const Bytes>(std::move(png)), exposure};
}

}  // namespace radiosity::engine
