// The network side of radiosityd: opens the port, serves until drained. Owned by main. The engine must outlive it.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "common/result.h"
#include "server/engine/engine.h"
#include "server/net/server_options.h"

namespace radiosity::net {

class Server {
 public:
  /// Opens the port; connections wait until run(). kUnavailable: the port is in use or the address not ours.
  /// kBadUsage: exposed without token (access.h).
  [[nodiscard]] static Result<std::unique_ptr<Server>> open(const ServerOptions& options, engine::Engine& engine);
  ~Server();
  Server(const Server&) = delete;
  Server& operator=(const Server&) = delete;

  [[nodiscard]] std::uint16_t port() const;  ///< the real one, also where 0 was asked for
  [[nodiscard]] std::string url() const;     ///< "http://127.0.0.1:8765", with TLS "https://..."

  /// SIGINT and SIGTERM drain; a second one stops at once. SIGHUP reads the certificate again, where there
  /// is one; without one it drains where stdin is a terminal, which was closed. Before run().
  void drainOnSignals();
  /// Called once when the server begins to drain, on one of its threads. Before run().
  void onDrain(std::function<void()> hook);
  /// How long ago the event loop last came round; it does so every second. Any thread.
  [[nodiscard]] double silentSeconds() const;
  /// "solving, revision 3, error 4.1 %, 2 viewers". Any thread.
  [[nodiscard]] std::string statusLine() const;
  /// Serves with options.threads threads, the caller's among them; returns when drained.
  void run();
  /// A second signal came: whoever sent it does not want to wait for anything.
  [[nodiscard]] bool inHurry() const;
  /// Tells clients, finishes what was begun, closes; cuts off what is left after options.drain_grace. Any thread.
  void drain();

 private:
  class State;
  explicit Server(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace radiosity::net
