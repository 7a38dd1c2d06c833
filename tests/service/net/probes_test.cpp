// Grids of probes over real sockets: as JSON, as bytes, and refused.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "protocol/probes.h"
#include "server/scene/values/probe_grid.h"
#include "tests/service/net/running_server.h"
#include "tests/service/net/test_client.h"

namespace radiosity::testing {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

static_assert(scene::kMostProbes == protocol::kMaxProbes && scene::kMostProbeGrids == protocol::kMaxProbeGrids);

TEST(LightProbes, AreJsonByHttp) {
  RunningServer server;
  const auto got = request(server.port(), "GET", "/probes.json?spacing=0.5");
  EXPECT_EQ(got.status, 200);
  EXPECT_EQ(got.header("Content-Type"), "application/json");
  EXPECT_THAT(got.body, HasSubstr("\"light\":[0,1,2,"));
  const auto probes = protocol::decodeHttpProbes(got.body);
  ASSERT_TRUE(probes) << probes.error().text();
  ASSERT_EQ(probes->grids.size(), 1U);
  EXPECT_FALSE(probes->grids[0].node) << "the whole scene";
  EXPECT_EQ(probes->grids[0].steps[0][0], 0.5);
}

TEST(LightProbes, AreThoseOfNodesWhereNoSpacingIsAsked) {
  RunningServer server;
  const auto probes = protocol::decodeHttpProbes(request(server.port(), "GET", "/probes.json").body);
  ASSERT_TRUE(probes) << probes.error().text();
  EXPECT_EQ(probes->grids[0].node, 4U);
}

TEST(LightProbes, AreBytesByHttp) {
  RunningServer server;
  const auto got = request(server.port(), "GET", "/probes.bin?spacing=0.5");
  EXPECT_EQ(got.header("Content-Type"), "application/octet-stream");
  EXPECT_THAT(got.body, StartsWith("RPRB"));
  EXPECT_GT(got.body.size(), protocol::kProbeNumbers * sizeof(float));
}

TEST(LightProbes, WithoutLightArePlacesAlone) {
  RunningServer server;
  const auto got = request(server.port(), "GET", "/probes.json?light=false&");
  EXPECT_EQ(got.status, 200);
  EXPECT_EQ(got.body.find("\"light\""), std::string::npos);
}

TEST(LightProbes, AskedForWronglyAreRefusedByTheirPlace) {
  RunningServer server;
  for (const char* wrong :
       {"spacing=0", "spacing=-1", "spacing=1e7", "spacing=nan", "spacing=1m", "spacing=", "light=1"}) {
    const auto got = request(server.port(), "GET", std::string("/probes.json?") + wrong);
    EXPECT_EQ(got.status, 400) << wrong;
    const std::string where = wrong[0] == 'l' ? "?light=" : "?spacing=";
    EXPECT_THAT(got.body, HasSubstr(where)) << wrong;
  }
  const auto alone = request(server.port(), "GET", "/probes.bin?light=false");
  EXPECT_EQ(alone.status, 400) << "its head would be that of a file with light";
  EXPECT_THAT(alone.body, HasSubstr("?light="));
  const auto many = request(server.port(), "GET", "/probes.bin?spacing=1e-6");
  EXPECT_EQ(many.status, 413);
  EXPECT_THAT(many.body, HasSubstr("?spacing="));
}

}  // namespace
}  // namespace radiosity::testing
