// Light is told for the normals that files give, and carried by those that surfaces have.
#include "server/solver/reflected/leaf_shading.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "server/solver/pipeline/linked_solver.h"
#include "tests/unit/solver/quad_scene.h"
#include "tests/unit/solver/solve.h"

namespace radiosity::solver {
namespace {

using test::cubeQuads;
using test::makeQuadScene;
using test::Quad;
using test::RayTransport;

/// The quads of a scene as a file would have them: one instance each, with such a normal at all corners; 0: none.
std::shared_ptr<const scene::ShadingNormals> normalsOf(const test::QuadScene& made, std::vector<glm::vec3> by_quad) {
  scene::Scene scene;
  auto patches = *made.patches;
  patches.triangle_source.assign(patches.triangles.size(), 0);
  for (std::uint32_t s = 0; s < patches.surfaces.size(); ++s) {
    auto& surface = patches.surfaces[s];
    surface.instance = s;
    scene::Primitive primitive;
    for (std::uint32_t t = 0; t < surface.triangle_count; ++t) {
      patches.triangle_source[surface.first_triangle + t] = t;
      for (std::uint32_t k = 0; k < 3; ++k) {
        const auto& vertex = patches.vertices[patches.indices[3 * (surface.first_triangle + t) + k]];
        primitive.indices.push_back(static_cast<std::uint32_t>(primitive.positions.size()));
        primitive.positions.emplace_back(vertex.position);
        if (by_quad[s] != glm::vec3(0.0F)) primitive.normals.push_back(glm::normalize(by_quad[s]));
      }
    }
    scene.primitives.push_back(std::move(primitive));
    scene.instances.emplace_back().primitive = s;
  }
  return std::make_shared<const scene::ShadingNormals>(scene, patches);
}

struct Solve {
  Solve(test::QuadScene scene, const std::vector<glm::vec3>& normals, double target, const LightSources& sources = {},
        SolverSettings settings = {})
      : made(std::move(scene)), normals(normalsOf(made, normals)) {
    settings.target_error = target;
    EXPECT_TRUE(rays.setScene(made.patches));
    solver = std::make_unique<LinkedSolver>(made.patches, made.materials, rays, settings, sources);
    solver->shadeFor(this->normals);
    test::runToEnd(*solver);
  }
  [[nodiscard]] double at(std::size_t surface, std::uint32_t x, std::uint32_t y) const {
    const auto& of = made.patches->surfaces[surface];
    return static_cast<double>(solver->irradiance()[of.first_node[0] + y * of.width + x].x);
  }
  [[nodiscard]] double mean(std::size_t surface) const {
    const auto& of = made.patches->surfaces[surface];
    double sum = 0.0;
    for (std::uint32_t y = 0; y < of.height; ++y)
      for (std::uint32_t x = 0; x < of.width; ++x) sum += at(surface, x, y);
    return sum / (of.width * of.height);
  }

  test::QuadScene made;
  std::shared_ptr<const scene::ShadingNormals> normals;
  RayTransport rays{64};
  std::unique_ptr<LinkedSolver> solver;
};

/// A black floor of side 1 under a lamp half as wide, one above it; the lamp's radiosity is 1.
test::QuadScene floorAndLamp() {
  return makeQuadScene({{{-0.5F, 0, -0.5F}, {0, 0, 1}, {1, 0, 0}, 8, 8},
                        {{-0.25F, 1, -0.25F}, {0.5F, 0, 0}, {0, 0, 0.5F}, 4, 4, glm::vec3(1.0F)}});
}

/// By a sum over a grid of the lamp's points, of cosines with any normal where the floor's own sees them.
double sumOverLamp(const glm::dvec3& at, const glm::dvec3& normal) {
  constexpr int kGrid = 200;
  double sum = 0.0;
  for (int i = 0; i < kGrid * kGrid; ++i) {
    const glm::dvec3 from((i % kGrid + 0.5) / kGrid * 0.5 - 0.25, 1.0, (i / kGrid + 0.5) / kGrid * 0.5 - 0.25);
    const auto way = from - at;
    const double square = glm::dot(way, way);
    sum += std::max(0.0, glm::dot(normal, way)) * way.y / (square * square);
  }
  return sum * 0.25 / (kGrid * kGrid) / std::numbers::pi;
}

TEST(ShadedLeaves, ALampCountsByTheCosineWithTheShadingNormal) {
  for (const auto& normal : {glm::vec3(0.5F, 1.0F, 0.2F), glm::vec3(-2.0F, 0.3F, 0.0F)}) {  // the latter cuts the lamp
    const Solve solved(floorAndLamp(), {normal, glm::vec3(0.0F)}, 0.005);
    for (const auto& [x, y] : {std::pair{0U, 0U}, {7U, 7U}, {3U, 4U}, {0U, 7U}}) {
      const glm::dvec3 at((x + 0.5) / 8.0 - 0.5, 0.0, (y + 0.5) / 8.0 - 0.5);
      // Quads lie along z first, so that rows of leaves are along x.
      const double exact = sumOverLamp({at.z, 0.0, at.x}, glm::normalize(glm::dvec3(normal)));
      EXPECT_NEAR(solved.at(0, x, y), exact, 0.004 * exact + 2e-4) << x << ", " << y;  // of 11 bits, and of the grid
    }
  }
}

TEST(ShadedLeaves, NothingComesFromBelowTheHorizonOfTheSurface) {
  // Towards a lamp that stands on the floor's other side.
  const Solve solved(makeQuadScene({{{-0.5F, 0, -0.5F}, {0, 0, 1}, {1, 0, 0}, 4, 4},
                                    {{-0.25F, -0.5F, -0.25F}, {0, 0, 0.5F}, {0.5F, 0, 0}, 4, 4, glm::vec3(1.0F)}}),
                     {glm::vec3(1.0F, 0.1F, 0.0F), glm::vec3(0.0F)}, 0.01);
  EXPECT_EQ(solved.mean(0), 0.0);
}

TEST(ShadedLeaves, TheSunCountsByTheCosineWithTheShadingNormal) {
  LightSources sun;
  sun.lights.push_back({.kind = scene::LightKind::kDirectional,
                        .direction = glm::normalize(glm::dvec3(-1.0, -1.0, 0.0)),
                        .intensity = glm::vec3(100.0F)});
  const Quad floor{{-0.5F, 0, -0.5F}, {0, 0, 1}, {1, 0, 0}, 4, 4};
  const double root = std::sqrt(0.5);
  const auto light = [&](const glm::vec3& normal) {
    return Solve(makeQuadScene({floor}), {normal}, 0.01, sun).mean(0);
  };
  EXPECT_NEAR(light(glm::vec3(0.0F)), 100.0 * root, 0.05);
  EXPECT_NEAR(light(glm::vec3(1.0F, 1.0F, 0.0F)), 100.0, 0.05);
  EXPECT_NEAR(light(glm::vec3(0.6F, 0.8F, 0.0F)), 140.0 * root, 0.05);
  EXPECT_EQ(light(glm::vec3(-1.0F, 0.5F, 0.0F)), 0.0) << "behind the shading normal";
}

TEST(ShadedLeaves, APointCountsByTheCosineWithTheShadingNormal) {
  LightSources lamp;
  lamp.lights.push_back({.position = {0.2, 0.7, -0.1}, .intensity = glm::vec3(10.0F)});
  const Solve solved(makeQuadScene({{{-0.5F, 0, -0.5F}, {0, 0, 1}, {1, 0, 0}, 8, 8}}), {{0.4F, 1.0F, -0.3F}}, 0.01,
                     lamp);
  const auto normal = glm::normalize(glm::dvec3(0.4, 1.0, -0.3));
  for (const auto& [x, y] : {std::pair{0U, 0U}, {7U, 2U}, {4U, 4U}}) {
    const auto way = glm::dvec3(0.2, 0.7, -0.1) - glm::dvec3((y + 0.5) / 8.0 - 0.5, 0.0, (x + 0.5) / 8.0 - 0.5);
    const double exact = 10.0 * glm::dot(normal, way) / std::pow(glm::length(way), 3.0);
    EXPECT_NEAR(solved.at(0, x, y), exact, 0.002 * exact);
  }
}

/// All around is as bright as all else: of it so much as lies above both horizons arrives.
TEST(ShadedLeaves, ReflectedLightCountsByTheCosineWithTheShadingNormal) {
  std::array<float, 6> shines{}, reflects{};
  shines.fill(1.0F);
  reflects.fill(0.5F);
  const auto made = makeQuadScene(cubeQuads(6, shines, reflects));
  for (const double tilt : {10.0, 30.0, 50.0}) {
    std::vector<glm::vec3> normals;
    for (const auto& surface : made.patches->surfaces) {
      const auto& frame = made.patches->triangles[surface.first_triangle];
      const double angle = tilt * std::numbers::pi / 180.0;
      normals.push_back(glm::vec3(std::cos(angle) * glm::dvec3(frame.normal) +
                                  std::sin(angle) * glm::dvec3(glm::normalize(frame.du))));
    }
    normals[2] = glm::vec3(0.0F);
    const Solve solved(made, normals, 0.01);
    const double whole = 1.0 / (1.0 - 0.5), both = 0.5 * (1.0 + std::cos(tilt * std::numbers::pi / 180.0));
    EXPECT_NEAR(solved.mean(2), whole, 0.002 * whole);
    for (const std::size_t s : {0U, 1U, 3U, 4U, 5U}) EXPECT_NEAR(solved.mean(s), both * whole, 0.004 * whole) << tilt;
  }
}

/// Nodes that shine count by some of their points, which near by are a coarse picture of them; a lamp by its polygon.
TEST(ShadedLeaves, LightOfABrightNodeCountsByTheCosineWithTheShadingNormal) {
  auto quads = cubeQuads(6, test::kDark, test::kDark);
  quads.push_back({{-0.1F, 0.3F, -0.1F}, {0.2F, 0, 0}, {0, 0, 0.2F}, 4, 4, glm::vec3(100.0F), glm::vec3(0.0F)});
  const auto lamp = makeQuadScene(quads);
  auto nodes = makeQuadScene(quads);
  const auto& panel = nodes.patches->surfaces[6];
  for (std::uint32_t leaf = 0; leaf < panel.width * panel.height; ++leaf)
    nodes.materials.emission.set(panel.first_node[0] + leaf, glm::vec3(leaf % 2 == 0 ? 99.0F : 101.0F));
  std::vector<glm::vec3> normals(7, glm::vec3(0.0F));
  const auto& frame = lamp.patches->triangles[lamp.patches->surfaces[0].first_triangle];
  normals[0] =
      glm::vec3(std::cos(0.5) * glm::dvec3(frame.normal) + std::sin(0.5) * glm::dvec3(glm::normalize(frame.du)));
  const Solve of_lamp(lamp, normals, 0.01), of_nodes(nodes, normals, 0.01);
  const auto isNode = [](const Shooter& shooter) { return !shooter.isLight(); };
  EXPECT_TRUE(std::ranges::any_of(of_nodes.solver->system().shooters(), isNode));
  EXPECT_FALSE(std::ranges::any_of(of_lamp.solver->system().shooters(), isNode));
  EXPECT_NEAR(of_nodes.mean(0), of_lamp.mean(0), 0.03 * of_lamp.mean(0));
}

/// A wall under a sky that shines above the horizon alone: the quarter of all directions that it sees is as far from
/// even as light gets.
TEST(ShadedLeaves, LightFromOneSideCountsByTheCosineWithTheShadingNormal) {
  LightSources sky;
  sky.sky = {glm::vec3(1.0F), glm::vec3(0.0F)};
  const Quad wall{{0, -0.5F, -0.5F}, {0, 1, 0}, {0, 0, 1}, 8, 8};
  const auto light = [&](double tilt) {
    const glm::vec3 normal(glm::dvec3(std::cos(tilt), std::sin(tilt), 0.0));
    return Solve(makeQuadScene({wall}), {tilt == 0.0 ? glm::vec3(0.0F) : normal}, 0.005, sky).mean(0);
  };
  const double quarter = 0.5 * std::numbers::pi;
  EXPECT_NEAR(light(0.0), quarter, 0.005 * quarter);
  // The mean of 64 leaves; what is left is mostly that rays near the horizon count as if they were a little above it.
  for (const double tilt : {0.2, 0.5}) {
    const double up = quarter * (std::cos(tilt) + std::sin(tilt)), down = quarter * (1.0 - std::sin(tilt));
    EXPECT_NEAR(light(tilt), up, 0.01 * up) << tilt;
    EXPECT_NEAR(light(-tilt), down, 0.02 * down) << tilt;
  }
}

TEST(ShadedLeaves, NormalsOfTheFacesThemselvesChangeNoBit) {
  const auto made = makeQuadScene(cubeQuads(6, {0, 4, 0, 0, 0, 0}, test::kGrey));
  std::vector<glm::vec3> own, none(6, glm::vec3(0.0F));
  for (const auto& surface : made.patches->surfaces)
    own.push_back(made.patches->triangles[surface.first_triangle].normal);
  const Solve with(made, own, 0.01), without(made, none, 0.01);
  EXPECT_TRUE(with.normals->empty());
  EXPECT_EQ(with.solver->irradiance(), without.solver->irradiance());
  EXPECT_EQ(with.solver->halfIrradiance(1), without.solver->halfIrradiance(1));
}

TEST(ShadedLeaves, LightIsCarriedByGeometryWhateverTheNormals) {
  const auto made = makeQuadScene(cubeQuads(6, {0, 4, 0, 0, 0, 0}, test::kGrey));
  std::vector<glm::vec3> tilted(6, glm::vec3(0.0F));
  tilted[0] = {0.5F, 1.0F, 0.0F};
  const Solve with(made, tilted, 0.01), without(made, std::vector<glm::vec3>(6, glm::vec3(0.0F)), 0.01);
  EXPECT_NE(with.mean(0), without.mean(0));
  for (std::size_t s = 1; s < 6; ++s) EXPECT_EQ(with.mean(s), without.mean(s)) << s;
  EXPECT_EQ(with.solver->error().total, without.solver->error().total);
}

TEST(ShadedLeaves, OfLightThatWasEditedAndOfASolveThatWasSaved) {
  auto made = makeQuadScene(cubeQuads(6, {0, 4, 0, 0, 0, 0}, test::kGrey));
  std::vector<glm::vec3> tilted(6, glm::vec3(0.0F));
  tilted[0] = {0.5F, 1.0F, 0.0F};
  Solve solved(made, tilted, 0.01);
  const auto before = solved.solver->irradiance();
  ArchiveWriter to(std::size_t{64} << 20);
  ASSERT_TRUE(solved.solver->save(to));
  LinkedSolver next(made.patches, made.materials, solved.rays, [] {
    SolverSettings settings;
    settings.target_error = 0.01;
    return settings;
  }());
  next.shadeFor(solved.normals);
  ArchiveReader from(to.bytes());
  ASSERT_TRUE(next.restore(from));
  EXPECT_EQ(next.irradiance(), before);
  // Twice the light, and back.
  auto brighter = makeQuadScene(cubeQuads(6, {0, 8, 0, 0, 0, 0}, test::kGrey));
  for (auto* solver : {solved.solver.get(), &next}) {
    solver->setMaterials(brighter.materials);
    test::runToEnd(*solver);
  }
  EXPECT_EQ(next.irradiance(), solved.solver->irradiance());
  const auto node = made.patches->surfaces[0].first_node[0] + 7;
  EXPECT_NEAR(static_cast<double>(next.irradiance()[node].x / before[node].x), 2.0, 1e-3);
  next.setMaterials(made.materials);
  test::runToEnd(next);
  EXPECT_EQ(next.irradiance(), before);
}

}  // namespace
}  // namespace radiosity::solver
