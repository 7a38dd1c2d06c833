// What clients hear of a load while it is under way.
#include <gtest/gtest.h>

#include <chrono>
#include <nlohmann/json.hpp>

#include "tests/service/net/replies.h"
#include "tests/service/net/running_server.h"
#include "tests/service/net/test_client.h"

namespace radiosity::testing {
namespace {

using namespace protocol;  // NOLINT: the test speaks the protocol

TEST(LoadProgress, TellsHowMuchIsDoneWhileItLasts) {
  net::ServerOptions options;
  options.progress_interval = std::chrono::milliseconds(0);
  RunningServer server(options);
  TestSocket socket(server.port());
  socket.hello();
  server.engine.progress(0.5, engine::SolveState::kLoading);
  const auto loading = socket.waitFor("progress");
  ASSERT_TRUE(loading.has_value());
  EXPECT_EQ(loading->params->at("state"), "loading");
  EXPECT_EQ(loading->params->at("fraction"), 0.25);
  EXPECT_EQ(replyOf<StatusReply>(socket.call(StatusCall{})).progress.fraction, 0.25);
  server.engine.progress(0.5);
  const auto solving = socket.waitFor("progress");
  ASSERT_TRUE(solving.has_value());
  EXPECT_FALSE(solving->params->contains("fraction"));
}

}  // namespace
}  // namespace radiosity::testing
