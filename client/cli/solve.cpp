// radiosity solve and measure: scene in, lightmaps or figures of measuring planes out, on a private server or on one
// that runs already.
#include <fmt/format.h>

#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <thread>

#include "client/cli/commands.h"
#include "client/cli/engine_output.h"
#include "client/cli/interrupt.h"
#include "client/cli/ktx2.h"
#include "client/cli/measure.h"
#include "client/cli/probes.h"
#include "client/cli/remote.h"
#include "client/cli/report.h"
#include "client/cli/scene_file.h"
#include "client/cli/server_process.h"
#include "client/cli/sky_options.h"
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

struct SolveOptions {
  std::string scene, output, report, png, engine;  ///< output: empty for planes alone; of an engine: a folder
  MeasureOptions measure;
  ProbeOptions probes;
  SkyOptions sky;
  std::string state;  ///< folder; empty: an interrupted solve is lost
  RemoteOptions server;
  double error = 0.02;
  double time_limit_s = 0.0;  ///< 0: none
  std::uint64_t texels = 0;   ///< 0: as many as usual
  double texel_size_m = 0.0;  ///< 0: by number
  std::uint64_t seed = 1;
  unsigned workers = 0;          ///< 0: the server's choice
  std::string visibility;        ///< empty: the server's choice
  std::string link_memory;       ///< as radiosityd takes it; empty: the server's choice
  std::string max_scene_memory;  ///< likewise
  bool double_sided = false, uniform = false, means = false;
  Method method = Method::kGather;
  bool unlit = false, error_map = false, quiet = false;
};

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
    if (!options_.output.empty()) {
      const auto ready =
          is_folder ? checkEngineFolder(options_.output) : glbStem(options_.output).map([](const auto&) {});
      if (!ready) return ready;
    }
    if (*kind == SceneKind::kGltf && options_.server.url.empty() && !sky_.isOfScene()) {
      const auto external = hasExternalFiles(options_.scene);
      if (!external) return tl::unexpected(external.error());
      by_path_ = *external && !needsKtx2(options_.scene);
    }
    return checkOutputs(
        {is_folder ? "" : options_.output, options_.report, options_.png, options_.measure.csv, options_.measure.json});
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
      display_.message(saved->note);
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

void addOutputOptions(CLI::App& command, SolveOptions& options) {
  command.add_option("SCENE", options.scene, "the scene: .glb, or .gltf with its files beside it")
      ->required()
      ->type_name("");
  command.add_option("--measure", options.measure.csv, "also the points of the scene's measuring planes, as CSV")
      ->type_name("FILE");
  addProbeOptions(command, options.probes, "--probes", "--probes-out");
  command
      .add_option("-o,--output", options.output,
                  "the scene with lightmap UVs; lightmaps go to NAME.lightmap.<page>.exr beside it")
      ->required()
      ->type_name("OUT.glb");
  auto* unlit =
      command.add_flag("--unlit", options.unlit, "OUT.glb shows the tone-mapped result in any glTF viewer instead");
  auto* error_map = command.add_flag("--error-map", options.error_map,
                                     "also the standard error of each texel, in lux: NAME.error.<page>.exr");
  addEngineOption(command, options.engine)->excludes(unlit)->excludes(error_map);
  command.add_option("--png", options.png, "also a picture from the scene's camera, or from one that frames it")
      ->type_name("FILE");
  command.add_option("--report", options.report, "also figures about the solve, as JSON")->type_name("FILE");
}

/// How to solve, and where.
void addSolvingOptions(CLI::App& command, SolveOptions& of) {
  auto* options = &of;
  command
      .add_option(
          "--error", options->error,
          "target: relative RMS error of light where people look, 0.02 is 2 %; with texels of one size: on texels")
      ->check(CLI::Range(1e-6, 1.0).description(""))
      ->type_name("FRACTION")
      ->capture_default_str();
  command
      .add_option("--time-limit", options->time_limit_s, "solving stops after this many seconds (default: no limit)")
      ->check(CLI::Range(0.001, 1e6).description(""))
      ->type_name("SECONDS");
  auto* texels = command
                     .add_option("--texels", options->texels,
                                 "lightmap texels (leaf patches) that there may be (default: 1000000), or, of one "
                                 "size, in all, about (24000)")
                     ->check(CLI::Range(std::uint64_t{1}, std::uint64_t{1} << 28U).description(""))
                     ->type_name("COUNT");
  command.add_option("--texel-size", options->texel_size_m, "side of a texel in metres, instead of --texels")
      ->check(CLI::Range(1e-6, 1e6).description(""))
      ->type_name("METRES")
      ->excludes(texels);
  command.add_flag("--means", options->means,
                   "texels hold the mean light of what they cover, not what bilinear lookups are closest with");
  command.add_flag("--uniform", options->uniform,
                   "texels of one size everywhere, on which --error is met; without it, and without --texel-size, "
                   "texels are chosen, as few as meet --error where people look, finer where light wants it");
  command.add_option("--seed", options->seed, "the same seed gives the same bits")
      ->type_name("N")
      ->capture_default_str();
  command.add_flag("--double-sided", options->double_sided,
                   "light both sides of all surfaces, whatever their materials say: for rooms whose faces are turned "
                   "outward");
  command
      .add_option(
          "--method", options->method,
          "gather: texels gather reflected light along rays; shooting: progressive shooting, which remembers no "
          "links; paper: Lum, Ma and Max 2002, whose sampling error is what it is (default: gather)")
      ->transform(CLI::CheckedTransformer(std::map<std::string, Method>{{"gather", Method::kGather},
                                                                        {"shooting", Method::kShooting},
                                                                        {"paper", Method::kPaper}})
                      .description(""))
      ->type_name("METHOD");
  addSkyOptions(command, options->sky);
  auto* workers =
      command.add_option("--workers", options->workers, "render processes of the private server (default: one a core)")
          ->check(CLI::Range(1U, 256U).description(""))
          ->type_name("N");
  auto* visibility = command
                         .add_option("--visibility", options->visibility,
                                     "how the private server finds out what a light sees: rays, images, measured (both "
                                     "are tried at start-up) or auto (default: rays where the processor draws, "
                                     "measured on a GPU)")
                         ->check(CLI::IsMember({"rays", "images", "measured", "auto"}).description(""))
                         ->type_name("HOW");
  auto* memory = command
                     .add_option("--link-memory", options->link_memory,
                                 "memory for links and rays of the private server, such as 256MiB (default: 1GiB); "
                                 "when it is used up the solve ends above its error")
                     ->check(CLI::AsSizeValue(false).description(""))
                     ->type_name("SIZE");
  auto* scene_memory =
      command
          .add_option("--max-scene-memory", options->max_scene_memory,
                      "memory that the scene may claim, such as 2GiB (default: a quarter of what there is); a file "
                      "that names more is refused before any of it is made")
          ->check(CLI::AsSizeValue(false).description(""))
          ->type_name("SIZE");
  auto* state = command
                    .add_option("--state", options->state,
                                "folder (made if missing) that an interrupted solve is kept in: Ctrl-C, SIGTERM or "
                                "SIGHUP ends it within 5 s with status 75, and the same command goes on from there, "
                                "to the same output")
                    ->type_name("DIR");
  command.add_option("--server", options->server.url, "solve there rather than on a private radiosityd")
      ->type_name("URL")
      ->excludes(workers)
      ->excludes(visibility)
      ->excludes(memory)
      ->excludes(scene_memory)
      ->excludes(state);
  addAccessOptions(command, options->server);
  command.add_flag("-q,--quiet", options->quiet, "no progress on stderr");
}

ExitCode solve(SolveOptions options) {
  options.measure.wanted = !options.measure.csv.empty();
  return Solve(options).run();
}

/// Of a scene that is solved for it, or else of a server's as it is now.
ExitCode measure(SolveOptions options) {
  options.measure.wanted = true;
  if (!options.scene.empty()) return Solve(options).run();
  if (options.server.url.empty()) return complain(Error{ErrorCode::kBadUsage, "name a SCENE, or a --server", {}});
  const auto remote = remoteFrom(options.server);
  if (!remote) return complain(remote.error());
  if (auto ready = checkOutputs({options.measure.csv, options.measure.json}); !ready) return complain(ready.error());
  ProgressDisplay display(options.quiet);
  const auto measured = measurePlanes(*remote, options.measure, display);
  if (!measured) return complain(measured.error());
  std::fputs(measured->c_str(), stdout);
  return ExitCode::kOk;
}

}  // namespace

void addSolve(CLI::App& app, Run& run) {
  auto options = std::make_shared<SolveOptions>();
  auto& command = *app.add_subcommand("solve", "solve a scene and write its lightmaps");
  addOutputOptions(command, *options);
  addSolvingOptions(command, *options);
  command.callback([options, &run] { run = [options] { return solve(*options); }; });
}

void addMeasure(CLI::App& app, Run& run) {
  auto options = std::make_shared<SolveOptions>();
  auto& command = *app.add_subcommand(
      "measure",
      "tell illuminance, uniformity and daylight factor on a scene's measuring planes (extras.radiosityPlane)");
  command
      .add_option("SCENE", options->scene, "the scene, which is solved for it (default: that of --server as it is now)")
      ->type_name("");
  addMeasureOptions(command, options->measure);
  addSolvingOptions(command, *options);
  command.callback([options, &run] { run = [options] { return measure(*options); }; });
}

}  // namespace radiosity::cli
