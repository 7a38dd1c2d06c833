#include "server/solver/lamps/punctual_lights.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>
#include <optional>
#include <span>
#include <unordered_map>

#include "server/solver/lamps/lamp_of_light.h"
#include "server/solver/lamps/sky_sources.h"
#include "server/solver/math/sampling.h"
#include "server/solver/patches/unshot_pyramid.h"

namespace radiosity::solver {
namespace {

using std::numbers::pi;

constexpr std::uint32_t kMostPointPixels = 512, kMostParallelPixels = 2048;

/// A point light this far away (unit box) is a directional one: its irradiance differs by 2e-4 at most over the scene.
constexpr double kFarAway = 1.0e4;
/// A narrower sun (rad) is a direction: its half shadow, a box wide, is thinner than what positions are rounded to.
constexpr double kLeastSun = 1.0e-6;

/// Pixels across `extent` that are half as large as a leaf of middling size; a power of two.
std::uint32_t pixelsForLeaves(const scene::PatchScene& patches, float extent) {
  double area = 0.0, leaves = 0.0;
  for (const auto& surface : patches.surfaces) {
    const double count = double{1.0} * surface.width * surface.height;
    area += count * static_cast<double>(surface.texel_area);
    leaves += count;
  }
  if (area <= 0.0) return 0;
  const double wanted = 2.0 * static_cast<double>(extent) / std::sqrt(area / leaves);
  std::uint32_t pixels = 2;
  while (pixels < 4096 && pixels < wanted) pixels *= 2;
  return pixels;
}

std::array<double, 3> channels(const glm::dvec3& v) { return {v.x, v.y, v.z}; }

/// A unit vector perpendicular to `axis`, turned about it by `turns`.
glm::vec3 perpendicular(const glm::vec3& axis, double turns) {
  const glm::vec3 helper = std::abs(axis.x) < 0.6F ? glm::vec3(1, 0, 0) : glm::vec3(0, 1, 0);
  const glm::vec3 a = glm::normalize(glm::cross(helper, axis));
  const double angle = 2.0 * pi * turns;
  return glm::normalize(a * static_cast<float>(std::cos(angle)) +
                        glm::cross(axis, a) * static_cast<float>(std::sin(angle)));
}

/// Uniform over the sphere (u in [0, 1)), or over the upper half of it about +Y (u in [0.5, 1)).
glm::vec3 onSphere(double u, double v) {
  const double y = 2.0 * u - 1.0, radius = std::sqrt(std::max(0.0, 1.0 - y * y)), angle = 2.0 * pi * v;
  return {static_cast<float>(radius * std::cos(angle)), static_cast<float>(y),
          static_cast<float>(radius * std::sin(angle))};
}

ReceiverPoints receiverPoints(std::uint32_t index, std::uint64_t key) {
  ReceiverPoints points;
  points.count = kMaxReceiverPoints;
  for (std::uint32_t p = 0; p < kMaxReceiverPoints; ++p) {
    const glm::dvec4 at = sobol4(index * static_cast<std::uint32_t>(kMaxReceiverPoints) + p, key);
    points.at[p] = glm::vec2(at.x, at.y);
  }
  return points;
}

/// Integral of clamp(cos scale + offset, 0, 1)^2 over the half space around the axis, sr.
double coneSolidAngle(double scale, double offset) {
  if (scale <= 0.0) return 2.0 * pi;
  const double outer = std::clamp(-offset / scale, 0.0, 1.0), inner = std::clamp((1.0 - offset) / scale, outer, 1.0);
  const auto cubed = [&](double c) { return std::pow(std::clamp(c * scale + offset, 0.0, 1.0), 3.0); };
  return 2.0 * pi * ((cubed(inner) - cubed(outer)) / (3.0 * scale) + 1.0 - inner);
}

ParallelView parallelView(const glm::vec3& direction, double turn, double shift, std::uint64_t key) {
  return {direction, perpendicular(direction, turn), glm::vec2(shift, uniformFromKey(key))};
}

/// Finds sources of the same shape among very many.
class Shapes {
 public:
  using Source = PunctualLights::Source;

  /// Number of the first that was added of this shape; none.
  [[nodiscard]] std::optional<std::size_t> find(const std::vector<Source>& sources, const Source& like) const {
    const auto [first, end] = numbers_.equal_range(keyOf(like));
    std::optional<std::size_t> found;
    for (auto at = first; at != end; ++at)
      if (sources[at->second].sameShape(like)) found = std::min(found.value_or(at->second), at->second);
    return found;
  }
  void add(const Source& source, std::size_t number) { numbers_.emplace(keyOf(source), number); }

 private:
  /// Equal for equal shapes: -0 becomes 0.
  static std::uint64_t keyOf(Source source) {
    source.position += 0.0F;
    source.direction += 0.0F;
    source.cone_scale += 0.0F;
    source.cone_offset += 0.0F;
    source.range += 0.0F;
    return source.shapeKey();
  }
  std::unordered_multimap<std::uint64_t, std::size_t> numbers_;
};

}  // namespace

std::array<glm::vec3, 2> sceneBox(const scene::PatchScene& patches) {
  if (patches.vertices.empty()) return {};
  std::array<glm::vec3, 2> box{patches.vertices[0].position, patches.vertices[0].position};
  for (const auto& vertex : patches.vertices) {
    box[0] = glm::min(box[0], vertex.position);
    box[1] = glm::max(box[1], vertex.position);
  }
  return box;
}

double boxSilhouette(const std::array<glm::vec3, 2>& box, const glm::vec3& direction) {
  const glm::dvec3 size(box[1] - box[0]), d(glm::abs(direction));
  return d.x * size.y * size.z + d.y * size.x * size.z + d.z * size.x * size.y;
}

double totalFlux(const scene::PatchScene& patches, const LightSources& sources) {
  return PunctualLights(patches, sources, {}).owed(1);
}

bool PunctualLights::Source::sameShape(const Source& other) const {
  return kind == other.kind && position == other.position && direction == other.direction &&
         cone_scale == other.cone_scale && cone_offset == other.cone_offset && range == other.range &&
         shape == other.shape && web_key == other.web_key;
}

Lamp PunctualLights::Source::lamp() const {
  static const std::array<float, 7> black{2.0F, 1.0F, 0.0F, 180.0F, 0.0F, 0.0F, 0.0F};
  static const std::array<float, 9> dark{1.0F, 0.0F, 0.0F, 0.0F, 1.0F, 0.0F, 0.0F, 1.0F, 0.0F};
  const auto none = shape.kind == LampShape::Kind::kSky ? std::span<const float>(dark) : std::span<const float>(black);
  return {shape, web ? std::span<const float>(*web) : none};
}

std::uint64_t PunctualLights::Source::shapeKey() const {
  std::uint64_t key = static_cast<std::uint64_t>(kind);
  for (const float value :
       {position.x, position.y, position.z, direction.x, direction.y, direction.z, cone_scale, cone_offset, range}) {
    key = mixKeys(key, std::bit_cast<std::uint32_t>(value));
  }
  if (kind == Kind::kSky && web) return mixKeys(key, web_key);
  if (kind != Kind::kLamp) return key;
  key = mixKeys(mixKeys(key, web_key), static_cast<std::uint64_t>(shape.kind));
  for (const float value : {shape.axis.x, shape.axis.y, shape.axis.z, shape.across.x, shape.across.y, shape.across.z,
                            shape.half.x, shape.half.y}) {
    key = mixKeys(key, std::bit_cast<std::uint32_t>(value + 0.0F));  // -0 becomes 0
  }
  for (const float value : {shape.cone_scale, shape.cone_offset - 1.0F, shape.range})  // which most have not
    if (value != 0.0F) key = mixKeys(key, std::bit_cast<std::uint32_t>(value));
  return key;
}

PunctualLights::PunctualLights(const scene::PatchScene& patches, const LightSources& sources, PunctualSettings settings)
    : settings_(settings), box_(sceneBox(patches)), sources_(makeSources(patches, sources)) {
  const std::uint32_t wanted = pixelsForLeaves(patches, glm::length(box_[1] - box_[0]));
  settings_.point_resolution = std::max(settings_.point_resolution, std::min(wanted, kMostPointPixels));
  settings_.parallel_resolution = std::max(settings_.parallel_resolution, std::min(wanted, kMostParallelPixels));
}

PunctualLights::Source PunctualLights::makeLight(const scene::PatchScene& patches,
                                                 const scene::PunctualLight& light) const {
  if (light.kind == scene::LightKind::kDirectional) return makeSun(light.intensity, -light.direction, light.half.x);
  Source source;
  const glm::dvec3 position = (light.position - patches.centre) / patches.scale;
  source.intensity = glm::dvec3(light.intensity) / (patches.scale * patches.scale);
  source.flux_per_intensity = 4.0 * pi;
  if (light.kind == scene::LightKind::kSpot) {
    source.kind = Source::Kind::kSpot;
    source.direction = glm::normalize(glm::vec3(light.direction));
    // KHR_lights_punctual: lightAngleScale and lightAngleOffset.
    const double outer = std::cos(light.outer_cone_rad);
    const double scale = 1.0 / std::max(0.001, std::cos(light.inner_cone_rad) - outer);
    source.cone_scale = static_cast<float>(scale);
    source.cone_offset = static_cast<float>(-outer * scale);
    source.flux_per_intensity =
        coneSolidAngle(static_cast<double>(source.cone_scale), static_cast<double>(source.cone_offset));
  }
  if (hasSizeOrWeb(light)) return makeLamp(patches, light, source);
  const double range = light.range / patches.scale;
  const double largest = std::max({std::abs(position.x), std::abs(position.y), std::abs(position.z)});
  if (largest > kFarAway) {
    const glm::dvec3 towards = glm::normalize(position / largest);  // squares of 1e300 are no numbers
    const double distance = largest * glm::length(position / largest);
    const double cosine = -glm::dot(glm::dvec3(source.direction), towards);
    const double fade =
        std::clamp(cosine * static_cast<double>(source.cone_scale) + static_cast<double>(source.cone_offset), 0.0, 1.0);
    const double window = range > 0.0 ? std::clamp(1.0 - std::pow(distance / range, 4.0), 0.0, 1.0) : 1.0;
    return makeDirectional(source.intensity * (fade * fade * window / distance / distance), towards);
  }
  source.position = glm::vec3(position);
  if (range > 0.0) source.range = std::max(static_cast<float>(range), std::numeric_limits<float>::min());
  return source;
}

/// `spot`: what the light would be without a size.
PunctualLights::Source PunctualLights::makeLamp(const scene::PatchScene& patches, const scene::PunctualLight& light,
                                                const Source& spot) const {
  Source source;
  source.kind = Source::Kind::kLamp;
  source.shape = lampShape(patches, light, {spot.cone_scale, spot.cone_offset});
  const double unit2 = patches.scale * patches.scale;
  source.intensity = glm::dvec3(light.intensity) * (source.shape.isFlat() ? lampArea(light) / unit2 : 1.0 / unit2);
  if (light.web) {
    source.web = {light.web.shared(), &light.web->table};
    source.web_key = light.web->key;
  }
  source.flux_per_intensity = source.shape.kind == LampShape::Kind::kSpotDisc
                                  ? spot.flux_per_intensity
                                  : lampFlux(source.shape, light.web ? light.web->lumens : 0.0);
  const glm::dvec3 position = (light.position - patches.centre) / patches.scale;
  const double largest = std::max({std::abs(position.x), std::abs(position.y), std::abs(position.z)});
  if (largest > kFarAway) {
    const glm::dvec3 towards = glm::normalize(position / largest);
    const double distance = largest * glm::length(position / largest);
    const auto lamp = source.lamp();
    const double strength = static_cast<double>(lamp.strength(glm::vec3(-towards))) * lamp.fade(distance);
    return makeDirectional(source.intensity * (strength / distance / distance), towards);
  }
  source.position = source.shape.centre;
  source.direction = source.shape.axis;
  return source;
}

PunctualLights::Source PunctualLights::makeDirectional(const glm::dvec3& irradiance, const glm::dvec3& towards) const {
  Source source;
  source.kind = Source::Kind::kDirectional;
  source.intensity = irradiance;
  source.direction = glm::vec3(glm::normalize(towards));
  source.flux_per_intensity = boxSilhouette(box_, source.direction);
  return source;
}

/// `radius_rad`: half of the angle that its light comes from; 0: from one direction.
PunctualLights::Source PunctualLights::makeSun(const glm::dvec3& illuminance, const glm::dvec3& towards,
                                               double radius_rad) const {
  auto source = makeDirectional(illuminance, towards);
  if (radius_rad < kLeastSun) return source;
  source.kind = Source::Kind::kLamp;
  source.shape.kind = LampShape::Kind::kSun;
  source.shape.axis = source.direction;
  source.shape.half.x = static_cast<float>(std::sin(radius_rad));
  return source;
}

PunctualLights::Source PunctualLights::makeSky(const glm::vec3& radiance, float up) const {
  Source source;
  source.kind = Source::Kind::kSky;
  source.direction = glm::vec3(0.0F, up, 0.0F);
  source.intensity = glm::dvec3(radiance);
  const glm::dvec3 size(box_[1] - box_[0]);
  // The sum of pi (1 + cos) / 2 times area over the faces of the box.
  source.flux_per_intensity = pi * (size.x * size.y + size.y * size.z + size.z * size.x);
  return source;
}

std::vector<PunctualLights::Source> PunctualLights::makeSources(const scene::PatchScene& patches,
                                                                const LightSources& sources) const {
  std::vector<Source> made;
  Shapes shapes;
  const auto add = [&](Source source) {
    if (channelSum(source.intensity) <= 0.0) return;
    if (source.kind == Source::Kind::kLamp && source.flux_per_intensity <= 0.0) return;  // its web is black
    source.key = mixKeys(settings_.seed, source.shapeKey());
    if (const auto same = shapes.find(made, source)) {
      made[*same].intensity += source.intensity;  // two lights in one place shine as one
    } else {
      shapes.add(source, made.size());
      made.push_back(source);
    }
  };
  for (const auto& light : sources.lights) add(makeLight(patches, light));
  add(makeSky(sources.sky.upper, 1.0F));
  add(makeSky(sources.sky.lower, -1.0F));
  if (const auto& sun = sources.sky.sun)
    add(makeSun(glm::dvec3(sun->illuminance), sun->direction, 0.5 * sun->diameter_rad));
  for (const auto& source : pictureSources(sources.sky, box_, settings_.rays_see_sky)) add(source);
  return made;
}

void PunctualLights::setSources(const scene::PatchScene& patches, const LightSources& sources) {
  auto before = std::move(sources_);
  sources_ = makeSources(patches, sources);
  Shapes shapes;
  for (std::size_t i = 0; i < sources_.size(); ++i) shapes.add(sources_[i], i);
  for (auto& old : before) {
    if (old.sequences == 0 || channelSum(old.delivered) <= 0.0) continue;
    if (const auto same = shapes.find(sources_, old)) {
      sources_[*same].delivered = old.delivered;
      sources_[*same].sequences = old.sequences;
    } else {
      old.intensity = glm::dvec3(0.0);  // its light is to be taken back
      shapes.add(old, sources_.size());
      sources_.push_back(old);
    }
  }
}

std::array<double, 3> PunctualLights::flux() const {
  glm::dvec3 sum(0.0);
  for (const auto& source : sources_) sum += source.flux_per_intensity * source.intensity;
  return channels(sum);
}

double PunctualLights::owed(std::uint32_t rounds) const {
  double sum = 0.0;
  for (std::size_t i = next_; i < pending_.size(); ++i) {
    const auto& task = pending_[i];
    sum += 0.5 * task.source.flux_per_intensity * channelSum(task.intensity);
  }
  for (const auto& source : sources_) {
    const double fresh = static_cast<double>(rounds) - static_cast<double>(source.sequences);
    sum += source.flux_per_intensity *
           (channelSum(source.intensity - source.delivered) * source.sequences + channelSum(source.intensity) * fresh);
  }
  return sum;
}

void PunctualLights::plan(std::uint32_t rounds) {
  pending_.clear();
  next_ = 0;
  for (auto& source : sources_) {
    const glm::dvec3 difference = source.intensity - source.delivered;
    if (channelSum(difference) > 0.0) {
      for (std::uint32_t played = 0; played < source.sequences; ++played) addTasks(source, played, difference);
    }
    source.delivered = source.intensity;
    for (; source.sequences < rounds; ++source.sequences) addTasks(source, source.sequences, source.intensity);
  }
  // Dark ones have nothing more to give or to take back.
  std::erase_if(sources_, [](const Source& source) { return channelSum(source.intensity) <= 0.0; });
}

void PunctualLights::addTasks(const Source& source, std::uint32_t sequence, const glm::dvec3& intensity) {
  if (channelSum(intensity) <= 0.0) return;
  for (std::uint32_t half = 0; half < 2; ++half) pending_.push_back({source, sequence, half, intensity});
}

void PunctualLights::addPoint(const Task& task, ShotBatch& batch) const {
  const auto& source = task.source;
  const std::uint64_t key = mixKeys(source.key, task.half);
  const bool spot = source.kind == Source::Kind::kSpot;
  for (std::uint32_t image = 0; image < settings_.images; ++image) {
    const std::uint32_t index = task.sequence * settings_.images + image;
    const glm::dvec4 at = sobol4(index, key);
    PointShot shot;
    shot.half = task.half;
    shot.resolution = settings_.point_resolution;
    shot.range = source.range;
    shot.cone_scale = source.cone_scale;
    shot.cone_offset = source.cone_offset;
    shot.receivers = receiverPoints(index, mixKeys(key, 1));
    // The two hemicubes of a point light stand back to back across a random plane.
    const glm::vec3 normal = spot ? source.direction : onSphere(at.x, at.y);
    shot.frame.origin = source.position;
    shot.frame.tangent = perpendicular(normal, at.z);
    shot.frame.lattice =
        static_cast<std::uint32_t>(mixKeys(key, 2 + index) % (std::uint64_t{kLatticeSide} * kLatticeSide));
    const glm::dvec3 weighed = task.intensity / (2.0 * settings_.images);
    shot.intensity = channels(weighed);
    shot.emitted = channels(weighed * source.flux_per_intensity * (spot ? 1.0 : 0.5));
    shot.frame.normal = normal;
    batch.point_lights.push_back(shot);
    if (spot) continue;
    shot.frame.normal = -normal;
    batch.point_lights.push_back(shot);
  }
}

void PunctualLights::addLamp(const Task& task, ShotBatch& batch) const {
  const auto& source = task.source;
  const std::uint64_t key = mixKeys(source.key, task.half);
  const auto lamp = source.lamp();
  LampShot shot;
  shot.shape = lamp.shape;
  if (lamp.shape.hasTable()) {
    shot.web_size = static_cast<std::uint32_t>(lamp.web.size());
    const bool is_last = batch.webs.size() >= lamp.web.size() &&
                         std::equal(lamp.web.begin(), lamp.web.end(), batch.webs.end() - shot.web_size);
    if (!is_last) batch.webs.insert(batch.webs.end(), lamp.web.begin(), lamp.web.end());
    shot.first_web = static_cast<std::uint32_t>(batch.webs.size()) - shot.web_size;
  }
  shot.half = task.half;
  shot.key = mixKeys(key, 3);
  const glm::dvec3 weighed = task.intensity / (2.0 * settings_.images);
  shot.intensity = channels(weighed);
  shot.emitted = channels(weighed * source.flux_per_intensity);
  for (std::uint32_t image = 0; image < settings_.images; ++image) {
    const std::uint32_t index = task.sequence * settings_.images + image;
    shot.receivers = receiverPoints(index, mixKeys(key, 1));
    for (std::uint32_t p = 0; p < kMaxReceiverPoints; ++p) {
      const auto at = sobol4(index * static_cast<std::uint32_t>(kMaxReceiverPoints) + p, mixKeys(key, 2));
      shot.at[p] = glm::vec2(at.x, at.y);
    }
    batch.lamps.push_back(shot);
  }
}

void PunctualLights::addDirectional(const Task& task, ShotBatch& batch) const {
  const auto& source = task.source;
  const std::uint64_t key = mixKeys(source.key, task.half);
  for (std::uint32_t image = 0; image < settings_.images; ++image) {
    const std::uint32_t index = task.sequence * settings_.images + image;
    const glm::dvec4 at = sobol4(index, key);
    ParallelShot shot;
    shot.half = task.half;
    shot.resolution = settings_.parallel_resolution;
    shot.receivers = receiverPoints(index, mixKeys(key, 1));
    shot.first_view = static_cast<std::uint32_t>(batch.views.size());
    const glm::dvec3 weighed = task.intensity / (2.0 * settings_.images);
    shot.irradiance = channels(weighed);
    shot.emitted = channels(weighed * source.flux_per_intensity);
    batch.parallel.push_back(shot);
    batch.views.push_back(parallelView(source.direction, at.z, at.w, mixKeys(key, 2 + index)));
  }
}

void PunctualLights::addSky(const Task& task, ShotBatch& batch) const {
  const auto& source = task.source;
  const std::uint64_t key = mixKeys(source.key, task.half);
  const std::uint32_t count = settings_.sky_directions;
  const auto begin = static_cast<std::uint32_t>(batch.views.size());
  double silhouettes = 0.0;
  for (std::uint32_t i = 0; i < count; ++i) {
    const std::uint32_t index = task.sequence * count + i;
    const glm::dvec4 at = sobol4(index, key);
    const glm::vec3 direction = onSphere(0.5 + 0.5 * at.x, at.y) * glm::vec3(1.0F, source.direction.y, 1.0F);
    batch.views.push_back(parallelView(direction, at.z, at.w, mixKeys(key, 2 + index)));
    silhouettes += boxSilhouette(box_, direction);
  }
  const glm::dvec3 weighed = 0.5 * task.intensity;
  for (std::uint32_t first = 0; first < count; first += settings_.views_a_shot) {
    ParallelShot shot;
    shot.half = task.half;
    shot.resolution = settings_.sky_resolution;
    shot.axis = source.direction;
    shot.first_of_sky = begin;
    shot.sky_count = count;
    shot.first_view = begin + first;
    shot.view_count = std::min(settings_.views_a_shot, count - first);
    shot.receivers = receiverPoints(task.sequence * count + first, mixKeys(key, 1));
    shot.irradiance = channels(weighed * (2.0 * pi / count));
    double seen = 0.0;
    for (std::uint32_t i = 0; i < shot.view_count; ++i) {
      seen += boxSilhouette(box_, batch.views[shot.first_view + i].direction);
    }
    const double share = silhouettes > 0.0 ? seen / silhouettes : 0.0;
    shot.emitted = channels(weighed * (source.flux_per_intensity * share));
    batch.parallel.push_back(shot);
  }
}

void PunctualLights::addTask(const Task& task, ShotBatch& batch) const {
  if (task.source.kind == Source::Kind::kSky) {
    addSky(task, batch);
  } else if (task.source.kind == Source::Kind::kDirectional) {
    addDirectional(task, batch);
  } else if (task.source.kind == Source::Kind::kLamp) {
    addLamp(task, batch);
  } else {
    addPoint(task, batch);
  }
}

void PunctualLights::addSample(const Source& source, std::uint32_t sequence, std::uint32_t half,
                               ShotBatch& batch) const {
  addTask({source, sequence, half, glm::dvec3(1.0)}, batch);
}

void PunctualLights::addSlice(std::uint32_t rounds, ShotBatch& batch) {
  if (next_ >= pending_.size()) plan(rounds);
  const auto images = [&] { return batch.point_lights.size() + batch.views.size() + batch.lamps.size(); };
  for (; next_ < pending_.size() && images() < settings_.images_a_slice; ++next_) {
    addTask(pending_[next_], batch);
  }
}

}  // namespace radiosity::solver
