// Errors that a peer, a file or a driver can cause travel as values. Our own bugs use CHECK (check.h).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <tl/expected.hpp>
#include <utility>

namespace radiosity {

/// What kind of thing went wrong; the protocol and the exit codes are derived from it.
enum class ErrorCode {
  kBadUsage,       ///< an option or argument makes no sense
  kBadInput,       ///< a file or document cannot be read as what it claims to be
  kInvalidScene,   ///< readable, but not a scene we can light (protocol -32022)
  kUnsupported,    ///< a required feature we do not have, named
  kNotFound,       ///< a file, page, tile or revision that does not exist
  kTooLarge,       ///< over a stated limit (protocol -32013)
  kStaleRevision,  ///< baseRevision is not the current one, or sameSceneAs of another scene (protocol -32009)
  kTestFailed,     ///< a JSON Patch `test` did not hold (protocol -32010)
  kBusy,           ///< try again later: queue full, draining
  kUnavailable,    ///< no driver, no connection, port in use
  kInternal,       ///< a bug that did not have to end the process
  kCancelled,      ///< called off before its end: another load came, or the server stops (protocol -32049)
};

/// `message` says what was wrong and what to do; `where` names the place: "room.glb", "/materials/3/emissiveFactor",
/// "room.glb: /accessors/4/count".
struct Error {
  ErrorCode code = ErrorCode::kInternal;
  std::string message;
  std::string where = {};
  std::optional<std::uint32_t> operation = {};  ///< index of the JSON Patch operation that failed

  /// "where: message", or just the message.
  [[nodiscard]] std::string text() const { return where.empty() ? message : where + ": " + message; }
};

template <typename T>
using Result = tl::expected<T, Error>;

[[nodiscard]] inline tl::unexpected<Error> fail(ErrorCode code, std::string message, std::string where = {}) {
  return tl::unexpected<Error>(Error{code, std::move(message), std::move(where)});
}

}  // namespace radiosity
