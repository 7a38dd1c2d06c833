#include "server/engine/publish/publisher.h"

#include <algorithm>
#include <cmath>
#include <glm/common.hpp>
#include <utility>

namespace radiosity::engine {
namespace {

/// A half float holds 11 significant bits: smaller changes would be sent for nothing.
constexpr float kQuantum = 0x1p-11F;

constexpr int kSide = static_cast<int>(kTileSize);

/// Texels of tile `t` of an image that is `size` large.
struct TileRect {
  TileRect(glm::ivec2 size, std::size_t t) {
    const int columns = (size.x + kSide - 1) / kSide;
    x0 = static_cast<int>(t) % columns * kSide;
    y0 = static_cast<int>(t) / columns * kSide;
    x1 = std::min(x0 + kSide, size.x);
    y1 = std::min(y0 + kSide, size.y);
  }
  int x0, y0, x1, y1;
};

std::size_t tileCount(glm::ivec2 size) {
  return static_cast<std::size_t>((size.x + kSide - 1) / kSide) *
         static_cast<std::size_t>((size.y + kSide - 1) / kSide);
}

struct Change {
  float mean = 0.0F, largest = 0.0F;
};

/// Relative change of a tile's texels, mean and largest.
Change tileChange(const Image& before, const Image& after, const TileRect& tile) {
  Change change;
  for (int y = tile.y0; y < tile.y1; ++y) {
    for (int x = tile.x0; x < tile.x1; ++x) {
      const glm::vec3 difference = glm::abs(after.at(x, y) - before.at(x, y));
      const glm::vec3 level = glm::max(glm::abs(after.at(x, y)), glm::abs(before.at(x, y)));
      const float top = std::max({level.x, level.y, level.z});
      const float relative = top > 0.0F ? std::max({difference.x, difference.y, difference.z}) / top : 0.0F;
      change.mean += relative;
      change.largest = std::max(change.largest, relative);
    }
  }
  change.mean /= static_cast<float>((tile.x1 - tile.x0) * (tile.y1 - tile.y0));
  return change;
}

/// A number is the same or it is not.
Change tileChange(const IdImage& before, const IdImage& after, const TileRect& tile) {
  Change change;
  for (int y = tile.y0; y < tile.y1; ++y) {
    for (int x = tile.x0; x < tile.x1; ++x) {
      const auto i = static_cast<std::size_t>(y) * static_cast<std::size_t>(after.width) + static_cast<std::size_t>(x);
      if (before.ids[i] == after.ids[i]) continue;
      change.mean += 1.0F;
      change.largest = 1.0F;
    }
  }
  change.mean /= static_cast<float>((tile.x1 - tile.x0) * (tile.y1 - tile.y0));
  return change;
}

void copyTile(const Image& from, const TileRect& tile, Image& to) {
  for (int y = tile.y0; y < tile.y1; ++y) std::copy_n(&from.at(tile.x0, y), tile.x1 - tile.x0, &to.at(tile.x0, y));
}
void copyTile(const IdImage& /*those that did not change at all*/, const TileRect& /*tile*/, IdImage& /*to*/) {}

/// Leaves the page empty: of many texels a copy is worth leaving out.
std::vector<Image> valueMips(QuantityPages& pages, std::size_t page) {
  std::vector<Image> mips;
  scene::LightmapPage mip = std::move(pages.values[page]);
  while (true) {
    const bool last = mip.irradiance.width == 1 && mip.irradiance.height == 1;
    auto coarser = last ? scene::LightmapPage{} : scene::coarserMip(mip);
    mips.push_back(shown(pages, std::move(mip.irradiance)));
    if (last) return mips;
    mip = std::move(coarser);
  }
}

IdImage coarser(const IdImage& fine) {
  IdImage coarse{(fine.width + 1) / 2, (fine.height + 1) / 2, {}};
  for (int y = 0; y < coarse.height; ++y) {
    for (int x = 0; x < coarse.width; ++x) {
      std::uint32_t id = kNoId;
      for (int k = 0; k < 4 && id == kNoId; ++k) {
        const int fx = 2 * x + k % 2, fy = 2 * y + k / 2;
        if (fx < fine.width && fy < fine.height)
          id = fine.ids[static_cast<std::size_t>(fy) * static_cast<std::size_t>(fine.width) +
                        static_cast<std::size_t>(fx)];
      }
      coarse.ids.push_back(id);
    }
  }
  return coarse;
}

std::vector<IdImage> idMips(const IdImage& page) {
  std::vector<IdImage> mips{page};
  while (mips.back().width > 1 || mips.back().height > 1) mips.push_back(coarser(mips.back()));
  return mips;
}

/// Which tiles of one mip are new. `now` keeps what was sent of the others, so that many small changes cannot add up
/// unseen.
template <typename Mip>
void compare(const PageSnapshot* before, const std::vector<Mip> PageSnapshot::*mips, std::size_t level,
             std::uint64_t version, PageSnapshot& made, Mip& now) {
  const auto tiles = tileCount(made.size(level));
  std::vector<std::uint64_t> versions(tiles, version);
  std::vector<float> changes(tiles, 1.0F);
  for (std::size_t t = 0; before != nullptr && t < tiles; ++t) {
    const TileRect tile(made.size(level), t);
    const Mip& then = (before->*mips)[level];
    const Change change = tileChange(then, now, tile);
    if (change.largest < kQuantum) {
      versions[t] = before->tile_version[level][t];
      changes[t] = before->tile_change[level][t];
      copyTile(then, tile, now);
    } else {
      changes[t] = change.mean;
    }
  }
  made.tile_version.push_back(std::move(versions));
  made.tile_change.push_back(std::move(changes));
}

}  // namespace

void Publisher::reset() {
  ++layout_;
  layout_since_ = version_ + 1;
  for (auto& lightmaps : latest_) lightmaps.reset();
}

std::shared_ptr<const PageSnapshot> Publisher::snapshot(QuantityPages& pages, std::size_t page,
                                                        const PageSnapshot* before) const {
  auto made = std::make_shared<PageSnapshot>();
  if (holdsIds(pages.quantity)) {
    made->id_mips = idMips(pages.ids[page]);
  } else {
    made->mips = valueMips(pages, page);
  }
  for (std::size_t level = 0; level < made->mipCount(); ++level) {
    if (holdsIds(pages.quantity)) {
      compare(before, &PageSnapshot::id_mips, level, version_, *made, made->id_mips[level]);
    } else {
      compare(before, &PageSnapshot::mips, level, version_, *made, made->mips[level]);
    }
  }
  return made;
}

std::shared_ptr<const Lightmaps> Publisher::publish(QuantityPages pages, const Status& status, bool final) {
  auto& latest = latest_[static_cast<std::size_t>(pages.quantity)];
  auto lightmaps = std::make_shared<Lightmaps>();
  for (std::size_t p = 0; p < pages.size(); ++p) {
    lightmaps->pages.push_back(snapshot(pages, p, latest ? latest->pages[p].get() : nullptr));
    for (const auto& mip : lightmaps->pages.back()->tile_version) {
      for (const auto version : mip) ++(version == version_ ? tiles_.changed : tiles_.unchanged);
    }
  }
  lightmaps->quantity = pages.quantity;
  lightmaps->layout = layout_;
  lightmaps->revision = status.revision;
  lightmaps->tile_version = version_;
  lightmaps->shots = static_cast<std::uint32_t>(status.shots);
  lightmaps->error = static_cast<float>(status.error.total);
  lightmaps->final = final;
  latest = std::move(lightmaps);
  return latest;
}

}  // namespace radiosity::engine
