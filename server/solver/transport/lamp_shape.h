// Lamps that are no surfaces but have a size, or shine unlike in different directions: what they bring to a place, all
// of them or from one of their points. They hide nothing. So are suns and parts of the sky, which are as far from all
// places. Plain values, as they travel to the renderers; any thread.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <span>

namespace radiosity::solver {

/// Unit box. What it brings is for an intensity of one: candela of a ball, along the axis of all others; of a web, a
/// factor of its candela; of a sun, lux on a plane that faces it; of a sky, lux of all directions together.
struct LampShape {
  enum class Kind : std::uint32_t {
    kWeb,        ///< a point with a web
    kBall,       ///< of even radiance
    kRectangle,  ///< shines along the axis by the cosine
    kDisc,       ///< the same
    kSpotDisc,   ///< each of its points is a spot (KHR_lights_punctual)
    kSun,        ///< even light from within a cone of directions
    kSky,        ///< light from directions that its table tells (scene::skyTable)
  };
  Kind kind = Kind::kBall;
  glm::vec3 centre{0.0F};
  glm::vec3 axis{0.0F};     ///< unit; of a web: where the polar angle is 0; of a sun: towards it
  glm::vec3 across{0.0F};   ///< unit; along the width, or where the azimuth is 0; of a sky: where +X of its table is
  glm::vec2 half{0.0F};     ///< of width and height; the first is the radius of what is round, of a sun its sine
  float cone_scale = 0.0F;  ///< falloff of a spot: clamp(cos x scale + offset, 0, 1)^2
  float cone_offset = 1.0F;
  float range = 0.0F;  ///< faded out there, as KHR_lights_punctual has it; 0: none

  bool operator==(const LampShape&) const = default;

  /// wholeIrradiance() knows what all of it brings: of a spot with a size, only its points.
  [[nodiscard]] bool hasClosedForm() const {
    return kind != Kind::kSpotDisc && kind != Kind::kWeb && kind != Kind::kSky;
  }
  /// It has a table.
  [[nodiscard]] bool hasTable() const { return kind == Kind::kWeb || kind == Kind::kSky; }
  /// It has no place, and its rays are parallel, or nearly.
  [[nodiscard]] bool isFar() const { return kind == Kind::kSun || kind == Kind::kSky; }
  /// It shines by the cosine with its axis.
  [[nodiscard]] bool isFlat() const { return kind == Kind::kRectangle || kind == Kind::kDisc; }
  /// Of one that has an axis; uniform where `at` is, in [0, 1)^2.
  [[nodiscard]] glm::dvec3 pointOn(const glm::dvec2& at) const;
  /// Nothing of it is farther from its centre.
  [[nodiscard]] float reach() const;
};

/// `web`: LightWeb::table of a lamp that has one, or the table of a sky.
struct Lamp {
  LampShape shape;
  std::span<const float> web;

  /// Intensity in a direction from the lamp (unit length).
  [[nodiscard]] float strength(const glm::vec3& direction) const;
  /// Of what arrives from so far.
  [[nodiscard]] double fade(double distance) const;
};

/// Irradiance where nothing hides the lamp, exactly, where it has a closed form; else as if all of it were its centre,
/// or, of a sky, as if what of its light is in no one direction came evenly from all sides.
[[nodiscard]] double wholeIrradiance(const Lamp& lamp, const glm::dvec3& place, const glm::dvec3& normal);

/// A point of it, and what all of it would bring if it were as bright, and as near, as there. The mean over `at`, which
/// is uniform in [0, 1)^2, is wholeIrradiance().
struct LampPoint {
  glm::dvec3 position{0.0};
  double brings = 0.0;
};
[[nodiscard]] LampPoint lampPoint(const Lamp& lamp, const glm::dvec3& place, const glm::dvec3& normal,
                                  const glm::dvec2& at);

/// A ray that leaves it; `weight` is in proportion to the light that such rays stand for. Of what is far the origin is
/// the direction towards it.
struct LampRay {
  glm::vec3 origin{0.0F}, direction{0.0F};
  double weight = 0.0;
};
/// `at`: uniform in [0, 1)^4. Of any lamp but a web: LampRays draws from all.
[[nodiscard]] LampRay lampRay(const Lamp& lamp, const std::array<double, 4>& at);

/// Flux for an intensity of one, unit^2 sr; of a spot with a size, that of a spot without counts; of what is far, what
/// enters the scene.
[[nodiscard]] double lampFlux(const LampShape& shape, double web_lumens);

/// What looks at single points of a lamp tell of all of it. Where all are seen that is the closed form, and 0 where
/// none is; between, it is nearly right in the mean: the part of the others that are seen stands for what a look's own
/// point does not tell of.
class LampLooks {
 public:
  /// `whole`: what all of the lamp would bring to the place of a look; `brings`: its point, which may be hidden.
  void ask(float whole, float brings) {
    ++asked_;
    lacking_ += whole - brings;
  }
  /// The look's point is below the horizon.
  void pass(float whole) { beside_ += whole; }
  /// A point that was asked is seen.
  void see(float whole, float brings) {
    ++seen_;
    brought_ += brings;
    lacking_seen_ += whole - brings;
  }
  /// Of `looks` in all.
  [[nodiscard]] float irradiance(std::uint32_t looks) const;

 private:
  std::uint32_t asked_ = 0, seen_ = 0;
  float brought_ = 0.0F, lacking_ = 0.0F, lacking_seen_ = 0.0F, beside_ = 0.0F;
};

}  // namespace radiosity::solver
