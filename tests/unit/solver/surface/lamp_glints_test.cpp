// Lamps in rough metal, by looks and by chance together, against chance alone.
#include "server/solver/surface/lamp_glints.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <memory>
#include <vector>

#include "server/solver/patches/lights.h"
#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

/// A cube of which one wall is of metal, with a lamp of a quarter of its width that hangs in it and faces that wall.
class LampGlintsTest : public testing::Test {
 protected:
  static constexpr std::size_t kMetal = 2;

  LampGlintsTest() : made_(test::makeQuadScene(quads())) {
    made_.materials.specular = made_.materials.lobe = scene::SideColours(*made_.patches);
    sides_ = makeSides(*made_.patches);
    lamps_ = findLightPolygons(*made_.patches, sides_, made_.materials.emission);
    rays_ = std::make_shared<const LeafRays>(*made_.patches, sides_);
    tinted_ = std::make_unique<TintedRays>(rays_);
  }

  [[nodiscard]] static std::vector<test::Quad> quads() {
    auto quads = test::cubeQuads(8, test::kDark, test::kGrey);
    test::Quad lamp;
    const auto& wall = quads[kMetal];  // its front is inwards
    const auto inward = glm::normalize(glm::cross(wall.du, wall.dv));
    lamp.origin = wall.origin + 0.3F * wall.du + 0.3F * wall.dv + 0.4F * inward + 0.25F * wall.dv;
    lamp.du = 0.25F * wall.du;
    lamp.dv = -0.25F * wall.dv;  // so that it faces the wall
    lamp.width = lamp.height = 2;
    lamp.emission = glm::vec3(1.0F, 2.0F, 4.0F);
    quads.push_back(lamp);
    return quads;
  }

  void polish(double roughness) {
    made_.materials.specular.fill(sides_[kMetal].number, glm::vec3(0.6F));
    made_.materials.lobe.fill(sides_[kMetal].number, glm::vec3(static_cast<float>(roughness), 1.0F, 0.0F));
    mirrors_ = SpecularLeaves::find(sides_, made_.materials, made_.patches->surfaces);
  }

  struct Found {
    double mean = 0.0, deviation = 0.0;  ///< of the green light of one ray
  };
  [[nodiscard]] Found find(const LampGlints& glints) const {
    constexpr int kRays = 100'000;
    double sum = 0.0, square = 0.0;
    for (int i = 0; i < kRays; ++i) {
      const auto key = static_cast<std::uint64_t>(i + 1) * 7919;
      RayEnd at;
      at.value = sides_[kMetal].first_value + 8 * 3 + 2;
      at.end = rays_->placeOn(at.value, {0.4, 0.6});
      at.direction = glm::normalize(-at.end.normal + 0.5 * glm::normalize(glm::dvec3(0.3, 0.2, 0.5)));
      at.key = key;
      double light = glints.look(*tinted_, *mirrors_, at).y;
      followMirrors(*tinted_, mirrors_.get(), at, [&](const RayEnd& end, const glm::dvec3& part, const MirrorHop& hop) {
        if (hop.number > 0 || end.value < sides_.back().first_value || end.value == LeafRays::kNothing ||
            LeafRays::isSky(end.value))
          return;
        const double weight = hop.bounces == 1 ? glints.weightOf(*mirrors_, at, end, {1.0F, 2.0F, 4.0F}) : 1.0;
        light += weight * part.y * 2.0;
      });
      sum += light / kRays;
      square += light * light / kRays;
    }
    return {sum, std::sqrt(square - sum * sum)};
  }

  test::QuadScene made_;
  std::vector<Side> sides_;
  std::vector<LightPolygon> lamps_;
  std::shared_ptr<const LeafRays> rays_;
  std::unique_ptr<TintedRays> tinted_;
  std::shared_ptr<const SpecularLeaves> mirrors_;
};

TEST_F(LampGlintsTest, LooksAndRaysTogetherBringWhatRaysAloneDo) {
  ASSERT_EQ(lamps_.size(), 1U);
  for (const double roughness : {0.2, 0.4, 1.0}) {
    polish(roughness);
    const auto both = find(LampGlints(lamps_)), alone = find(LampGlints());
    EXPECT_GT(alone.mean, 0.01) << "the lamp is seen in the metal";
    // Four deviations of the mean of a hundred thousand.
    EXPECT_NEAR(both.mean, alone.mean, 4.0 * std::hypot(both.deviation, alone.deviation) / std::sqrt(1e5)) << roughness;
    // Of two ways a ray may be met by, both are tried: of what either does well little is lost, and of the rest much
    // won.
    EXPECT_LT(both.deviation, (roughness < 0.3 ? 1.5 : 0.7) * alone.deviation) << roughness;
  }
}

TEST_F(LampGlintsTest, ASmoothMirrorIsLeftToRays) {
  polish(0.0);
  const auto both = find(LampGlints(lamps_)), alone = find(LampGlints());
  EXPECT_EQ(both.mean, alone.mean);
}

}  // namespace
}  // namespace radiosity::solver
