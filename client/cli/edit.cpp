// radiosity edit: applies a JSON Patch (RFC 6902) to the scene that a server holds.
#include <cstdio>
#include <fstream>
#include <iostream>
#include <memory>
#include <optional>

#include "client/cli/commands.h"
#include "client/cli/editor.h"

namespace radiosity::cli {
namespace {

struct EditOptions {
  RemoteOptions server;
  std::string patch_file;
  std::optional<std::uint64_t> base_revision;
  bool dry_run = false;
};

Result<std::string> readBounded(std::istream& stream, const std::string& name) {
  std::string text(protocol::kMaxMessageBytes + 1, '\0');
  stream.read(text.data(), static_cast<std::streamsize>(text.size()));
  if (stream.bad()) return fail(ErrorCode::kBadInput, "cannot be read", name);
  text.resize(static_cast<std::size_t>(stream.gcount()));
  if (text.size() > protocol::kMaxMessageBytes)
    return fail(ErrorCode::kTooLarge, "the patch is over the protocol's limit of 1 MiB; split it", name);
  return text;
}

/// The patch's text, known to be JSON; everything else about it is the server's to judge.
Result<std::string> readPatch(const std::string& path) {
  Result<std::string> text = std::string();
  const bool is_stdin = path == "-";
  const std::string name = is_stdin ? "standard input" : path;
  if (is_stdin) {
    text = readBounded(std::cin, name);
  } else {
    std::ifstream file(path, std::ios::binary);
    if (!file) return fail(ErrorCode::kBadInput, "no such file, or no permission to read it", path);
    text = readBounded(file, name);
  }
  if (!text) return text;
  if (auto json = protocol::parseJson(*text); !json) return fail(ErrorCode::kBadInput, json.error().text(), name);
  return text;
}

ExitCode edit(const EditOptions& options) {
  const auto remote = remoteFrom(options.server);
  if (!remote) return complain(remote.error());
  auto patch = readPatch(options.patch_file);
  if (!patch) return complain(patch.error());
  const auto reply = sendEdit(
      *remote, protocol::ScenePatchCall{
                   .patch = std::move(*patch), .base_revision = options.base_revision, .dry_run = options.dry_run});
  if (!reply) return complain(reply.error());
  if (options.dry_run) std::fputs("dry run: ", stdout);
  printEdit(reply->revision, reply->affected_surfaces, reply->affected_shots);
  return ExitCode::kOk;
}

}  // namespace

void addEdit(CLI::App& app, Run& run) {
  auto options = std::make_shared<EditOptions>();
  auto& command = *app.add_subcommand("edit", "change a server's scene by a JSON Patch (RFC 6902) on its glTF");
  addRemoteOptions(command, options->server);
  command
      .add_option("PATCH", options->patch_file,
                  "file with the patch, - for standard input; for example\n"
                  "[{\"op\":\"replace\",\"path\":\"/materials/3/emissiveFactor\",\"value\":[1,0.8,0.6]}]")
      ->required()
      ->type_name("");
  command.add_option("--base-revision", options->base_revision, "fail (exit 2) unless the scene is at this revision")
      ->type_name("N");
  command.add_flag("--dry-run", options->dry_run, "check the patch and tell what it would affect, without applying it");
  command.callback([options, &run] { run = [options] { return edit(*options); }; });
}

}  // namespace radiosity::cli
