// What a probe is told of what is missing, and what is refused meanwhile.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/service/net/running_server.h"
#include "tests/service/net/test_client.h"

namespace radiosity::testing {
namespace {

using ::testing::HasSubstr;

TEST(Readiness, NamesTheStateAndTheRenderersThatAreMissing) {
  RunningServer server;
  server.engine.progress(1.0);
  const auto ready = [&] { return request(server.port(), "GET", "/readyz"); };
  const auto metrics = [&] { return request(server.port(), "GET", "/metrics").body; };
  server.engine.loseIdle(1, 2, "worker process 7 was killed by signal 9");
  EXPECT_EQ(ready().status, 200);
  EXPECT_THAT(ready().body, HasSubstr("1 of 2 renderers are being replaced: worker process 7"));
  EXPECT_THAT(metrics(), HasSubstr("radiosityd_renderers_missing 1\n"));
  EXPECT_THAT(metrics(), HasSubstr("radiosityd_renderer_lost 0\n"));
  server.engine.loseIdle(2, 2, "worker process 7 was killed by signal 9");
  EXPECT_EQ(ready().status, 503);
  EXPECT_THAT(ready().body, HasSubstr("no renderer: worker process 7"));
  EXPECT_THAT(metrics(), HasSubstr("radiosityd_renderer_lost 1\n"));
  server.engine.loseIdle(0, 2, "");
  EXPECT_EQ(ready().body, "ready\n");
  server.engine.loseState("/r\xf6om/state.sqlite: was removed");
  EXPECT_EQ(ready().status, 503);
  EXPECT_THAT(ready().body, HasSubstr("edits are refused: /r\\xf6om/state.sqlite"));
  EXPECT_THAT(metrics(), HasSubstr("radiosityd_state_lost 1\n"));
  EXPECT_THAT(request(server.port(), "GET", "/status").body, HasSubstr("Edits are refused"));
}

}  // namespace
}  // namespace radiosity::testing
