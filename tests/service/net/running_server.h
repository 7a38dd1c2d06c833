// A server with a fake engine on a free port, running in its own thread for the length of a test.
#pragma once

#include <gtest/gtest.h>

#include <memory>
#include <thread>
#include <utility>

#include "server/net/server.h"
#include "tests/service/fake_engine.h"

namespace radiosity::testing {

/// A token as servers may want it.
inline constexpr const char* kSecret = "0123456789abcdef0123456789abcdef";

class RunningServer {
 public:
  explicit RunningServer(net::ServerOptions options = {}, FakeEngine::Layout layout = {}) : engine(layout) {
    options.port = 0;
    options.drain_grace = std::chrono::milliseconds(3000);
    auto opened = net::Server::open(options, engine);
    EXPECT_TRUE(opened.has_value()) << opened.error().text();
    server_ = std::move(*opened);
    thread_ = std::thread([this] { server_->run(); });
  }
  ~RunningServer() { stop(); }
  RunningServer(const RunningServer&) = delete;
  RunningServer& operator=(const RunningServer&) = delete;

  void drain() { server_->drain(); }
  /// Drains and waits for the end.
  void stop() {
    if (!thread_.joinable()) return;
    server_->drain();
    thread_.join();
    server_.reset();
  }
  [[nodiscard]] std::uint16_t port() const { return server_->port(); }

  FakeEngine engine;

 private:
  std::unique_ptr<net::Server> server_;
  std::thread thread_;
};

}  // namespace radiosity::testing
