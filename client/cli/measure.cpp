#include "client/cli/measure.h"

#include <fmt/format.h>

#include "client/cli/editor.h"
#include "client/lib/atomic_file.h"
#include "client/lib/http.h"
#include "common/one_line.h"
#include "protocol/http_bodies.h"

namespace radiosity::cli {
namespace {

Result<void> writeFile(const std::string& path, const std::string& text) {
  if (path.empty()) return {};
  auto file = client::AtomicFile::create(path);
  if (!file) return tl::unexpected(file.error());
  if (auto done = file->write(text); !done) return done;
  return file->commit();
}

std::string figuresText(const protocol::PlaneFigures& f, const char* unit) {
  const double off = f.solve_error;
  return fmt::format(
      "mean {:.4g} +- {:.2g}{} {}, minimum {:.4g} +- {:.2g}, maximum {:.4g}, median {:.4g}, U0 {:.3f} +- "
      "{:.2g}",
      f.mean, f.mean_error, off > 0.0 ? fmt::format(" (+- {:.2g} by the solve)", off) : "", unit, f.minimum,
      f.minimum_error, f.maximum, f.median, f.uniformity, f.uniformity_error);
}

std::string verdictText(const protocol::Plane& plane) {
  std::string text;
  if (plane.wanted_lux) text += fmt::format("{:.6g} lux: {}; ", *plane.wanted_lux, plane.verdict.lux);
  if (plane.wanted_uniformity)
    text += fmt::format("U0 {:.6g}: {}; ", *plane.wanted_uniformity, plane.verdict.uniformity);
  return text + plane.verdict.all + " at 95 %";
}

Error noPlane() {
  return {ErrorCode::kBadInput,
          "the scene has no measuring plane: a node with extras.radiosityPlane, such as {\"width\": 2, \"depth\": 3}",
          {}};
}

bool isPlane(const Json& node) {
  return node.is_object() && node.contains("extras") && node["extras"].is_object() &&
         node["extras"].contains("radiosityPlane");
}

bool isCalled(const Json& node, std::size_t index, const std::string& plane) {
  const auto name = node.find("name");
  return std::to_string(index) == plane || (name != node.end() && name->is_string() && *name == plane);
}

}  // namespace

void addMeasureOptions(CLI::App& command, MeasureOptions& options) {
  command.add_option("--csv", options.csv, "the points as a table: lux and standard errors")->type_name("FILE");
  command.add_option("--json", options.json, "the same as JSON")->type_name("FILE");
  command.add_option("--plane", options.plane, "this plane alone: name or index of its node (default: all)")
      ->type_name("NAME");
  command.add_flag("--daylight-factor", options.daylight_factor,
                   "also daylight factors, in percent: under a CIE overcast sky, all lamps off");
}

client::CallResult<void> requirePlanes(const Remote& remote, const MeasureOptions& options) {
  const auto scene = fetchScene(remote);
  if (!scene) return tl::unexpected(scene.error());
  bool has_some = false;
  const auto nodes = scene->gltf.value("nodes", Json::array());
  for (std::size_t i = 0; i < nodes.size(); ++i) {
    if (!isPlane(nodes[i])) continue;
    has_some = true;
    if (options.plane.empty() || isCalled(nodes[i], i, options.plane)) return {};
  }
  if (!has_some) return tl::unexpected(client::CallFailure{noPlane()});
  return tl::unexpected(client::CallFailure{
      {ErrorCode::kBadInput, "there is no measuring plane of this name, or on the node of this number", "--plane"}});
}

Result<std::string> measurePlanes(const Remote& remote, const MeasureOptions& options, ProgressDisplay& display) {
  display.showText("measuring planes");
  std::string target =
      options.daylight_factor ? "/planes.json?daylightFactor=true" : "/planes.json?daylightFactor=false";
  if (!options.plane.empty()) target += "&plane=" + client::percentEncode(options.plane);
  const auto reply = client::httpGet(remote.http(), target);
  display.clear();
  if (!reply) return tl::unexpected(reply.error());
  if (!reply->ok()) return tl::unexpected(httpError(*reply, remote.url.text()));
  const auto planes = protocol::decodeHttpPlanes(reply->body);
  if (!planes)
    return fail(ErrorCode::kUnavailable, "the answer to /planes.json: " + planes.error().text(), remote.url.text());
  if (planes->planes.empty()) return tl::unexpected(noPlane());
  if (auto done = writeFile(options.csv, protocol::planesCsv(*planes)); !done) return tl::unexpected(done.error());
  if (auto done = writeFile(options.json, reply->body + "\n"); !done) return tl::unexpected(done.error());
  return planesText(*planes);
}

std::string planesText(const protocol::Planes& planes) {
  std::string text;
  for (const auto& plane : planes.planes) {
    const auto name = plane.name.empty() ? fmt::format("node {}", plane.node) : oneLine(plane.name);
    text +=
        fmt::format("{}, {} x {} points: {}\n", name, plane.columns, plane.rows, figuresText(plane.illuminance, "lux"));
    if (!plane.verdict.all.empty()) text += "  " + verdictText(plane) + "\n";
    if (plane.daylight_factor) text += "  daylight factor: " + figuresText(*plane.daylight_factor, "%") + "\n";
  }
  return text;
}

}  // namespace radiosity::cli
