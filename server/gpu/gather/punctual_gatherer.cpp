#include "server/gpu/gather/punctual_gatherer.h"

#include <algorithm>
#include <bit>
#include <chrono>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "common/task.h"
#include "server/geometry/way_queue.h"
#include "server/gpu/cull/hemicube_views.h"
#include "server/solver/math/sampling.h"

namespace radiosity::gpu {
namespace {

using Clock = std::chrono::steady_clock;

/// So many rays find out what of a light is lost, and of one of the many directions of a sky.
constexpr std::uint32_t kLostRaysOfSky = 1024;

/// Cone falloff of KHR_lights_punctual. `cosine`: of the angle from the axis.
float coneFalloff(const solver::PointShot& shot, float cosine) {
  const float value = std::clamp(cosine * shot.cone_scale + shot.cone_offset, 0.0F, 1.0F);
  return value * value;
}

/// KHR_lights_punctual: max(min(1 - (distance / range)^4, 1), 0).
float rangeFade(const solver::PointShot& shot, float distance) {
  if (shot.range <= 0.0F) return 1.0F;
  const float square = distance * distance / (shot.range * shot.range);
  return std::clamp(1.0F - square * square, 0.0F, 1.0F);
}

/// Where a receiver lies in a picture of `columns` x `rows` pixels: at (x, y), where pixel i reaches from i to i + 1.
struct PixelPlace {
  const std::uint32_t* picture;
  int columns, rows;
  float x, y;

  [[nodiscard]] std::uint32_t item(float px, float py) const {
    const int column = std::clamp(static_cast<int>(px), 0, columns - 1);
    const int row = std::clamp(static_cast<int>(py), 0, rows - 1);
    return picture[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
                   static_cast<std::size_t>(column)];
  }
};

/// The receiver's own pixel decides where the four whose samples lie around it show the same. Elsewhere, if all sixteen
/// around those hide the light, or none does, so does the receiver's, or it does not; where they differ the ray tells:
/// pixels blur the edge of a shadow alike to both sides, but to ask only facets wide enough for them to show takes back
/// what they lose beside these, not what they darken, and shadows of dense meshes on what is wide grow. Partial opacity
/// is by the pixel, right in the mean. Of a surface with two sides one may be the inside of a wall thinner than a
/// pixel: there all is asked, too, where pixels do not show it.
bool isHidden(const Receivers& receivers, const PixelPlace& place, const Receivers::Ray& ray, bool two_sided) {
  const float left = std::floor(place.x - 0.5F), below = std::floor(place.y - 0.5F);
  const auto own = place.item(place.x, place.y);
  const auto around = [&](int x, int y) {
    return place.item(left + static_cast<float>(x), below + static_cast<float>(y));
  };
  bool edge = own == RAD_ITEM_NONE;
  for (int i = 0; i < 4; ++i) edge = edge || around(i % 2, i / 2) != own;
  const bool hidden = receivers.hides(own, ray);
  if (!edge) return hidden || (two_sided && receivers.liesApart(own, ray) && receivers.isBlocked(ray));
  std::array<std::uint32_t, 16> wider{};
  for (int i = 0; i < 16; ++i) wider[static_cast<std::size_t>(i)] = around(i % 4 - 1, i / 4 - 1);
  const auto alike = [&](std::uint32_t item) { return item == own || receivers.hides(item, ray) == hidden; };
  const bool see_through = std::ranges::any_of(wider, [&](auto item) { return receivers.isSeeThrough(item); });
  if (!see_through && (hidden || !two_sided) && std::ranges::all_of(wider, alike)) return hidden;
  if (receivers.isBlocked(ray) || receivers.anyMeets(wider, ray)) return true;
  return receivers.isSeeThrough(own) && receivers.hidesAtEdge(own, ray);
}

/// A hemicube's image, looked up by direction in the axes of the hemicube (the cells of hemicube_weights.h).
struct HemicubeItems {
  std::span<const std::uint32_t> items;
  int size;
  float shift_x, shift_y;

  HemicubeItems(std::span<const std::uint32_t> image, std::uint32_t resolution, std::uint32_t lattice)
      : items(image), size(static_cast<int>(resolution)) {
    const auto [across, up] = latticePhase(lattice);
    shift_x = static_cast<float>(0.5 - across);
    shift_y = static_cast<float>(0.5 - up);
  }

  [[nodiscard]] PixelPlace at(const glm::vec3& l) const {
    const float ax = std::abs(l.x), ay = std::abs(l.y), side = std::max(ax, ay);
    const bool top = l.z >= side, along_x = ax >= ay;
    const float depth = std::max(std::max(l.z, side), 1.0e-9F);
    const float scale = static_cast<float>(size) / 2.0F / depth;
    const float across = top || !along_x ? l.x : l.y;
    const float up = top ? l.y + depth : l.z;
    const int face = along_x ? (l.x > 0.0F ? 0 : 1) : (l.y > 0.0F ? 2 : 3);
    const int first_row = top ? 0 : size + face * size / 2;
    return {items.data() + static_cast<std::size_t>(first_row) * static_cast<std::size_t>(size), size,
            top ? size : size / 2, (across + depth) * scale + shift_x, up * scale + shift_y};
  }
};

/// A key of what is drawn anew for each look.
std::uint64_t lookOf(const glm::vec3& turn, float shift, std::uint32_t half) {
  return solver::mixKeys(solver::mixKeys(Receivers::placeKey(turn), std::bit_cast<std::uint32_t>(shift)), half);
}

/// The corner of the box that lies farthest along a direction.
glm::vec3 farthest(const scene::Surface& surface, const glm::vec3& d) {
  const auto &low = surface.bounds_min, &high = surface.bounds_max;
  return {d.x > 0.0F ? high.x : low.x, d.y > 0.0F ? high.y : low.y, d.z > 0.0F ? high.z : low.z};
}

bool beyondRange(const solver::PointShot& shot, const scene::Surface& surface) {
  if (shot.range <= 0.0F) return false;
  const auto nearest = glm::clamp(shot.frame.origin, surface.bounds_min, surface.bounds_max);
  return glm::distance(nearest, shot.frame.origin) >= shot.range;
}

}  // namespace

template <typename Take>
void PunctualGatherer::arriveAtGroup(const solver::PointShot& shot, const Receivers::Group& group,
                                     const Take& take) const {
  const auto& patches = receivers_->patches();
  const auto& surface = patches.surfaces[group.surface];
  const auto& o = shot.frame.origin;
  for (std::size_t i = group.first; i < group.first + group.count; ++i) {
    const auto& receiver = receivers_->all()[i];
    const auto& frame = patches.triangles[receiver.triangle];
    if (surface.planar && group.side * glm::dot(frame.normal, o - frame.origin) <= 0.0F) return;  // all turns away
    const float near_mean = nearMean(*receivers_, receiver, frame, o);
    const std::uint32_t count = (receiver.full || receiver.hasSpots()) ? shot.receivers.count : 1;
    for (std::uint32_t p = 0; p < count; ++p) {
      const auto [at, place] = receivers_->place(receiver, shot.receivers.at[p]);
      const auto normal = group.side * place->normal;
      const auto d = at - o;
      const float square = glm::dot(d, d), distance = std::sqrt(square), cosine = -glm::dot(d, normal) / distance;
      const float before = glm::dot(d, shot.frame.normal);
      if (before <= 0.0F || cosine <= 0.0F) continue;
      const float strength = coneFalloff(shot, before / distance) * rangeFade(shot, distance);
      if (strength <= 0.0F) continue;
      const float pixel_size = 2.0F * distance / static_cast<float>(shot.resolution);
      const float value = strength * (near_mean >= 0.0F ? near_mean : cosine / square);
      take(Arrival{
          i, value / static_cast<float>(count), {at, normal, -d, 1.0F, pixel_size}, receivers_->careOf(receiver)});
    }
  }
}

template <typename Take>
void PunctualGatherer::forEachArrival(const solver::PointShot& shot, const Take& take) const {
  for (const auto& group : receivers_->groups()) {
    const auto& surface = receivers_->patches().surfaces[group.surface];
    const bool behind = glm::dot(shot.frame.normal, farthest(surface, shot.frame.normal) - shot.frame.origin) <= 0.0F;
    if (!behind && !beyondRange(shot, surface)) arriveAtGroup(shot, group, take);
  }
}

/// Every pixel stands for its solid angle, (2 / N)^2 / (1 + u^2 + v^2)^(3/2), at (u, v) on its face of the cube.
LostShare PunctualGatherer::weighLost(const solver::PointShot& shot, std::span<const std::uint32_t> items) const {
  LostShare lost;
  const auto [o, t, b, n] = hemicubeAxes(shot.frame);
  const auto [across, up] = latticePhase(shot.frame.lattice);
  const auto size = shot.resolution;
  const double half = size / 2.0;
  const std::array<std::array<glm::vec3, 2>, RAD_FACES> axes{
      {{n, t}, {t, b}, {-t, b}, {b, t}, {-b, t}}};  // depth, across
  for (std::uint32_t row = 0; row < 3 * size; ++row) {
    const auto face = row < size ? 0 : 1 + (row - size) / (size / 2);
    const auto face_row = face == 0 ? row : (row - size) % (size / 2);
    const double v = (face_row + up) / half - (face == 0 ? 1.0 : 0.0);
    for (std::uint32_t column = 0; column < size; ++column) {
      const double u = (column + across) / half - 1.0;
      const double length = std::sqrt(1.0 + u * u + v * v);
      const double cosine = (face == 0 ? 1.0 : v) / length;
      const double weight =
          static_cast<double>(coneFalloff(shot, static_cast<float>(cosine))) / (length * length * length);
      if (weight <= 0.0) continue;
      lost.all += weight;
      const auto item = items[std::size_t{row} * size + column];
      if (item == RAD_ITEM_NONE) {
        lost.escaped += weight;
        continue;
      }
      const auto& plane = receivers_->plane(item);
      const float height = plane.height(o);
      double reached = weight;
      if (shot.range > 0.0F) {
        const auto d =
            axes[face][0] + static_cast<float>(u) * axes[face][1] + static_cast<float>(v) * (face == 0 ? b : n);
        const float towards = std::max(std::abs(glm::dot(d, plane.normal)), 1.0e-9F);
        const float distance = std::abs(height) / towards * static_cast<float>(length);
        reached = weight * static_cast<double>(rangeFade(shot, distance));
        lost.escaped += weight - reached;  // what fades on its way arrives nowhere
      }
      if (receivers_->absorbs(item, height <= 0.0F)) lost.absorbed += reached;
    }
  }
  return lost;
}

void PunctualGatherer::gather(const solver::PointShot& shot, double flux_scale, ImageSource& source,
                              const FluxSink& sink, solver::TransportCounters& counters) {
  const auto start = Clock::now();
  const double waited_before = source.seconds();
  const HemicubeView view{shot.frame, 0.0F};
  const auto items = source.hemicubes(HemicubePass::kItems, shot.resolution, std::span(&view, 1), counters);
  sum_.assign(receivers_->all().size(), 0.0F);
  const auto axes = hemicubeAxes(shot.frame);
  const HemicubeItems image(items, shot.resolution, shot.frame.lattice);
  forEachArrival(shot, [&](const Arrival& arrival) {
    const auto d = -arrival.ray.way;
    const glm::vec3 local(glm::dot(d, axes.tangent), glm::dot(d, axes.bitangent), glm::dot(d, axes.normal));
    const bool two_sided = (arrival.care & Receivers::kTwoSided) != 0;
    if (!isHidden(*receivers_, image.at(local), arrival.ray, two_sided)) sum_[arrival.receiver] += arrival.value;
  });
  deliverLight(*receivers_, sum_, {shot.intensity, shot.emitted, shot.half}, weighLost(shot, items), flux_scale, sink,
               counters);
  ++counters.point_images;
  counters.gather_seconds +=
      std::chrono::duration<double>(Clock::now() - start).count() - (source.seconds() - waited_before);
}

template <typename Take>
void PunctualGatherer::forEachArrival(const solver::ParallelShot& shot, const solver::ParallelView& view,
                                      std::size_t view_index, const Take& take) const {
  const auto& patches = receivers_->patches();
  const bool sky = shot.sky_count > 0;  // one point for each direction, all for a single one
  const auto sky_point = static_cast<std::uint32_t>(view_index) % shot.receivers.count;
  for (const auto& group : receivers_->groups()) {
    const bool planar = patches.surfaces[group.surface].planar;
    for (std::size_t i = group.first; i < group.first + group.count; ++i) {
      const auto& receiver = receivers_->all()[i];
      if (planar && group.side * glm::dot(patches.triangles[receiver.triangle].normal, view.direction) <= 0.0F) break;
      const std::uint32_t first = sky ? sky_point : 0;
      const std::uint32_t count = sky || !(receiver.full || receiver.hasSpots()) ? 1 : shot.receivers.count;
      for (std::uint32_t p = first; p < first + count; ++p) {
        const auto [at, frame] = receivers_->place(receiver, shot.receivers.at[p]);
        const auto normal = group.side * frame->normal;
        const float cosine = glm::dot(normal, view.direction);
        if (cosine <= 0.0F) continue;
        take(Arrival{i,
                     cosine / static_cast<float>(count),
                     {at, normal, view.direction, Receivers::kFar, 0.0F},
                     receivers_->careOf(receiver)});
      }
    }
  }
}

LostShare PunctualGatherer::weighLost(const solver::ParallelView& view, double pixel_area,
                                      std::span<const std::uint32_t> items) const {
  std::size_t hit = 0, absorbed = 0;
  for (const auto item : items) {
    if (item == RAD_ITEM_NONE) continue;
    ++hit;
    if (receivers_->absorbs(item, glm::dot(receivers_->plane(item).normal, view.direction) <= 0.0F)) ++absorbed;
  }
  LostShare lost;
  lost.all = solver::boxSilhouette(box_, view.direction);
  lost.escaped = lost.all - static_cast<double>(hit) * pixel_area;
  lost.absorbed = static_cast<double>(absorbed) * pixel_area;
  return lost;
}

/// Of one receiver: what the whole hemisphere gives where it is looked at, to what the directions give that stand for
/// it. Bounded: what all but turns away from the hemisphere sees too few of its directions.
float PunctualGatherer::skyScale(std::span<const glm::vec3> normals, const glm::vec3& axis,
                                 std::span<const solver::ParallelView> sky) {
  double found = 0.0, exact = 0.0;
  for (const auto& normal : normals) {
    for (const auto& view : sky) found += static_cast<double>(std::max(0.0F, glm::dot(normal, view.direction)));
    exact += 0.5 * std::numbers::pi * (1.0 + static_cast<double>(glm::dot(normal, axis)));
  }
  found *= 2.0 * std::numbers::pi / static_cast<double>(sky.size());
  return found > 0.0 ? static_cast<float>(std::clamp(exact / found, 0.5, 2.0)) : 1.0F;
}

void PunctualGatherer::scaleToSky(const solver::ParallelShot& shot, std::span<const solver::ParallelView> sky) {
  std::vector<glm::vec3> normals, scaled;  // `scaled`: those that `scale` is of
  float scale = 1.0F;
  for (const auto& group : receivers_->groups()) {
    for (std::size_t i = group.first; i < group.first + group.count; ++i) {
      if (sum_[i] <= 0.0F) continue;
      const auto& receiver = receivers_->all()[i];
      // A leaf may have places on several triangles, each with a sky of its own.
      normals.clear();
      for (std::uint32_t p = 0; p < (receiver.hasSpots() ? shot.receivers.count : 1); ++p) {
        normals.push_back(group.side * receivers_->place(receiver, shot.receivers.at[p]).frame->normal);
      }
      if (std::equal(normals.begin() + 1, normals.end(), normals.begin())) normals.resize(1);
      if (normals != scaled) {
        scaled = normals;
        scale = skyScale(normals, shot.axis, sky);
      }
      sum_[i] *= scale;
    }
  }
}

void PunctualGatherer::gather(const solver::ParallelShot& shot, std::span<const solver::ParallelView> views,
                              double flux_scale, ImageSource& source, const FluxSink& sink,
                              solver::TransportCounters& counters) {
  const auto start = Clock::now();
  const double waited_before = source.seconds();
  const auto mine = views.subspan(shot.first_view, shot.view_count);
  const auto pixels = std::size_t{shot.resolution} * shot.resolution;
  const auto capacity = source.parallelCapacity(shot.resolution);
  sum_.assign(receivers_->all().size(), 0.0F);
  LostShare lost;
  for (std::size_t first = 0; first < mine.size(); first += capacity) {
    const auto some = mine.subspan(first, std::min(capacity, mine.size() - first));
    const auto images = source.parallel(shot.resolution, some, counters);
    for (std::size_t i = 0; i < some.size(); ++i) {
      interruptionPoint();
      const auto items = images.subspan(i * pixels, pixels);
      const auto axes = source.axes(some[i], shot.resolution);
      const auto size = static_cast<int>(shot.resolution);
      const auto pixel_size = static_cast<float>(std::sqrt(axes.pixel_area));
      forEachArrival(shot, some[i], first + i, [&](const Arrival& arrival) {
        const auto d = arrival.ray.at - axes.centre;
        const PixelPlace place{items.data(), size, size, glm::dot(axes.right, d) + axes.shift.x,
                               glm::dot(axes.up, d) + axes.shift.y};
        auto ray = arrival.ray;
        ray.pixel_size = pixel_size;
        const bool two_sided = (arrival.care & Receivers::kTwoSided) != 0;
        if (!isHidden(*receivers_, place, ray, two_sided)) sum_[arrival.receiver] += arrival.value;
      });
      lost += weighLost(some[i], axes.pixel_area, items);
    }
  }
  if (shot.sky_count > 0) scaleToSky(shot, views.subspan(shot.first_of_sky, shot.sky_count));
  deliverLight(*receivers_, sum_, {shot.irradiance, shot.emitted, shot.half}, lost, flux_scale, sink, counters);
  counters.parallel_images += mine.size();
  counters.gather_seconds +=
      std::chrono::duration<double>(Clock::now() - start).count() - (source.seconds() - waited_before);
}

/// `look`: the same for no two looks, so that what one can see through lets each pass by a chance of its own. Ways end
/// a little before the light, which may lie in the plane of a face.
template <typename Each>
void PunctualGatherer::askRays(std::uint64_t look, const Each& each) {
  struct Asked {
    std::size_t receiver = 0;
    float value = 0.0F;
  };
  geometry::WayQueue<Asked> ways(receivers_->rays());
  const auto tell = [this](const Asked& asked) { sum_[asked.receiver] += asked.value; };
  each([&](const Arrival& arrival) {
    interruptionPoint();
    const auto& ray = arrival.ray;
    const auto from = ray.at + Receivers::kLift * ray.normal;
    const auto way = ray.at + ray.reach * ray.way - from;
    const float length = glm::length(way), open = length - 2.0F * Receivers::kLift;
    if (open <= 0.0F) return tell({arrival.receiver, arrival.value});
    ways.add(from, open / length * way, receivers_->wayKey(look, ray.at), {arrival.receiver, arrival.value}, tell);
  });
  ways.flush(tell);
}

void PunctualGatherer::gather(const solver::PointShot& shot, double flux_scale, const FluxSink& sink,
                              solver::TransportCounters& counters) {
  const auto start = Clock::now();
  sum_.assign(receivers_->all().size(), 0.0F);
  askRays(lookOf(shot.frame.tangent, static_cast<float>(shot.frame.lattice), shot.half),
          [&](const auto& take) { forEachArrival(shot, take); });
  deliverLight(*receivers_, sum_, {shot.intensity, shot.emitted, shot.half}, loseByRays(shot), flux_scale, sink,
               counters);
  ++counters.point_images;  // a look is counted as one, whichever way
  counters.gather_seconds += std::chrono::duration<double>(Clock::now() - start).count();
}

void PunctualGatherer::gather(const solver::ParallelShot& shot, std::span<const solver::ParallelView> views,
                              double flux_scale, const FluxSink& sink, solver::TransportCounters& counters) {
  const auto start = Clock::now();
  const auto mine = views.subspan(shot.first_view, shot.view_count);
  sum_.assign(receivers_->all().size(), 0.0F);
  LostShare lost;
  for (std::size_t i = 0; i < mine.size(); ++i) {
    askRays(lookOf(mine[i].right, mine[i].shift.x, shot.half),
            [&](const auto& take) { forEachArrival(shot, mine[i], i, take); });
    lost += loseByRays(mine[i], shot.sky_count > 0 ? kLostRaysOfSky : kLostRays);
  }
  if (shot.sky_count > 0) scaleToSky(shot, views.subspan(shot.first_of_sky, shot.sky_count));
  deliverLight(*receivers_, sum_, {shot.irradiance, shot.emitted, shot.half}, lost, flux_scale, sink, counters);
  counters.parallel_images += mine.size();
  counters.gather_seconds += std::chrono::duration<double>(Clock::now() - start).count();
}

/// Rays spread evenly over the solid angle into which the light shines.
LostShare PunctualGatherer::loseByRays(const solver::PointShot& shot) const {
  const auto axes = hemicubeAxes(shot.frame);
  const auto o = axes.origin, t = axes.tangent, b = axes.bitangent, n = axes.normal;  // lambdas take no bindings
  const float least = shot.cone_scale > 0.0F ? std::clamp(-shot.cone_offset / shot.cone_scale, 0.0F, 1.0F) : 0.0F;
  const auto key = lookOf(shot.frame.tangent, static_cast<float>(shot.frame.lattice), shot.half);
  const solver::Sobol4 draws(key);
  const float reach = glm::distance(o, 0.5F * (box_[0] + box_[1])) + glm::distance(box_[0], box_[1]);
  const auto rayOf = [&](std::uint32_t index) -> LostRay {
    const auto draw = draws(index);
    const auto cosine = 1.0F - static_cast<float>(draw.x) * (1.0F - least);
    const float sine = std::sqrt(std::max(0.0F, 1.0F - cosine * cosine));
    const auto angle = static_cast<float>(2.0 * std::numbers::pi * draw.y);
    const auto direction = cosine * n + sine * (std::cos(angle) * t + std::sin(angle) * b);
    return {{o, direction, reach}, static_cast<double>(coneFalloff(shot, cosine))};
  };
  return lostByRays(*receivers_, key, rayOf,
                    [&](float length) { return static_cast<double>(rangeFade(shot, length)); });
}

/// Rays spread evenly over a disk around the box, which the light crosses.
LostShare PunctualGatherer::loseByRays(const solver::ParallelView& view, std::uint32_t count) const {
  const auto centre = 0.5F * (box_[0] + box_[1]);
  const float radius = 0.5F * glm::distance(box_[0], box_[1]);
  const auto up = glm::cross(view.direction, view.right);
  const auto key = lookOf(view.right, view.shift.x, 0);
  const solver::Sobol4 draws(key);
  std::size_t hit = 0, absorbed = 0;
  for (std::uint32_t first = 0; first < count; first += geometry::kPacket) {
    interruptionPoint();
    std::array<geometry::Ray, geometry::kPacket> rays;
    std::array<geometry::Hit, geometry::kPacket> hits;
    for (std::uint32_t i = 0; i < geometry::kPacket; ++i) {
      const auto draw = draws(first + i);
      const auto far = radius * static_cast<float>(std::sqrt(draw.x));
      const auto angle = static_cast<float>(2.0 * std::numbers::pi * draw.y);
      const auto across = far * (std::cos(angle) * view.right + std::sin(angle) * up);
      rays[i] = {centre + across + 1.1F * radius * view.direction, -view.direction, Receivers::kFar};
    }
    receivers_->nearest(rays, solver::mixKeys(key, first), hits);
    for (std::size_t i = 0; i < hits.size(); ++i) {
      hit += hits[i].found() ? 1 : 0;
      absorbed += hits[i].found() && receivers_->absorbs(rays[i], hits[i]) ? 1 : 0;
    }
  }
  const double ray_area = std::numbers::pi * static_cast<double>(radius * radius) / count;
  LostShare lost;
  lost.all = solver::boxSilhouette(box_, view.direction);
  lost.escaped = lost.all - static_cast<double>(hit) * ray_area;
  lost.absorbed = static_cast<double>(absorbed) * ray_area;
  return lost;
}

}  // namespace radiosity::gpu
