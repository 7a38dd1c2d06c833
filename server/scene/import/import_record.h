// What importing a document leaves for importing it after an edit. Immutable once there; any thread.
#pragma once

#include <tiny_gltf.h>

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "common/bytes.h"
#include "server/scene/import/photometric_file.h"
#include "server/scene/values/scene.h"

namespace radiosity::scene {

struct DecodedImage {
  SharedList<Texture>::Element color;  ///< sRGB; null: not asked for
  SharedList<Texture>::Element data;   ///< linear; null: not asked for, or of no use (see there)
  std::optional<float> blue;           ///< 0 to 1: that which is the same all over
  float mean_green = 1.0F;             ///< 0 to 1, of `data`, or of what it would be
  SharedList<Texture>::Element mask;   ///< linear, of which red counts; null: not asked for, or the same all over
  std::optional<float> red;            ///< 0 to 1: that which is the same all over
  std::uint8_t halvings = 0;           ///< of width and height (ImagePlan)
};
/// By the bytes that they are decoded from, which so stay those of that image.
using DecodedImages = std::map<SharedBytes, DecodedImage>;

/// A photometric file, by where its bytes lie.
struct WebKey {
  SharedBytes buffer;
  std::size_t offset = 0, length = 0;

  auto operator<=>(const WebKey&) const = default;
};
struct ReadWeb {
  SharedWeb web;
  WebFrame frame = WebFrame::kC;
  std::vector<std::string> warnings;
};
using ReadWebs = std::map<WebKey, std::shared_ptr<const ReadWeb>>;

/// Of an extension: its JSON, and the document's images.
struct EnvironmentKey {
  std::string text;
  std::vector<SharedBytes> images;
  auto operator<=>(const EnvironmentKey&) const = default;
};

/// Pictures of skies, by where their bytes lie, and those of extensions and of daylight by what the document says.
struct ReadSkies {
  std::map<WebKey, SharedSkyPicture> pictures;
  std::map<EnvironmentKey, SharedSkyPicture> environments;
  std::map<std::string, SharedSkyPicture> daylights;
};

struct ImportRecord {
  std::shared_ptr<const tinygltf::Model> model;  ///< but for its materials, which change most often
  std::vector<tinygltf::Material> materials;
  DecodedImages images;              ///< that the materials use
  ReadWebs webs;                     ///< that the lights use
  ReadSkies skies;                   ///< that the sky uses
  std::uint64_t claimed_bytes = 0;   ///< of memory, by all but images
  std::set<std::string> extensions;  ///< that are used anywhere but in materials
  Scene scene;                       ///< shares what is large with the one that was imported
  /// Of its warnings, how many there were after each step.
  struct Warnings {
    std::size_t checks = 0, materials = 0, nodes = 0;
  } warnings;
};

}  // namespace radiosity::scene
