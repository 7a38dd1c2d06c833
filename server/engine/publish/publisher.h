// Turns finished pages into what viewers see: mip chains with a version and a change for every tile. Solve thread only.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <vector>

#include "server/engine/engine.h"
#include "server/engine/publish/quantity_pages.h"

namespace radiosity::engine {

class Publisher {
 public:
  /// Versions and layouts go on above `version`; before anything is published.
  void startAbove(std::uint64_t version) { layout_ = version_ = layout_since_ = version; }

  /// Forgets all tiles: the layout of the pages is new.
  void reset();

  /// The light has changed since the present version: what is published from now on is another. One version holds
  /// every quantity.
  void startVersion() { ++version_; }

  /// The present version of these pages; tiles that changed by less than a half-float quantum since the quantity was
  /// last published keep their version.
  [[nodiscard]] std::shared_ptr<const Lightmaps> publish(QuantityPages pages, const Status& status, bool final);

  /// What was published of the quantity last; nothing after reset() or forget().
  [[nodiscard]] const std::shared_ptr<const Lightmaps>& latest(Quantity quantity) const {
    return latest_[static_cast<std::size_t>(quantity)];
  }
  void forget(Quantity quantity) { latest_[static_cast<std::size_t>(quantity)].reset(); }

  [[nodiscard]] std::uint64_t version() const { return version_; }
  [[nodiscard]] std::uint64_t layout() const { return layout_; }
  [[nodiscard]] std::uint64_t layoutSince() const { return layout_since_; }

  /// Tiles of all publications, of all mips: those with a new version, and those that changed by less than a quantum
  /// and need not be sent again.
  struct TileCounters {
    std::uint64_t changed = 0, unchanged = 0;
  };
  [[nodiscard]] const TileCounters& tileCounters() const { return tiles_; }

 private:
  [[nodiscard]] std::shared_ptr<const PageSnapshot> snapshot(QuantityPages& pages, std::size_t page,
                                                             const PageSnapshot* before) const;

  std::uint64_t layout_ = 0, version_ = 0, layout_since_ = 0;
  TileCounters tiles_;
  std::array<std::shared_ptr<const Lightmaps>, kQuantityCount> latest_;
};

}  // namespace radiosity::engine
