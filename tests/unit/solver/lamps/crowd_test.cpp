// Lamps too many to be shooters, against what one large lamp in their place brings, whose form factor is exact.
#include "server/solver/lamps/crowd.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "server/solver/math/polygon_form_factor.h"
#include "server/solver/math/sampling.h"
#include "server/solver/pipeline/linked_solver.h"
#include "tests/unit/solver/quad_scene.h"
#include "tests/unit/solver/solve.h"

namespace radiosity::solver {
namespace {

using test::solve;

constexpr float kFloor = -0.4F, kCeiling = 0.4F, kHalf = 0.2F;
constexpr std::uint32_t kLeaves = 20, kTiles = 18;
constexpr std::size_t kFew = 256;

/// `count` by `count` lamps that make a square of side 2 kHalf, facing down.
std::vector<test::Quad> tiles(const glm::vec3& emission, std::uint32_t count = kTiles) {
  std::vector<test::Quad> quads;
  const float side = 2.0F * kHalf / static_cast<float>(count);
  for (std::uint32_t i = 0; i < count * count; ++i) {
    const glm::vec3 corner(-kHalf + side * static_cast<float>(i % count), kCeiling,
                           -kHalf + side * static_cast<float>(i / count));
    test::Quad tile{corner, {side, 0.0F, 0.0F}, {0.0F, 0.0F, side}};
    tile.width = tile.height = 1;
    tile.emission = emission;
    quads.push_back(tile);
  }
  return quads;
}

class CrowdTest : public testing::Test {
 protected:
  /// A floor of leaves 0.04 wide below them, and maybe a screen half way up from x = 0 on to one side.
  void make(const std::vector<test::Quad>& lamps, bool has_screen = false) {
    std::vector<test::Quad> quads{{{-0.4F, kFloor, -0.4F}, {0.0F, 0.0F, 0.8F}, {0.8F, 0.0F, 0.0F}}};
    quads[0].width = quads[0].height = kLeaves;
    quads.insert(quads.end(), lamps.begin(), lamps.end());
    if (has_screen) quads.push_back({{0.0F, 0.0F, -0.49F}, {0.0F, 0.0F, 0.98F}, {0.49F, 0.0F, 0.0F}});
    quads_ = quads;
    scene_ = test::makeQuadScene(quads);
    sides_ = makeSides(*scene_.patches);
    rays_.emplace(*scene_.patches, sides_);
    divided_ = divideLights(findLightPolygons(*scene_.patches, sides_, scene_.materials.emission), kFew);
  }
  /// Of the leaves of the floor, from all samples of both halves.
  [[nodiscard]] std::vector<double> arriving(const Crowd& crowd, std::uint32_t samples, LinkSample* last = nullptr) {
    std::vector<double> mean(kLeaves * kLeaves, 0.0);
    for (std::uint32_t k = 0; k < 2 * samples; ++k) {
      CrowdSample sample(*scene_.patches, sides_, *rays_, 1, crowd, k % 2, k / 2);
      while (!sample.advance(0.0)) continue;
      const auto links = sample.links();
      EXPECT_EQ(links.runs.front().first_node, 0U);
      for (std::size_t leaf = 0; leaf < mean.size(); ++leaf)
        mean[leaf] += static_cast<double>(links.irradiance[leaf]) / (2.0 * samples);
      if (last != nullptr) *last = links;
    }
    return mean;
  }
  /// Mean over the leaf of the form factor of what the screen leaves of the square: as seen from x its edge is at -x
  /// there, and what is farther in is hidden.
  [[nodiscard]] double expected(std::uint32_t leaf, bool has_screen) const {
    constexpr std::uint32_t kPlaces = 1024;
    double sum = 0.0;
    for (std::uint32_t i = 0; i < kPlaces; ++i) {
      const auto at = sobol4(i, 5);
      const auto place = rays_->placeOn(leaf, {at.x, at.y});
      const auto edge = static_cast<float>(-place.position.x);
      const float high = has_screen ? glm::clamp(edge, -kHalf, kHalf) : kHalf;
      if (high + kHalf < 1e-6F) continue;
      const std::array<glm::vec3, 4> corners{glm::vec3(-kHalf, kCeiling, -kHalf),
                                             {high, kCeiling, -kHalf},
                                             {high, kCeiling, kHalf},
                                             {-kHalf, kCeiling, kHalf}};
      sum += polygonFormFactor(place.position, place.normal, corners);
    }
    return sum / kPlaces;
  }
  void expectLight(bool has_screen, std::span<const double> light) {
    double square = 0.0, error = 0.0, sum = 0.0, all = 0.0;
    for (std::uint32_t leaf = 0; leaf < light.size(); ++leaf) {
      const double truth = expected(leaf, has_screen);
      square += truth * truth;
      error += (light[leaf] - truth) * (light[leaf] - truth);
      sum += light[leaf];
      all += truth;
    }
    EXPECT_NEAR(sum / all, 1.0, 0.002);           // 400 leaves of 1,024 draws each
    EXPECT_LT(std::sqrt(error / square), 0.015);  // one draw errs by 0.3 or so where nothing hides it, in steps of 1/18
  }

  std::vector<test::Quad> quads_;
  test::QuadScene scene_;
  std::vector<Side> sides_;
  std::optional<LeafRays> rays_;
  DividedLights divided_;
};

TEST_F(CrowdTest, FewLampsAreShootersAndSoAreStrongOnes) {
  auto few = tiles(glm::vec3(1.0F));
  few.resize(200);
  make(few);
  EXPECT_EQ(divided_.shooters.size(), 200U);
  EXPECT_TRUE(divided_.crowds.empty());
  auto lamps = tiles(glm::vec3(1.0F));
  lamps[40].emission = glm::vec3(50.0F);
  make(lamps);
  ASSERT_EQ(divided_.shooters.size(), 1U);
  EXPECT_EQ(divided_.shooters[0].emission, glm::vec3(50.0F));
  ASSERT_EQ(divided_.crowds.size(), 1U);
  EXPECT_EQ(divided_.crowds[0].lamps->lights().size(), lamps.size() - 1);
  EXPECT_NEAR(divided_.crowds[0].area, 4.0 * kHalf * kHalf * 323.0 / 324.0, 1e-6);
}

TEST(FewLights, AreAsManyAsTheirLinksHaveRoom) {
  constexpr std::size_t kGiB = std::size_t{1} << 30U;
  EXPECT_EQ(fewLights(24'000, kGiB), 1024U);
  EXPECT_EQ(fewLights(100'000, kGiB), kGiB / 4 / 400'000);  // two halves of two bytes a leaf, in a quarter
  EXPECT_EQ(fewLights(4'000'000, kGiB), 256U);
  EXPECT_EQ(fewLights(0, 0), 256U);
}

// At a limit of time: one leaf of each block is asked, and stands for the others.
TEST_F(CrowdTest, InHasteItBringsRoughlyTheSameForAFractionOfTheWork) {
  make(tiles(glm::vec3(3.0F)));
  constexpr std::uint32_t kSamples = 32;
  std::vector<double> light(kLeaves * kLeaves, 0.0);
  for (std::uint32_t k = 0; k < 2 * kSamples; ++k) {
    CrowdSample sample(*scene_.patches, sides_, *rays_, 1, divided_.crowds[0], k % 2, k / 2);
    while (!sample.advance(0.0, CrowdSample::Leaves::kSome)) continue;
    EXPECT_FALSE(sample.isWhole());
    const auto links = sample.links();
    for (std::size_t leaf = 0; leaf < light.size(); ++leaf)
      light[leaf] += static_cast<double>(links.irradiance[leaf]) / (2.0 * kSamples);
  }
  std::size_t alike = 0;
  for (std::uint32_t leaf = 0; leaf < light.size(); ++leaf) {
    const auto left = leaf / kLeaves * kLeaves + leaf % kLeaves / 8 * 8;
    alike += light[leaf] == light[left] ? 1 : 0;
    EXPECT_NEAR(light[leaf] / expected(leaf, false), 1.0, 0.6) << leaf;
  }
  EXPECT_EQ(alike, light.size());
}

TEST_F(CrowdTest, ASampleThatWasInHasteEndsAsOneThatHadTime) {
  make(tiles(glm::vec3(3.0F)));
  CrowdSample hasty(*scene_.patches, sides_, *rays_, 1, divided_.crowds[0], 0, 0);
  CrowdSample calm(*scene_.patches, sides_, *rays_, 1, divided_.crowds[0], 0, 0);
  while (!hasty.advance(0.0, CrowdSample::Leaves::kSome)) continue;
  while (!hasty.advance(0.0)) continue;
  while (!calm.advance(0.0)) continue;
  EXPECT_TRUE(hasty.isWhole());
  EXPECT_EQ(hasty.links().irradiance, calm.links().irradiance);
}

TEST_F(CrowdTest, BringsWhatOneLampInItsPlaceBrings) {
  make(tiles(glm::vec3(3.0F)));
  ASSERT_EQ(divided_.crowds.size(), 1U);
  EXPECT_EQ(divided_.crowds[0].emission, glm::vec3(3.0F));
  LinkSample links;
  expectLight(false, arriving(divided_.crowds[0], 64, &links));
  // What does not fall on the floor leaves the scene, or falls on no lit side.
  EXPECT_NEAR((links.delivered + links.escaped + links.absorbed) / divided_.crowds[0].area, 1.0, 0.02);
  EXPECT_EQ(links.due, 0.0);
}

TEST_F(CrowdTest, AScreenHidesOfItWhatItHidesOfOneLamp) {
  make(tiles(glm::vec3(1.0F)), true);
  const auto light = arriving(divided_.crowds.at(0), 64);
  expectLight(true, light);
  // A leaf at x sees of the lamps what lies below -x: from x = 0.2 on nothing.
  for (std::uint32_t leaf = 0; leaf < light.size(); ++leaf) {
    const auto place = rays_->placeOn(leaf, {0.5, 0.5});
    if (place.position.x > 0.2 + 0.04) {
      EXPECT_EQ(light[leaf], 0.0) << leaf;
    }
  }
}

TEST_F(CrowdTest, ColoursAreThatOfEachLamp) {
  auto lamps = tiles(glm::vec3(0.0F));
  for (std::size_t i = 0; i < lamps.size(); ++i) {
    lamps[i].emission.x = 1.0F;
    lamps[i].emission.z = lamps[i].origin.x < -1e-3F ? 2.0F : 0.0F;  // half of them
  }
  make(lamps);
  ASSERT_EQ(divided_.crowds.size(), 2U);
  EXPECT_EQ(divided_.crowds[0].emission, glm::vec3(1.0F, 0.0F, 0.0F));
  EXPECT_EQ(divided_.crowds[1].emission, glm::vec3(0.0F, 0.0F, 2.0F));
  EXPECT_EQ(divided_.crowds[0].lamps->lights().size(), 324U);
  EXPECT_EQ(divided_.crowds[1].lamps->lights().size(), 162U);
  EXPECT_NEAR(divided_.crowds[1].area, 0.5 * divided_.crowds[0].area, 1e-6);
}

TEST_F(CrowdTest, ThatIsDimmedAsAWholeIsTheSame) {
  auto lamps = tiles(glm::vec3(1.0F));
  for (std::size_t i = 0; i < lamps.size(); ++i) lamps[i].emission *= 0.5F + 0.37F * static_cast<float>(i % 11);
  make(lamps);
  const auto before = divided_.crowds;
  ASSERT_EQ(before.size(), 1U);
  const auto again = [&] {
    return divideLights(findLightPolygons(*scene_.patches, sides_, test::makeQuadScene(quads_).materials.emission),
                        kFew, before);
  };
  for (auto& quad : quads_) quad.emission *= 0.7F;
  const auto dimmed = again();
  ASSERT_EQ(dimmed.crowds.size(), 1U);
  EXPECT_EQ(dimmed.crowds[0].key, before[0].key);
  EXPECT_EQ(dimmed.crowds[0].lamps, before[0].lamps);
  EXPECT_NEAR(dimmed.crowds[0].emission.x, 0.7F * before[0].emission.x, 1e-5F * before[0].emission.x);
  quads_[5].emission *= 1.01F;
  EXPECT_NE(again().crowds.at(0).key, before[0].key);
}

TEST_F(CrowdTest, NearLampsBringNoMoreThanTheyEmit) {
  // Leaves a tenth of a tile below the lamps: points of these would bring up to 100 / pi, directions bring 1 at most.
  auto lamps = tiles(glm::vec3(1.0F));
  const float gap = 0.1F * lamps[0].du.x;
  make(lamps);
  std::vector<test::Quad> quads{{{-0.1F, kCeiling - gap, -0.1F}, {0.0F, 0.0F, 0.2F}, {0.2F, 0.0F, 0.0F}}};
  quads[0].width = quads[0].height = kLeaves;
  quads.insert(quads.end(), lamps.begin(), lamps.end());
  scene_ = test::makeQuadScene(quads);
  sides_ = makeSides(*scene_.patches);
  rays_.emplace(*scene_.patches, sides_);
  divided_ = divideLights(findLightPolygons(*scene_.patches, sides_, scene_.materials.emission), kFew);
  const auto light = arriving(divided_.crowds.at(0), 64);
  EXPECT_NEAR(std::reduce(light.begin(), light.end()) / static_cast<double>(light.size()), 0.9997, 0.01);
  EXPECT_LT(std::ranges::max(light), 1.2);
}

TEST_F(CrowdTest, LampsThatTheFloorCutsBringWhatIsLeftOfThem) {
  // A wall of tiles across the floor at x = 0, from a tenth below it to three tenths above, which shines towards +x.
  std::vector<test::Quad> lamps;
  constexpr float kLow = kFloor - 0.1F, kSide = 2.0F * kHalf / kTiles;
  for (std::uint32_t i = 0; i < kTiles * kTiles; ++i) {
    const glm::vec3 corner(0.0F, kLow + kSide * static_cast<float>(i % kTiles),
                           -kHalf + kSide * static_cast<float>(i / kTiles));
    lamps.push_back({corner, {0.0F, kSide, 0.0F}, {0.0F, 0.0F, kSide}});
    lamps.back().width = lamps.back().height = 1;
    lamps.back().emission = glm::vec3(1.0F);
  }
  make(lamps);
  const auto light = arriving(divided_.crowds.at(0), 64);
  constexpr float kHigh = kLow + 2.0F * kHalf;
  const std::array<glm::vec3, 4> wall{
      glm::vec3(0.0F, kFloor, -kHalf), {0.0F, kHigh, -kHalf}, {0.0F, kHigh, kHalf}, {0.0F, kFloor, kHalf}};
  double square = 0.0, error = 0.0, sum = 0.0, all = 0.0;
  for (std::uint32_t leaf = 0; leaf < light.size(); ++leaf) {
    double truth = 0.0;
    for (std::uint32_t i = 0; i < 1024; ++i) {
      const auto at = sobol4(i, 5);
      const auto place = rays_->placeOn(leaf, {at.x, at.y});
      if (place.position.x > 0.0) truth += polygonFormFactor(place.position, place.normal, wall) / 1024.0;
    }
    square += truth * truth;
    error += (light[leaf] - truth) * (light[leaf] - truth);
    sum += light[leaf];
    all += truth;
  }
  EXPECT_NEAR(sum / all, 1.0, 0.005);
  EXPECT_LT(std::sqrt(error / square), 0.03);
}

class CrowdSolve : public testing::Test {
 protected:
  CrowdSolve() : quads_(test::cubeQuads(8, test::kDark, test::kGrey)) {
    for (const auto& tile : tiles(glm::vec3(10.0F), 33)) quads_.push_back(tile);  // 1,089
    settings_.target_error = 0.02;
    take();
  }
  void take() {
    made_ = test::makeQuadScene(quads_);
    EXPECT_TRUE(transport_.setScene(made_.patches));
  }
  [[nodiscard]] std::unique_ptr<LinkedSolver> make() {
    return std::make_unique<LinkedSolver>(made_.patches, made_.materials, transport_, settings_);
  }
  [[nodiscard]] double meanOf(const LinkedSolver& solver) const {
    double sum = 0.0, area = 0.0;
    const auto light = solver.irradiance();
    for (const auto& side : makeSides(*made_.patches)) {
      for (auto node = side.first_node; node < side.first_node + side.leaf_count && side.surface < 6; ++node) {
        sum += static_cast<double>(light[node].x * made_.patches->node_area[node]);
        area += static_cast<double>(made_.patches->node_area[node]);
      }
    }
    return sum / area;
  }

  std::vector<test::Quad> quads_;
  test::QuadScene made_;
  SolverSettings settings_;
  test::RayTransport transport_{64};
};

TEST_F(CrowdSolve, EndsWhereOneLampInItsPlaceDoes) {
  const auto many = make();
  solve(*many);
  const double light = meanOf(*many);
  const auto energy = many->energy();
  EXPECT_NEAR(energy.imbalance[0] / energy.emitted[0], 0.0, 1e-3);
  EXPECT_LT(many->shots(), 400U);  // not the thousands of shots of so many shooters
  quads_.resize(6);
  quads_.push_back({{-kHalf, kCeiling, -kHalf}, {2.0F * kHalf, 0.0F, 0.0F}, {0.0F, 0.0F, 2.0F * kHalf}});
  quads_.back().emission = glm::vec3(10.0F);
  take();
  const auto one = make();
  solve(*one);
  EXPECT_NEAR(light / meanOf(*one), 1.0, 0.02);
}

TEST_F(CrowdSolve, EditsOfItsLightAndBackGiveTheSameBits) {
  const auto solver = make();
  solve(*solver);
  const auto before = solver->directIrradiance(), all = solver->irradiance();
  const auto samples = solver->linkCounters().samples;
  auto dimmed = quads_;
  for (auto& quad : dimmed) quad.emission *= 0.5F;
  solver->setMaterials(test::makeQuadScene(dimmed).materials);  // the same crowd
  solve(*solver);
  EXPECT_EQ(solver->linkCounters().samples, samples);
  EXPECT_NEAR(static_cast<double>(solver->directIrradiance()[3].x / before[3].x), 0.5, 1e-5);
  dimmed.back().emission = glm::vec3(4.0F);  // another
  solver->setMaterials(test::makeQuadScene(dimmed).materials);
  solve(*solver);
  EXPECT_GT(solver->linkCounters().samples, samples);
  solver->setMaterials(made_.materials);
  solve(*solver);
  EXPECT_EQ(solver->directIrradiance(), before);
  EXPECT_EQ(solver->irradiance(), all);
}

TEST_F(CrowdSolve, GoesOnFromBytesWhereverItWas) {
  const auto whole = make();
  solve(*whole);
  auto interrupted = make();
  int times = 0;
  for (int i = 0; i < 100'000; ++i) {
    const auto outcome = interrupted->step();
    ASSERT_TRUE(outcome);
    if (*outcome == StepOutcome::kConverged) break;
    ArchiveWriter to(std::size_t{64} << 20U);
    if (i % 2 != 0 || !interrupted->save(to)) continue;
    auto next = make();
    ArchiveReader from(to.bytes());
    ASSERT_TRUE(next->restore(from));
    interrupted = std::move(next);
    ++times;
  }
  EXPECT_GT(times, 2);
  EXPECT_EQ(interrupted->irradiance(), whole->irradiance());
}

}  // namespace
}  // namespace radiosity::solver
