#include "client/cli/report.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "common/check.h"
#include "common/one_line.h"
#include "protocol/codec.h"

namespace radiosity::cli {
namespace {

using nlohmann::json;
constexpr auto kReplace = json::error_handler_t::replace;  // texts come from files and may not be UTF-8

json numberOrNull(bool known, double value) { return known ? json(value) : json(nullptr); }

json settingsJson(const protocol::Settings& settings) {
  return {{"target_error", settings.target_error},
          {"time_limit_s", numberOrNull(settings.time_limit_ms.has_value(),
                                        static_cast<double>(settings.time_limit_ms.value_or(0)) / 1000.0)},
          {"texels", settings.texels},
          {"texel_size_m", settings.texel_size_m},
          {"seed", settings.seed},
          {"sky", settings.sky ? json{{"upper", settings.sky->upper}, {"lower", settings.sky->lower}} : json(nullptr)},
          {"double_sided", settings.double_sided},
          {"adaptive", settings.adaptive},
          {"method", nameOf(settings.method)}};
}

/// A total is that of too wide texels where it is so many times what these are off by.
constexpr double kWide = 2.0;

std::string p95Text(const protocol::ErrorParts& error) {
  return error.p95 ? fmt::format(", 95 % of places within {}", percentText(*error.p95)) : std::string();
}

std::string stateWord(const std::string& state) { return state == "timeLimit" ? "time limit" : state; }

}  // namespace

std::string reportJson(const protocol::StatusReply& status, bool reached) {
  const auto& progress = status.progress;
  json out = {{"seconds", progress.seconds},
              {"shots", progress.shots},
              {"patches", progress.patches},
              {"surfaces", progress.surfaces},
              {"polygons", progress.polygons},
              {"nodes", progress.nodes},
              {"error",
               {{"total", progress.error.total},
                {"p95", progress.error.p95 ? json(*progress.error.p95) : json(nullptr)},
                {"texels", progress.error.texels},
                {"residual", progress.error.residual},
                {"sampling", progress.error.sampling},
                {"variation", progress.error.variation},
                {"discretization", progress.error.discretization}}},
              {"energy",
               {{"emitted", progress.energy.emitted},
                {"absorbed", progress.energy.absorbed},
                {"specular", progress.energy.specular},
                {"escaped", progress.energy.escaped},
                {"backface", progress.energy.backface},
                {"unshot", progress.energy.unshot},
                {"imbalance", progress.energy.imbalance}}},
              {"revision", progress.revision},
              {"gl_renderer", status.gl_renderer},
              {"reached", reached},
              {"state", progress.state},
              {"unlit", progress.unlit.empty() ? json(nullptr) : json(progress.unlit)},
              {"limit", progress.state == "limited" ? json(progress.failure) : json(nullptr)},
              {"settings", settingsJson(status.settings)},
              {"warnings", status.warnings},
              {"warning_count", status.warning_count},
              {"counters", status.counters}};
  return out.dump(2, ' ', false, kReplace) + "\n";
}

std::string statusJson(const protocol::StatusReply& status) {
  const auto message = json::parse(protocol::encodeReply("0", status));
  return message.at("result").dump(2, ' ', false, kReplace) + "\n";
}

std::string statusText(const protocol::StatusReply& status) {
  const auto& p = status.progress;
  const auto& s = status.settings;
  std::string out;
  const auto row = [&out](std::string_view name, const std::string& value) {
    out += fmt::format("{:<10} {}\n", name, oneLine(value));
  };
  const auto loaded = p.fraction ? fmt::format(", {:.0f} % done", 100.0 * *p.fraction) : std::string();
  row("state", stateWord(p.state) + loaded + (p.failure.empty() ? "" : ": " + p.failure));
  row("revision", std::to_string(p.revision));
  const auto target = " of " + percentText(s.target_error);  // of what it is a target for
  row("error", !p.unlit.empty()
                   ? unlitText(p)
                   : fmt::format("{}{}{} (texels {}{}: residual {}, sampling {}, variation {}; between them {})",
                                 percentText(p.error.total), s.choosesTexels() ? target : "", p95Text(p.error),
                                 percentText(p.error.texels), s.choosesTexels() ? "" : target,
                                 percentText(p.error.residual), percentText(p.error.sampling),
                                 percentText(p.error.variation), percentText(p.error.discretization)));
  row("shots", fmt::format("{}, {:.0f}/s", countText(p.shots), p.shots_per_second));
  row("time", durationText(p.seconds) + (p.seconds_left ? ", " + durationText(*p.seconds_left) + " left" : "") +
                  (s.time_limit_ms ? ", limit " + durationText(static_cast<double>(*s.time_limit_ms) / 1000.0) : ""));
  row("scene", fmt::format("{} polygons, {} surfaces, {} patches, {} nodes", countText(p.polygons),
                           countText(p.surfaces), countText(p.patches), countText(p.nodes)));
  row("energy", fmt::format("emitted {:.6g} lm: absorbed {:.6g}, specular {:.6g}, escaped {:.6g}, back faces {:.6g}, "
                            "unshot {:.6g}, imbalance {:.3g}",
                            p.energy.emitted, p.energy.absorbed, p.energy.specular, p.energy.escaped, p.energy.backface,
                            p.energy.unshot, p.energy.imbalance));
  row("texels", s.texel_size_m > 0.0 ? fmt::format("{:g} m each", s.texel_size_m)
                                     : (s.choosesTexels() ? "as light wants them, " + countText(s.texels) + " at most"
                                                          : "about " + countText(s.texels)));
  row("seed", std::to_string(s.seed));
  if (s.double_sided) row("sides", "both of all surfaces");
  if (s.method != Method::kGather) row("method", std::string(nameOf(s.method)));
  row("OpenGL", status.gl_renderer);
  row("warnings", countText(status.warning_count));
  for (const auto& warning : status.warnings) out += "  " + oneLine(warning) + "\n";
  return out;
}

ProgressView viewOf(const protocol::Progress& progress, double target_error) {
  return {.state = stateWord(progress.state),
          .error = progress.error.total,
          .residual = progress.error.residual,
          .sampling = progress.error.sampling,
          .variation = progress.error.variation,
          .discretization = progress.error.discretization,
          .target_error = target_error,
          .shots = progress.shots,
          .shots_per_second = progress.shots_per_second,
          .seconds = progress.seconds,
          .seconds_left = progress.seconds_left,
          .show_parts = false,
          .load_fraction = progress.state == "loading" ? progress.fraction : std::nullopt,
          .unlit = progress.unlit.empty() ? "" : unlitText(progress)};
}

std::string unlitText(const protocol::Progress& progress) { return "no light arrives: " + progress.unlit; }

std::string outcomeText(const protocol::Progress& progress) {
  const auto outcome = progress.unlit.empty() ? "error " + percentText(progress.error.total) + " after"
                                              : oneLine(unlitText(progress)) + "; found in";
  return fmt::format("{} {}, {} shots, {} patches, revision {}", outcome, durationText(progress.seconds),
                     countText(progress.shots), countText(progress.patches), progress.revision);
}

std::string surfaceText(const protocol::ErrorParts& error) {
  auto text = error.p95 ? ";" + p95Text(error).substr(1) : std::string();
  if (kWide * error.texels < error.total) text += fmt::format("; texels alone are {} off", percentText(error.texels));
  return text;
}

}  // namespace radiosity::cli
