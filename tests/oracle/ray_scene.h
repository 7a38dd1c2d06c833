// Triangles as Embree holds them, in a box of size 2 about the origin, since Embree works in single precision.
#pragma once

#include <embree3/rtcore.h>

#include <glm/vec3.hpp>
#include <span>

#include "tests/oracle/triangle_scene.h"

namespace radiosity::oracle {

class RayScene {
 public:
  /// Primitive i of the only geometry is triangle i. Throws std::runtime_error where Embree does not start.
  explicit RayScene(std::span<const Triangle> triangles);
  ~RayScene();
  RayScene(const RayScene&) = delete;
  RayScene& operator=(const RayScene&) = delete;

  /// Made with RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION.
  [[nodiscard]] RTCScene handle() const { return scene_; }
  [[nodiscard]] glm::dvec3 toUnit(const glm::dvec3& world) const { return (world - centre_) * scale_; }
  [[nodiscard]] double scale() const { return scale_; }  ///< lengths in the box over lengths in the world
  /// Whether anything lies between a place of the box and that place plus `way`.
  [[nodiscard]] bool blocked(const glm::dvec3& from, const glm::dvec3& way) const;

 private:
  void measure(std::span<const Triangle> triangles);
  void attach(std::span<const Triangle> triangles);

  RTCDevice device_ = nullptr;
  RTCScene scene_ = nullptr;
  glm::dvec3 centre_{0.0};
  double scale_ = 1.0;
};

}  // namespace radiosity::oracle
