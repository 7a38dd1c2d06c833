#include <fmt/format.h>
#include <iterator>

#include "protocol/planes.h"

namespace radiosity::protocol {
namespace {

constexpr const char* kEnd = "\r\n";

std::string cell(std::string text) {
  if (!text.empty() && std::string("=+-@\t\r").find(text.front()) != std::string::npos) text.insert(0, "'");
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? std::string("\"\"") : std::string(1, c);
  return quoted + "\"";
}

std::string number(const std::optional<double>& value) { return value ? fmt::format("{:.6g}", *value) : ""; }

std::string figures(const PlaneFigures& f) {
  return fmt::format("{:.6g},{:.3g},{:.6g},{:.3g},{:.6g},{:.3g},{:.6g},{:.4g},{:.2g},{:.3g}", f.mean, f.mean_error,
                     f.minimum, f.minimum_error, f.maximum, f.maximum_error, f.median, f.uniformity, f.uniformity_error,
                     f.solve_error);
}

std::string figureNames(const char* before) {
  std::string names;
  for (const char* name : {"mean", "meanError", "minimum", "minimumError", "maximum", "maximumError", "median",
                           "uniformity", "uniformityError", "solveError"})
    names += fmt::format(",{}{}", before, name);
  return names;
}

bool hasDaylight(const Planes& planes) {
  for (const auto& plane : planes.planes)
    if (plane.daylight_factor) return true;
  return false;
}

}  // namespace

std::array<double, 3> Plane::pointAt(std::size_t point) const {
  std::array<double, 3> at{};
  const auto column = static_cast<double>(point % columns), row = static_cast<double>(point / columns);
  for (std::size_t c = 0; c < 3; ++c) at[c] = first[c] + column * across[c] + row * down[c];
  return at;
}

std::string planesCsv(const Planes& planes) {
  const bool has_daylight = hasDaylight(planes);
  std::string text =
      "plane,node,columns,rows" + figureNames("") + ",targetLux,targetUniformity,luxVerdict,uniformityVerdict,verdict";
  if (has_daylight) text += figureNames("daylightFactor:");
  text += kEnd;
  for (const auto& plane : planes.planes) {
    text += fmt::format("{},{},{},{},{},{},{},{},{},{}", cell(plane.name), plane.node, plane.columns, plane.rows,
                        figures(plane.illuminance), number(plane.wanted_lux), number(plane.wanted_uniformity),
                        plane.verdict.lux, plane.verdict.uniformity, plane.verdict.all);
    if (has_daylight) text += "," + (plane.daylight_factor ? figures(*plane.daylight_factor) : std::string(9, ','));
    text += kEnd;
  }
  text += kEnd;
  text += "plane,node,column,row,x,y,z,lux,standardError";
  if (has_daylight) text += ",daylightFactor,daylightFactorError";
  text += kEnd;
  for (const auto& plane : planes.planes) {
    for (std::size_t i = 0; i < plane.illuminance.light.size(); ++i) {
      const auto at = plane.pointAt(i);
      fmt::format_to(std::back_inserter(text), "{},{},{},{},{:.6g},{:.6g},{:.6g},{:.6g},{:.3g}", cell(plane.name),
                     plane.node, i % plane.columns, i / plane.columns, at[0], at[1], at[2], plane.illuminance.light[i],
                     plane.illuminance.error[i]);
      if (plane.daylight_factor && i < plane.daylight_factor->light.size())
        fmt::format_to(std::back_inserter(text), ",{:.6g},{:.3g}", plane.daylight_factor->light[i],
                       plane.daylight_factor->error[i]);
      text += kEnd;
    }
  }
  return text;
}

}  // namespace radiosity::protocol
