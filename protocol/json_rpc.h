// JSON-RPC 2.0 (https://www.jsonrpc.org/specification): text to calls and answers and back, without knowing any method.
// Pure functions; any thread. messages.h and codec.h give the calls their types.
#pragma once

#include <cstdint>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "common/result.h"

namespace radiosity::protocol {

/// Error codes on the wire.
enum class RpcCode : int {
  kParseError = -32700,
  kInvalidRequest = -32600,
  kMethodNotFound = -32601,
  kInvalidParams = -32602,
  kInternalError = -32603,
  kUnauthenticated = -32001,
  kForbidden = -32003,
  kNotFound = -32004,
  kStaleRevision = -32009,
  kTestFailed = -32010,
  kTooLarge = -32013,
  kInvalidScene = -32022,
  kRateLimited = -32029,
  kCancelled = -32049,
  kUnavailable = -32050,
  kDraining = -32053,
};

struct RpcError {
  RpcCode code = RpcCode::kInternalError;
  std::string message;                   ///< for people: what was wrong and what to do
  std::string pointer = {};              ///< data.pointer: JSON pointer into the message or the scene; empty: left out
  std::optional<std::uint64_t> op = {};  ///< data.op: index of the failing operation of a patch
  std::optional<std::uint64_t> revision = {};  ///< data.revision: the current one
};

/// A JSON-RPC id as JSON text (`7`, `"a"`, `null`), echoed as it came. Empty: a notification, which is not answered.
using RequestId = std::string;

using JsonPtr = std::shared_ptr<const nlohmann::json>;

struct RpcRequest {
  RequestId id;
  std::string method;
  JsonPtr params;  ///< null when absent; otherwise an object or an array
};

struct RpcResponse {
  RequestId id;
  JsonPtr result;  ///< null when `error` is set
  std::optional<RpcError> error;
};

/// A message, or an element of a batch, that is neither; to be answered with this error and id (`null` if unknown).
struct RpcMalformed {
  RequestId id;
  RpcError error;
};

using RpcItem = std::variant<RpcRequest, RpcResponse, RpcMalformed>;

struct RpcMessage {
  bool batch = false;  ///< the answers go into one array
  std::vector<RpcItem> items;
};

/// Never throws; whatever is wrong becomes an RpcMalformed. Size (kMaxMessageBytes) and depth (kMaxJsonDepth) are
/// checked before anything is parsed. Linear time.
[[nodiscard]] RpcMessage parseRpc(std::string_view text, std::size_t max_bytes);

/// JSON text to a value under the same depth check. kBadInput names what is wrong and at which byte.
[[nodiscard]] Result<JsonPtr> parseJson(std::string_view text);

/// Depth of nesting by a linear scan that only knows strings and brackets; stops counting past `limit`.
[[nodiscard]] bool isDeeperThan(std::string_view text, std::size_t limit);

[[nodiscard]] std::string encodeError(const RequestId& id, const RpcError& error);
[[nodiscard]] std::string encodeBatch(const std::vector<std::string>& answers);

/// What the engine's errors are called on the wire, and back again for the client's exit codes.
[[nodiscard]] RpcError toRpcError(const Error& error);
[[nodiscard]] Error fromRpcError(const RpcError& error);

}  // namespace radiosity::protocol
