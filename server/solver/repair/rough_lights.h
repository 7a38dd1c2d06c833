// Lights of which only some points have looked again after an edit of geometry: how unsure that leaves them, and leaves
// that look for themselves, at all of a light, where most of that is. Owned by EditRepair; one thread.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "server/solver/rays/leaf_rays.h"
#include "server/solver/repair/repair.h"

namespace radiosity::solver {

class RoughLights {
 public:
  /// Makes them when they are asked for first.
  using RaysOf = std::function<std::shared_ptr<const LeafRays>()>;
  RoughLights(const LinkParts& parts, RaysOf rays) : parts_(parts), rays_(std::move(rays)) {}

  /// By some points of a light both halves have looked at `leaves` again: sets how unsure these are (Repair::noise),
  /// and where that, by what the others would leave of it, is more than `most`, lets leaves look for themselves.
  /// Returns how many times they did. `room`: zeros, one a leaf value, and so it is left.
  std::size_t weigh(std::array<Repair*, 2> halves, std::span<const LinkColumn::ValueRun> leaves, double most,
                    std::span<float> room);

 private:
  /// A leaf that looks at a light for itself.
  struct LeafLook {
    std::uint32_t value;
    std::array<std::optional<float>, 2> link;  ///< by half, where it can
  };
  [[nodiscard]] std::vector<float> noiseOfLeaves(std::uint32_t shooter,
                                                 std::span<const LinkColumn::ValueRun> leaves) const;
  [[nodiscard]] std::vector<LeafLook> chooseUnsure(std::span<const LinkColumn::ValueRun> leaves,
                                                   std::span<const float> noise, double wanted,
                                                   std::span<float> room) const;
  void look(std::uint32_t shooter, std::vector<LeafLook>& looks) const;
  void takeLooks(Repair& repair, std::span<const LinkColumn::ValueRun> leaves, std::span<const LeafLook> looks,
                 std::span<float> room) const;

  const LinkParts& parts_;
  RaysOf rays_;
};

}  // namespace radiosity::solver
