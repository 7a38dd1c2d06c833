#include "tests/accuracy/reference_store.h"

#include <gtest/gtest.h>

#include <fstream>
#include <numbers>

#include "tests/accuracy/closed_form.h"
#include "tests/scenes/scenes.h"
#include "tests/unit/client/temporary_folder.h"

namespace radiosity::accuracy {
namespace {

/// One lit triangle of the furnace covers half of a page of 4 x 4 texels.
LitScene furnaceWithOnePage(double rho) {
  LitScene lit{oracle::triangulate(test_scenes::furnace(glm::dvec3(rho), glm::dvec3(1.0))), {}};
  lit.pages.push_back({4, 4, std::vector<glm::vec3>(16, glm::vec3(1.0F))});
  lit.scene.triangles[0].lightmap_uv = {glm::dvec2(0, 0), {1, 0}, {0, 1}};
  lit.scene.triangles[0].lightmap_page = 0;
  return lit;
}

constexpr ReferenceOptions kSmall{.texel_samples = 64, .point_samples = 64, .texels = 0, .points = 5};

TEST(ReferenceStore, WhatIsSavedIsReadBackBitForBit) {
  const TemporaryFolder folder;
  const auto made = findReference(furnaceWithOnePage(0.5), kSmall, folder.file("kept"));
  const auto again = findReference(furnaceWithOnePage(0.5), kSmall, folder.file("kept"));
  EXPECT_FALSE(made.from_disk);
  EXPECT_TRUE(again.from_disk);
  ASSERT_EQ(made.reference.texels.size(), again.reference.texels.size());
  ASSERT_EQ(again.reference.points.size(), 5U);
  ASSERT_FALSE(again.reference.texels.empty());
  for (std::size_t i = 0; i < made.reference.texels.size(); ++i) {
    EXPECT_EQ(made.reference.texels[i].irradiance.mean_lux, again.reference.texels[i].irradiance.mean_lux);
    EXPECT_EQ(made.reference.texels[i].x, again.reference.texels[i].x);
    EXPECT_EQ(made.reference.texels[i].plain, again.reference.texels[i].plain);
  }
  EXPECT_EQ(made.reference.points[4].position, again.reference.points[4].position);
  EXPECT_EQ(made.reference.points[4].irradiance.mean_lux, again.reference.points[4].irradiance.mean_lux);
  EXPECT_EQ(made.reference.cut_area, again.reference.cut_area);
}

TEST(ReferenceStore, TheKeyDependsOnAllThatTheValuesDependOn) {
  const auto key = [](const LitScene& lit, const ReferenceOptions& options = kSmall) {
    return referenceKey(lit, options, ReferencePart::kTexels);
  };
  const auto of_half = key(furnaceWithOnePage(0.5));
  EXPECT_EQ(of_half, key(furnaceWithOnePage(0.5)));
  EXPECT_NE(of_half, key(furnaceWithOnePage(0.6)));
  auto moved = furnaceWithOnePage(0.5);
  moved.scene.triangles[0].lightmap_uv[1].x = 0.5;
  EXPECT_NE(of_half, key(moved));
  auto finer = furnaceWithOnePage(0.5);
  finer.pages[0].width = 8;
  EXPECT_NE(of_half, key(finer));
  auto more = kSmall;
  more.texel_samples = 128;
  EXPECT_NE(of_half, key(furnaceWithOnePage(0.5), more));
  auto smooth = furnaceWithOnePage(0.5);
  smooth.scene.triangles[0].shading[1] = {0, 0, 1};
  EXPECT_NE(of_half, key(smooth));
}

TEST(ReferenceStore, PointsOutliveAChangeOfTheLayoutButNotOfTheScene) {
  const auto key = [](const LitScene& lit) { return referenceKey(lit, kSmall, ReferencePart::kPoints); };
  auto moved = furnaceWithOnePage(0.5);
  moved.scene.triangles[0].lightmap_uv[1].x = 0.5;
  moved.pages[0].width = 8;
  EXPECT_EQ(key(furnaceWithOnePage(0.5)), key(moved));
  EXPECT_NE(key(furnaceWithOnePage(0.5)), key(furnaceWithOnePage(0.6)));
  auto unlit = furnaceWithOnePage(0.5);
  unlit.unlit = furnaceWithOnePage(0.6).scene;
  EXPECT_EQ(key(unlit), key(furnaceWithOnePage(0.6)));
}

TEST(ReferenceStore, AFileCutShortOrLengthenedOrForeignIsNotRead) {
  const TemporaryFolder folder;
  const auto made = makeReference(furnaceWithOnePage(0.5), kSmall);
  const std::string file = folder.file("a.reference");
  saveReference(made, file);
  ASSERT_TRUE(loadReference(file));
  const auto bytes = folder.read("a.reference");
  for (const auto& wrong : {bytes.substr(0, bytes.size() - 1), bytes + "x", std::string("RADREF01"), std::string()}) {
    folder.write("a.reference", wrong);
    EXPECT_FALSE(loadReference(file)) << wrong.size();
  }
  auto lying = bytes;
  lying[8 + 3] = 1;  // 2^24 texels more than there are
  folder.write("a.reference", lying);
  EXPECT_FALSE(loadReference(file));
  EXPECT_FALSE(loadReference(folder.file("missing")));
}

TEST(CavityIrradiance, IsThatOfAFurnaceAndThePathTracerAgrees) {
  const auto lit = furnaceWithOnePage(0.5);
  const auto exact = cavityIrradiance(lit.scene);
  ASSERT_TRUE(exact);
  EXPECT_NEAR(exact->x, 2.0 * std::numbers::pi, 1e-12);
  auto options = kSmall;
  options.texel_samples = 16384;
  double traced = 0.0, error = 0.0;
  const auto reference = makeReference(lit, options);
  for (const auto& texel : reference.texels) {
    traced += texel.irradiance.mean_lux.x / static_cast<double>(reference.texels.size());
    error += texel.irradiance.standard_error.x / static_cast<double>(reference.texels.size());
  }
  EXPECT_NEAR(traced, exact->x, 4.0 * error);  // four standard errors of one texel: the mean of several is better
  EXPECT_LT(error, 0.02 * exact->x);
  options.closed_form = true;
  const auto known = makeReference(lit, options);
  EXPECT_TRUE(known.exact);
  ASSERT_EQ(known.texels.size(), reference.texels.size());
  EXPECT_EQ(known.texels[0].irradiance.mean_lux, *exact);
  EXPECT_EQ(known.texels[0].irradiance.standard_error, glm::dvec3(0.0));
}

TEST(CavityIrradiance, IsNotGivenForAnythingElse) {
  auto scene = furnaceWithOnePage(0.5).scene;
  auto open = scene;
  open.triangles.pop_back();
  EXPECT_FALSE(cavityIrradiance(open));
  auto uneven = scene;
  uneven.triangles[3].reflectance.y = 0.4;
  EXPECT_FALSE(cavityIrradiance(uneven));
  auto outside = scene;
  for (auto& triangle : outside.triangles) std::swap(triangle.corners[0], triangle.corners[1]);
  EXPECT_FALSE(cavityIrradiance(outside));
  EXPECT_FALSE(cavityIrradiance(oracle::triangulate(test_scenes::cornell())));
  EXPECT_FALSE(cavityIrradiance({}));
}

TEST(Pfm, IsReadWithTheTopRowFirstAndRefusedWhenShort) {
  const TemporaryFolder folder;
  const std::vector<float> bottom_first{4, 5, 6, 1, 2, 3};
  std::string bytes = "PF\n1 2\n-1.0\n";
  bytes.append(reinterpret_cast<const char*>(bottom_first.data()), bottom_first.size() * sizeof(float));
  folder.write("a.pfm", bytes);
  const auto page = readPfm(folder.file("a.pfm"));
  EXPECT_EQ(page.at(0, 0), glm::dvec3(1, 2, 3));
  EXPECT_EQ(page.at(0, 1), glm::dvec3(4, 5, 6));
  for (const auto& wrong : {bytes.substr(0, bytes.size() - 1), std::string("Pf\n1 2\n-1.0\n1234"),
                            std::string("PF\n1 99999999\n-1.0\n"), std::string("PF\n1 2\n1.0\n") + bytes.substr(12)}) {
    folder.write("b.pfm", wrong);
    EXPECT_THROW((void)readPfm(folder.file("b.pfm")), std::runtime_error) << wrong.size();
  }
}

}  // namespace
}  // namespace radiosity::accuracy
