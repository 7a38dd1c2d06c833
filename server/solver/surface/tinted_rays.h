// Rays from single places through what one can see through: where they end, and what colour is left of the light that
// comes from there. What lets light through in part stops a ray or not, by chance. Immutable; any thread.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <span>
#include <utility>

#include "server/solver/rays/leaf_rays.h"

namespace radiosity::solver {

class TintedRays {
 public:
  explicit TintedRays(std::shared_ptr<const LeafRays> rays) : rays_(std::move(rays)) {}

  /// LeafRays::see(), and what is left of the light that comes from there: `tint` is multiplied by it.
  [[nodiscard]] std::uint32_t see(const LeafRays::Place& from, const glm::dvec3& direction, std::uint64_t key,
                                  LeafRays::Place& end, glm::dvec3& tint, const geometry::Hit* first = nullptr) const;
  /// By channel, what passes of the light of a point, by chance from `key`; 0: it is hidden. `normal`: of the face on
  /// which that lies (LeafRays::isOpen).
  [[nodiscard]] glm::dvec3 passageTo(const LeafRays::Place& from, const glm::dvec3& to, const glm::dvec3& normal,
                                     std::uint64_t key) const;
  static constexpr std::size_t kMostPoints = 32;
  /// The same of up to kMostPoints, a multiple of geometry::kPacket, of which as many as that are asked together.
  void passageTo(const LeafRays::Place& from, std::span<const glm::dvec3> points, const glm::dvec3& normal,
                 std::uint64_t key, std::span<glm::dvec3> passing) const;

 private:
  std::shared_ptr<const LeafRays> rays_;
};

}  // namespace radiosity::solver
