#include "server/net/convert.h"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>

namespace radiosity::net {
namespace {

/// JSON has no infinity, and a client's arithmetic no use for it.
double finite(double value, double otherwise) { return std::isfinite(value) ? value : otherwise; }

}  // namespace

std::string_view stateName(engine::SolveState state) {
  switch (state) {
    case engine::SolveState::kEmpty:
      return "empty";
    case engine::SolveState::kLoading:
      return "loading";
    case engine::SolveState::kSolving:
      return "solving";
    case engine::SolveState::kPaused:
      return "paused";
    case engine::SolveState::kConverged:
      return "converged";
    case engine::SolveState::kTimeLimit:
      return "timeLimit";
    case engine::SolveState::kLimited:
      return "limited";
    case engine::SolveState::kFailed:
      return "failed";
  }
  return "failed";
}

bool hasStopped(engine::SolveState state) {
  return state == engine::SolveState::kEmpty || state == engine::SolveState::kConverged ||
         state == engine::SolveState::kTimeLimit || state == engine::SolveState::kLimited ||
         state == engine::SolveState::kFailed;
}

protocol::Progress toProgress(const engine::Status& s) {
  protocol::Progress p;
  p.revision = s.revision;
  p.state = stateName(s.state);
  p.tile_version = s.tile_version;
  p.shots = s.shots;
  p.shots_per_second = finite(s.shots_per_second, 0.0);
  p.seconds = finite(s.seconds, 0.0);
  if (s.seconds_left && std::isfinite(*s.seconds_left)) p.seconds_left = std::max(0.0, *s.seconds_left);
  p.error = {finite(s.error.total, 1e9), finite(s.error.residual, 1e9), finite(s.error.sampling, 1e9),
             finite(s.error.discretization, 1e9)};
  p.energy = {finite(s.energy.emitted, 0.0),  finite(s.energy.absorbed, 0.0), finite(s.energy.escaped, 0.0),
              finite(s.energy.backface, 0.0), finite(s.energy.unshot, 0.0),   finite(s.energy.imbalance, 0.0)};
  p.patches = s.patches;
  p.nodes = s.nodes;
  p.surfaces = s.surfaces;
  p.polygons = s.polygons;
  p.failure = s.failure;
  return p;
}

engine::SkySetting toSetting(const protocol::Sky& sky) {
  return {glm::vec3(sky.upper[0], sky.upper[1], sky.upper[2]), glm::vec3(sky.lower[0], sky.lower[1], sky.lower[2])};
}

protocol::Settings toSettings(const engine::SolveSettings& s) {
  protocol::Settings out;
  out.target_error = s.target_error;
  if (s.time_limit_s) out.time_limit_ms = static_cast<std::uint64_t>(std::llround(*s.time_limit_s * 1000.0));
  out.texels = s.texels;
  out.texel_size_m = s.texel_size_m;
  out.seed = s.seed;
  if (s.sky) {
    const auto color = [](const glm::vec3& c) {
      return std::array{static_cast<double>(c.x), static_cast<double>(c.y), static_cast<double>(c.z)};
    };
    out.sky = {color(s.sky->upper), color(s.sky->lower)};
  }
  return out;
}

engine::SolveSettings merged(engine::SolveSettings s, const protocol::SolveConfigureCall& call) {
  if (call.target_error) s.target_error = *call.target_error;
  if (call.no_time_limit) s.time_limit_s.reset();
  if (call.time_limit_ms) s.time_limit_s = static_cast<double>(*call.time_limit_ms) / 1000.0;
  if (call.texels) {  // naming a budget takes back a size named before
    s.texels = *call.texels;
    s.texel_size_m = 0.0;
  }
  if (call.texel_size_m) s.texel_size_m = *call.texel_size_m;
  if (call.seed) s.seed = *call.seed;
  if (call.no_sky) s.sky.reset();
  if (call.sky) s.sky = toSetting(*call.sky);
  return s;
}

protocol::StatusReply toStatusReply(const engine::Status& s) {
  protocol::StatusReply out;
  out.progress = toProgress(s);
  out.settings = toSettings(s.settings);
  out.warning_count = s.warnings.size();
  std::size_t bytes = 0;
  for (const auto& warning : s.warnings) {
    bytes += warning.size();
    if (out.warnings.size() == protocol::kMaxStatusWarnings || bytes > protocol::kMaxMessageBytes / 4) break;
    out.warnings.push_back(warning);
  }
  for (const auto& [key, value] : s.counters)
    if (std::isfinite(value)) out.counters[key] = value;
  out.gl_renderer = s.gl_renderer;
  return out;
}

protocol::LightmapsNote toLightmapsNote(const engine::Lightmaps& lightmaps) {
  protocol::LightmapsNote note;
  note.layout = lightmaps.layout;
  note.revision = lightmaps.revision;
  for (const auto& page : lightmaps.pages) {
    if (page == nullptr || page->mips.empty()) continue;
    const auto& base = page->mips.front();
    note.pages.push_back({static_cast<std::uint32_t>(base.width), static_cast<std::uint32_t>(base.height),
                          static_cast<std::uint32_t>(page->mips.size())});
  }
  note.uvs = fmt::format("/scene.glb?layout={}", lightmaps.layout);
  return note;
}

}  // namespace radiosity::net
