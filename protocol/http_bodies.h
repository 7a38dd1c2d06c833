// JSON bodies of the HTTP routes. Pure functions; any thread.
#pragma once

#include <string>
#include <string_view>

#include "common/result.h"
#include "protocol/messages.h"

namespace radiosity::protocol {

/// {"error": {"code": "notFound", "message": "...", "where": "..."}}
struct HttpError {
  std::string code, message, where;
};

/// "badUsage", "badInput", "invalidScene", "unsupported", "notFound", "tooLarge", "staleRevision", "testFailed",
/// "busy", "unavailable", "internal".
[[nodiscard]] std::string_view httpCode(ErrorCode code);

[[nodiscard]] std::string encodeHttpError(const HttpError& error);
/// The error in a response's body; where there is none, `status` says what can be said.
[[nodiscard]] Error decodeHttpError(int status, std::string_view body);

[[nodiscard]] std::string encodeHttpLoad(const SceneLoadReply& reply);  ///< {"revision", "warnings"}
[[nodiscard]] Result<SceneLoadReply> decodeHttpLoad(std::string_view body);

[[nodiscard]] std::string encodeHttpPlanes(const Planes& planes);  ///< as the reply of solve.measure
[[nodiscard]] Result<Planes> decodeHttpPlanes(std::string_view body);

[[nodiscard]] std::string encodeHttpUrl(std::string_view url);  ///< {"url"}
[[nodiscard]] Result<std::string> decodeHttpUrl(std::string_view body);

}  // namespace radiosity::protocol
