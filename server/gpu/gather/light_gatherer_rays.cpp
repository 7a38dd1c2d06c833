// What rays tell LightGatherer: which receivers a point on the light sees, and what of its light is lost.
#include <array>
#include <cmath>

#include "common/clones.h"
#include "common/task.h"
#include "server/geometry/way_queue.h"
#include "server/gpu/gather/light_gatherer.h"
#include "server/solver/math/sampling.h"
#include "server/solver/rays/leaf_rays.h"

namespace radiosity::gpu {
namespace {

/// From each point so many rays find out whether some of its light is lost, and so many how much: with 64 of them the
/// light of the Cornell box, of which a quarter leaves by its open side, is 0.6 % off. What is lost by less than a part
/// in the first number is missed in part, a seventh of a hundredth of the light at most.
constexpr std::uint32_t kFirstRays = 256, kAllRays = 1024;
static_assert(kFirstRays % geometry::kPacket == 0 && kAllRays % geometry::kPacket == 0);
static_assert(solver::kWeightOne % kFirstRays == 0 && solver::kWeightOne % kAllRays == 0);

/// cos cos / r^2 for every receiver; 0 of what lies behind the light. Branch-free, so that it vectorises.
RADIOSITY_CLONES void weighReceivers(const glm::vec3& o, const glm::vec3& n, std::size_t count, const float* x,
                                     const float* y, const float* z, const float* nx, const float* ny, const float* nz,
                                     float* weight) {
  for (std::size_t i = 0; i < count; ++i) {
    const float dx = x[i] - o.x, dy = y[i] - o.y, dz = z[i] - o.z;
    const float leaves = std::max(0.0F, dx * n.x + dy * n.y + dz * n.z);
    const float arrives = std::max(0.0F, -(dx * nx[i] + dy * ny[i] + dz * nz[i]));
    const float square = dx * dx + dy * dy + dz * dz;
    weight[i] = leaves * arrives / (square * square);
  }
}

}  // namespace

void LightGatherer::look(const solver::GatherShot& shot, const solver::HemicubeFrame& point) {
  askRays(shot, point, 0);
  const auto before = look_lost_;
  loseByRays(point, look_lost_);
  if (look_lost_ != before) open_looks_.add(look_count_);
  ++look_count_;
}

void LightGatherer::askRays(const solver::GatherShot& shot, const solver::HemicubeFrame& point, std::size_t half) {
  weighReceivers(point.origin, point.normal, lit_count_, lit_.x.data(), lit_.y.data(), lit_.z.data(), lit_.nx.data(),
                 lit_.ny.data(), lit_.nz.data(), lit_.point_weight.data());
  const glm::vec3 light = point.origin + Receivers::kLift * point.normal;
  const auto look = receivers_->placeKey(point.origin);
  float* weight = lit_.weight[half].data();
  float* visible_weight = lit_.visible_weight[half].data();
  geometry::WayQueue<std::uint32_t> ways(receivers_->rays());
  const auto tell = [&](std::uint32_t i) { visible_weight[i] += lit_.point_weight[i]; };
  for (std::uint32_t i = 0; i < lit_count_; ++i) {
    if (lit_.point_weight[i] <= 0.0F) continue;
    interruptionPoint();
    weight[i] += lit_.point_weight[i];
    const glm::vec3 at(lit_.x[i], lit_.y[i], lit_.z[i]), normal(lit_.nx[i], lit_.ny[i], lit_.nz[i]);
    const auto from = at + Receivers::kLift * normal;
    ways.add(from, light - from, receivers_->wayKey(look, at), i, tell);
  }
  ways.flush(tell);
  lookFromEdges(shot, point, half);
}

/// The same rays from the same point, whenever: what is lost there changes only where the scene does.
void LightGatherer::loseByRays(const solver::HemicubeFrame& point, Lost& lost) const {
  const auto key = receivers_->placeKey(point.origin);
  const solver::Sobol4 draws(key);
  const glm::vec3 from = point.origin + Receivers::kLift * point.normal;
  std::uint64_t escaped = 0, absorbed = 0;
  std::uint32_t cast = 0;
  while (cast < kFirstRays || (cast < kAllRays && escaped + absorbed > 0)) {
    interruptionPoint();
    std::array<geometry::Ray, geometry::kPacket> rays;
    std::array<geometry::Hit, geometry::kPacket> hits;
    for (std::uint32_t i = 0; i < geometry::kPacket; ++i) {
      const auto draw = draws(cast + i);
      rays[i] = {from, glm::vec3(solver::cosineDirection(glm::dvec3(point.normal), draw.x, draw.y)), Receivers::kFar};
    }
    receivers_->nearest(rays, solver::mixKeys(key, cast), hits);
    for (std::size_t i = 0; i < hits.size(); ++i) {
      escaped += hits[i].found() ? 0 : 1;
      absorbed += hits[i].found() && receivers_->absorbs(rays[i], hits[i]) ? 1 : 0;
    }
    cast += geometry::kPacket;
  }
  lost.escaped += escaped * (solver::kWeightOne / cast);
  lost.absorbed += absorbed * (solver::kWeightOne / cast);
}

}  // namespace radiosity::gpu
