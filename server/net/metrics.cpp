#include "server/net/metrics.h"

#include <fmt/format.h>
#include <array>
#include <cctype>
#include <iterator>
#include <string_view>

#include "server/net/convert.h"

namespace radiosity::net {
namespace {

class Text {
 public:
  void family(std::string_view name, std::string_view type, std::string_view help) {
    fmt::format_to(std::back_inserter(out_), "# HELP radiosityd_{} {}\n# TYPE radiosityd_{} {}\n", name, help, name,
                   type);
  }
  template <typename T>
  void sample(std::string_view name, T value, std::string_view labels = {}) {
    fmt::format_to(std::back_inserter(out_), "radiosityd_{}{} {}\n", name, labels, value);
  }
  template <typename T>
  void gauge(std::string_view name, std::string_view help, T value) {
    family(name, "gauge", help);
    sample(name, value);
  }
  void counter(std::string_view name, std::string_view help, std::uint64_t value) {
    family(name, "counter", help);
    sample(name, value);
  }
  std::string take() { return std::move(out_); }

 private:
  std::string out_;
};

/// A counter's name as a metric's: "skip.tilesUnchanged" becomes "solver_skip_tiles_unchanged".
std::string metricName(std::string_view key) {
  std::string name = "solver_";
  for (const char c : key) {
    const auto byte = static_cast<unsigned char>(c);
    if (std::isupper(byte) != 0 && name.back() != '_') name += '_';
    name += std::isalnum(byte) != 0 ? static_cast<char>(std::tolower(byte)) : '_';
  }
  return name;
}

void solveMetrics(Text& text, const engine::Status& status) {
  using engine::SolveState;
  text.family("solve_state", "gauge", "1 for the state the solve is in.");
  for (const auto state : {SolveState::kEmpty, SolveState::kLoading, SolveState::kSolving, SolveState::kPaused,
                           SolveState::kConverged, SolveState::kTimeLimit, SolveState::kLimited, SolveState::kFailed})
    text.sample("solve_state", state == status.state ? 1 : 0, fmt::format("{{state=\"{}\"}}", stateName(state)));
  text.gauge("scene_revision", "Revision of the scene.", status.revision);
  text.gauge("tile_version", "Version of the published lightmaps.", status.tile_version);
  text.counter("shots_total", "Shots of this solve.", status.shots);
  text.gauge("solve_seconds", "Solve time, without start-up and loading.", status.seconds);
  text.family("error_ratio", "gauge", "Estimated relative RMS error of irradiance.");
  text.sample("error_ratio", status.error.total, "{part=\"total\"}");
  text.sample("error_ratio", status.error.texels, "{part=\"texels\"}");
  text.sample("error_ratio", status.error.residual, "{part=\"residual\"}");
  text.sample("error_ratio", status.error.sampling, "{part=\"sampling\"}");
  text.sample("error_ratio", status.error.variation, "{part=\"variation\"}");
  text.sample("error_ratio", status.error.discretization, "{part=\"discretization\"}");
  if (status.surface_error) text.sample("error_ratio", status.surface_error->p95, "{part=\"p95\"}");
  text.family("energy_lumens", "gauge", "Where the light went.");
  text.sample("energy_lumens", status.energy.emitted, "{part=\"emitted\"}");
  text.sample("energy_lumens", status.energy.absorbed, "{part=\"absorbed\"}");
  text.sample("energy_lumens", status.energy.specular, "{part=\"specular\"}");
  text.sample("energy_lumens", status.energy.escaped, "{part=\"escaped\"}");
  text.sample("energy_lumens", status.energy.backface, "{part=\"backface\"}");
  text.sample("energy_lumens", status.energy.unshot, "{part=\"unshot\"}");
  text.sample("energy_lumens", status.energy.imbalance, "{part=\"imbalance\"}");
  text.counter("renderers_replaced_total", "Renderer processes that died or hung and were replaced.",
               status.renderers_replaced);
  text.counter("solve_restarts_total", "Solves that started over since no renderer was left.", status.solve_restarts);
  const bool none_left = status.renderers_missing > 0 && status.renderers_missing == status.renderers;
  text.gauge("renderer_lost", "1 while nothing can be drawn.", status.renderer_lost || none_left ? 1 : 0);
  text.gauge("renderers_missing", "Idle renderer processes that died and are being replaced.",
             status.renderers_missing);
  text.gauge("state_lost", "1 while edits are refused since the state's folder is not where it was opened.",
             status.state_trouble.empty() ? 0 : 1);
  text.gauge("patches", "Leaf patches with area.", status.patches);
  text.gauge("surfaces", "Charts.", status.surfaces);
  text.gauge("polygons", "Coplanar facets.", status.polygons);
  for (const auto& [key, value] : status.counters) text.gauge(metricName(key), "Counted by the solver.", value);
}

void networkMetrics(Text& text, Hub& hub) {
  auto& c = hub.counters();
  text.gauge("connections", "Open TCP connections.", c.connections.load());
  text.gauge("viewers", "WebSocket sessions that said hello.", hub.viewerCount());
  text.gauge("draining", "1 while shutting down.", hub.draining() ? 1 : 0);
  text.counter("connections_refused_total", "Connections over a limit.", c.connections_refused.load());
  if (const auto end = c.certificate_expires_at_s.load(); end != 0) {
    text.gauge("tls_certificate_expiry_timestamp_seconds", "When the certificate expires, Unix time.", end);
    text.gauge("tls_handshakes", "TLS handshakes under way.", c.tls_handshakes.load());
    text.counter("tls_handshakes_failed_total", "TLS handshakes that failed, were cut off, or were plain HTTP.",
                 c.tls_handshakes_failed.load());
  }
  text.family("http_responses_total", "counter", "HTTP responses by class of status.");
  for (std::size_t i = 1; i < c.http_responses.size(); ++i)
    text.sample("http_responses_total", c.http_responses[i].load(), fmt::format("{{code=\"{}xx\"}}", i));
  text.gauge("uploads_held_bytes", "Bodies that are coming or being worked on.", c.uploads_held_bytes.load());
  text.gauge("downloads_held_bytes", "Large bodies that wait for their peers to take them, each counted once.",
             hub.sendRoom().heldBytes());
  text.counter("upload_bytes_total", "Bytes of uploaded bodies.", c.upload_bytes.load());
  text.counter("calls_total", "JSON-RPC calls.", c.calls.load());
  text.counter("calls_failed_total", "JSON-RPC calls answered with an error.", c.calls_failed.load());
  text.counter("text_messages_sent_total", "WebSocket text messages.", c.text_messages_sent.load());
  text.counter("text_sent_bytes_total", "Bytes of WebSocket text messages.", c.text_bytes_sent.load());
  text.counter("tiles_encoded_total", "Tiles encoded; a tile is encoded once for all sessions.", hub.tiles().encoded());
  text.gauge("tile_cache_bytes", "Encoded tiles kept for whoever wants the same.", hub.tiles().bytes());
  text.counter("tiles_sent_total", "Tiles sent.", c.tiles_sent.load());
  text.counter("tiles_sent_bytes_total", "Bytes of tile frames.", c.tile_bytes_sent.load());
  text.family("sessions_closed_total", "counter", "WebSocket sessions closed by the server.");
  text.sample("sessions_closed_total", c.closed_too_slow.load(), "{reason=\"too_slow\"}");
  text.sample("sessions_closed_total", c.closed_overload.load(), "{reason=\"overload\"}");
  text.sample("sessions_closed_total", c.closed_policy.load(), "{reason=\"policy\"}");
}

}  // namespace

std::string metricsText(Hub& hub) {
  Text text;
  text.family("build_info", "gauge", "Always 1.");
  text.sample("build_info", 1, fmt::format("{{version=\"{}\"}}", hub.options().version));
  solveMetrics(text, hub.engine().status());
  text.gauge("solve_thread_busy_seconds", "How long the solve thread has been at its present slice or command.",
             hub.engine().busySeconds());
  networkMetrics(text, hub);
  return text.take();
}

}  // namespace radiosity::net
