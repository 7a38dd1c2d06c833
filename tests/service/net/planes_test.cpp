// Measuring planes over real sockets: by solve.measure, as JSON and as CSV.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "protocol/http_bodies.h"
#include "tests/service/net/replies.h"
#include "tests/service/net/running_server.h"
#include "tests/service/net/test_client.h"

namespace radiosity::testing {
namespace {

using namespace protocol;  // NOLINT: the test speaks the protocol
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::StartsWith;

TEST(MeasuringPlanes, AreMeasuredByACall) {
  RunningServer server;
  TestSocket socket(server.port());
  socket.hello();
  const auto reply = replyOf<Planes>(socket.call(SolveMeasureCall{"desk", true}));
  ASSERT_EQ(reply.planes.size(), 1U);
  const auto& plane = reply.planes.front();
  EXPECT_EQ(plane.name, "desk");
  EXPECT_EQ(plane.node, 4U);
  EXPECT_THAT(plane.illuminance.light, ElementsAre(100, 101, 102, 103, 104, 105));
  EXPECT_THAT(plane.pointAt(4), ElementsAre(1.5, 2.0, 3.25));
  EXPECT_EQ(plane.verdict.lux, "passes");
  EXPECT_EQ(plane.verdict.all, "passes");
  EXPECT_EQ(plane.verdict.uniformity, "");
  ASSERT_TRUE(plane.daylight_factor);
  EXPECT_EQ(plane.daylight_factor->light.size(), 6U);
  EXPECT_FALSE(replyOf<Planes>(socket.call(SolveMeasureCall{})).planes.front().daylight_factor);
}

TEST(MeasuringPlanes, ThatAreNotThereAreRefusedByTheirPointer) {
  RunningServer server;
  TestSocket socket(server.port());
  socket.hello();
  const auto answer = socket.call(SolveMeasureCall{"nobody"});
  EXPECT_EQ(codeOf(answer), -32004);
  ASSERT_TRUE(answer.error);
  EXPECT_EQ(answer.error->pointer, "/params/plane");
}

TEST(MeasuringPlanes, OfManyPointsComeWithoutThemInAMessageAndWithThemByHttp) {
  RunningServer server;
  TestSocket socket(server.port());
  socket.hello();
  const auto told = replyOf<Planes>(socket.call(SolveMeasureCall{"long", true}));
  EXPECT_EQ(told.planes.front().rows, 2000U);
  EXPECT_TRUE(told.planes.front().illuminance.light.empty());
  EXPECT_TRUE(told.planes.front().daylight_factor->light.empty());
  const auto got = request(server.port(), "GET", "/planes.json?plane=long");
  EXPECT_EQ(got.header("Content-Type"), "application/json");
  const auto planes = decodeHttpPlanes(got.body);
  ASSERT_TRUE(planes) << planes.error().text();
  EXPECT_EQ(planes->planes.front().illuminance.light.size(), 6000U);
}

TEST(MeasuringPlanes, AreATableByHttp) {
  RunningServer server;
  const auto got = request(server.port(), "GET", "/planes.csv?daylightFactor=true");
  EXPECT_EQ(got.status, 200);
  EXPECT_THAT(got.header("Content-Type"), StartsWith("text/csv"));
  EXPECT_THAT(got.body, HasSubstr("\"desk\",4,1,1,1.5,2,3.25,104,0.5,104,0.5\r\n"));
}

TEST(MeasuringPlanes, AskedForWronglyAreRefusedByHttp) {
  RunningServer server;
  const auto wrong = request(server.port(), "GET", "/planes.json?daylightFactor=1");
  EXPECT_EQ(wrong.status, 400);
  EXPECT_THAT(wrong.body, HasSubstr("?daylightFactor="));
  const auto unknown = request(server.port(), "GET", "/planes.csv?plane=nobody");
  EXPECT_EQ(unknown.status, 404);
  EXPECT_THAT(unknown.body, HasSubstr("?plane="));
}

}  // namespace
}  // namespace radiosity::testing
