#include "server/scene/import/import_probes.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <string>
#include <utility>

#include "server/scene/document/json_text.h"
#include "server/scene/import/placed_nodes.h"

namespace radiosity::scene {
namespace {

constexpr const char* kProbesMember = "radiosityProbes";
/// Metres, of a side in the node's space and in the world.
constexpr double kMostGridSide = 1e6, kLeastGridSide = 1e-6, kFarthestGrid = 1e9;
/// Of the volume of a box with these sides, what shear may take.
constexpr double kMostSheared = 1e-3;

bool isLength(const Json& json) {
  return json.is_number() && json.get<double>() > 0.0 && json.get<double>() <= kMostGridSide;
}

class ProbeGridList {
 public:
  explicit ProbeGridList(const Document& document) : document_(document) {}

  Result<void> take(const PlacedNode& node) {
    const auto pointer = "/nodes/" + std::to_string(node.index) + "/extras/" + kProbesMember;
    auto grid = read(node, pointer);
    if (!grid) return tl::unexpected(grid.error());
    if (!node.visible) return {};
    if (grids_.size() >= kMostProbeGrids)
      return fail(ErrorCode::kTooLarge, "is one of more than " + std::to_string(kMostProbeGrids) + " grids of probes",
                  place(document_.name, pointer));
    probes_ += grid->probeCount();
    grids_.push_back(std::move(*grid));
    return {};
  }
  [[nodiscard]] std::vector<ProbeGrid> grids() && { return std::move(grids_); }

 private:
  Result<ProbeGrid> read(const PlacedNode& node, const std::string& pointer) const {
    const auto& json = *node.extras;
    if (!json.is_object()) return bad(pointer, "must be an object with size and spacing");
    if (const auto ok = requireOnePlace(document_.name, node, pointer, "a grid"); !ok)
      return tl::unexpected(ok.error());
    const auto *size = memberOf(json, "size"), *spacing = memberOf(json, "spacing");
    if (size == nullptr || !size->is_array() || size->size() != 3 || !std::ranges::all_of(*size, isLength))
      return bad(pointer + "/size", "must be three numbers of metres above 0, at most 1e6");
    if (spacing == nullptr || !isLength(*spacing))
      return bad(pointer + "/spacing", "must be a number of metres above 0, at most 1e6");
    ProbeGrid made;
    made.node = static_cast<std::uint32_t>(node.index);
    made.name = node.name;
    made.corner = glm::dvec3(node.world[3]);
    for (int axis = 0; axis < 3; ++axis) {
      auto& side = made.sides[static_cast<std::size_t>(axis)];
      side = (*size)[static_cast<std::size_t>(axis)].get<double>() * glm::dvec3(node.world[axis]);
      made.corner -= 0.5 * side;
    }
    if (auto ok = checkPlace(made, pointer); !ok) return tl::unexpected(ok.error());
    if (auto ok = divide(made, spacing->get<double>(), probes_); !ok)
      return fail(ok.error().code, ok.error().message, place(document_.name, pointer + "/spacing"));
    return made;
  }

  [[nodiscard]] Result<void> checkPlace(const ProbeGrid& grid, const std::string& pointer) const {
    double volume = 1.0;
    for (int axis = 0; axis < 3; ++axis) {
      const double length = glm::length(grid.sides[static_cast<std::size_t>(axis)]);
      volume *= length;
      if (!(length >= kLeastGridSide && length <= kMostGridSide))
        return bad(pointer, "its sides must be from 1 um to 1000 km long as the node scales it");
      if (!(std::abs(grid.corner[axis]) <= kFarthestGrid)) return bad(pointer, "must lie within 1e9 m of the origin");
    }
    const double spanned = std::abs(glm::dot(grid.sides[0], glm::cross(grid.sides[1], grid.sides[2])));
    if (spanned < (1.0 - kMostSheared) * volume)
      return bad(pointer, "must stay a box: the transforms above its node shear it");
    return {};
  }

  [[nodiscard]] tl::unexpected<Error> bad(const std::string& pointer, std::string what) const {
    return fail(ErrorCode::kInvalidScene, std::move(what), place(document_.name, pointer));
  }

  const Document& document_;
  std::vector<ProbeGrid> grids_;
  std::uint64_t probes_ = 0;
};

}  // namespace

Result<std::vector<ProbeGrid>> readProbeGrids(const Document& document) {
  ProbeGridList list(document);
  const auto done = forEachPlacedNode(document, kProbesMember, [&](const PlacedNode& node) { return list.take(node); });
  if (!done) return tl::unexpected(done.error());
  return std::move(list).grids();
}

}  // namespace radiosity::scene
