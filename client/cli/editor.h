// Edits of a server's scene: sends patches so that a lost connection does no harm, and makes edits that depend on the
// present scene under its revision, again when somebody else was faster. One thread; blocking.
#pragma once

#include <functional>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>

#include "client/cli/remote.h"
#include "protocol/messages.h"

namespace radiosity::cli {

using Json = nlohmann::json;

struct FetchedScene {
  std::uint64_t revision = 0;
  Json gltf;
};

/// The scene's document; by URL where it is too long for a message.
[[nodiscard]] client::CallResult<FetchedScene> fetchScene(const Remote& remote);

/// Sends an edit; after a lost connection again under the same request id, which the server applies once. A server that
/// is gone then is waited for, 15 s. `CallType` has a request_id.
template <typename CallType>
[[nodiscard]] client::CallResult<typename CallType::Reply> sendEdit(const Remote& remote, CallType call);

/// Makes a patch from the scene as it is and sends it for just that revision; makes it again when another edit came
/// first (20 times at most). What `make` cannot do is an error of kBadInput.
using MakePatch = std::function<Result<Json>(const Json& gltf)>;
[[nodiscard]] client::CallResult<protocol::ScenePatchReply> editScene(const Remote& remote, const MakePatch& make);

/// "revision 4, affected: 6 surfaces, 1200 shots" on stdout.
void printEdit(std::uint64_t revision, std::uint64_t surfaces, std::uint64_t shots);

}  // namespace radiosity::cli
