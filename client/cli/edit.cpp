// radiosity edit: applies a JSON Patch (RFC 6902) to the scene that a server holds.
#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <iostream>
#include <iterator>
#include <memory>
#include <optional>
#include <random>
#include <thread>

#include "client/cli/commands.h"
#include "client/cli/interrupt.h"
#include "client/cli/remote.h"

namespace radiosity::cli {
namespace {

using namespace std::chrono_literals;

constexpr int kAttempts = 3;

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

std::string newRequestId() {
  std::random_device random;
  return fmt::format("{:08x}{:08x}{:08x}{:08x}", random(), random(), random(), random());
}

/// Sends the patch; after a lost connection again under the same request id, which the server applies once.
client::CallResult<protocol::ScenePatchReply> send(const Remote& remote, const protocol::ScenePatchCall& call) {
  client::BackOff back_off;
  for (int attempt = 1;; ++attempt) {
    auto connection = remote.connect();
    if (!connection) return tl::unexpected(connection.error());
    auto reply = connection->call(call);
    if (reply || reply.error().rpc || interrupted() || attempt == kAttempts) return reply;
    warn(reply.error().error.text() + "; sending the edit again");
    std::this_thread::sleep_for(back_off.next());
  }
}

ExitCode edit(const EditOptions& options) {
  const auto remote = remoteFrom(options.server);
  if (!remote) return complain(remote.error());
  auto patch = readPatch(options.patch_file);
  if (!patch) return complain(patch.error());
  const auto reply = send(*remote, {.patch = std::move(*patch),
                                    .base_revision = options.base_revision,
                                    .request_id = newRequestId(),
                                    .dry_run = options.dry_run});
  if (!reply) return complain(reply.error());
  std::printf("%srevision %llu, affected: %llu surfaces, %llu shots\n", options.dry_run ? "dry run: " : "",
              static_cast<unsigned long long>(reply->revision),
              static_cast<unsigned long long>(reply->affected_surfaces),
              static_cast<unsigned long long>(reply->affected_shots));
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
