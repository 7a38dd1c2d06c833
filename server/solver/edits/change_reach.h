// How far an edit of geometry can have put the links of a shooter that sees it from the truth, were they left as they
// are: an estimate, by rays to places on what is gone and on what is there now. Immutable; any thread.
#pragma once

#include <array>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <vector>

#include "server/geometry/bvh.h"
#include "server/scene/values/patch_scene.h"

namespace radiosity::solver {

class ChangeReach {
 public:
  /// `map`: of the scene after to that before, which both are to outlive it. O(n log n) in triangles.
  ChangeReach(const scene::PatchScene& before, const scene::PatchScene& after, const scene::PatchMap& map);

  /// About the area-weighted norm of the change of all links of a shooter of this area (unit box squared), as they look
  /// from one of its points: what arrived on things that are gone, or arrives on those that came, and what that opens
  /// or hides. `turn`: any number; another sees other places, so that the sum over many shooters is nearer to the truth
  /// than each. Some 40 rays.
  [[nodiscard]] double of(const glm::vec3& origin, const glm::vec3& normal, double area, std::uint32_t turn) const;

 private:
  struct Place {
    glm::dvec3 point, normal;
    double area;  ///< that it stands for
  };
  using Places = std::vector<Place>;
  struct Eye {
    glm::dvec3 origin, normal;
    double area;
  };
  void addTriangles(const scene::PatchScene& patches, const std::vector<bool>& gone, Places& places) const;
  void addAltered(const scene::PatchScene& patches, const scene::PatchMap& map);
  /// Square of the norm, by one place in the scene of `own`; `other`: what is there in the other scene.
  [[nodiscard]] static double squareAt(const Place& place, const Eye& eye, const scene::Bvh& own,
                                       const scene::PatchScene* other, const scene::Bvh* tree_of_other);

  const scene::PatchScene &before_, &after_;
  std::shared_ptr<const scene::Bvh> tree_before_, tree_after_;
  Places gone_, come_, altered_;
};

}  // namespace radiosity::solver
