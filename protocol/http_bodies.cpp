#include "protocol/http_bodies.h"

#include <fmt/format.h>
#include <array>
#include <nlohmann/json.hpp>
#include <utility>

#include "protocol/codec.h"
#include "protocol/json_text.h"

namespace radiosity::protocol {
namespace {

using nlohmann::json;

constexpr std::array<std::pair<ErrorCode, std::string_view>, 12> kCodeNames{
    {{ErrorCode::kBadUsage, "badUsage"},
     {ErrorCode::kBadInput, "badInput"},
     {ErrorCode::kInvalidScene, "invalidScene"},
     {ErrorCode::kUnsupported, "unsupported"},
     {ErrorCode::kNotFound, "notFound"},
     {ErrorCode::kTooLarge, "tooLarge"},
     {ErrorCode::kStaleRevision, "staleRevision"},
     {ErrorCode::kTestFailed, "testFailed"},
     {ErrorCode::kBusy, "busy"},
     {ErrorCode::kUnavailable, "unavailable"},
     {ErrorCode::kCancelled, "cancelled"},
     {ErrorCode::kInternal, "internal"}}};

std::string stringAt(const json& object, const char* key) {
  const auto found = object.find(key);
  return found != object.end() && found->is_string() ? found->get<std::string>() : std::string();
}

}  // namespace

std::string_view httpCode(ErrorCode code) {
  for (const auto& [ours, text] : kCodeNames)
    if (ours == code) return text;
  return "internal";
}

std::string encodeHttpError(const HttpError& error) {
  json body = {{"code", error.code}, {"message", error.message}};
  if (!error.where.empty()) body["where"] = error.where;
  return dumpJson({{"error", std::move(body)}});
}

Error decodeHttpError(int status, std::string_view body) {
  Error error{ErrorCode::kUnavailable, fmt::format("HTTP status {}", status), {}};
  const auto parsed = parseJson(body);
  if (!parsed || !(*parsed)->is_object()) return error;
  const auto found = (*parsed)->find("error");
  if (found == (*parsed)->end() || !found->is_object()) return error;
  error.message = stringAt(*found, "message");
  error.where = stringAt(*found, "where");
  const auto code = stringAt(*found, "code");
  for (const auto& [ours, text] : kCodeNames)
    if (text == code) error.code = ours;
  return error;
}

std::string encodeHttpLoad(const SceneLoadReply& reply) {
  return dumpJson({{"revision", reply.revision}, {"warnings", reply.warnings}});
}

Result<SceneLoadReply> decodeHttpLoad(std::string_view body) {
  return parseJson(body).and_then([](const JsonPtr& value) { return decodeReply<SceneLoadReply>(*value); });
}

std::string encodeHttpUrl(std::string_view url) { return dumpJson({{"url", url}}); }

Result<std::string> decodeHttpUrl(std::string_view body) {
  return parseJson(body).and_then([](const JsonPtr& value) -> Result<std::string> {
    if (value->is_object())
      if (auto url = stringAt(*value, "url"); !url.empty()) return url;
    return fail(ErrorCode::kBadInput, "answer without url");
  });
}

}  // namespace radiosity::protocol
