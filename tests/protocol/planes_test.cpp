// Measuring planes as CSV and as JSON that is wrong.
#include "protocol/planes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "protocol/http_bodies.h"

namespace radiosity::protocol {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;

Planes somePlanes() {
  Plane plane;
  plane.node = 7;
  plane.name = "=desk \"A\"";
  plane.columns = 2;
  plane.rows = 1;
  plane.first = {0.25, 0.75, 1.0};
  plane.across = {0.5, 0.0, 0.0};
  plane.wanted_lux = 500.0;
  plane.verdict = {"passes", "", "passes"};
  plane.illuminance.mean = 540.0;
  plane.illuminance.light = {520.0, 560.0};
  plane.illuminance.error = {1.5, 1.25};
  return {3, "converged", 0.02, {plane}};
}

TEST(PlanesCsv, HasALineForEachPlaneAndThenOneForEachPoint) {
  const auto text = planesCsv(somePlanes());
  EXPECT_THAT(text, HasSubstr("targetLux,targetUniformity,luxVerdict,uniformityVerdict,verdict\r\n"));
  EXPECT_THAT(text, HasSubstr(",500,,passes,,passes\r\n\r\nplane,node,column,row,x,y,z,lux,standardError\r\n"));
  EXPECT_THAT(text, HasSubstr("7,1,0,0.75,0.75,1,560,1.25\r\n"));
}

TEST(PlanesCsv, AllLinesOfATableHaveAsManyCells) {
  auto planes = somePlanes();
  planes.planes.push_back(planes.planes.front());
  planes.planes.back().daylight_factor = planes.planes.back().illuminance;
  planes.planes.front().name = planes.planes.back().name = "plain";
  const auto text = planesCsv(planes);
  const auto cells = [&](std::size_t line) {
    std::size_t begin = 0;
    for (; line > 0; --line) begin = text.find("\r\n", begin) + 2;
    const auto of = text.substr(begin, text.find("\r\n", begin) - begin);
    return std::count(of.begin(), of.end(), ',') + 1;
  };
  EXPECT_EQ(cells(1), cells(0));
  EXPECT_EQ(cells(2), cells(0));
}

TEST(PlanesCsv, ANameIsNoFormulaAndItsQuotesAreDoubled) {
  EXPECT_THAT(planesCsv(somePlanes()), HasSubstr("\"'=desk \"\"A\"\"\",7,"));
}

TEST(PlanesJson, ComesBackAsItWent) {
  const auto again = decodeHttpPlanes(encodeHttpPlanes(somePlanes()));
  ASSERT_TRUE(again) << again.error().text();
  EXPECT_EQ(encodeHttpPlanes(*again), encodeHttpPlanes(somePlanes()));
  EXPECT_EQ(again->planes.front().illuminance.light, (std::vector<double>{520.0, 560.0}));
}

TEST(PlanesJson, ThatIsWrongIsRefusedByItsPointer) {
  const auto refused = [](const std::string& where, const json& value) {
    auto text = json::parse(encodeHttpPlanes(somePlanes()));
    text[json::json_pointer(where)] = value;
    const auto planes = decodeHttpPlanes(text.dump());
    ASSERT_FALSE(planes) << where;
    EXPECT_EQ(planes.error().where, where);
  };
  refused("/planes/0/lux", {1.0});
  refused("/planes/0/columns", 0);
  refused("/planes/0/mean", -1.0);
  refused("/planes/0/verdict/all", "perhaps");
  refused("/planes/0/first", {1.0, 2.0});
  refused("/state", 7);
}

}  // namespace
}  // namespace radiosity::protocol
