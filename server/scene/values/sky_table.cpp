#include "server/scene/values/sky_table.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>
#include <queue>

namespace radiosity::scene {
namespace {

using std::numbers::pi;
constexpr std::size_t kSkyHead = 4, kOfRectangle = 5;
/// Rectangles are cut until what their light may be off by, times how far, is less than this part of all light (rad):
/// so little that the sky around a sun, a tenth of all light where that is hidden, is known to a degree or two.
constexpr double kSmooth = 1e-7;

/// Columns [x0, x1) and rows [y0, y1) of a grid.
struct Rectangle {
  std::size_t x0 = 0, x1 = 0, y0 = 0, y1 = 0;
  double light = 0.0;
  double roughness = 0.0;  ///< what cutting it may gain
  bool operator<(const Rectangle& other) const { return roughness < other.roughness; }
};

/// Sums of light, and of its square, over rectangles of a grid.
class Sums {
 public:
  explicit Sums(const SkyGrid& grid)
      : width_(grid.width),
        height_(grid.height),
        light_((width_ + 1) * (height_ + 1), 0.0),
        square_((width_ + 1) * (height_ + 1), 0.0) {
    const double column = 2.0 * pi / static_cast<double>(width_);
    for (std::size_t y = 0; y < height_; ++y) {
      const double solid_angle = column * (heightOf(y) - heightOf(y + 1));
      double light = 0.0, square = 0.0;
      for (std::size_t x = 0; x < width_; ++x) {
        const auto strength = static_cast<double>(grid.strength[y * width_ + x]);
        light += solid_angle * strength;
        square += solid_angle * strength * strength;
        light_[at(x + 1, y + 1)] = light_[at(x + 1, y)] + light;
        square_[at(x + 1, y + 1)] = square_[at(x + 1, y)] + square;
      }
    }
  }

  /// Of the upper edge of a row.
  [[nodiscard]] double heightOf(std::size_t row) const {
    return std::cos(pi * static_cast<double>(row) / static_cast<double>(height_));
  }
  [[nodiscard]] double azimuthOf(std::size_t column) const {
    return (2.0 * static_cast<double>(column) / static_cast<double>(width_) - 1.0) * pi;
  }

  [[nodiscard]] Rectangle rectangle(std::size_t x0, std::size_t x1, std::size_t y0, std::size_t y1) const {
    Rectangle made{x0, x1, y0, y1};
    made.light = std::max(0.0, sum(light_, made));
    if (x1 - x0 <= 1 && y1 - y0 <= 1) return made;
    const double spread = solidAngle(made) * sum(square_, made) - made.light * made.light;
    made.roughness = std::sqrt(std::max(0.0, spread)) * std::hypot(widthOf(made), fallOf(made));
    return made;
  }
  /// Across and down, radians.
  [[nodiscard]] double widthOf(const Rectangle& of) const {
    const double middle = pi * static_cast<double>(of.y0 + of.y1) / (2.0 * static_cast<double>(height_));
    return std::sin(middle) * (azimuthOf(of.x1) - azimuthOf(of.x0));
  }
  [[nodiscard]] double fallOf(const Rectangle& of) const {
    return pi * static_cast<double>(of.y1 - of.y0) / static_cast<double>(height_);
  }

 private:
  [[nodiscard]] std::size_t at(std::size_t x, std::size_t y) const { return y * (width_ + 1) + x; }
  [[nodiscard]] double sum(const std::vector<double>& sums, const Rectangle& of) const {
    return sums[at(of.x1, of.y1)] - sums[at(of.x0, of.y1)] - sums[at(of.x1, of.y0)] + sums[at(of.x0, of.y0)];
  }
  [[nodiscard]] double solidAngle(const Rectangle& of) const {
    return (azimuthOf(of.x1) - azimuthOf(of.x0)) * (heightOf(of.y0) - heightOf(of.y1));
  }

  std::size_t width_, height_;
  std::vector<double> light_, square_;
};

/// The roughest is cut in two across its longer side, until none is rough or there are enough.
std::vector<Rectangle> cutUp(const Sums& sums, const SkyGrid& grid) {
  const auto all = sums.rectangle(0, grid.width, 0, grid.height);
  std::vector<Rectangle> done;
  if (!(all.light > 0.0)) return done;
  std::priority_queue<Rectangle> rough;
  const auto add = [&](const Rectangle& made) {
    if (made.light <= 0.0) return;
    if (made.roughness > kSmooth * all.light) {
      rough.push(made);
    } else {
      done.push_back(made);
    }
  };
  add(all);
  while (!rough.empty() && done.size() + rough.size() < kMostSkyRectangles) {
    const auto of = rough.top();
    rough.pop();
    const bool across = of.x1 - of.x0 > 1 && (of.y1 - of.y0 <= 1 || sums.widthOf(of) >= sums.fallOf(of));
    const auto x = across ? (of.x0 + of.x1) / 2 : of.x1, y = across ? of.y1 : (of.y0 + of.y1) / 2;
    add(sums.rectangle(of.x0, x, of.y0, y));
    add(sums.rectangle(across ? x : of.x0, of.x1, across ? of.y0 : y, of.y1));
  }
  for (; !rough.empty(); rough.pop()) done.push_back(rough.top());
  return done;
}

/// Digits of both in turn: what is near in the order is near in the sky, so that draws that are spread evenly are so
/// there.
std::uint64_t interleaved(std::size_t x, std::size_t y) {
  std::uint64_t digits = 0;
  for (unsigned bit = 0; bit < 24; ++bit)
    digits |= (std::uint64_t{x >> bit & 1U} << (2 * bit)) | (std::uint64_t{y >> bit & 1U} << (2 * bit + 1));
  return digits;
}

glm::dvec3 directionAt(double azimuth, double height) {
  const double across = std::sqrt(std::max(0.0, 1.0 - height * height));
  return {across * std::cos(azimuth), height, across * std::sin(azimuth)};
}

}  // namespace

std::vector<float> skyTable(const SkyGrid& grid) {
  const Sums sums(grid);
  auto rectangles = cutUp(sums, grid);
  if (rectangles.empty()) return {};
  std::ranges::sort(rectangles, {}, [](const Rectangle& of) { return interleaved(of.x0, of.y0); });
  const auto count = rectangles.size();
  double all = 0.0, sum = 0.0;
  for (const auto& of : rectangles) all += of.light;
  std::vector<float> table(kSkyHead + kOfRectangle * count);
  table[0] = static_cast<float>(count);
  glm::dvec3 mean(0.0);
  for (std::size_t i = 0; i < count; ++i) {
    const auto& of = rectangles[i];
    sum += of.light;
    const double azimuth = sums.azimuthOf(of.x0), width = sums.azimuthOf(of.x1) - azimuth;
    const double height = sums.heightOf(of.y1), extent = sums.heightOf(of.y0) - height;
    mean += of.light / all * directionAt(azimuth + 0.5 * width, height + 0.5 * extent);
    const std::array<double, kOfRectangle> numbers{i + 1 < count ? sum / all : 1.0, azimuth, width, height, extent};
    for (std::size_t k = 0; k < kOfRectangle; ++k) table[kSkyHead + k * count + i] = static_cast<float>(numbers[k]);
  }
  for (int c = 0; c < 3; ++c) table[1 + static_cast<std::size_t>(c)] = static_cast<float>(mean[c]);
  return table;
}

bool isSkyTable(std::span<const float> table) {
  if (table.size() < kSkyHead + kOfRectangle ||
      !(table[0] >= 1.0F && table[0] <= static_cast<float>(kMostSkyRectangles)))
    return false;
  const auto count = static_cast<std::size_t>(table[0]);
  if (table.size() != kSkyHead + kOfRectangle * count) return false;
  const auto sums = table.subspan(kSkyHead, count);
  return sums.front() >= 0.0F && sums.back() == 1.0F && std::ranges::is_sorted(sums);
}

glm::dvec3 meanSkyDirection(std::span<const float> table) { return {table[1], table[2], table[3]}; }

glm::dvec3 skyDirection(std::span<const float> table, const glm::dvec2& at) {
  const auto count = static_cast<std::size_t>(table[0]);
  const auto sums = table.subspan(kSkyHead, count);
  const auto above = std::upper_bound(sums.begin(), sums.end() - 1, static_cast<float>(at.x));
  const auto i = static_cast<std::size_t>(above - sums.begin());
  const double low = i > 0 ? static_cast<double>(sums[i - 1]) : 0.0, high = static_cast<double>(sums[i]);
  const double within = high > low ? std::clamp((at.x - low) / (high - low), 0.0, 1.0) : 0.5;
  const auto number = [&](std::size_t k) { return static_cast<double>(table[kSkyHead + k * count + i]); };
  return directionAt(number(1) + within * number(2), std::clamp(number(3) + at.y * number(4), -1.0, 1.0));
}

std::uint64_t keyOfFloats(std::span<const float> values) {
  std::uint64_t key = 0xcbf29ce484222325ULL;
  for (const float value : values) key = (key ^ std::bit_cast<std::uint32_t>(value)) * 0x100000001b3ULL;
  return key ^ key >> 32U;
}

}  // namespace radiosity::scene
