#include "server/solver/math/lamp_form_factor.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

namespace radiosity::solver {
namespace {

using std::numbers::pi;

glm::dvec3 perpendicularTo(const glm::dvec3& axis) {
  const glm::dvec3 helper = std::abs(axis.x) < 0.6 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
  return glm::normalize(glm::cross(helper, axis));
}

/// A receiver in the axes of a disc: its rim lies at (radius cos phi - offset, radius sin phi, -height) from there.
struct Rim {
  double radius, offset, height;

  [[nodiscard]] glm::dvec3 at(double phi) const {
    return {radius * std::cos(phi) - offset, radius * std::sin(phi), -height};
  }
  /// Integral of r x dr / r^2, times the normal, from `begin` to `end`, both within (-2 pi, 2 pi).
  [[nodiscard]] double integral(const glm::dvec3& normal, double begin, double end) const {
    const double constant = radius * radius + offset * offset + height * height, wave = 2.0 * radius * offset;
    const double root = std::sqrt((constant - wave) * (constant + wave));
    const double stretch = std::sqrt((constant + wave) / (constant - wave));
    const auto turned = [&](double phi) { return std::atan2(stretch * std::sin(0.5 * phi), std::cos(0.5 * phi)); };
    const double plain = 2.0 / root * (turned(end) - turned(begin));  // of 1 / r^2
    double cosine = (std::sin(end) - std::sin(begin)) / constant;     // of cos phi / r^2
    double sine = (std::cos(begin) - std::cos(end)) / constant;       // of sin phi / r^2
    if (wave > 1e-9 * constant) {
      cosine = (constant * plain - (end - begin)) / wave;
      sine = std::log((constant - wave * std::cos(end)) / (constant - wave * std::cos(begin))) / wave;
    }
    return height * radius * (normal.x * cosine + normal.y * sine) +
           normal.z * radius * (radius * plain - offset * cosine);
  }
};

}  // namespace

double discFormFactor(const glm::dvec3& point, const glm::dvec3& normal, const glm::dvec3& centre,
                      const glm::dvec3& axis, double radius) {
  const auto way = point - centre;
  const double height = glm::dot(way, axis);
  if (!(height > 0.0) || !(radius > 0.0)) return 0.0;
  const auto aside = way - height * axis;
  const double offset = glm::length(aside);
  const auto x = offset > 1e-12 * radius ? aside / offset : perpendicularTo(axis);
  const glm::dvec3 local(glm::dot(normal, x), glm::dot(normal, glm::cross(axis, x)), glm::dot(normal, axis));
  const Rim rim{radius, offset, height};
  // Above the horizon: steep cos(phi - middle) > level.
  const double steep = radius * std::hypot(local.x, local.y), level = local.x * offset + local.z * height;
  if (steep <= level) return 0.0;
  if (-steep >= level) return std::max(0.0, -rim.integral(local, -pi, pi) / (2.0 * pi));
  const double middle = std::atan2(local.y, local.x), half = std::acos(level / steep);
  const double begin = middle - half, end = middle + half;
  const auto first = rim.at(end), second = rim.at(begin);
  const auto turn = glm::cross(first, second);
  const double angle = std::atan2(glm::length(turn), glm::dot(first, second));
  const double chord = glm::dot(turn, local) < 0.0 ? -angle : angle;
  return std::max(0.0, -(rim.integral(local, begin, end) + chord) / (2.0 * pi));
}

double ballFormFactor(const glm::dvec3& point, const glm::dvec3& normal, const glm::dvec3& centre, double radius) {
  const auto way = centre - point;
  const double distance = glm::length(way);
  if (!(distance > 0.0) || !(radius > 0.0)) return 0.0;
  const double sine = std::min(1.0, radius / distance), square = sine * sine;
  const double cosine = std::clamp(glm::dot(normal, way) / distance, -1.0, 1.0);
  if (cosine >= sine) return cosine * square;
  if (cosine <= -sine) return 0.0;
  const double across = std::sqrt(1.0 - cosine * cosine), x = std::sqrt(std::max(0.0, 1.0 / square - 1.0));
  const double y = std::clamp(-x * cosine / across, -1.0, 1.0), rest = across * std::sqrt(1.0 - y * y);
  const double whole = (cosine * std::acos(y) - x * rest) * square + std::atan2(rest, x);
  return std::max(0.0, whole / pi);
}

}  // namespace radiosity::solver
