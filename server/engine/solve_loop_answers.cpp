// What can be fetched from the solve thread: the document, files in memory, pictures.
#include <map>
#include <utility>

#include "server/engine/exports.h"
#include "server/engine/framing.h"
#include "server/engine/solve_loop_class.h"
#include "server/scene/lightmap.h"

namespace radiosity::engine {
namespace {

/// Stated error from which on a snapshot shows the solver's own light after an edit.
constexpr double kPresentable = 0.5;

}  // namespace

void SolveLoop::sceneText(Callback<SceneText> done) {
  askLit<SceneText>(std::move(done), [this]() -> Result<SceneText> {
    return SceneText{revision_, lit_->document().gltf.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace)};
  });
}

void SolveLoop::sceneGlb(Callback<SharedBytes> done) {
  askLit<SharedBytes>(std::move(done), [this]() -> Result<SharedBytes> {
    const auto lit = scene::withLightmapUvs(lit_->document(), lit_->scene(), lit_->patches());
    if (!lit) return tl::unexpected<Error>(lit.error());
    return std::make_shared<const Bytes>(scene::writeGlb(*lit));
  });
}

Result<SharedBytes> SolveLoop::makeUnlit() {
  // One exposure for all pages, from the radiance that the eye would see.
  std::vector<Image> display;
  for (const auto& page : lit_->pages()) display.push_back(page.irradiance);
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

Result<SharedBytes> SolveLoop::makeExr(std::uint32_t page) {
  const auto pages = lit_->pages();
  if (page >= pages.size()) {
    return fail(ErrorCode::kNotFound, "there is no lightmap page " + std::to_string(page) + " (there are " +
                                          std::to_string(pages.size()) + ")");
  }
  auto bytes = encodeExr(pages[page].irradiance);
  if (!bytes) return tl::unexpected<Error>(bytes.error());
  return std::make_shared<const Bytes>(std::move(*bytes));
}

void SolveLoop::lightmapExr(std::uint32_t page, Callback<SharedBytes> done) {
  askLit<SharedBytes>(std::move(done), [this, page] { return makeExr(page); });
}

Result<SharedBytes> SolveLoop::renderSnapshot(const SnapshotRequest& request) {
  static const std::map<std::string, gpu::ViewQuantity> kQuantities = {{"lit", gpu::ViewQuantity::kLit},
                                                                       {"irradiance", gpu::ViewQuantity::kIrradiance},
                                                                       {"radiosity", gpu::ViewQuantity::kRadiosity},
                                                                       {"error", gpu::ViewQuantity::kError},
                                                                       {"patchId", gpu::ViewQuantity::kPatchId},
                                                                       {"mipLevel", gpu::ViewQuantity::kMipLevel},
                                                                       {"normal", gpu::ViewQuantity::kNormal}};
  const auto quantity = kQuantities.find(request.quantity);
  if (quantity == kQuantities.end())
    return fail(ErrorCode::kBadUsage, "no quantity \"" + request.quantity + "\"", "quantity");
  gpu::ViewRequest view;
  auto camera = chooseCamera(*lit_, request.camera, static_cast<double>(request.width) / request.height);
  if (!camera) return tl::unexpected<Error>(camera.error());
  view.camera = *camera;
  view.width = request.width;
  view.height = request.height;
  view.quantity = quantity->second;
  if (!view_) {
    auto made = gpu::makeViewRenderer();
    if (!made) return tl::unexpected<Error>(made.error());
    view_ = std::move(*made);
  }
  std::vector<Image> pages;
  if (quantity->second == gpu::ViewQuantity::kError) {
    for (auto& page : lit_->errorPages()) pages.push_back(std::move(page.irradiance));
  } else {
    // Nobody wants a picture of the dark after an edit; but what was waited for must not have a ghost of the old light.
    const bool solved = lit_->solver().error().total <= kPresentable;
    for (auto& page : solved ? lit_->pages() : lit_->shownPages()) pages.push_back(std::move(page.irradiance));
  }
  const auto image = view_->render(lit_->scene(), lit_->patches(), pages, view);
  if (!image) return tl::unexpected<Error>(image.error());
  const bool photometric = quantity->second == gpu::ViewQuantity::kLit ||
                           quantity->second == gpu::ViewQuantity::kIrradiance ||
                           quantity->second == gpu::ViewQuantity::kRadiosity;
  auto png = encodePng(photometric ? toneMap(*image, autoExposure(*image)) : *image);
  if (!png) return tl::unexpected<Error>(png.error());
  return std::make_shared<const Bytes>(std::move(*png));
}

void SolveLoop::snapshot(SnapshotRequest request, Callback<SharedBytes> done) {
  askLit<SharedBytes>(std::move(done), [this, request = std::move(request)] { return renderSnapshot(request); });
}

}  // namespace radiosity::engine
