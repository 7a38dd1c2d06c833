// Turns finished pages into what viewers see: mip chains with a version and a change for every tile. Solve thread only.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "server/engine/engine.h"
#include "server/scene/lightmap.h"

namespace radiosity::engine {

class Publisher {
 public:
  /// Forgets all tiles: the layout of the pages is new.
  void reset() {
    ++layout_;
    pages_.clear();
  }

  /// A new version holding `pages`; tiles that changed by less than a half-float quantum keep their version.
  [[nodiscard]] std::shared_ptr<const Lightmaps> publish(const std::vector<scene::LightmapPage>& pages,
                                                         const Status& status, bool final);

  [[nodiscard]] std::uint64_t version() const { return version_; }

  /// Tiles of all publications, of all mips: those with a new version, and those that changed by less than a quantum
  /// and need not be sent again.
  struct TileCounters {
    std::uint64_t changed = 0, unchanged = 0;
  };
  [[nodiscard]] const TileCounters& tileCounters() const { return tiles_; }

 private:
  [[nodiscard]] std::shared_ptr<const PageSnapshot> snapshot(const scene::LightmapPage& page,
                                                             const PageSnapshot* before) const;

  std::uint64_t layout_ = 0, version_ = 0;
  TileCounters tiles_;
  std::vector<std::shared_ptr<const PageSnapshot>> pages_;
};

}  // namespace radiosity::engine
