#include "server/gpu/gather/lamp_gatherer.h"

#include <array>
#include <chrono>
#include <cmath>
#include <glm/geometric.hpp>

#include "common/task.h"
#include "server/geometry/way_queue.h"
#include "server/solver/math/sampling.h"

namespace radiosity::gpu {
namespace {

using Clock = std::chrono::steady_clock;
using Kind = solver::LampShape::Kind;

/// So many rays find out what of a lamp is lost.
constexpr std::uint32_t kLostRays = 16384;

/// A point of the unit square, turned around by a receiver's own number: neighbours look at other points of the lamp.
glm::dvec2 turned(const glm::vec2& at, std::uint64_t key) {
  const glm::dvec2 sum = glm::dvec2(at) + glm::dvec2(solver::uniformFromKey(key), solver::uniformFromKey(~key));
  return sum - glm::floor(sum);
}

/// All of the surface is behind a flat lamp, or beyond its range.
bool isBeyond(const solver::LampShape& shape, const scene::Surface& surface) {
  const auto &low = surface.bounds_min, &high = surface.bounds_max;
  const auto nearest = glm::clamp(shape.centre, low, high);
  if (shape.range > 0.0F && glm::distance(nearest, shape.centre) >= shape.range + shape.reach()) return true;
  if (shape.kind == Kind::kBall || shape.kind == Kind::kWeb) return false;
  const glm::vec3 farthest(shape.axis.x > 0.0F ? high.x : low.x, shape.axis.y > 0.0F ? high.y : low.y,
                           shape.axis.z > 0.0F ? high.z : low.z);
  return glm::dot(shape.axis, farthest - shape.centre) <= 0.0F;
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
    const float before = group.side * glm::dot(frame.normal, lamp.shape.centre - frame.origin);
    if (surface.planar && before <= -lamp.shape.reach()) return;  // all turns away
    const bool is_point = lamp.shape.kind == Kind::kWeb;
    const float near_mean = is_point ? nearMean(*receivers_, receiver, frame, lamp.shape.centre) : -1.0F;
    const auto key = solver::mixKeys(shot.key, receiver.node);
    for (std::uint32_t p = 0; p < shot.receivers.count; ++p) {
      const auto place = receivers_->place(receiver, shot.receivers.at[p]);
      const auto normal = group.side * place.frame->normal;
      const glm::dvec3 at(place.point), upright(normal);
      auto point = solver::lampPoint(lamp, at, upright, turned(shot.at[p], key));
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

LostShare LampGatherer::loseByRays(const solver::LampShot& shot, const solver::Lamp& lamp) const {
  const auto key = solver::mixKeys(shot.key, Receivers::placeKey({shot.at[0], 1.0F}));
  const solver::Sobol4 draws(key);
  const auto middle = 0.5F * (box_[0] + box_[1]);
  const float reach = glm::distance(lamp.shape.centre, middle) + glm::distance(box_[0], box_[1]) + lamp.shape.reach();
  LostShare lost;
  for (std::uint32_t first = 0; first < kLostRays; first += geometry::kPacket) {
    interruptionPoint();
    std::array<geometry::Ray, geometry::kPacket> rays;
    std::array<double, geometry::kPacket> weights;
    std::array<geometry::Hit, geometry::kPacket> hits;
    for (std::uint32_t i = 0; i < geometry::kPacket; ++i) {
      const auto draw = draws(first + i);
      const auto ray = solver::lampRay(lamp, {draw.x, draw.y, draw.z, draw.w});
      rays[i] = {ray.origin + 2.0F * Receivers::kLift * ray.direction, ray.direction, reach};
      weights[i] = ray.weight;
    }
    receivers_->nearest(rays, solver::mixKeys(key, first), hits);
    for (std::size_t i = 0; i < hits.size(); ++i) {
      lost.all += weights[i];
      const double reached = hits[i].found() ? weights[i] * lamp.fade(static_cast<double>(hits[i].t)) : 0.0;
      lost.escaped += weights[i] - reached;  // what fades on its way arrives nowhere
      if (hits[i].found() && receivers_->absorbs(rays[i], hits[i])) lost.absorbed += reached;
    }
  }
  return lost;
}

}  // namespace radiosity::gpu
