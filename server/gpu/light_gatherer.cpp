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

/// A polygon of whose light less than this stays in the scene is not held to deliver it all. A crack that is
/// more than one pixel (isCrack) takes up to 0.0012 for each.
constexpr double kClosed = 0.99;
/// A single pixel through which one looks out of the scene, between four that show something: where a corner of one
/// wall meets the middle of another's edge, rounding leaves such holes, and no light must leave by them.
bool isCrack(std::span<const std::uint32_t> items, std::size_t first, std::size_t end, std::size_t width) {
  if (end - first != 1 || first < width || first + width >= items.size()) return false;
  for (const auto neighbour : {first - 1, first + 1, first - width, first + width}) {
    if (items[neighbour] == RAD_ITEM_NONE) return false;
  }
  return true;
}

/// So many pixels around the places of named receivers are drawn: their own pixel's middle, and its neighbours', lie
/// within.
constexpr float kPixelsAround = 0.8F;

/// So many of a receiver's spots count for one shot of a reflecting node, and of a light: others for every shot.
constexpr std::uint32_t kNodeSpots = 4, kLightSpots = 16;

/// What few points in front of a receiver's plane stand for is multiplied by this at most.
constexpr double kMostForOthers = 4.0;

/// What the kernel below needs of a hemicube and of the receivers.
struct PointView {
  glm::vec3 o, t, b, n;
  int resolution;
  float shift_x, shift_y;
};

/// For every receiver: the pixel of the hemicube's image in which it lies (the cells of hemicube_weights.h), and cos
/// cos / r^2. Branch-free, so that it vectorises; one clone for processors with 256-bit vectors, same bits in both.
__attribute__((target_clones("avx2", "default"))) void projectReceivers(const PointView& view, std::size_t count,
                                                                        const float* x, const float* y, const float* z,
                                                                        const float* nx, const float* ny,
                                                                        const float* nz, std::uint32_t* pixel,
                                                                        float* weight) {
  const int size = view.resolution, half_size = size / 2;
  const float half = static_cast<float>(size) / 2.0F;
  for (std::size_t i = 0; i < count; ++i) {
    const float dx = x[i] - view.o.x, dy = y[i] - view.o.y, dz = z[i] - view.o.z;
    const float lx = dx * view.t.x + dy * view.t.y + dz * view.t.z;
    const float ly = dx * view.b.x + dy * view.b.y + dz * view.b.z;
    const float lz = std::max(dx * view.n.x + dy * view.n.y + dz * view.n.z, 1.0e-9F);
    const float ax = std::abs(lx), ay = std::abs(ly), side = std::max(ax, ay);
    const bool top = lz >= side;
    const bool along_x = ax >= ay;
    const float depth = std::max(lz, side);
    const float across = top || !along_x ? lx : ly;
    const float up = top ? ly + depth : lz;  // top rows start at -1, side rows at the horizon
    const float scale = half / depth;
    const int column = std::clamp(static_cast<int>((across + depth) * scale + view.shift_x), 0, size - 1);
    const int row = std::clamp(static_cast<int>(up * scale + view.shift_y), 0, (top ? size : half_size) - 1);
    const int face = along_x ? (lx > 0.0F ? 0 : 1) : (ly > 0.0F ? 2 : 3);
    const int first_row = top ? 0 : size + face * half_size;
    pixel[i] = static_cast<std::uint32_t>((first_row + row) * size + column);
    const float square = dx * dx + dy * dy + dz * dz;
    const float cosine = std::max(0.0F, -(dx * nx[i] + dy * ny[i] + dz * nz[i]));
    weight[i] = lz * cosine / (square * square);
  }
}

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

void LightGatherer::testPoint(const solver::GatherShot& shot, const solver::HemicubeFrame& point,
                              std::span<const std::uint32_t> items, std::size_t half) {
  const auto [o, t, b, n] = hemicubeAxes(point);
  const auto [across, up] = latticePhase(point.lattice);
  const PointView view{
      o, t, b, n, static_cast<int>(shot.resolution), static_cast<float>(0.5 - across), static_cast<float>(0.5 - up)};
  projectReceivers(view, lit_count_, lit_.x.data(), lit_.y.data(), lit_.z.data(), lit_.nx.data(), lit_.ny.data(),
                   lit_.nz.data(), lit_.pixel.data(), lit_.point_weight.data());
  const auto size = static_cast<std::size_t>(shot.resolution);
  float* weight = lit_.weight[half].data();
  float* visible_weight = lit_.visible_weight[half].data();
  for (std::size_t i = 0; i < lit_count_; ++i) {
    const auto item = items[lit_.pixel[i]];
    bool visible = true;
    if (item == RAD_ITEM_NONE) {
      visible = !hiddenAtSilhouette(i, o, items, size);
    } else {
      const auto& plane = receivers_->plane(item);
      const glm::vec3 at(lit_.x[i], lit_.y[i], lit_.z[i]);
      const float light = glm::dot(plane.normal, o) - plane.distance;
      const float receiver = glm::dot(plane.normal, at) - plane.distance;
      const float before = light > 0.0F ? receiver : -receiver;
      visible =
          before >= -kInPlane || !receivers_->risesBefore(item, at, glm::vec3(lit_.nx[i], lit_.ny[i], lit_.nz[i]));
    }
    weight[i] += lit_.point_weight[i];
    visible_weight[i] += visible ? lit_.point_weight[i] : 0.0F;
  }
}

/// The middle of a receiver's pixel misses everything, the receiver too. Where the ray to it meets a wide facet that a
/// neighbouring pixel shows, that hides it: along the edges of a closed room, what lies behind its walls.
bool LightGatherer::hiddenAtSilhouette(std::size_t i, const glm::vec3& light, std::span<const std::uint32_t> items,
                                       std::size_t size) const {
  const std::size_t pixel = lit_.pixel[i], column = pixel % size, row = pixel / size;
  const std::size_t first_row = row < size ? 0 : size + (row - size) / (size / 2) * (size / 2);
  const std::size_t rows = row < size ? size : size / 2;
  std::array<std::uint32_t, 9> around{};
  for (std::size_t k = 0; k < around.size(); ++k) {
    const auto x = std::clamp<std::size_t>(column + k % 3, 1, size) - 1;
    const auto y = std::clamp<std::size_t>(row - first_row + k / 3, 1, rows) - 1;
    around[k] = items[(first_row + y) * size + x];
  }
  const glm::vec3 at(lit_.x[i], lit_.y[i], lit_.z[i]), normal(lit_.nx[i], lit_.ny[i], lit_.nz[i]);
  const float pixel_size = 2.0F * glm::distance(light, at) / static_cast<float>(size);
  return receivers_->anyMeets(around, {at, normal, light - at, 1.0F, pixel_size});
}

void LightGatherer::weighLost(const solver::HemicubeFrame& point, std::span<const std::uint32_t> items,
                              std::uint32_t resolution, const HemicubeWeights& weights, Lost& lost) {
  starts_.resize(items.size() + 1);
  const auto runs = findRuns(items, starts_);
  for (std::size_t run = 0; run < runs; ++run) {
    const auto item = items[starts_[run]];
    const std::uint64_t weight = weights.before[starts_[run + 1]] - weights.before[starts_[run]];
    if (item == RAD_ITEM_NONE) {
      if (!isCrack(items, starts_[run], starts_[run + 1], resolution)) lost.escaped += weight;
      continue;
    }
    const bool back = glm::dot(receivers_->plane(item).normal, point.origin) <= receivers_->plane(item).distance;
    if (receivers_->absorbs(item, back)) lost.absorbed += weight;
  }
}

void LightGatherer::weighLostInside(const ViewWindow& window, const solver::HemicubeFrame& point,
                                    std::span<const std::uint32_t> items, std::uint32_t resolution,
                                    const HemicubeWeights& weights, Lost& lost) const {
  for (std::uint32_t row = 0; row < 3 * resolution; ++row) {
    const auto inside = pixelsInside(window, point, resolution, row);
    for (std::size_t i = std::size_t{row} * resolution + inside.first; i < std::size_t{row} * resolution + inside.end;
         ++i) {
      const auto item = items[i];
      if (item == RAD_ITEM_NONE) {
        if (!isCrack(items, i, i + 1, resolution)) lost.escaped += weights.pixel(i);
        continue;
      }
      const bool back = glm::dot(receivers_->plane(item).normal, point.origin) <= receivers_->plane(item).distance;
      if (receivers_->absorbs(item, back)) lost.absorbed += weights.pixel(i);
    }
  }
}

/// By the points before the receiver's plane, which decide alone: those behind it see nothing of what the form factor
/// stands for. Where there happen to be none, others stand for them, so that the mean over all samples is right. Where
/// so little lies in front that they would have to stand for very many, the receiver is taken to see the rest.
float LightGatherer::visibility(std::size_t sums, std::size_t i, std::size_t points) const {
  const float weight = lit_.weight[sums][i];
  if (lit_.front[i] >= 1.0F) return weight > 0.0F ? lit_.visible_weight[sums][i] / weight : 0.0F;
  const double none = std::pow(1.0 - static_cast<double>(lit_.front[i]), static_cast<double>(points));
  const double factor = std::min(1.0 / (1.0 - none), kMostForOthers);
  if (weight > 0.0F) return static_cast<float>(factor) * lit_.visible_weight[sums][i] / weight;
  return static_cast<float>(std::max(0.0, 1.0 - factor * (1.0 - none)) / none);
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
  sample.due = kept < kClosed ? sample.delivered : kept * area;
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
