// radiosity load, status, texel, snapshot and save: one exchange with a server each.
#include <fmt/format.h>

#include <array>
#include <charconv>
#include <chrono>
#include <memory>
#include <optional>
#include <tuple>
#include <variant>

#include "client/cli/commands.h"
#include "client/cli/engine_output.h"
#include "client/cli/remote.h"
#include "client/cli/report.h"

namespace radiosity::cli {
namespace {

struct LoadOptions {
  RemoteOptions server;
  std::string scene;
  bool quiet = false;
};

/// Uploads beside a connection that tells how far the load is. Where there is none to be had the upload says why.
Result<Loaded> uploadWatched(const Remote& remote, const std::string& scene, ProgressDisplay& display) {
  auto connection = remote.connect();
  if (!connection) return uploadScene(remote, scene, {}, display);
  connection->onNotification([&display](const protocol::Notification& note) {
    const auto* progress = std::get_if<protocol::ProgressNote>(&note);
    if (progress != nullptr && progress->progress.state == "loading") display.show(viewOf(progress->progress, 1.0));
  });
  auto uploader = remote;
  uploader.keep_going = [&connection, &remote] {
    (void)connection->poll(std::chrono::milliseconds(0));  // one that broke tells nothing more
    return remote.keep_going();
  };
  return uploadScene(uploader, scene, {}, display);
}

ExitCode load(const LoadOptions& options) {
  const auto remote = remoteFrom(options.server);
  if (!remote) return complain(remote.error());
  ProgressDisplay display(options.quiet);
  const auto loaded = uploadWatched(*remote, options.scene, display);
  display.clear();
  if (!loaded) return complain(loaded.error());
  for (const auto& warning : loaded->warnings) warn(warning);
  std::printf("revision %llu\n", static_cast<unsigned long long>(loaded->revision));
  return ExitCode::kOk;
}

struct StatusOptions {
  RemoteOptions server;
  bool json = false;
};

ExitCode status(const StatusOptions& options) {
  const auto remote = remoteFrom(options.server);
  if (!remote) return complain(remote.error());
  auto connection = remote->connect();
  if (!connection) return complain(connection.error());
  const auto reply = connection->call(protocol::StatusCall{});
  if (!reply) return complain(reply.error());
  std::fputs((options.json ? statusJson(*reply) : statusText(*reply)).c_str(), stdout);
  return ExitCode::kOk;
}

struct TexelOptions {
  RemoteOptions server;
  protocol::TexelCall texel;
};

double luminance(const std::array<double, 3>& rgb) { return 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2]; }

ExitCode texel(const TexelOptions& options) {
  const auto remote = remoteFrom(options.server);
  if (!remote) return complain(remote.error());
  auto connection = remote->connect();
  if (!connection) return complain(connection.error());
  const auto reply = connection->call(options.texel);
  if (!reply) return complain(reply.error());
  const auto& [light, error] = std::tie(reply->irradiance, reply->error);
  std::fputs(fmt::format("{:.6g} +- {:.2g} lux\nR {:.6g} +- {:.2g}, G {:.6g} +- {:.2g}, B {:.6g} +- {:.2g}\n",
                         luminance(light), luminance(error), light[0], error[0], light[1], error[1], light[2], error[2])
                 .c_str(),
             stdout);
  return ExitCode::kOk;
}

/// A server that makes a large scene answers when it has made it.
constexpr auto kLoadPatience = std::chrono::minutes(10);

struct SnapshotOptions {
  RemoteOptions server;
  std::string output, camera, quantity = "lit", exposure = "auto";
  int width = 960, height = 720;
};

/// What the pictures of this process, one after the other, hand on to `--exposure same`.
std::optional<double>& exposureBefore() {
  static std::optional<double> exposure;
  return exposure;
}

std::optional<double> exposureIn(const std::string& text) {
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  return error == std::errc() && end == text.data() + text.size() ? std::optional(value) : std::nullopt;
}

std::optional<double> exposureOf(const std::string& text) {
  return text == "same" ? exposureBefore() : exposureIn(text);
}

std::string checkExposure(const std::string& text) {
  const auto value = exposureIn(text);
  const bool good = text == "auto" || text == "same" || (value && *value > 0.0 && *value <= protocol::kMaxExposure);
  return good ? std::string{} : "must be auto, same, or a number above 0: " + text;
}

ExitCode snapshot(const SnapshotOptions& options) {
  const auto remote = remoteFrom(options.server);
  if (!remote) return complain(remote.error());
  auto file = client::AtomicFile::create(options.output);
  if (!file) return complain(file.error());
  auto connection = remote->connect();
  if (!connection) return complain(connection.error());
  const auto made = connection->call(protocol::SnapshotCall{options.camera, options.width, options.height,
                                                            options.quantity, exposureOf(options.exposure)},
                                     kLoadPatience);
  if (!made) return complain(made.error());
  const auto reply = client::httpGetToFile(remote->http(), made->url, *file);
  if (!reply) return complain(reply.error());
  if (!reply->ok()) return complain(httpError(*reply, remote->url.text()));
  if (auto done = file->commit(); !done) return complain(done.error());
  if (made->exposure) exposureBefore() = made->exposure;
  std::printf("%s\n", options.output.c_str());
  if (made->exposure) std::fprintf(stderr, "%s\n", fmt::format("exposure {:.6g} per nit", *made->exposure).c_str());
  return ExitCode::kOk;
}

struct SaveOptions {
  RemoteOptions server;
  std::string output;
  std::string engine;  ///< empty: the plain files
  bool unlit = false, error_map = false, quiet = false;
};

ExitCode saveForEngine(const SaveOptions& options, const Remote& remote) {
  auto connection = remote.connect();
  if (!connection) return complain(connection.error());
  const auto status = connection->call(protocol::StatusCall{});
  if (!status) return complain(status.error());
  const auto& error = status->progress.error;
  ProgressDisplay display(options.quiet);
  const auto saved = saveForEngine(remote, {options.engine, options.output}, {error.total, error.p95}, display);
  display.clear();
  if (!saved) return complain(saved.error());
  for (const auto& path : saved->paths) std::printf("%s\n", path.c_str());
  std::fprintf(stderr, "%s%s\n", outcomeText(status->progress).c_str(), surfaceText(error).c_str());
  tellSaved(*saved, options.quiet);
  return ExitCode::kOk;
}

ExitCode save(const SaveOptions& options) {
  const auto remote = remoteFrom(options.server);
  if (!remote) return complain(remote.error());
  if (!options.engine.empty()) return saveForEngine(options, *remote);
  ProgressDisplay display(options.quiet);
  const SaveRequest request{
      .glb_path = options.output, .unlit = options.unlit, .png_path = {}, .error_map = options.error_map};
  const auto names = saveScene(*remote, request, display);
  display.clear();
  if (!names) return complain(names.error());
  for (const auto& name : *names) std::printf("%s\n", name.c_str());
  return ExitCode::kOk;
}

}  // namespace

void addLoad(CLI::App& app, Run& run) {
  auto options = std::make_shared<LoadOptions>();
  auto& command = *app.add_subcommand("load", "send a scene to a server, which starts to solve it");
  addRemoteOptions(command, options->server);
  command.add_option("SCENE", options->scene, "the scene: .glb, or .gltf with its files beside it")
      ->required()
      ->type_name("");
  command.add_flag("-q,--quiet", options->quiet, "no progress on stderr");
  command.callback([options, &run] { run = [options] { return load(*options); }; });
}

void addStatus(CLI::App& app, Run& run) {
  auto options = std::make_shared<StatusOptions>();
  auto& command = *app.add_subcommand("status", "tell what a server is doing: state, error, energy, settings");
  addRemoteOptions(command, options->server);
  command.add_flag("--json", options->json, "as JSON (errors as fractions, seconds, lumens)");
  command.callback([options, &run] { run = [options] { return status(*options); }; });
}

void addTexel(CLI::App& app, Run& run) {
  auto options = std::make_shared<TexelOptions>();
  auto& command = *app.add_subcommand("texel", "tell the irradiance of one lightmap texel and its standard error, lux");
  addRemoteOptions(command, options->server);
  command.add_option("PAGE", options->texel.page, "the lightmap page, from 0")->required()->type_name("");
  command.add_option("X", options->texel.x, "the texel's column, from 0")->required()->type_name("");
  command.add_option("Y", options->texel.y, "the texel's row, from 0: v = 0")->required()->type_name("");
  command.callback([options, &run] { run = [options] { return texel(*options); }; });
}

void addSnapshot(CLI::App& app, Run& run) {
  auto options = std::make_shared<SnapshotOptions>();
  auto& command = *app.add_subcommand("snapshot", "save a picture of a server's scene as it is now");
  addRemoteOptions(command, options->server);
  command.add_option("-o,--output", options->output, "the picture")->required()->type_name("FILE.png");
  command
      .add_option("--camera", options->camera,
                  "name or index of a camera of the scene (default: the first, or one that frames the scene)")
      ->type_name("NAME");
  const CLI::Range side(16, protocol::kMaxSnapshotSide);
  command.add_option("--width", options->width, "pixels")->check(side)->type_name("PX")->capture_default_str();
  command.add_option("--height", options->height, "pixels")->check(side)->type_name("PX")->capture_default_str();
  command
      .add_option(
          "--quantity", options->quantity,
          "lit, irradiance, radiosity, unshot, error, patchId, mipLevel or normal; all but light in false colours")
      ->check(CLI::IsMember({"lit", "irradiance", "radiosity", "unshot", "error", "patchId", "mipLevel", "normal"}))
      ->type_name("WHAT")
      ->capture_default_str();
  command
      .add_option("--exposure", options->exposure,
                  "what radiance in nits is multiplied by; auto: measured (and told on stderr); same: that of the "
                  "picture before it in a script")
      ->check(CLI::Validator(checkExposure, ""))
      ->type_name("X")
      ->capture_default_str();
  command.callback([options, &run] { run = [options] { return snapshot(*options); }; });
}

void addSave(CLI::App& app, Run& run) {
  auto options = std::make_shared<SaveOptions>();
  auto& command = *app.add_subcommand("save", "save a server's scene and lightmaps as they are now");
  addRemoteOptions(command, options->server);
  command
      .add_option("-o,--output", options->output,
                  "the scene with lightmap UVs; lightmaps go to NAME.lightmap.<page>.exr beside it")
      ->required()
      ->type_name("OUT.glb");
  auto* unlit =
      command.add_flag("--unlit", options->unlit, "OUT.glb shows the tone-mapped result in any glTF viewer instead");
  auto* error_map = command.add_flag("--error-map", options->error_map,
                                     "also the standard error of each texel, in lux: NAME.error.<page>.exr");
  addEngineOption(command, options->engine)->excludes(unlit)->excludes(error_map);
  command.add_flag("-q,--quiet", options->quiet, "no progress on stderr");
  command.callback([options, &run] { run = [options] { return save(*options); }; });
}

}  // namespace radiosity::cli
