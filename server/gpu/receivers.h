// Where the leaves of a scene receive gathered light: receiving points, planes, and which sides only absorb.
// Plain values made from a scene, any thread.
#pragma once

#include <array>
#include <cstdint>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <memory>
#include <span>
#include <vector>

#include "server/scene/patch_scene.h"

namespace radiosity::gpu {

/// A receiver this far (unit box) behind a plane still counts as lying in it.
inline constexpr float kInPlane = 2.0e-6F;

class Receivers {
 public:
  /// A side of a leaf that can receive light.
  struct Receiver {
    std::uint32_t node, triangle;
    glm::vec2 texel;           ///< corner of the leaf when full, else the point itself
    std::uint32_t first_spot;  ///< its places (PatchScene::spots), or kNone
    bool full;

    [[nodiscard]] bool hasSpots() const { return first_spot != scene::kNone; }
  };
  /// Receivers of one side of a surface; they lie together.
  struct Group {
    std::uint32_t surface;
    std::size_t first, count;
    float side;  ///< +1 front, -1 back
  };
  struct Plane {
    glm::vec3 normal{0.0F};
    float distance = 0.0F;

    [[nodiscard]] float height(const glm::vec3& point) const {
      return normal.x * point.x + normal.y * point.y + normal.z * point.z - distance;
    }
  };

  Receivers() = default;
  explicit Receivers(std::shared_ptr<const scene::PatchScene> patches);

  [[nodiscard]] const scene::PatchScene& patches() const { return *patches_; }
  [[nodiscard]] const std::vector<Group>& groups() const { return groups_; }
  [[nodiscard]] const std::vector<Receiver>& all() const { return receivers_; }
  [[nodiscard]] const Plane& plane(std::uint32_t triangle) const { return planes_[triangle]; }
  /// Whether the side of the triangle that faces (or turns away from) a light only absorbs.
  [[nodiscard]] bool absorbs(std::uint32_t triangle, bool back) const {
    return absorbs_[triangle][static_cast<std::size_t>(back)];
  }
  struct Place {
    glm::vec3 point;
    const scene::TriangleFrame* frame;
  };
  /// A place on a receiver, by `at` in [0, 1)^2.
  [[nodiscard]] Place place(const Receiver& receiver, const glm::vec2& at) const;
  /// One of its places, spot < kLeafSpots; of a receiver that has them.
  [[nodiscard]] Place spot(const Receiver& receiver, std::uint32_t spot) const;
  [[nodiscard]] glm::vec3 point(const Receiver& receiver, const glm::vec2& at) const {
    return place(receiver, at).point;
  }

  /// Whether a part of the triangle lies in front of a receiver. What is wholly behind its horizon cannot hide a light
  /// from it, although a pixel on a convex edge may show it: the top of a block, seen instead of the topmost texels of
  /// its side.
  [[nodiscard]] bool risesBefore(std::uint32_t triangle, const glm::vec3& point, const glm::vec3& normal) const {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto& corner = patches_->vertices[patches_->indices[3 * std::size_t{triangle} + k]].position;
      if (glm::dot(normal, corner - point) > kInPlane) return true;
    }
    return false;
  }

  /// A receiving point, and the way from it to the light.
  struct Ray {
    glm::vec3 at, normal;
    glm::vec3 way;     ///< to the light, or of length 1 towards a light at infinity
    float reach;       ///< the light is at `at` + reach x way
    float pixel_size;  ///< at most this, unit, anywhere along the way
  };

  /// Whether what a pixel shows hides the light from a receiver in it: it lies behind the item's plane, on the side
  /// that the light does not see. No depth bias, hence no acne. For pixels away from edges.
  [[nodiscard]] bool hides(std::uint32_t item, const Ray& ray) const {
    return item != scene::kNone && behind(item, ray);
  }

  /// The same near an edge, for the receiver's own pixel. Facets wide enough for pixels to show them are intersected
  /// with the ray, so that shadows end where the geometry does, and nothing leaks along the edges of a room; narrow
  /// ones (slivers, dense meshes), and places of partial opacity, count by what the pixel shows, which is right in the
  /// mean.
  [[nodiscard]] bool hidesAtEdge(std::uint32_t item, const Ray& ray) const;

  /// Whether the ray meets a wide facet that some neighbouring pixel shows, where that lets nothing through.
  [[nodiscard]] bool anyMeets(std::span<const std::uint32_t> items, const Ray& ray) const;

 private:
  /// Coplanar triangles of one chart that share corners.
  struct Facet {
    std::uint32_t first = 0, count = 0;  ///< into facet_triangles_
    float width = 0.0F;                  ///< area / longest side, unit
  };
  void findFacets();
  [[nodiscard]] bool behind(std::uint32_t item, const Ray& ray) const;
  [[nodiscard]] bool wide(std::uint32_t item, const Ray& ray) const;
  /// What the ray finds of the item's facet; kChance: a place of partial opacity.
  enum class Meeting { kNothing, kChance, kSolid };
  [[nodiscard]] Meeting meet(std::uint32_t item, const Ray& ray) const;
  [[nodiscard]] Meeting opacityAt(std::uint32_t triangle, const glm::vec2& texel) const;

  std::shared_ptr<const scene::PatchScene> patches_;
  std::vector<Receiver> receivers_;
  std::vector<Group> groups_;
  std::vector<Plane> planes_;                 ///< by triangle
  std::vector<std::array<bool, 2>> absorbs_;  ///< by triangle: front, back
  std::vector<Facet> facets_;
  std::vector<std::uint32_t> facet_of_;  ///< by triangle
  std::vector<std::uint32_t> facet_triangles_;
};

}  // namespace radiosity::gpu
