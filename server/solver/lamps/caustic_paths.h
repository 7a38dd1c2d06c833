// Light that lamps send to leaves by way of metal and glass, path by path from the lamp (Arvo 1986, "Backward ray
// tracing"): caustics. Rays from the leaves find a small lamp in rough metal seldom, and in what is curved or far away
// hardly ever, while of what a lamp sends to mirrors every path arrives somewhere. What a leaf gets on the whole is all
// that there is to know of it, so that no path is spread over its neighbours, and nothing is blurred. Immutable; any
// thread.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>
#include <memory>
#include <span>
#include <vector>

#include "server/solver/lamps/lamp_images.h"
#include "server/solver/patches/lights.h"
#include "server/solver/rays/leaf_rays.h"
#include "server/solver/rays/specular_leaves.h"

namespace radiosity::solver {

class CausticPaths {
 public:
  /// Of more lamps none are followed.
  static constexpr std::size_t kMostLamps = LampImages::kMostImages;

  /// Of these lamps, which may be dark. Null: there is nothing that reflects, or no lamp, or there are too many. Cost:
  /// O(leaves).
  [[nodiscard]] static std::shared_ptr<const CausticPaths> find(std::span<const Side> sides,
                                                                std::shared_ptr<const LeafRays> rays,
                                                                std::shared_ptr<const SpecularLeaves> mirrors,
                                                                std::span<const LightPolygon> polygons);

  [[nodiscard]] std::size_t lampCount() const { return polygons_.size(); }
  /// Stays while a lamp, and what reflects, stay as they are, in one scene.
  [[nodiscard]] std::uint64_t keyOf(std::size_t lamp) const { return keys_[lamp]; }

  /// Of a lamp's light, what those leaves reflect at first if nothing stands between, about.
  [[nodiscard]] double partOf(std::size_t lamp) const { return part_[lamp]; }

  /// Of what lamps light of all leaves that reflect, the part on leaves that no image is in, about; null: of none.
  [[nodiscard]] double partOutside(const LampImages* images) const;

  /// Leaves that reflect, by how much of a lamp's light each is likely to: where paths begin.
  class Starts {
   public:
    struct Start {
      std::size_t which = 0;  ///< of the leaves that reflect
      double along = 0.0;     ///< what is left of the number that chose it, uniform in [0, 1)
    };
    [[nodiscard]] Start at(double number) const;
    [[nodiscard]] double chanceOf(std::size_t which) const;
    [[nodiscard]] bool empty() const { return below_.empty(); }

   private:
    friend class CausticPaths;
    std::vector<double> below_;  ///< by leaf that reflects: the sum of the chances up to it
  };
  /// O(leaves that reflect). Its paths are to outlive it.
  [[nodiscard]] Starts startsOf(std::size_t lamp) const;

  /// Where a path reaches a leaf that takes light.
  struct Arrival {
    LeafRays::Place place;      ///< `value`: the leaf
    glm::dvec3 direction{0.0};  ///< that it came along
    glm::dvec3 flux{0.0};       ///< of an emission of one, unit box squared: its mean over paths is what all bring
  };
  static constexpr std::size_t kMostArrivals = SpecularLeaves::kMostHops;
  /// How paths leave a lamp: towards a leaf that reflects, or, one of so many, into any direction.
  enum class Way { kTowards, kAnywhere };
  static constexpr std::uint32_t kOneAnywhere = 4;
  /// Where one path arrives; `draw`: uniform in [0, 1)^4, `key`: for all other chance. Returns how many, at most
  /// kMostArrivals: a path goes on from what reflects in part only. Cost: two rays at least.
  std::size_t follow(std::size_t lamp, const Starts& starts, Way way, const glm::dvec4& draw, std::uint64_t key,
                     std::span<Arrival, kMostArrivals> arrivals) const;

 private:
  CausticPaths() = default;
  /// Light on its way, before it is reflected by what it met.
  struct Light {
    LeafRays::Place met;
    glm::dvec3 direction{0.0}, flux{0.0};
  };
  [[nodiscard]] Light towards(std::size_t lamp, const Starts& starts, const glm::dvec4& draw) const;
  [[nodiscard]] Light anywhere(std::size_t lamp, const Starts& starts, const glm::dvec4& draw, std::uint64_t key) const;
  [[nodiscard]] Light between(const LightPolygon& lamp, const glm::dvec3& from, const glm::dvec3& to,
                              double density) const;
  [[nodiscard]] double litPart(const LightPolygon& lamp, const LampImages* but_images = nullptr) const;
  [[nodiscard]] bool reflects(std::uint32_t value) const {
    return !LeafRays::isSky(value) && value != LeafRays::kNothing && mirrors_->has(value);
  }

  std::shared_ptr<const LeafRays> rays_;
  std::shared_ptr<const SpecularLeaves> mirrors_;
  std::vector<LightPolygon> polygons_;
  std::vector<std::uint64_t> keys_;    ///< by lamp
  std::vector<double> part_;           ///< likewise
  std::vector<std::uint32_t> leaves_;  ///< that reflect and have area
  std::vector<float> weight_;          ///< by these: area, times what is reflected of light from all around
  std::vector<float> covered_;         ///< by these: LeafRays::coveredAreaOf()
};

}  // namespace radiosity::solver
