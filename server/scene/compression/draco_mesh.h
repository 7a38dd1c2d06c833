// A Draco stream (KHR_draco_mesh_compression) to plain vertices and triangles. What the stream says of its size is held
// against what the file declared before anything of that size is made. Pure; any thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "common/bytes.h"
#include "common/result.h"

namespace radiosity::scene {

/// An attribute that is wanted, as its accessor declares it.
struct DracoAttribute {
  std::uint32_t id = 0;        ///< unique in the stream
  int component_type = 0;      ///< of glTF: 5120 to 5126
  std::size_t components = 0;  ///< 1 to 4
  std::string where;           ///< of the accessor, for messages
};

struct DracoRequest {
  std::vector<DracoAttribute> attributes;
  std::size_t points = 0;            ///< that each attribute has
  std::optional<std::size_t> faces;  ///< none: not declared
  std::uint64_t room = 0;            ///< bytes that decoding may take, its own working memory included
  std::uint64_t attribute_room = 0;  ///< likewise of attributes alone, whether anybody asks for them or not
  std::string where;                 ///< of the extension, for messages
};

struct DracoMesh {
  std::vector<std::uint32_t> corners;  ///< three a face, each below DracoRequest::points
  std::vector<Bytes> attributes;       ///< as asked for: elements one after the other, of the type declared
  std::uint64_t attribute_bytes = 0;   ///< that decoding all of the stream's took
};

/// Of one of glTF's component types, 5120 to 5126.
[[nodiscard]] std::size_t componentBytes(int component_type);

/// Bytes that decoding takes at its peak, about, for so many faces: tables of corners, symbols and traversals.
[[nodiscard]] std::uint64_t dracoWorkingBytes(std::uint64_t faces);

/// kUnsupported: another geometry or version of the bitstream than glTF allows; kTooLarge: more than `room`; else
/// kBadInput or kInvalidScene. O(faces + points).
[[nodiscard]] Result<DracoMesh> decodeDraco(std::span<const std::uint8_t> stream, const DracoRequest& request);

}  // namespace radiosity::scene
