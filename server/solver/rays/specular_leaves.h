// Leaves that reflect as mirrors do: metal, and glass. Rays that meet them go on. Made anew for every edit of
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
                                                                  const scene::PatchMaterials& materials,
                                                                  const std::vector<scene::Surface>& surfaces);

  [[nodiscard]] bool has(std::uint32_t value) const { return roughness_[value] >= 0.0F; }
  [[nodiscard]] double roughness(std::uint32_t value) const { return static_cast<double>(roughness_[value]); }
  [[nodiscard]] bool isGlass(std::uint32_t value) const { return !glass_.empty() && glass_[value].face.isGlass(); }
  [[nodiscard]] bool hasGlass() const { return !glass_.empty(); }
  /// Part of the light that is reflected, by channel, where `edge` is Schlick's (1 - cos)^5.
  [[nodiscard]] glm::vec3 reflectance(std::uint32_t value, float edge) const {
    if (isGlass(value)) return glm::vec3(glass_[value].face.reflectanceOfStopped(edge, glass_[value].entered));
    const glm::vec3 facing(colour_[value]);
    return facing + (colour_[value].w - facing) * edge;
  }
  /// The same, of light from all around.
  [[nodiscard]] glm::vec3 meanReflectance(std::uint32_t value) const { return reflectance(value, kMeanEdge); }
  /// Changes with whatever a solution depends on.
  [[nodiscard]] std::uint64_t key() const { return key_; }

  /// Whether rays go on alike from a leaf and another of other ones; null has none.
  [[nodiscard]] static bool goOnAlike(const SpecularLeaves* a, std::uint32_t value_a, const SpecularLeaves* b,
                                      std::uint32_t value_b) {
    return (a != nullptr ? a->roughness_[value_a] : kNone) == (b != nullptr ? b->roughness_[value_b] : kNone);
  }

 private:
  static constexpr float kNone = -1.0F;
  static constexpr float kMeanEdge = 1.0F / 21.0F;  ///< of (1 - cos)^5, weighted by the cosine
  /// Of what does not pass glass; elsewhere `face` is none.
  struct Glass {
    scene::GlassFace face;
    float entered = 0.0F;
  };
  explicit SpecularLeaves(std::size_t leaves) : roughness_(leaves, kNone), colour_(leaves, glm::vec4(0.0F)) {}

  std::vector<float> roughness_;  ///< by leaf value; kNone: it does not reflect so
  std::vector<glm::vec4>
      colour_;                ///< what it reflects of light straight at it, and, of all channels, of light along it
  std::vector<Glass> glass_;  ///< by leaf value; empty: there is none
  std::uint64_t key_ = 0;
};

}  // namespace radiosity::solver
