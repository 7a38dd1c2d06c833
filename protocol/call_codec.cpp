// Calls: a client encodes them, the server decodes them.
#include <fmt/format.h>
#include <array>
#include <functional>
#include <utility>

#include "protocol/codec.h"
#include "protocol/json_text.h"
#include "protocol/message_parts.h"

namespace radiosity::protocol {
namespace {

using nlohmann::json;

// ---- to JSON; a call without parameters is an empty object ----

json params(const HelloCall& c) {
  json out = {{"client", c.client}, {"creditBytes", c.credit_bytes}};
  if (!c.token.empty()) out["token"] = c.token;
  for (const auto format : c.tile_formats) out["tileFormats"].push_back(name(format));
  for (const auto codec : c.codecs) out["codecs"].push_back(name(codec));
  if (c.resume)
    out["resume"] = {{"epoch", c.resume->epoch},
                     {"revision", c.resume->revision},
                     {"tileVersion", c.resume->tile_version},
                     {"quantity", name(c.resume->quantity)}};
  return out;
}
json params(const SceneLoadCall& c) { return {{"url", c.url}}; }
json params(const ScenePatchCall& c) {
  json out = {{"patch", json::parse(c.patch, nullptr, false)}};
  if (out["patch"].is_discarded()) out["patch"] = c.patch;  // the server says what is wrong with it
  if (c.base_revision) out["baseRevision"] = *c.base_revision;
  if (c.same_scene_as) out["sameSceneAs"] = *c.same_scene_as;
  if (!c.request_id.empty()) out["requestId"] = c.request_id;
  if (c.dry_run) out["dryRun"] = true;
  return out;
}
template <typename Step>
json stepParams(const Step& c) {
  json out = json::object();
  if (c.base_revision) out["baseRevision"] = *c.base_revision;
  if (!c.request_id.empty()) out["requestId"] = c.request_id;
  return out;
}
json params(const SceneUndoCall& c) { return stepParams(c); }
json params(const SceneRedoCall& c) { return stepParams(c); }
json params(const SceneHistoryCall& c) { return c.limit == kMaxHistory ? json::object() : json{{"limit", c.limit}}; }
json params(const SolveConfigureCall& c) {
  json out = json::object();
  if (c.target_error) out["targetError"] = *c.target_error;
  if (c.time_limit_ms) out["timeLimitMs"] = *c.time_limit_ms;
  if (c.no_time_limit) out["timeLimitMs"] = nullptr;
  if (c.texels) out["texels"] = *c.texels;
  if (c.texel_size_m) out["texelSize"] = *c.texel_size_m;
  if (c.seed) out["seed"] = *c.seed;
  if (c.sky) out["sky"] = toJson(*c.sky);
  if (c.no_sky) out["sky"] = nullptr;
  if (c.double_sided) out["doubleSided"] = *c.double_sided;
  if (c.adaptive) out["adaptive"] = *c.adaptive;
  if (c.method) out["method"] = nameOf(*c.method);
  return out;
}
json params(const SolveWaitCall& c) {
  json out = json::object();
  if (c.error) out["error"] = *c.error;
  if (c.revision) out["revision"] = *c.revision;
  if (c.timeout_ms) out["timeoutMs"] = *c.timeout_ms;
  return out;
}
json params(const SubscribeCall& c) {
  json out = {{"minMip", c.min_mip}, {"maxMip", c.max_mip}, {"maxHz", c.max_hz}, {"quantity", name(c.quantity)}};
  if (!c.lightmaps.empty()) out["lightmaps"] = c.lightmaps;
  return out;
}
json params(const CreditCall& c) { return {{"bytes", c.bytes}}; }
json params(const SnapshotCall& c) {
  json out = {{"width", c.width}, {"height", c.height}, {"quantity", c.quantity}};
  if (!c.camera.empty()) out["camera"] = c.camera;
  if (c.exposure) out["exposure"] = *c.exposure;
  return out;
}
json params(const TexelCall& c) { return {{"page", c.page}, {"x", c.x}, {"y", c.y}}; }
json params(const SolveMeasureCall& c) {
  json out = json::object();
  if (!c.plane.empty()) out["plane"] = c.plane;
  if (c.daylight_factor) out["daylightFactor"] = true;
  return out;
}
json params(const CameraCall& c) { return c.pose ? toJson(*c.pose) : json::object(); }
template <typename C>
json params(const C& /*no parameters*/) {
  return json::object();
}

// ---- from JSON ----

void read(Reader& r, HelloCall& c) {
  r.text("client", c.client, Need::kRequired, kMaxTextBytes);
  r.text("token", c.token, Need::kOptional, kMaxTokenBytes);
  // Names that this version does not know are skipped: a newer client may offer them first.
  std::vector<std::string> names;
  readStrings(r, "tileFormats", Need::kOptional, kMaxListEntries, names);
  for (const auto& text : names)
    if (const auto format = pixelFormatFrom(text)) c.tile_formats.push_back(*format);
  names.clear();
  readStrings(r, "codecs", Need::kOptional, kMaxListEntries, names);
  for (const auto& text : names)
    if (const auto codec = codecFrom(text)) c.codecs.push_back(*codec);
  r.narrow("creditBytes", c.credit_bytes, Need::kOptional, 0, kMaxCreditBytes);
  if (r.find("resume") == nullptr) return;
  r.object("resume", Need::kOptional, [&](Reader& inner) {
    Resume resume;
    inner.text("epoch", resume.epoch, Need::kRequired, kMaxTextBytes);
    inner.integer("revision", resume.revision, Need::kRequired, 0, kAnyInteger);
    inner.integer("tileVersion", resume.tile_version, Need::kRequired, 0, kAnyInteger);
    inner.choice("quantity", resume.quantity, Need::kOptional, quantityFrom, kQuantityNames);
    c.resume = std::move(resume);
  });
}
void read(Reader& r, SceneLoadCall& c) { r.text("url", c.url, Need::kRequired, 4096); }

/// The shape of the patch: enough for the engine to be handed an array of operations.
void readPatch(Reader& r, ScenePatchCall& c) {
  const auto* patch = r.find("patch");
  if (patch == nullptr) return r.refuse(r.pointerOf("patch"), "is missing");
  r.array("patch", Need::kRequired, kMaxPatchOperations, [&](const json& op, const std::string& pointer) {
    Reader inner(&op, pointer);
    std::string text;
    inner.text("op", text, Need::kRequired, 16);
    inner.text("path", text, Need::kRequired, 4096);
    if (inner.failed()) r.refuse(inner.pointer(), inner.message().substr(inner.pointer().size() + 1));
  });
  if (!r.failed()) c.patch = dumpJson(*patch);
}

void read(Reader& r, ScenePatchCall& c) {
  readPatch(r, c);
  r.optionalInteger("baseRevision", c.base_revision, 0, kAnyInteger);
  r.optionalInteger("sameSceneAs", c.same_scene_as, 0, kAnyInteger);
  r.text("requestId", c.request_id, Need::kOptional, kMaxTextBytes);
  r.boolean("dryRun", c.dry_run, Need::kOptional);
}
template <typename Step>
void readStep(Reader& r, Step& c) {
  r.optionalInteger("baseRevision", c.base_revision, 0, kAnyInteger);
  r.text("requestId", c.request_id, Need::kOptional, kMaxTextBytes);
}
void read(Reader& r, SceneUndoCall& c) { readStep(r, c); }
void read(Reader& r, SceneRedoCall& c) { readStep(r, c); }
void read(Reader& r, SceneHistoryCall& c) { r.integer("limit", c.limit, Need::kOptional, 1, kMaxHistory); }
void read(Reader& r, SolveConfigureCall& c) {
  r.optionalNumber("targetError", c.target_error, kErrorRange);
  if (const auto* limit = r.find("timeLimitMs"); limit != nullptr && limit->is_null())
    c.no_time_limit = true;
  else
    r.optionalInteger("timeLimitMs", c.time_limit_ms, 1, kMaxTimeLimitMs);
  r.optionalInteger("texels", c.texels, 1, kMaxTexels);
  r.optionalNumber("texelSize", c.texel_size_m, kTexelSizeRange);
  r.optionalInteger("seed", c.seed, 0, std::numeric_limits<std::uint64_t>::max());
  const auto* sky = r.find("sky");
  c.no_sky = sky != nullptr && sky->is_null();
  readSky(r, c.sky);
  if (bool given = false; r.find("doubleSided") != nullptr) {
    r.boolean("doubleSided", given, Need::kOptional);
    c.double_sided = given;
  }
  if (bool given = false; r.find("adaptive") != nullptr) {
    r.boolean("adaptive", given, Need::kOptional);
    c.adaptive = given;
  }
  if (Method given{}; r.find("method") != nullptr) {
    r.choice("method", given, Need::kOptional, methodFrom, kMethodNamesText);
    c.method = given;
  }
}
void read(Reader& r, SolveWaitCall& c) {
  r.optionalNumber("error", c.error, kErrorRange);
  r.optionalInteger("revision", c.revision, 0, kAnyInteger);
  r.optionalInteger("timeoutMs", c.timeout_ms, 0, kMaxWaitMs);
}
void read(Reader& r, SubscribeCall& c) {
  readIndices(r, "lightmaps", c.lightmaps);
  r.narrow("minMip", c.min_mip, Need::kOptional, 0, kMaxMip);
  r.narrow("maxMip", c.max_mip, Need::kOptional, 0, kMaxMip);
  if (!r.failed() && c.min_mip > c.max_mip) r.refuse(r.pointerOf("minMip"), "must not be above maxMip");
  r.number("maxHz", c.max_hz, Need::kOptional, {0.0, 1000.0, false});
  r.choice("quantity", c.quantity, Need::kOptional, quantityFrom, kQuantityNames);
}
void read(Reader& r, CreditCall& c) { r.narrow("bytes", c.bytes, Need::kRequired, 0, kMaxCreditBytes); }
void read(Reader& r, SnapshotCall& c) {
  r.text("camera", c.camera, Need::kOptional, kMaxTextBytes);
  r.narrow("width", c.width, Need::kOptional, 1, kMaxSnapshotSide);
  r.narrow("height", c.height, Need::kOptional, 1, kMaxSnapshotSide);
  r.text("quantity", c.quantity, Need::kOptional, 64);
  r.optionalNumber("exposure", c.exposure, {0.0, kMaxExposure, true});
}
void read(Reader& r, TexelCall& c) {
  constexpr std::uint64_t kMost = std::numeric_limits<std::uint32_t>::max();
  r.narrow("page", c.page, Need::kRequired, 0, kMost);
  r.narrow("x", c.x, Need::kRequired, 0, kMost);
  r.narrow("y", c.y, Need::kRequired, 0, kMost);
}
void read(Reader& r, SolveMeasureCall& c) {
  r.text("plane", c.plane, Need::kOptional, kMaxTextBytes);
  r.boolean("daylightFactor", c.daylight_factor, Need::kOptional);
}
void read(Reader& r, CameraCall& c) {
  if (r.find("position") != nullptr || r.find("target") != nullptr) read(r, c.pose.emplace());
}
template <typename C>
void read(Reader& /*reader*/, C& /*no parameters*/) {}

/// /params/patch/3/op -> 3.
std::optional<std::uint64_t> patchOperation(const std::string& pointer) {
  constexpr std::string_view kPrefix = "/params/patch/";
  if (!pointer.starts_with(kPrefix)) return std::nullopt;
  std::uint64_t op = 0;
  for (std::size_t i = kPrefix.size(); i < pointer.size() && pointer[i] != '/'; ++i)
    op = op * 10 + static_cast<std::uint64_t>(pointer[i] - '0');
  return op;
}

using DecodedCall = tl::expected<Call, RpcError>;

template <typename C>
DecodedCall decodeCallAs(const json* object) {
  Reader reader(object, "/params");
  C call;
  read(reader, call);
  if (!reader.failed()) return Call(std::move(call));
  return tl::unexpected(
      RpcError{RpcCode::kInvalidParams, reader.message(), reader.pointer(), patchOperation(reader.pointer())});
}

struct Method {
  std::string_view name;
  DecodedCall (*decode)(const json*);
};

template <typename... C>
constexpr auto methodsOf(std::variant<C...>* /*only its type counts*/) {
  return std::array{Method{C::kMethod, &decodeCallAs<C>}...};
}

constexpr auto kMethods = methodsOf(static_cast<Call*>(nullptr));

}  // namespace

tl::expected<Call, RpcError> decodeCall(const RpcRequest& request) {
  for (const auto& method : kMethods)
    if (method.name == request.method) return method.decode(request.params.get());
  return tl::unexpected(RpcError{RpcCode::kMethodNotFound,
                                 fmt::format("there is no method \"{}\"", request.method.substr(0, 64)), "/method"});
}

std::vector<std::string> methodNames() {
  std::vector<std::string> names;
  for (const auto& method : kMethods) names.emplace_back(method.name);
  return names;
}

std::string encodeCall(const RequestId& id, const Call& call) {
  return std::visit(
      [&](const auto& c) {
        json message = {{"jsonrpc", "2.0"}, {"method", std::decay_t<decltype(c)>::kMethod}};
        if (auto body = params(c); !body.empty()) message["params"] = std::move(body);
        if (!id.empty()) message["id"] = json::parse(id);
        return dumpJson(message);
      },
      call);
}

}  // namespace radiosity::protocol
