// Images of lamps in flat mirrors.
#include "server/solver/lamps/lamp_images.h"

#include <gtest/gtest.h>

#include <cmath>
#include <glm/geometric.hpp>
#include <memory>
#include <vector>

#include "server/solver/lamps/unhidden.h"
#include "server/solver/math/sampling.h"
#include "tests/unit/solver/quad_scene.h"

namespace radiosity::solver {
namespace {

using test::cubeQuads;
using test::kDark;
using test::kGrey;
using test::makeQuadScene;
using Source = PunctualLights::Source;

/// A cube of which one wall is a mirror that reflects half of the light at any angle.
class LampImage : public testing::Test {
 protected:
  static constexpr std::uint32_t kMirror = 1;

  explicit LampImage(const std::vector<test::Quad>& quads = cubeQuads(8, kDark, kGrey))
      : made_(makeQuadScene(quads)),
        sides_(makeSides(*made_.patches)),
        rays_(std::make_shared<const LeafRays>(*made_.patches, sides_)) {
    made_.materials.specular = made_.materials.lobe = scene::SideColours(*made_.patches);
    polish(kMirror, 0.0F);
  }

  void polish(std::uint32_t side, float roughness) {
    made_.materials.specular.fill(sides_[side].number, glm::vec3(0.5F));
    made_.materials.lobe.fill(sides_[side].number, glm::vec3(roughness, 0.5F, 0.0F));
  }

  [[nodiscard]] std::shared_ptr<const LampImages> find(const std::vector<Source>& sources) const {
    return LampImages::find(*made_.patches, sides_, rays_,
                            SpecularLeaves::find(sides_, made_.materials, made_.patches->surfaces), {}, sources);
  }

  /// `part`: of the cube, from its lowest corner.
  [[nodiscard]] static Source pointIn(const glm::dvec3& part) {
    Source source;
    source.position = glm::vec3(part - 0.5);
    source.intensity = glm::dvec3(1.0);
    return source;
  }

  test::QuadScene made_;
  std::vector<Side> sides_;
  std::shared_ptr<const LeafRays> rays_;
};

TEST_F(LampImage, BringsWhatALampBehindTheMirrorWould) {
  const std::vector<Source> sources{pointIn({0.4, 0.6, 0.55})};
  const auto images = find(sources);
  ASSERT_TRUE(images);
  ASSERT_EQ(images->images().size(), 1U);
  const auto& side = sides_[kMirror];
  const auto on_mirror = rays_->placeOn(side.first_value, {0.5, 0.5});
  const glm::dvec3 lamp(sources[0].position);
  const auto image = lamp - 2.0 * glm::dot(lamp - on_mirror.position, on_mirror.normal) * on_mirror.normal;
  std::size_t seen = 0;
  for (const auto& other : sides_) {
    for (auto value = other.first_value; value < other.first_value + other.leaf_count; ++value) {
      const auto place = rays_->placeOn(value, {0.3, 0.7});
      const auto look = images->look(images->images()[0], place, place.normal, {0.5, 0.5});
      const auto way = image - place.position;
      const double arrives = glm::dot(place.normal, way);
      const bool sees = other.number != side.number && arrives > 0.0;
      if (!sees) {
        EXPECT_EQ(look.seen, glm::dvec3(0.0));
        continue;
      }
      ++seen;
      const double truth = 0.5 * arrives / std::pow(glm::length(way), 3.0);
      EXPECT_NEAR(look.seen.x, truth, 1e-4 * truth);
      LampImages::Looks looks;
      looks.add(look);
      const auto irradiance = images->irradiance(images->images()[0], looks, std::span(&place, 1));
      EXPECT_NEAR(irradiance.y, truth, 1e-4 * truth);
    }
  }
  EXPECT_GT(seen, 200U) << "all five other walls";
}

TEST_F(LampImage, IsNotLookedForInWhatBlursIt) {
  const std::vector<Source> sources{pointIn({0.4, 0.6, 0.5})};
  polish(kMirror, 0.2F);
  EXPECT_FALSE(find(sources));
  polish(kMirror, 0.05F);
  EXPECT_TRUE(find(sources));
}

TEST_F(LampImage, OfTooManyLampsNoneIsLookedFor) {
  std::vector<Source> sources;
  for (std::size_t i = 0; i <= LampImages::kMostImages; ++i)
    sources.push_back(pointIn(glm::dvec3(0.1 + 0.8 * static_cast<double>(i) / LampImages::kMostImages)));
  EXPECT_FALSE(find(sources));
  sources.pop_back();
  EXPECT_TRUE(find(sources));
}

TEST_F(LampImage, OfMoreMirrorsThanThereIsRoomForTheLargestCount) {
  for (std::uint32_t s = 0; s < 6; ++s) polish(s, 0.0F);
  std::vector<Source> sources;
  for (std::size_t i = 0; i < LampImages::kMostImages / 4; ++i)
    sources.push_back(pointIn(glm::dvec3(0.2 + 0.01 * static_cast<double>(i))));
  const auto images = find(sources);
  ASSERT_TRUE(images);
  EXPECT_EQ(images->images().size(), LampImages::kMostImages) << "four of six planes";
  std::size_t in = 0;
  for (const auto& side : sides_) in += images->isIn(side.first_value) ? 1 : 0;
  EXPECT_EQ(in, 4U);
}

/// The same, and a small mirror within.
class LampImageInSmallMirror : public LampImage {
 protected:
  LampImageInSmallMirror() : LampImage(quads()) {
    made_.materials.specular.fill(sides_[kMirror].number, glm::vec3(0.0F));
    polish(6, 0.0F);
  }

 private:
  static std::vector<test::Quad> quads() {
    auto quads = cubeQuads(8, kDark, kGrey);
    quads.push_back({{-0.15F, -0.1F, -0.3F}, {0.3F, 0.0F, 0.0F}, {0.0F, 0.3F, 0.0F}});
    return quads;
  }
};

// Whatever sees an image says that it may.
TEST_F(LampImageInSmallMirror, IsRuledOutOnlyWhereNothingSeesIt) {
  std::size_t seen = 0, ruled_out = 0;
  for (std::uint32_t i = 0; i < 40; ++i) {
    const auto draw = sobol4(i, 7);
    auto lamp = pointIn({0.05 + 0.9 * draw.x, 0.05 + 0.9 * draw.y, 0.05 + 0.9 * draw.z});
    if (i % 2 == 1) {
      lamp.kind = Source::Kind::kLamp;
      lamp.shape.kind = LampShape::Kind::kBall;
      lamp.shape.centre = lamp.position;
      lamp.shape.half = glm::vec2(0.04F, 0.0F);
    }
    const auto images = find({lamp});
    ASSERT_TRUE(images);
    for (std::uint32_t k = 0; k < 400; ++k) {
      const auto at = sobol4(k, 100 + i);
      const auto value = static_cast<std::uint32_t>(at.x * static_cast<double>(sides_.back().first_value));
      if (rays_->areaOf(value) <= 0.0) continue;
      const auto place = rays_->placeOn(value, {at.y, at.z});
      const auto middle = rays_->placeOn(value, {0.5, 0.5}).position;
      const auto look = images->look(images->images()[0], place, place.normal, {at.w, at.y});
      const bool may = images->maySee(images->images()[0], middle, rays_->widthOf(value));
      if (look.seen != glm::dvec3(0.0)) {
        ++seen;
        EXPECT_TRUE(may);
      }
      ruled_out += may ? 0 : 1;
    }
  }
  EXPECT_GT(seen, 500U);
  EXPECT_GT(ruled_out, 4000U);
}

}  // namespace
}  // namespace radiosity::solver
