// Where a solve ended for the light and colours that it had before: whoever takes an edit of these back sees what was
// there, to the last bit, though more rays or links were needed in between. Plain values; one thread.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <list>
#include <memory>
#include <vector>

#include "server/solver/error/error_parts.h"
#include "server/solver/variation/leaf_variation.h"

namespace radiosity::solver {

struct KeptEnd {
  std::uint64_t key = 0;                         ///< of light and colours
  std::array<std::vector<glm::vec3>, 2> half;    ///< irradiance by leaf value
  std::array<std::vector<glm::vec3>, 2> shaded;  ///< what is to be added for shading normals, where there are some
  std::vector<LeafVariation::Correction> corrections;  ///< of light that varies within leaves
  std::vector<float> common;  ///< square of what both halves are off by, by leaf value; empty: not known
  ErrorParts error;

  [[nodiscard]] std::size_t bytes() const;
};

class KeptEnds {
 public:
  /// Those that were asked for or kept last, as many as `most_bytes` hold, and 32 of them at most.
  explicit KeptEnds(std::size_t most_bytes) : most_bytes_(most_bytes) {}

  /// Null: there is none.
  [[nodiscard]] std::shared_ptr<const KeptEnd> find(std::uint64_t key);
  /// In the place of one with the same key. One that is too large by itself is not kept.
  void keep(std::shared_ptr<const KeptEnd> end);
  [[nodiscard]] std::size_t bytes() const { return bytes_; }

 private:
  void drop(std::list<std::shared_ptr<const KeptEnd>>::iterator end);

  std::size_t most_bytes_, bytes_ = 0;
  std::list<std::shared_ptr<const KeptEnd>> ends_;  ///< the latest first
};

}  // namespace radiosity::solver
