// Floors that walls stand on, cut along these walls, so that no texel lies in two rooms (Baum, Mann, Smith and Winget
// 1991, "Making radiosity usable": surfaces are split where others meet them). A texel has one value, and whoever looks
// it up blends it with its neighbours: where it reaches under a wall, light of one side is seen on the other, the more
// the larger it is. What is cut becomes charts of their own; where a cut runs on through open space, light goes on
// across it as over any seam.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <vector>

#include "server/scene/values/scene.h"

namespace radiosity::scene {

/// A vertex on a triangle of the file, by weights of its vertices, which sum to 1.
struct MadeVertex {
  std::array<std::uint32_t, 3> of;
  std::array<double, 3> weight;

  bool operator==(const MadeVertex&) const = default;
};

/// What takes the place of an instance's primitive.
struct CutPrimitive {
  Primitive primitive;           ///< its first vertices are those of the file, the others are made
  std::vector<MadeVertex> made;  ///< in the order of their vertices
  /// By triangle: that of the file's primitive it is a part of; no chart holds two regions of one; and on which edges a
  /// wall stands (bit e: from corner e), across which no light goes on.
  std::vector<std::uint32_t> source, region;
  std::vector<std::uint8_t> walled;
  std::vector<bool> hidden;  ///< by triangle: it lies under what stands between two regions, and nobody sees it

  [[nodiscard]] std::size_t fileVertices() const { return primitive.positions.size() - made.size(); }
  bool operator==(const CutPrimitive&) const = default;
};

/// Immutable; copies share what they hold. Any thread.
class WallCuts {
 public:
  /// Null: the instance's primitive is whole.
  [[nodiscard]] const CutPrimitive* find(std::uint32_t instance) const {
    const auto found = cut_.find(instance);
    return found == cut_.end() ? nullptr : found->second.get();
  }
  /// That which the triangles of an instance are numbered by.
  [[nodiscard]] const Primitive& primitiveOf(const Scene& scene, std::uint32_t instance) const {
    const auto* cut = find(instance);
    return cut != nullptr ? cut->primitive : scene.primitives[scene.instances[instance].primitive];
  }
  /// Of a triangle of it: that of the file's primitive.
  [[nodiscard]] std::uint32_t sourceOf(std::uint32_t instance, std::uint32_t triangle) const {
    const auto* cut = find(instance);
    return cut != nullptr ? cut->source[triangle] : triangle;
  }
  [[nodiscard]] bool isHidden(std::uint32_t instance, std::uint32_t triangle) const {
    const auto* cut = find(instance);
    return cut != nullptr && cut->hidden[triangle];
  }
  /// Some faces meet too many walls: light of one side may be seen on the other there.
  [[nodiscard]] bool leavesSomeWhole() const { return leaves_some_whole_; }
  void leaveRestWhole() { leaves_some_whole_ = true; }
  [[nodiscard]] bool empty() const { return cut_.empty(); }
  [[nodiscard]] bool operator==(const WallCuts& other) const;
  void add(std::uint32_t instance, CutPrimitive cut) {
    cut_[instance] = std::make_shared<const CutPrimitive>(std::move(cut));
  }

 private:
  std::map<std::uint32_t, std::shared_ptr<const CutPrimitive>> cut_;
  bool leaves_some_whole_ = false;
};

}  // namespace radiosity::scene
