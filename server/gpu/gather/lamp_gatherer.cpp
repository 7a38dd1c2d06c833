#include "server/gpu/gather/lamp_gatherer.h"

#include <array>
#include <chrono>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "common/task.h"
#include "server/geometry/way_queue.h"
#include "server/solver/math/sampling.h"
#include "server/solver/transport/lamp_rays.h"

namespace radiosity::gpu {
namespace {

using Clock = std::chrono::steady_clock;
using Kind = solver::LampShape::Kind;

/// A point of the unit square for a receiver: neighbours look at other points of the lamp.
glm::dvec2 pointOf(const glm::vec2& at, std::uint32_t turn) {
  const auto digits = [](float number) { return static_cast<std::uint32_t>(static_cast<double>(number) * 0x1p32); };
  return {solver::turnedOver(digits(at.x), solver::kTurnU * turn),
          solver::turnedOver(digits(at.y), solver::kTurnV * turn)};
}

/// All of the surface is behind a flat lamp, or beyond its range.
bool isBeyond(const solver::LampShape& shape, const scene::Surface& surface) {
  const auto &low = surface.bounds_min, &high = surface.bounds_max;
  if (shape.isFar()) return false;
  const auto nearest = glm::clamp(shape.centre, low, high);
  if (shape.range > 0.0F && glm::distance(nearest, shape.centre) >= shape.range + shape.reach()) return true;
  if (shape.kind == Kind::kBall || shape.kind == Kind::kWeb) return false;
  const glm::vec3 farthest(shape.axis.x > 0.0F ? high.x : low.x, shape.axis.y > 0.0F ? high.y : low.y,
                           shape.axis.z > 0.0F ? high.z : low.z);
  return glm::dot(shape.axis, farthest - shape.centre) <= 0.0F;
}

/// All of the lamp is behind the plane of a triangle.
bool turnsAway(const solver::LampShape& shape, const scene::TriangleFrame& frame, float side) {
  if (shape.kind == Kind::kSky) return false;
  if (shape.kind == Kind::kSun) return side * glm::dot(frame.normal, shape.axis) <= -shape.half.x;
  return side * glm::dot(frame.normal, shape.centre - frame.origin) <= -shape.reach();
}

}  // namespace

/// Ways that are asked a packet at a time; those that are open tell the looks of their receivers.
class LampGatherer::Ways {
 public:
  Ways(const Receivers& receivers, std::vector<solver::LampLooks>& looks, std::uint64_t key)
      : receivers_(receivers), looks_(looks), key_(key), queue_(receivers.rays()) {}

  /// From a place to a point of the lamp. It ends a little before that, which may lie in the plane of a face.
  void add(const Receivers::Place& place, const glm::vec3& normal, const glm::vec3& to, const Look& look) {
    interruptionPoint();
    looks_[look.receiver].ask(look.whole, look.brings);
    const auto from = place.point + Receivers::kLift * normal, way = to - from;
    const float length = glm::length(way), open = length - 2.0F * Receivers::kLift;
    if (open <= 0.0F) return tell(look);
    queue_.add(from, open / length * way, receivers_.wayKey(key_, place.point), look,
               [this](const Look& seen) { tell(seen); });
  }
  void flush() {
    queue_.flush([this](const Look& seen) { tell(seen); });
  }

 private:
  void tell(const Look& look) { looks_[look.receiver].see(look.whole, look.brings); }

  const Receivers& receivers_;
  std::vector<solver::LampLooks>& looks_;
  std::uint64_t key_;
  geometry::WayQueue<Look> queue_;
};

/// All receivers look as often: one that is only a part of a leaf from one place, at as many points of the lamp.
void LampGatherer::lookFrom(const solver::LampShot& shot, const solver::Lamp& lamp, const Receivers::Group& group,
                            Ways& ways) {
  const auto& patches = receivers_->patches();
  const auto& surface = patches.surfaces[group.surface];
  for (std::size_t i = group.first; i < group.first + group.count; ++i) {
    const auto& receiver = receivers_->all()[i];
    const auto& frame = patches.triangles[receiver.triangle];
    if (surface.planar && turnsAway(lamp.shape, frame, group.side)) return;
    const bool is_point = lamp.shape.kind == Kind::kWeb;
    const float near_mean = is_point ? nearMean(*receivers_, receiver, frame, lamp.shape.centre) : -1.0F;
    const auto turn = Receivers::turnOf(receiver.texel);
    for (std::uint32_t p = 0; p < shot.receivers.count; ++p) {
      const auto place = receivers_->place(receiver, shot.receivers.at[p]);
      const auto normal = group.side * place.frame->normal;
      const glm::dvec3 at(place.point), upright(normal);
      auto point = solver::lampPoint(lamp, at, upright, pointOf(shot.at[p], turn));
      if (near_mean >= 0.0F && point.brings > 0.0) {
        const auto way = glm::normalize(place.point - lamp.shape.centre);
        point.brings = static_cast<double>(near_mean * lamp.strength(way));
      }
      const auto brings = static_cast<float>(point.brings);
      const float whole =
          lamp.shape.hasClosedForm() ? static_cast<float>(solver::wholeIrradiance(lamp, at, upright)) : brings;
      if (brings > 0.0F) {
        ways.add(place, normal, glm::vec3(point.position), {i, whole, brings});
      } else if (whole > 0.0F) {
        looks_[i].pass(whole);
      }
    }
  }
}

void LampGatherer::gather(const solver::LampShot& shot, std::span<const float> webs, double flux_scale,
                          const FluxSink& sink, solver::TransportCounters& counters) {
  const auto start = Clock::now();
  const solver::Lamp lamp{shot.shape, webs.subspan(shot.first_web, shot.web_size)};
  looks_.assign(receivers_->all().size(), {});
  Ways ways(*receivers_, looks_, solver::mixKeys(shot.key, Receivers::placeKey({shot.at[0], 0.0F})));
  for (const auto& group : receivers_->groups())
    if (!isBeyond(shot.shape, receivers_->patches().surfaces[group.surface])) lookFrom(shot, lamp, group, ways);
  ways.flush();
  irradiance_.clear();
  for (const auto& looks : looks_) irradiance_.push_back(looks.irradiance(shot.receivers.count));
  deliverLight(*receivers_, irradiance_, {shot.intensity, shot.emitted, shot.half}, loseByRays(shot, lamp), flux_scale,
               sink, counters);
  ++counters.point_images;  // a look is counted as one, whichever way
  counters.gather_seconds += std::chrono::duration<double>(Clock::now() - start).count();
}

/// Rays spread evenly over a disk around the box, which the light of each direction crosses.
LostShare LampGatherer::loseFromFar(const solver::LampShot& shot, const solver::Lamp& lamp, std::uint64_t key) const {
  const solver::Sobol4 draws(key);
  const auto centre = 0.5F * (box_[0] + box_[1]);
  const float radius = 0.5F * glm::distance(box_[0], box_[1]);
  const auto rayOf = [&](std::uint32_t index) -> LostRay {
    const auto draw = draws(index);
    const auto towards = solver::lampRay(lamp, {draw.x, draw.y, 0.0, 0.0}).origin;
    const auto across = glm::normalize(
        glm::cross(towards, std::abs(towards.x) < 0.6F ? glm::vec3(1.0F, 0.0F, 0.0F) : glm::vec3(0.0F, 1.0F, 0.0F)));
    const float far = radius * std::sqrt(static_cast<float>(draw.z));
    const auto angle = static_cast<float>(2.0 * std::numbers::pi * draw.w);
    const auto aside = far * (std::cos(angle) * across + std::sin(angle) * glm::cross(towards, across));
    return {{centre + aside + 1.1F * radius * towards, -towards, Receivers::kFar}, 1.0};
  };
  const auto rays = lostByRays(*receivers_, key, rayOf, [](float) { return 1.0; });
  const double ray_area = std::numbers::pi * static_cast<double>(radius * radius) / rays.all;
  std::size_t channel = 0;
  for (std::size_t c = 1; c < 3; ++c)
    if (std::abs(shot.intensity[c]) > std::abs(shot.intensity[channel])) channel = c;
  LostShare lost;
  lost.all = shot.intensity[channel] != 0.0 ? shot.emitted[channel] / shot.intensity[channel] : 0.0;
  lost.escaped = lost.all - (rays.all - rays.escaped) * ray_area;
  lost.absorbed = rays.absorbed * ray_area;
  return lost;
}

LostShare LampGatherer::loseByRays(const solver::LampShot& shot, const solver::Lamp& lamp) {
  const auto key = solver::mixKeys(shot.key, Receivers::placeKey({shot.at[0], 1.0F}));
  if (lamp.shape.isFar()) return loseFromFar(shot, lamp, key);
  const solver::Sobol4 draws(key);
  const auto middle = 0.5F * (box_[0] + box_[1]);
  const float reach = glm::distance(lamp.shape.centre, middle) + glm::distance(box_[0], box_[1]) + lamp.shape.reach();
  const solver::LampRays leaving(lamp, webs_);
  const auto rayOf = [&](std::uint32_t index) -> LostRay {
    const auto draw = draws(index);
    const auto ray = leaving({draw.x, draw.y, draw.z, draw.w});
    return {{ray.origin + 2.0F * Receivers::kLift * ray.direction, ray.direction, reach}, ray.weight};
  };
  return lostByRays(*receivers_, key, rayOf, [&](float length) { return lamp.fade(static_cast<double>(length)); });
}

}  // namespace radiosity::gpu
