#include "tests/oracle/ray_scene.h"

#include <algorithm>
#include <glm/common.hpp>
#include <limits>
#include <stdexcept>

#include "tests/oracle/embree_ray.h"

namespace radiosity::oracle {

RayScene::RayScene(std::span<const Triangle> triangles) : device_(rtcNewDevice(nullptr)) {
  if (device_ == nullptr) throw std::runtime_error("Embree did not start");
  measure(triangles);
  scene_ = rtcNewScene(device_);
  rtcSetSceneFlags(scene_, static_cast<RTCSceneFlags>(RTC_SCENE_FLAG_ROBUST | RTC_SCENE_FLAG_CONTEXT_FILTER_FUNCTION));
  rtcSetSceneBuildQuality(scene_, RTC_BUILD_QUALITY_HIGH);
  if (!triangles.empty()) attach(triangles);
  rtcCommitScene(scene_);
}

RayScene::~RayScene() {
  rtcReleaseScene(scene_);
  rtcReleaseDevice(device_);
}

void RayScene::measure(std::span<const Triangle> triangles) {
  glm::dvec3 low(std::numeric_limits<double>::infinity());
  glm::dvec3 high(-low);
  for (const auto& triangle : triangles) {
    for (const auto& corner : triangle.corners) {
      low = glm::min(low, corner);
      high = glm::max(high, corner);
    }
  }
  if (triangles.empty()) return;
  centre_ = 0.5 * (low + high);
  const auto size = high - low;
  scale_ = 2.0 / std::max({size.x, size.y, size.z});
}

void RayScene::attach(std::span<const Triangle> triangles) {
  const RTCGeometry geometry = rtcNewGeometry(device_, RTC_GEOMETRY_TYPE_TRIANGLE);
  auto* vertices = static_cast<float*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3,
                                                               3 * sizeof(float), triangles.size() * 3));
  auto* indices = static_cast<unsigned*>(rtcSetNewGeometryBuffer(geometry, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3,
                                                                 3 * sizeof(unsigned), triangles.size()));
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto position = toUnit(triangles[t].corners[k]);
      for (int axis = 0; axis < 3; ++axis) *vertices++ = static_cast<float>(position[axis]);
      *indices++ = static_cast<unsigned>(3 * t + k);
    }
  }
  rtcCommitGeometry(geometry);
  rtcAttachGeometry(scene_, geometry);
  rtcReleaseGeometry(geometry);
}

bool RayScene::blocked(const glm::dvec3& from, const glm::dvec3& way) const {
  auto ray = embreeRay(from, way, 1.0).ray;
  RTCIntersectContext context;
  rtcInitIntersectContext(&context);
  rtcOccluded1(scene_, &context, &ray);
  return ray.tfar <= 0.0F;
}

}  // namespace radiosity::oracle
