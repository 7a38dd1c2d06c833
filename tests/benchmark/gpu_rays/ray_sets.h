// Rays as a solve casts them, what the processor's tree says of each, and whether what a card says is right.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <string>
#include <vector>

#include "common/result.h"
#include "server/geometry/bvh.h"
#include "server/scene/values/patch_scene.h"
#include "server/solver/patches/side.h"
#include "server/solver/rays/leaf_rays.h"

namespace radiosity::benchmarks {

/// As rays.comp reads it.
struct CastRay {
  glm::vec3 origin{0.0F};
  std::uint32_t own = scene::kNone;  ///< triangle that it does not meet
  glm::vec3 direction{0.0F};
  float reach = 0.0F;
};

struct RaySet {
  std::vector<CastRay> rays;
  bool any = false;  ///< asks whether something lies between, not what
};

/// Which rays lie beside each other: those of a leaf; the first of all leaves, then the second; or, of each 64 leaves,
/// those of like direction.
enum class RayOrder { kByLeaf, kByNumber, kByDirection };

/// A scene with its leaves. Stays where it is.
class RayScene {
 public:
  /// `name`: a file, or "room:N", a room of N random rectangles.
  [[nodiscard]] static Result<std::unique_ptr<RayScene>> load(const std::string& name, std::uint64_t texels);

  [[nodiscard]] const std::vector<scene::Bvh::Triangle>& triangles() const { return triangles_; }
  [[nodiscard]] std::size_t leafCount() const { return leaves_.size(); }
  /// From places on leaves, with probability proportional to the cosine, leaf after leaf: as solver::LeafSights.
  [[nodiscard]] RaySet leafRays(std::uint32_t of_each) const;
  /// From the same places to the middle of the brightest leaf, of those that face each other.
  [[nodiscard]] RaySet lampRays(std::uint32_t of_each) const;
  /// By number of a leaf that has area, of_each in a row: which such leaf its rays end on, or leafCount().
  [[nodiscard]] std::vector<std::uint32_t> leafHits(std::uint32_t of_each) const;

 private:
  explicit RayScene(std::shared_ptr<const scene::PatchScene> patches);
  [[nodiscard]] std::uint32_t brightest(const scene::PatchMaterials& materials) const;

  std::shared_ptr<const scene::PatchScene> patches_;
  std::vector<scene::Bvh::Triangle> triangles_;
  std::vector<solver::Side> sides_;
  std::unique_ptr<solver::LeafRays> rays_;
  std::vector<std::uint32_t> leaves_;  ///< values that have area
  solver::LeafRays::Place lamp_;
};

[[nodiscard]] RaySet inOrder(const RaySet& set, RayOrder order, std::uint32_t of_each);

/// By ray, as rays.comp tells it: triangle and, in the highest bit, whether it shows its front, or kNone; whether
/// something was met, where the set asks no more.
struct Answers {
  std::vector<std::uint32_t> hits;
  double seconds = 0.0;  ///< on all cores
};
[[nodiscard]] Answers askProcessor(const std::vector<scene::Bvh::Triangle>& triangles, const RaySet& set);

/// Answers that differ. Of so many that were looked at, in double precision, triangle by triangle, those are wrong that
/// are not a question of rounding: at an edge, or of triangles in one place.
struct Differences {
  std::size_t all = 0, examined = 0, wrong = 0;
};
[[nodiscard]] Differences compare(const std::vector<scene::Bvh::Triangle>& triangles, const RaySet& set,
                                  const std::vector<std::uint32_t>& right, const std::vector<std::uint32_t>& told);

}  // namespace radiosity::benchmarks
