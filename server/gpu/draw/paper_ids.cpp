#include "server/gpu/draw/paper_ids.h"

#include <algorithm>
#include <bit>
#include <numeric>
#include <string>

#include "server/gpu/gl/shader_constants.h"

namespace radiosity::gpu {
namespace {

constexpr std::uint32_t kMaxTextureSize = 4096;

}  // namespace

Result<PaperIds::Layout> PaperIds::fits(const scene::PatchScene& patches) {
  std::uint32_t largest = 1;
  for (const auto& surface : patches.surfaces) largest = std::max({largest, surface.width, surface.height});
  const auto size = std::uint64_t{1} << static_cast<unsigned>(std::bit_width(largest - 1));
  std::uint64_t codes = 0;
  for (auto width = size; width > 0; width /= 2) codes += width * width;
  const auto bits = static_cast<std::uint32_t>(std::bit_width(codes - 1));
  // One polygon code stays free: all ones is the background.
  const auto polygons = 2 * static_cast<std::uint64_t>(patches.surfaces.size()) + 1;
  if (size > kMaxTextureSize || polygons > std::uint64_t{1} << (32U - bits)) {
    return fail(ErrorCode::kTooLarge, "paper mode has 32 bits for an ID, which " +
                                          std::to_string(patches.surfaces.size()) + " charts of up to " +
                                          std::to_string(largest) +
                                          " texels a side do not fit; use fewer texels or the default mode");
  }
  return Layout{static_cast<std::uint32_t>(size), bits};
}

Result<PaperIds> PaperIds::create(std::shared_ptr<const scene::PatchScene> patches) {
  const auto layout = fits(*patches);
  if (!layout) return tl::unexpected(layout.error());
  PaperIds ids;
  ids.size_ = layout->size;
  ids.patch_bits_ = layout->patch_bits;
  ids.levels_ = static_cast<std::uint32_t>(std::bit_width(ids.size_));
  for (std::uint32_t level = 0; level < ids.levels_; ++level) {
    ids.level_start_.push_back(static_cast<std::uint32_t>(ids.patch_.size()));
    const auto width = ids.size_ >> level;
    for (std::uint32_t i = 0; i < width * width; ++i) ids.patch_.push_back({level, i % width, i / width});
  }
  ids.patches_ = std::move(patches);
  return ids;
}

std::vector<std::uint32_t> PaperIds::level(std::uint32_t level) const {
  const auto width = size_ >> level;
  std::vector<std::uint32_t> texels(std::size_t{width} * width);
  std::iota(texels.begin(), texels.end(), level_start_[level]);
  return texels;
}

std::uint32_t PaperIds::nodeOf(std::uint32_t id, std::uint32_t escaped) const {
  if (id == RAD_ITEM_NONE) return escaped;
  const auto polygon = id >> patch_bits_;
  const auto& surface = patches_->surfaces[polygon / 2];
  const auto first = surface.first_node[polygon % 2];
  if (first == scene::kNone) return escaped + 1;
  // A small chart's pyramid ends before the texture's does; and a texel beyond its border belongs to the border.
  const auto& patch = patch_[id & ((1U << patch_bits_) - 1)];
  const auto level = std::min(patch.level, surface.level_count - 1);
  const auto shift = patch.level - level;
  const auto grid = scene::levelGrid(surface.width, surface.height, level);
  const auto x = std::min(patch.x << shift, grid.width - 1);
  const auto y = std::min(patch.y << shift, grid.height - 1);
  return first + grid.offset + y * grid.width + x;
}

void PaperIds::decode(std::span<std::uint32_t> ids, std::uint32_t escaped) const {
  std::uint32_t last = RAD_ITEM_NONE;
  std::uint32_t node = escaped;
  for (auto& id : ids) {
    if (id != last) {
      last = id;
      node = nodeOf(id, escaped);
    }
    id = node;
  }
}

}  // namespace radiosity::gpu
