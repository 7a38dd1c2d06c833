#include "server/scene/charts/trial_room.h"

#include <array>
#include <cmath>
#include <glm/ext/matrix_transform.hpp>
#include <numbers>
#include <utility>

#include "server/scene/charts/build.h"
#include "server/scene/values/scene.h"

namespace radiosity::scene {
namespace {

constexpr glm::dvec3 kRoomSize{6.0, 3.0, 6.0};  ///< metres
constexpr std::uint32_t kBoxes = 240;           ///< twelve triangles each
constexpr std::uint64_t kTexels = 8'000;

/// In [0, 1): the golden ratio's multiples, and those of two others, spread evenly.
double spread(std::uint32_t i, double step) { return std::fmod((i + 0.5) * step, 1.0); }

/// A box of side 1 about the origin, seen from outside.
Primitive unitBox() {
  Primitive box;
  for (std::uint32_t axis = 0; axis < 3; ++axis)
    for (const double way : {-0.5, 0.5}) {
      const auto first = static_cast<std::uint32_t>(box.positions.size());
      const auto across = (axis + 1) % 3, up = (axis + 2) % 3;
      for (const auto& [u, v] :
           {std::array{-0.5, -0.5}, std::array{way, -way}, std::array{0.5, 0.5}, std::array{-way, way}}) {
        glm::dvec3 corner(0.0);
        corner[axis] = way;
        corner[across] = u;
        corner[up] = v;
        box.positions.push_back(corner);
      }
      for (const auto corner : {0U, 1U, 2U, 0U, 2U, 3U}) box.indices.push_back(first + corner);
    }
  return box;
}

Scene furnishedRoom() {
  Scene scene;
  scene.materials.resize(1);
  const auto box = unitBox();
  auto walls = box;
  for (std::size_t i = 0; i < walls.indices.size(); i += 3) std::swap(walls.indices[i + 1], walls.indices[i + 2]);
  scene.primitives = {walls, box};
  scene.instances.push_back({.primitive = 0, .world = glm::scale(glm::dmat4(1.0), kRoomSize)});
  for (std::uint32_t i = 0; i < kBoxes; ++i) {
    const glm::dvec3 place(spread(i, std::numbers::phi) - 0.5, 0.6 * spread(i, std::numbers::sqrt2) - 0.5,
                           spread(i, std::numbers::sqrt3) - 0.5);
    auto world = glm::translate(glm::dmat4(1.0), 0.9 * kRoomSize * place);
    world = glm::rotate(world, 2.0 * std::numbers::pi * spread(i, std::numbers::e), glm::dvec3(0.0, 1.0, 0.0));
    scene.instances.push_back({.primitive = 1, .world = glm::scale(world, glm::dvec3(0.3, 0.15, 0.2))});
  }
  return scene;
}

}  // namespace

Result<std::shared_ptr<const PatchScene>> makeTrialRoom() {
  ChartOptions options;
  options.texel_budget = kTexels;
  auto room = buildPatchScene(furnishedRoom(), options);
  if (!room) return tl::unexpected(room.error());
  return std::make_shared<const PatchScene>(std::move(*room));
}

}  // namespace radiosity::scene
