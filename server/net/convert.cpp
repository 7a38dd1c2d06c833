#include "server/net/convert.h"

#include <fmt/format.h>
#include <algorithm>
#include <cmath>

namespace radiosity::net {
namespace {

/// JSON has no infinity, and a client's arithmetic no use for it.
double finite(double value, double otherwise) { return std::isfinite(value) ? value : otherwise; }

protocol::ErrorParts toErrorParts(const engine::ErrorEstimate& error) {
  return {finite(error.total, 1e9),    finite(error.texels, 1e9),    finite(error.residual, 1e9),
          finite(error.sampling, 1e9), finite(error.variation, 1e9), finite(error.discretization, 1e9)};
}

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
  p.error = toErrorParts(s.error);
  p.error.measuring = s.probes_surface;
  if (s.surface_error) p.error.p95 = finite(s.surface_error->p95, 1e9);
  p.energy = {finite(s.energy.emitted, 0.0),  finite(s.energy.absorbed, 0.0), finite(s.energy.specular, 0.0),
              finite(s.energy.escaped, 0.0),  finite(s.energy.backface, 0.0), finite(s.energy.unshot, 0.0),
              finite(s.energy.imbalance, 0.0)};
  p.patches = s.patches;
  p.nodes = s.nodes;
  p.surfaces = s.surfaces;
  p.polygons = s.polygons;
  p.failure = s.failure;
  p.unlit = s.unlit;
  if (s.load_fraction) p.fraction = std::clamp(finite(*s.load_fraction, 0.0), 0.0, 1.0);
  return p;
}

engine::SkySetting toSetting(const protocol::Sky& sky) {
  return {glm::vec3(sky.upper[0], sky.upper[1], sky.upper[2]), glm::vec3(sky.lower[0], sky.lower[1], sky.lower[2])};
}

protocol::Settings toSettings(const engine::SolveSettings& s) {
  protocol::Settings out;
  out.target_error = s.target_error;
  constexpr auto kLongest = static_cast<double>(protocol::kMaxTimeLimitMs);
  if (s.time_limit_s)
    out.time_limit_ms = static_cast<std::uint64_t>(std::llround(std::min(*s.time_limit_s * 1000.0, kLongest)));
  out.texels = s.texels;
  out.texel_size_m = s.texel_size_m;
  out.seed = s.seed;
  if (s.sky) {
    const auto color = [](const glm::vec3& c) {
      return std::array{static_cast<double>(c.x), static_cast<double>(c.y), static_cast<double>(c.z)};
    };
    out.sky = {color(s.sky->upper), color(s.sky->lower)};
  }
  out.double_sided = s.double_sided;
  out.adaptive = s.adaptive;
  out.method = s.method;
  return out;
}

engine::SolveSettings merged(engine::SolveSettings s, const protocol::SolveConfigureCall& call) {
  const bool usual = s.texels == s.usualTexels();
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
  if (call.double_sided) s.double_sided = *call.double_sided;
  if (call.adaptive) s.adaptive = *call.adaptive;
  if (call.method) s.method = *call.method;
  // A million texels alike would take the paper's method hours.
  if (usual && !call.texels) s.texels = s.usualTexels();
  return s;
}

namespace {

/// No fewer than the text takes as JSON: control characters are written as six, what is no UTF-8 becomes three.
std::size_t bytesInJson(const std::string& text) {
  std::size_t bytes = 2;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    bytes += byte < 0x20 ? 6 : byte >= 0x80 ? 3 : c == '"' || c == '\\' ? 2 : 1;
  }
  return bytes;
}

}  // namespace

std::vector<std::string> firstWarnings(const std::vector<std::string>& all) {
  std::vector<std::string> first;
  std::size_t bytes = 0;
  for (const auto& warning : all) {
    bytes += bytesInJson(warning);
    if (first.size() == protocol::kMaxStatusWarnings || bytes > protocol::kMaxMessageBytes / 4) break;
    first.push_back(warning);
  }
  return first;
}

protocol::SceneHistoryReply toHistoryReply(const engine::HistoryReport& report, std::uint64_t limit) {
  using Kind = engine::PastRevision::Kind;
  protocol::SceneHistoryReply reply{report.revision, report.undoable, report.redoable, {}};
  const auto& all = report.revisions;
  for (auto i = all.size() - std::min<std::size_t>(all.size(), limit); i < all.size(); ++i) {
    const auto& past = all[i];
    auto& out = reply.revisions.emplace_back();
    out.revision = past.revision;
    out.kind = past.kind == Kind::kLoad    ? "load"
               : past.kind == Kind::kPatch ? "patch"
               : past.kind == Kind::kUndo  ? "undo"
                                           : "redo";
    out.by = past.by;
    out.summary = past.summary;
    out.time_s = past.time_s;
    if (past.kind == Kind::kUndo || past.kind == Kind::kRedo) out.edit = past.stepped;
    out.undone = past.undone;
  }
  return reply;
}

static_assert(engine::kErrorSamples == protocol::kMaxErrorSamples);

protocol::SolveHistoryReply toSolveHistoryReply(const engine::SolveHistory& history) {
  protocol::SolveHistoryReply reply{history.revision, {}};
  for (const auto& sample : history.samples) {
    const auto error = toErrorParts(sample.error);
    reply.samples.push_back(
        {finite(sample.seconds, 0.0), error.total, error.texels, error.residual, error.sampling, error.variation});
  }
  return reply;
}

protocol::TexelReply toTexelReply(const engine::Texel& texel) {
  protocol::TexelReply reply{texel.revision, texel.tile_version, {}, {}};
  for (int c = 0; c < 3; ++c) {
    const auto i = static_cast<std::size_t>(c);
    reply.irradiance[i] = finite(static_cast<double>(texel.irradiance[c]), 0.0);
    reply.error[i] = finite(static_cast<double>(texel.error[c]), 1e9);
  }
  return reply;
}

namespace {

std::array<double, 3> triple(const glm::dvec3& v) { return {v.x, v.y, v.z}; }

std::string verdictName(const std::optional<engine::PlaneVerdict>& verdict) {
  if (!verdict) return {};
  return *verdict == engine::PlaneVerdict::kPasses  ? "passes"
         : *verdict == engine::PlaneVerdict::kFails ? "fails"
                                                    : "undecided";
}

protocol::PlaneFigures toFigures(const engine::PlaneFigures& f) {
  protocol::PlaneFigures out{f.mean,   f.mean_error, f.minimum,          f.minimum_error, f.maximum, f.maximum_error,
                             f.median, f.uniformity, f.uniformity_error, f.solve_error,   f.light,   f.error};
  for (auto* value : {&out.mean, &out.mean_error, &out.minimum, &out.minimum_error, &out.maximum, &out.maximum_error,
                      &out.median, &out.uniformity, &out.uniformity_error, &out.solve_error})
    *value = finite(*value, 0.0);
  for (auto* list : {&out.light, &out.error})
    for (auto& value : *list) value = finite(value, 0.0);
  return out;
}

}  // namespace

protocol::Planes toPlanes(const engine::MeasureReport& report) {
  protocol::Planes out{report.revision, std::string(stateName(report.state)), finite(report.error, 1e9), {}};
  for (const auto& plane : report.planes) {
    auto& to = out.planes.emplace_back();
    to.node = plane.node;
    to.name = plane.name;
    to.columns = plane.columns;
    to.rows = plane.rows;
    to.first = triple(plane.place[0]);
    to.across = triple(plane.place[1]);
    to.down = triple(plane.place[2]);
    to.normal = triple(plane.normal);
    to.wanted_lux = plane.wanted_lux;
    to.wanted_uniformity = plane.wanted_uniformity;
    to.verdict = {verdictName(plane.lux_verdict), verdictName(plane.uniformity_verdict), verdictName(plane.verdict)};
    to.illuminance = toFigures(plane.illuminance);
    if (plane.daylight_factor) to.daylight_factor = toFigures(*plane.daylight_factor);
  }
  return out;
}

protocol::Probes toProbes(engine::ProbeReport report) {
  static_assert(protocol::kProbeNumbers == engine::kProbeValues);
  protocol::Probes out{report.revision, std::string(stateName(report.state)), finite(report.error, 1e9), {}};
  for (auto& grid : report.grids) {
    auto& to = out.grids.emplace_back();
    to.node = grid.node;
    to.name = std::move(grid.name);
    for (std::size_t axis = 0; axis < 3; ++axis) {
      to.counts[axis] = grid.counts[axis];
      to.steps[axis] = triple(grid.steps[axis]);
    }
    to.first = triple(grid.first);
    to.values = std::move(grid.values);
  }
  return out;
}

protocol::Web toWeb(const engine::ShownWeb& web) {
  return {web.revision,       web.lumens, web.most_candela, triple(web.axis),
          triple(web.across), web.polar,  web.azimuth,      web.candela};
}

protocol::Planes withoutLongGrids(protocol::Planes planes) {
  std::size_t points = 0;
  for (const auto& plane : planes.planes) points += plane.illuminance.light.size();
  if (points <= protocol::kMaxInlinePlanePoints) return planes;
  for (auto& plane : planes.planes) {
    for (auto* figures : {&plane.illuminance, plane.daylight_factor ? &*plane.daylight_factor : nullptr}) {
      if (figures == nullptr) continue;
      figures->light.clear();
      figures->error.clear();
    }
  }
  return planes;
}

protocol::StatusReply toStatusReply(const engine::Status& s) {
  protocol::StatusReply out;
  out.progress = toProgress(s);
  out.settings = toSettings(s.settings);
  out.warning_count = s.warning_count;
  out.warnings = firstWarnings(s.warnings);
  for (const auto& [key, value] : s.counters)
    if (std::isfinite(value)) out.counters[key] = value;
  out.gl_renderer = s.gl_renderer;
  return out;
}

static_assert(engine::kStatusWarnings == protocol::kMaxStatusWarnings);

// Both list the same quantities in the same order.
static_assert(static_cast<int>(engine::Quantity::kIrradiance) == static_cast<int>(protocol::Quantity::kIrradiance));
static_assert(static_cast<int>(engine::Quantity::kRadiosity) == static_cast<int>(protocol::Quantity::kRadiosity));
static_assert(static_cast<int>(engine::Quantity::kError) == static_cast<int>(protocol::Quantity::kError));
static_assert(static_cast<int>(engine::Quantity::kPatchId) == static_cast<int>(protocol::Quantity::kPatchId));
static_assert(static_cast<int>(engine::Quantity::kMipLevel) == static_cast<int>(protocol::Quantity::kMipLevel));
static_assert(static_cast<int>(engine::Quantity::kUnshot) == static_cast<int>(protocol::Quantity::kUnshot));
static_assert(static_cast<int>(engine::Quantity::kNormal) == static_cast<int>(protocol::Quantity::kNormal));
static_assert(engine::kQuantityCount == 7);

protocol::Quantity toQuantity(engine::Quantity quantity) { return static_cast<protocol::Quantity>(quantity); }
engine::Quantity toQuantity(protocol::Quantity quantity) { return static_cast<engine::Quantity>(quantity); }

protocol::LightmapsNote toLightmapsNote(const engine::Lightmaps& lightmaps) {
  protocol::LightmapsNote note;
  note.layout = lightmaps.layout;
  note.revision = lightmaps.revision;
  note.quantity = toQuantity(lightmaps.quantity);
  for (const auto& page : lightmaps.pages) {
    if (page == nullptr || page->mipCount() == 0) continue;
    const auto base = page->size(0);
    note.pages.push_back({static_cast<std::uint32_t>(base.x), static_cast<std::uint32_t>(base.y),
                          static_cast<std::uint32_t>(page->mipCount())});
  }
  note.uvs = fmt::format("/scene.glb?layout={}", lightmaps.layout);
  return note;
}

}  // namespace radiosity::net
