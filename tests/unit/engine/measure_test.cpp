// Measuring planes: they come and change by patches, without any change of the light, and are measured beside the
// solve.
#include <gmock/gmock.h>

#include <nlohmann/json.hpp>
#include <numbers>
#include <string>
#include <utility>

#include "tests/scenes/scenes.h"
#include "tests/unit/engine/block_room.h"
#include "tests/unit/engine/engine_driver.h"

namespace radiosity::test {
namespace {

using engine::PlaneVerdict;
using testing::HasSubstr;

class Planes : public EngineTest {
 protected:
  Result<engine::MeasureReport> measure(engine::MeasureRequest request = {}) {
    return call<engine::MeasureReport>(
        [&](auto done) { engine().measure(std::move(request), "test", std::move(done)); });
  }
  /// Appends node_, with a plane of 0.8 x 0.8 m in 3 x 3 points.
  Result<engine::PatchOutcome> add(const std::string& more = "", const std::string& place = "[1, 0.9, 1]") {
    node_ = std::to_string(nlohmann::json::parse(sceneText())["nodes"].size());
    return patch(R"([{"op": "add", "path": "/nodes/-", "value": {"name": "desk", "translation": )" + place +
                 R"(, "extras": {"radiosityPlane": {"width": 0.8, "depth": 0.8, "columns": 3, "rows": 3)" + more +
                 R"(}}}}, {"op": "add", "path": "/scenes/0/nodes/-", "value": )" + node_ + "}]");
  }
  /// Of node_.
  Result<engine::PatchOutcome> replace(const std::string& member, const std::string& value) {
    return patch(R"([{"op": "replace", "path": "/nodes/)" + node_ + "/" + member + R"(", "value": )" + value + "}]");
  }

  std::string node_;
};

TEST_F(Planes, OfASceneWithoutAnyAreNone) {
  solve(blockRoom());
  const auto report = measure();
  ASSERT_TRUE(report) << report.error().text();
  EXPECT_TRUE(report->planes.empty());
}

TEST_F(Planes, ThatPatchesBringAreMeasuredAndChangeNoLight) {
  solve(blockRoom());
  const auto before = light();
  const auto shots = status().shots;
  const auto added = add(R"(, "target": {"lux": 1})");
  ASSERT_TRUE(added) << added.error().text();
  EXPECT_EQ(added->affected_surfaces, 0U);
  EXPECT_EQ(added->affected_shots, 0U);
  const auto report = measure();
  ASSERT_TRUE(report) << report.error().text();
  EXPECT_EQ(report->revision, added->revision);
  ASSERT_EQ(report->planes.size(), 1U);
  const auto& plane = report->planes.front();
  EXPECT_EQ(std::to_string(plane.node), node_);
  EXPECT_EQ(plane.name, "desk");
  EXPECT_EQ(plane.illuminance.light.size(), 9U);
  EXPECT_GT(plane.illuminance.minimum, 1.0);
  EXPECT_GE(plane.illuminance.maximum, plane.illuminance.mean);
  EXPECT_LT(plane.illuminance.mean_error, 0.2 * plane.illuminance.mean);
  EXPECT_EQ(plane.lux_verdict, PlaneVerdict::kPasses);
  EXPECT_EQ(plane.verdict, PlaneVerdict::kPasses);
  EXPECT_FALSE(plane.uniformity_verdict);
  EXPECT_FALSE(plane.daylight_factor);
  EXPECT_EQ(light(), before);
  EXPECT_EQ(status().shots, shots);
  EXPECT_EQ(status().state, State::kConverged);
}

TEST_F(Planes, AreMeasuredToTheSameBits) {
  solve(blockRoom());
  ASSERT_TRUE(add());
  const auto first = measure(), second = measure();
  EXPECT_EQ(first->planes.front().illuminance.light, second->planes.front().illuminance.light);
  EXPECT_EQ(first->planes.front().illuminance.error, second->planes.front().illuminance.error);
}

TEST_F(Planes, FollowTheirNodeAndUndo) {
  solve(blockRoom());
  ASSERT_TRUE(add());
  const double high = measure()->planes.front().illuminance.mean;
  const auto before = light();
  ASSERT_TRUE(replace("translation", "[1, 0.1, 1]"));
  EXPECT_LT(measure()->planes.front().illuminance.mean, 0.9 * high) << "farther from the lamp";
  ASSERT_TRUE(replace("extras/radiosityPlane/columns", "5"));
  EXPECT_EQ(measure()->planes.front().illuminance.light.size(), 15U);
  EXPECT_EQ(light(), before);
  ASSERT_TRUE(undo());
  ASSERT_TRUE(undo());
  EXPECT_EQ(measure()->planes.front().illuminance.mean, high);
  ASSERT_TRUE(undo());
  EXPECT_TRUE(measure()->planes.empty());
}

TEST_F(Planes, ThatAreWrongAreRefusedByTheirPlace) {
  solve(blockRoom());
  ASSERT_TRUE(add());
  const auto refused = replace("extras/radiosityPlane/width", "0");
  ASSERT_FALSE(refused);
  EXPECT_THAT(refused.error().where, HasSubstr("/nodes/" + node_ + "/extras/radiosityPlane/width"));
  EXPECT_EQ(measure()->planes.size(), 1U);
}

TEST_F(Planes, AreFoundByNameAndByNumber) {
  solve(blockRoom());
  ASSERT_TRUE(add());
  EXPECT_EQ(measure({"desk", false})->planes.size(), 1U);
  EXPECT_EQ(measure({node_, false})->planes.size(), 1U);
  const auto unknown = measure({"nobody", false});
  ASSERT_FALSE(unknown);
  EXPECT_EQ(unknown.error().code, ErrorCode::kNotFound);
  EXPECT_EQ(unknown.error().where, "plane");
}

// In a closed room of one emission and reflectance the radiance is the same in all directions: E / (1 - rho)
// everywhere.
TEST_F(Planes, InAFurnaceHaveTheLightOfItsWalls) {
  solve(test_scenes::furnace(glm::dvec3(0.5), glm::dvec3(10.0)));
  const auto added = add("", "[0.5, 0.5, 0.5]");
  ASSERT_TRUE(added) << added.error().text();
  const auto report = measure();
  ASSERT_EQ(report->planes.size(), 1U);
  const auto& found = report->planes.front().illuminance;
  EXPECT_NEAR(found.mean, std::numbers::pi * 10.0 / 0.5, 0.5 + 3.0 * found.mean_error + found.solve_error);
  EXPECT_NEAR(found.uniformity, 1.0, 0.02);
}

TEST_F(Planes, WithinAClosedRoomHaveNoDaylight) {
  solve(blockRoom());
  ASSERT_TRUE(add());
  const auto report = measure({"", true});
  ASSERT_TRUE(report->planes.front().daylight_factor);
  EXPECT_EQ(report->planes.front().daylight_factor->maximum, 0.0);
}

TEST_F(Planes, OnASolveWhoseErrorNobodyKnowsAreUndecided) {
  ASSERT_TRUE(configure([](engine::SolveSettings& settings) { settings.method = Method::kPaper; }));
  solve(blockRoom());
  ASSERT_TRUE(add(R"(, "target": {"lux": 0.001, "uniformity": 0.001})"));
  EXPECT_EQ(measure()->planes.front().verdict, PlaneVerdict::kUndecided) << "paper does not know its sampling error";
}

}  // namespace
}  // namespace radiosity::test
