// radiosityd with the fake engine: the network as it is, light that is only a pattern. For developing clients and for
// tests of the command line and of the wire; not installed. RADIOSITY_FAKE_PATIENCE_MS shortens what the server waits
// for a peer, and gives it a long grace at its end, so that what is not cut off shows.
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <thread>

#include "common/log.h"
#include "server/net/server.h"
#include "server/options.h"
#include "tests/service/fake_engine.h"

namespace {

void shorten(radiosity::net::ServerOptions& options) {
  const char* text = std::getenv("RADIOSITY_FAKE_PATIENCE_MS");
  if (text == nullptr) return;
  const std::chrono::milliseconds patience(std::strtol(text, nullptr, 10));
  options.hello_timeout = options.write_deadline = options.close_patience = options.header_timeout =
      options.handshake_timeout = options.drain_patience = patience;
  options.drain_grace = std::chrono::minutes(10);
}

}  // namespace

int main(int argc, char** argv) {
  using namespace radiosity;
  auto parsed = parseOptions(argc, argv, "0.0.0-fake");
  if (parsed.exit_code) return *parsed.exit_code;
  shorten(parsed.options.server);
  startLog("fake_radiosityd", parsed.options.log_level, parsed.options.log_format);
  testing::FakeEngine fake({2, 512, 256, 4});
  fake.configure([&](const auto&) { return parsed.options.solve; }, [](const auto&) {});
  auto server = net::Server::open(parsed.options.server, fake);
  if (!server) {
    std::fprintf(stderr, "radiosityd: %s\n", server.error().text().c_str());
    return exitCodeOf(server.error());
  }
  (*server)->drainOnSignals();
  if (!parsed.options.scene.empty()) fake.loadFile(parsed.options.scene, {}, [](const auto&) {});
  std::atomic<bool> stop{false};
  std::thread solver([&] {
    for (double error = 1.0; !stop; error *= 0.97) {
      std::this_thread::sleep_for(std::chrono::milliseconds(50));
      const auto status = fake.status();
      if (status.state != engine::SolveState::kSolving) {
        error = 1.0;
        continue;
      }
      const bool done = error <= status.settings.target_error;
      fake.progress(error, done ? engine::SolveState::kConverged : engine::SolveState::kSolving);
      fake.publish();
    }
  });
  std::printf("listening on %s\n", (*server)->url().c_str());
  std::fflush(stdout);
  (*server)->run();
  stop = true;
  solver.join();
}
