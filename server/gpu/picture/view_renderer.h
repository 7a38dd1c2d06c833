// Pictures of the lit scene (snapshots): rasterises the scene from a camera with its lightmaps. Own EGL context; used
// from the thread that made it only.
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "common/image.h"
#include "common/result.h"
#include "server/scene/values/patch_scene.h"
#include "server/scene/values/scene.h"

namespace radiosity::gpu {

enum class ViewQuantity { kLit, kIrradiance, kRadiosity, kError, kPatchId, kMipLevel, kNormal };

struct ViewRequest {
  scene::Camera camera;
  int width = 960, height = 720;
  ViewQuantity quantity = ViewQuantity::kLit;
};

struct ViewPicture {
  Image image;
  std::vector<float> cover;  ///< share of each pixel that surfaces cover
};

class ViewRenderer {
 public:
  virtual ~ViewRenderer() = default;
  /// Linear RGB radiance (nits) for kLit: albedo H / pi + L_e, 4x multisampled, back faces of single-sided surfaces not
  /// drawn (so that one sees into a room); other quantities in their own unit. Black where nothing covers a pixel.
  /// `pages`: irradiance, lux. Large pictures are drawn in tiles, with an interruption point before each.
  [[nodiscard]] virtual Result<ViewPicture> render(const scene::Scene& scene, const scene::PatchScene& patches,
                                                   std::span<const Image> pages, const ViewRequest& request) = 0;
};

[[nodiscard]] Result<std::unique_ptr<ViewRenderer>> makeViewRenderer();

}  // namespace radiosity::gpu
