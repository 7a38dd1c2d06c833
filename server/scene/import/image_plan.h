// At what size the pictures of a document are held: together they take no more memory than they may. Read from their
// headers, before any is decoded. Pure function of a value; any thread.
#pragma once

#include <cstdint>
#include <vector>

#include "server/scene/document/document.h"
#include "server/scene/import/import_model.h"

namespace radiosity::scene {

struct ImagePlan {
  /// By image: how often its width and height are halved; 0 for those that no material uses, or whose header cannot be
  /// read.
  std::vector<std::uint8_t> halvings;
  std::uint64_t bytes = 0;           ///< that all take, so halved
  std::uint64_t largest_pixels = 0;  ///< of the file's
  std::uint32_t halved = 0;          ///< how many are
  bool two_at_once = false;          ///< of those that are halved: there is room for two decoders
};

/// The largest first, as long as they take more than this together: 32 pictures of 2048 x 2048, more than a lightmap
/// of a million texels can tell apart.
inline constexpr std::uint64_t kMostImageBytes = std::uint64_t{512} << 20;

/// kTooLarge, naming the image: one has more pixels than it may, or all together have. `claimed`: what the rest of the
/// scene takes. O(bytes of headers + images log images).
[[nodiscard]] Result<ImagePlan> planImages(const Document& document, std::uint64_t claimed, const ImportLimits& limits);

}  // namespace radiosity::scene
