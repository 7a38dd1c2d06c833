// What rays tell LightGatherer: which receivers a point on the light sees, and what of its light is lost.
#include <array>
#include <cmath>

#include "common/clones.h"
#include "common/task.h"
#include "server/geometry/way_queue.h"
#include "server/gpu/gather/light_gatherer.h"
#include "server/solver/math/sampling.h"
#include "server/solver/patches/lights.h"
#include "server/solver/rays/leaf_rays.h"

namespace radiosity::gpu {
namespace {

/// From each point so many rays find out whether some of its light is lost, and so many how much: with 64 of them the
/// light of the Cornell box, of which a quarter leaves by its open side, is 0.6 % off. What is lost by less than a part
/// in the first number is missed in part, a seventh of a hundredth of the light at most.
constexpr std::uint32_t kFirstRays = 256, kAllRays = 1024;
static_assert(kFirstRays % geometry::kPacket == 0 && kAllRays % geometry::kPacket == 0);
static_assert(solver::kWeightOne % kFirstRays == 0 && solver::kWeightOne % kAllRays == 0);

/// A light of three or four corners, and the draw that all turns begin from: numbers below 2^32.
struct TurnedPoints {
  glm::vec3 a, b, c, d;
  float first;  ///< share of the area in the triangle a b c
  std::uint32_t u, v;
  bool is_parallelogram;
};

TurnedPoints turnedPoints(const solver::GatherShot& shot, const glm::dvec4& draw) {
  const auto& [a, b, c, d, rest1, rest2, rest3, rest4] = shot.corners;
  TurnedPoints points{a,    b, c, d,
                      1.0F, 0, 0, solver::isParallelogram(std::span(shot.corners.data(), shot.corner_count))};
  if (shot.corner_count == 4) {
    const float abc = glm::length(glm::cross(b - a, c - a)), acd = glm::length(glm::cross(c - a, d - a));
    points.first = abc / (abc + acd);
  }
  points.u = static_cast<std::uint32_t>(draw.x * 0x1p32);
  points.v = static_cast<std::uint32_t>(draw.y * 0x1p32);
  return points;
}

/// As findPoints().
RADIOSITY_CLONES void findPointsAlongEdges(const TurnedPoints& light, std::size_t count, const std::uint32_t* turn,
                                           float* x, float* y, float* z) {
  const auto a = light.a, along_u = light.b - light.a, along_v = light.d - light.a;
  const auto u0 = light.u, v0 = light.v;
  for (std::size_t i = 0; i < count; ++i) {
    const float u = solver::turnedOver(u0, solver::kTurnU * turn[i]),
                v = solver::turnedOver(v0, solver::kTurnV * turn[i]);
    x[i] = a.x + u * along_u.x + v * along_v.x;
    y[i] = a.y + u * along_u.y + v * along_v.y;
    z[i] = a.z + u * along_u.z + v * along_v.z;
  }
}

/// What each receiver looks at, as LightPolygon::point() has it. Branch-free, so that it vectorises.
RADIOSITY_CLONES void findPoints(const TurnedPoints& light, std::size_t count, const std::uint32_t* turn, float* x,
                                 float* y, float* z) {
  const auto [a, b, c, d, first, u0, v0, is_parallelogram] = light;
  const float rest = 1.0F - first;
  if (is_parallelogram) return findPointsAlongEdges(light, count, turn, x, y, z);
  for (std::size_t i = 0; i < count; ++i) {
    const float u = solver::turnedOver(u0, solver::kTurnU * turn[i]),
                v = solver::turnedOver(v0, solver::kTurnV * turn[i]);
    const bool in_first = u < first;
    const float root = std::sqrt(in_first ? u / first : (u - first) / rest);
    const float p = root * (1.0F - v), q = root * v, o = 1.0F - root;
    x[i] = o * a.x + p * (in_first ? b.x : c.x) + q * (in_first ? c.x : d.x);
    y[i] = o * a.y + p * (in_first ? b.y : c.y) + q * (in_first ? c.y : d.y);
    z[i] = o * a.z + p * (in_first ? b.z : c.z) + q * (in_first ? c.z : d.z);
  }
}

/// cos cos / r^2 for every receiver; 0 of what lies behind the light. Branch-free, so that it vectorises.
RADIOSITY_CLONES void weighReceivers(const glm::vec3& n, std::size_t count, const float* ox, const float* oy,
                                     const float* oz, const float* x, const float* y, const float* z, const float* nx,
                                     const float* ny, const float* nz, float* weight) {
  for (std::size_t i = 0; i < count; ++i) {
    const float dx = x[i] - ox[i], dy = y[i] - oy[i], dz = z[i] - oz[i];
    const float leaves = std::max(0.0F, dx * n.x + dy * n.y + dz * n.z);
    const float arrives = std::max(0.0F, -(dx * nx[i] + dy * ny[i] + dz * nz[i]));
    const float square = dx * dx + dy * dy + dz * dz;
    weight[i] = leaves * arrives / (square * square);
  }
}

}  // namespace

void LightGatherer::look(const solver::GatherShot& shot, const solver::HemicubeFrame& point) {
  askRays(shot, point, look_count_, 0);
  const auto before = look_lost_;
  loseByRays(point, look_lost_);
  if (look_lost_ != before) open_looks_.add(look_count_);
  ++look_count_;
  asked_ = {};
}

void LightGatherer::askRays(const solver::GatherShot& shot, const solver::HemicubeFrame& point, std::uint32_t look,
                            std::size_t half) {
  if (shot.own_points_key != 0) {
    const auto draw = solver::sobol4(shot.first_draw + look, shot.own_points_key);
    findPoints(turnedPoints(shot, draw), lit_count_, lit_.turn.data(), lit_.light_x.data(), lit_.light_y.data(),
               lit_.light_z.data());
  } else {
    std::fill_n(lit_.light_x.begin(), lit_count_, point.origin.x);
    std::fill_n(lit_.light_y.begin(), lit_count_, point.origin.y);
    std::fill_n(lit_.light_z.begin(), lit_count_, point.origin.z);
  }
  weighReceivers(point.normal, lit_count_, lit_.light_x.data(), lit_.light_y.data(), lit_.light_z.data(), lit_.x.data(),
                 lit_.y.data(), lit_.z.data(), lit_.nx.data(), lit_.ny.data(), lit_.nz.data(),
                 lit_.point_weight.data());
  const auto lift = Receivers::kLift * point.normal;
  const auto key = receivers_->placeKey(point.origin);
  float* weight = lit_.weight[half].data();
  float* visible_weight = lit_.visible_weight[half].data();
  geometry::WayQueue<std::uint32_t> ways(receivers_->rays());
  const auto tell = [&](std::uint32_t i) { visible_weight[i] += lit_.point_weight[i]; };
  for (auto& i = asked_.receivers; i < lit_count_; ++i) {
    if (lit_.point_weight[i] <= 0.0F) continue;
    if (ways.isEmpty()) interruptionPoint();  // so that packets hold the same ways wherever it is interrupted
    weight[i] += lit_.point_weight[i];
    const glm::vec3 at(lit_.x[i], lit_.y[i], lit_.z[i]), normal(lit_.nx[i], lit_.ny[i], lit_.nz[i]);
    const auto from = at + Receivers::kLift * normal;
    const glm::vec3 light(lit_.light_x[i], lit_.light_y[i], lit_.light_z[i]);
    ways.add(from, light + lift - from, receivers_->wayKey(key, at), i, tell);
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
