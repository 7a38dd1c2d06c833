// Attributes of vertices that are made where faces are cut (wall_cuts.h), as their file stores such attributes. Pure
// functions of values; used by the exporter.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "server/scene/import/accessor.h"
#include "server/scene/import/import_model.h"
#include "server/scene/values/wall_cuts.h"

namespace radiosity::scene {

struct MadeElement {
  std::vector<std::uint8_t> bytes;  ///< elementBytes() long
  std::array<double, 4> stored{};   ///< what they say, integers as they are
};

/// Between the elements of the file's vertices, rounded to what the accessor can store; the nearest one's own where
/// elements are no vectors.
enum class MadeHow : std::uint8_t {
  kBetween,
  kUnitLength,  ///< its first three components are a direction
  kNearest,     ///< numbers of something have nothing between them
};
[[nodiscard]] MadeElement madeElement(const AccessorReader& reader, const tinygltf::Accessor& accessor,
                                      const MadeVertex& vertex, MadeHow how);

}  // namespace radiosity::scene
