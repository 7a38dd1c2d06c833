#include <cmath>
#include <limits>

#include "server/scene/charts/build.h"
#include "server/scene/charts/flatten.h"
#include "server/scene/values/patch_scene.h"

namespace radiosity::scene {

std::uint64_t expectedLeaves(const Scene& scene, const ChartOptions& options) {
  if (options.texel_size_m <= 0.0) return options.texel_budget;
  const FlatScene flat = flatten(scene, frameFor(scene));
  double area = 0.0;
  for (const FlatTriangle& triangle : flat.triangles) area += triangle.area;
  const double side = options.texel_size_m / flat.scale;
  const double leaves = area / (side * side);
  constexpr auto kMost = std::numeric_limits<std::uint64_t>::max();
  return leaves < 1e18 ? static_cast<std::uint64_t>(leaves) : kMost;
}

}  // namespace radiosity::scene
