// The sky as options give it, in a scene file before it travels, and as an edit of a server's scene.
#pragma once

#include <CLI/CLI.hpp>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "common/result.h"
#include "protocol/sky.h"

namespace radiosity::cli {

using Json = nlohmann::json;

struct SkyOptions {
  std::string sky;                 ///< nits, a file, or the name of a model; empty: none
  std::optional<double> rotation;  ///< degrees
  std::optional<double> strength;
  std::string sun;                  ///< TIME@LATITUDE,LONGITUDE; empty: none
  std::optional<double> sun_angle;  ///< degrees
  std::optional<double> turbidity;
};
void addSkyOptions(CLI::App& command, SkyOptions& options);

/// What they come to: colours, which are a setting of solves, or a sky of the scene.
struct SkyChoice {
  std::optional<protocol::Sky> colours;
  Json sky;             ///< /extras/radiositySky but for its picture; null: the scene's own
  std::string picture;  ///< path; empty: none

  [[nodiscard]] bool isOfScene() const { return !sky.is_null(); }
};
/// kBadUsage, naming the option: it is wrong, does not go with another, or there is no such file.
[[nodiscard]] Result<SkyChoice> skyChoice(const SkyOptions& options);

/// A scene file with this sky, and its picture, in it: a GLB, or the text of a .gltf with all its files in it.
struct SceneBytes {
  std::string bytes;
  bool is_glb = false;
};
[[nodiscard]] Result<SceneBytes> withSky(const std::string& scene_path, const SkyChoice& choice);

/// Bytes of the picture; empty where there is none.
[[nodiscard]] Result<std::string> readPicture(const SkyChoice& choice);
/// Turns the scene's own picture or daylight, or makes it as strong, by those options alone. kBadUsage: it has none.
[[nodiscard]] Result<Json> skyTurnPatch(const Json& gltf, const SkyOptions& options);
/// An edit of a scene; `uri`: of the uploaded picture, which has so many bytes.
[[nodiscard]] Json skyPatch(const Json& gltf, const SkyChoice& choice, const std::string& uri, std::size_t bytes);

}  // namespace radiosity::cli
