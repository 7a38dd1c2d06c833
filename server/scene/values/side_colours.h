// A colour for every node of the patch hierarchies, by sides of surfaces: where all nodes of a side are of one colour,
// as of all materials without textures, one is kept.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <vector>

namespace radiosity::scene {

struct PatchScene;

/// A value, not tied to the patches it was made for. Copies share what sides have until one of the two is changed.
class SideColours {
 public:
  SideColours() = default;
  /// Black. Sides are numbered as solver::makeSides() does: by surface, the front first, without those that have no
  /// nodes.
  explicit SideColours(const PatchScene& patches);

  /// Of the nodes of one side, level 0 first. Until the side is changed.
  class OfSide {
   public:
    OfSide(const std::vector<glm::vec3>& colours) : first_(colours.data()), step_(colours.size() > 1 ? 1 : 0) {}
    [[nodiscard]] const glm::vec3& operator[](std::size_t node) const { return first_[step_ * node]; }
    [[nodiscard]] bool isUniform() const { return step_ == 0; }

   private:
    const glm::vec3* first_;
    std::size_t step_;
  };
  [[nodiscard]] OfSide side(std::size_t side) const { return *colours_[side]; }
  [[nodiscard]] std::size_t sideCount() const { return colours_.size(); }
  /// The side that a node is of. O(log sides).
  [[nodiscard]] std::size_t sideOf(std::uint32_t node) const;
  /// Of a node by its number in the scene. O(log sides).
  [[nodiscard]] glm::vec3 operator[](std::uint32_t node) const;

  /// All nodes of one side.
  void fill(std::size_t side, const glm::vec3& colour);
  /// Of every side.
  void fill(const glm::vec3& colour);
  /// Every colour becomes so many times what it is, by channel.
  void scale(const glm::vec3& factor);
  /// One colour for each node of the side.
  void assign(std::size_t side, std::vector<glm::vec3> colours);
  /// Of one node by its number in the scene. O(nodes of its side).
  void set(std::uint32_t node, const glm::vec3& colour);

  bool operator==(const SideColours& other) const;

 private:
  using Shared = std::shared_ptr<const std::vector<glm::vec3>>;
  static Shared one(const glm::vec3& colour);
  [[nodiscard]] std::size_t nodeCount(std::size_t side) const {
    return (*first_nodes_)[side + 1] - (*first_nodes_)[side];
  }

  /// By side, and where the nodes of the last one end. Of all copies there is one.
  std::shared_ptr<const std::vector<std::uint32_t>> first_nodes_;
  std::vector<Shared> colours_;  ///< by side: one, or one for each node
  Shared last_filled_;           ///< what a side was filled with last
};

}  // namespace radiosity::scene
