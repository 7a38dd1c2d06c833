#include "protocol/json_rpc.h"

#include <fmt/format.h>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <utility>

#include "protocol/json_text.h"
#include "protocol/limits.h"

namespace radiosity::protocol {
namespace {

using nlohmann::json;

struct CodePair {
  ErrorCode ours;
  RpcCode wire;
};
// Read from the top in both directions: the first pair that matches wins.
constexpr std::array kCodes = {
    CodePair{ErrorCode::kBadUsage, RpcCode::kInvalidParams},
    CodePair{ErrorCode::kInvalidScene, RpcCode::kInvalidScene},
    CodePair{ErrorCode::kBadInput, RpcCode::kInvalidScene},
    CodePair{ErrorCode::kUnsupported, RpcCode::kInvalidScene},
    CodePair{ErrorCode::kNotFound, RpcCode::kNotFound},
    CodePair{ErrorCode::kTooLarge, RpcCode::kTooLarge},
    CodePair{ErrorCode::kStaleRevision, RpcCode::kStaleRevision},
    CodePair{ErrorCode::kTestFailed, RpcCode::kTestFailed},
    CodePair{ErrorCode::kBusy, RpcCode::kRateLimited},
    CodePair{ErrorCode::kBusy, RpcCode::kDraining},
    CodePair{ErrorCode::kUnavailable, RpcCode::kUnavailable},
    CodePair{ErrorCode::kUnavailable, RpcCode::kUnauthenticated},
    CodePair{ErrorCode::kUnavailable, RpcCode::kForbidden},
    CodePair{ErrorCode::kCancelled, RpcCode::kCancelled},
    CodePair{ErrorCode::kInternal, RpcCode::kInternalError},
};

RpcMalformed malformed(RequestId id, RpcCode code, std::string message, std::string pointer = {}) {
  return {std::move(id), RpcError{code, std::move(message), std::move(pointer)}};
}

/// The id's JSON text, or nothing when it is not a string, number or null, or is too long.
std::optional<RequestId> idText(const json& value) {
  if (!value.is_string() && !value.is_number() && !value.is_null()) return std::nullopt;
  auto text = dumpJson(value);
  if (text.size() > kMaxRequestIdBytes) return std::nullopt;
  return text;
}

std::optional<RpcError> readError(const json& value) {
  const auto code = value.is_object() ? value.find("code") : value.end();
  if (!value.is_object() || code == value.end() || !code->is_number_integer()) return std::nullopt;
  RpcError error;
  error.code = static_cast<RpcCode>(code->get<std::int64_t>());
  if (const auto m = value.find("message"); m != value.end() && m->is_string()) error.message = m->get<std::string>();
  const auto data = value.find("data");
  if (data == value.end() || !data->is_object()) return error;
  if (const auto m = data->find("pointer"); m != data->end() && m->is_string()) error.pointer = m->get<std::string>();
  if (const auto m = data->find("op"); m != data->end() && m->is_number_unsigned()) error.op = m->get<std::uint64_t>();
  if (const auto m = data->find("revision"); m != data->end() && m->is_number_unsigned())
    error.revision = m->get<std::uint64_t>();
  return error;
}

RpcItem readResponse(json& value, RequestId id) {
  const auto result = value.find("result");
  const auto error = value.find("error");
  if (result != value.end() && error == value.end())
    return RpcResponse{std::move(id), std::make_shared<const json>(std::move(*result)), std::nullopt};
  if (error != value.end() && result == value.end()) {
    if (auto read = readError(*error)) return RpcResponse{std::move(id), nullptr, std::move(*read)};
  }
  return malformed("null", RpcCode::kInvalidRequest, "a response needs either result or error {code, message}");
}

RpcItem readRequest(json& value, RequestId id) {
  auto& method = value["method"];
  if (!method.is_string())
    return malformed(id.empty() ? "null" : id, RpcCode::kInvalidRequest, "method must be a string", "/method");
  const auto params = value.find("params");
  if (params == value.end()) return RpcRequest{std::move(id), method.get<std::string>(), nullptr};
  if (!params->is_structured())
    return malformed(id.empty() ? "null" : id, RpcCode::kInvalidRequest, "params must be an object", "/params");
  auto name = method.get<std::string>();
  return RpcRequest{std::move(id), std::move(name), std::make_shared<const json>(std::move(*params))};
}

RpcItem readItem(json& value) {
  if (!value.is_object()) return malformed("null", RpcCode::kInvalidRequest, "a JSON-RPC message must be an object");
  RequestId id;
  if (const auto found = value.find("id"); found != value.end()) {
    auto text = idText(*found);
    if (!text)
      return malformed("null", RpcCode::kInvalidRequest,
                       fmt::format("id must be a string, number or null of at most {} bytes", kMaxRequestIdBytes),
                       "/id");
    id = std::move(*text);
  }
  const auto version = value.find("jsonrpc");
  if (version == value.end() || *version != "2.0")
    return malformed(id.empty() ? "null" : id, RpcCode::kInvalidRequest, "jsonrpc must be \"2.0\"", "/jsonrpc");
  if (value.contains("method")) return readRequest(value, std::move(id));
  if (!id.empty() && (value.contains("result") || value.contains("error"))) return readResponse(value, std::move(id));
  return malformed(id.empty() ? "null" : id, RpcCode::kInvalidRequest, "method is missing", "/method");
}

RpcMessage whole(RpcMalformed item) {
  RpcMessage message;
  message.items.emplace_back(std::move(item));
  return message;
}

/// What is wrong, without what nlohmann says of itself, nor all that it had read of a token: that may be a whole
/// message.
std::string reasonOf(std::string_view what) {
  constexpr std::size_t kEnough = 300;
  if (const auto start = what.find("] "); start != std::string_view::npos) what.remove_prefix(start + 2);
  return what.size() > kEnough ? std::string(what.substr(0, kEnough)) + " ..." : std::string(what);
}

/// Parses after the depth check; the message of nlohmann's exception says where.
Result<json> parseChecked(std::string_view text) {
  if (isDeeperThan(text, kMaxJsonDepth))
    return fail(ErrorCode::kTooLarge, fmt::format("JSON is nested deeper than {} levels", kMaxJsonDepth));
  // nlohmann 3.11.2 takes a NUL for the end and would accept what stands before it.
  if (const auto nul = text.find('\0'); nul != std::string_view::npos)
    return fail(ErrorCode::kBadInput, fmt::format("not JSON: NUL at byte {}", nul));
  try {
    return json::parse(text);
  } catch (const json::exception& e) {
    return fail(ErrorCode::kBadInput, "not JSON: " + reasonOf(e.what()));
  }
}

}  // namespace

std::string dumpJson(const json& value) { return value.dump(-1, ' ', false, json::error_handler_t::replace); }

double sixDigits(double value) {
  std::array<char, 32> text{};
  std::snprintf(text.data(), text.size(), "%.6g", value);
  return std::strtod(text.data(), nullptr);
}

bool isDeeperThan(std::string_view text, std::size_t limit) {
  std::size_t depth = 0;
  bool in_string = false;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const char c = text[i];
    if (in_string) {
      if (c == '\\') ++i;
      if (c == '"') in_string = false;
    } else if (c == '"') {
      in_string = true;
    } else if (c == '[' || c == '{') {
      if (++depth > limit) return true;
    } else if ((c == ']' || c == '}') && depth > 0) {
      --depth;
    }
  }
  return false;
}

Result<JsonPtr> parseJson(std::string_view text) {
  auto parsed = parseChecked(text);
  if (!parsed) return tl::unexpected(std::move(parsed.error()));
  return std::make_shared<const json>(std::move(*parsed));
}

RpcMessage parseRpc(std::string_view text, std::size_t max_bytes) {
  if (text.size() > max_bytes)
    return whole(malformed("null", RpcCode::kTooLarge,
                           fmt::format("message of {} bytes; at most {} are accepted", text.size(), max_bytes)));
  auto parsed = parseChecked(text);
  if (!parsed) return whole(malformed("null", RpcCode::kParseError, std::move(parsed.error().message)));
  if (!parsed->is_array()) {
    RpcMessage message;
    message.items.push_back(readItem(*parsed));
    return message;
  }
  if (parsed->empty()) return whole(malformed("null", RpcCode::kInvalidRequest, "a batch must not be empty"));
  if (parsed->size() > kMaxBatch)
    return whole(malformed("null", RpcCode::kTooLarge,
                           fmt::format("batch of {} calls; at most {} are accepted", parsed->size(), kMaxBatch)));
  RpcMessage message;
  message.batch = true;
  for (auto& element : *parsed) message.items.push_back(readItem(element));
  return message;
}

std::string encodeError(const RequestId& id, const RpcError& error) {
  json body = {{"code", static_cast<int>(error.code)}, {"message", error.message}};
  if (!error.pointer.empty()) body["data"]["pointer"] = error.pointer;
  if (error.op) body["data"]["op"] = *error.op;
  if (error.revision) body["data"]["revision"] = *error.revision;
  return fmt::format(R"({{"jsonrpc":"2.0","id":{},"error":{}}})", id.empty() ? "null" : id, dumpJson(body));
}

std::string encodeBatch(const std::vector<std::string>& answers) {
  return fmt::format("[{}]", fmt::join(answers, ","));
}

RpcError toRpcError(const Error& error) {
  for (const auto& pair : kCodes)
    if (pair.ours == error.code) return {pair.wire, error.message, error.where, error.operation};
  return {RpcCode::kInternalError, error.message, error.where, error.operation};
}

Error fromRpcError(const RpcError& error) {
  for (const auto& pair : kCodes)
    if (pair.wire == error.code) return {pair.ours, error.message, error.pointer};
  return {ErrorCode::kInternal, fmt::format("{} (code {})", error.message, static_cast<int>(error.code)),
          error.pointer};
}

}  // namespace radiosity::protocol
