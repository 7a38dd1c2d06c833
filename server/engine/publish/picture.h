// Pictures of the lit scene as PNG: what the solver has at one moment is read on the solve thread, and the picture made
// of it on another, beside the solve and the edits.
#pragma once

#include <memory>
#include <optional>
#include <vector>

#include "common/result.h"
#include "server/engine/engine.h"
#include "server/engine/lit/lit_scene.h"
#include "server/engine/publish/mirror_view.h"
#include "server/engine/publish/quantity_pages.h"
#include "server/gpu/picture/view_renderer.h"
#include "server/scene/values/scene.h"

namespace radiosity::engine {

/// All that a picture is made of; nothing in it changes any more.
struct PictureParts {
  std::shared_ptr<const scene::Scene> scene;
  std::shared_ptr<const scene::PatchScene> patches;
  scene::Sky sky;
  std::optional<scene::Camera> camera;                    ///< none: one is to be found that frames the scene
  QuantityValues values;                                  ///< of what the picture shows
  std::optional<std::vector<scene::LightmapPage>> faded;  ///< in the place of `values`: light from before an edit
  std::optional<MirrorScene> mirrors;                     ///< where the picture shows some
  std::optional<QuantityValues> light;                    ///< for finding a camera, where `values` are not irradiance
};

/// Solve thread; costs a pass over the leaves. kBadUsage: no such quantity; kNotFound: no such camera.
[[nodiscard]] Result<PictureParts> readPicture(LitScene& lit, const SnapshotRequest& request);

/// One thread, always the same: that of `renderer`, which is made where there is none. Takes seconds for large
/// pictures, with interruption points.
[[nodiscard]] Result<Snapshot> makePicture(std::unique_ptr<gpu::ViewRenderer>& renderer, PictureParts parts,
                                           const SnapshotRequest& request);

/// The pages of any quantity as images of numbers; where there is no number it is 0. Any thread.
[[nodiscard]] std::vector<Image> pageImages(QuantityPages pages);

}  // namespace radiosity::engine
