// Which receivers a polygon shines at, from where on them they look at it, and the form factors there.
#include <algorithm>
#include <array>
#include <cmath>
#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include "common/clones.h"
#include "server/gpu/gather/form_factor_kernel.h"
#include "server/gpu/gather/light_gatherer.h"
#include "server/gpu/gather/receiver_places.h"
#include "server/solver/math/polygon_form_factor.h"

namespace radiosity::gpu {
namespace {

constexpr std::size_t kFewestLit = 4096;
/// More do not wait for their form factors: the other half's places would take memory.
constexpr std::size_t kWeighedAtOnce = 65536;
/// The halves look from opposite places, of which most cancels in their mean and shows in their difference: where
/// nothing else is unknown, as in an empty room, that would say several times too large an error. So the form factors
/// of a half lean on those of the other half's places, and keep this part of the difference: what the mean of all
/// places errs by, beside half the difference of the halves, root mean squares over jitters. For one place of each
/// half, from kNearTexels on, that is 0.05 to 0.11 (lamps of a texel at any height), for two near by 0.3 to 0.5 (0.4
/// for a wall and the floor at its foot). The mean stays as it is. Where something may hide one place and not the other
/// it would not: what is odd in the form factor times what is odd in what is seen is no part of the mean of the one
/// alone.
constexpr float kKept = 0.15F, kKeptNear = 0.4F;

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
         a.receiver_jitter == b.receiver_jitter && a.spots == b.spots && a.spot_rows == b.spot_rows &&
         a.fill == b.fill && a.triangle == b.triangle && a.side == b.side;
}

/// How much of what shines lies in front, then.
float frontOfShining(float fill, double front) {
  return static_cast<float>(std::min(1.0, front / static_cast<double>(fill)));
}

/// Least and greatest height of a box above the polygon's plane.
std::array<float, 2> heights(const solver::GatherShot& shot, const glm::vec3& low, const glm::vec3& high) {
  const auto rises = glm::greaterThan(shot.normal, glm::vec3(0.0F));
  return {glm::dot(shot.normal, glm::mix(high, low, rises) - shot.corners[0]),
          glm::dot(shot.normal, glm::mix(low, high, rises) - shot.corners[0])};
}

/// The places of receivers in one frame, as Receivers::place has them. Branch-free, so that it vectorises.
RADIOSITY_CLONES void findPlaces(const scene::TriangleFrame& frame, const glm::vec2& at, std::size_t count,
                                 const float* texel_x, const float* texel_y, float* x, float* y, float* z) {
  const auto o = frame.origin, u = frame.du, v = frame.dv;
  for (std::size_t i = 0; i < count; ++i) {
    const float across = texel_x[i] + at.x, up = texel_y[i] + at.y;
    x[i] = o.x + across * u.x + up * v.x;
    y[i] = o.y + across * u.y + up * v.y;
    z[i] = o.z + across * u.z + up * v.z;
  }
}

}  // namespace

void LightGatherer::Lit::resize(std::size_t count) {
  for (auto* values : {&x, &y, &z, &nx, &ny, &nz, &form_factor, &share, &front, &point_weight, &visibility, &light_x,
                       &light_y, &light_z})
    values->resize(count);
  turn.resize(count);
  node.resize(count);
  care.resize(count);
  doubt.resize(count);
  doubtful.resize(count);
  pixel.resize(count);
  for (std::size_t half = 0; half < 2; ++half) {
    for (auto* sums : {&weight[half], &visible_weight[half]}) sums->resize(count);
  }
}

void LightGatherer::Others::resize(std::size_t count) {
  for (auto* values : {&x, &y, &z, &nx, &ny, &nz, &form_factor}) values->resize(count);
}

void LightGatherer::Others::clear() {
  resize(0);
  runs.clear();
}

LightGatherer::LightGatherer(std::shared_ptr<const Receivers> receivers) : receivers_(std::move(receivers)) {}

/// Room for so many more: not for all receivers there are, of which half face a shooter.
void LightGatherer::makeRoom(std::size_t more) {
  const auto size = lit_.x.size();
  if (lit_count_ + more > size) lit_.resize(std::max({lit_count_ + more, size + size / 2, kFewestLit}));
}

/// Whether all of the surface lies behind the polygon's plane.
bool LightGatherer::behind(const solver::GatherShot& shot, const scene::Surface& surface) const {
  return heights(shot, surface.bounds_min, surface.bounds_max)[1] <= kInPlane;
}

void LightGatherer::clearLit() {
  lit_count_ = weighed_ = gaps_ = 0;
  others_.clear();
  clearEdges();
  lit_valid_ = false;
}

void LightGatherer::findLit(const solver::GatherShot& shot) {
  if (lit_valid_ && sameGeometry(shot, lit_for_)) return;
  clearLit();
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
  leanOnOthers([&] {
    auto& o = others_;
    wholeFormFactors(std::span(shot.corners.data(), shot.corner_count),
                     {o.x.data(), o.y.data(), o.z.data(), o.nx.data(), o.ny.data(), o.nz.data()}, o.x.size(),
                     o.form_factor.data());
  });
  for (auto i = k; i < lit_count_ && shot.fill < 1.0F; ++i) lit_.form_factor[i] *= shot.fill;
  std::fill(lit_.front.begin() + static_cast<std::ptrdiff_t>(k),
            lit_.front.begin() + static_cast<std::ptrdiff_t>(lit_count_), 1.0F);
  shareAmongPlaces(k);
  weighed_ = lit_count_;
}

std::size_t LightGatherer::addOthers(std::size_t lit, std::size_t count, bool near, const glm::vec3& normal) {
  const std::size_t begin = others_.x.size();
  others_.resize(begin + count);
  std::fill_n(&others_.nx[begin], count, normal.x);
  std::fill_n(&others_.ny[begin], count, normal.y);
  std::fill_n(&others_.nz[begin], count, normal.z);
  others_.runs.push_back({static_cast<std::uint32_t>(lit), static_cast<std::uint32_t>(count), near});
  return begin;
}

/// `weigh` finds the form factors of the other half's places. What both halves see of the light stays in proportion: a
/// form factor is what it would be, and the visibility that of the half's own places.
template <typename Weigh>
void LightGatherer::leanOnOthers(const Weigh& weigh) {
  if (others_.runs.empty()) return;
  weigh();
  const float* other = others_.form_factor.data();
  for (const auto& run : others_.runs) {
    float* own = &lit_.form_factor[run.lit];
    if (run.near) {
      const float sum = own[0] + own[1], mean = 0.5F * (sum + other[0] + other[1]);
      const float factor = sum > 0.0F ? (mean + kKeptNear * (sum - mean)) / sum : 1.0F;
      for (std::size_t i = 0; i < 2; ++i) own[i] *= factor;
    } else {
      for (std::size_t i = 0; i < run.count; ++i) {
        const float mean = 0.5F * (own[i] + other[i]);
        own[i] = mean + kKept * (own[i] - mean);
      }
    }
    other += run.count;
  }
  others_.clear();
}

/// A receiver of several places is the mean of them; of those lit from `begin` on.
void LightGatherer::shareAmongPlaces(std::size_t begin) {
  for (std::size_t k = begin; k < lit_count_; ++k) lit_.form_factor[k] *= lit_.share[k];
}

/// A receiver before whose plane only part of the polygon lies.
void LightGatherer::weighPart(const solver::GatherShot& shot, std::size_t lit, double front) {
  lit_.form_factor[lit] *= static_cast<float>(shining(static_cast<double>(shot.fill), front));
  lit_.front[lit] = frontOfShining(shot.fill, front);
}

/// Receivers of one plane, lit from `begin` on, before which `polygon` is left of what shines.
void LightGatherer::weighClipped(const solver::GatherShot& shot, const ClippedPolygon& polygon, const glm::vec3& normal,
                                 std::size_t begin) {
  planarFormFactors(polygon, normal, lit_.x.data() + begin, lit_.y.data() + begin, lit_.z.data() + begin,
                    lit_count_ - begin, lit_.form_factor.data() + begin);
  leanOnOthers([&] {
    auto& o = others_;
    planarFormFactors(polygon, normal, o.x.data(), o.y.data(), o.z.data(), o.x.size(), o.form_factor.data());
  });
  const double kept = solver::polygonArea(std::span(polygon.corner.data(), polygon.count)) /
                      solver::polygonArea(std::span(shot.corners.data(), shot.corner_count));
  parts_.push_back(polygon);
  for (std::size_t k = begin; k < lit_count_; ++k) {
    if (isEdge(shot, k, kept)) {
      addEdge(k);
    } else {
      weighPart(shot, k, kept);
    }
  }
  if (edges_.empty() || edges_.back().part + 1 < parts_.size()) parts_.pop_back();
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
  const bool leans = surface.planar && receivers_->isConvex();
  const auto ball = nearBall(corners, surface, plane.du);
  const auto takeOthers = [&](const auto& others) {
    auto k = addOthers(lit_count_ - others.size(), others.size(), others.size() > 1, plane_normal);
    for (const auto& other : others) {
      others_.x[k] = other.point.x;
      others_.y[k] = other.point.y;
      others_.z[k++] = other.point.z;
    }
  };
  const auto add = [&](const Receivers::Receiver& receiver) {
    const auto take = [&](const Receivers::Place& place, float share) {
      const auto normal = surface.planar ? plane_normal : group.side * place.frame->normal;
      if (!surface.planar) {
        const auto form_factor = solver::formFactorInFront(place.point, normal, corners);
        if (form_factor.value <= 0.0) return;
        lit_.form_factor[lit_count_] = static_cast<float>(form_factor.value);
        if (isEdge(shot, lit_count_, form_factor.front)) {
          parts_.push_back(clipToPlane(corners, place.point, normal));
          addEdge(lit_count_);
        } else {
          weighPart(shot, lit_count_, form_factor.front);
        }
      }
      lit_.share[lit_count_] = share;
      addLit(receiver, place, normal);
    };
    forEachPlace(shot, ball, *receivers_, receiver, take, leans, takeOthers);
  };
  const auto end = group.first + group.count;
  auto block = receivers_->blocks().begin() + static_cast<std::ptrdiff_t>(group.first_block);
  for (auto i = group.first; i < end; ++block) {
    const auto stop = std::min(end, block->first + block->count);
    if (stop <= i) continue;
    // By the whole block, also where only some of it are named: they get the same bits.
    makeRoom((stop - i) * std::max(2U, block->plain ? 0 : shot.spot_rows * scene::kSpotQuarters));
    const auto [low, high] = heights(shot, block->low, block->high);
    if (high <= 0.0F) i = stop;
    if (whole && lit_count_ - weighed_ > kWeighedAtOnce) weighWhole(shot);
    if (block->plain && low > kInPlane && !isNear(ball, *block)) {
      addPlain(shot, i, stop - i, plane_normal);
      i = stop;
    }
    for (; i < stop; ++i) {
      add(receivers_->all()[i]);
    }
  }
  if (whole) return;
  weighed_ = lit_count_;
  if (surface.planar) weighClipped(shot, polygon, plane_normal, begin);
  shareAmongPlaces(begin);
}

/// Receivers of a plain block.
void LightGatherer::addPlain(const solver::GatherShot& shot, std::size_t first, std::size_t count,
                             const glm::vec3& normal) {
  const std::size_t k = lit_count_;
  const auto& frame = receivers_->patches().triangles[receivers_->all()[first].triangle];
  findPlaces(frame, shot.receiver_jitter, count, receivers_->texelX() + first, receivers_->texelY() + first, &lit_.x[k],
             &lit_.y[k], &lit_.z[k]);
  if (receivers_->isConvex()) {
    const auto o = addOthers(k, count, false, normal);
    findPlaces(frame, 1.0F - shot.receiver_jitter, count, receivers_->texelX() + first, receivers_->texelY() + first,
               &others_.x[o], &others_.y[o], &others_.z[o]);
  }
  std::fill_n(&lit_.nx[k], count, normal.x);
  std::fill_n(&lit_.ny[k], count, normal.y);
  std::fill_n(&lit_.nz[k], count, normal.z);
  std::fill_n(&lit_.share[k], count, 1.0F);
  std::fill_n(&lit_.care[k], count, receivers_->careOf(receivers_->all()[first]));
  std::copy_n(receivers_->nodes() + first, count, &lit_.node[k]);
  for (std::size_t i = 0; i < count; ++i)
    lit_.turn[k + i] = Receivers::turnOf({receivers_->texelX()[first + i], receivers_->texelY()[first + i]});
  lit_count_ += count;
}

void LightGatherer::addLit(const Receivers::Receiver& receiver, const Receivers::Place& place,
                           const glm::vec3& normal) {
  const std::size_t k = lit_count_++;
  lit_.x[k] = place.point.x;
  lit_.y[k] = place.point.y;
  lit_.z[k] = place.point.z;
  lit_.nx[k] = normal.x;
  lit_.ny[k] = normal.y;
  lit_.nz[k] = normal.z;
  lit_.node[k] = receiver.node;
  lit_.turn[k] = Receivers::turnOf(receiver.texel);
  lit_.care[k] = receivers_->careOf(receiver);
  gaps_ += (lit_.care[k] & Receivers::kInGap) != 0 ? 1 : 0;
}

}  // namespace radiosity::gpu
