#include "server/solver/lamps/lamp_of_light.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>

namespace radiosity::solver {
namespace {

using scene::LightKind;
using ShapeKind = LampShape::Kind;

/// A smaller ball (unit box) is a point to all that may see it, and its square would be no number.
constexpr float kLeastBall = 1e-6F;

ShapeKind kindOf(LightKind kind) {
  switch (kind) {
    case LightKind::kRectangle:
      return ShapeKind::kRectangle;
    case LightKind::kDisc:
      return ShapeKind::kDisc;
    case LightKind::kWeb:
      return ShapeKind::kWeb;
    case LightKind::kSpot:
      return ShapeKind::kSpotDisc;
    default:
      return ShapeKind::kBall;
  }
}

/// Of a disc any will do.
glm::vec3 acrossOf(const scene::PunctualLight& light) {
  if (light.kind == LightKind::kRectangle || light.kind == LightKind::kWeb)
    return glm::vec3(glm::normalize(light.across));
  const auto helper = std::abs(light.direction.x) < 0.6 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
  return glm::vec3(glm::normalize(glm::cross(helper, light.direction)));
}

}  // namespace

bool hasSizeOrWeb(const scene::PunctualLight& light) {
  return light.kind == LightKind::kWeb || (light.kind != LightKind::kDirectional && light.half.x > 0.0);
}

double lampArea(const scene::PunctualLight& light) {
  if (light.kind == LightKind::kRectangle) return 4.0 * light.half.x * light.half.y;
  return std::numbers::pi * light.half.x * light.half.x;
}

LampShape lampShape(const scene::PatchScene& patches, const scene::PunctualLight& light, const Cone& cone) {
  LampShape shape;
  shape.kind = kindOf(light.kind);
  shape.centre = glm::vec3((light.position - patches.centre) / patches.scale);
  if (shape.kind != ShapeKind::kBall) {  // which has no axis: a turn of its node is no edit
    shape.axis = glm::normalize(glm::vec3(light.direction));
    shape.across = acrossOf(light);
  }
  if (shape.kind != ShapeKind::kWeb) shape.half = glm::vec2(light.half / patches.scale);
  if (shape.kind != ShapeKind::kRectangle) shape.half.y = 0.0F;
  if (shape.kind == ShapeKind::kBall) shape.half.x = std::max(shape.half.x, kLeastBall);
  if (shape.kind == ShapeKind::kSpotDisc) {
    shape.cone_scale = cone.scale;
    shape.cone_offset = cone.offset;
  }
  if (light.range > 0.0)
    shape.range = std::max(static_cast<float>(light.range / patches.scale), std::numeric_limits<float>::min());
  return shape;
}

}  // namespace radiosity::solver
