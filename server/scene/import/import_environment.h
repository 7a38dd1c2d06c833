// Skies of extensions: EXT_lights_image_based and KHR_environment_map. Owned by one importScene call.
#pragma once

#include <optional>
#include <string>

#include "server/scene/import/import_context.h"

namespace radiosity::scene {

/// Where that of the scene that is shown lies: a pointer; nullopt: the scene names none. kInvalidScene: an index that
/// points nowhere.
[[nodiscard]] Result<std::optional<std::string>> environmentOf(const ImportContext& context);
/// Reads it as a picture in its place, its strength included: cubemaps of PNG (RGBD or plain) and JPEG, or KTX 2.0;
/// where a file has none that can be read, what its irradiance coefficients come from, with a warning. Cost: of the
/// pixels.
[[nodiscard]] Result<SkyImage> readEnvironment(ImportContext& context, const std::string& pointer);

}  // namespace radiosity::scene
