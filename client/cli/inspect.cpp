// radiosity load, status, snapshot and save: one exchange with a server each.
#include <fmt/format.h>

#include <memory>

#include "client/cli/commands.h"
#include "client/cli/remote.h"
#include "client/cli/report.h"

namespace radiosity::cli {
namespace {

struct LoadOptions {
  RemoteOptions server;
  std::string scene;
  bool quiet = false;
};

ExitCode load(const LoadOptions& options) {
  const auto remote = remoteFrom(options.server);
  if (!remote) return complain(remote.error());
  ProgressDisplay display(options.quiet);
  const auto loaded = uploadScene(*remote, options.scene, display);
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

struct SnapshotOptions {
  RemoteOptions server;
  std::string output, camera, quantity = "lit";
  int width = 960, height = 720;
};

ExitCode snapshot(const SnapshotOptions& options) {
  const auto remote = remoteFrom(options.server);
  if (!remote) return complain(remote.error());
  auto file = client::AtomicFile::create(options.output);
  if (!file) return complain(file.error());
  std::string target = fmt::format("/snapshot.png?width={}&height={}&quantity={}", options.width, options.height,
                                   client::percentEncode(options.quantity));
  if (!options.camera.empty()) target += "&camera=" + client::percentEncode(options.camera);
  const auto reply = client::httpGetToFile(remote->http(), target, *file);
  if (!reply) return complain(reply.error());
  if (!reply->ok()) return complain(httpError(*reply, remote->url.text()));
  if (auto done = file->commit(); !done) return complain(done.error());
  std::printf("%s\n", options.output.c_str());
  return ExitCode::kOk;
}

struct SaveOptions {
  RemoteOptions server;
  std::string output;
  bool unlit = false, error_map = false, quiet = false;
};

ExitCode save(const SaveOptions& options) {
  const auto remote = remoteFrom(options.server);
  if (!remote) return complain(remote.error());
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
  command.add_flag("--unlit", options->unlit, "OUT.glb shows the tone-mapped result in any glTF viewer instead");
  command.add_flag("--error-map", options->error_map,
                   "also the standard error of each texel, in lux: NAME.error.<page>.exr");
  command.add_flag("-q,--quiet", options->quiet, "no progress on stderr");
  command.callback([options, &run] { run = [options] { return save(*options); }; });
}

}  // namespace radiosity::cli
