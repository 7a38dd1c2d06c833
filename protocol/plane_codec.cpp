// Measuring planes to JSON and back.
#include <algorithm>
#include <cmath>
#include <utility>

#include "protocol/http_bodies.h"
#include "protocol/json_rpc.h"
#include "protocol/json_text.h"
#include "protocol/message_parts.h"

namespace radiosity::protocol {
namespace {

using nlohmann::json;

constexpr double kMost = std::numeric_limits<double>::max();
constexpr const char* kVerdicts = "passes, fails, undecided";

json listOf(const std::vector<double>& values) {
  json list = json::array();
  for (const double value : values) list.push_back(sixDigits(value));
  return list;
}

void addFigures(json& to, const PlaneFigures& f, const char* light) {
  to["mean"] = sixDigits(f.mean);
  to["meanError"] = sixDigits(f.mean_error);
  to["minimum"] = sixDigits(f.minimum);
  to["minimumError"] = sixDigits(f.minimum_error);
  to["maximum"] = sixDigits(f.maximum);
  to["maximumError"] = sixDigits(f.maximum_error);
  to["median"] = sixDigits(f.median);
  to["uniformity"] = sixDigits(f.uniformity);
  to["uniformityError"] = sixDigits(f.uniformity_error);
  to["solveError"] = sixDigits(f.solve_error);
  if (f.light.empty()) return;
  to[light] = listOf(f.light);
  to["standardError"] = listOf(f.error);
}

json toJson(const Plane& plane) {
  json out = {{"node", plane.node},   {"name", plane.name},     {"columns", plane.columns}, {"rows", plane.rows},
              {"first", plane.first}, {"across", plane.across}, {"down", plane.down},       {"normal", plane.normal}};
  addFigures(out, plane.illuminance, "lux");
  if (!plane.verdict.all.empty()) {
    auto &target = out["target"], &verdict = out["verdict"];
    if (plane.wanted_lux) target["lux"] = *plane.wanted_lux;
    if (plane.wanted_uniformity) target["uniformity"] = *plane.wanted_uniformity;
    if (!plane.verdict.lux.empty()) verdict["lux"] = plane.verdict.lux;
    if (!plane.verdict.uniformity.empty()) verdict["uniformity"] = plane.verdict.uniformity;
    verdict["all"] = plane.verdict.all;
  }
  if (plane.daylight_factor) addFigures(out["daylightFactor"], *plane.daylight_factor, "percent");
  return out;
}

void readList(Reader& r, const char* key, std::size_t count, std::vector<double>& out) {
  r.array(key, Need::kOptional, kMaxPlanePoints, [&](const json& element, const std::string& pointer) {
    if (!element.is_number()) return r.refuse(pointer, "must be a number");
    out.push_back(element.get<double>());
  });
  if (!r.failed() && !out.empty() && out.size() != count)
    r.refuse(r.pointerOf(key), "must have a number for each point");
}

void readFigures(Reader& r, const char* light, std::size_t count, PlaneFigures& f) {
  const std::array<std::pair<const char*, double*>, 10> members{{{"mean", &f.mean},
                                                                 {"meanError", &f.mean_error},
                                                                 {"minimum", &f.minimum},
                                                                 {"minimumError", &f.minimum_error},
                                                                 {"maximum", &f.maximum},
                                                                 {"maximumError", &f.maximum_error},
                                                                 {"median", &f.median},
                                                                 {"uniformity", &f.uniformity},
                                                                 {"uniformityError", &f.uniformity_error},
                                                                 {"solveError", &f.solve_error}}};
  for (const auto& [key, value] : members) r.number(key, *value, Need::kRequired, {0.0, kMost, false});
  readList(r, light, count, f.light);
  readList(r, "standardError", count, f.error);
  if (!r.failed() && f.light.size() != f.error.size())
    r.refuse(r.pointerOf("standardError"), "must have a number for each point");
}

void readVerdict(Reader& r, const char* key, Need need, std::string& verdict) {
  r.text(key, verdict, need, kMaxTextBytes);
  if (!r.failed() && !verdict.empty() && verdict != "passes" && verdict != "fails" && verdict != "undecided")
    r.refuse(r.pointerOf(key), std::string("must be one of ") + kVerdicts);
}

void read(Reader& r, Plane& plane) {
  r.integer("node", plane.node, Need::kRequired, 0, kAnyInteger);
  r.text("name", plane.name, Need::kOptional, kAnyText);
  r.integer("columns", plane.columns, Need::kRequired, 1, kMaxPlanePoints);
  r.integer("rows", plane.rows, Need::kRequired, 1, kMaxPlanePoints);
  for (const auto& [key, value] :
       {std::pair{"first", &plane.first}, {"across", &plane.across}, {"down", &plane.down}, {"normal", &plane.normal}})
    readTriple(r, key, Need::kRequired, -kMost, kMost, *value);
  const auto count = static_cast<std::size_t>(plane.columns * plane.rows);
  readFigures(r, "lux", count, plane.illuminance);
  if (r.find("target") != nullptr) {
    r.object("target", Need::kOptional, [&](Reader& inner) {
      inner.optionalNumber("lux", plane.wanted_lux, {0.0, kMost, true});
      inner.optionalNumber("uniformity", plane.wanted_uniformity, {0.0, 1.0, true});
    });
    r.object("verdict", Need::kRequired, [&](Reader& inner) {
      readVerdict(inner, "lux", Need::kOptional, plane.verdict.lux);
      readVerdict(inner, "uniformity", Need::kOptional, plane.verdict.uniformity);
      readVerdict(inner, "all", Need::kRequired, plane.verdict.all);
    });
  }
  if (r.find("daylightFactor") != nullptr)
    r.object("daylightFactor", Need::kOptional,
             [&](Reader& inner) { readFigures(inner, "percent", count, plane.daylight_factor.emplace()); });
}

}  // namespace

json toJson(const Planes& planes) {
  json out = {{"revision", planes.revision}, {"state", planes.state}, {"error", sixDigits(planes.error)}};
  out["planes"] = json::array();
  for (const auto& plane : planes.planes) out["planes"].push_back(toJson(plane));
  return out;
}

void read(Reader& r, Planes& planes) {
  r.integer("revision", planes.revision, Need::kRequired, 0, kAnyInteger);
  r.text("state", planes.state, Need::kRequired, kMaxTextBytes);
  r.number("error", planes.error, Need::kRequired, {0.0, kMost, false});
  r.array("planes", Need::kRequired, kMaxPlanes, [&](const json& element, const std::string& pointer) {
    Reader inner(&element, pointer);
    read(inner, planes.planes.emplace_back());
    if (inner.failed()) r.refuse(inner.pointer(), inner.message().substr(inner.pointer().size() + 1));
  });
}

std::string encodeHttpPlanes(const Planes& planes) { return dumpJson(toJson(planes)); }

Result<Planes> decodeHttpPlanes(std::string_view body) {
  return parseJson(body).and_then([](const JsonPtr& value) -> Result<Planes> {
    Reader reader(value.get(), "");
    Planes planes;
    if (!reader.failed()) read(reader, planes);
    if (reader.failed()) return fail(ErrorCode::kBadInput, reader.message(), reader.pointer());
    return planes;
  });
}

}  // namespace radiosity::protocol
