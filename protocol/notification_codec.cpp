// Notifications: the server encodes them, a client decodes them.
#include <fmt/format.h>
#include <array>
#include <utility>

#include "protocol/codec.h"
#include "protocol/json_text.h"
#include "protocol/message_parts.h"

namespace radiosity::protocol {
namespace {

using nlohmann::json;

std::string params(const ServerInfo& n) {
  return dumpJson({{"server", n.server},
                   {"epoch", n.epoch},
                   {"revision", n.revision},
                   {"capabilities", n.capabilities},
                   {"limits", n.limits},
                   {"lightmaps", n.lightmaps},
                   {"glRenderer", n.gl_renderer},
                   {"authRequired", n.auth_required}});
}
std::string params(const ProgressNote& n) { return dumpJson(toJson(n.progress)); }
std::string params(const ScenePatched& n) {  // the patch is JSON text already, and may be long
  return fmt::format(R"({{"revision":{},"patch":{},"by":{}}})", n.revision, n.patch, dumpJson(n.by));
}
std::string params(const SceneLoaded& n) { return dumpJson({{"revision", n.revision}}); }
std::string params(const LightmapsNote& n) {
  json pages = json::array();
  for (const auto& page : n.pages)
    pages.push_back({{"width", page.width}, {"height", page.height}, {"mips", page.mips}});
  return dumpJson({{"layout", n.layout},
                   {"revision", n.revision},
                   {"quantity", name(n.quantity)},
                   {"pages", std::move(pages)},
                   {"uvs", n.uvs}});
}
std::string params(const Bookmark& n) {
  return dumpJson({{"revision", n.revision}, {"tileVersion", n.tile_version}, {"quantity", name(n.quantity)}});
}
std::string params(const ViewersNote& n) { return dumpJson({{"count", n.count}}); }
std::string params(const CamerasNote& n) {
  json cameras = json::array();
  for (const auto& camera : n.cameras) {
    cameras.push_back(toJson(camera.pose));
    cameras.back()["viewer"] = camera.viewer;
    cameras.back()["name"] = camera.name;
  }
  return dumpJson({{"cameras", std::move(cameras)}});
}
std::string params(const Draining& n) { return dumpJson({{"graceMs", n.grace_ms}}); }
std::string params(const ServerNote& n) { return dumpJson({{"kind", n.kind}, {"text", n.text}}); }
std::string params(const SolveConfigured& n) { return dumpJson(toJson(n.settings)); }

void read(Reader& r, ServerInfo& n) {
  r.text("server", n.server, Need::kRequired, kAnyText);
  r.text("epoch", n.epoch, Need::kRequired, kMaxTextBytes);
  r.integer("revision", n.revision, Need::kRequired, 0, kAnyInteger);
  readStrings(r, "capabilities", Need::kOptional, kMaxListEntries, n.capabilities);
  if (const auto* limits = r.find("limits"); limits != nullptr && limits->is_object())
    for (const auto& [key, value] : limits->items())
      if (value.is_number_unsigned()) n.limits[key] = value.get<std::uint64_t>();
  r.integer("lightmaps", n.lightmaps, Need::kOptional, 0, kAnyInteger);
  r.text("glRenderer", n.gl_renderer, Need::kOptional, kAnyText);
  r.boolean("authRequired", n.auth_required, Need::kOptional);
}
void read(Reader& r, ProgressNote& n) { read(r, n.progress); }
void read(Reader& r, ScenePatched& n) {
  r.integer("revision", n.revision, Need::kRequired, 0, kAnyInteger);
  if (const auto* patch = r.find("patch"); patch != nullptr && patch->is_array())
    n.patch = dumpJson(*patch);
  else
    r.refuse(r.pointerOf("patch"), "must be an array");
  r.text("by", n.by, Need::kOptional, kAnyText);
}
void read(Reader& r, SceneLoaded& n) { r.integer("revision", n.revision, Need::kRequired, 0, kAnyInteger); }
void read(Reader& r, LightmapsNote& n) {
  r.integer("layout", n.layout, Need::kRequired, 0, kAnyInteger);
  r.integer("revision", n.revision, Need::kRequired, 0, kAnyInteger);
  r.choice("quantity", n.quantity, Need::kOptional, quantityFrom, kQuantityNames);
  r.text("uvs", n.uvs, Need::kOptional, kAnyText);
  r.array("pages", Need::kRequired, kMaxListEntries, [&](const json& element, const std::string& pointer) {
    Reader inner(&element, pointer);
    PageInfo page;
    inner.narrow("width", page.width, Need::kRequired, 1, 1U << 20U);
    inner.narrow("height", page.height, Need::kRequired, 1, 1U << 20U);
    inner.narrow("mips", page.mips, Need::kRequired, 1, kMaxMip + 1);
    if (inner.failed()) r.refuse(inner.pointer(), inner.message().substr(inner.pointer().size() + 1));
    n.pages.push_back(page);
  });
}
void read(Reader& r, Bookmark& n) {
  r.integer("revision", n.revision, Need::kRequired, 0, kAnyInteger);
  r.integer("tileVersion", n.tile_version, Need::kRequired, 0, kAnyInteger);
  r.choice("quantity", n.quantity, Need::kOptional, quantityFrom, kQuantityNames);
}
void read(Reader& r, ViewersNote& n) { r.integer("count", n.count, Need::kRequired, 0, kAnyInteger); }
void read(Reader& r, CamerasNote& n) {
  r.array("cameras", Need::kRequired, kMaxListEntries, [&](const json& element, const std::string& pointer) {
    Reader inner(&element, pointer);
    SharedCamera camera;
    inner.integer("viewer", camera.viewer, Need::kRequired, 0, kAnyInteger);
    inner.text("name", camera.name, Need::kRequired, kMaxTextBytes);
    read(inner, camera.pose);
    if (inner.failed()) r.refuse(inner.pointer(), inner.message().substr(inner.pointer().size() + 1));
    n.cameras.push_back(std::move(camera));
  });
}
void read(Reader& r, Draining& n) { r.integer("graceMs", n.grace_ms, Need::kRequired, 0, kAnyInteger); }
void read(Reader& r, ServerNote& n) {
  r.text("kind", n.kind, Need::kRequired, kMaxTextBytes);
  r.text("text", n.text, Need::kOptional, kAnyText);
}
void read(Reader& r, SolveConfigured& n) { read(r, n.settings); }

using DecodedNotification = tl::expected<Notification, RpcError>;

template <typename N>
DecodedNotification decodeNotificationAs(const json* object) {
  Reader reader(object, "/params");
  N note;
  read(reader, note);
  if (reader.failed()) return tl::unexpected(RpcError{RpcCode::kInvalidParams, reader.message(), reader.pointer()});
  return Notification(std::move(note));
}

struct Kind {
  std::string_view name;
  DecodedNotification (*decode)(const json*);
};

template <typename... N>
constexpr auto kindsOf(std::variant<N...>* /*only its type counts*/) {
  return std::array{Kind{N::kMethod, &decodeNotificationAs<N>}...};
}

constexpr auto kKinds = kindsOf(static_cast<Notification*>(nullptr));

}  // namespace

std::string encodeNotification(const Notification& notification) {
  return std::visit(
      [](const auto& n) {
        return fmt::format(R"({{"jsonrpc":"2.0","method":"{}","params":{}}})", std::decay_t<decltype(n)>::kMethod,
                           params(n));
      },
      notification);
}

tl::expected<Notification, RpcError> decodeNotification(const RpcRequest& request) {
  for (const auto& kind : kKinds)
    if (kind.name == request.method) return kind.decode(request.params.get());
  return tl::unexpected(RpcError{RpcCode::kMethodNotFound, "unknown notification " + request.method, "/method"});
}

}  // namespace radiosity::protocol
