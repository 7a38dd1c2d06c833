#include "server/scene/values/web_directions.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>
#include <utility>

#include "server/scene/values/degree.h"
#include "server/scene/values/light_web.h"

namespace radiosity::scene {
namespace {

/// The step of an ascending list of sums in which `at` lies, and how far into the step.
struct Step {
  std::size_t index = 0;
  double part = 0.0, height = 0.0;
};
template <typename Sum>
Step stepOf(std::span<const Sum> sums, double at) {
  const auto found = std::upper_bound(sums.begin(), sums.end(), at,
                                      [](double value, Sum sum) { return value < static_cast<double>(sum); });
  Step step;
  step.index = static_cast<std::size_t>(std::min<std::ptrdiff_t>(found - sums.begin(), std::ssize(sums) - 1));
  const double below = step.index > 0 ? static_cast<double>(sums[step.index - 1]) : 0.0;
  step.height = static_cast<double>(sums[step.index]) - below;
  step.part = step.height > 0.0 ? std::clamp((at - below) / step.height, 0.0, 1.0) : 0.5;
  return step;
}

}  // namespace

WebDirections::WebDirections(std::span<const float> table) {
  const auto rows = static_cast<std::size_t>(table[0]), azimuths = static_cast<std::size_t>(table[1]);
  polar_ = table.subspan(kWebHead, rows);
  azimuth_ = table.subspan(kWebHead + rows, azimuths);
  candela_ = table.subspan(kWebHead + rows + azimuths);
  columns_ = std::max<std::size_t>(azimuths, 2) - 1;
  until_row_.reserve(columns_ * (rows - 1));
  const auto parts = ringParts(polar_);
  auto here = rings(0, parts);
  double lumens = 0.0;
  for (std::size_t column = 0; column < columns_; ++column) {
    const auto next = std::min(column + 1, azimuths - 1);
    auto there = rings(next, parts);
    for (std::size_t row = 0; row + 1 < rows; ++row) here[row] = 0.5 * (here[row] + there[row]);
    const double sum = std::accumulate(here.begin(), here.end(), 0.0);
    double until = 0.0;
    for (const double ring : here) until_row_.push_back(static_cast<float>(sum > 0.0 ? (until += ring) / sum : 0.0));
    const double turn =
        azimuths > 1 ? kDegree * static_cast<double>(azimuth_[next] - azimuth_[column]) : 2.0 * std::numbers::pi;
    until_column_.push_back(lumens += sum * turn);
    here = std::move(there);
  }
}

std::vector<double> WebDirections::rings(std::size_t azimuth, std::span<const RingPart> parts) const {
  const auto candela = candela_.subspan(azimuth * polar_.size(), polar_.size());
  std::vector<double> flux;
  flux.reserve(parts.size());
  for (std::size_t row = 0; row < parts.size(); ++row) {
    const auto first = static_cast<double>(candela[row]), second = static_cast<double>(candela[row + 1]);
    flux.push_back(std::max(0.0, first * parts[row].whole + (second - first) * parts[row].rising));
  }
  return flux;
}

/// Candela are linear in the angle; the flux is that of LightWeb::lumens.
std::vector<WebDirections::RingPart> WebDirections::ringParts(std::span<const float> polar_deg) {
  std::vector<RingPart> parts;
  for (std::size_t row = 0; row + 1 < polar_deg.size(); ++row) {
    const double low = kDegree * static_cast<double>(polar_deg[row]);
    const double high = kDegree * static_cast<double>(polar_deg[row + 1]);
    const double width = high - low;
    parts.push_back(
        {std::cos(low) - std::cos(high), (std::sin(high) - std::sin(low) - width * std::cos(high)) / width});
  }
  return parts;
}

/// Within a cell directions are uniform over the solid angle.
WebDirections::Direction WebDirections::at(const glm::dvec2& at) const {
  const double lumens = until_column_.back();
  if (!(lumens > 0.0)) return {};
  const auto column = stepOf(std::span<const double>(until_column_), at.x * lumens);
  const std::size_t rows = polar_.size() - 1;
  const auto row = stepOf(std::span<const float>(until_row_).subspan(column.index * rows, rows), at.y);
  const auto first = static_cast<double>(azimuth_[column.index]);
  const auto next = std::min(column.index + 1, azimuth_.size() - 1);
  const double turn = azimuth_.size() > 1 ? static_cast<double>(azimuth_[next]) - first : 360.0;
  const double low = kDegree * static_cast<double>(polar_[row.index]);
  const double high = kDegree * static_cast<double>(polar_[row.index + 1]);
  const double cosine = std::cos(low) + row.part * (std::cos(high) - std::cos(low));
  Direction drawn{std::clamp(std::acos(std::clamp(cosine, -1.0, 1.0)), low, high),
                  kDegree * (first + column.part * turn), 0.0};
  const double along = high > low ? (drawn.polar_rad - low) / (high - low) : 0.0;
  const auto candela = [&](std::size_t azimuth) {
    const auto* values = candela_.data() + azimuth * polar_.size() + row.index;
    return static_cast<double>(values[0]) + along * static_cast<double>(values[1] - values[0]);
  };
  const double here = candela(column.index) + column.part * (candela(next) - candela(column.index));
  const double flux = column.height * row.height;
  if (flux > 0.0) drawn.weight = here * (std::cos(low) - std::cos(high)) * kDegree * turn / flux;
  return drawn;
}

}  // namespace radiosity::scene
