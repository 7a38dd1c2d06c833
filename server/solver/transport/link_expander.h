// From the nodes of any level that a shot delivers to, to the leaves whose links are kept. Plain values; one thread at
// a time.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "server/solver/patches/side.h"
#include "server/solver/patches/slivers.h"
#include "server/solver/transport/transport.h"

namespace radiosity::solver {

/// Sum of values times areas, as many.
[[nodiscard]] double fluxOf(std::span<const float> values, const float* areas);

/// Turns what a shot delivered to nodes of any level into values of leaves.
class LinkExpander {
 public:
  LinkExpander(const scene::PatchScene& patches, const std::vector<Side>& sides);

  /// `by_pixels`: of a scatter shot. A sliver is hit by few pixels and by none most of the time, each of them worth
  /// many times what arrives there (a link of 58, where none can be above one): it shares what it gets with the leaf
  /// beside it, by area, so that all of it stays.
  void expand(const LinkSample& sample, bool by_pixels = false);
  /// Irradiance by leaf value; only that of the sides reached is valid.
  [[nodiscard]] std::span<const float> values() const { return values_; }
  [[nodiscard]] std::span<const std::uint32_t> sidesReached() const { return reached_; }
  /// Sum of irradiance times area over all leaves.
  [[nodiscard]] double flux() const;
  /// The next sample takes its memory anew.
  void forget();

 private:
  void prepare();
  void reach(std::uint32_t side);
  void pushDown(std::uint32_t side);
  void shareSlivers();
  [[nodiscard]] float areaOf(std::uint32_t value, std::uint32_t side) const {
    return patches_.node_area[sides_[side].first_node + (value - sides_[side].first_value)];
  }
  [[nodiscard]] double fluxTo(std::uint32_t value, std::uint32_t side) const;

  const scene::PatchScene& patches_;
  const std::vector<Side>& sides_;
  // Empty until a sample comes:
  std::vector<std::uint32_t> side_of_node_;
  std::vector<float> values_;
  std::vector<float> coarse_;  // by node: what was linked above level 0
  std::vector<std::uint32_t> reached_;
  std::vector<bool> is_reached_, has_coarse_;
  std::optional<std::vector<Sliver>> slivers_;  // when first asked for: many scenes scatter nothing
};

}  // namespace radiosity::solver
