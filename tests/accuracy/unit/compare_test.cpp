// What references of whole texels hold, where that is known.
#include "tests/accuracy/compare.h"

#include <gtest/gtest.h>

#include <numbers>

namespace radiosity::accuracy {
namespace {

/// A sheet of paper that lies level under a sky that shines from above alone: half of its light passes, and of the
/// other half it reflects a half. Of its `upper` or its lower side there are texels.
LitScene paperUnderASky(bool upper) {
  LitScene lit;
  const std::array<glm::dvec3, 4> corner{glm::dvec3(0.0, 0.0, 0.0), {0.0, 0.0, 1.0}, {1.0, 0.0, 1.0}, {1.0, 0.0, 0.0}};
  for (const auto& [a, b, c] : {std::array<std::size_t, 3>{0, 1, 2}, {0, 2, 3}}) {
    oracle::Triangle triangle;
    triangle.corners = {corner[a], corner[upper ? b : c], corner[upper ? c : b]};
    triangle.normal = {0.0, upper ? 1.0 : -1.0, 0.0};
    triangle.reflectance = glm::dvec3(0.5);
    triangle.diffuse_transmission = 0.5;
    triangle.transmitted = glm::dvec3(1.0);
    triangle.lightmap_page = 0;
    for (std::size_t k = 0; k < 3; ++k) triangle.lightmap_uv[k] = {triangle.corners[k].x, triangle.corners[k].z};
    lit.scene.triangles.push_back(triangle);
  }
  lit.scene.sky_upper = glm::dvec3(1.0 / std::numbers::pi);  // one lux on what lies level
  lit.scene.has_sky = true;
  lit.pages.push_back({4, 4, std::vector<glm::vec3>(16)});
  return lit;
}

glm::dvec3 meanOf(const LitScene& lit) {
  const auto reference = makePart(lit, {.texel_samples = 256}, ReferencePart::kTexels);
  glm::dvec3 sum(0.0);
  for (const auto& texel : reference.texels) sum += texel.irradiance.mean_lux;
  return reference.texels.empty() ? sum : sum / static_cast<double>(reference.texels.size());
}

// Lit by one lux from above, the upper side leaves a quarter by reflection, the lower one a half by what passes. A
// lightmap is multiplied by the base colour, a half.
TEST(References, OfPaperHoldTheLightOfBothSidesByItsBaseColour) {
  EXPECT_NEAR(meanOf(paperUnderASky(true)).x, 0.5, 1e-9);
  EXPECT_NEAR(meanOf(paperUnderASky(false)).x, 1.0, 1e-9);
}

}  // namespace
}  // namespace radiosity::accuracy
