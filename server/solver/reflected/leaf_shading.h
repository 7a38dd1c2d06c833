// Which leaves light is told for another normal of than their own, and what that makes of the light of an emitter:
// the part of it above both horizons, weighed by the cosine with the shading normal, beside what geometry makes of it.
// Light is transported with geometric normals; nothing here feeds back into it. Immutable; any thread.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <span>
#include <vector>

#include "server/scene/shading/shading_normals.h"
#include "server/scene/values/patch_scene.h"
#include "server/solver/patches/side.h"

namespace radiosity::solver {

/// A place on a leaf; both normals on its lit side, unit length.
struct ShadedPlace {
  glm::dvec3 position{0.0}, geometric{0.0}, shading{0.0};
};

class LeafShading {
 public:
  LeafShading() = default;
  /// `patches` and `sides` are to outlive it.
  LeafShading(const scene::PatchScene& patches, const std::vector<Side>& sides,
              std::shared_ptr<const scene::ShadingNormals> normals);

  /// No leaf has such a normal.
  [[nodiscard]] bool empty() const { return normal_.empty(); }
  /// Leaves of a side that has such leaves have consecutive numbers.
  struct ShadedSide {
    std::uint32_t side = 0, first = 0;
  };
  [[nodiscard]] std::span<const ShadedSide> sides() const { return shaded_; }
  /// Of all these sides.
  [[nodiscard]] std::size_t size() const { return normal_.size(); }
  /// By number: unit length; 0 where it is the geometric one, or no leaf is.
  [[nodiscard]] const glm::vec3& normal(std::size_t number) const { return normal_[number]; }
  /// The number of a leaf value whose normal is not the geometric one; kNone: it has none.
  [[nodiscard]] std::uint32_t numberOf(std::uint32_t value) const;

  /// A leaf is looked at in so many places at most.
  static constexpr std::size_t kMostPlaces = 16;
  /// Of a leaf that has a normal: spread over what is left of it where something cuts it or it lies on several
  /// triangles. Returns how many.
  std::size_t places(const Side& side, std::uint32_t leaf, std::span<ShadedPlace, kMostPlaces> places) const;
  /// Of any leaf that has area: in the place of its spot `texel` of `triangle`.
  [[nodiscard]] ShadedPlace place(const Side& side, const scene::LeafSpot& spot) const;

 private:
  [[nodiscard]] glm::vec3 normalOf(const Side& side, std::uint32_t leaf) const;

  const scene::PatchScene* patches_ = nullptr;
  const std::vector<Side>* sides_ = nullptr;
  std::shared_ptr<const scene::ShadingNormals> normals_;
  std::vector<ShadedSide> shaded_;
  std::vector<glm::vec3> normal_;
};

/// Something that shines at leaves, as large or small as need be.
struct ShadingEmitter {
  enum class Kind {
    kPolygon,    ///< `corners`, convex, seen from its lit side
    kPoint,      ///< `at`
    kDirection,  ///< `at`: towards it, unit length
    kSky,        ///< the hemisphere around `at`, evenly
    kPatches,    ///< `patches`
    kDirections  ///< the positions of `patches`: directions, unit length
  } kind = Kind::kPolygon;
  std::span<const glm::vec3> corners;
  glm::dvec3 at{0.0};
  struct Patch {
    glm::dvec3 position, normal;
    double area;
  };
  std::vector<Patch> patches;
};

/// What arrives at these places for the shading normal, of what does for the geometric one. 1 where nothing does, as
/// far as places without extent can tell.
[[nodiscard]] double shadedPart(const ShadingEmitter& emitter, std::span<const ShadedPlace> places);

}  // namespace radiosity::solver
