// Links that an edit of geometry leaves alone, or mends in parts, are those that measuring all of them again finds.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <memory>
#include <nlohmann/json.hpp>
#include <vector>

#include "server/gpu/gpu_transport.h"
#include "server/scene/document.h"
#include "server/scene/lineage.h"
#include "server/solver/linked_solver.h"
#include "tests/scenes/glb_writer.h"
#include "tests/scenes/scenes.h"
#include "tests/unit/engine/block_room.h"

namespace radiosity {
namespace {

using nlohmann::json;
using solver::LinkedSolver;
using solver::StepOutcome;

struct Built {
  scene::Document document;
  scene::Scene scene;
  std::shared_ptr<const scene::PatchScene> patches;
  scene::PatchMaterials materials;
};

class GeometryEdit : public testing::Test {
 protected:
  static constexpr std::uint64_t kTexels = 1500;

  void start(const test_scenes::TestScene& scene) {
    before_.document = scene::parseDocument("room.glb", test_scenes::encodeGlb(scene)).value();
    before_.scene = scene::importScene(before_.document).value();
    build(before_, nullptr);
    transport_ = gpu::makeInProcessTransport().value();
    settings_.target_error = 0.05;
  }

  static void build(Built& built, const Built* former) {
    scene::ChartOptions charts;
    charts.texel_budget = kTexels;
    std::optional<scene::FormerScene> old;
    if (former != nullptr) old.emplace(scene::FormerScene{former->scene, *former->patches});
    built.patches = std::make_shared<const scene::PatchScene>(
        scene::buildPatchScene(built.scene, charts, old ? &*old : nullptr).value());
    built.materials = scene::shadePatches(built.scene, *built.patches);
  }

  Built edited(const Built& from, const json& patch) const {
    auto edit = scene::editDocument(from.document, patch).value();
    Built built{std::move(edit.document), std::move(edit.scene), nullptr, {}};
    build(built, &from);
    return built;
  }

  static void finish(LinkedSolver& solver) {
    for (int i = 0; i < 5000; ++i) {
      const auto outcome = solver.step();
      ASSERT_TRUE(outcome.has_value()) << outcome.error().text();
      if (*outcome == StepOutcome::kConverged || *outcome == StepOutcome::kExhausted) return;
    }
    FAIL() << "no end";
  }

  /// Until all links are true and light is solved for over them.
  static void settle(LinkedSolver& solver) {
    while (true) {
      const auto outcome = solver.step();
      ASSERT_TRUE(outcome.has_value()) << outcome.error().text();
      if (*outcome != StepOutcome::kSlice) return;
    }
  }

  std::unique_ptr<LinkedSolver> solved(const Built& built) {
    EXPECT_TRUE(transport_->setScene(built.patches));
    auto solver = std::make_unique<LinkedSolver>(built.patches, built.materials, *transport_, settings_);
    finish(*solver);
    return solver;
  }

  std::unique_ptr<LinkedSolver> successor(LinkedSolver& former, const Built& after, const scene::PatchMap& map) {
    EXPECT_TRUE(transport_->setScene(after.patches));
    auto solver = std::make_unique<LinkedSolver>(after.patches, after.materials, *transport_, settings_,
                                                 solver::LightSources{}, former, map);
    solver->beExact();
    settle(*solver);
    return solver;
  }

  static scene::PatchMap mapOf(const Built& before, const Built& after) {
    return scene::matchPatches(before.scene, *before.patches, after.scene, *after.patches);
  }

  /// Links are kept as 16 bits: 2^-12, twice over where their unit was another.
  static void expectSameLinks(const LinkedSolver& mended, const LinkedSolver& measured,
                              const scene::PatchScene& patches) {
    const auto &a = mended.system().shooters(), &b = measured.system().shooters();
    ASSERT_EQ(a.size(), b.size());
    const auto sides = solver::makeSides(patches);
    std::size_t differ = 0, compared = 0;
    for (std::size_t n = 0; n < a.size(); ++n) {
      for (std::size_t half = 0; half < 2; ++half) {
        const auto &x = a[n].column[half], &y = b[n].column[half];
        ASSERT_EQ(x.points(), y.points()) << n;
        EXPECT_NEAR(x.escaped(), y.escaped(), 1e-9);
        EXPECT_NEAR(x.absorbed(), y.absorbed(), 1e-9);
        EXPECT_NEAR(x.gain(), y.gain(), 1e-3);
        for (const auto& side : sides) {
          std::vector<float> u(side.leaf_count, 0.0F), v(side.leaf_count, 0.0F);
          (void)x.decode(side.first_value, u);
          (void)y.decode(side.first_value, v);
          for (std::size_t i = 0; i < u.size(); ++i) {
            ++compared;
            if (std::abs(u[i] - v[i]) > 0.0015F * std::max(u[i], v[i]) + 1e-6F) ++differ;
          }
        }
      }
    }
    EXPECT_GT(compared, 100'000U);
    EXPECT_EQ(differ, 0U) << "of " << compared;
  }

  /// The same edit twice: mended, and with everything measured again.
  void expectMendedIsMeasured(const json& patch) {
    SCOPED_TRACE(patch.dump());
    const auto after = edited(before_, patch);
    const auto first = solved(before_), second = solved(before_);
    const auto map = mapOf(before_, after);
    const auto mended = successor(*first, after, map);
    auto all = map;
    std::fill(all.leaf_altered.begin(), all.leaf_altered.end(), true);
    const auto measured = successor(*second, after, all);
    const auto counters = mended->linkCounters(), everything = measured->linkCounters();
    EXPECT_GT(counters.repaired, 0U);
    EXPECT_LT(everything.repaired, 10U) << "only lights, for all leaves";
    EXPECT_LT(counters.retaken, everything.retaken);
    expectSameLinks(*mended, *measured, *after.patches);
  }

  Built before_;
  std::unique_ptr<solver::Transport> transport_;
  solver::SolverSettings settings_;
};

json replaced(const std::string& path, json value) {
  return json::array({{{"op", "replace"}, {"path", path}, {"value", std::move(value)}}});
}

TEST_F(GeometryEdit, MovesMendTheLinksThatMeasuringAllFinds) {
  start(test::blockRoom());
  expectMendedIsMeasured(replaced("/nodes/2/translation", {0.75, 0.0, 0.65}));
  expectMendedIsMeasured(replaced("/nodes/2/translation", {0.6, 0.5, 0.6}));
  expectMendedIsMeasured(replaced("/nodes/2/rotation", {0.0, 0.38268343, 0.0, 0.92387953}));
  expectMendedIsMeasured(replaced("/nodes/2/scale", {0.5, 1.2, 0.5}));
  expectMendedIsMeasured(replaced("/nodes/1/translation", {0.9, 1.7, 1.0}));  // the lamp
}

TEST_F(GeometryEdit, WhatIsGoneOrAddedMendsTheLinksThatMeasuringAllFinds) {
  start(test::blockRoom());
  expectMendedIsMeasured(replaced("/nodes/2/extensions/KHR_node_visibility/visible", false));
  expectMendedIsMeasured(
      json::array({{{"op", "add"},
                    {"path", "/nodes/-"},
                    {"value", {{"mesh", before_.document.gltf["nodes"][2]["mesh"]}, {"translation", {1.2, 0.0, 1.2}}}}},
                   {{"op", "add"}, {"path", "/scenes/0/nodes/-"}, {"value", before_.document.gltf["nodes"].size()}}}));
}

// Where receivers look past their planes' edges, and at floor of which part is covered: beside a wall, a hair's breadth
// further, thin as a leaf, and tilted into the floor.
TEST_F(GeometryEdit, WhatStandsBesideAWallMendsTheLinksThatMeasuringAllFinds) {
  settings_.seed = 3;
  start(test::blockRoom());
  expectMendedIsMeasured(replaced("/nodes/2/translation", {0.301, 0.0, 0.302}));
  expectMendedIsMeasured(replaced("/nodes/2/scale", {0.02, 2.2, 0.02}));
  expectMendedIsMeasured(replaced("/nodes/2/rotation", {0.0871557, 0.0, 0.0, 0.9961947}));
  before_ = edited(before_, replaced("/nodes/2/translation", {0.31, 0.03, 0.6}));
  expectMendedIsMeasured(replaced("/nodes/2/translation", {0.3105, 0.03, 0.6}));
}

/// A room full of chairs, of which one is moved.
class ChairEdit : public GeometryEdit {
 protected:
  void SetUp() override {
    for (const auto& [name, make] : test_scenes::allScenes()) {
      if (name == "room_small") start(make());
    }
    const auto& nodes = before_.document.gltf["nodes"];
    for (std::size_t n = 0; n < nodes.size(); ++n) {
      auto at = nodes[n].value("translation", json::array());
      if (nodes[n].value("name", "") != "chair1") continue;
      at[0] = at[0].get<double>() + 0.15;
      move_ = replaced("/nodes/" + std::to_string(n) + "/translation", at);
    }
  }

  /// Area-weighted RMS, relative to that of `b`.
  static double difference(const LinkedSolver& a, const LinkedSolver& b, const scene::PatchScene& patches) {
    double sum = 0.0, scale = 0.0;
    for (const auto& side : solver::makeSides(patches)) {
      for (auto node = side.first_node; node < side.first_node + side.leaf_count; ++node) {
        const glm::dvec3 d(a.irradiance()[node] - b.irradiance()[node]), v(b.irradiance()[node]);
        sum += static_cast<double>(patches.node_area[node]) * glm::dot(d, d);
        scale += static_cast<double>(patches.node_area[node]) * glm::dot(v, v);
      }
    }
    return std::sqrt(sum / scale);
  }

  /// Links of lights that differ.
  static std::size_t unlikeLights(const LinkedSolver& a, const LinkedSolver& b, const scene::PatchScene& patches) {
    std::size_t differ = 0;
    for (std::size_t n = 0; n < a.system().shooters().size(); ++n) {
      const auto &x = a.system().shooters()[n], &y = b.system().shooters()[n];
      for (const auto& side : solver::makeSides(patches)) {
        std::vector<float> u(side.leaf_count, 0.0F), v(side.leaf_count, 0.0F);
        for (std::size_t half = 0; half < 2 && x.isLight(); ++half) {
          (void)x.column[half].decode(side.first_value, u);
          (void)y.column[half].decode(side.first_value, v);
          for (std::size_t i = 0; i < u.size(); ++i)
            differ += std::abs(u[i] - v[i]) > 0.0015F * std::max(u[i], v[i]) + 1e-6F ? 1 : 0;
        }
      }
    }
    return differ;
  }

  json move_;
};

TEST_F(ChairEdit, MendsTheLinksThatMeasuringAllFinds) {
  // With these seeds something that was moved far behind a leaf once decided whether that was lit.
  for (const std::uint64_t seed : {1U, 3U, 6U, 8U}) {
    SCOPED_TRACE(seed);
    settings_.seed = seed;
    expectMendedIsMeasured(move_);
  }
}

TEST_F(ChairEdit, ShowsLightBeforeItHasWhatMattersLittleAndHasAllInTheEnd) {
  const auto after = edited(before_, move_);
  const auto first = solved(before_), second = solved(before_);
  settings_.target_error = 0.1;  // so that no other samples are wanted
  const auto map = mapOf(before_, after);
  const auto exact = successor(*second, after, map);
  finish(*exact);
  LinkedSolver early(after.patches, after.materials, *transport_, settings_, {}, *first, map);
  finish(early);
  ASSERT_TRUE(early.isBehind());
  const auto waiting = early.linkCounters().waiting;
  EXPECT_GT(waiting, early.linkCounters().repaired / 4);
  // What is stated more than where all is measured; the solve before left most of the target.
  const auto stated = [&] {
    return std::sqrt(std::max(0.0, std::pow(early.error().total, 2.0) - std::pow(exact->error().total, 2.0)));
  };
  EXPECT_LT(difference(early, *exact, *after.patches), stated());
  EXPECT_LT(stated(), 0.5 * settings_.target_error) << "what may wait";
  // In other light too, the old links of what is stronger now included.
  auto brighter = after.materials;
  for (auto& emission : brighter.emission) emission *= 5.0F;
  early.setMaterials(brighter);
  exact->setMaterials(brighter);
  finish(early), finish(*exact);
  EXPECT_LT(difference(early, *exact, *after.patches), stated());
  EXPECT_LT(stated(), 0.75 * settings_.target_error);
  for (int i = 0; i < 1000 && early.isBehind(); ++i) ASSERT_TRUE(early.step());
  EXPECT_FALSE(early.isBehind());  // nobody steps any further then: the light is that of the links
  expectSameLinks(early, *exact, *after.patches);
  EXPECT_LT(difference(early, *exact, *after.patches), 1e-4);
}

TEST_F(ChairEdit, WithLittleRoomUnderTheTargetWaitsForLess) {
  const auto after = edited(before_, move_);
  const auto loose = solved(before_), tight = solved(before_);
  const auto map = mapOf(before_, after);
  const auto waiting = [&](LinkedSolver& former, double target) {
    settings_.target_error = target;
    LinkedSolver early(after.patches, after.materials, *transport_, settings_, {}, former, map);
    finish(early);
    EXPECT_LE(early.error().total, target);
    return early.linkCounters().waiting;
  };
  const double error = tight->error().total;
  EXPECT_LT(waiting(*tight, 1.05 * error), waiting(*loose, 2.0 * error));
}

TEST_F(ChairEdit, LightsLookWithFewPointsFirstWhereTheShadowsMayBeThatRough) {
  const auto after = edited(before_, move_);
  const auto measured = solved(before_), loose = solved(before_), tight = solved(before_);
  const auto map = mapOf(before_, after);
  const double error = tight->error().total;
  const auto exact = successor(*measured, after, map);
  const auto early = [&](LinkedSolver& former, double target) {
    settings_.target_error = target;
    auto solver = std::make_unique<LinkedSolver>(after.patches, after.materials, *transport_, settings_,
                                                 solver::LightSources{}, former, map);
    for (int i = 0; i < 1000 && solver->isRepairing(); ++i) EXPECT_TRUE(solver->step());
    return solver;
  };
  const auto rough = early(*loose, 2.0 * error), fine = early(*tight, 1.01 * error);
  EXPECT_GT(unlikeLights(*rough, *exact, *after.patches), 0U);
  EXPECT_FALSE(rough->directIrradiance().empty()) << "it is shown";
  ASSERT_TRUE(fine->step());
  EXPECT_TRUE(fine->isRepairing()) << "with more points";
  while (fine->isRepairing()) ASSERT_TRUE(fine->step());
  EXPECT_LT(unlikeLights(*fine, *exact, *after.patches), unlikeLights(*rough, *exact, *after.patches));
  ASSERT_TRUE(rough->step());
  EXPECT_FALSE(rough->isRepairing());
  finish(*rough);
  for (int i = 0; i < 1000 && rough->isBehind(); ++i) ASSERT_TRUE(rough->step());
  EXPECT_EQ(unlikeLights(*rough, *exact, *after.patches), 0U) << "in the end";
}

TEST_F(ChairEdit, OfASceneThatIsBehindCountsWhatWaitedForEarlierEdits) {
  const auto middle = edited(before_, move_);
  auto further = move_;
  further[0]["value"][0] = further[0]["value"][0].get<double>() + 0.15;
  const auto after = edited(middle, further);
  const auto first = solved(before_), second = solved(before_);
  settings_.target_error = 0.1;
  ASSERT_TRUE(transport_->setScene(middle.patches));
  LinkedSolver between(middle.patches, middle.materials, *transport_, settings_, {}, *first, mapOf(before_, middle));
  finish(between);
  ASSERT_TRUE(between.isBehind());
  const auto mended = successor(between, after, mapOf(middle, after));
  const auto exact = successor(*second, after, mapOf(before_, after));
  expectSameLinks(*mended, *exact, *after.patches);
}

TEST_F(ChairEdit, WhileItsLampIsOffIsMeasuredWhenItIsOn) {
  const auto after = edited(before_, move_);
  const auto first = solved(before_), second = solved(before_);
  settings_.target_error = 0.1;
  const auto exact = successor(*second, after, mapOf(before_, after));
  finish(*exact);
  auto dark = before_.materials;
  std::ranges::fill(dark.emission, glm::vec3(0.0F));
  ASSERT_TRUE(transport_->setScene(before_.patches));
  first->setMaterials(dark);
  finish(*first);
  ASSERT_TRUE(transport_->setScene(after.patches));
  auto dark_after = after.materials;
  std::ranges::fill(dark_after.emission, glm::vec3(0.0F));
  LinkedSolver early(after.patches, dark_after, *transport_, settings_, {}, *first, mapOf(before_, after));
  finish(early);
  EXPECT_GT(early.linkCounters().waiting, 0U);
  early.setMaterials(after.materials);
  finish(early);
  EXPECT_LT(difference(early, *exact, *after.patches), 0.3 * settings_.target_error);
}

TEST_F(GeometryEdit, EditsThatOvertakeEachOtherMendWhatTheyAllChanged) {
  start(test::blockRoom());
  const auto middle = edited(before_, replaced("/nodes/2/translation", {0.9, 0.3, 0.65}));
  const auto after = edited(middle, replaced("/nodes/2/translation", {1.2, 0.0, 1.1}));
  const auto first = solved(before_), second = solved(before_);
  LinkedSolver between(middle.patches, middle.materials, *transport_, settings_, {}, *first, mapOf(before_, middle));
  ASSERT_TRUE(transport_->setScene(middle.patches));
  ASSERT_TRUE(between.step().has_value());  // a part of it
  const auto mended = successor(between, after, mapOf(middle, after));
  auto all = mapOf(before_, after);
  std::fill(all.leaf_altered.begin(), all.leaf_altered.end(), true);
  expectSameLinks(*mended, *successor(*second, after, all), *after.patches);
}

TEST_F(GeometryEdit, ThereAndBackEndsWithTheSameLinks) {
  start(test::blockRoom());
  const auto away = edited(before_, replaced("/nodes/2/translation", {1.1, 0.2, 0.65}));
  const auto back = edited(away, replaced("/nodes/2/translation", before_.document.gltf["nodes"][2]["translation"]));
  const auto first = solved(before_), untouched = solved(before_);
  const auto moved = successor(*first, away, mapOf(before_, away));
  const auto returned = successor(*moved, back, mapOf(away, back));
  expectSameLinks(*returned, *untouched, *back.patches);
}

}  // namespace
}  // namespace radiosity
