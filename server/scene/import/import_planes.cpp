#include "server/scene/import/import_planes.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/mat4x4.hpp>
#include <string>
#include <utility>

#include "server/scene/document/json_text.h"
#include "server/scene/import/import_instancing.h"
#include "server/scene/import/node_transform.h"

namespace radiosity::scene {
namespace {

constexpr const char* kMember = "radiosityPlane";
/// Metres, of a side in the node's space and in the world.
constexpr double kMostSide = 1e6, kLeastSide = 1e-6, kFarthestPlane = 1e9;
constexpr double kMostAskedLux = 1e9;
/// Of the cosine between the sides of a rectangle.
constexpr double kSquare = 1e-3;

/// A node of the tree, where it stands.
struct Place {
  std::size_t index = 0;
  glm::dmat4 world{1.0};
  bool visible = true;
  bool animated = false;  ///< it, or a node above it, is moved by an animation
};

const Json* planeOf(const Json& node) {
  const auto* extras = memberOf(node, "extras");
  return extras != nullptr ? memberOf(*extras, kMember) : nullptr;
}

std::string pointerOf(std::size_t node) { return "/nodes/" + std::to_string(node) + "/extras/" + kMember; }

class PlaneReader {
 public:
  PlaneReader(const std::string& document, const Json& json, const Place& node, std::uint64_t other_points)
      : document_(document),
        json_(json),
        node_(node),
        plane_(*planeOf(json)),
        pointer_(pointerOf(node.index)),
        other_points_(other_points) {}

  Result<MeasuringPlane> read() {
    if (!plane_.is_object()) return bad(pointer_, "must be an object with width and depth");
    if (extensionOf(json_, "EXT_mesh_gpu_instancing") != nullptr)
      return bad(pointer_, "must not be on a node with EXT_mesh_gpu_instancing: a plane lies in one place");
    if (node_.animated)
      return bad(pointer_,
                 "must not be on a node that an animation moves, or below one: animations are not "
                 "played, and a plane lies in one place");
    MeasuringPlane made;
    made.node = static_cast<std::uint32_t>(node_.index);
    const auto* name = memberOf(json_, "name");
    if (name != nullptr && name->is_string()) made.name = name->get<std::string>();
    if (auto ok = readPlace(made); !ok) return tl::unexpected(ok.error());
    if (auto ok = readGrid(made); !ok) return tl::unexpected(ok.error());
    if (auto ok = readTarget(made.target); !ok) return tl::unexpected(ok.error());
    return made;
  }

 private:
  Result<void> readPlace(MeasuringPlane& made) {
    const auto width = side("width"), depth = side("depth");
    if (!width || !depth) return tl::unexpected(width ? depth.error() : width.error());
    const auto margin = marginOf(0.5 * std::min(*width, *depth));
    if (!margin) return tl::unexpected(margin.error());
    const glm::dvec3 x(node_.world[0]), y(node_.world[1]), z(node_.world[2]);
    made.across = (*width - 2.0 * *margin) * x;
    made.down = (*depth - 2.0 * *margin) * z;
    made.corner = glm::dvec3(node_.world[3]) - 0.5 * (made.across + made.down);
    const double wide = glm::length(made.across), deep = glm::length(made.down);
    if (!(wide >= kLeastSide && deep >= kLeastSide && wide <= kMostSide && deep <= kMostSide))
      return bad(pointer_, "its sides must be from 1 um to 1000 km long as the node scales it");
    for (int c = 0; c < 3; ++c)
      if (!(std::abs(made.corner[c]) <= kFarthestPlane)) return bad(pointer_, "must lie within 1e9 m of the origin");
    if (std::abs(glm::dot(made.across, made.down)) > kSquare * wide * deep)
      return bad(pointer_, "must stay a rectangle: the transforms above its node shear it");
    const auto normal = glm::normalize(glm::cross(made.down / deep, made.across / wide));
    made.normal = glm::dot(normal, y) < 0.0 ? -normal : normal;
    return {};
  }

  Result<void> readGrid(MeasuringPlane& made) {
    const auto usual = usualGrid(glm::length(made.across), glm::length(made.down));
    const auto columns = cells("columns", usual.columns), rows = cells("rows", usual.rows);
    if (!columns || !rows) return tl::unexpected(columns ? rows.error() : columns.error());
    if (*columns * *rows + other_points_ > kMostPlanePoints)
      return fail(ErrorCode::kTooLarge,
                  "makes more than " + std::to_string(kMostPlanePoints) +
                      " points of all measuring planes together; name fewer columns and rows",
                  place(document_, pointer_));
    made.columns = static_cast<std::uint32_t>(*columns);
    made.rows = static_cast<std::uint32_t>(*rows);
    return {};
  }

  Result<void> readTarget(PlaneTarget& target) {
    const auto* json = memberOf(plane_, "target");
    if (json == nullptr) return {};
    const auto pointer = pointer_ + "/target";
    const auto *lux = memberOf(*json, "lux"), *uniformity = memberOf(*json, "uniformity");
    if (lux == nullptr && uniformity == nullptr) return bad(pointer, "must be an object with lux, uniformity or both");
    if (lux != nullptr) {
      if (!isIn(*lux, kMostAskedLux)) return bad(pointer + "/lux", "must be a number above 0, at most 1e9");
      target.lux = lux->get<double>();
    }
    if (uniformity != nullptr) {
      if (!isIn(*uniformity, 1.0)) return bad(pointer + "/uniformity", "must be a number above 0, at most 1");
      target.uniformity = uniformity->get<double>();
    }
    return {};
  }

  [[nodiscard]] static bool isIn(const Json& json, double most) {
    return json.is_number() && json.get<double>() > 0.0 && json.get<double>() <= most;
  }

  [[nodiscard]] Result<double> side(const char* member) const {
    const auto* json = memberOf(plane_, member);
    if (json != nullptr && isIn(*json, kMostSide)) return json->get<double>();
    return bad(pointer_ + "/" + member, "must be a number of metres above 0, at most 1e6");
  }

  [[nodiscard]] Result<double> marginOf(double most) const {
    const auto* json = memberOf(plane_, "margin");
    if (json == nullptr) return 0.0;
    if (json->is_number() && json->get<double>() >= 0.0 && json->get<double>() < most) return json->get<double>();
    return bad(pointer_ + "/margin", "must be a number of metres, 0 or more, below half of the shorter side");
  }

  [[nodiscard]] Result<std::uint64_t> cells(const char* member, std::uint64_t usual) const {
    const auto* json = memberOf(plane_, member);
    if (json == nullptr) return usual;
    if (json->is_number_integer() && *json >= 1 && *json <= kMostPlanePoints) return json->get<std::uint64_t>();
    return bad(pointer_ + "/" + member, "must be a whole number from 1 to " + std::to_string(kMostPlanePoints));
  }

  [[nodiscard]] tl::unexpected<Error> bad(const std::string& pointer, std::string what) const {
    return fail(ErrorCode::kInvalidScene, std::move(what), place(document_, pointer));
  }

  const std::string& document_;
  const Json& json_;
  const Place& node_;
  const Json& plane_;
  std::string pointer_;
  std::uint64_t other_points_;
};

/// By node: whether a channel of an animation moves it. Empty: there are no animations.
std::vector<bool> animatedNodes(const Json& gltf) {
  const auto* animations = memberOf(gltf, "animations");
  const auto* nodes = memberOf(gltf, "nodes");
  if (animations == nullptr || !animations->is_array() || nodes == nullptr || !nodes->is_array()) return {};
  std::vector<bool> animated(nodes->size(), false);
  for (const auto& animation : *animations) {
    const auto* channels = memberOf(animation, "channels");
    if (channels == nullptr || !channels->is_array()) continue;
    for (const auto& channel : *channels) {
      const auto* target = memberOf(channel, "target");
      const auto* node = target != nullptr ? memberOf(*target, "node") : nullptr;
      if (node == nullptr || !node->is_number_integer() || *node < 0) continue;
      if (const auto index = node->get<std::uint64_t>(); index < animated.size()) animated[index] = true;
    }
  }
  return animated;
}

glm::dmat4 localMatrix(const Json& node) {
  const auto numbers = [&](const char* member, auto otherwise) {
    const auto* json = memberOf(node, member);
    if (json != nullptr)
      for (int i = 0; i < otherwise.length(); ++i) otherwise[i] = (*json)[static_cast<std::size_t>(i)].get<double>();
    return otherwise;
  };
  if (const auto* matrix = memberOf(node, "matrix")) {
    glm::dmat4 m(1.0);
    for (int i = 0; i < 16; ++i) m[i / 4][i % 4] = (*matrix)[static_cast<std::size_t>(i)].get<double>();
    return m;
  }
  const auto turn = numbers("rotation", glm::dvec4(0.0, 0.0, 0.0, 1.0));
  return Trs{numbers("translation", glm::dvec3(0.0)), glm::normalize(glm::dquat(turn.w, turn.x, turn.y, turn.z)),
             numbers("scale", glm::dvec3(1.0))}
      .matrix();
}

class PlaneWalk {
 public:
  explicit PlaneWalk(const Document& document)
      : document_(document), nodes_(document.gltf.at("nodes")), animated_(animatedNodes(document.gltf)) {}

  Result<std::vector<MeasuringPlane>> run() {
    const auto roots = rootNodes();
    for (auto root = roots.rbegin(); root != roots.rend(); ++root) stack_.push_back({*root});
    while (!stack_.empty()) {
      auto node = stack_.back();
      stack_.pop_back();
      const auto& json = nodes_[node.index];
      const auto* visibility = extensionOf(json, "KHR_node_visibility");
      node.world = node.world * localMatrix(json);
      node.visible = node.visible && (visibility == nullptr || visibility->value("visible", true));
      node.animated = node.animated || (!animated_.empty() && animated_[node.index]);
      if (planeOf(json) != nullptr)
        if (auto ok = take(json, node); !ok) return tl::unexpected(ok.error());
      const auto below = childrenOf(json);
      for (auto child = below.rbegin(); child != below.rend(); ++child)
        stack_.push_back({*child, node.world, node.visible, node.animated});
    }
    return std::move(planes_);
  }

 private:
  [[nodiscard]] static std::vector<std::size_t> childrenOf(const Json& json, const char* member = "children") {
    const auto* children = memberOf(json, member);
    return children != nullptr ? children->get<std::vector<std::size_t>>() : std::vector<std::size_t>();
  }

  /// Of the scene to show: /scene, else the first of /scenes, else every node without a parent.
  [[nodiscard]] std::vector<std::size_t> rootNodes() const {
    const auto* scenes = memberOf(document_.gltf, "scenes");
    if (scenes != nullptr && !scenes->empty())
      return childrenOf((*scenes)[document_.gltf.value("scene", std::size_t{0})], "nodes");
    std::vector<bool> has_parent(nodes_.size(), false);
    for (const auto& node : nodes_)
      for (const auto child : childrenOf(node)) has_parent[child] = true;
    std::vector<std::size_t> roots;
    for (std::size_t n = 0; n < has_parent.size(); ++n)
      if (!has_parent[n]) roots.push_back(n);
    return roots;
  }

  Result<void> take(const Json& json, const Place& node) {
    const auto where = place(document_.name, pointerOf(node.index));
    if (!isFinite(node.world)) return fail(ErrorCode::kInvalidScene, "its world transform is not finite", where);
    auto plane = PlaneReader(document_.name, json, node, points_).read();
    if (!plane) return tl::unexpected(plane.error());
    if (!node.visible) return {};
    if (planes_.size() >= kMostPlanes)
      return fail(ErrorCode::kTooLarge, "is one of more than " + std::to_string(kMostPlanes) + " measuring planes",
                  where);
    points_ += plane->pointCount();
    planes_.push_back(std::move(*plane));
    return {};
  }

  const Document& document_;
  const Json& nodes_;
  std::vector<bool> animated_;
  std::vector<Place> stack_;
  std::vector<MeasuringPlane> planes_;
  std::uint64_t points_ = 0;
};

}  // namespace

Result<std::vector<MeasuringPlane>> readPlanes(const Document& document) {
  const auto* nodes = memberOf(document.gltf, "nodes");
  const auto has_plane = [](const Json& node) { return planeOf(node) != nullptr; };
  if (nodes == nullptr || std::none_of(nodes->begin(), nodes->end(), has_plane)) return std::vector<MeasuringPlane>();
  return PlaneWalk(document).run();
}

}  // namespace radiosity::scene
