#include "client/cli/solve_run.h"

#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <thread>

#include "client/cli/engine_output.h"
#include "client/cli/interrupt.h"
#include "client/cli/ktx2.h"
#include "client/cli/report.h"
#include "client/cli/scene_file.h"
#include "client/cli/server_process.h"
#include "client/cli/staged_folder.h"
#include "common/one_line.h"

namespace radiosity::cli {
namespace {

using namespace std::chrono_literals;
using client::CallFailure;
using client::CallResult;

constexpr auto kStatusInterval = 250ms;
constexpr auto kStopGrace = 5000ms;
constexpr auto kInterruptGrace = 500ms;
constexpr auto kCheckpointGrace = 4500ms;  // an interrupted solve that keeps state ends within five seconds
constexpr auto kEndGrace = 300ms;          // a dying process closes its sockets before it can be waited for

/// One run of the command; members in the order in which they must go.
class Solve {
 public:
  explicit Solve(const SolveOptions& options) : options_(options), display_(options.quiet) {}

  ExitCode run() {
    const ExitCode code = solve();
    display_.clear();
    if (server_) {
      server_->stop(!interrupted() ? kStopGrace : options_.state.empty() ? kInterruptGrace : kCheckpointGrace);
      passOnLog();
    }
    if (code == ExitCode::kInterrupted)
      std::fprintf(stderr, "radiosity: nothing was written; %s\n", whatNext().c_str());
    return code;
  }

 private:
  [[nodiscard]] std::string whatNext() const {
    if (!options_.server.url.empty()) return "the server goes on solving (radiosity save gets the result)";
    if (options_.state.empty()) return "without --state a solve starts anew next time";
    return "what was solved is kept in " + options_.state + ": the same command goes on from there";
  }

  ExitCode solve() {
    if (auto ready = checkInputs(); !ready) return complain(ready.error());
    if (auto ready = findServer(); !ready) return complain(ready.error());
    auto connection = remote_.connect();
    if (!connection) return complainOf(connection.error());
    connection->onNotification([this](const protocol::Notification& note) { onNotification(note); });
    if (auto set = connection->call(settings()); !set) return complainOf(set.error());
    if (auto loaded = load(*connection); !loaded) return complainOf(loaded.error());
    if (options_.measure.wanted)
      if (auto ready = requirePlanes(remote_, options_.measure); !ready) return complainOf(ready.error());
    if (!options_.probes.output.empty())
      if (auto ready = requireProbes(remote_, options_.probes); !ready) return complainOf(CallFailure{ready.error()});
    auto status = waitForEnd(*connection);
    if (!status) return complainOf(status.error());
    return finish(*connection, *std::move(status));
  }

  Result<void> checkInputs() {
    auto sky = skyChoice(options_.sky);
    if (!sky) return tl::unexpected(sky.error());
    sky_ = std::move(*sky);
    if (auto ready = checkProbes(options_.probes); !ready) return ready;
    const auto kind = sceneKind(options_.scene);
    if (!kind) return tl::unexpected(kind.error());
    const bool is_folder = !options_.engine.empty();
    std::optional<StagedFolder> folder;  // for as long as it takes to see whether the picture can lie in it
    if (is_folder && !options_.output.empty()) {
      auto made = StagedFolder::open(options_.output);
      if (!made) return tl::unexpected(made.error());
      folder.emplace(std::move(*made));
    } else if (!options_.output.empty()) {
      if (const auto stem = glbStem(options_.output); !stem) return tl::unexpected(stem.error());
    }
    if (*kind == SceneKind::kGltf && options_.server.url.empty() && !sky_.isOfScene()) {
      const auto external = hasExternalFiles(options_.scene);
      if (!external) return tl::unexpected(external.error());
      by_path_ = *external && !needsKtx2(options_.scene);
    }
    const std::vector<std::string> outputs{is_folder ? "" : options_.output, options_.report, options_.png,
                                           options_.measure.csv, options_.measure.json};
    if (auto ready = checkOutputs(outputs); !ready) return ready;
    return checkProbesFile(outputs, *kind);
  }

  /// What else has names that may end with .json or .bin.
  [[nodiscard]] Result<void> checkProbesFile(std::vector<std::string> others, SceneKind kind) const {
    if (options_.probes.output.empty()) return {};
    others.push_back(options_.scene);
    if (kind == SceneKind::kGltf) {
      const auto files = externalFiles(options_.scene);
      if (!files) return tl::unexpected(files.error());
      others.insert(others.end(), files->begin(), files->end());
    }
    return requireOwnFile(options_.probes, others);
  }

  Result<void> findServer() {
    if (!options_.server.url.empty()) {
      auto remote = remoteFrom(options_.server);
      if (!remote) return tl::unexpected(remote.error());
      remote_ = std::move(*remote);
      return {};
    }
    auto program = findServerProgram();
    if (!program) return tl::unexpected(program.error());
    // Nobody watches.
    ServerProcess::Options start{
        .program = *program, .arguments = {"--first-texels", "0"}, .keep_going = [] { return !interrupted(); }};
    if (options_.workers > 0)
      start.arguments.insert(start.arguments.end(), {"--workers", std::to_string(options_.workers)});
    if (!options_.visibility.empty())
      start.arguments.insert(start.arguments.end(), {"--visibility", options_.visibility});
    if (options_.means) start.arguments.emplace_back("--means");
    if (!options_.link_memory.empty())
      start.arguments.insert(start.arguments.end(), {"--link-memory", options_.link_memory});
    if (!options_.max_scene_memory.empty())
      start.arguments.insert(start.arguments.end(), {"--max-scene-memory", options_.max_scene_memory});
    if (!options_.state.empty())
      start.arguments.insert(start.arguments.end(), {"--state", std::filesystem::absolute(options_.state).string()});
    if (by_path_) {
      const auto folder = std::filesystem::canonical(options_.scene).parent_path();
      start.arguments.insert(start.arguments.end(), {"--scene-root", folder.string()});
    }
    display_.showText("starting radiosityd");
    auto server = ServerProcess::start(start);
    if (!server) return tl::unexpected(server.error());
    server_.emplace(std::move(*server));
    remote_.url = server_->url();
    remote_.token = server_->token();
    remote_.keep_going = [this] {
      passOnLog();
      return !interrupted();
    };
    return {};
  }

  [[nodiscard]] protocol::SolveConfigureCall settings() const {
    const bool chooses = choosesTexels(!options_.uniform, options_.texel_size_m, options_.method);
    protocol::SolveConfigureCall call{.target_error = options_.error,
                                      .no_time_limit = options_.time_limit_s <= 0.0,
                                      .texels = options_.texels > 0 ? options_.texels : usualTexels(chooses),
                                      .texel_size_m = options_.texel_size_m,
                                      .seed = options_.seed,
                                      .sky = sky_.colours,
                                      .no_sky = !sky_.colours,
                                      .double_sided = options_.double_sided,
                                      .adaptive = !options_.uniform,
                                      .method = options_.method};
    constexpr double kMillisecondsPerSecond = 1000.0;
    if (!call.no_time_limit)
      call.time_limit_ms = static_cast<std::uint64_t>(std::llround(options_.time_limit_s * kMillisecondsPerSecond));
    return call;
  }

  CallResult<void> load(client::Connection& connection) {
    if (by_path_) return loadByPath(connection);
    // The connection is kept alive while the upload runs.
    Remote uploader = remote_;
    uploader.keep_going = [this, &connection] {
      (void)connection.poll(0ms);  // one that broke shows in the next call
      return remote_.keep_going();
    };
    auto loaded = uploadScene(uploader, options_.scene, sky_, display_);
    if (!loaded) return tl::unexpected(CallFailure{loaded.error()});
    revision_ = loaded->revision;
    return {};
  }

  /// Our private server reads the .gltf and its files itself, from their folder.
  CallResult<void> loadByPath(client::Connection& connection) {
    constexpr auto kLoadTimeout = 10min;
    display_.showText("loading " + options_.scene);
    const auto name = std::filesystem::canonical(options_.scene).filename().string();
    const auto loaded = connection.call(protocol::SceneLoadCall{.url = "file:" + name}, kLoadTimeout);
    if (!loaded) return tl::unexpected(placed(loaded.error()));
    revision_ = loaded->revision;
    return {};
  }

  /// The server knows the scene by its bare name; the message names it as the user did.
  [[nodiscard]] CallFailure placed(CallFailure failure) const {
    const auto name = std::filesystem::path(options_.scene).filename().string();
    auto& where = failure.error.where;
    if (where.starts_with(name)) where.erase(0, name.size());
    if (where.starts_with(": ")) where.erase(0, 2);
    where = options_.scene + (where.empty() ? "" : ": " + where);
    return failure;
  }

  void onNotification(const protocol::Notification& note) {
    if (const auto* progress = std::get_if<protocol::ProgressNote>(&note)) {
      if (progress->progress.revision < revision_) return;
      display_.show(viewOf(progress->progress, options_.error));
      ask_now_ = ask_now_ || (progress->progress.state != "solving" && progress->progress.state != "loading");
    } else if (const auto* loaded = std::get_if<protocol::SceneLoaded>(&note)) {
      if (revision_ > 0 && loaded->revision > revision_) replaced_ = true;
    }
  }

  /// Asks for the status now and then, and at once when a notification says that the solve has stopped: so the end is
  /// seen whatever else happens on the server.
  CallResult<protocol::StatusReply> waitForEnd(client::Connection& connection) {
    for (;;) {
      ask_now_ = false;
      auto status = connection.call(protocol::StatusCall{});
      if (!status) return status;
      const auto& progress = status->progress;
      if (replaced_)
        return tl::unexpected(CallFailure{
            {ErrorCode::kUnavailable, "another client loaded another scene into this server", remote_.url.text()}});
      if (progress.state == "failed")
        return tl::unexpected(CallFailure{{ErrorCode::kUnavailable, "the solve failed: " + progress.failure, {}}});
      if (progress.state == "empty")
        return tl::unexpected(CallFailure{{ErrorCode::kUnavailable, "the server lost the scene", remote_.url.text()}});
      display_.show(viewOf(progress, options_.error));
      const bool is_ours = progress.revision >= revision_;
      if (is_ours && (progress.state == "converged" || progress.state == "timeLimit" || progress.state == "limited"))
        return status;
      const auto next = std::chrono::steady_clock::now() + kStatusInterval;
      while (!ask_now_ && std::chrono::steady_clock::now() < next) {
        if (interrupted()) return tl::unexpected(CallFailure{{ErrorCode::kUnavailable, "interrupted", {}}});
        auto polled = connection.poll(kStatusInterval);
        if (!polled) return tl::unexpected(CallFailure{polled.error()});
      }
    }
  }

  /// What people see of the error is measured while the result is being fetched. Of a solve that is not the one that
  /// was waited for any more nothing is told.
  static void addSurfaceError(client::Connection& connection, protocol::StatusReply& status) {
    constexpr auto kPatience = 60s;
    constexpr auto kBetween = 20ms;
    const auto until = std::chrono::steady_clock::now() + kPatience;
    auto now = connection.call(protocol::StatusCall{});
    while (now && now->progress.error.measuring && std::chrono::steady_clock::now() < until) {
      std::this_thread::sleep_for(kBetween);
      now = connection.call(protocol::StatusCall{});
    }
    if (!now || now->progress.revision != status.progress.revision || now->progress.shots != status.progress.shots)
      return;
    status.progress.error.total = now->progress.error.total;
    status.progress.error.p95 = now->progress.error.p95;
  }

  ExitCode finish(client::Connection& connection, protocol::StatusReply status) {
    const bool chooses = status.settings.choosesTexels();
    const auto& error = status.progress.error;
    const bool reached =
        (chooses ? error.total : error.texels) <= options_.error && (!chooses || status.progress.state == "converged");
    if (!reached && status.progress.state == "converged")
      warn(fmt::format("the server stopped at {}: another client changed its settings", percentText(error.total)));
    if (!options_.engine.empty()) addSurfaceError(connection, status);  // which goes into the folder
    auto written = save(status.progress.error);
    if (!written) return complainOf(CallFailure{written.error()});
    if (options_.engine.empty()) addSurfaceError(connection, status);
    if (!options_.report.empty()) {
      auto done = writeReport(status, reached);
      if (!done) return complain(done.error());
    }
    display_.clear();
    passOnLog();
    for (const auto& warning : status.warnings)
      if (passed_on_.find(warning) == std::string::npos) warn(warning);
    for (const auto& name : *written) std::printf("%s\n", name.c_str());
    auto measured = options_.measure.wanted ? measurePlanes(remote_, options_.measure, display_) : std::string();
    if (!measured) return complainOf(CallFailure{measured.error()});
    std::fputs(measured->c_str(), stdout);
    auto probes = options_.probes.output.empty() ? std::string() : saveProbes(remote_, options_.probes, display_);
    if (!probes) return complainOf(CallFailure{probes.error()});
    std::fputs(probes->c_str(), stdout);
    const auto& failure = status.progress.failure;
    const std::string why =
        status.progress.state == "limited" ? "limited (" + oneLine(failure) + "): " : "time limit: ";
    std::fprintf(stderr, "%s%s%s\n", reached ? "" : why.c_str(), outcomeText(status.progress).c_str(),
                 surfaceText(status.progress.error).c_str());
    return reached ? ExitCode::kOk : ExitCode::kShort;
  }

  Result<std::vector<std::string>> save(const protocol::ErrorParts& error) {
    if (options_.output.empty()) return std::vector<std::string>();
    if (!options_.engine.empty()) {
      const EngineRequest request{options_.engine, options_.output, options_.png};
      auto saved = saveForEngine(remote_, request, {error.total, error.p95}, display_);
      if (!saved) return tl::unexpected(saved.error());
      display_.clear();
      tellSaved(*saved, options_.quiet);
      return std::move(saved->paths);
    }
    return saveScene(remote_,
                     {.glb_path = options_.output,
                      .unlit = options_.unlit,
                      .png_path = options_.png,
                      .error_map = options_.error_map},
                     display_);
  }

  Result<void> writeReport(const protocol::StatusReply& status, bool reached) const {
    auto file = client::AtomicFile::create(options_.report);
    if (!file) return tl::unexpected(file.error());
    if (auto done = file->write(reportJson(status, reached)); !done) return done;
    return file->commit();
  }

  /// A connection that broke because our own server ended is explained by the server's last words.
  ExitCode complainOf(const CallFailure& failure) {
    display_.clear();
    if (server_ && !failure.rpc && !interrupted() && server_->endsWithin(kEndGrace)) {
      passOnLog();
      return complain(server_->epitaph());
    }
    return complain(failure);
  }

  void passOnLog() {
    if (!server_) return;
    for (const auto& line : server_->takeLog()) {
      if (!line.isWarning() && !line.isError()) continue;
      passed_on_ += line.text + "\n";
      if (!interrupted()) display_.message("radiosityd: " + line.level + ": " + line.text);
    }
  }

  const SolveOptions& options_;
  ProgressDisplay display_;
  std::optional<ServerProcess> server_;
  Remote remote_;
  SkyChoice sky_;
  bool by_path_ = false;        ///< the private server reads the scene itself
  std::uint64_t revision_ = 0;  ///< of our scene; 0: not known
  bool ask_now_ = false, replaced_ = false;
  std::string passed_on_;  ///< warnings that were printed already
};

}  // namespace

ExitCode solveScene(const SolveOptions& options) { return Solve(options).run(); }

}  // namespace radiosity::cli
