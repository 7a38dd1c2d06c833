// Elements of a glTF accessor as numbers: any component type, stride, normalisation, sparse overlay.
// Borrowed views into a Document's buffers; any thread.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "common/result.h"
#include "server/scene/import/import_model.h"

namespace radiosity::scene {

/// Bytes of one element of a checked accessor. MAT2 of bytes and MAT3 of bytes or shorts have padded columns.
[[nodiscard]] std::size_t elementBytes(const tinygltf::Accessor& accessor);

[[nodiscard]] std::size_t componentCount(const tinygltf::Accessor& accessor);

/// Types, bounds against views and buffers, sparse bounds. `pointer`: "/accessors/4".
[[nodiscard]] Result<void> checkAccessor(const Document& document, const tinygltf::Model& model, std::size_t index);

/// Views against buffers.
[[nodiscard]] Result<void> checkBufferView(const Document& document, const tinygltf::Model& model, std::size_t index);

class AccessorReader {
 public:
  /// The accessor must have passed checkAccessor. Reads sparse indices and refuses those
  /// that are not increasing or not below count.
  [[nodiscard]] static Result<AccessorReader> open(const Document& document, const tinygltf::Model& model,
                                                   std::size_t index);

  [[nodiscard]] std::size_t size() const { return count_; }
  [[nodiscard]] std::size_t components() const { return components_; }

  /// The first 4 components of element `i`, missing ones 0. Normalised integers are scaled to [-1, 1] or [0, 1]
  /// (glTF 2.0, 3.6.2.2).
  [[nodiscard]] std::array<double, 4> at(std::size_t i) const;

  /// The same elements with integers as they are stored.
  [[nodiscard]] AccessorReader unnormalized() const {
    auto copy = *this;
    copy.normalized_ = false;
    return copy;
  }

  /// First component of element `i`, not normalised; for indices.
  [[nodiscard]] std::uint32_t indexAt(std::size_t i) const;

  /// The raw bytes of element `i`; null where the accessor has no buffer view (zeros).
  [[nodiscard]] const std::uint8_t* bytesAt(std::size_t i) const;

 private:
  int component_type_ = 0;
  bool normalized_ = false;
  std::size_t count_ = 0, components_ = 0, stride_ = 0, element_bytes_ = 0;
  const std::uint8_t* base_ = nullptr;
  std::vector<std::uint32_t> sparse_indices_;
  const std::uint8_t* sparse_base_ = nullptr;
};

}  // namespace radiosity::scene
