// What all commands that talk to a server share: its address, the token, and how answers become errors or files.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

#include "client/cli/exit_code.h"
#include "client/cli/progress_line.h"
#include "client/cli/sky_options.h"
#include "client/lib/connection.h"
#include "client/lib/http.h"
#include "common/result.h"

namespace radiosity::cli {

/// As the options give it.
struct RemoteOptions {
  std::string url;
  std::string token_file;
  client::TlsTrust trust;
};

/// Adds the positional URL and the options of access.
void addRemoteOptions(CLI::App& command, RemoteOptions& options);
/// --token-file, --ca, --insecure.
void addAccessOptions(CLI::App& command, RemoteOptions& options);

/// A server that can be spoken to.
struct Remote {
  client::ServerUrl url;
  client::TlsTrust trust = {};
  std::string token = {};
  client::KeepGoing keep_going = {};  ///< stops at an interruption

  [[nodiscard]] client::HttpOptions http() const {
    return {.url = url, .trust = trust, .token = token, .keep_going = keep_going};
  }
  [[nodiscard]] client::CallResult<client::Connection> connect() const;
};
[[nodiscard]] Result<Remote> remoteFrom(const RemoteOptions& options);

/// The Error of an answer that is not 2xx: the server's own words where its body has them. `where` as in Error.
[[nodiscard]] Error httpError(const client::HttpReply& reply, const std::string& where);

struct Loaded {
  std::uint64_t revision = 0;
  std::vector<std::string> warnings;
};
/// Sends a scene file (PUT /scene): GLB as it is, glTF with its external files packed in; either with another sky where
/// one is chosen for the scene.
[[nodiscard]] Result<Loaded> uploadScene(const Remote& remote, const std::string& path, const SkyChoice& sky,
                                         ProgressDisplay& display);

/// Downloads GLB and lightmap pages of one revision, complete or not at all: "OUT.glb" and "OUT.lightmap.<page>.exr";
/// with `error_map` also "OUT.error.<page>.exr", the standard error of the lightmaps' texels in lux.
/// Returns the names of the files written.
struct SaveRequest {
  std::string glb_path;
  bool unlit = false;
  std::string png_path;  ///< empty: none
  bool error_map = false;
};
[[nodiscard]] Result<std::vector<std::string>> saveScene(const Remote& remote, const SaveRequest& request,
                                                         ProgressDisplay& display);
/// kBadUsage where the outputs cannot be written; to be asked before a long solve rather than after.
[[nodiscard]] Result<void> checkOutputs(const std::vector<std::string>& paths);
/// "room.glb" -> "room"; kBadUsage for another ending.
[[nodiscard]] Result<std::string> glbStem(const std::string& path);

}  // namespace radiosity::cli
