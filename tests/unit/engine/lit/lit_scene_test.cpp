// What viewers see of an edit while it is being solved.
#include "server/engine/lit/lit_scene.h"

#include <gtest/gtest.h>

#include <cmath>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "server/scene/document/document.h"
#include "tests/scenes/glb_writer.h"
#include "tests/unit/engine/block_room.h"
#include "tests/unit/solver/quad_scene.h"

namespace radiosity::test {
namespace {

using engine::LitScene;

scene::EditedDocument roomDocument() {
  const auto bytes = test_scenes::encodeGlb(blockRoom());
  auto document = scene::parseDocument("room.glb", bytes);
  EXPECT_TRUE(document) << document.error().text();
  auto imported = scene::importScene(*document);
  EXPECT_TRUE(imported) << imported.error().text();
  return {std::move(*document), std::move(*imported)};
}

template <typename T>
T valueOf(Result<T> result) {
  EXPECT_TRUE(result) << result.error().text();
  return std::move(*result);
}

void solveToEnd(LitScene& lit) {
  for (;;) {
    const auto outcome = lit.solver().step();
    ASSERT_TRUE(outcome) << outcome.error().text();
    if (*outcome == solver::StepOutcome::kConverged) return;
    ASSERT_NE(*outcome, solver::StepOutcome::kExhausted);
  }
}

/// Which texels lie wholly on their surfaces. What is around them is drawn out from there and fitted to what is beyond
/// a seam, and may become darker where all else becomes brighter.
std::vector<bool> wholeTexels(const std::vector<scene::LightmapPage>& pages) {
  std::vector<bool> whole;
  for (const auto& page : pages) {
    for (const float part : page.coverage) whole.push_back(part >= 1.0F);
  }
  return whole;
}

/// Green light of all texels.
std::vector<float> lightOf(const std::vector<scene::LightmapPage>& pages) {
  std::vector<float> light;
  for (const auto& page : pages) {
    for (const auto& pixel : page.irradiance.pixels) light.push_back(pixel.y);
  }
  return light;
}

// Ten times a second somebody asks; scenes have as many warnings as materials.
TEST(LitScene, TellsSoManyWarningsAndHowManyThereAre) {
  auto edited = roomDocument();
  edited.scene.warnings = {"one", "two", "three"};
  engine::SolveSettings settings;
  settings.texels = 600;
  RayTransport transport(64);
  const auto lit = valueOf(LitScene::make(std::move(edited), settings, transport));
  (void)lit->startSolve();
  EXPECT_EQ(lit->warnings(2), (std::vector<std::string>{"one", "two"}));
  EXPECT_EQ(lit->warnings().size(), lit->warningCount());
  EXPECT_GE(lit->warningCount(), 3U);
  EXPECT_GT(lit->patchCount(), 500U);
  EXPECT_TRUE(lit->warnings(0).empty());
}

TEST(LitScene, ShadowsMoveBeforeReflectedLightIsKnown) {
  engine::SolveSettings settings;
  settings.target_error = 0.03;
  settings.texels = 600;
  RayTransport transport(400);
  const auto former = valueOf(LitScene::make(roomDocument(), settings, transport));
  auto& before = *former;
  ASSERT_TRUE(before.upload());
  before.startSolve();
  solveToEnd(before);
  const auto old_light = lightOf(before.pages());

  const auto patch =
      nlohmann::json::parse(R"([{"op":"replace","path":"/nodes/@block/translation","value":[1.3,0,1.3]}])");
  auto edited = valueOf(scene::editDocument(before.document(), patch, {}));
  const auto next = valueOf(LitScene::make(std::move(edited), settings, transport, &before));
  auto& after = *next;
  ASSERT_TRUE(after.upload());
  (void)after.succeed(before);
  ASSERT_TRUE(after.keepsLayoutOf(before));
  after.setSlowLinks(0);
  after.fadeFrom(before, true);
  after.startSolve(&before);
  EXPECT_FALSE(after.showDirectLight()) << "nothing of the new light is known";
  EXPECT_EQ(lightOf(after.shownPages()), old_light);

  while (!after.showDirectLight()) {
    const auto outcome = after.solver().step();
    ASSERT_TRUE(outcome) << outcome.error().text();
    ASSERT_EQ(*outcome, solver::StepOutcome::kSlice) << "reflected light was there as soon";
    ASSERT_TRUE(after.solver().isRepairing() || after.solver().isUnsettled());
  }
  const auto shown = lightOf(after.shownPages());
  EXPECT_FALSE(after.showDirectLight()) << "once for each edit";
  solveToEnd(after);
  const auto fresh = lightOf(after.pages());
  ASSERT_EQ(shown.size(), old_light.size());
  ASSERT_EQ(shown.size(), fresh.size());

  // Where a shadow came or went, what is shown at once lies nearer to the light to come than to what was.
  std::size_t darker = 0, brighter = 0, nearer = 0;
  for (std::size_t i = 0; i < shown.size(); ++i) {
    if (shown[i] < 0.6F * old_light[i]) {
      ++darker;
    } else if (shown[i] > old_light[i] / 0.6F) {
      ++brighter;
    } else {
      continue;
    }
    nearer += std::abs(shown[i] - fresh[i]) < std::abs(old_light[i] - fresh[i]) ? 1 : 0;
  }
  EXPECT_GT(darker, 10U);
  EXPECT_GT(brighter, 10U);
  EXPECT_GE(nearer, 9 * (darker + brighter) / 10);
}

TEST(LitScene, LampsAreSeenToChangeBeforeTheirReflectedLightIsKnown) {
  engine::SolveSettings settings;
  settings.target_error = 0.03;
  settings.texels = 600;
  RayTransport transport(400);
  const auto room = valueOf(LitScene::make(roomDocument(), settings, transport));
  auto& lit = *room;
  ASSERT_TRUE(lit.upload());
  lit.startSolve();
  solveToEnd(lit);
  const auto old_light = lightOf(lit.shownPages());
  const auto twice = [&](double strength) {
    auto patch = nlohmann::json::array();
    const auto& materials = lit.document().gltf["materials"];
    for (std::size_t m = 0; m < materials.size(); ++m) {
      const auto path =
          "/materials/" + std::to_string(m) + "/extensions/KHR_materials_emissive_strength/emissiveStrength";
      patch.push_back({{"op", "replace"}, {"path", path}, {"value", strength}});
    }
    auto edited = valueOf(scene::editDocument(lit.document(), patch, {}));
    const auto change = lit.changeTo(edited.scene);
    EXPECT_FALSE(change.geometry);
    lit.reshade(std::move(edited.document), std::make_shared<const scene::Scene>(std::move(edited.scene)), change);
  };
  double strength = 1.0;
  for (const auto& material : lit.document().gltf["materials"]) {
    const auto lamp = nlohmann::json::json_pointer("/extensions/KHR_materials_emissive_strength/emissiveStrength");
    if (material.contains(lamp)) strength = std::max(strength, material[lamp].get<double>());
  }
  twice(2.0 * strength);
  EXPECT_EQ(lightOf(lit.shownPages()), old_light) << "the light over few links is there soon enough";
  solveToEnd(lit);
  const auto doubled = lightOf(lit.shownPages());

  lit.setSlowLinks(0);
  twice(4.0 * strength);
  const auto shown = lightOf(lit.shownPages());
  EXPECT_TRUE(lit.solver().isUnsettled()) << "who looks does not wait for it";
  solveToEnd(lit);
  const auto fresh = lightOf(lit.shownPages());
  EXPECT_EQ(fresh, lightOf(lit.pages()));
  const auto whole = wholeTexels(lit.pages());
  std::size_t between = 0, direct = 0, outside = 0;
  for (std::size_t i = 0; i < shown.size(); ++i) {
    if (!whole[i]) continue;
    // How far texels are fitted depends on the noise of all the light that is shown: single ones by some hundredths.
    EXPECT_GE(shown[i], 0.95F * doubled[i]) << i;
    EXPECT_LE(shown[i], 1.05F * fresh[i]) << i;
    outside += shown[i] < 0.999F * doubled[i] || shown[i] > 1.001F * fresh[i] ? 1 : 0;
    between += shown[i] < 0.95F * fresh[i] ? 1 : 0;
    direct += shown[i] > 1.5F * doubled[i] ? 1 : 0;
  }
  EXPECT_LT(outside, shown.size() / 50);
  EXPECT_GT(between, shown.size() / 4) << "reflected light is that of before";
  EXPECT_GT(direct, shown.size() / 8) << "what the lamps light is theirs";
}

}  // namespace
}  // namespace radiosity::test
