// Leaves that reflect as mirrors do: metal, and smooth coats. Rays that meet them go on. Made anew for every edit of
// materials; immutable; any thread.
#pragma once

#include <cstdint>
#include <glm/common.hpp>
#include <glm/vec4.hpp>
#include <memory>
#include <span>
#include <vector>

#include "server/scene/values/patch_scene.h"
#include "server/solver/patches/side.h"

namespace radiosity::solver {

class SpecularLeaves {
 public:
  /// A ray goes on from so many of them at most.
  static constexpr std::size_t kMostHops = 8;

  /// Null: there are none. O(leaves) where some are.
  [[nodiscard]] static std::shared_ptr<const SpecularLeaves> find(const std::vector<Side>& sides,
                                                                  const scene::PatchMaterials& materials);

  [[nodiscard]] bool has(std::uint32_t value) const { return roughness_[value] >= 0.0F; }
  [[nodiscard]] double roughness(std::uint32_t value) const { return static_cast<double>(roughness_[value]); }
  /// Part of the light that is reflected, by channel, where `edge` is Schlick's (1 - cos)^5.
  [[nodiscard]] glm::vec3 reflectance(std::uint32_t value, float edge) const {
    const glm::vec3 facing(colour_[value]);
    return facing + (colour_[value].w - facing) * edge;
  }
  /// Changes with whatever a solution depends on.
  [[nodiscard]] std::uint64_t key() const { return key_; }

  /// Whether rays go on alike from a leaf and another of other ones; null has none.
  [[nodiscard]] static bool goOnAlike(const SpecularLeaves* a, std::uint32_t value_a, const SpecularLeaves* b,
                                      std::uint32_t value_b) {
    return (a != nullptr ? a->roughness_[value_a] : kNone) == (b != nullptr ? b->roughness_[value_b] : kNone);
  }

 private:
  static constexpr float kNone = -1.0F;
  explicit SpecularLeaves(std::size_t leaves) : roughness_(leaves, kNone), colour_(leaves, glm::vec4(0.0F)) {}

  std::vector<float> roughness_;  ///< by leaf value; kNone: it does not reflect so
  std::vector<glm::vec4>
      colour_;  ///< what it reflects of light straight at it, and, of all channels, of light along it
  std::uint64_t key_ = 0;
};

}  // namespace radiosity::solver
