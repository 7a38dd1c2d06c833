// A solve that is saved and goes on elsewhere is the solve that was never interrupted, to the last bit.
#include <gtest/gtest.h>

#include "server/solver/pipeline/linked_solver.h"
#include "server/solver/shooting/shooting_solver.h"
#include "tests/unit/solver/quad_scene.h"
#include "tests/unit/solver/solve.h"

namespace radiosity::solver {
namespace {

using test::cubeQuads;
using test::makeQuadScene;
using test::RayTransport;
using test::solve;

constexpr std::size_t kRoom = std::size_t{64} << 20;

LightSources lamp(float candela) { return {{{.position = {0.1, 0.2, 0.0}, .intensity = glm::vec3(candela)}}, {}}; }

template <typename Kind>
class Saved : public testing::Test {
 protected:
  void SetUp() override {
    settings_.target_error = 0.01;
    ASSERT_TRUE(rays_.setScene(made_.patches));
  }
  std::unique_ptr<Kind> make(const LightSources& sources = lamp(5.0F)) {
    return std::make_unique<Kind>(made_.patches, made_.materials, rays_, settings_, sources);
  }
  /// As a new process would: from bytes alone.
  std::unique_ptr<Kind> goOn(const Kind& from) {
    ArchiveWriter to(kRoom);
    if (!from.save(to) || !to.fits()) return nullptr;
    auto next = make();
    ArchiveReader reader(to.bytes());
    return next->restore(reader) ? std::move(next) : nullptr;
  }
  void expectSame(const Kind& a, const Kind& b) {
    EXPECT_EQ(a.irradiance(), b.irradiance());
    EXPECT_EQ(a.unshot(), b.unshot());
    EXPECT_EQ(a.shotLevels(), b.shotLevels());
    EXPECT_EQ(a.linkCounters().samples, b.linkCounters().samples);
    EXPECT_EQ(a.rounds(), b.rounds());
    EXPECT_EQ(a.error().total, b.error().total);
    EXPECT_EQ(a.energy().absorbed, b.energy().absorbed);
  }

  test::QuadScene made_ = makeQuadScene(cubeQuads(6, {0, 4, 0, 0, 0, 0}, {0.5F, 0.5F, 0.6F, 0.5F, 0.5F, 0.5F}));
  SolverSettings settings_;
  RayTransport rays_{64};
};

using Kinds = testing::Types<LinkedSolver, ShootingSolver>;
TYPED_TEST_SUITE(Saved, Kinds);

TYPED_TEST(Saved, WhereverItWasInterruptedTheEndIsTheSame) {
  auto whole = this->make();
  solve(*whole);
  auto interrupted = this->make();
  int times = 0;
  for (int i = 0; i < 100000; ++i) {
    const auto outcome = interrupted->step();
    ASSERT_TRUE(outcome);
    if (*outcome == StepOutcome::kConverged) break;
    if (i % 3 != 0) continue;
    if (auto next = this->goOn(*interrupted)) {
      interrupted = std::move(next);
      ++times;
    }
  }
  EXPECT_GT(times, 3);
  this->expectSame(*interrupted, *whole);
}

TYPED_TEST(Saved, ADoneSolveIsStillDoneAndTakesEditsAsBefore) {
  auto solved = this->make();
  solve(*solved);
  auto next = this->goOn(*solved);
  ASSERT_TRUE(next);
  this->expectSame(*next, *solved);
  EXPECT_EQ(next->step().value(), StepOutcome::kConverged);
  for (auto* solver : {solved.get(), next.get()}) {
    solver->setLights(lamp(9.0F));
    solve(*solver);
  }
  this->expectSame(*next, *solved);
}

TYPED_TEST(Saved, EditsBeforeItAreInIt) {
  auto solved = this->make(lamp(2.0F));
  for (int i = 0; i < 20; ++i) ASSERT_TRUE(solved->step());
  solved->setLights(lamp(5.0F));
  solve(*solved);
  auto next = this->goOn(*solved);
  ASSERT_TRUE(next);
  this->expectSame(*next, *solved);
}

TYPED_TEST(Saved, InTheMiddleOfNewLampsItGoesOnWithTheNext) {
  LightSources many = lamp(5.0F);
  for (int i = 0; i < 5; ++i)
    many.lights.push_back({.position = {0.1 * i - 0.2, 0.1, 0.05 * i}, .intensity = glm::vec3(3.0F)});
  auto whole = this->make(), interrupted = this->make();
  for (auto* solver : {whole.get(), interrupted.get()}) {
    solve(*solver);
    solver->setLights(many);
  }
  solve(*whole);
  int times = 0;
  for (int i = 0; i < 8; ++i) {
    ASSERT_TRUE(interrupted->step());
    ArchiveWriter to(kRoom);
    if (!interrupted->save(to)) continue;
    auto next = this->make(many);
    ArchiveReader reader(to.bytes());
    ASSERT_TRUE(next->restore(reader));
    interrupted = std::move(next);
    ++times;
  }
  EXPECT_GT(times, 0);
  solve(*interrupted);
  this->expectSame(*interrupted, *whole);
}

TYPED_TEST(Saved, WhatIsCutShortOrOfAnotherSceneIsRefused) {
  auto solved = this->make();
  solve(*solved);
  ArchiveWriter to(kRoom);
  ASSERT_TRUE(solved->save(to));
  for (const std::size_t part : {0UL, 3UL, to.bytes().size() / 2, to.bytes().size() - 1}) {
    ArchiveReader reader(std::span(to.bytes()).first(part));
    EXPECT_FALSE(this->make()->restore(reader)) << part;
  }
  const auto other = makeQuadScene(cubeQuads(5, {0, 4, 0, 0, 0, 0}, {0.5F, 0.5F, 0.5F, 0.5F, 0.5F, 0.5F}));
  TypeParam elsewhere(other.patches, other.materials, this->rays_, this->settings_);
  ArchiveReader reader(to.bytes());
  EXPECT_FALSE(elsewhere.restore(reader));
}

TYPED_TEST(Saved, NeverTakesMoreThanItMay) {
  auto solved = this->make();
  solve(*solved);
  ArchiveWriter to(1000);
  (void)solved->save(to);
  EXPECT_FALSE(to.fits());
  EXPECT_LE(to.bytes().size(), 1000U);
}

// The renderer of this test knows no pixels, but those of the real one depend on how far the solve has come: a panel
// that is lit after a small error was reached shows finer ones.
TEST(SavedLinks, GoOnWithTheSamePixels) {
  auto quads = cubeQuads(6, {0, 4, 0, 0, 0, 0}, {0.5F, 0.5F, 0.6F, 0.5F, 0.5F, 0.5F});
  quads.push_back({{-0.1F, 0.3F, -0.1F}, {0.2F, 0, 0}, {0, 0, 0.2F}, 4, 4, glm::vec3(0.0F), glm::vec3(0.0F)});
  const auto made = makeQuadScene(quads);
  RayTransport rays(64);
  ASSERT_TRUE(rays.setScene(made.patches));
  SolverSettings settings;
  settings.target_error = 2e-3;
  LinkedSolver whole(made.patches, made.materials, rays, settings);
  (void)test::runToEnd(whole);
  ArchiveWriter to(kRoom);
  ASSERT_TRUE(whole.save(to));
  LinkedSolver next(made.patches, made.materials, rays, settings);
  ArchiveReader from(to.bytes());
  ASSERT_TRUE(next.restore(from));
  auto lit = made.materials;
  for (std::uint32_t leaf = 0; leaf < 16; ++leaf)
    lit.emission.set(made.patches->surfaces[6].first_node[0] + leaf, glm::vec3(leaf % 2 == 0 ? 99.0F : 101.0F));
  std::uint32_t most = 0;
  for (auto* solver : {&whole, &next}) {
    solver->setMaterials(lit);
    (void)test::runToEnd(*solver);
  }
  const auto &a = whole.system().shooters(), &b = next.system().shooters();
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t n = 0; n < a.size(); ++n) {
    EXPECT_EQ(a[n].resolution, b[n].resolution) << n;
    if (!a[n].isLight()) most = std::max(most, a[n].resolution);
  }
  EXPECT_GT(most, settings.planner.node_resolution);
  EXPECT_EQ(whole.irradiance(), next.irradiance());
}

}  // namespace
}  // namespace radiosity::solver
