// Where the leaves of a scene receive gathered light: receiving points, planes, and which sides only absorb.
// Plain values made from a scene, any thread.
#pragma once

#include <array>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <vector>

#include "server/geometry/ray_scene.h"
#include "server/scene/values/patch_scene.h"

namespace radiosity::gpu {

/// A receiver this far (unit box) behind a plane still counts as lying in it.
inline constexpr float kInPlane = 2.0e-6F;
/// One this far (unit box) before an item is none of its places: its pixel's middle misses what it lies on.
inline constexpr float kApart = 1.0e-5F;

class Receivers {
 public:
  /// A side of a leaf that can receive light.
  struct Receiver {
    std::uint32_t node, triangle;
    glm::vec2 texel;          ///< corner of the leaf when full, else the point itself
    std::uint32_t spot_list;  ///< its places (LeafPoint)
    bool full;

    [[nodiscard]] bool hasSpots() const { return spot_list != scene::kNone; }
    /// Something hovers right before it, or beside that.
    [[nodiscard]] bool liesInGap() const { return full && hasSpots(); }
  };
  /// Receivers of one side of a surface; they lie together.
  struct Group {
    std::uint32_t surface;
    std::size_t first, count;
    float side;  ///< +1 front, -1 back
    std::size_t first_block;
  };
  /// Receivers of a group in a row.
  struct Block {
    std::size_t first, count;
    glm::vec3 low{0.0F}, high{0.0F};  ///< around all their places
    bool plain = false;               ///< all full, out of gaps and in one frame
  };
  static constexpr std::size_t kBlock = 64;  ///< receivers of a block at most
  struct Plane {
    glm::vec3 normal{0.0F};
    float distance = 0.0F;

    [[nodiscard]] float height(const glm::vec3& point) const {
      return normal.x * point.x + normal.y * point.y + normal.z * point.z - distance;
    }
  };

  Receivers() = default;
  explicit Receivers(std::shared_ptr<const scene::PatchScene> patches);

  /// Nothing hides anything: all that is there lies before the plane of each triangle, as in an empty room. False where
  /// there is too much to look.
  [[nodiscard]] bool isConvex() const { return is_convex_; }
  [[nodiscard]] const scene::PatchScene& patches() const { return *patches_; }
  [[nodiscard]] const std::vector<Group>& groups() const { return groups_; }
  [[nodiscard]] const std::vector<Receiver>& all() const { return receivers_; }
  /// By group.
  [[nodiscard]] const std::vector<Block>& blocks() const { return blocks_; }
  /// As in Receiver, by receiver.
  [[nodiscard]] const float* texelX() const { return texel_x_.data(); }
  [[nodiscard]] const float* texelY() const { return texel_y_.data(); }
  [[nodiscard]] const std::uint32_t* nodes() const { return nodes_.data(); }
  [[nodiscard]] const Plane* planes() const { return planes_.data(); }
  [[nodiscard]] const Plane& plane(std::uint32_t triangle) const { return planes_[triangle]; }
  /// Whether the side of the triangle that faces (or turns away from) a light only absorbs.
  [[nodiscard]] bool absorbs(std::uint32_t triangle, bool back) const {
    return absorbs_[triangle][static_cast<std::size_t>(back)];
  }
  /// Whether what a ray meets only absorbs: such a side, or a part of a lit one that lies in a solid, so that no leaf
  /// is there, nor beside it with nothing in between.
  [[nodiscard]] bool absorbs(const geometry::Ray& ray, const geometry::Hit& hit) const;
  /// Where a receiver's own pixel does not decide alone: in a gap; on a surface with two sides, of which one may be the
  /// inside of something.
  enum Care : std::uint32_t { kInGap = 1, kTwoSided = 2 };
  [[nodiscard]] std::uint32_t careOf(const Receiver& receiver) const {
    const bool two_sided = !absorbs_[receiver.triangle][0] && !absorbs_[receiver.triangle][1];
    return (receiver.liesInGap() ? kInGap : 0U) | (two_sided ? kTwoSided : 0U);
  }
  struct Place {
    glm::vec3 point;
    const scene::TriangleFrame* frame;
  };
  /// A place on a receiver, by `at` in [0, 1)^2.
  [[nodiscard]] Place place(const Receiver& receiver, const glm::vec2& at) const {
    if (receiver.full) return placeOf({receiver.texel + at, receiver.triangle});
    scene::LeafPoint leaf{receiver.texel, receiver.triangle};
    leaf.spot_list = receiver.spot_list;
    return placeOf(patches_->spotAt(leaf, 0, 0, at));
  }
  /// Those of a receiver that has some.
  struct Spots {
    const Receivers& receivers;
    const Receiver& receiver;
    std::uint32_t count;
    scene::LeafSpots::View list{};  ///< of one that is not full

    /// k < count.
    [[nodiscard]] Place at(std::uint32_t k) const {
      if (receiver.full) return receivers.placeOf({receiver.texel + scene::kSpotsOfFull[k], receiver.triangle});
      return receivers.placeOf(list.at(k, receiver.triangle));
    }
  };
  [[nodiscard]] Spots spots(const Receiver& receiver) const {
    if (receiver.full) return {*this, receiver, scene::kLeafLattice};
    const auto& spots = patches_->spots;
    return {*this, receiver, spots.countOf(receiver.spot_list), spots.of(receiver.spot_list)};
  }
  [[nodiscard]] glm::vec3 point(const Receiver& receiver, const glm::vec2& at) const {
    return place(receiver, at).point;
  }

  /// Whether a part of the item's facet may lie in front of a receiver. What is wholly behind its horizon cannot hide a
  /// light from it, although a pixel on a convex edge may show it: the top of a block, seen instead of the topmost
  /// texels of its side. The facet's: an item names any triangle of the facet that the pixel shows. True decides
  /// nothing: a box stands for facets of many corners, and facets have holes.
  [[nodiscard]] bool risesBefore(std::uint32_t item, const glm::vec3& point, const glm::vec3& normal) const {
    const auto& facet = facets_[facet_of_[item]];
    return anyRises(std::span(&outlines_[facet.first_corner], facet.corner_count), point, normal);
  }

  /// A receiving point, and the way from it to the light.
  struct Ray {
    glm::vec3 at, normal;
    glm::vec3 way;     ///< to the light, or of length 1 towards a light at infinity
    float reach;       ///< the light is at `at` + reach x way
    float pixel_size;  ///< at most this, unit, anywhere along the way
  };

  /// Whether a part of the item's facet may be nearer to the light than a receiver is. What is wholly farther away
  /// cannot hide the light, although a pixel beside a silhouette may show it, and its plane lie between the two: the
  /// chair behind a thin leg. Not asked for lights at infinity, whose wide pixels are right in the mean alone.
  [[nodiscard]] bool liesBefore(std::uint32_t item, const Ray& ray) const {
    return risesBefore(item, ray.at, glm::normalize(ray.way));
  }

  /// Whether what a pixel shows hides the light from a receiver in it: it lies behind the item's plane, on the side
  /// that the light does not see. No depth bias, hence no acne. For pixels away from edges.
  [[nodiscard]] bool hides(std::uint32_t item, const Ray& ray) const {
    return item != scene::kNone && behind(item, ray) &&
           (anyRises(corners_[item], ray.at, ray.normal) || isMet(item, ray));
  }
  /// The same of a light that is not at infinity, and of an item behind whose plane the receiver lies. Where the
  /// triangle named lies before the receiver the pixel decides, which is right in the mean; where only others of the
  /// facet do, the ray: the far side of a wall around a window lies before the window's reveal, and hides nothing.
  [[nodiscard]] bool hidesBefore(std::uint32_t item, const Ray& ray) const {
    const auto way = glm::normalize(ray.way);
    if (anyRises(corners_[item], ray.at, ray.normal) && anyRises(corners_[item], ray.at, way)) return true;
    return risesBefore(item, ray.at, ray.normal) && risesBefore(item, ray.at, way) && isMet(item, ray);
  }

  /// Whether a receiver lies before the plane of what its pixel shows: the pixel looks past what it lies on.
  [[nodiscard]] bool liesApart(std::uint32_t item, const Ray& ray) const { return before(item, ray) > kApart; }

  /// The same as hides() near an edge, for the receiver's own pixel. Facets wide enough for pixels to show them are
  /// intersected with the ray, so that shadows end where the geometry does, and nothing leaks along the edges of a
  /// room; narrow ones (slivers, dense meshes), and places of partial opacity, count by what the pixel shows, which is
  /// right in the mean.
  [[nodiscard]] bool hidesAtEdge(std::uint32_t item, const Ray& ray) const;

  /// Whether one of the facets that the pixels around a receiver show hides the light from it, by intersection. None:
  /// one of them is narrow, or lets light through in part, and the receiver's own pixel is right in the mean.
  [[nodiscard]] std::optional<bool> hiddenAmong(std::span<const std::uint32_t> items, const Ray& ray) const;

  /// Whether anything opaque stands between, by intersection with all there is.
  [[nodiscard]] bool isBlocked(const Ray& ray) const;

  /// All triangles, for rays: made when first asked for, since many scenes never are. Throws std::bad_alloc. Ways pass
  /// what one can see through by chance, from wayKey().
  [[nodiscard]] const geometry::RayScene& rays() const;
  /// Of a way from a place on a receiver, in a look that no other is like; 0 where there is nothing to see through.
  [[nodiscard]] std::uint64_t wayKey(std::uint64_t look, const glm::vec3& from) const;
  /// Where in a frame a point of its plane lies, in leaves from its origin; its axes need not be at right angles.
  [[nodiscard]] static glm::vec2 texelAt(const scene::TriangleFrame& frame, const glm::vec3& point);
  /// Of a place.
  [[nodiscard]] static std::uint64_t placeKey(const glm::vec3& place);
  /// Which of the turns of a light's points a receiver has, by where it lies on its surface, which edits elsewhere do
  /// not change: with those around it it looks at points that are spread evenly.
  [[nodiscard]] static std::uint32_t turnOf(const glm::vec2& texel) {
    constexpr std::uint32_t kRow = 8;
    return static_cast<std::uint32_t>(static_cast<std::int32_t>(texel.x)) +
           kRow * static_cast<std::uint32_t>(static_cast<std::int32_t>(texel.y));
  }
  /// What geometry::kPacket rays at most meet that does not let them pass; `key`: of the chance by which it does.
  void nearest(std::span<const geometry::Ray> rays, std::uint64_t key, std::span<geometry::Hit> hits) const;
  /// Where ways begin at a place, and end at a light: so far before it (unit box).
  static constexpr float kLift = 2.0e-6F;
  /// Farther than the unit box is wide.
  static constexpr float kFar = 4.0F;

  /// Whether the item is of a surface that lets light through somewhere.
  /// PatchScene::hasGlass().
  [[nodiscard]] bool hasGlass() const { return has_glass_; }
  [[nodiscard]] bool isSeeThrough(std::uint32_t item) const {
    return item != scene::kNone && patches_->surfaces[patches_->triangle_surface[item]].see_through;
  }

  /// Whether the ray meets a wide facet that some neighbouring pixel shows, where that lets nothing through.
  [[nodiscard]] bool anyMeets(std::span<const std::uint32_t> items, const Ray& ray) const;

 private:
  bool is_convex_ = false;
  struct Rays {
    std::once_flag made;
    geometry::RayScene scene;
  };
  /// Coplanar triangles of one chart that share corners.
  struct Facet {
    std::uint32_t first = 0, count = 0;                ///< into facet_triangles_
    std::uint32_t first_corner = 0, corner_count = 0;  ///< into outlines_
    float width = 0.0F;                                ///< area / longest side, unit
  };
  [[nodiscard]] Place placeOf(const scene::LeafSpot& spot) const {
    const auto& frame = patches_->triangles[spot.triangle];
    return {frame.origin + spot.texel.x * frame.du + spot.texel.y * frame.dv, &frame};
  }
  void findBlocks(Group& group);
  void setBounds(Block& block) const;
  void findFacets();
  [[nodiscard]] bool findConvex() const;
  void measure(Facet& facet);
  [[nodiscard]] geometry::RayScene makeRays() const;
  [[nodiscard]] geometry::Hit goOn(const geometry::Hit& first, const geometry::Ray& ray, std::uint64_t key) const;
  [[nodiscard]] static bool anyRises(std::span<const glm::vec3> corners, const glm::vec3& point,
                                     const glm::vec3& normal) {
    for (const auto& corner : corners) {
      if (glm::dot(normal, corner - point) > kInPlane) return true;
    }
    return false;
  }
  /// The ray passes through the item's facet, or it has too many triangles to ask.
  [[nodiscard]] bool isMet(std::uint32_t item, const Ray& ray) const;
  /// Height above the plane, on the light's side of it.
  [[nodiscard]] float before(std::uint32_t item, const Ray& ray) const {
    const auto& plane = planes_[item];
    const float height = plane.height(ray.at);
    const float rise = glm::dot(plane.normal, ray.way) * ray.reach;  // from the receiver to the light
    return height + rise > 0.0F ? height : -height;
  }
  [[nodiscard]] bool behind(std::uint32_t item, const Ray& ray) const {
    return before(item, ray) < -kInPlane && risesBefore(item, ray.at, ray.normal);
  }
  [[nodiscard]] bool wide(std::uint32_t item, const Ray& ray) const;
  /// What the ray finds of the item's facet; kChance: a place of partial opacity.
  enum class Meeting { kNothing, kChance, kSolid };
  [[nodiscard]] Meeting meet(std::uint32_t item, const Ray& ray) const;
  [[nodiscard]] Meeting opacityAt(std::uint32_t triangle, const glm::vec2& texel) const;

  std::shared_ptr<const scene::PatchScene> patches_;
  bool has_glass_ = false;
  std::vector<Receiver> receivers_;
  std::vector<Group> groups_;
  std::vector<Block> blocks_;
  std::vector<float> texel_x_, texel_y_;
  std::vector<std::uint32_t> nodes_;
  std::vector<Plane> planes_;                      ///< by triangle
  std::vector<std::array<glm::vec3, 3>> corners_;  ///< by triangle
  std::vector<std::array<bool, 2>> absorbs_;       ///< by triangle: front, back
  std::unique_ptr<Rays> rays_;
  std::vector<Facet> facets_;
  std::vector<std::uint32_t> facet_of_;  ///< by triangle
  std::vector<std::uint32_t> facet_triangles_;
  std::vector<glm::vec3> outlines_;  ///< each facet's corners, or those of a box around many
};

}  // namespace radiosity::gpu
