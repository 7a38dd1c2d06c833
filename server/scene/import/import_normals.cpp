#include "server/scene/import/import_normals.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <vector>

#include "common/give_back.h"
#include "common/task.h"

namespace radiosity::scene {
namespace {

constexpr double kLeastLength = 1e-6;
/// Cosine of 1.4e-3 rad, which changes what a surface receives by less than 0.2 % where light grazes at 45 degrees.
constexpr double kUpright = 1.0 - 1e-6;

struct Faces {
  std::vector<glm::dvec3> sum;  ///< by vertex: of its triangles' normals, as long as their areas
  std::vector<double> area;     ///< by vertex: of its triangles
};

template <typename Visit>
void forEachTriangle(const Primitive& primitive, const Visit& visit) {
  for (std::size_t i = 0; i + 2 < primitive.indices.size(); i += 3) {
    interruptionPoint();
    const auto* t = &primitive.indices[i];
    const auto& a = primitive.positions[t[0]];
    const auto cross = glm::cross(primitive.positions[t[1]] - a, primitive.positions[t[2]] - a);
    visit(t, cross, glm::length(cross));
  }
}

Faces facesOf(const Primitive& primitive) {
  Faces faces{std::vector<glm::dvec3>(primitive.positions.size(), glm::dvec3(0.0)),
              std::vector<double>(primitive.positions.size(), 0.0)};
  forEachTriangle(primitive, [&](const std::uint32_t* t, const glm::dvec3& cross, double area) {
    for (int c = 0; c < 3; ++c) {
      faces.sum[t[c]] += cross;
      faces.area[t[c]] += area;
    }
  });
  return faces;
}

/// Whether shading with them differs from shading flat.
bool bend(const Primitive& primitive) {
  bool bends = false;
  forEachTriangle(primitive, [&](const std::uint32_t* t, const glm::dvec3& cross, double area) {
    for (int c = 0; c < 3; ++c) {
      const glm::dvec3 normal(primitive.normals[t[c]]);
      bends |= normal != glm::dvec3(0.0) && glm::dot(normal, cross) < kUpright * area;
    }
  });
  return bends;
}

}  // namespace

std::string NormalFaults::text(std::size_t of) const {
  std::string why;
  const auto add = [&](std::uint32_t count, const char* what) {
    if (count != 0) why += fmt::format("{}{} {}", why.empty() ? "" : ", ", count, what);
  };
  add(missing, "missing");
  add(broken, "without length or not finite");
  add(opposite, "opposite to their faces");
  return fmt::format("{} of {} normals are of no use ({}); these corners are shaded flat", count(), of, why);
}

NormalFaults settleNormals(Primitive& primitive) {
  NormalFaults faults;
  auto& normals = primitive.normals;
  if (normals.empty()) return faults;
  const auto given = std::min(normals.size(), primitive.positions.size());
  normals.resize(primitive.positions.size(), glm::vec3(0.0F));
  const auto faces = facesOf(primitive);
  for (std::size_t i = 0; i < normals.size(); ++i) {
    const glm::dvec3 normal(normals[i]);
    const auto length = glm::length(normal);
    normals[i] = glm::vec3(0.0F);
    if (faces.area[i] == 0.0) continue;
    if (i >= given) {
      ++faults.missing;
    } else if (!(length > kLeastLength && std::isfinite(length))) {
      ++faults.broken;
    } else if (!(glm::dot(normal / length, faces.sum[i]) > kLeastLength * faces.area[i])) {
      ++faults.opposite;
    } else {
      normals[i] = glm::vec3(normal / length);
    }
  }
  if (!bend(primitive)) giveBack(normals);
  return faults;
}

}  // namespace radiosity::scene
