#include "tests/oracle/form_factors.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

namespace radiosity::oracle {
namespace {

using std::numbers::pi;

glm::dvec3 normalSum(std::span<const glm::dvec3> polygon) {
  glm::dvec3 sum(0.0);
  for (std::size_t i = 1; i + 1 < polygon.size(); ++i) {
    sum += glm::cross(polygon[i] - polygon[0], polygon[i + 1] - polygon[0]);
  }
  return sum;
}

/// The part of a convex polygon where dot(plane_normal, p - plane_point) >= 0 (Sutherland and Hodgman 1974).
Corners clip(std::span<const glm::dvec3> polygon, const glm::dvec3& plane_point, const glm::dvec3& plane_normal) {
  Corners kept;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const auto& a = polygon[i];
    const auto& b = polygon[(i + 1) % polygon.size()];
    const double da = glm::dot(plane_normal, a - plane_point);
    const double db = glm::dot(plane_normal, b - plane_point);
    if (da >= 0.0) kept.push_back(a);
    if ((da > 0.0 && db < 0.0) || (da < 0.0 && db > 0.0)) kept.push_back(a + (b - a) * (da / (da - db)));
  }
  if (kept.size() < 3) kept.clear();
  return kept;
}

/// Lambert's sum over the edges of a polygon wholly above the horizon and seen from its front.
double lambert(const glm::dvec3& point, const glm::dvec3& normal, std::span<const glm::dvec3> polygon) {
  double sum = 0.0;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const auto a = polygon[i] - point;
    const auto b = polygon[(i + 1) % polygon.size()] - point;
    const auto perpendicular = glm::cross(b, a);  // reversed: the front's order is clockwise seen along the normal
    const double sine = glm::length(perpendicular);
    if (sine > 0.0) sum += std::atan2(sine, glm::dot(a, b)) * glm::dot(perpendicular, normal) / sine;
  }
  return sum / (2.0 * pi);
}

/// Removes from `pieces` what the occluder hides from the point.
std::vector<Corners> cutShadow(std::vector<Corners> pieces, const glm::dvec3& point, const Corners& occluder) {
  auto away = unitNormal(occluder);
  const double distance = glm::dot(away, occluder[0] - point);
  const double size = glm::length(occluder[1] - occluder[0]);
  if (std::abs(distance) <= 1e-12 * size) return pieces;
  if (distance < 0.0) away = -away;
  std::vector<Corners> visible;
  for (auto& piece : pieces) {
    auto before = clip(piece, occluder[0], -away);
    if (!before.empty()) visible.push_back(std::move(before));
    auto beyond = clip(piece, occluder[0], away);
    for (std::size_t i = 0; i < occluder.size() && !beyond.empty(); ++i) {
      auto side = glm::cross(occluder[i] - point, occluder[(i + 1) % occluder.size()] - point);
      // towards the inside of the pyramid
      glm::dvec3 middle(0.0);
      for (const auto& corner : occluder) middle += corner / static_cast<double>(occluder.size());
      if (glm::dot(side, middle - point) < 0.0) side = -side;
      auto outside = clip(beyond, point, -side);
      if (!outside.empty()) visible.push_back(std::move(outside));
      beyond = clip(beyond, point, side);
    }
  }
  return visible;
}

using ThreeCorners = std::array<glm::dvec3, 3>;

struct Integrand {
  glm::dvec3 normal;
  std::span<const glm::dvec3> to;
  std::span<const Corners> occluders;

  double operator()(const glm::dvec3& point) const { return pointToPolygon(point, normal, to, occluders); }
};

/// Mean over a triangle by the 7-point rule of degree 5 (Radon 1948; Strang and Fix 1973, no. 5).
double meanOver(const ThreeCorners& t, const Integrand& f) {
  const double root = std::sqrt(15.0);
  const double a = (6.0 - root) / 21.0;
  const double b = (6.0 + root) / 21.0;
  const double wa = (155.0 - root) / 1200.0;
  const double wb = (155.0 + root) / 1200.0;
  double sum = 0.225 * f((t[0] + t[1] + t[2]) / 3.0);
  for (std::size_t i = 0; i < 3; ++i) {
    const auto& apex = t[i];
    const auto rest = t[(i + 1) % 3] + t[(i + 2) % 3];
    sum += wa * f(apex * (1.0 - 2.0 * a) + rest * a) + wb * f(apex * (1.0 - 2.0 * b) + rest * b);
  }
  return sum;
}

double adaptiveMean(const ThreeCorners& t, const Integrand& f, double coarse, double tolerance, int depth) {
  const auto ab = 0.5 * (t[0] + t[1]);
  const auto bc = 0.5 * (t[1] + t[2]);
  const auto ca = 0.5 * (t[2] + t[0]);
  const std::array<ThreeCorners, 4> quarters{{{t[0], ab, ca}, {ab, t[1], bc}, {ca, bc, t[2]}, {ab, bc, ca}}};
  std::array<double, 4> means{};
  for (std::size_t i = 0; i < 4; ++i) means[i] = meanOver(quarters[i], f);
  const double fine = 0.25 * (means[0] + means[1] + means[2] + means[3]);
  if (depth <= 0 || std::abs(fine - coarse) <= tolerance) return fine;
  double sum = 0.0;
  // the errors of the quarters have either sign and are averaged, so each may be larger than the whole's
  for (std::size_t i = 0; i < 4; ++i) sum += adaptiveMean(quarters[i], f, means[i], 2.0 * tolerance, depth - 1);
  return 0.25 * sum;
}

}  // namespace

glm::dvec3 unitNormal(std::span<const glm::dvec3> polygon) { return glm::normalize(normalSum(polygon)); }

double area(std::span<const glm::dvec3> polygon) { return 0.5 * glm::length(normalSum(polygon)); }

double parallelRectangles(double width, double depth, double distance) {
  const double x = width / distance;
  const double y = depth / distance;
  const double rx = std::sqrt(1.0 + x * x);
  const double ry = std::sqrt(1.0 + y * y);
  const double sum = 0.5 * std::log(rx * rx * ry * ry / (1.0 + x * x + y * y)) + x * ry * std::atan(x / ry) +
                     y * rx * std::atan(y / rx) - x * std::atan(x) - y * std::atan(y);
  return 2.0 / (pi * x * y) * sum;
}

double perpendicularRectangles(double edge, double from_depth, double to_depth) {
  const double w = from_depth / edge;
  const double h = to_depth / edge;
  const double w2 = w * w;
  const double h2 = h * h;
  const double d = std::sqrt(w2 + h2);
  const double all = 1.0 + w2 + h2;
  const double logs = std::log((1.0 + w2) * (1.0 + h2) / all) + w2 * std::log(w2 * all / ((1.0 + w2) * (w2 + h2))) +
                      h2 * std::log(h2 * all / ((1.0 + h2) * (w2 + h2)));
  return (w * std::atan(1.0 / w) + h * std::atan(1.0 / h) - d * std::atan(1.0 / d) + 0.25 * logs) / (pi * w);
}

double coaxialDiscs(double from_radius, double to_radius, double distance) {
  const double r1 = from_radius / distance;
  const double r2 = to_radius / distance;
  const double s = 1.0 + (1.0 + r2 * r2) / (r1 * r1);
  const double ratio = r2 / r1;
  return 0.5 * (s - std::sqrt(s * s - 4.0 * ratio * ratio));
}

double pointToPolygon(const glm::dvec3& point, const glm::dvec3& normal, std::span<const glm::dvec3> polygon) {
  if (glm::dot(normalSum(polygon), point - polygon[0]) <= 0.0) return 0.0;
  const auto above = clip(polygon, point, normal);
  return above.empty() ? 0.0 : std::max(0.0, lambert(point, normal, above));
}

double pointToPolygon(const glm::dvec3& point, const glm::dvec3& normal, std::span<const glm::dvec3> polygon,
                      std::span<const Corners> occluders) {
  if (occluders.empty()) return pointToPolygon(point, normal, polygon);
  if (glm::dot(normalSum(polygon), point - polygon[0]) <= 0.0) return 0.0;
  std::vector<Corners> pieces{clip(polygon, point, normal)};
  if (pieces[0].empty()) return 0.0;
  for (const auto& occluder : occluders) {
    pieces = cutShadow(std::move(pieces), point, occluder);
    if (pieces.empty()) return 0.0;
  }
  double sum = 0.0;
  for (const auto& piece : pieces) sum += lambert(point, normal, piece);
  return std::max(0.0, sum);
}

double formFactor(const Corners& from, const Corners& to, std::span<const Corners> occluders,
                  const IntegrationOptions& options) {
  const auto normal = unitNormal(from);
  const bool any_above = std::any_of(to.begin(), to.end(), [&](const auto& corner) {
    return glm::dot(normal, corner - from[0]) > 1e-12 * glm::length(corner - from[0]);
  });
  if (!any_above) return 0.0;
  const Integrand f{normal, to, occluders};
  const double whole = area(from);
  double sum = 0.0;
  for (std::size_t i = 1; i + 1 < from.size(); ++i) {
    const ThreeCorners triangle{from[0], from[i], from[i + 1]};
    const double mean = meanOver(triangle, f);
    const double better =
        options.tolerance > 0.0 ? adaptiveMean(triangle, f, mean, options.tolerance, options.max_depth) : mean;
    sum += better * area(triangle) / whole;
  }
  return sum;
}

}  // namespace radiosity::oracle
