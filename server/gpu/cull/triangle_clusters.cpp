#include "server/gpu/cull/triangle_clusters.h"

#include <algorithm>
#include <glm/common.hpp>
#include <limits>
#include <numeric>
#include <utility>

namespace radiosity::gpu {
namespace {

constexpr float kFar = std::numeric_limits<float>::max();

struct Box {
  glm::vec3 low{kFar}, high{-kFar};

  void add(const glm::vec3& point) {
    low = glm::min(low, point);
    high = glm::max(high, point);
  }
};

}  // namespace

TriangleClusters makeClusters(const scene::PatchScene& patches, std::uint32_t most) {
  const auto corner = [&](std::uint32_t triangle, std::size_t k) {
    return patches.vertices[patches.indices[3 * std::size_t{triangle} + k]].position;
  };
  TriangleClusters made;
  // What is drawn first stays where two are equally near.
  const bool coincide = !patches.covered.empty();
  const auto emits = [&](std::uint32_t t) { return patches.surfaces[patches.triangle_surface[t]].emits; };
  auto& order = made.order;
  order.resize(patches.indices.size() / 3);
  std::iota(order.begin(), order.end(), 0U);
  std::vector<glm::vec3> centre;
  centre.reserve(order.size());
  for (const auto t : order) centre.push_back((corner(t, 0) + corner(t, 1) + corner(t, 2)) / 3.0F);

  std::vector<std::pair<std::uint32_t, std::uint32_t>> open{{0, static_cast<std::uint32_t>(order.size())}};
  while (!open.empty()) {
    const auto [first, count] = open.back();
    open.pop_back();
    if (count == 0) continue;
    const auto begin = order.begin() + first, end = begin + count;
    if (count <= most) {
      std::sort(begin, end);
      if (coincide) std::stable_partition(begin, end, emits);
      Box box;
      for (auto t = begin; t != end; ++t) {
        for (std::size_t k = 0; k < 3; ++k) box.add(corner(*t, k));
      }
      made.clusters.push_back({first, count, 0.5F * (box.low + box.high), 0.5F * (box.high - box.low)});
      continue;
    }
    Box box;
    for (auto t = begin; t != end; ++t) box.add(centre[*t]);
    const auto size = box.high - box.low;
    const int axis = size.x >= size.y && size.x >= size.z ? 0 : size.y >= size.z ? 1 : 2;
    std::nth_element(begin, begin + count / 2, end, [&](std::uint32_t a, std::uint32_t b) {
      return std::pair(centre[a][axis], a) < std::pair(centre[b][axis], b);
    });
    open.emplace_back(first + count / 2, count - count / 2);
    open.emplace_back(first, count / 2);
  }
  return made;
}

}  // namespace radiosity::gpu
