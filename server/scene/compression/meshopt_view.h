// A compressed buffer view (EXT_meshopt_compression, KHR_meshopt_compression) to the bytes that it stands for. Pure;
// any thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>

#include "common/bytes.h"
#include "common/result.h"

namespace radiosity::scene {

/// Members of the extension's object.
struct MeshoptView {
  std::string mode, filter = "NONE";
  std::size_t count = 0, stride = 0;

  [[nodiscard]] std::size_t bytes() const { return count * stride; }
};

/// The rules that the extension has for these members. kUnsupported names a filter that our version of the library does
/// not know. `where`: of the extension's object.
[[nodiscard]] Result<void> checkMeshopt(const MeshoptView& view, const std::string& where);

/// MeshoptView::bytes() of them, for a view that was checked. kUnsupported: a later version of the codec. O(bytes).
[[nodiscard]] Result<Bytes> decodeMeshopt(std::span<const std::uint8_t> stream, const MeshoptView& view,
                                          const std::string& where);

}  // namespace radiosity::scene
