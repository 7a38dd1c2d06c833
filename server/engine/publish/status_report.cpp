#include "server/engine/publish/status_report.h"

#include <array>

namespace radiosity::engine {
namespace {

/// Weights of Rec. 709, as lux has them: the sum of the channels would be three times what a white lamp gives.
double lumens(const std::array<double, 3>& flux, double scale_m) {
  return (0.2126 * flux[0] + 0.7152 * flux[1] + 0.0722 * flux[2]) * scale_m * scale_m;
}

/// Sides of surfaces that neither reflect nor shine: they receive light and never shoot.
std::uint64_t blackSides(const LitScene& lit) {
  std::uint64_t black = 0;
  for (const auto& surface : lit.patches().surfaces) {
    const auto root = scene::levelGrid(surface.width, surface.height, surface.level_count - 1).offset;
    for (const auto first : surface.first_node) {
      if (first == scene::kNone) continue;
      const auto& materials = lit.materials();
      glm::vec3 sum = materials.emission[first + root] + materials.reflectance[first + root];
      if (materials.transmittance.sideCount() > 0) sum += materials.transmittance[first + root];
      black += sum == glm::vec3(0.0F) ? 1 : 0;
    }
  }
  return black;
}

void addCounters(const LitScene& lit, Status& status) {
  const auto& transport = lit.solver().transportCounters();
  const auto& planner = lit.solver().plannerCounters();
  const auto& scene = lit.scene();
  const auto& patches = lit.patches();
  auto& counters = status.counters;
  counters["rounds"] = lit.solver().rounds();
  counters["scatter.shots"] = static_cast<double>(transport.scatter_shots);
  counters["scatter.links"] = static_cast<double>(transport.links);
  counters["gather.points"] = static_cast<double>(transport.gather_points);
  counters["lights.pointImages"] = static_cast<double>(transport.point_images);
  counters["lights.parallelImages"] = static_cast<double>(transport.parallel_images);
  counters["pixels"] = static_cast<double>(transport.pixels);
  counters["triangles.drawn"] = static_cast<double>(transport.triangles_drawn);
  counters["triangles.culled"] = static_cast<double>(transport.triangles_culled);
  counters["triangles.betweenSamples"] = static_cast<double>(transport.triangles_between);
  counters["triangles.hidden"] = static_cast<double>(transport.triangles_hidden);
  counters["faces"] = static_cast<double>(transport.faces);
  counters["faces.empty"] = static_cast<double>(transport.faces_empty);
  counters["triangles.dropped"] = static_cast<double>(scene.triangles_dropped + patches.triangles_dropped);
  counters["seconds.render"] = transport.render_seconds;
  counters["seconds.accumulate"] = transport.accumulate_seconds;
  counters["seconds.gather"] = transport.gather_seconds;
  counters["skip.rouletteKills"] = static_cast<double>(planner.roulette_kills);
  counters["skip.wholeSubtrees"] = static_cast<double>(planner.whole_subtrees);
  counters["skip.blackSides"] = static_cast<double>(blackSides(lit));
  if (const auto links = lit.solver().linkCounters(); links.solutions > 0) {
    counters["links.bytes"] = static_cast<double>(links.bytes);
    counters["links.shooters"] = static_cast<double>(links.shooters);
    counters["links.samples"] = static_cast<double>(links.samples);
    counters["links.solutions"] = static_cast<double>(links.solutions);
    counters["links.sweeps"] = static_cast<double>(links.sweeps);
    counters["rays"] = static_cast<double>(links.rays);
    counters["skip.raysKept"] = static_cast<double>(links.rays_kept);
    counters["links.rows"] = static_cast<double>(links.rows);
    counters["skip.shotsKept"] = static_cast<double>(links.kept);
    counters["edits.shotsRepaired"] = static_cast<double>(links.repaired);
    counters["edits.linksRepaired"] = static_cast<double>(links.repaired_links);
    counters["edits.samplesWaiting"] = static_cast<double>(links.waiting);
    counters["edits.shotsRetaken"] = static_cast<double>(links.retaken);
    counters["skip.shotsReplayed"] = static_cast<double>(links.replayed);
    counters["skip.rowsOfChannels"] = static_cast<double>(links.rows_saved);
  } else {
    counters["pushPulls"] = static_cast<double>(planner.push_pulls);
  }
}

}  // namespace

Status reportStatus(const LitScene& lit, double seconds) {
  Status status;
  const auto& solver = lit.solver();
  const auto& patches = lit.patches();
  status.shots = solver.shots();
  status.shots_per_second = seconds > 0.0 ? static_cast<double>(status.shots) / seconds : 0.0;
  const auto& error = solver.error();
  status.error = {lit.shownError(), error.total, error.residual, error.sampling, error.variation, error.discretization};
  if (const auto& surface = lit.surfaceError())
    status.surface_error = SurfaceEstimate{surface->total, surface->deviation, surface->p95};
  const double target = lit.settings().target_error;
  // Sampling error falls with the square root of time.
  if (error.total > target && error.total < 1.0)
    status.seconds_left = seconds * (error.total * error.total / (target * target) - 1.0);
  const auto energy = solver.energy();
  const double scale = patches.scale;
  status.energy = {lumens(energy.emitted, scale),  lumens(energy.absorbed, scale), lumens(energy.specular, scale),
                   lumens(energy.escaped, scale),  lumens(energy.backface, scale), lumens(energy.unshot, scale),
                   lumens(energy.imbalance, scale)};
  status.nodes = patches.nodeCount();
  status.surfaces = patches.surfaces.size();
  status.polygons = patches.polygons;
  status.pages = patches.pages.size();
  status.patches = lit.patchCount();
  status.warnings = lit.warnings(kStatusWarnings);
  status.warning_count = lit.warningCount();
  status.unlit = lit.unlit(energy);
  addCounters(lit, status);
  return status;
}

}  // namespace radiosity::engine
