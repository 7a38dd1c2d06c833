#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <functional>

#include "server/scene/charts/build.h"
#include "server/scene/lightmap/lightmap.h"
#include "tests/unit/scene/shapes.h"

namespace radiosity::scene::test {
namespace {

PatchScene build(const Scene& scene, std::uint64_t budget, ChartOptions options = {}) {
  options.texel_budget = budget;
  return buildPatchScene(scene, options).value();
}

/// Position in the world of a texel's centre.
glm::dvec3 worldAt(const PatchScene& patches, std::uint32_t triangle, const glm::vec2& texel) {
  const TriangleFrame& f = patches.triangles[triangle];
  return glm::dvec3(f.origin + f.du * texel.x + f.dv * texel.y) * patches.scale + patches.centre;
}

std::vector<glm::vec3> leafValues(const PatchScene& patches, const std::function<float(const glm::dvec3&)>& field) {
  std::vector<glm::vec3> values(patches.nodeCount(), glm::vec3(-1e9F));  // other levels must not be read
  for (const Surface& s : patches.surfaces)
    for (std::uint32_t i = 0; i < s.width * s.height; ++i) {
      const LeafPoint& leaf = patches.leaves[s.first_leaf + i];
      for (const std::uint32_t first : s.first_node)
        if (first != kNone && leaf.triangle != kNone) {
          const glm::vec2 centre(static_cast<float>(i % s.width) + 0.5F, static_cast<float>(i / s.width) + 0.5F);
          values[first + i] = glm::vec3(field(worldAt(patches, leaf.triangle, centre)));
        }
    }
  return values;
}

float bilinear(const LightmapPage& page, const glm::vec2& uv) {
  const glm::vec2 place = uv * glm::vec2(page.irradiance.width, page.irradiance.height) - 0.5F;
  const glm::vec2 base = glm::floor(place), f = place - base;
  const auto at = [&](int dx, int dy) {
    return page.irradiance
        .at(std::clamp(static_cast<int>(base.x) + dx, 0, page.irradiance.width - 1),
            std::clamp(static_cast<int>(base.y) + dy, 0, page.irradiance.height - 1))
        .x;
  };
  return glm::mix(glm::mix(at(0, 0), at(1, 0), f.x), glm::mix(at(0, 1), at(1, 1), f.x), f.y);
}

/// Largest difference between the field and what a viewer would look up, over points of every triangle, borders
/// included.
double worstLookup(const Scene& scene, const PatchScene& patches, const std::vector<LightmapPage>& pages,
                   const std::function<float(const glm::dvec3&)>& field) {
  double worst = 0.0;
  for (std::size_t i = 0; i < scene.instances.size(); ++i) {
    const Primitive& p = scene.primitives[scene.instances[i].primitive];
    for (std::size_t t = 0; t < p.indices.size() / 3; ++t)
      for (int a = 0; a <= 12; ++a)
        for (int b = 0; a + b <= 12; ++b) {
          const std::array<double, 3> w{a / 12.0, b / 12.0, (12 - a - b) / 12.0};
          glm::dvec3 position(0.0);
          glm::dvec2 uv(0.0);
          for (std::size_t k = 0; k < 3; ++k) {
            position +=
                w[k] * glm::dvec3(scene.instances[i].world * glm::dvec4(p.positions[p.indices[3 * t + k]], 1.0));
            uv += w[k] * glm::dvec2(patches.instance_uvs[i].side[0].corners[t][k]);
          }
          const double seen = bilinear(pages[patches.instance_uvs[i].side[0].page[t]], glm::vec2(uv));
          worst = std::max(worst, std::abs(seen - field(position)));
        }
  }
  return worst;
}

float ramp(const glm::dvec3& p) { return static_cast<float>(10.0 + p.x + 0.5 * p.z); }

TEST(Pages, LinearRampIsReproducedUpToEveryEdge) {
  Scene scene;
  place(scene, floorQuad(1.0));
  place(scene, floorQuad(1.0, 1.0));
  const PatchScene patches = build(scene, 200);
  const auto pages = assemblePages(patches, leafValues(patches, ramp));
  EXPECT_LT(worstLookup(scene, patches, pages, ramp), 2e-3);
}

TEST(Pages, RampOverATriangleIsReproducedAlongItsSlantedEdges) {
  Primitive p;
  p.positions = {{0, 0, 0}, {1, 0, 3}, {4, 0, 1}};
  p.indices = {0, 1, 2};
  const Scene scene = sceneOf(p);
  const PatchScene patches = build(scene, 500);
  const auto pages = assemblePages(patches, leafValues(patches, ramp));
  EXPECT_LT(worstLookup(scene, patches, pages, ramp), 0.05);  // texels are 0.11 wide: under half a texel's slope
}

TEST(Pages, TexelsUnderABlockAreFilledFromWhatIsVisible) {
  Scene scene;
  place(scene, floorQuad(10.0, -5.0, -5.0));
  place(scene, box({-1.0, 0.0, -1.0}, {1.0, 2.0, 1.0}));
  ChartOptions options;
  options.texel_size_m = 0.3;
  const PatchScene patches = build(scene, 0, options);
  std::vector<glm::vec3> values(patches.nodeCount(), glm::vec3(0.0F));
  const Surface& floor = patches.surfaces[0];
  for (std::uint32_t i = 0; i < floor.width * floor.height; ++i) {
    const double share = patches.node_area[i] / floor.texel_area;
    values[i] = glm::vec3(share >= 0.25 ? 7.0F : 1000.0F);  // what is hardly visible has a wild estimate
  }
  const auto pages = assemblePages(patches, values);
  for (std::uint32_t y = 0; y < floor.height; ++y)
    for (std::uint32_t x = 0; x < floor.width; ++x)
      EXPECT_NEAR(pages[floor.place[0].page]
                      .irradiance.at(static_cast<int>(floor.place[0].x + x), static_cast<int>(floor.place[0].y + y))
                      .x,
                  7.0, 1e-4);
}

// Whatever lies beside it on the page: that depends on the layout, which edits leave as it is and solves do not.
TEST(Pages, WhatIsWhollyBuriedIsBlack) {
  Scene scene;
  place(scene, box({-1.0, 0.0, -1.0}, {1.0, 2.0, 1.0}));
  place(scene, box({-0.2, 0.9, -0.2}, {0.2, 1.1, 0.2}));
  ChartOptions options;
  options.texel_size_m = 0.1;
  const PatchScene patches = build(scene, 0, options);
  const auto pages = assemblePages(patches, leafValues(patches, [](const glm::dvec3&) { return 1000.0F; }));
  std::size_t buried = 0;
  for (const Surface& surface : patches.surfaces) {
    if (surface.instance == 0) continue;
    const PagePlace& at = surface.place[0];
    const auto& page = pages[at.page];
    for (std::uint32_t y = 0; y < surface.height; ++y)
      for (std::uint32_t x = 0; x < surface.width; ++x, ++buried)
        EXPECT_EQ(page.irradiance.at(static_cast<int>(at.x + x), static_cast<int>(at.y + y)), glm::vec3(0.0F));
  }
  EXPECT_GT(buried, 0U);
}

TEST(Pages, LookupsOnBothSidesOfASeamAgree) {
  const Scene scene = sceneOf(icoSphere(1.0, 4));
  const PatchScene patches = build(scene, 3000);
  ASSERT_GT(patches.seams.size(), 100U);
  // noise, so that nothing but stitching can make the sides agree
  std::uint32_t state = 1;
  std::vector<glm::vec3> values(patches.nodeCount());
  for (auto& v : values)
    v = glm::vec3(1.0F + 0.2F * static_cast<float>((state = state * 1664525U + 1013904223U) >> 8) / 16777216.0F);
  const auto pages = assemblePages(patches, values);
  double sum = 0.0;
  for (const PatchScene::Seam& seam : patches.seams) {
    std::array<float, 2> seen{};
    for (std::size_t s = 0; s < 2; ++s) {
      const Surface& surface = patches.surfaces[seam.surface[s]];
      const glm::vec2 texel =
          0.5F * (seam.texel[s][0] + seam.texel[s][1]) + glm::vec2(surface.place[0].x, surface.place[0].y);
      const Page& page = patches.pages[surface.place[0].page];
      seen[s] = bilinear(pages[surface.place[0].page], texel / glm::vec2(page.width, page.height));
    }
    sum += (seen[0] - seen[1]) * (seen[0] - seen[1]);
  }
  EXPECT_LT(std::sqrt(sum / static_cast<double>(patches.seams.size())), 0.01);  // 0.06 unstitched
}

// A strip of a two-hundredth of a texel beside a wide face, tilted by five degrees: a chart of its own, that one ray or
// other may make a thousand times too bright.
TEST(Pages, ASliverDoesNotPullTheWideFaceBesideIt) {
  constexpr double kWidth = 2.5e-4;
  Primitive face, strip;
  test::addQuad(face, {0, 0, 1}, {1, 0, 1}, {1, 0, 0}, {0, 0, 0});
  test::addQuad(strip, {1, 0, 1}, {1 + kWidth, 0.09 * kWidth, 1}, {1 + kWidth, 0.09 * kWidth, 0}, {1, 0, 0});
  Scene scene;
  for (const auto& primitive : {face, strip}) test::place(scene, primitive);
  const PatchScene patches = build(scene, 400);
  ASSERT_EQ(patches.surfaces.size(), 2U);
  ASSERT_FALSE(patches.seams.empty());
  std::vector<glm::vec3> values(patches.nodeCount());
  const Surface &wide = patches.surfaces[0], &sliver = patches.surfaces[1];
  std::fill_n(values.begin() + wide.first_node[0], wide.width * wide.height, glm::vec3(1.0F));
  std::fill_n(values.begin() + sliver.first_node[0], sliver.width * sliver.height, glm::vec3(1000.0F));
  const auto pages = assemblePages(patches, values);
  const auto& image = pages[wide.place[0].page].irradiance;
  float most = 0.0F;
  for (std::uint32_t i = 0; i < wide.width * wide.height; ++i) {
    const auto x = static_cast<int>(wide.place[0].x + i % wide.width),
               y = static_cast<int>(wide.place[0].y + i / wide.width);
    most = std::max(most, image.at(x, y).x);
  }
  // They meet in the mean, weighed by area, 1 + 999 / 200; some sweeps over ties that share texels leave a tenth more.
  EXPECT_LT(most, 7.0F);
}

TEST(Pages, StitchingLeavesTheMeanAlone) {
  const Scene scene = sceneOf(icoSphere(1.0, 4));
  const PatchScene patches = build(scene, 3000);
  const auto field = [](const glm::dvec3& p) { return static_cast<float>(2.0 + p.y); };
  const auto values = leafValues(patches, field);
  const auto pages = assemblePages(patches, values);
  double before = 0.0, after = 0.0, area = 0.0;
  for (const Surface& s : patches.surfaces)
    for (std::uint32_t i = 0; i < s.width * s.height; ++i) {
      const double a = patches.node_area[s.first_node[0] + i];
      if (a == 0.0) continue;
      area += a;
      before += a * values[s.first_node[0] + i].x;
      after += a * pages[s.place[0].page]
                       .irradiance
                       .at(static_cast<int>(s.place[0].x + i % s.width), static_cast<int>(s.place[0].y + i / s.width))
                       .x;
    }
  EXPECT_NEAR(after / area, before / area, 0.01);
}

TEST(Pages, EachSideHasTexelsOfItsOwn) {
  Scene scene;
  Material material;
  material.double_sided = true;
  place(scene, floorQuad(1.0), glm::dmat4(1.0), material);
  const PatchScene patches = build(scene, 16);
  std::vector<glm::vec3> values(patches.nodeCount(), glm::vec3(0.0F));
  const Surface& s = patches.surfaces[0];
  for (std::uint32_t i = 0; i < s.width * s.height; ++i) {
    values.at(s.first_node[0] + i) = glm::vec3(2.0F);
    values.at(s.first_node[1] + i) = glm::vec3(4.0F);
  }
  const auto pages = assemblePages(patches, values);
  const auto valueOn = [&](std::size_t side) {
    const PagePlace& place = s.place[side];
    return pages[place.page].irradiance.at(static_cast<int>(place.x) + 1, static_cast<int>(place.y) + 1).x;
  };
  EXPECT_EQ(valueOn(0), 2.0F);
  EXPECT_EQ(valueOn(1), 4.0F);
}

TEST(Pages, NothingIsNegativeOrNotFinite) {
  Scene scene;
  place(scene, box({0, 0, 0}, {4, 3, 5}, true));
  place(scene, icoSphere(0.7, 3), glm::translate(glm::dmat4(1.0), glm::dvec3(1.1, 0.2, 2.7)));
  const PatchScene patches = build(scene, 3000);
  std::vector<glm::vec3> values(patches.nodeCount());
  for (std::size_t i = 0; i < values.size(); ++i) values[i] = glm::vec3(i % 17 == 0 ? 1e6F : 1e-6F);
  for (const LightmapPage& page : assemblePages(patches, values)) {
    LightmapPage mip = page;
    for (int level = 0; level < 5; ++level) {
      for (const glm::vec3& v : mip.irradiance.pixels) {
        ASSERT_TRUE(std::isfinite(v.x));
        ASSERT_GE(v.x, 0.0F);
      }
      mip = coarserMip(mip);
    }
  }
}

TEST(Pages, CoarserMipsDoNotBleedGutters) {
  LightmapPage page;
  page.irradiance = Image(4, 3, glm::vec3(100.0F));
  page.coverage.assign(12, 0.0F);
  for (const int i : {0, 1, 4}) {
    page.irradiance.pixels[static_cast<std::size_t>(i)] = glm::vec3(2.0F);
    page.coverage[static_cast<std::size_t>(i)] = 1.0F;
  }
  const LightmapPage coarse = coarserMip(page);
  EXPECT_EQ(coarse.irradiance.width, 2);
  EXPECT_EQ(coarse.irradiance.height, 2);
  EXPECT_FLOAT_EQ(coarse.irradiance.at(0, 0).x, 2.0F);
  EXPECT_FLOAT_EQ(coarse.coverage[0], 0.75F);
  EXPECT_FLOAT_EQ(coarse.coverage[1], 0.0F);
}

TEST(Pages, EmptySceneHasNoPages) { EXPECT_TRUE(assemblePages(PatchScene{}, {}).empty()); }

// Whoever draws both sees now one, now the other: a black one would show as a pattern of dots.
TEST(Pages, LightmapsOfCoveredFacesShowTheLightOfWhatCoversThem) {
  Scene scene;
  place(scene, floorQuad(1.0));
  place(scene, floorQuad(0.5));  // lies in the first, with texels of other places
  const PatchScene patches = build(scene, 300);
  ASSERT_EQ(patches.surfaces.size(), 2U);
  std::vector<glm::vec3> values(patches.nodeCount(), glm::vec3(0.0F));
  const auto light = [](const glm::vec3& position) { return glm::vec3(1.0F + position.x, 2.0F + position.z, 3.0F); };
  const auto middle = [&](const Surface& surface, std::uint32_t i) {
    const auto& frame = patches.triangles[surface.first_triangle];
    return frame.origin + (static_cast<float>(i % surface.width) + 0.5F) * frame.du +
           (static_cast<float>(i / surface.width) + 0.5F) * frame.dv;
  };
  const auto& lit = patches.surfaces[0];
  for (std::uint32_t i = 0; i < lit.width * lit.height; ++i) values[lit.first_node[0] + i] = light(middle(lit, i));
  const auto pages = assemblePages(patches, values);
  const auto& covered = patches.surfaces[1];
  for (std::uint32_t i = 0; i < covered.width * covered.height; ++i) {
    const auto& image = pages[covered.place[0].page].irradiance;
    const auto pixel = image.pixels[image.index(static_cast<int>(covered.place[0].x + i % covered.width),
                                                static_cast<int>(covered.place[0].y + i / covered.width))];
    const auto expected = light(middle(covered, i));
    for (int channel = 0; channel < 3; ++channel) EXPECT_NEAR(pixel[channel], expected[channel], 0.02) << i;
  }
}

}  // namespace
}  // namespace radiosity::scene::test
