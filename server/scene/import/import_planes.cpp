#include "server/scene/import/import_planes.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <string>
#include <utility>

#include "server/scene/document/json_text.h"
#include "server/scene/import/placed_nodes.h"

namespace radiosity::scene {
namespace {

constexpr const char* kMember = "radiosityPlane";
/// Metres, of a side in the node's space and in the world.
constexpr double kMostSide = 1e6, kLeastSide = 1e-6, kFarthestPlane = 1e9;
constexpr double kMostAskedLux = 1e9;
/// Of the cosine between the sides of a rectangle.
constexpr double kSquare = 1e-3;

std::string pointerOf(std::size_t node) { return "/nodes/" + std::to_string(node) + "/extras/" + kMember; }

class PlaneReader {
 public:
  PlaneReader(const std::string& document, const PlacedNode& node, std::uint64_t other_points)
      : document_(document),
        node_(node),
        plane_(*node.extras),
        pointer_(pointerOf(node.index)),
        other_points_(other_points) {}

  Result<MeasuringPlane> read() {
    if (!plane_.is_object()) return bad(pointer_, "must be an object with width and depth");
    if (const auto ok = requireOnePlace(document_, node_, pointer_, "a plane"); !ok) return tl::unexpected(ok.error());
    MeasuringPlane made;
    made.node = static_cast<std::uint32_t>(node_.index);
    made.name = node_.name;
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
  const PlacedNode& node_;
  const Json& plane_;
  std::string pointer_;
  std::uint64_t other_points_;
};

/// Reads the planes of the nodes that have one.
class PlaneList {
 public:
  explicit PlaneList(const Document& document) : document_(document) {}

  Result<void> take(const PlacedNode& node) {
    const auto where = place(document_.name, pointerOf(node.index));
    auto plane = PlaneReader(document_.name, node, points_).read();
    if (!plane) return tl::unexpected(plane.error());
    if (!node.visible) return {};
    if (planes_.size() >= kMostPlanes)
      return fail(ErrorCode::kTooLarge, "is one of more than " + std::to_string(kMostPlanes) + " measuring planes",
                  where);
    points_ += plane->pointCount();
    planes_.push_back(std::move(*plane));
    return {};
  }
  [[nodiscard]] std::vector<MeasuringPlane> planes() && { return std::move(planes_); }

 private:
  const Document& document_;
  std::vector<MeasuringPlane> planes_;
  std::uint64_t points_ = 0;
};

}  // namespace

Result<std::vector<MeasuringPlane>> readPlanes(const Document& document) {
  PlaneList list(document);
  const auto done = forEachPlacedNode(document, kMember, [&](const PlacedNode& node) { return list.take(node); });
  if (!done) return tl::unexpected(done.error());
  return std::move(list).planes();
}

}  // namespace radiosity::scene
