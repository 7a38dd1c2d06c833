#include "server/solver/lamps/lamp_ball.h"

#include <cmath>

namespace radiosity::solver {

LampBall ballOf(const LightPolygon& lamp) {
  const auto ball = lamp.ball();
  return {glm::dvec3(ball), static_cast<double>(ball.w), false};
}

LampBall ballOf(const PunctualLights::Source& source) {
  using Kind = PunctualLights::Source::Kind;
  if (source.kind == Kind::kDirectional) return {glm::dvec3(source.direction), 0.0, true};
  if (source.kind != Kind::kLamp) return {glm::dvec3(source.position), 0.0, false};
  const auto& shape = source.shape;
  // Of suns the radius is a sine, which is that of a ball at a distance of one; of a sky nothing is known.
  if (shape.kind == LampShape::Kind::kSky) return {glm::dvec3(0.0), HUGE_VAL, true};
  if (shape.isFar()) return {glm::dvec3(shape.axis), static_cast<double>(shape.half.x), true};
  return {glm::dvec3(shape.centre), static_cast<double>(shape.reach()), false};
}

}  // namespace radiosity::solver
