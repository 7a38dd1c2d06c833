// How the trees of wide_tree.h lie in the buffers that shaders read.
#include <algorithm>
#include <bit>
#include <cmath>
#include <glm/geometric.hpp>

#include "tests/benchmark/gpu_rays/wide_tree.h"

namespace radiosity::benchmarks {
namespace {

/// By which boxes grow (unit box), and triangles, times their longer edge: as scene::WideNodes and geometry::RayScene
/// do it.
constexpr float kGrowth = 2e-6F, kEdge = 5e-7F;
constexpr std::uint32_t kLeaf = 1U << 31U, kCountBits = 3;

using Words = std::vector<std::uint32_t>;

std::uint32_t wordOf(float value) { return std::bit_cast<std::uint32_t>(value); }

scene::Bounds grown(const scene::Bounds& box) { return {box.min - kGrowth, box.max + kGrowth}; }

std::uint32_t referenceOf(const WideNode::Child& child) {
  return child.isInner() ? child.node : kLeaf | child.first << kCountBits | child.triangles;
}

/// No ray meets what is empty.
scene::Bounds boxOf(const WideNode::Child& child) {
  constexpr float kFar = 1e9F;
  if (child.isEmpty()) return {glm::vec3(kFar), glm::vec3(-kFar)};
  return grown(child.box);
}

/// Aila and Laine 2009: both boxes at their parent.
void addBinary(const WideNode& node, Words& words) {
  for (std::size_t k = 0; k < 2; ++k) {
    const auto box = boxOf(node.child[k]);
    for (int axis = 0; axis < 3; ++axis) words.push_back(wordOf(box.min[axis]));
    words.push_back(referenceOf(node.child[k]));
    for (int axis = 0; axis < 3; ++axis) words.push_back(wordOf(box.max[axis]));
    words.push_back(0);
  }
}

void addFour(const WideNode& node, Words& words) {
  for (int axis = 0; axis < 3; ++axis)
    for (std::size_t k = 0; k < 4; ++k) words.push_back(wordOf(boxOf(node.child[k]).min[axis]));
  for (int axis = 0; axis < 3; ++axis)
    for (std::size_t k = 0; k < 4; ++k) words.push_back(wordOf(boxOf(node.child[k]).max[axis]));
  for (std::size_t k = 0; k < 4; ++k) words.push_back(referenceOf(node.child[k]));
}

/// Where the boxes of children lie in steps of a power of two from the corner of a node.
class Grid {
 public:
  explicit Grid(const WideNode& node) {
    scene::Bounds all;
    for (const auto& child : node.child)
      if (!child.isEmpty()) all.add(grown(child.box));
    origin_ = all.min;
    for (int axis = 0; axis < 3; ++axis) {
      int exponent = 0;
      std::frexp(std::max(all.max[axis] - all.min[axis], 1e-30F) / 255.0F, &exponent);
      // What a corner is rounded to may ask for one step more than there are.
      while (std::ceil((all.max[axis] - all.min[axis]) / std::ldexp(1.0F, exponent)) > 254.0F) ++exponent;
      exponent_[static_cast<std::size_t>(axis)] = exponent;
    }
  }
  [[nodiscard]] std::uint32_t low(float value, int axis) const {
    return static_cast<std::uint32_t>(std::clamp(std::floor(steps(value, axis)), 0.0F, 255.0F));
  }
  [[nodiscard]] std::uint32_t high(float value, int axis) const {
    return static_cast<std::uint32_t>(std::clamp(std::ceil(steps(value, axis)), 0.0F, 255.0F));
  }
  [[nodiscard]] float origin(int axis) const { return origin_[axis]; }
  /// As a floating point number has it.
  [[nodiscard]] std::uint32_t exponent(int axis) const {
    return static_cast<std::uint32_t>(exponent_[static_cast<std::size_t>(axis)] + 127);
  }

 private:
  [[nodiscard]] float steps(float value, int axis) const {
    return std::ldexp(value - origin_[axis], -exponent_[static_cast<std::size_t>(axis)]);
  }
  glm::vec3 origin_{0.0F};
  std::array<int, 3> exponent_{};
};

/// Ylitie, Karras and Laine 2017: 80 bytes for eight children.
void addEight(const WideNode& node, Words& words) {
  constexpr std::size_t kChildren = WideNode::kMostChildren;
  const Grid grid(node);
  std::uint32_t inner = 0, first_child = 0, first_triangle = 0;
  std::array<std::uint32_t, kChildren> meta{};
  std::array<std::array<std::uint32_t, kChildren>, 6> plane{};
  bool has_leaf = false;
  for (std::size_t k = 0; k < kChildren; ++k) {
    const auto& child = node.child[k];
    for (std::size_t axis = 0; axis < 3; ++axis) plane[axis][k] = 255;
    if (child.isEmpty()) continue;
    const auto box = grown(child.box);
    for (int axis = 0; axis < 3; ++axis) {
      plane[static_cast<std::size_t>(axis)][k] = grid.low(box.min[axis], axis);
      plane[static_cast<std::size_t>(axis) + 3][k] = grid.high(box.max[axis], axis);
    }
    if (child.isInner()) {
      if (inner == 0) first_child = child.node;
      inner |= 1U << k;
      meta[k] = 1U << 5U | static_cast<std::uint32_t>(24 + k);
    } else {
      if (!has_leaf) first_triangle = child.first;
      has_leaf = true;
      meta[k] = ((1U << child.triangles) - 1U) << 5U | (child.first - first_triangle);
    }
  }
  for (int axis = 0; axis < 3; ++axis) words.push_back(wordOf(grid.origin(axis)));
  words.push_back(grid.exponent(0) | grid.exponent(1) << 8U | grid.exponent(2) << 16U | inner << 24U);
  const auto addBytes = [&](const std::array<std::uint32_t, kChildren>& bytes) {
    for (std::size_t half = 0; half < 2; ++half)
      words.push_back(bytes[4 * half] | bytes[4 * half + 1] << 8U | bytes[4 * half + 2] << 16U |
                      bytes[4 * half + 3] << 24U);
  };
  words.push_back(first_child);
  words.push_back(first_triangle);
  addBytes(meta);
  for (const auto& bytes : plane) addBytes(bytes);
}

}  // namespace

std::vector<std::uint32_t> nodeWords(const WideTree& tree) {
  Words words;
  for (const auto& node : tree.nodes) {
    if (tree.width == 2) addBinary(node, words);
    if (tree.width == 4) addFour(node, words);
    if (tree.width == 8) addEight(node, words);
  }
  return words;
}

std::vector<std::uint32_t> triangleWords(const WideTree& tree, std::span<const scene::Bvh::Triangle> triangles) {
  Words words;
  words.reserve(12 * tree.order.size());
  for (const auto t : tree.order) {
    const auto& triangle = triangles[t];
    const glm::vec3 a = triangle[1] - triangle[0], b = triangle[2] - triangle[0];
    const float slack = kEdge * std::max(glm::length(a), glm::length(b));
    for (int axis = 0; axis < 3; ++axis) words.push_back(wordOf(triangle[0][axis]));
    words.push_back(wordOf(slack));
    for (int axis = 0; axis < 3; ++axis) words.push_back(wordOf(a[axis]));
    words.push_back(t);
    for (int axis = 0; axis < 3; ++axis) words.push_back(wordOf(b[axis]));
    words.push_back(0);
  }
  return words;
}

}  // namespace radiosity::benchmarks
