// Paths through the open space of a scene, as light would come: from places before surfaces, until they see a lamp, the
// sun or the sky. Paths never cross a surface but one that can be seen through. For lit_sides.h and dark_air.h. Plain
// values; questions may be asked by several threads, each with a Random of its own.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <vector>

#include "server/geometry/ray_scene.h"
#include "server/scene/lit_sides.h"

namespace radiosity::scene {

/// splitmix64 (Steele, Lea and Flood 2014).
class Random {
 public:
  explicit Random(std::uint64_t seed) : state_(seed * 0x9E3779B97F4A7C15U) {}
  /// In [0, 1).
  double operator()() {
    std::uint64_t z = state_ += 0x9E3779B97F4A7C15U;
    z = (z ^ z >> 30U) * 0xBF58476D1CE4E5B9U;
    z = (z ^ z >> 27U) * 0x94D049BB133111EBU;
    return static_cast<double>((z ^ z >> 31U) >> 11U) * 0x1.0p-53;
  }

 private:
  std::uint64_t state_;
};

class LightPaths {
 public:
  static constexpr float kFar = 4.0F;      ///< unit box; longer than its diagonal
  static constexpr double kLift = 1.0e-5;  ///< unit box; paths start so far before their surface, well above rounding
  /// After eight diffuse bounces little light is left in any scene.
  static constexpr int kHops = 8;

  /// A place right before a side of a triangle.
  struct Place {
    glm::dvec3 point, normal;
    std::uint32_t triangle;
  };
  /// Lamps and lights about where a path begins.
  struct Near {
    std::vector<std::uint32_t> lamps, lights;
  };

  /// Refers to both.
  LightPaths(const SideScene& scene, const geometry::RayScene& tree);

  [[nodiscard]] const std::vector<std::uint32_t>& lamps() const { return lamps_; }  ///< triangles that shine
  [[nodiscard]] std::uint32_t groupNumber(std::uint32_t triangle) const { return group_of_[triangle]; }
  [[nodiscard]] const std::vector<std::uint32_t>& groups() const { return group_of_; }  ///< by triangle
  [[nodiscard]] glm::dvec3 middleOf(std::uint32_t triangle) const;

  /// Somewhere on a side of a triangle, or of a group, each part of it as likely as any other.
  [[nodiscard]] Place placeOn(std::uint32_t triangle, std::uint32_t side, Random& random) const;
  [[nodiscard]] Place placeIn(const SideScene::Group& group, std::uint32_t side, Random& random) const;
  [[nodiscard]] std::uint32_t drawLamp(Random& random) const;
  [[nodiscard]] std::uint32_t drawLampSide(std::uint32_t lamp, Random& random) const;
  [[nodiscard]] Near nearTo(const glm::dvec3& place) const;

  /// Of so many, at least one, each as likely as any other.
  [[nodiscard]] static std::size_t drawIndex(std::size_t count, Random& random);
  /// By the cosine of the angle to the normal.
  [[nodiscard]] static glm::dvec3 drawDirection(const Place& from, Random& random);
  /// About `axis`.
  [[nodiscard]] static glm::dvec3 around(const glm::dvec3& axis, double cosine, double turn);
  /// What a ray meets; past what one can see through by chance, one time in two.
  [[nodiscard]] bool trace(const Place& from, const glm::dvec3& direction, Random& random, geometry::Hit& hit) const;
  /// What one can see through hides nothing.
  [[nodiscard]] bool isFree(const Place& from, const glm::dvec3& way, float reach) const;
  /// Where a path that met a surface goes on: before the side that it came from. False: that side absorbs.
  [[nodiscard]] bool goOn(const glm::dvec3& direction, const geometry::Hit& hit, Place& at) const;

  /// A lamp or a light, drawn by chance, shines on the place.
  [[nodiscard]] bool seesSource(const Place& at, const Near& near, Random& random) const;
  [[nodiscard]] bool skyShines(const glm::dvec3& direction) const;
  /// The hit is on a lamp's shining side.
  [[nodiscard]] bool shines(const geometry::Hit& hit) const;
  /// Whether a path from there comes to light. `open`: set where it leaves the scene.
  [[nodiscard]] bool findsLight(Place at, const Near& near, Random& random, bool& open) const;

 private:
  [[nodiscard]] double areaOf(std::uint32_t triangle) const;
  [[nodiscard]] glm::dvec3 normalOf(std::uint32_t triangle) const;
  [[nodiscard]] const SideScene::Group& groupOf(std::uint32_t triangle) const {
    return scene_.groups[group_of_[triangle]];
  }
  [[nodiscard]] bool seesLamp(const Place& at, const Near& near, Random& random) const;
  [[nodiscard]] bool seesLight(const Place& at, const Near& near, Random& random) const;

  const SideScene& scene_;
  const geometry::RayScene& tree_;
  std::vector<std::uint32_t> group_of_;  ///< by triangle
  std::vector<double> areas_;            ///< by triangle: of its group's up to and with it
  std::vector<std::uint32_t> lamps_;
  std::vector<double> lamp_areas_;  ///< likewise, summed up
};

}  // namespace radiosity::scene
