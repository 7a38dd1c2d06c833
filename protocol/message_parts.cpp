#include "protocol/message_parts.h"

#include <fmt/format.h>
#include <cmath>

namespace radiosity::protocol {

using nlohmann::json;

json toJson(const Settings& s) {
  return {{"targetError", s.target_error},
          {"timeLimitMs", s.time_limit_ms ? json(*s.time_limit_ms) : json(nullptr)},
          {"texels", s.texels},
          {"texelSize", s.texel_size_m},
          {"seed", s.seed},
          {"sky", s.sky ? toJson(*s.sky) : json(nullptr)},
          {"doubleSided", s.double_sided},
          {"adaptive", s.adaptive},
          {"method", nameOf(s.method)}};
}

json toJson(const Sky& sky) { return {{"upper", sky.upper}, {"lower", sky.lower}}; }

void read(Reader& r, Sky& sky) {
  readTriple(r, "upper", Need::kRequired, 0.0, kMaxSkyNits, sky.upper);
  sky.lower = sky.upper;
  readTriple(r, "lower", Need::kOptional, 0.0, kMaxSkyNits, sky.lower);
}

void readTriple(Reader& r, const char* key, Need need, double low, double high, std::array<double, 3>& out) {
  std::size_t count = 0;
  r.array(key, need, 3, [&](const json& value, const std::string& pointer) {
    const double number = value.is_number() ? value.get<double>() : std::nan("");
    if (number >= low && number <= high) {
      out[count++] = number;
    } else {
      r.refuse(pointer, fmt::format("must be a number in [{:g}, {:g}]", low, high));
    }
  });
  if (r.find(key) != nullptr && count != 3) r.refuse(r.pointerOf(key), "must have 3 elements");
}

json toJson(const CameraPose& pose) { return {{"position", pose.position}, {"target", pose.target}}; }

void read(Reader& r, CameraPose& pose) {
  readTriple(r, "position", Need::kRequired, -kMaxCoordinateM, kMaxCoordinateM, pose.position);
  readTriple(r, "target", Need::kRequired, -kMaxCoordinateM, kMaxCoordinateM, pose.target);
}

void readSky(Reader& r, std::optional<Sky>& sky) {
  const auto* given = r.find("sky");
  if (given == nullptr || given->is_null()) return;
  r.object("sky", Need::kOptional, [&](Reader& inner) { read(inner, sky.emplace()); });
}

void read(Reader& r, Settings& s) {
  r.number("targetError", s.target_error, Need::kRequired, {});
  if (const auto* limit = r.find("timeLimitMs"); limit != nullptr && !limit->is_null())
    r.optionalInteger("timeLimitMs", s.time_limit_ms, 0, kAnyInteger);
  r.integer("texels", s.texels, Need::kRequired, 0, kAnyInteger);
  r.number("texelSize", s.texel_size_m, Need::kOptional, {});
  r.integer("seed", s.seed, Need::kOptional, 0, std::numeric_limits<std::uint64_t>::max());
  readSky(r, s.sky);
  r.boolean("doubleSided", s.double_sided, Need::kOptional);
  r.boolean("adaptive", s.adaptive, Need::kOptional);
  r.choice("method", s.method, Need::kOptional, methodFrom, kMethodNamesText);
}

json toJson(const Progress& p) {
  json out = {{"revision", p.revision},
              {"state", p.state},
              {"tileVersion", p.tile_version},
              {"shots", p.shots},
              {"shotsPerSecond", p.shots_per_second},
              {"seconds", p.seconds},
              {"error",
               {{"total", p.error.total},
                {"texels", p.error.texels},
                {"residual", p.error.residual},
                {"sampling", p.error.sampling},
                {"variation", p.error.variation},
                {"discretization", p.error.discretization}}},
              {"energy",
               {{"emitted", p.energy.emitted},
                {"absorbed", p.energy.absorbed},
                {"specular", p.energy.specular},
                {"escaped", p.energy.escaped},
                {"backface", p.energy.backface},
                {"unshot", p.energy.unshot},
                {"imbalance", p.energy.imbalance}}},
              {"patches", p.patches},
              {"nodes", p.nodes},
              {"surfaces", p.surfaces},
              {"polygons", p.polygons}};
  if (p.error.p95) out["error"]["p95"] = *p.error.p95;
  if (p.error.measuring) out["error"]["measuring"] = true;
  if (p.seconds_left) out["secondsLeft"] = *p.seconds_left;
  if (!p.failure.empty()) out["failure"] = p.failure;
  if (!p.unlit.empty()) out["unlit"] = p.unlit;
  if (p.fraction) out["fraction"] = *p.fraction;
  return out;
}

void read(Reader& r, Progress& p) {
  constexpr Range kAny{-std::numeric_limits<double>::max(), std::numeric_limits<double>::max(), false};
  r.integer("revision", p.revision, Need::kRequired, 0, kAnyInteger);
  r.text("state", p.state, Need::kRequired, kMaxTextBytes);
  r.integer("tileVersion", p.tile_version, Need::kRequired, 0, kAnyInteger);
  r.integer("shots", p.shots, Need::kRequired, 0, kAnyInteger);
  r.number("shotsPerSecond", p.shots_per_second, Need::kRequired, {});
  r.number("seconds", p.seconds, Need::kRequired, {});
  r.optionalNumber("secondsLeft", p.seconds_left, {});
  r.object("error", Need::kRequired, [&](Reader& e) {
    e.number("total", p.error.total, Need::kRequired, {});
    e.number("texels", p.error.texels, Need::kRequired, {});
    e.number("residual", p.error.residual, Need::kRequired, {});
    e.number("sampling", p.error.sampling, Need::kRequired, {});
    e.number("variation", p.error.variation, Need::kOptional, {});
    e.number("discretization", p.error.discretization, Need::kRequired, {});
    e.optionalNumber("p95", p.error.p95, {});
    e.boolean("measuring", p.error.measuring, Need::kOptional);
  });
  r.object("energy", Need::kOptional, [&](Reader& e) {
    e.number("emitted", p.energy.emitted, Need::kRequired, kAny);
    e.number("absorbed", p.energy.absorbed, Need::kRequired, kAny);
    e.number("specular", p.energy.specular, Need::kOptional, kAny);
    e.number("escaped", p.energy.escaped, Need::kRequired, kAny);
    e.number("backface", p.energy.backface, Need::kRequired, kAny);
    e.number("unshot", p.energy.unshot, Need::kRequired, kAny);
    e.number("imbalance", p.energy.imbalance, Need::kRequired, kAny);
  });
  r.integer("patches", p.patches, Need::kOptional, 0, kAnyInteger);
  r.integer("nodes", p.nodes, Need::kOptional, 0, kAnyInteger);
  r.integer("surfaces", p.surfaces, Need::kOptional, 0, kAnyInteger);
  r.integer("polygons", p.polygons, Need::kOptional, 0, kAnyInteger);
  r.text("failure", p.failure, Need::kOptional, kAnyText);
  r.text("unlit", p.unlit, Need::kOptional, kAnyText);
  r.optionalNumber("fraction", p.fraction, {0.0, 1.0, false});
}

void readStrings(Reader& r, const char* key, Need need, std::size_t max, std::vector<std::string>& out) {
  r.array(key, need, max, [&](const json& element, const std::string& pointer) {
    if (element.is_string())
      out.push_back(element.get<std::string>());
    else
      r.refuse(pointer, "must be a string");
  });
}

void readIndices(Reader& r, const char* key, std::vector<std::uint32_t>& out) {
  r.array(key, Need::kOptional, kMaxListEntries, [&](const json& element, const std::string& pointer) {
    if (element.is_number_unsigned() && element.get<std::uint64_t>() <= 0xffffffffU)
      out.push_back(element.get<std::uint32_t>());
    else
      r.refuse(pointer, "must be the index of a lightmap page");
  });
}

}  // namespace radiosity::protocol
