// Which of a file's vertex normals can be shaded with. Pure; any thread.
#pragma once

#include <cstdint>
#include <string>

#include "server/scene/values/scene.h"

namespace radiosity::scene {

struct NormalFaults {
  std::uint32_t missing = 0;  ///< the file has fewer normals than vertices
  std::uint32_t broken = 0;   ///< no length, or no number
  std::uint32_t opposite = 0;

  [[nodiscard]] std::uint32_t count() const { return missing + broken + opposite; }
  /// "3 of 8 normals ...", for a warning.
  [[nodiscard]] std::string text(std::size_t of) const;
};

/// Makes what was read as Primitive::normals what scene.h promises: unit length, or 0 where the normal is missing,
/// broken, or points to the back of the triangles that use it, weighted by area (a sliver's facing is rounding).
/// Normals that all stand upright on their triangles say no more than "flat", so the list is then emptied; so it is
/// where none is usable. Vertices without a triangle are not counted. Needs the positions and indices.
NormalFaults settleNormals(Primitive& primitive);

}  // namespace radiosity::scene
