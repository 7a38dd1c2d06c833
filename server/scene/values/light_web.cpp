#include "server/scene/values/light_web.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <numbers>

#include "server/scene/values/degree.h"

namespace radiosity::scene {
namespace {

/// Between two neighbours of a list: `part` of the way from the first.
struct Between {
  std::size_t first = 0, second = 0;
  float part = 0.0F;
  bool inside = false;
};

Between find(std::span<const float> angles, float at) {
  if (angles.empty() || !(at >= angles.front() && at <= angles.back())) return {};
  if (angles.size() == 1) return {0, 0, 0.0F, true};
  const auto above = std::upper_bound(angles.begin() + 1, angles.end() - 1, at);
  const auto second = static_cast<std::size_t>(above - angles.begin());
  const float low = angles[second - 1], high = angles[second];
  return {second - 1, second, (at - low) / (high - low), true};
}

/// Azimuths are the same after a full turn.
Between findAround(std::span<const float> azimuths, float at) {
  if (azimuths.size() == 1) return {0, 0, 0.0F, true};
  for (const float turn : {0.0F, 360.0F, -360.0F})
    if (const auto found = find(azimuths, at + turn); found.inside) return found;
  return {};
}

/// Integral over polar angles of the interpolant between them, times the sine.
double polarIntegral(std::span<const float> polar, std::span<const float> candela) {
  double sum = 0.0;
  for (std::size_t i = 1; i < polar.size(); ++i) {
    const double low = kDegree * static_cast<double>(polar[i - 1]), high = kDegree * static_cast<double>(polar[i]);
    const double width = high - low, whole = std::cos(low) - std::cos(high);
    const double rising = (std::sin(high) - std::sin(low) - width * std::cos(high)) / width;
    const auto first = static_cast<double>(candela[i - 1]), second = static_cast<double>(candela[i]);
    sum += first * whole + (second - first) * rising;
  }
  return sum;
}

double lumensOf(std::span<const float> polar, std::span<const float> azimuth, std::span<const float> candela) {
  const auto column = [&](std::size_t a) {
    return polarIntegral(polar, candela.subspan(a * polar.size(), polar.size()));
  };
  double before = column(0);
  if (azimuth.size() == 1) return 2.0 * std::numbers::pi * before;
  double sum = 0.0;
  for (std::size_t a = 1; a < azimuth.size(); ++a) {
    const double here = column(a);
    sum += 0.5 * (before + here) * kDegree * static_cast<double>(azimuth[a] - azimuth[a - 1]);
    before = here;
  }
  return sum;
}

std::uint64_t keyOf(std::span<const float> table) {
  std::uint64_t key = 0xcbf29ce484222325ULL;  // FNV-1a, by words
  for (const float value : table) key = (key ^ std::bit_cast<std::uint32_t>(value)) * 0x100000001b3ULL;
  return key ^ key >> 32U;
}

}  // namespace

LightWeb LightWeb::of(const std::vector<float>& polar_deg, const std::vector<float>& azimuth_deg,
                      const std::vector<float>& candela) {
  LightWeb web;
  web.table = {static_cast<float>(polar_deg.size()), static_cast<float>(azimuth_deg.size())};
  for (const auto* list : {&polar_deg, &azimuth_deg, &candela})
    web.table.insert(web.table.end(), list->begin(), list->end());
  web.lumens = lumensOf(polar_deg, azimuth_deg, candela);
  web.key = keyOf(web.table);
  return web;
}

bool isWebTable(std::span<const float> table) {
  if (table.size() < kWebHead) return false;
  const float polar = table[0], azimuth = table[1];
  if (!(polar >= 2.0F && azimuth >= 1.0F && polar <= static_cast<float>(kMostWebCandela) &&
        azimuth <= static_cast<float>(kMostWebCandela)))
    return false;
  const auto rows = static_cast<std::size_t>(polar), columns = static_cast<std::size_t>(azimuth);
  return rows * columns <= kMostWebCandela && table.size() == kWebHead + rows + columns + rows * columns;
}

float webCandela(std::span<const float> table, float polar_deg, float azimuth_deg) {
  const auto rows = static_cast<std::size_t>(table[0]), columns = static_cast<std::size_t>(table[1]);
  const auto p = find(table.subspan(kWebHead, rows), polar_deg);
  const auto a = findAround(table.subspan(kWebHead + rows, columns), azimuth_deg);
  if (!p.inside || !a.inside) return 0.0F;
  const auto candela = table.subspan(kWebHead + rows + columns);
  const auto along = [&](std::size_t column) {
    const float low = candela[column * rows + p.first], high = candela[column * rows + p.second];
    return low + p.part * (high - low);
  };
  const float first = along(a.first);
  return a.part > 0.0F ? first + a.part * (along(a.second) - first) : first;
}

}  // namespace radiosity::scene
