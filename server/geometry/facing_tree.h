// A tree over things that have a place and a direction: neither many in one place nor many that face one way make a
// search for those near a place, which face about one way, slow. Immutable once built, so any number of threads may
// ask.
#pragma once

#include <cstdint>
#include <glm/common.hpp>
#include <glm/vec3.hpp>
#include <glm/vector_relational.hpp>
#include <limits>
#include <span>
#include <vector>

namespace radiosity::scene {

class FacingTree {
 public:
  struct Item {
    glm::vec3 low, high;  ///< bounds
    glm::vec3 normal;     ///< unit length
  };
  /// Bounds of some items, and of their normals.
  struct Reach {
    glm::vec3 low{std::numeric_limits<float>::infinity()}, high{-low};
    glm::vec3 normal_low{low}, normal_high{high};

    void add(const Item& item) {
      low = glm::min(low, item.low);
      high = glm::max(high, item.high);
      normal_low = glm::min(normal_low, item.normal);
      normal_high = glm::max(normal_high, item.normal);
    }
    /// Whether bounds are no farther than `margin` from these, along any axis.
    [[nodiscard]] bool isNear(const glm::vec3& other_low, const glm::vec3& other_high, float margin) const {
      return !glm::any(glm::greaterThan(low, other_high + margin)) &&
             !glm::any(glm::greaterThan(other_low, high + margin));
    }
    /// Whether a normal differs by no more than `chord` from one of these, along any axis.
    [[nodiscard]] bool faces(const glm::vec3& normal, float chord) const {
      return !glm::any(glm::greaterThan(normal_low, normal + chord)) &&
             !glm::any(glm::greaterThan(normal - chord, normal_high));
    }
  };
  struct Node {
    Reach reach;
    std::uint32_t first, count;  ///< of order()
    std::uint32_t child;         ///< the first of two, which follow; 0: a leaf
  };

  FacingTree() = default;
  /// Halves along what differs most, beside how large the items are. O(n log n).
  explicit FacingTree(std::span<const Item> items);

  /// The root first; empty without items.
  [[nodiscard]] const std::vector<Node>& nodes() const { return nodes_; }
  /// Numbers of items, leaf after leaf.
  [[nodiscard]] const std::vector<std::uint32_t>& order() const { return order_; }

  /// Between unit vectors whose angle has this cosine, and a little more than rounding.
  [[nodiscard]] static float chordOf(float cosine);

 private:
  void divide(std::size_t n, std::span<const Item> items);

  std::vector<std::uint32_t> order_;
  std::vector<Node> nodes_;
};

}  // namespace radiosity::scene
