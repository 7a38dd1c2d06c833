// A question for Embree.
#pragma once

#include <embree3/rtcore.h>

#include <glm/vec3.hpp>

namespace radiosity::oracle {

/// What the ray meets first within `far` lengths of `way` is still to be found.
inline RTCRayHit embreeRay(const glm::dvec3& from, const glm::dvec3& way, double far) {
  RTCRayHit query{};
  query.ray.org_x = static_cast<float>(from.x);
  query.ray.org_y = static_cast<float>(from.y);
  query.ray.org_z = static_cast<float>(from.z);
  query.ray.dir_x = static_cast<float>(way.x);
  query.ray.dir_y = static_cast<float>(way.y);
  query.ray.dir_z = static_cast<float>(way.z);
  query.ray.tfar = static_cast<float>(far);
  query.ray.mask = ~0U;
  query.hit.geomID = RTC_INVALID_GEOMETRY_ID;
  query.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
  return query;
}

}  // namespace radiosity::oracle
