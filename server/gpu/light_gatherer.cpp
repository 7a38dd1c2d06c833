#include "server/gpu/light_gatherer.h"

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <glm/geometric.hpp>

#include "server/gpu/form_factor_kernel.h"
#include "server/gpu/polygon_form_factor.h"
#include "server/gpu/scatter_accumulator.h"

namespace radiosity::gpu {
namespace {

/// A single shot of whose light less than this stays in the scene is not held to deliver it all: what one image says of
/// that is too coarse. A crack that is more than one pixel (isCrack) takes up to 0.0012 for each.
constexpr double kClosed = 0.99;
/// So many pixels around the places of named receivers are drawn: their own pixel's middle, and its neighbours', lie
/// within.
constexpr float kPixelsAround = 0.8F;

/// So many of a receiver's spots count for one shot of a reflecting node, and of a light: others for every shot.
constexpr std::uint32_t kNodeSpots = 4, kLightSpots = 16;

/// Least and greatest height of a polygon above a plane.
std::array<float, 2> heights(std::span<const glm::vec3> corners, const glm::vec3& point, const glm::vec3& normal) {
  float low = 1e30F, high = -1e30F;
  for (const auto& corner : corners) {
    const float height = glm::dot(corner - point, normal);
    low = std::min(low, height);
    high = std::max(high, height);
  }
  return {low, high};
}

bool sameGeometry(const solver::GatherShot& a, const solver::GatherShot& b) {
  return a.corners == b.corners && a.corner_count == b.corner_count && a.normal == b.normal &&
         a.receiver_jitter == b.receiver_jitter && a.all_spots == b.all_spots && a.fill == b.fill;
}

/// How much of the part of a polygon in front of a receiver shines where of the whole polygon `fill` does: not more
/// than all. `front`: that part, of the polygon's area.
double shining(float fill, double front) {
  return front > 0.0 ? std::min(1.0, static_cast<double>(fill) / front) : 1.0;
}

/// How much of what shines lies in front, then.
float frontOfShining(float fill, double front) {
  return static_cast<float>(std::min(1.0, front / static_cast<double>(fill)));
}

/// How many points of a receiver count.
std::uint32_t spotsOf(const solver::GatherShot& shot, const Receivers::Receiver& receiver) {
  return !receiver.hasSpots() ? 1 : shot.all_spots ? kLightSpots : kNodeSpots;
}

}  // namespace

void LightGatherer::Lit::resize(std::size_t count) {
  for (auto* values : {&x, &y, &z, &nx, &ny, &nz, &form_factor, &front, &point_weight}) values->resize(count);
  receiver.resize(count);
  pixel.resize(count);
  for (std::size_t half = 0; half < 2; ++half) {
    for (auto* sums : {&weight[half], &visible_weight[half]}) sums->resize(count);
  }
}

LightGatherer::LightGatherer(std::shared_ptr<const Receivers> receivers) : receivers_(std::move(receivers)) {
  std::size_t points = receivers_->all().size();
  for (const auto& receiver : receivers_->all()) points += receiver.hasSpots() ? kLightSpots - 1 : 0;
  lit_.resize(points);
}

/// Whether all of the surface lies behind the polygon's plane.
bool LightGatherer::behind(const solver::GatherShot& shot, const scene::Surface& surface) const {
  const auto& n = shot.normal;
  const glm::vec3 farthest(n.x > 0.0F ? surface.bounds_max.x : surface.bounds_min.x,
                           n.y > 0.0F ? surface.bounds_max.y : surface.bounds_min.y,
                           n.z > 0.0F ? surface.bounds_max.z : surface.bounds_min.z);
  return glm::dot(n, farthest - shot.corners[0]) <= kInPlane;
}

void LightGatherer::findLit(const solver::GatherShot& shot) {
  if (lit_valid_ && sameGeometry(shot, lit_for_)) return;
  lit_count_ = weighed_ = 0;
  for (const auto& group : receivers_->groups()) {
    if (!behind(shot, receivers_->patches().surfaces[group.surface])) findLitGroup(shot, group);
  }
  weighWhole(shot);
  lit_for_ = shot;
  lit_valid_ = true;
}

/// Form factors of the receivers that wait for theirs: groups in a row that see all of the polygon are weighed at once,
/// since many scenes have thousands of groups of one or two.
void LightGatherer::weighWhole(const solver::GatherShot& shot) {
  const std::size_t k = weighed_;
  wholeFormFactors(std::span(shot.corners.data(), shot.corner_count),
                   {lit_.x.data() + k, lit_.y.data() + k, lit_.z.data() + k, lit_.nx.data() + k, lit_.ny.data() + k,
                    lit_.nz.data() + k},
                   lit_count_ - k, lit_.form_factor.data() + k);
  for (auto i = k; i < lit_count_ && shot.fill < 1.0F; ++i) lit_.form_factor[i] *= shot.fill;
  std::fill(lit_.front.begin() + static_cast<std::ptrdiff_t>(k),
            lit_.front.begin() + static_cast<std::ptrdiff_t>(lit_count_), 1.0F);
  shareAmongSpots(shot, k);
  weighed_ = lit_count_;
}

/// A receiver of several places is the mean of them; of those lit from `begin` on.
void LightGatherer::shareAmongSpots(const solver::GatherShot& shot, std::size_t begin) {
  for (std::size_t k = begin; k < lit_count_; ++k) {
    const auto spots = spotsOf(shot, receivers_->all()[lit_.receiver[k]]);
    if (spots > 1) lit_.form_factor[k] /= static_cast<float>(spots);
  }
}

void LightGatherer::findLitGroup(const solver::GatherShot& shot, const Receivers::Group& group) {
  const auto& surface = receivers_->patches().surfaces[group.surface];
  const auto& plane = receivers_->patches().triangles[surface.first_triangle];
  const auto plane_normal = group.side * plane.normal;
  const std::span corners(shot.corners.data(), shot.corner_count);
  ClippedPolygon polygon;
  bool whole = false;
  if (surface.planar) {
    const auto [low, high] = heights(corners, plane.origin, plane_normal);
    if (high < -kInPlane) return;
    whole = low > kInPlane;
    if (!whole) polygon = clipToPlane(corners, plane.origin, plane_normal);
    if (!whole && polygon.count == 0) return;
  }
  if (!whole) weighWhole(shot);
  const std::size_t begin = lit_count_;
  for (std::size_t i = group.first; i < group.first + group.count; ++i) {
    const auto& receiver = receivers_->all()[i];
    const std::uint32_t spots = spotsOf(shot, receiver), apart = scene::kLeafSpots / spots;
    const auto first =
        std::min(apart - 1, static_cast<std::uint32_t>(shot.receiver_jitter.x * static_cast<float>(apart)));
    for (std::uint32_t k = 0; k < spots; ++k) {
      const auto place =
          spots > 1 ? receivers_->spot(receiver, first + k * apart) : receivers_->place(receiver, shot.receiver_jitter);
      if (glm::dot(shot.normal, place.point - shot.corners[0]) <= kInPlane) continue;
      const auto normal = surface.planar ? plane_normal : group.side * place.frame->normal;
      if (!surface.planar) {
        const auto form_factor = formFactorInFront(place.point, normal, corners);
        if (form_factor.value <= 0.0) continue;
        lit_.form_factor[lit_count_] = static_cast<float>(form_factor.value * shining(shot.fill, form_factor.front));
        lit_.front[lit_count_] = frontOfShining(shot.fill, form_factor.front);
      }
      addLit(i, place, normal);
    }
  }
  if (whole) return;
  weighed_ = lit_count_;
  if (surface.planar) {
    planarFormFactors(polygon, plane_normal, &lit_.x[begin], &lit_.y[begin], &lit_.z[begin], lit_count_ - begin,
                      &lit_.form_factor[begin]);
    const double kept = polygonArea(std::span(polygon.corner.data(), polygon.count)) / polygonArea(corners);
    for (std::size_t k = begin; k < lit_count_; ++k) {
      lit_.form_factor[k] *= static_cast<float>(shining(shot.fill, kept));
      lit_.front[k] = frontOfShining(shot.fill, kept);
    }
  }
  shareAmongSpots(shot, begin);
}

void LightGatherer::addLit(std::size_t receiver, const Receivers::Place& place, const glm::vec3& normal) {
  const std::size_t k = lit_count_++;
  lit_.x[k] = place.point.x;
  lit_.y[k] = place.point.y;
  lit_.z[k] = place.point.z;
  lit_.nx[k] = normal.x;
  lit_.ny[k] = normal.y;
  lit_.nz[k] = normal.z;
  lit_.receiver[k] = static_cast<std::uint32_t>(receiver);
}

/// Flux that arrives by form factors and visibility, for a radiosity of one.
double LightGatherer::delivered(std::size_t sums, std::size_t points) const {
  double delivered = 0.0;
  for (std::size_t i = 0; i < lit_count_; ++i) {
    const auto node = receivers_->all()[lit_.receiver[i]].node;
    delivered +=
        static_cast<double>(lit_.form_factor[i] * visibility(sums, i, points) * receivers_->patches().node_area[node]);
  }
  return delivered;
}

/// As LinkColumn::gain, for one shot.
double LightGatherer::conserve(std::size_t sums, std::size_t points, double area, double kept) const {
  if (kept < kClosed) return 1.0;
  const double sum = delivered(sums, points);
  return sum > 0.0 ? std::clamp(kept * area / sum, 0.25, 4.0) : 1.0;
}

void LightGatherer::deliver(const solver::GatherShot& shot, std::size_t half, std::size_t points, double share,
                            const FluxSink& sink, solver::TransportCounters& counters) const {
  const std::size_t sums = shot.half == solver::kBothHalves ? half : 0;
  for (std::size_t i = 0; i < lit_count_; ++i) {
    const float seen = visibility(sums, i, points);
    if (seen <= 0.0F) continue;
    const auto node = receivers_->all()[lit_.receiver[i]].node;
    const double factor = share * static_cast<double>(lit_.form_factor[i] * seen) *
                          static_cast<double>(receivers_->patches().node_area[node]);
    solver::Flux3 flux{};
    for (std::size_t channel = 0; channel < 3; ++channel) {
      flux[channel] = std::lrint(shot.radiosity[channel] * factor);
      sink.totals->gathered[channel] += flux[channel];
    }
    sink.add(static_cast<std::uint32_t>(half), node, flux);
    ++counters.links;
  }
}

/// The parts of groups that runs of leaves name.
template <typename Take>
void LightGatherer::forEachGroup(std::span<const solver::NodeRun> named, const Take& take) const {
  const auto& all = receivers_->all();
  auto group = receivers_->groups().begin();
  const auto end = receivers_->groups().end();
  for (const auto& run : named) {
    const auto before = [](const Receivers::Receiver& receiver, std::uint32_t node) { return receiver.node < node; };
    while (group != end && (group->count == 0 || all[group->first + group->count - 1].node < run.first_node)) ++group;
    for (auto part = group; part != end; ++part) {
      if (part->count == 0) continue;
      const auto first = all.begin() + static_cast<std::ptrdiff_t>(part->first);
      const auto last = first + static_cast<std::ptrdiff_t>(part->count);
      if (first->node >= run.first_node + run.count) break;
      const auto low = std::lower_bound(first, last, run.first_node, before);
      const auto high = std::lower_bound(low, last, run.first_node + run.count, before);
      if (low == high) continue;
      take(Receivers::Group{part->surface, static_cast<std::size_t>(low - all.begin()),
                            static_cast<std::size_t>(high - low), part->side});
    }
  }
}

std::optional<ViewWindow> LightGatherer::windowOf(const solver::GatherShot& shot, const solver::HemicubeFrame& point,
                                                  std::span<const solver::NodeRun> named,
                                                  std::span<const scene::ChangedBox> boxes) {
  places_.clear();
  forEachGroup(named, [&](const Receivers::Group& group) {
    if (behind(shot, receivers_->patches().surfaces[group.surface])) return;
    for (std::size_t i = group.first; i < group.first + group.count; ++i) {
      const auto& receiver = receivers_->all()[i];
      const auto spots = receiver.hasSpots() ? scene::kLeafSpots : 1;
      for (std::uint32_t k = 0; k < spots; ++k) {
        const auto place =
            spots > 1 ? receivers_->spot(receiver, k) : receivers_->place(receiver, shot.receiver_jitter);
        if (glm::dot(shot.normal, place.point - shot.corners[0]) > kInPlane) places_.push_back(place.point);
      }
    }
  });
  return windowAround(point, places_, boxes, kPixelsAround * 2.0F / static_cast<float>(shot.resolution));
}

void LightGatherer::beginLinks(const solver::GatherShot& shot, std::span<const solver::NodeRun> named) {
  if (named.empty()) {
    findLit(shot);
  } else {
    lit_count_ = weighed_ = 0;
    lit_valid_ = false;
    forEachGroup(named, [&](const Receivers::Group& group) {
      if (!behind(shot, receivers_->patches().surfaces[group.surface])) findLitGroup(shot, group);
    });
    weighWhole(shot);
  }
  for (auto* sum : {&lit_.weight[0], &lit_.visible_weight[0]}) {
    std::fill_n(sum->begin(), lit_count_, 0.0F);
  }
  look_lost_ = {};
  look_count_ = 0;
}

void LightGatherer::look(const solver::GatherShot& shot, const solver::HemicubeFrame& point,
                         std::span<const std::uint32_t> items, const HemicubeWeights& weights,
                         const ViewWindow* window) {
  testPoint(shot, point, items, 0);
  if (window != nullptr) {
    weighLostInside(*window, point, items, shot.resolution, weights, look_lost_);
  } else {
    weighLost(point, items, shot.resolution, weights, look_lost_);
  }
  ++look_count_;
}

void LightGatherer::finishLinks(const solver::GatherShot& shot, solver::LinkSample& sample,
                                solver::TransportCounters& counters) {
  const double area = static_cast<double>(shot.fill) * polygonArea(std::span(shot.corners.data(), shot.corner_count));
  const double one = static_cast<double>(look_count_) * solver::kWeightOne;
  const double escaped = static_cast<double>(look_lost_.escaped) / one;
  const double absorbed = static_cast<double>(look_lost_.absorbed) / one;
  const double kept = 1.0 - escaped - absorbed;
  sample.delivered = delivered(0, look_count_);
  sample.due = kept * area;
  sample.runs.clear();
  sample.irradiance.clear();
  sample.irradiance.reserve(lit_count_);
  for (std::size_t i = 0; i < lit_count_; ++i) {
    // What is hidden is sent too: zeros inside a run cost less than a new run.
    const float value = lit_.form_factor[i] * visibility(0, i, look_count_);
    if (i > 0 && lit_.receiver[i] == lit_.receiver[i - 1]) {
      sample.irradiance.back() += value;
    } else {
      sample.add(receivers_->all()[lit_.receiver[i]].node, value);
    }
  }
  sample.escaped = escaped * area;
  sample.absorbed = absorbed * area;
  counters.links += sample.irradiance.size();
  counters.gather_points += look_count_;
  ++counters.gather_shots;
}

void LightGatherer::gather(const solver::GatherShot& shot, std::span<const solver::HemicubeFrame> points,
                           double flux_scale, HemicubeRenderer& renderer, WeightCache& weights, const FluxSink& sink,
                           solver::TransportCounters& counters) {
  if (points.empty()) return;
  using Clock = std::chrono::steady_clock;
  const auto start = Clock::now();
  const double rendered_before = counters.render_seconds;
  findLit(shot);
  const bool both = shot.half == solver::kBothHalves && points.size() > 1;
  for (std::size_t half = 0; half < 2; ++half) {
    for (auto* sum : {&lit_.weight[half], &lit_.visible_weight[half]}) {
      std::fill_n(sum->begin(), lit_count_, 0.0F);
    }
  }
  std::array<Lost, 2> lost{};
  const auto capacity = renderer.capacity(shot.resolution);
  std::vector<HemicubeView> views;
  for (std::size_t first = 0; first < points.size(); first += capacity) {
    views.clear();
    for (const auto& point : points.subspan(first, std::min(capacity, points.size() - first))) views.push_back({point});
    const auto images = renderer.render(HemicubePass::kItems, shot.resolution, views, counters);
    const auto pixels = hemicubePixels(shot.resolution);
    for (std::size_t i = 0; i < views.size(); ++i) {
      const auto items = images.subspan(i * pixels, pixels);
      const std::size_t half = both && 2 * (first + i) >= points.size() ? 1 : 0;
      testPoint(shot, views[i].frame, items, half);
      weighLost(views[i].frame, items, shot.resolution, weights.get(shot.resolution, views[i].frame.lattice),
                lost[half]);
    }
  }
  const double area = static_cast<double>(shot.fill) * polygonArea(std::span(shot.corners.data(), shot.corner_count));
  const std::size_t first_half = both ? (points.size() + 1) / 2 : points.size();
  for (std::size_t sums = 0; sums < (both ? 2U : 1U); ++sums) {
    const std::size_t count = sums == 0 ? first_half : points.size() - first_half;
    const double share = (both ? 0.5 : 1.0) * flux_scale, one = static_cast<double>(count) * solver::kWeightOne;
    const double escaped = static_cast<double>(lost[sums].escaped) / one;
    const double absorbed = static_cast<double>(lost[sums].absorbed) / one;
    const double scale = conserve(sums, count, area, 1.0 - escaped - absorbed);
    deliver(shot, both ? sums : shot.half % 2, count, share * scale, sink, counters);
    for (std::size_t channel = 0; channel < 3; ++channel) {
      const double flux = shot.radiosity[channel] * area * share;
      sink.totals->escaped[channel] += std::lrint(flux * escaped);
      sink.totals->backface[channel] += std::lrint(flux * absorbed);
    }
  }
  counters.gather_points += points.size();
  ++counters.gather_shots;
  counters.gather_seconds +=
      std::chrono::duration<double>(Clock::now() - start).count() - (counters.render_seconds - rendered_before);
}

}  // namespace radiosity::gpu
