// An edit that is asked for twice is made once.
#include <gtest/gtest.h>

#include "tests/service/net/replies.h"
#include "tests/service/net/running_server.h"
#include "tests/service/net/test_client.h"

namespace radiosity::testing {
namespace {

using protocol::ScenePatchReply;

TEST(RequestIds, TheSameRequestIdGetsTheSameAnswerOnce) {
  RunningServer server;
  TestSocket socket(server.port());
  socket.hello();
  EXPECT_EQ(replyOf<ScenePatchReply>(socket.call(somePatch({}, "edit-1"))).revision, 1U);
  EXPECT_EQ(replyOf<ScenePatchReply>(socket.call(somePatch({}, "edit-1"))).revision, 1U);
  EXPECT_EQ(server.engine.patchesSeen(), 1U);
  EXPECT_EQ(replyOf<ScenePatchReply>(socket.call(somePatch({}, "edit-2"))).revision, 2U);
  EXPECT_EQ(codeOf(socket.call(somePatch(1, "edit-1"))), -32602);
}

TEST(RequestIds, ADryRunDoesNotUseUpItsRequestId) {
  RunningServer server;
  TestSocket socket(server.port());
  socket.hello();
  auto dry = somePatch({}, "edit-1");
  dry.dry_run = true;
  for (const std::uint64_t revision : {0U, 1U}) {
    EXPECT_EQ(replyOf<ScenePatchReply>(socket.call(dry)).revision, revision);
    EXPECT_EQ(replyOf<ScenePatchReply>(socket.call(somePatch({}, "edit-1"))).revision, 1U);
  }
}

}  // namespace
}  // namespace radiosity::testing
