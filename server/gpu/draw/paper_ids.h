// The composed IDs of Lum, Ma and Max 2002: a patch code that one mipmapped texture shared by all polygons holds (low
// bits), and a polygon code (high bits): twice the surface, plus one for its back. Plain values, any thread.
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "common/result.h"
#include "server/scene/values/patch_scene.h"

namespace radiosity::gpu {

class PaperIds {
 public:
  struct Layout {
    std::uint32_t size = 1, patch_bits = 0;
  };
  /// kTooLarge when a patch and a polygon do not fit into 32 bits together.
  [[nodiscard]] static Result<Layout> fits(const scene::PatchScene& patches);
  [[nodiscard]] static Result<PaperIds> create(std::shared_ptr<const scene::PatchScene> patches);

  /// The texture is size() x size(), a power of two that the largest chart fits.
  [[nodiscard]] std::uint32_t size() const { return size_; }
  [[nodiscard]] std::uint32_t levels() const { return levels_; }
  [[nodiscard]] std::uint32_t patchBits() const { return patch_bits_; }
  /// Texels of one level, row-major.
  [[nodiscard]] std::vector<std::uint32_t> level(std::uint32_t level) const;

  /// Composed ids to node ids, in place; `escaped` where nothing is seen, `escaped` + 1 for sides that only absorb.
  void decode(std::span<std::uint32_t> ids, std::uint32_t escaped) const;

 private:
  struct Patch {
    std::uint32_t level, x, y;
  };
  [[nodiscard]] std::uint32_t nodeOf(std::uint32_t id, std::uint32_t escaped) const;

  std::shared_ptr<const scene::PatchScene> patches_;
  std::uint32_t size_ = 1, levels_ = 1, patch_bits_ = 0;
  std::vector<std::uint32_t> level_start_;  ///< code of texel (0, 0) of each level
  std::vector<Patch> patch_;                ///< by code
};

}  // namespace radiosity::gpu
