// What every node still has to shoot: net flux and what varies inside, pulled up from the leaves. Plain values.
#pragma once

#include <glm/vec3.hpp>
#include <span>
#include <vector>

#include "server/solver/patches/side.h"

namespace radiosity::solver {

/// Sum of the magnitudes of the channels.
[[nodiscard]] float channelSum(const glm::vec3& v);
[[nodiscard]] double channelSum(const glm::dvec3& v);

class UnshotPyramid {
 public:
  explicit UnshotPyramid(const scene::PatchScene& patches) : patches_(patches) {}

  /// Makes room, before pull().
  void begin();
  /// `unshot`: radiosity by leaf of the side. Any thread, other sides by others at the same time.
  void pull(const Side& side, std::span<const glm::vec3> unshot);
  /// Nothing is unshot anywhere, which takes no memory.
  void clear();

  /// Unshot flux of the subtree per channel, signed: what the node would shoot as one.
  [[nodiscard]] glm::vec3 flux(std::uint32_t node) const { return flux_.empty() ? glm::vec3(0.0F) : flux_[node]; }
  /// Sum of |unshot| area over the leaves of the subtree, all channels.
  [[nodiscard]] float rough(std::uint32_t node) const { return rough_.empty() ? 0.0F : rough_[node]; }

 private:
  const scene::PatchScene& patches_;
  std::vector<glm::vec3> flux_;  ///< by node; empty: none
  std::vector<float> rough_;     ///< likewise
};

}  // namespace radiosity::solver
