#include "tests/oracle/burial.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <limits>
#include <numbers>

#include "tests/oracle/directions.h"

namespace radiosity::oracle {
namespace {

// Lengths in the box of size 2, in which 32-bit positions are rounded to 1.2e-7.
constexpr double kLift = 2e-6;
constexpr double kOnSurface = 4e-5;
constexpr double kSamePlane = 1e-6;
/// Two triangles met at one distance, both from the front or both from the back, are one crossing: of their edge.
constexpr double kSameCrossing = 1e-6;
constexpr double kSameFacing = 0.9999;
constexpr int kRays = 16;
/// So few that say otherwise leave no doubt: where half of all rays leave, so few of kRays do in one case of a hundred.
constexpr int kFew = 3;
/// Rays along a surface rise by this part of their length: through any gap that is wider than a thousandth of its
/// depth.
constexpr double kGrazing = 2e-4;

bool emits(const Triangle& triangle) { return triangle.emission_lux != glm::dvec3(0.0); }

}  // namespace

Burial::Burial(const RayScene& scene, std::span<const Triangle> triangles) : scene_(scene), triangles_(triangles) {}

/// In order.
std::vector<Burial::Crossing> Burial::crossings(const glm::dvec3& from, const glm::dvec3& way, double far) const {
  std::vector<Crossing> met;
  scene_.visit(from, way, far, [&](const RayScene::Met& one) {
    met.push_back({one.distance, one.triangle});
    return false;  // goes on to the next
  });
  std::sort(met.begin(), met.end(), [](const auto& a, const auto& b) {
    return a.distance != b.distance ? a.distance < b.distance : a.triangle < b.triangle;
  });
  return met;
}

std::vector<Burial::Crossing> Burial::solidCrossings(const glm::dvec3& from, const glm::dvec3& direction) const {
  auto met = crossings(from, direction, std::numeric_limits<double>::infinity());
  std::erase_if(met, [&](const Crossing& crossing) { return triangles_[crossing.triangle].see_through; });
  const auto sheet = std::find_if(met.begin(), met.end(), [&](const auto& crossing) { return isSheet(crossing); });
  if (sheet != met.end()) met.erase(sheet + 1, met.end());
  return met;
}

/// Opaque, and lit on both sides: nobody sees beyond it.
bool Burial::isSheet(const Crossing& crossing) const {
  const auto& triangle = triangles_[crossing.triangle];
  return hasTwoSides(triangle) && !triangle.see_through;
}

bool Burial::isFront(std::uint32_t triangle, const glm::dvec3& direction) const {
  return glm::dot(direction, triangles_[triangle].normal) < 0.0;
}

/// From the start to some place on the ray: then the start is inside what is left there.
bool Burial::leavesMore(std::span<const Crossing> crossings, const glm::dvec3& direction) const {
  int entered = 0;
  for (std::size_t i = 0; i < crossings.size() && !isSheet(crossings[i]); ++i) {
    const bool front = isFront(crossings[i].triangle, direction);
    const bool same = i > 0 && crossings[i].distance - crossings[i - 1].distance < kSameCrossing &&
                      front == isFront(crossings[i - 1].triangle, direction);
    if (same) continue;
    entered += front ? 1 : -1;
    if (entered < 0) return true;
  }
  return false;
}

bool Burial::leavesSolid(const glm::dvec3& point, const glm::dvec3& direction) const {
  return leavesMore(solidCrossings(point, direction), direction);
}

/// Of rays into the hemisphere.
Where Burial::vote(const glm::dvec3& point, const glm::dvec3& normal) const {
  const auto lifted = point + normal * kLift;
  int leave = 0, stay = 0;
  while (leave + stay < kRays && leave < kRays - kFew && stay < kRays - kFew) {
    const int i = leave + stay;
    const bool leaves = leavesSolid(lifted, cosineDirection(normal, (i + 0.5) / kRays, i * std::numbers::phi));
    ++(leaves ? leave : stay);
  }
  if (leave >= kRays - kFew) return Where::kInside;
  if (stay >= kRays - kFew) return Where::kOutside;
  return 2 * leave > kRays ? Where::kUndecidedInside : Where::kUndecidedOutside;
}

/// Whether rays along the surface get to where one is not inside, or out of the scene, before they leave a solid.
Where Burial::alongSurface(const glm::dvec3& point, const glm::dvec3& normal) const {
  const auto [s, t] = tangents(normal);
  const auto from = point + normal * kOnSurface;
  int out = 0, perhaps_out = 0, perhaps_in = 0;
  for (int i = 0; i < kRays && out <= kFew; ++i) {
    const double phi = 2.0 * std::numbers::pi * (i + 0.3) / kRays;
    const auto direction = glm::normalize(s * std::cos(phi) + t * std::sin(phi) + normal * kGrazing);
    const auto met = solidCrossings(from, direction);
    if (leavesMore(met, direction)) continue;
    // What it meets first may be a part of the surface, in a hollow, or of another that is inside as well.
    auto there = Where::kOutside;
    if (!met.empty()) {
      const auto& normal = triangles_[met.front().triangle].normal;
      const bool from_behind = isSheet(met.front()) && !isFront(met.front().triangle, direction);
      there = vote(from + direction * met.front().distance, from_behind ? -normal : normal);
    }
    out += there == Where::kOutside ? 1 : 0;
    perhaps_out += there == Where::kUndecidedOutside ? 1 : 0;
    perhaps_in += there == Where::kUndecidedInside ? 1 : 0;
  }
  if (out > kFew) return Where::kOutside;
  if (out + perhaps_out > 0) return Where::kUndecidedOutside;
  return perhaps_in > 0 ? Where::kUndecidedInside : Where::kInside;
}

Where Burial::whereIs(const glm::dvec3& point, const glm::dvec3& normal) const {
  const auto votes = vote(point, normal);
  if (votes == Where::kOutside) return votes;
  const auto above = solidCrossings(point + normal * kLift, normal);
  if (!above.empty() && above.front().distance < kOnSurface && !isSheet(above.front()) &&
      !isFront(above.front().triangle, normal))
    return votes;
  const auto along = alongSurface(point, normal);
  if (along == Where::kInside) return votes;
  return along == Where::kUndecidedInside && !isInside(votes) ? votes : along;
}

bool Burial::underEarlier(const glm::dvec3& point, const glm::dvec3& normal, std::uint32_t triangle) const {
  const auto met = crossings(point + normal * kSamePlane, -normal, 2.0 * kSamePlane);
  return std::any_of(met.begin(), met.end(), [&](const Crossing& crossing) {
    const auto& other = triangles_[crossing.triangle];
    const double same = glm::dot(other.normal, normal);
    const bool through = triangles_[triangle].see_through, shines = emits(triangles_[triangle]);
    const bool before = shines != emits(other)         ? emits(other)
                        : through != other.see_through ? through
                                                       : crossing.triangle < triangle;
    return before && (same > kSameFacing || (hasTwoSides(other) && same < -kSameFacing));
  });
}

}  // namespace radiosity::oracle
