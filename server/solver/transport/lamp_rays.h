// Rays that leave a lamp, for many of them: what takes work for a whole web is done once. Immutable once made; any
// thread.
#pragma once

#include <array>
#include <cstddef>
#include <deque>
#include <memory>
#include <span>
#include <vector>

#include "server/scene/values/web_directions.h"
#include "server/solver/transport/lamp_shape.h"

namespace radiosity::solver {

/// Webs that rays were drawn by, so that lamps with one file, and shots of one lamp, share what is made of it. One
/// thread.
class KnownWebs {
 public:
  /// `table`: is copied. O(n) in its directions; cheaper where it is one of the last kMost.
  [[nodiscard]] std::shared_ptr<const scene::WebDirections> of(std::span<const float> table);

 private:
  static constexpr std::size_t kMost = 16;
  /// Stays where it is, as the directions look into the table.
  struct Known {
    explicit Known(std::span<const float> of) : table(of.begin(), of.end()), directions(table) {}
    Known(const Known&) = delete;
    Known& operator=(const Known&) = delete;

    std::vector<float> table;
    scene::WebDirections directions;
  };
  std::deque<std::shared_ptr<const Known>> known_;  ///< the oldest first
};

class LampRays {
 public:
  /// Keeps what the lamp's table lies in. O(n) in the directions of a web that `webs` does not know.
  LampRays(const Lamp& lamp, KnownWebs& webs);

  /// `at`: uniform in [0, 1)^4. As lampRay(); those of a web are drawn in proportion to its candela, so that beams of a
  /// degree get as many as wide ones. O(log n).
  [[nodiscard]] LampRay operator()(const std::array<double, 4>& at) const;

 private:
  Lamp lamp_;
  std::shared_ptr<const scene::WebDirections> web_;  ///< null: it has none
};

}  // namespace radiosity::solver
