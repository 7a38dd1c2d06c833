// Scenes before and after an edit of geometry, and solvers of both.
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "server/gpu/workers/gpu_transport.h"
#include "server/scene/charts/build.h"
#include "server/scene/document/document.h"
#include "server/scene/shading/shade.h"
#include "server/scene/values/lineage.h"
#include "server/solver/pipeline/linked_solver.h"
#include "tests/scenes/glb_writer.h"
#include "tests/scenes/scenes.h"

namespace radiosity::test {

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
  static constexpr std::uint32_t kGlintsApart = 32;

  void start(const test_scenes::TestScene& scene) {
    before_.document = scene::parseDocument("room.glb", test_scenes::encodeGlb(scene)).value();
    before_.scene = scene::importScene(before_.document).value();
    build(before_, nullptr);
    transport_ = gpu::makeInProcessTransport().value();
    settings_.target_error = 0.05;
  }

  void build(Built& built, const Built* former) const {
    scene::ChartOptions charts;
    charts.texel_budget = kTexels;
    std::optional<scene::FormerScene> old;
    if (former != nullptr) old.emplace(scene::FormerScene{former->scene, *former->patches});
    built.patches = std::make_shared<const scene::PatchScene>(
        scene::buildPatchScene(built.scene, charts, old ? &*old : nullptr).value());
    built.materials = scene::shadePatches(built.scene, *built.patches);
    if (has_glints_) addGlints(built);
  }

  /// Single leaves of what is no lamp shine so brightly that they shoot.
  static void addGlints(Built& built) {
    for (const auto& side : solver::makeSides(*built.patches)) {
      const auto of_side = built.materials.emission.side(side.number);
      if (of_side[0] != glm::vec3(0.0F)) continue;
      for (std::uint32_t leaf = 7; leaf < side.leaf_count; leaf += kGlintsApart)
        built.materials.emission.set(side.first_node + leaf, glm::vec3(1e5F + 100.0F * static_cast<float>(leaf % 3)));
    }
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

  /// Links are kept as 16 bits: 2^-12, twice over where their unit was another. `lost`: of what is sent, to which what
  /// escapes and is absorbed is known.
  static void expectSameLinks(const LinkedSolver& mended, const LinkedSolver& measured,
                              const scene::PatchScene& patches, double lost = 0.0) {
    const auto &a = mended.system().shooters(), &b = measured.system().shooters();
    ASSERT_EQ(a.size(), b.size());
    const auto sides = solver::makeSides(patches);
    std::size_t differ = 0, compared = 0;
    for (std::size_t n = 0; n < a.size(); ++n) {
      for (std::size_t half = 0; half < 2; ++half) {
        const auto &x = a[n].column[half], &y = b[n].column[half];
        ASSERT_EQ(x.points(), y.points()) << n;
        EXPECT_NEAR(x.escaped(), y.escaped(), lost * a[n].area + 1e-9);
        EXPECT_NEAR(x.absorbed(), y.absorbed(), lost * a[n].area + 1e-9);
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

  static std::uint64_t shotsOfLights(const LinkedSolver& solver) {
    std::uint64_t shots = 0;
    for (const auto& shooter : solver.system().shooters()) {
      for (const auto& column : shooter.column)
        if (shooter.isLight())
          shots += (static_cast<std::uint64_t>(column.points()) + solver::kLightPoints - 1) / solver::kLightPoints;
    }
    return shots;
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
    EXPECT_LE(everything.repaired, shotsOfLights(*measured)) << "only lights, for all leaves";
    EXPECT_LT(counters.retaken, everything.retaken);
    expectSameLinks(*mended, *measured, *after.patches);
  }

  /// Area-weighted RMS, relative to that of `b`.
  static double difference(const LinkedSolver& a, const LinkedSolver& b, const scene::PatchScene& patches) {
    double sum = 0.0, scale = 0.0;
    const auto light_a = a.irradiance(), light_b = b.irradiance();
    for (const auto& side : solver::makeSides(patches)) {
      for (auto node = side.first_node; node < side.first_node + side.leaf_count; ++node) {
        const glm::dvec3 d(light_a[node] - light_b[node]), v(light_b[node]);
        sum += static_cast<double>(patches.node_area[node]) * glm::dot(d, d);
        scale += static_cast<double>(patches.node_area[node]) * glm::dot(v, v);
      }
    }
    return std::sqrt(sum / scale);
  }

  Built before_;
  std::unique_ptr<solver::Transport> transport_;
  solver::SolverSettings settings_;
  bool has_glints_ = false;
};

inline json replaced(const std::string& path, json value) {
  return json::array({{{"op", "replace"}, {"path", path}, {"value", std::move(value)}}});
}

/// A room full of chairs, of which one is moved.
class ChairRoom : public GeometryEdit {
 protected:
  void SetUp() override {
    for (const auto& [name, make] : test_scenes::allScenes()) {
      if (name == "room_small") start(make());
    }
    const auto& nodes = before_.document.gltf["nodes"];
    for (std::size_t n = 0; n < nodes.size(); ++n) {
      auto at = nodes[n].value("translation", json::array());
      if (nodes[n].value("name", "") != "chair1") continue;
      home_ = at;
      at[0] = at[0].get<double>() + 0.15;
      move_ = replaced("/nodes/" + std::to_string(n) + "/translation", at);
    }
  }

  json move_, home_;  ///< the patch; where the chair was
};

}  // namespace radiosity::test
