// Where decompressed geometry goes: one new buffer of a document, with the views into it. What it will hold is counted
// against the document's limits before it is there. Lives for one call of decompressGeometry, on its thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "common/bytes.h"
#include "common/result.h"
#include "server/scene/document/document.h"
#include "server/scene/document/json_text.h"
#include "server/scene/document/scene_limit.h"

namespace radiosity::scene {

class DecodedBuffer {
 public:
  /// The document must outlive it. The new buffer comes behind those that are there.
  DecodedBuffer(const Document& document, const ImportLimits& limits);

  /// Before so many bytes are made, for which decoding needs `working` more. kTooLarge: there is no room.
  [[nodiscard]] Result<void> claim(std::uint64_t bytes, std::uint64_t working, const std::string& where);
  /// What may still be claimed.
  [[nodiscard]] std::uint64_t room() const { return memory_.bytes - claimed_; }

  /// Bytes that were claimed, which `view` then names; its other members stay.
  void put(Bytes bytes, Json& view);
  [[nodiscard]] bool holds(const Json& view) const { return view["buffer"] == index_; }
  [[nodiscard]] std::size_t index() const { return index_; }

  /// All of it, in one piece.
  [[nodiscard]] Bytes take();

 private:
  std::size_t index_ = 0, size_ = 0;
  std::uint64_t most_ = 0, claimed_ = 0, bytes_ = 0;
  SceneLimit memory_;
  std::vector<Bytes> pieces_;
};

}  // namespace radiosity::scene
