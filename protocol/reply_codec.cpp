// Replies: the server encodes them, a client decodes them.
#include <fmt/format.h>
#include <utility>

#include "protocol/codec.h"
#include "protocol/json_text.h"
#include "protocol/message_parts.h"

namespace radiosity::protocol {
namespace {

using nlohmann::json;

std::string answer(const RequestId& id, const std::string& result) {
  return fmt::format(R"({{"jsonrpc":"2.0","id":{},"result":{}}})", id.empty() ? "null" : id, result);
}
std::string answer(const RequestId& id, const json& result) { return answer(id, dumpJson(result)); }

void read(Reader& r, HelloReply& reply) {
  r.text("epoch", reply.epoch, Need::kRequired, kMaxTextBytes);
  r.integer("revision", reply.revision, Need::kRequired, 0, kAnyInteger);
  r.choice("tileFormat", reply.tile_format, Need::kRequired, pixelFormatFrom, "rgba16f, rgb9e5, rgba32f, r32ui");
  r.choice("codec", reply.codec, Need::kRequired, codecFrom, "none, deflate");
  r.narrow("creditBytes", reply.credit_bytes, Need::kRequired, 0, kAnyInteger);
  r.boolean("resumed", reply.resumed, Need::kRequired);
}
void read(Reader& r, SceneGetReply& reply) {
  r.integer("revision", reply.revision, Need::kRequired, 0, kAnyInteger);
  r.text("url", reply.url, Need::kOptional, kAnyText);
  if (const auto* gltf = r.find("gltf"))
    reply.gltf = dumpJson(*gltf);
  else if (reply.url.empty())
    r.refuse(r.pointerOf("gltf"), "is missing");
}
void read(Reader& r, SceneLoadReply& reply) {
  r.integer("revision", reply.revision, Need::kRequired, 0, kAnyInteger);
  readStrings(r, "warnings", Need::kOptional, kAnyInteger, reply.warnings);
}
void read(Reader& r, ScenePatchReply& reply) {
  r.integer("revision", reply.revision, Need::kRequired, 0, kAnyInteger);
  r.object("affected", Need::kRequired, [&](Reader& inner) {
    inner.integer("surfaces", reply.affected_surfaces, Need::kRequired, 0, kAnyInteger);
    inner.integer("shots", reply.affected_shots, Need::kRequired, 0, kAnyInteger);
  });
}
void read(Reader& r, SceneStepReply& reply) {
  ScenePatchReply common;
  read(r, common);
  reply.revision = common.revision;
  reply.affected_surfaces = common.affected_surfaces;
  reply.affected_shots = common.affected_shots;
  r.integer("edit", reply.edit, Need::kRequired, 0, kAnyInteger);
}
void read(Reader& r, PastRevision& past) {
  r.integer("revision", past.revision, Need::kRequired, 0, kAnyInteger);
  r.text("kind", past.kind, Need::kRequired, kMaxTextBytes);
  r.text("by", past.by, Need::kOptional, kAnyText);
  r.text("summary", past.summary, Need::kOptional, kAnyText);
  r.number("time", past.time_s, Need::kRequired, {});
  r.optionalInteger("edit", past.edit, 0, kAnyInteger);
  r.boolean("undone", past.undone, Need::kOptional);
}
void read(Reader& r, ErrorSample& sample) {
  r.number("seconds", sample.seconds, Need::kRequired, {});
  r.number("total", sample.total, Need::kRequired, {});
  r.number("texels", sample.texels, Need::kRequired, {});
  r.number("residual", sample.residual, Need::kRequired, {});
  r.number("sampling", sample.sampling, Need::kRequired, {});
  r.number("variation", sample.variation, Need::kRequired, {});
}
/// A list of objects.
template <typename T>
void readEach(Reader& r, const char* key, std::vector<T>& out) {
  r.array(key, Need::kRequired, kMaxListEntries, [&](const json& element, const std::string& pointer) {
    Reader inner(&element, pointer);
    read(inner, out.emplace_back());
    if (inner.failed()) r.refuse(inner.pointer(), inner.message().substr(inner.pointer().size() + 1));
  });
}
void read(Reader& r, SceneHistoryReply& reply) {
  r.integer("revision", reply.revision, Need::kRequired, 0, kAnyInteger);
  r.integer("undoable", reply.undoable, Need::kRequired, 0, kAnyInteger);
  r.integer("redoable", reply.redoable, Need::kRequired, 0, kAnyInteger);
  readEach(r, "revisions", reply.revisions);
}
void read(Reader& r, SolveHistoryReply& reply) {
  r.integer("revision", reply.revision, Need::kRequired, 0, kAnyInteger);
  readEach(r, "samples", reply.samples);
}
void read(Reader& r, StateReply& reply) { r.text("state", reply.state, Need::kRequired, kMaxTextBytes); }
void read(Reader& r, StatusReply& reply) {
  read(r, reply.progress);
  r.object("settings", Need::kRequired, [&](Reader& inner) { read(inner, reply.settings); });
  readStrings(r, "warnings", Need::kOptional, kAnyInteger, reply.warnings);
  r.integer("warningCount", reply.warning_count, Need::kOptional, 0, kAnyInteger);
  r.text("glRenderer", reply.gl_renderer, Need::kOptional, kAnyText);
  if (const auto* counters = r.find("counters"); counters != nullptr && counters->is_object())
    for (const auto& [key, value] : counters->items())
      if (value.is_number()) reply.counters[key] = value.get<double>();
  if (r.find("reached") != nullptr) r.boolean("reached", reply.reached.emplace(), Need::kOptional);
}
void read(Reader& r, SubscribeReply& reply) {
  readIndices(r, "lightmaps", reply.lightmaps);
  r.narrow("minMip", reply.min_mip, Need::kRequired, 0, 0xffffffffU);
  r.narrow("maxMip", reply.max_mip, Need::kRequired, 0, 0xffffffffU);
  r.number("maxHz", reply.max_hz, Need::kRequired, {});
  r.choice("quantity", reply.quantity, Need::kRequired, quantityFrom, kQuantityNames);
}
void read(Reader& r, CreditReply& reply) {
  const auto* value = r.find("creditBytes");  // may be negative by a frame
  if (value == nullptr || !value->is_number_integer())
    return r.refuse(r.pointerOf("creditBytes"), "must be an integer");
  reply.credit_bytes = value->get<std::int64_t>();
}
void read(Reader& r, SnapshotReply& reply) {
  r.text("url", reply.url, Need::kRequired, kAnyText);
  r.optionalNumber("exposure", reply.exposure, {0.0, std::numeric_limits<double>::max(), true});
}
void read(Reader& r, TexelReply& reply) {
  constexpr double kMost = std::numeric_limits<double>::max();
  r.integer("revision", reply.revision, Need::kRequired, 0, kAnyInteger);
  r.integer("tileVersion", reply.tile_version, Need::kRequired, 0, kAnyInteger);
  readTriple(r, "irradiance", Need::kRequired, -kMost, kMost, reply.irradiance);
  readTriple(r, "error", Need::kRequired, 0.0, kMost, reply.error);
}
void read(Reader& r, CameraReply& reply) { r.optionalInteger("viewer", reply.viewer, 0, kAnyInteger); }
void read(Reader& r, ViewersReply& reply) { r.integer("count", reply.count, Need::kRequired, 0, kAnyInteger); }

}  // namespace

std::string encodeReply(const RequestId& id, const HelloReply& r) {
  return answer(id, json{{"epoch", r.epoch},
                         {"revision", r.revision},
                         {"tileFormat", name(r.tile_format)},
                         {"codec", name(r.codec)},
                         {"creditBytes", r.credit_bytes},
                         {"resumed", r.resumed}});
}

std::string encodeReply(const RequestId& id, const SceneGetReply& r) {
  if (r.gltf.empty()) return answer(id, json{{"revision", r.revision}, {"url", r.url}});
  return answer(id, fmt::format(R"({{"revision":{},"gltf":{}}})", r.revision, r.gltf));
}

std::string encodeReply(const RequestId& id, const SceneLoadReply& r) {
  return answer(id, json{{"revision", r.revision}, {"warnings", r.warnings}});
}

std::string encodeReply(const RequestId& id, const ScenePatchReply& r) {
  return answer(id, json{{"revision", r.revision},
                         {"affected", {{"surfaces", r.affected_surfaces}, {"shots", r.affected_shots}}}});
}

std::string encodeReply(const RequestId& id, const SceneStepReply& r) {
  return answer(id, json{{"revision", r.revision},
                         {"affected", {{"surfaces", r.affected_surfaces}, {"shots", r.affected_shots}}},
                         {"edit", r.edit}});
}

std::string encodeReply(const RequestId& id, const SceneHistoryReply& r) {
  json revisions = json::array();
  for (const auto& past : r.revisions) {
    json entry = {{"revision", past.revision}, {"kind", past.kind}, {"time", past.time_s}, {"summary", past.summary}};
    if (!past.by.empty()) entry["by"] = past.by;
    if (past.edit) entry["edit"] = *past.edit;
    if (past.undone) entry["undone"] = true;
    revisions.push_back(std::move(entry));
  }
  return answer(id, json{{"revision", r.revision},
                         {"undoable", r.undoable},
                         {"redoable", r.redoable},
                         {"revisions", std::move(revisions)}});
}

std::string encodeReply(const RequestId& id, const SolveHistoryReply& r) {
  json samples = json::array();
  for (const auto& sample : r.samples)
    samples.push_back({{"seconds", sample.seconds},
                       {"total", sample.total},
                       {"texels", sample.texels},
                       {"residual", sample.residual},
                       {"sampling", sample.sampling},
                       {"variation", sample.variation}});
  return answer(id, json{{"revision", r.revision}, {"samples", std::move(samples)}});
}

std::string encodeReply(const RequestId& id, const Settings& r) { return answer(id, toJson(r)); }

std::string encodeReply(const RequestId& id, const StateReply& r) { return answer(id, json{{"state", r.state}}); }

std::string encodeReply(const RequestId& id, const StatusReply& r) {
  auto out = toJson(r.progress);
  out["settings"] = toJson(r.settings);
  out["warnings"] = r.warnings;
  out["warningCount"] = r.warning_count;
  out["counters"] = r.counters;
  out["glRenderer"] = r.gl_renderer;
  if (r.reached) out["reached"] = *r.reached;
  return answer(id, out);
}

std::string encodeReply(const RequestId& id, const SubscribeReply& r) {
  json out = {{"minMip", r.min_mip}, {"maxMip", r.max_mip}, {"maxHz", r.max_hz}, {"quantity", name(r.quantity)}};
  if (!r.lightmaps.empty()) out["lightmaps"] = r.lightmaps;
  return answer(id, out);
}

std::string encodeReply(const RequestId& id, const CreditReply& r) {
  return answer(id, json{{"creditBytes", r.credit_bytes}});
}

std::string encodeReply(const RequestId& id, const SnapshotReply& r) {
  json out = {{"url", r.url}};
  if (r.exposure) out["exposure"] = *r.exposure;
  return answer(id, std::move(out));
}

std::string encodeReply(const RequestId& id, const TexelReply& r) {
  return answer(
      id,
      json{
          {"revision", r.revision}, {"tileVersion", r.tile_version}, {"irradiance", r.irradiance}, {"error", r.error}});
}

std::string encodeReply(const RequestId& id, const Planes& r) { return answer(id, toJson(r)); }

std::string encodeReply(const RequestId& id, const ViewersReply& r) { return answer(id, json{{"count", r.count}}); }

std::string encodeReply(const RequestId& id, const CameraReply& r) {
  return answer(id, r.viewer ? json{{"viewer", *r.viewer}} : json::object());
}

template <typename Reply>
Result<Reply> decodeReply(const json& result) {
  Reader reader(&result, "");
  Reply reply;
  if (!reader.failed()) read(reader, reply);
  if (reader.failed()) return fail(ErrorCode::kBadInput, reader.message(), reader.pointer());
  return reply;
}

template Result<HelloReply> decodeReply<HelloReply>(const json&);
template Result<SceneGetReply> decodeReply<SceneGetReply>(const json&);
template Result<SceneLoadReply> decodeReply<SceneLoadReply>(const json&);
template Result<ScenePatchReply> decodeReply<ScenePatchReply>(const json&);
template Result<SceneStepReply> decodeReply<SceneStepReply>(const json&);
template Result<SceneHistoryReply> decodeReply<SceneHistoryReply>(const json&);
template Result<SolveHistoryReply> decodeReply<SolveHistoryReply>(const json&);
template Result<Settings> decodeReply<Settings>(const json&);
template Result<StateReply> decodeReply<StateReply>(const json&);
template Result<StatusReply> decodeReply<StatusReply>(const json&);
template Result<SubscribeReply> decodeReply<SubscribeReply>(const json&);
template Result<CreditReply> decodeReply<CreditReply>(const json&);
template Result<SnapshotReply> decodeReply<SnapshotReply>(const json&);
template Result<TexelReply> decodeReply<TexelReply>(const json&);
template Result<Planes> decodeReply<Planes>(const json&);
template Result<ViewersReply> decodeReply<ViewersReply>(const json&);
template Result<CameraReply> decodeReply<CameraReply>(const json&);

}  // namespace radiosity::protocol
