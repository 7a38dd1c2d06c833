#include "server/scene/values/daylight.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <glm/geometric.hpp>
#include <numbers>

#include "server/scene/values/degree.h"

namespace radiosity::scene {
namespace {

using std::numbers::pi;
/// Of pictures of the models, which vary slowly: 0.7 degrees.
constexpr std::size_t kWidth = 512, kHeight = 256;
/// Cosine of the zenith angle at the horizon, where gradations have none.
constexpr double kLeastHeight = 1e-3;
constexpr double kSolarWatts = 1367.0, kSolarLux = 127.5e3;

double wrapped(double degrees) { return degrees - 360.0 * std::floor(degrees / 360.0); }

/// So many digits, and then `after` (0: nothing), which is taken off.
std::optional<int> digits(std::string_view& text, std::size_t count, char after) {
  int value = 0;
  if (text.size() < count) return std::nullopt;
  const auto [end, error] = std::from_chars(text.data(), text.data() + count, value);
  if (error != std::errc() || end != text.data() + count || value < 0 || text.front() == '-') return std::nullopt;
  text.remove_prefix(count);
  if (after == 0) return value;
  if (text.empty() || text.front() != after) return std::nullopt;
  text.remove_prefix(1);
  return value;
}

bool isLeap(int year) { return (year % 4 == 0 && year % 100 != 0) || year % 400 == 0; }

/// From 1.
std::optional<int> dayOfYear(int year, int month, int day) {
  constexpr std::array kDays{31, 28, 31, 30, 31, 30, 31, 31, 30, 31, 30, 31};
  if (month < 1 || month > 12) return std::nullopt;
  const auto length = [&](int of) {
    return kDays[static_cast<std::size_t>(of - 1)] + (of == 2 && isLeap(year) ? 1 : 0);
  };
  if (day < 1 || day > length(month)) return std::nullopt;
  int sum = day;
  for (int before = 1; before < month; ++before) sum += length(before);
  return sum;
}

/// Minutes ahead of universal time.
std::optional<int> offsetOf(std::string_view text) {
  if (text == "Z") return 0;
  if (text.empty() || (text.front() != '+' && text.front() != '-')) return std::nullopt;
  const int sign = text.front() == '+' ? 1 : -1;
  text.remove_prefix(1);
  const auto hours = digits(text, 2, ':');
  const auto minutes = hours ? digits(text, 2, 0) : std::nullopt;
  if (!minutes || !text.empty() || *hours > 14 || *minutes > 59) return std::nullopt;
  return sign * (60 * *hours + *minutes);
}

/// Square of the mean distance of the sun by that of the day (Spencer 1971).
double eccentricity(int day_of_year) {
  const double angle = 2.0 * pi * (day_of_year - 1) / 365.0;
  return 1.00011 + 0.034221 * std::cos(angle) + 0.00128 * std::sin(angle) + 0.000719 * std::cos(2.0 * angle) +
         0.000077 * std::sin(2.0 * angle);
}

/// Kasten and Young 1989.
double airMass(double altitude) {
  const double degrees = std::max(0.0, altitude) / kDegree;
  return 1.0 / (std::sin(std::max(0.0, altitude)) + 0.50572 * std::pow(degrees + 6.07995, -1.6364));
}

/// Bins of clearness (Perez 1990).
std::size_t binOf(double clearness) {
  constexpr std::array kBins{1.065, 1.230, 1.500, 1.950, 2.800, 4.500, 6.200};
  return static_cast<std::size_t>(std::ranges::upper_bound(kBins, clearness) - kBins.begin());
}

/// By bin: a1 to a4, b1 to b4 ... e1 to e4.
constexpr double kPerez[8][5][4] = {{{1.3525, -0.2576, -0.2690, -1.4366},
                                     {-0.7670, 0.0007, 1.2734, -0.1233},
                                     {2.8000, 0.6004, 1.2375, 1.0000},
                                     {1.8734, 0.6297, 0.9738, 0.2809},
                                     {0.0356, -0.1246, -0.5718, 0.9938}},
                                    {{-1.2219, -0.7730, 1.4148, 1.1016},
                                     {-0.2054, 0.0367, -3.9128, 0.9156},
                                     {6.9750, 0.1774, 6.4477, -0.1239},
                                     {-1.5798, -0.5081, -1.7812, 0.1080},
                                     {0.2624, 0.0672, -0.2190, -0.4285}},
                                    {{-1.1000, -0.2515, 0.8952, 0.0156},
                                     {0.2782, -0.1812, -4.5000, 1.1766},
                                     {24.7219, -13.0812, -37.7000, 34.8438},
                                     {-5.0000, 1.5218, 3.9229, -2.6204},
                                     {-0.0156, 0.1597, 0.4199, -0.5562}},
                                    {{-0.5484, -0.6654, -0.2672, 0.7117},
                                     {0.7234, -0.6219, -5.6812, 2.6297},
                                     {33.3389, -18.3000, -62.2500, 52.0781},
                                     {-3.5000, 0.0016, 1.1477, 0.1062},
                                     {0.4659, -0.3296, -0.0876, -0.0329}},
                                    {{-0.6000, -0.3566, -2.5000, 2.3250},
                                     {0.2937, 0.0496, -5.6812, 1.8415},
                                     {21.0000, -4.7656, -21.5906, 7.2492},
                                     {-3.5000, -0.1554, 1.4062, 0.3988},
                                     {0.0032, 0.0766, -0.0656, -0.1294}},
                                    {{-1.0156, -0.3670, 1.0078, 1.4051},
                                     {0.2875, -0.5328, -3.8500, 3.3750},
                                     {14.0000, -0.9999, -7.1406, 7.5469},
                                     {-3.4000, -0.1078, -1.0750, 1.5702},
                                     {-0.0672, 0.4016, 0.3017, -0.4844}},
                                    {{-1.0000, 0.0211, 0.5025, -0.5119},
                                     {-0.3000, 0.1922, 0.7023, -1.6317},
                                     {19.0000, -5.0000, 1.2438, -1.9094},
                                     {-4.0000, 0.0250, 0.3844, 0.2656},
                                     {1.0468, -0.3788, -2.4517, 1.4656}},
                                    {{-1.0500, 0.0289, 0.4260, 0.3590},
                                     {-0.3250, 0.1156, 0.7781, 0.0025},
                                     {31.0625, -14.5000, -46.1148, 55.3750},
                                     {-7.2312, 0.4050, 13.3500, 0.6234},
                                     {1.5000, -0.6426, 1.8564, 0.5636}}};

/// By bin: lm/W of the sky, and of the sun (Perez 1990, tables 4).
constexpr double kDiffuseEfficacy[8][4] = {{97.24, -0.46, 12.00, -8.91},   {107.22, 1.15, 0.59, -3.95},
                                           {104.97, 2.96, -5.53, -8.77},   {102.39, 5.59, -13.95, -13.90},
                                           {100.71, 5.94, -22.75, -23.74}, {106.42, 3.83, -36.15, -28.83},
                                           {141.88, 1.90, -53.24, -14.03}, {152.23, 0.35, -45.27, -7.98}};
constexpr double kDirectEfficacy[8][4] = {{57.20, -4.55, -2.98, 117.12}, {98.99, -3.46, -1.21, 12.38},
                                          {109.83, -4.90, -1.71, -8.81}, {110.34, -5.84, -1.99, -4.56},
                                          {106.36, -3.97, -1.75, -6.16}, {107.19, -1.25, -1.51, -26.73},
                                          {105.75, 0.77, -1.26, -34.44}, {101.18, 1.58, -1.10, -8.29}};
/// Water in the air, cm.
constexpr double kWater = 2.0;

SkyShape perezShape(double clearness, double brightness, double zenith) {
  const auto bin = binOf(clearness);
  const auto of = [&](std::size_t k) {
    const auto& x = kPerez[bin][k];
    return x[0] + x[1] * zenith + brightness * (x[2] + x[3] * zenith);
  };
  SkyShape shape{.a = of(0), .b = of(1), .c = of(2), .d = of(3), .e = of(4)};
  if (bin == 0) {
    const auto &c = kPerez[0][2], &d = kPerez[0][3];
    shape.c = std::exp(std::pow(brightness * (c[0] + c[1] * zenith), c[2])) - c[3];
    shape.d = -std::exp(brightness * (d[0] + d[1] * zenith)) + d[2] + brightness * d[3];
  }
  shape.b = std::min(shape.b, 0.0);  // above 0 the gradation has no end at the horizon
  return shape;
}

}  // namespace

std::optional<Moment> momentOf(std::string_view text) {
  const auto year = digits(text, 4, '-');
  const auto month = year ? digits(text, 2, '-') : std::nullopt;
  const auto day = month ? digits(text, 2, 'T') : std::nullopt;
  const auto hour = day ? digits(text, 2, ':') : std::nullopt;
  const auto minute = hour ? digits(text, 2, 0) : std::nullopt;
  if (!minute || *year < 1950 || *year > 2050 || *hour > 23 || *minute > 59) return std::nullopt;
  int second = 0;
  if (text.starts_with(':')) {
    text.remove_prefix(1);
    const auto given = digits(text, 2, 0);
    if (!given || *given > 59) return std::nullopt;
    second = *given;
    if (text.starts_with('.')) {  // of a second, as JavaScript writes it
      const auto end = std::min(text.find_first_not_of("0123456789", 1), text.size());
      if (end == 1) return std::nullopt;
      text.remove_prefix(end);
    }
  }
  const auto offset = offsetOf(text);
  const auto of_year = dayOfYear(*year, *month, *day);
  if (!offset || !of_year) return std::nullopt;
  const int before = *year - 1950, leaps = (*year - 1949) / 4;  // 2000 was one; of 1950 to 2050 every fourth is
  const double days = 365.0 * before + leaps + *of_year - 1;    // since 1950-01-01
  const double hours = *hour + (*minute - *offset) / 60.0 + second / 3600.0;
  constexpr double kTo2000 = 18262.5;
  return Moment{days - kTo2000 + hours / 24.0, *of_year};
}

glm::dvec3 SunPlace::direction() const {
  return {std::cos(altitude) * std::sin(azimuth), std::sin(altitude), -std::cos(altitude) * std::cos(azimuth)};
}

SunPlace sunAt(const Moment& moment, double latitude_deg, double longitude_deg) {
  const double n = moment.days;
  const double anomaly = kDegree * wrapped(357.528 + 0.9856003 * n);
  const double longitude =
      kDegree * wrapped(280.460 + 0.9856474 * n + 1.915 * std::sin(anomaly) + 0.020 * std::sin(2.0 * anomaly));
  const double tilt = kDegree * (23.439 - 4e-7 * n);
  const double ascension = std::atan2(std::cos(tilt) * std::sin(longitude), std::cos(longitude));
  const double declination = std::asin(std::sin(tilt) * std::sin(longitude));
  const double midnight = std::floor(n + 0.5) - 0.5, universal = 24.0 * (n - midnight);
  const double sidereal = 6.697375 + 0.0657098242 * n + universal;  // hours
  const double hour = kDegree * wrapped(15.0 * sidereal + longitude_deg) - ascension;
  const double latitude = kDegree * latitude_deg;
  const double height =
      std::sin(declination) * std::sin(latitude) + std::cos(declination) * std::cos(latitude) * std::cos(hour);
  const double east = -std::cos(declination) * std::sin(hour);
  const double north =
      std::sin(declination) * std::cos(latitude) - std::cos(declination) * std::sin(latitude) * std::cos(hour);
  SunPlace place{std::asin(std::clamp(height, -1.0, 1.0)), std::atan2(east, north)};
  const double degrees = place.altitude / kDegree;
  if (degrees > -0.56)
    place.altitude += kDegree * 3.51561 * (0.1594 + 0.0196 * degrees + 0.00002 * degrees * degrees) /
                      (1.0 + 0.505 * degrees + 0.0845 * degrees * degrees);
  return place;
}

double SkyShape::at(const glm::dvec3& direction, const glm::dvec3& sun) const {
  const double height = std::max(direction.y, kLeastHeight);
  if (is_traditional) return (1.0 + 2.0 * std::max(0.0, direction.y)) / 3.0;
  const double cosine = std::clamp(glm::dot(direction, sun), -1.0, 1.0), angle = std::acos(cosine);
  const double gradation = 1.0 + a * std::exp(b / height);
  return std::max(0.0, gradation * (1.0 + c * (std::exp(d * angle) - shift) + e * cosine * cosine));
}

SkyShape cieShape(int type) {
  constexpr double kGradation[6][2] = {{4.0, -0.70},  {1.1, -0.80},  {0.0, -1.0},
                                       {-1.0, -0.55}, {-1.0, -0.32}, {-1.0, -0.15}};
  constexpr double kIndicatrix[6][3] = {{0.0, -1.0, 0.0},   {2.0, -1.5, 0.15},  {5.0, -2.5, 0.30},
                                        {10.0, -3.0, 0.45}, {16.0, -3.0, 0.30}, {24.0, -2.8, 0.15}};
  constexpr int kOfType[15][2] = {{0, 0}, {0, 1}, {1, 0}, {1, 1}, {2, 0}, {2, 1}, {2, 2}, {2, 3},
                                  {3, 1}, {3, 2}, {3, 3}, {4, 3}, {4, 4}, {5, 4}, {5, 5}};
  if (type >= kCieTypes) return {.is_traditional = true};
  const auto& of = kOfType[std::max(type, 1) - 1];
  const auto& gradation = kGradation[of[0]];
  const auto& indicatrix = kIndicatrix[of[1]];
  SkyShape shape{.a = gradation[0], .b = gradation[1], .c = indicatrix[0], .d = indicatrix[1], .e = indicatrix[2]};
  shape.shift = std::exp(shape.d * pi / 2.0);
  return shape;
}

DaylightLevel usualLevel(int cie_type, double altitude, int day_of_year) {
  if (altitude <= 0.0) return {};
  const double sine = std::sin(altitude), sun = kSolarLux * eccentricity(day_of_year);
  if (cie_type >= 11 && cie_type <= 15)
    return {800.0 + 15'500.0 * std::sqrt(sine), sun * std::exp(-0.21 * airMass(altitude))};
  if (cie_type >= 6 && cie_type <= 10) return {300.0 + 45'000.0 * sine, sun * std::exp(-0.80 * airMass(altitude))};
  return {300.0 + 21'000.0 * sine, 0.0};
}

DaylightPower clearPower(double turbidity, double altitude, int day_of_year) {
  if (altitude <= 0.0) return {};
  const double outside = kSolarWatts * eccentricity(day_of_year), m = airMass(altitude), sine = std::sin(altitude);
  const double depth =
      m <= 20.0 ? 1.0 / (6.6296 + m * (1.7513 + m * (-0.1202 + m * (0.0065 - 0.00013 * m)))) : 1.0 / (10.4 + 0.718 * m);
  const double t = turbidity, through = -1.5843e-2 + 3.0543e-2 * t + 3.797e-4 * t * t;
  const double a0 = std::max(2.6463e-1 - 6.1581e-2 * t + 3.1408e-3 * t * t, 2e-3 / through);
  const double a1 = 2.0402 + 1.8945e-2 * t - 1.1161e-2 * t * t, a2 = -1.3025 + 3.9231e-2 * t + 8.5079e-3 * t * t;
  return {outside * through * std::max(0.0, a0 + a1 * sine + a2 * sine * sine),
          outside * std::exp(-0.8662 * t * m * depth)};
}

PerezSky perezSky(const DaylightPower& power, double altitude, int day_of_year) {
  const double zenith = pi / 2.0 - std::max(0.0, altitude), cubed = 1.041 * zenith * zenith * zenith;
  const double diffuse = std::max(power.diffuse, 1e-3);
  const double clearness = std::clamp(((diffuse + power.direct) / diffuse + cubed) / (1.0 + cubed), 1.0, 12.0);
  double brightness = std::clamp(diffuse * airMass(altitude) / (kSolarWatts * eccentricity(day_of_year)), 0.01, 0.6);
  const auto bin = binOf(clearness);
  const auto &sky = kDiffuseEfficacy[bin], &sun = kDirectEfficacy[bin];
  PerezSky made;
  made.level.diffuse = power.diffuse * std::max(0.0, sky[0] + sky[1] * kWater + sky[2] * std::cos(zenith) +
                                                         sky[3] * std::log(brightness));
  made.level.direct = power.direct * std::max(0.0, sun[0] + sun[1] * kWater + sun[2] * std::exp(5.73 * zenith - 5.0) +
                                                       sun[3] * brightness);
  if (clearness > 1.065 && clearness < 2.8) brightness = std::max(brightness, 0.2);  // the erratum
  made.shape = perezShape(clearness, brightness, zenith);
  return made;
}

SkyImage daylightImage(const SkyShape& shape, const glm::dvec3& sun, double diffuse_lux, double ground_nits) {
  SkyImage image{kWidth, kHeight, std::vector<glm::vec3>(kWidth * kHeight, glm::vec3(static_cast<float>(ground_nits)))};
  double arrives = 0.0;  // for a luminance of the shape
  for (std::size_t y = 0; y < kHeight / 2; ++y) {
    const double top = std::cos(pi * static_cast<double>(y) / kHeight);
    const double bottom = std::cos(pi * static_cast<double>(y + 1) / kHeight);
    const double height = 0.5 * (top + bottom), across = std::sqrt(1.0 - height * height);
    for (std::size_t x = 0; x < kWidth; ++x) {
      const double azimuth = (2.0 * (static_cast<double>(x) + 0.5) / kWidth - 1.0) * pi;
      const double nits = shape.at({across * std::cos(azimuth), height, across * std::sin(azimuth)}, sun);
      image.texels[y * kWidth + x] = glm::vec3(static_cast<float>(nits));
      arrives += nits * 2.0 * pi / kWidth * 0.5 * (top * top - bottom * bottom);
    }
  }
  for (std::size_t i = 0; i < kWidth * kHeight / 2; ++i) {
    auto& texel = image.texels[i];  // a shape that is black everywhere tells nothing of where light comes from
    texel = arrives > 0.0 ? texel * static_cast<float>(diffuse_lux / arrives)
                          : glm::vec3(static_cast<float>(diffuse_lux / pi));
  }
  return image;
}

}  // namespace radiosity::scene
