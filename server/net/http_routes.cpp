#include "server/net/http_routes.h"

#include <fmt/format.h>
#include <algorithm>
#include <array>
#include <charconv>
#include <new>
#include <utility>

#include "common/log.h"
#include "common/printable.h"
#include "protocol/http_bodies.h"
#include "protocol/light_web.h"
#include "protocol/messages.h"
#include "server/net/convert.h"
#include "server/net/metrics.h"
#include "server/net/status_page.h"
#include "server/net/viewer_files.h"

namespace radiosity::net {
namespace {

using Handler = void (*)(const std::shared_ptr<Hub>&, HttpRequest&, const Respond&);

HttpResponse file(SharedBytes bytes, std::string_view type) {
  HttpResponse response;
  response.content_type = type;
  response.bytes = std::move(bytes);
  return response;
}

HttpResponse plain(int status, std::string text) {
  HttpResponse response;
  response.status = status;
  response.text = std::move(text);
  return response;
}

engine::Client clientOf(const HttpRequest& request) { return {request.client, request.session, request.gone}; }

engine::Engine::Callback<SharedBytes> fileAnswer(Hub& hub, const Respond& done, std::string_view type) {
  return hub.fromEngine<SharedBytes>([done, type](Result<SharedBytes> bytes) {
    done(bytes ? file(std::move(*bytes), type) : errorResponse(bytes.error()));
  });
}

/// An integer member of the query in [low, high]; `otherwise` where it is absent.
Result<int> queryInt(const HttpRequest& request, const char* key, int otherwise, int low, int high) {
  const auto found = request.query.find(key);
  if (found == request.query.end()) return otherwise;
  int value = 0;
  const auto& text = found->second;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || value < low || value > high)
    return fail(ErrorCode::kBadInput, fmt::format("must be an integer in [{}, {}]", low, high),
                fmt::format("?{}=", key));
  return value;
}

Result<std::optional<double>> queryExposure(const HttpRequest& request) {
  const auto found = request.query.find("exposure");
  if (found == request.query.end()) return std::nullopt;
  double value = 0.0;
  const auto& text = found->second;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !(value > 0.0 && value <= protocol::kMaxExposure))
    return fail(ErrorCode::kBadInput, fmt::format("must be a number in (0, {}]", protocol::kMaxExposure), "?exposure=");
  return value;
}

Result<std::optional<std::uint64_t>> queryLayout(const HttpRequest& request) {
  const auto found = request.query.find("layout");
  if (found == request.query.end()) return std::nullopt;
  std::uint64_t value = 0;
  const auto& text = found->second;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size())
    return fail(ErrorCode::kBadInput, "must be the number of a layout", "?layout=");
  return value;
}

std::string queryText(const HttpRequest& request, const char* key, std::string otherwise) {
  const auto found = request.query.find(key);
  return found == request.query.end() ? std::move(otherwise) : found->second.substr(0, protocol::kMaxTextBytes);
}

// ---- handlers ----

void getViewer(const std::shared_ptr<Hub>& /*hub*/, HttpRequest& request, const Respond& done) {
  done(viewerResponse(request));
}

void getStatus(const std::shared_ptr<Hub>& hub, HttpRequest& /*request*/, const Respond& done) {
  HttpResponse response;
  response.content_type = "text/html; charset=utf-8";
  response.text = statusPage(hub->engine().status(), hub->viewerCount(), hub->options().version);
  response.headers.emplace_back("Content-Security-Policy", "default-src 'self'; style-src 'unsafe-inline'");
  done(std::move(response));
}

void putScene(const std::shared_ptr<Hub>& hub, HttpRequest& request, const Respond& done) {
  if (hub->draining()) return done(errorResponse({ErrorCode::kBusy, "the server is shutting down", {}}));
  auto bytes = std::make_shared<const Bytes>(std::move(request.body));
  auto answer = [hub = hub.get(), name = request.name, by = request.client,
                 done](const Result<engine::LoadOutcome>& outcome) {
    if (!outcome) return done(errorResponse(outcome.error()));
    hub->sawRevision(outcome->revision);
    const LogScope about({.revision = outcome->revision});
    log::info("scene {} loaded by {}", name, by);
    auto response = plain(200, protocol::encodeHttpLoad({outcome->revision, outcome->warnings}));
    response.content_type = "application/json";
    done(std::move(response));
  };
  hub->engine().loadBytes(request.name, std::move(bytes), clientOf(request),
                          hub->fromEngine<engine::LoadOutcome>(std::move(answer)));
}

void putUpload(const std::shared_ptr<Hub>& hub, HttpRequest& request, const Respond& done) {
  hub->keepUpload(request.body_sha256, request.name, std::make_shared<const Bytes>(std::move(request.body)),
                  [done](const Result<std::string>& id) {
                    if (!id) return done(errorResponse(id.error()));
                    auto response = plain(201, protocol::encodeHttpUrl("/uploads/" + *id));
                    response.content_type = "application/json";
                    response.headers.emplace_back("Location", "/uploads/" + *id);
                    done(std::move(response));
                  });
}

void getSceneGltf(const std::shared_ptr<Hub>& hub, HttpRequest& /*request*/, const Respond& done) {
  hub->engine().sceneText(hub->fromEngine<engine::Engine::SceneText>([done](Result<engine::Engine::SceneText> text) {
    if (!text) return done(errorResponse(text.error()));
    auto response = file(std::make_shared<const Bytes>(text->gltf.begin(), text->gltf.end()), "model/gltf+json");
    response.headers.emplace_back("X-Revision", std::to_string(text->revision));
    done(std::move(response));
  }));
}

void getSceneGlb(const std::shared_ptr<Hub>& hub, HttpRequest& request, const Respond& done) {
  const auto layout = queryLayout(request);
  if (!layout) return done(errorResponse(layout.error()));
  // Nobody's fault: the layout changed while the request was on its way.
  hub->engine().sceneGlb(*layout, clientOf(request), hub->fromEngine<SharedBytes>([done](Result<SharedBytes> glb) {
    const bool overtaken = !glb && glb.error().code == ErrorCode::kStaleRevision;
    done(glb ? file(std::move(*glb), "model/gltf-binary") : overtaken ? plain(204, "") : errorResponse(glb.error()));
  }));
}

void getUnlitGlb(const std::shared_ptr<Hub>& hub, HttpRequest& request, const Respond& done) {
  hub->engine().unlitGlb(clientOf(request), fileAnswer(*hub, done, "model/gltf-binary"));
}

void getSky(const std::shared_ptr<Hub>& hub, HttpRequest& request, const Respond& done) {
  hub->engine().skyPicture(clientOf(request), fileAnswer(*hub, done, "image/vnd.radiance"));
}

void getWeb(const std::shared_ptr<Hub>& hub, HttpRequest& request, const Respond& done) {
  std::uint32_t light = 0;
  const auto text = std::string_view(request.path).substr(std::string_view("/webs/").size());
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), light);
  if (error != std::errc() || std::string_view(end, text.data() + text.size()) != ".json")
    return done(errorResponse(
        {ErrorCode::kNotFound, "webs are /webs/<index in EXT_lights_ies>.json, counted from 0", request.path}));
  const auto encode = [](const Result<engine::ShownWeb>& web) -> Result<std::string> {
    if (!web) return tl::unexpected(web.error());
    return protocol::encodeHttpWeb(toWeb(*web));
  };
  hub->engine().lightWeb(light, clientOf(request),
                         hub->fromEngineMade<engine::ShownWeb>(encode, [done](Result<std::string> body) {
                           if (!body) return done(errorResponse(body.error()));
                           auto response = plain(200, std::move(*body));
                           response.content_type = "application/json";
                           done(std::move(response));
                         }));
}

void getLightmap(const std::shared_ptr<Hub>& hub, HttpRequest& request, const Respond& done) {
  std::uint32_t page = 0;
  const auto text = std::string_view(request.path).substr(std::string_view("/lightmaps/").size());
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), page);
  if (error != std::errc() || std::string_view(end, text.data() + text.size()) != ".exr")
    return done(
        errorResponse({ErrorCode::kNotFound, "lightmaps are /lightmaps/<page>.exr, counted from 0", request.path}));
  const auto quantity = protocol::quantityFrom(queryText(request, "quantity", "irradiance"));
  if (!quantity)
    return done(
        errorResponse({ErrorCode::kBadInput,
                       "must be irradiance, radiosity, error, patchId, mipLevel, unshot or normal", "?quantity="}));
  hub->engine().lightmapExr(page, toQuantity(*quantity), clientOf(request), fileAnswer(*hub, done, "image/x-exr"));
}

void getSnapshot(const std::shared_ptr<Hub>& hub, HttpRequest& request, const Respond& done) {
  const auto width = queryInt(request, "width", 960, 1, protocol::kMaxSnapshotSide);
  const auto height = queryInt(request, "height", 720, 1, protocol::kMaxSnapshotSide);
  if (!width || !height) return done(errorResponse(width ? height.error() : width.error()));
  const auto exposure = queryExposure(request);
  if (!exposure) return done(errorResponse(exposure.error()));
  hub->engine().snapshot(
      {queryText(request, "camera", ""), *width, *height, queryText(request, "quantity", "lit"), *exposure},
      clientOf(request), hub->fromEngine<engine::Snapshot>([done](Result<engine::Snapshot> made) {
        if (made) return done(file(std::move(made->png), "image/png"));
        auto error = made.error();
        if (error.code == ErrorCode::kBadUsage) error.where = fmt::format("?{}=", error.where);
        done(errorResponse(error));
      }));
}

void getStoredSnapshot(const std::shared_ptr<Hub>& hub, HttpRequest& request, const Respond& done) {
  auto id = std::string_view(request.path).substr(std::string_view("/snapshots/").size());
  if (id.ends_with(".png")) id.remove_suffix(4);
  const auto blob = hub->snapshots().find(id);
  if (!blob) return done(errorResponse({ErrorCode::kNotFound, "there is no such snapshot (any more)", request.path}));
  done(file(blob->bytes, "image/png"));
}

Result<engine::MeasureRequest> queryMeasure(const HttpRequest& request) {
  const auto daylight = queryText(request, "daylightFactor", "false");
  if (daylight != "true" && daylight != "false")
    return fail(ErrorCode::kBadInput, "must be true or false", "?daylightFactor=");
  return engine::MeasureRequest{queryText(request, "plane", ""), daylight == "true"};
}

/// `write` makes the body of what was measured.
void measure(const std::shared_ptr<Hub>& hub, HttpRequest& request, const Respond& done, std::string_view type,
             std::string (*write)(const protocol::Planes&)) {
  auto wanted = queryMeasure(request);
  if (!wanted) return done(errorResponse(wanted.error()));
  const auto encode = [write](Result<engine::MeasureReport> report) -> Result<SharedBytes> {
    if (report) {
      const auto text = write(toPlanes(*report));
      return std::make_shared<const Bytes>(text.begin(), text.end());
    }
    auto error = report.error();
    if (error.where == "plane") error.where = "?plane=";
    return tl::unexpected<Error>(std::move(error));
  };
  hub->engine().measure(
      std::move(*wanted), clientOf(request),
      hub->fromEngineMade<engine::MeasureReport>(encode, [done, type](const Result<SharedBytes>& bytes) {
        done(bytes ? file(*bytes, type) : errorResponse(bytes.error()));
      }));
}

void getPlanesJson(const std::shared_ptr<Hub>& hub, HttpRequest& request, const Respond& done) {
  measure(hub, request, done, "application/json", &protocol::encodeHttpPlanes);
}

void getPlanesCsv(const std::shared_ptr<Hub>& hub, HttpRequest& request, const Respond& done) {
  measure(hub, request, done, "text/csv; charset=utf-8", &protocol::planesCsv);
}

Result<engine::ProbeRequest> queryProbes(const HttpRequest& request) {
  engine::ProbeRequest wanted;
  const auto light = queryText(request, "light", "true");
  if (light != "true" && light != "false") return fail(ErrorCode::kBadInput, "must be true or false", "?light=");
  wanted.light = light == "true";
  const auto found = request.query.find("spacing");
  if (found == request.query.end()) return wanted;
  double value = 0.0;
  const auto& text = found->second;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size() || !(value > 0.0 && value <= protocol::kMaxProbeSpacing))
    return fail(ErrorCode::kBadInput, "must be a number of metres above 0, at most 1e6", "?spacing=");
  wanted.spacing = value;
  return wanted;
}

using WriteProbes = Bytes (*)(const protocol::Probes&);

Result<SharedBytes> probesBody(Result<engine::ProbeReport> report, WriteProbes write) {
  if (!report) {
    auto error = report.error();
    if (error.where == "spacing") error.where = "?spacing=";
    return tl::unexpected<Error>(std::move(error));
  }
  try {
    return std::make_shared<const Bytes>(write(toProbes(std::move(*report))));
  } catch (const std::bad_alloc&) {
    return fail(ErrorCode::kTooLarge, "the server's memory does not hold the file of these probes", "?spacing=");
  }
}

/// `write` makes the body.
void tellProbes(const std::shared_ptr<Hub>& hub, HttpRequest& request, const Respond& done, std::string_view type,
                WriteProbes write) {
  const auto wanted = queryProbes(request);
  if (!wanted) return done(errorResponse(wanted.error()));
  const auto encode = [write](Result<engine::ProbeReport> report) { return probesBody(std::move(report), write); };
  hub->engine().probes(*wanted, clientOf(request),
                       hub->fromEngineMade<engine::ProbeReport>(encode, [done, type](const Result<SharedBytes>& bytes) {
                         done(bytes ? file(*bytes, type) : errorResponse(bytes.error()));
                       }));
}

void getProbesJson(const std::shared_ptr<Hub>& hub, HttpRequest& request, const Respond& done) {
  tellProbes(hub, request, done, "application/json", &protocol::encodeHttpProbes);
}

void getProbesBinary(const std::shared_ptr<Hub>& hub, HttpRequest& request, const Respond& done) {
  if (queryText(request, "light", "true") == "false")
    return done(errorResponse({ErrorCode::kBadInput, "places alone are told by /probes.json", "?light="}));
  tellProbes(hub, request, done, "application/octet-stream", &protocol::probesBinary);
}

void getHealth(const std::shared_ptr<Hub>& /*hub*/, HttpRequest& /*request*/, const Respond& done) {
  done(plain(200, "ok\n"));
}

void getReady(const std::shared_ptr<Hub>& hub, HttpRequest& /*request*/, const Respond& done) {
  const auto status = hub->engine().status();
  if (hub->draining()) return done(plain(503, "draining\n"));
  if (status.state == engine::SolveState::kLoading) return done(plain(503, "loading\n"));
  const auto unready = [&](std::string_view what, std::string_view why) {
    done(plain(503, fmt::format("{}: {}\n", what, printable(why))));
  };
  if (!status.state_trouble.empty()) return unready("edits are refused", status.state_trouble);
  if (status.renderer_lost) return unready("no renderer", status.failure);
  if (status.renderers_missing > 0 && status.renderers_missing == status.renderers)
    return unready("no renderer", status.renderer_trouble);
  if (status.state == engine::SolveState::kFailed) return unready("failed", status.failure);
  if (status.renderers_missing == 0) return done(plain(200, "ready\n"));
  done(plain(200, fmt::format("ready; {} of {} renderers are being replaced: {}\n", status.renderers_missing,
                              status.renderers, printable(status.renderer_trouble))));
}

void getMetrics(const std::shared_ptr<Hub>& hub, HttpRequest& /*request*/, const Respond& done) {
  auto response = plain(200, metricsText(*hub));
  response.content_type = "text/plain; version=0.0.4; charset=utf-8";
  done(std::move(response));
}

// ---- the table ----

struct Route {
  std::string_view path;  ///< ending in '/': everything below
  std::string_view method;
  Handler handle;
  bool open = false;  ///< without a token
};

constexpr std::array kRoutes = {
    Route{"/", "GET", getViewer, true},  // the viewer holds no secrets, and asks for the token itself
    Route{"/assets/", "GET", getViewer, true},
    Route{"/favicon.svg", "GET", getViewer, true},
    Route{"/status", "GET", getStatus},
    Route{"/scene", "PUT", putScene},
    Route{"/uploads", "PUT", putUpload},
    Route{"/scene.gltf", "GET", getSceneGltf},
    Route{"/scene.glb", "GET", getSceneGlb},
    Route{"/scene-unlit.glb", "GET", getUnlitGlb},
    Route{"/sky.hdr", "GET", getSky},
    Route{"/webs/", "GET", getWeb},
    Route{"/lightmaps/", "GET", getLightmap},
    Route{"/snapshot.png", "GET", getSnapshot},
    Route{"/snapshots/", "GET", getStoredSnapshot},
    Route{"/planes.json", "GET", getPlanesJson},
    Route{"/planes.csv", "GET", getPlanesCsv},
    Route{"/probes.json", "GET", getProbesJson},
    Route{"/probes.bin", "GET", getProbesBinary},
    Route{"/healthz", "GET", getHealth, true},
    Route{"/readyz", "GET", getReady, true},
    Route{"/metrics", "GET", getMetrics},
    Route{protocol::kWebSocketPath, "GET", nullptr},
};

const Route* routeOf(const HttpRequest& request) {
  for (const auto& route : kRoutes) {
    const bool folder = route.path.size() > 1 && route.path.ends_with('/');
    if (folder ? request.path.starts_with(route.path) && request.path.size() > route.path.size()
               : request.path == route.path)
      return &route;
  }
  return nullptr;
}

bool sceneType(std::string_view type) {
  constexpr std::array kTypes = {"", "model/gltf-binary", "model/gltf+json", "application/json",
                                 "application/octet-stream"};
  type = type.substr(0, type.find(';'));
  while (type.ends_with(' ')) type.remove_suffix(1);
  return std::find(kTypes.begin(), kTypes.end(), type) != kTypes.end();
}

}  // namespace

bool needsToken(const HttpRequest& request) {
  const auto* route = routeOf(request);
  return route == nullptr || !route->open;
}

bool namedByContent(const HttpRequest& request) {
  const auto* route = routeOf(request);
  return route != nullptr && route->handle == putUpload && request.method == route->method;
}

std::optional<HttpResponse> refusal(const HttpRequest& request) {
  if (request.path == "*") {  // with OPTIONS: of the whole server
    auto response = plain(204, "");
    response.headers.emplace_back("Allow", "GET, HEAD, PUT, OPTIONS");
    return response;
  }
  const auto* route = routeOf(request);
  if (route == nullptr) return errorResponse({ErrorCode::kNotFound, "there is nothing at this path", request.path});
  const auto allow = route->method == "GET" ? "GET, HEAD, OPTIONS" : fmt::format("{}, OPTIONS", route->method);
  if (request.method == "OPTIONS") {
    auto response = plain(204, "");
    response.headers.emplace_back("Allow", allow);
    return response;
  }
  if (request.method != route->method) {
    auto response = errorResponse(405, "methodNotAllowed", fmt::format("{} allows {}", request.path, allow));
    response.headers.emplace_back("Allow", allow);
    return response;
  }
  if (route->handle == nullptr) {
    auto response = errorResponse(426, "upgradeRequired", "this path speaks WebSocket, subprotocol radiosity.v1");
    response.headers.emplace_back("Upgrade", "websocket");
    return response;
  }
  if (request.method == "PUT" && !sceneType(request.content_type))
    return errorResponse(415, "unsupportedMediaType",
                         fmt::format("Content-Type {}; send model/gltf-binary, model/gltf+json or "
                                     "application/octet-stream (curl -T FILE does)",
                                     request.content_type));
  return std::nullopt;
}

void respond(const std::shared_ptr<Hub>& hub, HttpRequest request, const Respond& done) {
  routeOf(request)->handle(hub, request, done);
}

}  // namespace radiosity::net
