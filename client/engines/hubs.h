// Lightmaps as Hubs reads them: images of the GLB (MOZ_texture_rgbe) that materials name (MOZ_lightmap).
#pragma once

#include <cstddef>

#include "client/engines/encode.h"
#include "client/engines/lit_scene.h"

namespace radiosity::engines {

/// Refers to a scene, which is to outlive it.
class HubsPages {
 public:
  /// `exposure`: what luminances are multiplied by, since Hubs does not expose: it shows 1 as white.
  HubsPages(Json& gltf, Bytes& bin, double exposure) : gltf_(gltf), bin_(bin), exposure_(exposure) {}

  /// Appends a page to the scene, for the materials whose "extras" name it.
  void add(std::size_t page, const EncodedPage& encoded);

 private:
  std::size_t addTexture(const Bytes& bytes);

  Json& gltf_;
  Bytes& bin_;
  double exposure_;
};

}  // namespace radiosity::engines
