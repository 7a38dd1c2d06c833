// What tests of the WebSocket side ask of replies and connections.
#pragma once

#include <gtest/gtest.h>

#include "tests/service/net/test_client.h"

namespace radiosity::testing {

inline int codeOf(const protocol::RpcResponse& response) {
  return response.error ? static_cast<int>(response.error->code) : 0;
}

template <typename Reply>
Reply replyOf(const protocol::RpcResponse& response) {
  EXPECT_FALSE(response.error.has_value()) << response.error->message;
  if (response.error) return {};
  const auto reply = protocol::decodeReply<Reply>(*response.result);
  EXPECT_TRUE(reply.has_value()) << reply.error().text();
  return reply.value_or(Reply{});
}

inline protocol::ScenePatchCall somePatch(std::optional<std::uint64_t> base = {}, std::string id = {}) {
  return {.patch = R"([{"op":"replace","path":"/nodes/@lamp/translation","value":[0,2,0]}])",
          .base_revision = base,
          .request_id = std::move(id)};
}

/// Reads to the end of the connection.
inline int closeCodeOf(TestSocket& socket) {
  while (socket.read()) {
  }
  return socket.closeCode();
}

/// Reads until the answer to this id has come; other messages are passed over.
inline protocol::RpcResponse awaitAnswer(TestSocket& socket, const std::string& id) {
  while (const auto message = socket.read()) {
    if (message->binary) continue;
    const auto parsed = protocol::parseRpc(message->text(), protocol::kMaxMessageBytes);
    if (const auto* response = std::get_if<protocol::RpcResponse>(&parsed.items.at(0)); response && response->id == id)
      return *response;
  }
  return {};
}

}  // namespace radiosity::testing
