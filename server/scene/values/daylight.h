// Skies by day as published models tell them: where the sun stands, and the luminance of the sky around it. Pure
// functions; any thread.
//
// East is +X, the zenith +Y, and so north is -Z.
#pragma once

#include <cstddef>
#include <glm/vec3.hpp>
#include <optional>
#include <string_view>

#include "server/scene/values/sky_picture.h"

namespace radiosity::scene {

/// Diameter of the sun, seen from the earth, degrees.
inline constexpr double kSunDegrees = 0.533;
/// A moment, as days since noon of 2000-01-01, universal time.
struct Moment {
  double days = 0.0;
  int day_of_year = 1;  ///< of the date as it is written
};
/// "2026-06-21T12:00+02:00", with seconds or without, and Z or an offset; nullopt: it is none, or not of 1950 to 2050,
/// for which the sun's place is known.
[[nodiscard]] std::optional<Moment> momentOf(std::string_view text);

/// Where the sun stands, radians: above the horizon, as the atmosphere bends its light; from north by way of east.
struct SunPlace {
  double altitude = 0.0, azimuth = 0.0;
  [[nodiscard]] glm::dvec3 direction() const;
};
/// Good to 0.01 degrees (Michalsky, "The Astronomical Almanac's algorithm for approximate solar position (1950-2050)",
/// Solar Energy 40, 1988).
[[nodiscard]] SunPlace sunAt(const Moment& moment, double latitude_deg, double longitude_deg);

/// Gradation 1 + a exp(b / cos of the zenith angle), times indicatrix 1 + c (exp(d x) - shift) + e cos^2 x, where x is
/// the angle from the sun.
struct SkyShape {
  double a = 0.0, b = -1.0, c = 0.0, d = -1.0, e = 0.0;
  double shift = 0.0;           ///< of the CIE: exp(d pi / 2)
  bool is_traditional = false;  ///< (1 + 2 sin of the altitude) / 3 instead: the CIE overcast sky of Moon and Spencer
  [[nodiscard]] double at(const glm::dvec3& direction, const glm::dvec3& sun) const;
};

/// CIE S 011/E:2003 (ISO 15469:2004), types 1 to 15; 16 is the traditional overcast sky.
inline constexpr int kCieTypes = 16, kCieClear = 12, kCieIntermediate = 7, kCieOvercast = 16;
[[nodiscard]] SkyShape cieShape(int type);

/// What arrives on the horizontal ground from the sky, and on a plane that faces the sun: lux.
struct DaylightLevel {
  double diffuse = 0.0, direct = 0.0;
};
/// Of a clear, an intermediate and an overcast sky (types 11 to 15, 6 to 10, and the others) at this altitude of the
/// sun: IES RP-21-84, "Calculation of daylight availability".
[[nodiscard]] DaylightLevel usualLevel(int cie_type, double altitude, int day_of_year);

/// Irradiance, W/m^2: from the sky on the ground, and from the sun on a plane that faces it.
struct DaylightPower {
  double diffuse = 0.0, direct = 0.0;
};
/// Under a clear sky of this turbidity (Linke): Rigollier, Bauer and Wald, "On the clear sky model of the ESRA", Solar
/// Energy 68, 2000, with optical depths of Kasten 1996.
[[nodiscard]] DaylightPower clearPower(double turbidity, double altitude, int day_of_year);

/// Perez, Seals and Michalsky, "All-weather model for sky luminance distribution", Solar Energy 50, 1993 (and its
/// erratum); illuminances by the efficacies of Perez, Ineichen, Seals, Michalsky and Stewart, Solar Energy 44, 1990.
struct PerezSky {
  SkyShape shape;
  DaylightLevel level;
};
/// `power`: at least one of its numbers above 0.
[[nodiscard]] PerezSky perezSky(const DaylightPower& power, double altitude, int day_of_year);

/// A picture of a sky of this shape that brings `diffuse_lux` to the ground, above a ground of `ground_nits`. White.
/// Cost: some milliseconds.
[[nodiscard]] SkyImage daylightImage(const SkyShape& shape, const glm::dvec3& sun, double diffuse_lux,
                                     double ground_nits);

}  // namespace radiosity::scene
