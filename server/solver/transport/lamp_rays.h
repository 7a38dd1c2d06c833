// Rays that leave a lamp, for many of them: what takes work for a whole web is done once. Immutable once made; any
// thread.
#pragma once

#include <array>
#include <optional>

#include "server/scene/values/web_directions.h"
#include "server/solver/transport/lamp_shape.h"

namespace radiosity::solver {

class LampRays {
 public:
  /// Keeps what the lamp's table lies in. O(n) in the directions of a web.
  explicit LampRays(const Lamp& lamp);

  /// `at`: uniform in [0, 1)^4. As lampRay(); those of a web are drawn in proportion to its candela, so that beams of a
  /// degree get as many as wide ones. O(log n).
  [[nodiscard]] LampRay operator()(const std::array<double, 4>& at) const;

 private:
  Lamp lamp_;
  std::optional<scene::WebDirections> web_;
};

}  // namespace radiosity::solver
