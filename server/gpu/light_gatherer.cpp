#include "server/gpu/light_gatherer.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <glm/geometric.hpp>

#include "server/gpu/polygon_form_factor.h"
#include "server/gpu/scatter_accumulator.h"

namespace radiosity::gpu {
namespace {

/// A receiver this far (unit box) behind a plane still counts as lying in it.
constexpr float kInPlane = 2.0e-6F;

double polygonArea(const solver::GatherShot& shot) {
  glm::dvec3 sum(0.0);
  for (std::uint32_t i = 2; i < shot.corner_count; ++i) {
    sum += glm::cross(glm::dvec3(shot.corners[i - 1]) - glm::dvec3(shot.corners[0]),
                      glm::dvec3(shot.corners[i]) - glm::dvec3(shot.corners[0]));
  }
  return 0.5 * glm::length(sum);
}

/// The pixel of a hemicube image in which a direction falls (the cells of hemicube_weights.h).
struct PixelFinder {
  int n;
  float half, shift_x, shift_y;

  PixelFinder(std::uint32_t resolution, std::uint32_t lattice)
      : n(static_cast<int>(resolution)), half(static_cast<float>(resolution) / 2.0F) {
    const auto [across, up] = latticePhase(lattice);
    shift_x = static_cast<float>(0.5 - across);
    shift_y = static_cast<float>(0.5 - up);
  }

  /// x, y along tangent and bitangent, z > 0 along the normal.
  [[nodiscard]] std::uint32_t operator()(float x, float y, float z) const {
    const float ax = std::abs(x);
    const float ay = std::abs(y);
    const bool top = z >= ax && z >= ay;
    const bool along_x = ax >= ay;
    const float depth = top ? z : std::max(ax, ay);
    const float across = top || !along_x ? x : y;
    const float up = top ? y + depth : z;  // top rows start at -1, side rows at the horizon
    const float scale = half / depth;
    const int column = std::clamp(static_cast<int>((across + depth) * scale + shift_x), 0, n - 1);
    const int row = std::clamp(static_cast<int>(up * scale + shift_y), 0, (top ? n : n / 2) - 1);
    const int face = along_x ? (x > 0.0F ? 0 : 1) : (y > 0.0F ? 2 : 3);
    const int first_row = top ? 0 : n + face * (n / 2);
    return static_cast<std::uint32_t>((first_row + row) * n + column);
  }
};

bool sameGeometry(const solver::GatherShot& a, const solver::GatherShot& b) {
  return a.corners == b.corners && a.corner_count == b.corner_count && a.normal == b.normal &&
         a.receiver_jitter == b.receiver_jitter;
}

}  // namespace

LightGatherer::LightGatherer(std::shared_ptr<const scene::PatchScene> patches) : patches_(std::move(patches)) {
  for (const auto& surface : patches_->surfaces) {
    for (int side = 0; side < 2; ++side) {
      const auto first = surface.first_node[static_cast<std::size_t>(side)];
      if (first == scene::kNone) continue;
      for (std::uint32_t i = 0; i < surface.width * surface.height; ++i) {
        const auto& leaf = patches_->leaves[surface.first_leaf + i];
        if (leaf.triangle == scene::kNone || patches_->node_area[first + i] <= 0.0F) continue;
        const auto texel = leaf.full ? glm::vec2(i % surface.width, i / surface.width) : leaf.texel;
        receivers_.push_back({first + i, leaf.triangle, texel, leaf.full, side == 0 ? 1.0F : -1.0F});
      }
    }
  }
  for (std::size_t i = 0; i < patches_->triangles.size(); ++i) {
    const auto& normal = patches_->triangles[i].normal;
    const auto& corner = patches_->vertices[patches_->indices[3 * i]].position;
    const auto& surface = patches_->surfaces[patches_->triangle_surface[i]];
    planes_.push_back({normal, glm::dot(normal, corner)});
    absorbs_.push_back({surface.first_node[0] == scene::kNone, surface.first_node[1] == scene::kNone});
  }
}

void LightGatherer::findLit(const solver::GatherShot& shot) {
  if (lit_valid_ && sameGeometry(shot, lit_for_)) return;
  lit_ = {};
  const std::span corners(shot.corners.data(), shot.corner_count);
  for (std::uint32_t i = 0; i < receivers_.size(); ++i) {
    const auto& receiver = receivers_[i];
    const auto& frame = patches_->triangles[receiver.triangle];
    const auto texel = receiver.full ? receiver.texel + shot.receiver_jitter : receiver.texel;
    const auto point = frame.origin + texel.x * frame.du + texel.y * frame.dv;
    const auto normal = receiver.side * frame.normal;
    if (glm::dot(shot.normal, point - shot.corners[0]) <= kInPlane) continue;
    const double form_factor = polygonFormFactor(point, normal, corners);
    if (form_factor <= 0.0) continue;
    lit_.x.push_back(point.x);
    lit_.y.push_back(point.y);
    lit_.z.push_back(point.z);
    lit_.nx.push_back(normal.x);
    lit_.ny.push_back(normal.y);
    lit_.nz.push_back(normal.z);
    lit_.form_factor.push_back(form_factor);
    lit_.receiver.push_back(i);
  }
  lit_for_ = shot;
  lit_valid_ = true;
}

void LightGatherer::testPoint(const solver::GatherShot& shot, const solver::HemicubeFrame& point,
                              std::span<const std::uint32_t> items) {
  const auto [o, t, b, n] = hemicubeAxes(point);
  const PixelFinder pixel(shot.resolution, point.lattice);
  for (std::size_t i = 0; i < lit_.x.size(); ++i) {
    const glm::vec3 d(lit_.x[i] - o.x, lit_.y[i] - o.y, lit_.z[i] - o.z);
    const float height = std::max(glm::dot(d, n), 1.0e-9F);
    const auto item = items[pixel(glm::dot(d, t), glm::dot(d, b), height)];
    const float square = glm::dot(d, d);
    const float cos_receiver = std::max(0.0F, -(d.x * lit_.nx[i] + d.y * lit_.ny[i] + d.z * lit_.nz[i]));
    const float weight = height * cos_receiver / (square * square);
    bool visible = true;
    if (item != RAD_ITEM_NONE) {
      const auto& plane = planes_[item];
      const float light = glm::dot(plane.normal, o) - plane.distance;
      const float receiver = glm::dot(plane.normal, glm::vec3(lit_.x[i], lit_.y[i], lit_.z[i])) - plane.distance;
      visible = (light > 0.0F ? receiver : -receiver) >= -kInPlane;
    }
    lit_.weight[i] += weight;
    lit_.visible_weight[i] += visible ? weight : 0.0F;
    lit_.visible[i] += visible ? 1.0F : 0.0F;
  }
}

void LightGatherer::weighLost(const solver::HemicubeFrame& point, std::span<const std::uint32_t> items,
                              const HemicubeWeights& weights, std::uint64_t& escaped, std::uint64_t& absorbed) {
  starts_.resize(items.size() + 1);
  const auto runs = findRuns(items, starts_);
  for (std::size_t run = 0; run < runs; ++run) {
    const auto item = items[starts_[run]];
    const std::uint64_t weight = weights.before[starts_[run + 1]] - weights.before[starts_[run]];
    if (item == RAD_ITEM_NONE) {
      escaped += weight;
      continue;
    }
    const bool back = glm::dot(planes_[item].normal, point.origin) <= planes_[item].distance;
    if (absorbs_[item][static_cast<std::size_t>(back)]) absorbed += weight;
  }
}

void LightGatherer::deliver(const solver::GatherShot& shot, double flux_scale, const FluxSink& sink,
                            solver::TransportCounters& counters) const {
  for (std::size_t i = 0; i < lit_.receiver.size(); ++i) {
    const double visibility = lit_.weight[i] > 0.0F
                                  ? static_cast<double>(lit_.visible_weight[i]) / static_cast<double>(lit_.weight[i])
                                  : static_cast<double>(lit_.visible[i]) / shot.point_count;
    if (visibility <= 0.0) continue;
    const auto node = receivers_[lit_.receiver[i]].node;
    const double factor =
        lit_.form_factor[i] * visibility * static_cast<double>(patches_->node_area[node]) * flux_scale;
    solver::Flux3 flux{};
    for (std::size_t channel = 0; channel < 3; ++channel) {
      flux[channel] = std::lrint(shot.radiosity[channel] * factor);
      sink.totals->gathered[channel] += flux[channel];
    }
    sink.add(shot.half, node, flux);
    ++counters.links;
  }
}

void LightGatherer::gather(const solver::GatherShot& shot, std::span<const solver::HemicubeFrame> points,
                           double flux_scale, HemicubeRenderer& renderer, WeightCache& weights, const FluxSink& sink,
                           solver::TransportCounters& counters) {
  if (points.empty()) return;
  using Clock = std::chrono::steady_clock;
  const auto start = Clock::now();
  const double rendered_before = counters.render_seconds;
  findLit(shot);
  for (auto* sum : {&lit_.weight, &lit_.visible_weight, &lit_.visible}) sum->assign(lit_.x.size(), 0.0F);
  std::uint64_t escaped = 0;
  std::uint64_t absorbed = 0;
  const auto capacity = renderer.capacity(shot.resolution);
  std::vector<HemicubeView> views;
  for (std::size_t first = 0; first < points.size(); first += capacity) {
    views.clear();
    for (const auto& point : points.subspan(first, std::min(capacity, points.size() - first))) views.push_back({point});
    const auto images = renderer.render(HemicubePass::kItems, shot.resolution, views, counters);
    const auto pixels = hemicubePixels(shot.resolution);
    for (std::size_t i = 0; i < views.size(); ++i) {
      const auto items = images.subspan(i * pixels, pixels);
      testPoint(shot, views[i].frame, items);
      weighLost(views[i].frame, items, weights.get(shot.resolution, views[i].frame.lattice), escaped, absorbed);
    }
  }
  deliver(shot, flux_scale, sink, counters);
  const double power = polygonArea(shot) * flux_scale / (static_cast<double>(points.size()) * solver::kWeightOne);
  for (std::size_t channel = 0; channel < 3; ++channel) {
    const double flux = shot.radiosity[channel] * power;
    sink.totals->escaped[channel] += std::lrint(flux * static_cast<double>(escaped));
    sink.totals->backface[channel] += std::lrint(flux * static_cast<double>(absorbed));
  }
  counters.gather_points += points.size();
  ++counters.gather_shots;
  counters.gather_seconds +=
      std::chrono::duration<double>(Clock::now() - start).count() - (counters.render_seconds - rendered_before);
}

}  // namespace radiosity::gpu
