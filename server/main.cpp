// radiosityd: options -> engine and network -> run until a signal.
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <mutex>
#include <string_view>
#include <thread>

#include "common/freed_memory.h"
#include "common/log.h"
#include "common/printable.h"
#include "server/engine/loop/solve_loop.h"
#include "server/gpu/workers/gpu_transport.h"
#include "server/net/server.h"
#include "server/options.h"
#include "server/scene/charts/trial_room.h"
#include "server/service_notify.h"
#include "server/state/store.h"
#include "server/state/uploads.h"

#ifndef RADIOSITY_VERSION
#define RADIOSITY_VERSION "0.0.0"
#endif

namespace radiosity {
namespace {

/// How a worker, which is started by the server, learns the form of its log.
constexpr const char* kLogFormatVariable = "RADIOSITY_LOG_FORMAT";

int report(const Error& error) {
  std::fprintf(stderr, "radiosityd: %s\n", printable(error.text()).c_str());
  return exitCodeOf(error);
}

void loadFirstScene(engine::Engine& engine, const std::string& path, bool reload) {
  engine.openFile(path, reload, [path](const Result<engine::LoadOutcome>& outcome) {
    if (!outcome) return log::error("{}", outcome.error().text());
  });
}

/// The log ends with main(), before the threads of leaveWithin() do. Neither is ever destroyed.
std::mutex leaving;
bool log_ended = false;

/// Whoever asked for the end does not wait longer. What was acknowledged is on the disk at any time, and the workers
/// die with this process.
void leaveWithin(std::chrono::milliseconds patience, const char* why) {
  std::thread([patience, why] {
    std::this_thread::sleep_for(patience);
    const std::lock_guard lock(leaving);
    if (!log_ended) log::info("leaving {}", why);
    std::_Exit(0);
  }).detach();
}

/// All is done but for what libraries do at the end of a program, which leaveWithin() bounds as well.
void endLog() {
  const std::lock_guard lock(leaving);
  log_ended = true;
}

Vitals vitalsOf(const engine::Engine& engine, const net::Server& server) {
  return {[&server] { return server.silentSeconds(); }, [&engine] { return engine.busySeconds(); },
          [&server] { return server.statusLine(); }};
}

/// How long the end waits for the last checkpoint; then the one before it stays.
constexpr auto kCheckpointPatience = std::chrono::milliseconds(3500);
/// For what lies between the end's waits, which have bounds of their own: a disk that does not answer, say.
constexpr auto kEndSlack = std::chrono::milliseconds(500);
/// The engine ends between two steps of what it does, and putting a big scene in place takes seconds; nothing it has
/// made since the checkpoint is worth keeping.
constexpr auto kEnginePatience = std::chrono::milliseconds(200);

int serve(Options options) {
  engine::EngineOptions engine_options;
  if (!options.state.empty()) {
    auto store = state::Store::open(options.state);
    if (!store) return report(store.error());
    engine_options.store = std::move(*store);
    engine_options.named_settings = options.named_settings;
    engine_options.checkpoint_bytes = options.checkpoint_bytes;
    options.server.uploads = std::make_shared<state::Uploads>(*engine_options.store);
  }
  const auto store = engine_options.store;  // outlives the uploads, which outlive the server
  const auto uploads = options.server.uploads;
  engine_options.settings = options.solve;
  engine_options.first_texels = options.first_texels;
  engine_options.max_scene_bytes = options.max_scene_bytes;
  engine_options.make_transport = [workers = options.workers, sight = options.sight] {
    return gpu::makeWorkerTransport(
        {.workers = workers, .executable = "/proc/self/exe", .sight = sight, .make_trial_room = scene::makeTrialRoom});
  };
  const auto engine = engine::makeEngine(std::move(engine_options));
  if (!engine) return report(engine.error());
  auto server = net::Server::open(options.server, **engine);
  if (!server) return report(server.error());
  (*server)->drainOnSignals();
  if (!options.scene.empty()) loadFirstScene(**engine, options.scene, options.reload);
  std::printf("listening on %s\n", (*server)->url().c_str());
  std::fflush(stdout);
  ServiceNotifier notifier(vitalsOf(**engine, **server));
  (*server)->onDrain([&notifier, grace = options.server.drain_grace] {
    leaveWithin(grace + kCheckpointPatience + kEndSlack, "before all was done: the end took too long");
    notifier.stopping();
  });
  (*server)->run();
  for (const int number : {SIGINT, SIGTERM}) (void)std::signal(number, SIG_DFL);  // from here on it ends at once
  if (!(*server)->inHurry()) (*engine)->keepSolve(kCheckpointPatience);
  if (store) store->foldLog();
  leaveWithin(kEnginePatience, "in the middle of the engine's work");
  if (uploads) uploads->finish();
  return 0;
}

int run(int argc, char** argv) {
  keepFreedMemory();
  (void)std::signal(SIGXFSZ,
                    SIG_IGN);  // a file that reached `ulimit -f` is an error of its write; workers inherit this
  if (argc > 1 && std::string_view(argv[1]) == "--worker") {
    const char* format = std::getenv(kLogFormatVariable);
    const bool json = format != nullptr && std::string_view(format) == "json";
    startLog("radiosityd worker", "info", json ? LogFormat::kJson : LogFormat::kText);
    return gpu::workerMain(argc - 2, argv + 2);
  }
  const auto parsed = parseOptions(argc, argv, RADIOSITY_VERSION);
  if (parsed.exit_code) return *parsed.exit_code;
  startLog("radiosityd", parsed.options.log_level, parsed.options.log_format);
  if (parsed.options.log_format == LogFormat::kJson) setenv(kLogFormatVariable, "json", 1);
  const int status = serve(parsed.options);
  endLog();
  return status;
}

}  // namespace
}  // namespace radiosity

int main(int argc, char** argv) {
  try {
    return radiosity::run(argc, argv);
  } catch (const std::exception& e) {
    std::fprintf(stderr, "radiosityd: %s\n", radiosity::printable(e.what()).c_str());
    return radiosity::kExitFailed;
  }
}
