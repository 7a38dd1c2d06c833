// The paper's own linking (mipmapped ID texture, hardware level of detail) against the formula.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstdio>

#include "server/gpu/draw/hemicube_renderer.h"
#include "server/gpu/draw/paper_ids.h"
#include "server/gpu/workers/gpu_transport.h"
#include "tests/gl/scene_builder.h"

namespace radiosity::test {
namespace {

/// Level and chart of a node.
struct Place {
  std::uint32_t surface = scene::kNone, level = 0;
};

std::vector<Place> places(const scene::PatchScene& scene) {
  std::vector<Place> all(scene.nodeCount() + 2);
  for (std::uint32_t s = 0; s < scene.surfaces.size(); ++s) {
    const auto& surface = scene.surfaces[s];
    for (std::uint32_t level = 0; level < surface.level_count; ++level) {
      const auto grid = scene::levelGrid(surface.width, surface.height, level);
      for (std::uint32_t i = 0; i < grid.width * grid.height; ++i) {
        all[surface.first_node[0] + grid.offset + i] = {s, level};
      }
    }
  }
  return all;
}

TEST(PaperIds, EveryNodeHasItsOwnIdAndIsFoundAgain) {
  SceneBuilder builder;
  builder.add({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 7, 3});
  builder.add({{0, 0, 1}, {1, 0, 0}, {0, 1, 0}, 1, 9, true});
  const auto scene = builder.build();
  const auto ids = gpu::PaperIds::create(scene);
  ASSERT_TRUE(ids.has_value());
  EXPECT_EQ(ids->size(), 16U);
  for (std::uint32_t s = 0; s < 2; ++s) {
    const auto& surface = scene->surfaces[s];
    for (std::uint32_t side = 0; side <= s; ++side) {
      for (std::uint32_t level = 0; level < surface.level_count; ++level) {
        const auto texels = ids->level(level);
        const auto grid = scene::levelGrid(surface.width, surface.height, level);
        for (std::uint32_t i = 0; i < grid.width * grid.height; ++i) {
          const auto texel = texels[i / grid.width * (16U >> level) + i % grid.width];
          std::array<std::uint32_t, 1> id{(2 * s + side) << ids->patchBits() | texel};
          ids->decode(id, 1000);
          EXPECT_EQ(id[0], surface.first_node[side] + grid.offset + i);
        }
      }
    }
  }
}

TEST(PaperIds, TooManyPatchesForThirtyTwoBitsAreRefused) {
  SceneBuilder builder;
  builder.add({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, 4096, 1});
  for (int i = 0; i < 200; ++i) builder.add({{0, 0, 1}, {1, 0, 0}, {0, 1, 0}, 1, 1});
  const auto ids = gpu::PaperIds::create(builder.build());
  ASSERT_FALSE(ids.has_value());
  EXPECT_EQ(ids.error().code, ErrorCode::kTooLarge);
}

class Paper : public ::testing::Test {
 protected:
  void SetUp() override {
    auto made = gpu::EglContext::create();
    if (!made) GTEST_SKIP() << made.error().text();
    context_ = std::move(*made);
  }
  std::unique_ptr<gpu::EglContext> context_;
};

TEST_F(Paper, HardwareAndFormulaChooseLevelsWithinOneOfEachOther) {
  const auto scene = randomRoom(60, 200000, 3);
  auto renderer = gpu::HemicubeRenderer::create(*context_);
  ASSERT_TRUE(renderer.has_value());
  auto uploaded = gpu::GpuScene::upload(*context_, scene);
  ASSERT_TRUE(uploaded.has_value());
  ASSERT_TRUE(renderer->setScene(std::move(*uploaded)).has_value());
  ASSERT_TRUE(renderer->preparePaper().has_value());
  const auto place = places(*scene);
  std::mt19937 random(5);
  solver::TransportCounters counters;
  std::size_t seen = 0, same_surface = 0, same = 0, close = 0;
  for (std::uint32_t i = 0; i < 40; ++i) {
    const auto shot = shotFrom(*scene, i % 6, 0.3F, 0.6F, 64, random);
    const std::array<gpu::HemicubeView, 1> views{gpu::HemicubeView{shot.frame, 0.5F}};
    std::vector<std::uint32_t> by_formula, by_hardware;
    renderer->render(gpu::HemicubePass::kNodes, 64, views, counters, by_formula);
    renderer->render(gpu::HemicubePass::kPaper, 64, views, counters, by_hardware);
    for (std::size_t p = 0; p < by_formula.size(); ++p) {
      const auto& a = place[by_formula[p]];
      const auto& b = place[by_hardware[p]];
      ++seen;
      if (a.surface != b.surface) continue;
      ++same_surface;
      const auto apart = std::abs(static_cast<int>(a.level) - static_cast<int>(b.level));
      same += static_cast<std::size_t>(apart == 0);
      close += static_cast<std::size_t>(apart <= 1);
    }
  }
  const auto share = [&](std::size_t count) { return static_cast<double>(count) / static_cast<double>(seen); };
  RecordProperty("same_level_percent", static_cast<int>(100 * share(same)));
  RecordProperty("within_one_level_percent", static_cast<int>(100 * share(close)));
  std::printf("same level %.1f %%, within one %.1f %%\n", 100 * share(same), 100 * share(close));
  EXPECT_EQ(same_surface, seen);
  EXPECT_GT(share(close), 0.9);
  EXPECT_GT(share(same), 0.4);
}

TEST_F(Paper, FluxPerSurfaceAgreesWithTheFormula) {
  const auto scene = randomRoom(60, 4000, 3);
  auto made = gpu::makeInProcessTransport();
  ASSERT_TRUE(made.has_value());
  ASSERT_TRUE((*made)->setScene(scene).has_value());
  std::mt19937 random(5);
  solver::ShotBatch batch;
  batch.flux_scale = kFluxScale;
  for (std::uint32_t i = 0; i < 60; ++i) batch.scatter.push_back(shotFrom(*scene, i % 6, 0.4F, 0.7F, 64, random));
  auto formula = accumulators(*scene);
  ASSERT_TRUE((*made)->run(batch, formula).has_value());
  batch.mode = solver::LinkMode::kPaperMipmap;
  auto paper = accumulators(*scene);
  ASSERT_TRUE((*made)->run(batch, paper).has_value());
  for (std::uint32_t s = 0; s < scene->surfaces.size(); ++s) {
    const auto expected = fluxAt(*scene, formula, s, kFluxScale);
    EXPECT_NEAR(fluxAt(*scene, paper, s, kFluxScale), expected, 0.01 * expected + 1e-6) << "surface " << s;
  }
  EXPECT_EQ(paper.escaped, formula.escaped);
}

}  // namespace
}  // namespace radiosity::test
