// What is said of light that ends on backs.
#include "server/engine/lit/light_report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <memory>

#include "server/engine/lit/lit_scene.h"
#include "tests/scenes/glb_writer.h"
#include "tests/scenes/shapes.h"
#include "tests/unit/solver/quad_scene.h"

namespace radiosity::test {
namespace {

using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

test_scenes::Object panel(const std::string& name, double y, std::uint32_t material, double low = 0.0,
                          double high = 1.0) {
  test_scenes::Object object{name, {}, {}};
  object.polygons.push_back(
      {{{low, y, low}, {high, y, low}, {high, y, high}, {low, y, high}}, material});  // faces down
  return object;
}

/// Two floors that face down, the second aside, and right above each a lamp that does, too.
class LightOnBacks : public testing::Test {
 protected:
  void SetUp() override {
    test_scenes::TestScene scene;
    scene.name = "backs";
    scene.add({"tile", glm::dvec3(0.5), glm::dvec3(0.0)});
    scene.add({"sheet", glm::dvec3(0.5), glm::dvec3(0.0)});
    scene.add({"glow", glm::dvec3(0.0), glm::dvec3(100.0)});
    scene.objects = {panel("tiles", 0.0, 0), panel("lamp", 0.05, 2), panel("sheets", 0.0, 1, 5.0, 6.0),
                     panel("other", 0.05, 2, 5.0, 6.0)};
    auto document = scene::parseDocument("backs.glb", test_scenes::encodeGlb(scene));
    ASSERT_TRUE(document) << document.error().text();
    engine::SolveSettings settings;
    settings.target_error = 0.03;
    settings.texels = 400;
    auto made = engine::LitScene::make(std::move(*document), settings, transport_);
    ASSERT_TRUE(made) << made.error().text();
    lit_ = std::move(*made);
    ASSERT_TRUE(lit_->upload());
    (void)lit_->startSolve();
    for (;;) {
      const auto outcome = lit_->solver().step();
      ASSERT_TRUE(outcome) << outcome.error().text();
      if (*outcome == solver::StepOutcome::kConverged || *outcome == solver::StepOutcome::kExhausted) break;
    }
  }
  /// As if these materials were double-sided, and no light had been found on their backs.
  std::vector<std::string> reportOf(const std::vector<std::size_t>& double_sided,
                                    const solver::LightSources& sources = {}) {
    auto scene = lit_->scene();
    for (const auto m : double_sided) scene.materials[m].double_sided = true;
    engine::LightReport report;
    report.findLost({lit_->document(), scene, lit_->patches(), lit_->materials(), sources}, lit_->solver());
    return report.lost();
  }

  RayTransport transport_{400};
  std::unique_ptr<engine::LitScene> lit_;
};

TEST_F(LightOnBacks, OfSingleSidedFacesItIsToldHowBothAreLit) {
  const auto told = reportOf({});
  EXPECT_THAT(told, Contains(AllOf(HasSubstr("ends on backs of single-sided faces: "), HasSubstr("'tiles'"),
                                   HasSubstr("'sheets'"), HasSubstr("--double-sided"))));
  EXPECT_THAT(told, Not(Contains(HasSubstr("taken for dark"))));
}

TEST_F(LightOnBacks, OfDoubleSidedFacesItIsToldThatTheyWereTakenForDark) {
  const auto told = reportOf({0, 1});
  EXPECT_THAT(told, Contains(AllOf(HasSubstr("double-sided faces that were taken for dark: "), HasSubstr("'tiles'"),
                                   HasSubstr("--texels"))));
  EXPECT_THAT(told, Contains(AllOf(HasSubstr("lights nothing"), HasSubstr("taken for dark, those of"))));
  EXPECT_THAT(told, Not(Contains(HasSubstr("single-sided"))));
  EXPECT_THAT(told, Not(Contains(HasSubstr("--double-sided"))));
}

TEST_F(LightOnBacks, OfBothKindsEachIsToldItsOwn) {
  const auto told = reportOf({1});
  EXPECT_THAT(told, Contains(AllOf(HasSubstr("% of the light ends on backs of single-sided faces: "),
                                   HasSubstr("'tiles'"), Not(HasSubstr("'sheets'")))));
  EXPECT_THAT(told, Contains(AllOf(HasSubstr("% of the light ends on sides of double-sided faces"),
                                   HasSubstr("'sheets'"), Not(HasSubstr("'tiles'")))));
}

TEST_F(LightOnBacks, OfManyLampsOnlySomeAreAsked) {
  solver::LightSources sources;
  scene::PunctualLight upward;
  upward.kind = scene::LightKind::kSpot;
  upward.position = {0.0, 10.0, 0.0};
  upward.direction = {0.0, 1.0, 0.0};
  upward.intensity = glm::vec3(1e-6F);
  sources.lights.assign(998, upward);
  // With the two lamps that face the floors' backs as many as are asked.
  EXPECT_THAT(reportOf({}, sources), Contains(HasSubstr("980 more lamps light nothing")));
  EXPECT_THAT(reportOf({}, sources), Not(Contains(HasSubstr("not known"))));
  sources.lights.resize(1005, upward);
  EXPECT_THAT(reportOf({}, sources), Contains(HasSubstr("980 more lamps light nothing")));
  EXPECT_THAT(reportOf({}, sources), Contains(HasSubstr("whether 7 more lamps light anything is not known")));
}

}  // namespace
}  // namespace radiosity::test
