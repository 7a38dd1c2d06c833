// Photometric webs of lamps over real sockets.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/service/net/running_server.h"
#include "tests/service/net/test_client.h"

namespace radiosity::testing {
namespace {

using ::testing::HasSubstr;

TEST(Webs, ComeByTheIndexOfTheirLight) {
  RunningServer server;
  const auto got = request(server.port(), "GET", "/webs/2.json");
  EXPECT_EQ(got.status, 200);
  EXPECT_EQ(got.header("Content-Type"), "application/json");
  const auto web = nlohmann::json::parse(got.body);
  EXPECT_EQ(web["lumens"], 12.0);
  EXPECT_EQ(web["candelaMost"], 500.0);
  EXPECT_EQ(web["axis"], nlohmann::json({0.0, 0.0, -1.0}));
  EXPECT_EQ(web["across"], nlohmann::json({1.0, 0.0, 0.0}));
  EXPECT_EQ(web["polar"], nlohmann::json({0.0, 30.0, 60.0}));
  EXPECT_EQ(web["azimuth"], nlohmann::json({0.0}));
  EXPECT_EQ(web["candela"], nlohmann::json({500.0, 250.0, 0.0}));
}

TEST(Webs, ThatAreNotThereAreRefused) {
  RunningServer server;
  EXPECT_EQ(request(server.port(), "GET", "/webs/3.json").status, 404);
  for (const auto* path : {"/webs/-1.json", "/webs/2", "/webs/2.ies", "/webs/99999999999.json"}) {
    const auto wrong = request(server.port(), "GET", path);
    EXPECT_EQ(wrong.status, 404) << path;
    EXPECT_THAT(wrong.body, HasSubstr("/webs/<index in EXT_lights_ies>.json")) << path;
  }
}

}  // namespace
}  // namespace radiosity::testing
