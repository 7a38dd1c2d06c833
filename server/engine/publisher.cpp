#include "server/engine/publisher.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>

namespace radiosity::engine {
namespace {

/// A half float holds 11 significant bits: smaller changes would be sent for nothing.
constexpr float kQuantum = 0x1p-11F;

struct TileGrid {
  int columns, rows;
};

TileGrid tileGrid(const Image& mip) {
  const int size = static_cast<int>(kTileSize);
  return {(mip.width + size - 1) / size, (mip.height + size - 1) / size};
}

struct Change {
  float mean = 0.0F, largest = 0.0F;
};

/// Relative change of a tile's texels, mean and largest.
Change tileChange(const Image& before, const Image& after, int tile_x, int tile_y) {
  const int size = static_cast<int>(kTileSize);
  const int x_end = std::min((tile_x + 1) * size, after.width), y_end = std::min((tile_y + 1) * size, after.height);
  Change change;
  int count = 0;
  for (int y = tile_y * size; y < y_end; ++y) {
    for (int x = tile_x * size; x < x_end; ++x) {
      const glm::vec3 difference = glm::abs(after.at(x, y) - before.at(x, y));
      const glm::vec3 level = glm::max(after.at(x, y), before.at(x, y));
      const float top = std::max({level.x, level.y, level.z});
      const float relative = top > 0.0F ? std::max({difference.x, difference.y, difference.z}) / top : 0.0F;
      change.mean += relative;
      change.largest = std::max(change.largest, relative);
      ++count;
    }
  }
  change.mean /= static_cast<float>(std::max(count, 1));
  return change;
}

}  // namespace

std::shared_ptr<const PageSnapshot> Publisher::snapshot(const scene::LightmapPage& page,
                                                        const PageSnapshot* before) const {
  auto made = std::make_shared<PageSnapshot>();
  scene::LightmapPage mip = page;
  while (true) {
    made->mips.push_back(mip.irradiance);
    if (mip.irradiance.width == 1 && mip.irradiance.height == 1) break;
    mip = scene::coarserMip(mip);
  }
  for (std::size_t level = 0; level < made->mips.size(); ++level) {
    const Image& image = made->mips[level];
    const auto [columns, rows] = tileGrid(image);
    std::vector<std::uint64_t> versions(static_cast<std::size_t>(columns * rows), version_);
    std::vector<float> changes(versions.size(), 1.0F);
    for (int t = 0; before != nullptr && t < columns * rows; ++t) {
      const auto i = static_cast<std::size_t>(t);
      const Change change = tileChange(before->mips[level], image, t % columns, t / columns);
      if (change.largest < kQuantum) {
        versions[i] = before->tile_version[level][i];
        changes[i] = before->tile_change[level][i];
        // Keep what was sent, so that many small changes cannot add up unseen.
        const int size = static_cast<int>(kTileSize), x0 = t % columns * size, y0 = t / columns * size;
        for (int y = y0; y < std::min(y0 + size, image.height); ++y) {
          const auto row = before->mips[level].pixels.begin() + static_cast<std::ptrdiff_t>(image.index(x0, y));
          std::copy_n(row, std::min(size, image.width - x0),
                      made->mips[level].pixels.begin() + static_cast<std::ptrdiff_t>(image.index(x0, y)));
        }
      } else {
        changes[i] = change.mean;
      }
    }
    made->tile_version.push_back(std::move(versions));
    made->tile_change.push_back(std::move(changes));
  }
  return made;
}

std::shared_ptr<const Lightmaps> Publisher::publish(const std::vector<scene::LightmapPage>& pages, const Status& status,
                                                    bool final) {
  ++version_;
  auto lightmaps = std::make_shared<Lightmaps>();
  for (std::size_t p = 0; p < pages.size(); ++p) {
    const PageSnapshot* before = p < pages_.size() ? pages_[p].get() : nullptr;
    lightmaps->pages.push_back(snapshot(pages[p], before));
    for (const auto& mip : lightmaps->pages.back()->tile_version) {
      for (const auto version : mip) ++(version == version_ ? tiles_.changed : tiles_.unchanged);
    }
  }
  pages_ = lightmaps->pages;
  lightmaps->layout = layout_;
  lightmaps->revision = status.revision;
  lightmaps->tile_version = version_;
  lightmaps->shots = static_cast<std::uint32_t>(status.shots);
  lightmaps->error = static_cast<float>(status.error.total);
  lightmaps->final = final;
  return lightmaps;
}

}  // namespace radiosity::engine
