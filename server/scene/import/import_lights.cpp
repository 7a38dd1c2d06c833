#include "server/scene/import/import_lights.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <memory>
#include <numbers>
#include <span>
#include <utility>

#include "common/task.h"
#include "server/scene/document/document_uri.h"
#include "server/scene/document/scene_limit.h"
#include "server/scene/import/photometric_file.h"

namespace radiosity::scene {
namespace {

constexpr double kMaxConeRad = std::numbers::pi / 2;
/// Metres: a lamp as large as a country is a mistake.
constexpr double kMostSize = 1e6;
/// Degrees: light from a wider angle is that of a sky.
constexpr double kWidestSun = 90.0;
/// Times the candela of a web, or square metres, it is still a number in single precision.
constexpr float kBrightest = 1e24F;
/// Of all directions, some two degrees across: a web that shines into less may pass between the places of the texels
/// that look for its light.
constexpr double kNarrowBeam = 1e-4;
constexpr const char* kPunctual = "KHR_lights_punctual";
constexpr const char* kArea = "EXT_lights_area";
constexpr const char* kIes = "EXT_lights_ies";

std::string pointerTo(const char* extension, std::size_t light) {
  return std::string("/extensions/") + extension + "/lights/" + std::to_string(light);
}

/// The axes of a node, unit length and at right angles; those that are flattened away are replaced by any.
struct Axes {
  glm::dvec3 x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};

  explicit Axes(const glm::dmat4& world) {
    if (const glm::dvec3 along(world[2]); glm::length(along) > 0) z = glm::normalize(along);
    const auto across = glm::dvec3(world[0]) - glm::dot(glm::dvec3(world[0]), z) * z;
    const auto helper = std::abs(z.x) < 0.6 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 1, 0);
    x = glm::normalize(glm::length(across) > 0 ? across : glm::cross(helper, z));
    y = glm::cross(z, x);
  }
  [[nodiscard]] glm::dvec3 of(const glm::dvec3& own) const { return own.x * x + own.y * y + own.z * z; }
};

/// Of EXT_lights_area: lamps grow with the largest scale of their node, in all directions.
double largestScale(const glm::dmat4& world) {
  return std::max(
      {glm::length(glm::dvec3(world[0])), glm::length(glm::dvec3(world[1])), glm::length(glm::dvec3(world[2]))});
}

class LightPlacer {
 public:
  LightPlacer(ImportContext& context, const glm::dmat4& world, std::string node)
      : context_(context), world_(world), axes_(world), node_(std::move(node)) {}

  Result<void> punctual(std::size_t index) {
    const auto& source = context_.model.lights[index];
    const auto pointer = pointerTo(kPunctual, index);
    PunctualLight light;
    if (source.type == "spot") {
      light.kind = LightKind::kSpot;
    } else if (source.type == "directional") {
      light.kind = LightKind::kDirectional;
    } else if (source.type != "point") {
      return context_.bad(pointer + "/type", "must be point, spot or directional");
    }
    const auto axis = -glm::dvec3(world_[2]);
    if (glm::length(axis) > 0) light.direction = glm::normalize(axis);
    const auto color = source.color.empty() ? std::vector<double>{1, 1, 1} : source.color;
    if (auto ok = shine(light, source.intensity, color, pointer + "/intensity"); !ok) return ok;
    light.range = source.range;
    light.inner_cone_rad = source.spot.innerConeAngle;
    light.outer_cone_rad = source.spot.outerConeAngle;
    if (light.kind == LightKind::kSpot) {
      if (!(light.outer_cone_rad > 0)) return context_.bad(pointer + "/spot/outerConeAngle", "must be above 0");
      // What is odd about them is said once a light (import_lint.h).
      light.outer_cone_rad = std::min(light.outer_cone_rad, kMaxConeRad);
      light.inner_cone_rad = std::min(light.inner_cone_rad, light.outer_cone_rad);
    }
    const auto radius = radiusOf(lightOf(kPunctual, index), pointer);
    if (!radius) return tl::unexpected(radius.error());
    if (light.kind != LightKind::kDirectional) light.half.x = *radius;
    const auto angle = angleOf(lightOf(kPunctual, index), pointer);
    if (!angle) return tl::unexpected(angle.error());
    if (light.kind == LightKind::kDirectional) light.half.x = *angle;
    return add(std::move(light), pointer);
  }

  /// One without area sends nothing.
  Result<void> area(std::size_t index) {
    const auto& source = lightOf(kArea, index);
    const auto pointer = pointerTo(kArea, index);
    PunctualLight light;
    light.kind = source["type"] == "disk" ? LightKind::kDisc : LightKind::kRectangle;
    light.direction = -axes_.z;
    light.across = axes_.x;
    const double half = 0.5 * source.value("size", 1.0) * largestScale(world_);
    const auto rect = source.value("rect", Json::object());
    light.half = {half, half};
    if (light.kind == LightKind::kRectangle) light.half.x *= rect.value("aspect", 1.0);
    if (!(light.half.x <= kMostSize && light.half.y <= kMostSize))
      return context_.bad(node_, "makes its area light larger than 1000 km");
    const auto color = source.value("color", std::vector<double>{1, 1, 1});
    if (auto ok = shine(light, source.value("intensity", 1000.0), color, pointer + "/intensity"); !ok) return ok;
    if (light.half.x > 0.0 && light.half.y > 0.0) return add(std::move(light), pointer);
    context_.warn(node_, "its area light has no area, and sends no light");
    return {};
  }

  Result<void> ies(const Json& of_node) {
    const auto index = of_node["light"].get<std::size_t>();
    const auto read = webOf(index);
    if (!read) return tl::unexpected(read.error());
    PunctualLight light;
    light.kind = LightKind::kWeb;
    light.web = (*read)->web;
    const auto own = webAxes((*read)->frame);
    light.direction = axes_.of(own.axis);
    light.across = axes_.of(own.across);
    const auto color = of_node.value("color", std::vector<double>{1, 1, 1});
    const auto pointer = node_ + "/extensions/" + kIes;
    if (auto ok = shine(light, of_node.value("multiplier", 1.0), color, pointer + "/multiplier"); !ok) return ok;
    return add(std::move(light), pointer);
  }

 private:
  [[nodiscard]] const Json& lightOf(const char* extension, std::size_t index) const {
    return context_.document.gltf["extensions"][extension]["lights"][index];
  }

  /// Our own: KHR_lights_punctual knows no size.
  [[nodiscard]] Result<double> radiusOf(const Json& light, const std::string& pointer) const {
    const auto extras = light.find("extras");
    if (extras == light.end() || !extras->is_object() || !extras->contains("radiosityRadius")) return 0.0;
    const auto& radius = (*extras)["radiosityRadius"];
    if (radius.is_number() && radius.get<double>() >= 0.0 && radius.get<double>() <= kMostSize)
      return radius.get<double>();
    return context_.bad(pointer + "/extras/radiosityRadius", "must be a number of metres in [0, 1e6]");
  }

  /// Likewise: half of the angle that a directional light comes from, radians; the file has all of it in degrees.
  [[nodiscard]] Result<double> angleOf(const Json& light, const std::string& pointer) const {
    const auto extras = light.find("extras");
    if (extras == light.end() || !extras->is_object() || !extras->contains("radiosityAngle")) return 0.0;
    const auto& angle = (*extras)["radiosityAngle"];
    if (angle.is_number() && angle.get<double>() >= 0.0 && angle.get<double>() <= kWidestSun)
      return angle.get<double>() * std::numbers::pi / 360.0;
    return context_.bad(pointer + "/extras/radiosityAngle", "must be a number of degrees in [0, 90]");
  }

  [[nodiscard]] Result<void> shine(PunctualLight& light, double strength, const std::vector<double>& color,
                                   const std::string& pointer) const {
    for (int c = 0; c < 3; ++c) {
      light.intensity[c] = static_cast<float>(color[static_cast<std::size_t>(c)] * strength);
      if (!(light.intensity[c] <= kBrightest)) return context_.bad(pointer, "is too bright to hold");
    }
    return {};
  }

  Result<void> add(PunctualLight light, const std::string& pointer) {
    light.position = glm::dvec3(world_[3]);
    if (context_.scene.lights.size() >= context_.limits.max_nodes) {
      return context_.tooLarge(pointer, "more than " + std::to_string(context_.limits.max_nodes) + " lights");
    }
    context_.scene.lights.push_back(std::move(light));
    return {};
  }

  /// Read once, however many nodes use it, and edits where it lies in a buffer.
  Result<std::shared_ptr<const ReadWeb>> webOf(std::size_t index) {
    const auto pointer = pointerTo(kIes, index);
    auto& known = context_.webs_of_lights;
    if (const auto found = known.find(index); found != known.end()) return tell(found->second, pointer);
    auto read = readWeb(lightOf(kIes, index), pointer);
    if (read) known.emplace(index, *read);
    return read;
  }

  Result<std::shared_ptr<const ReadWeb>> readWeb(const Json& light, const std::string& pointer) {
    interruptionPoint();
    WebKey key;
    Bytes decoded;
    std::span<const std::uint8_t> bytes;
    if (light.contains("bufferView")) {
      const auto* view = viewOf(context_.model, light["bufferView"].get<int>());
      if (view == nullptr) return context_.bad(pointer + "/bufferView", "is no buffer view");
      const auto& buffer = context_.document.buffers[static_cast<std::size_t>(view->buffer)];
      bytes = std::span(*buffer).subspan(view->byteOffset, view->byteLength);
      key = {buffer, view->byteOffset, view->byteLength};
    } else {
      const auto uri = light.value("uri", std::string());
      if (!isDataUri(uri)) return context_.bad(pointer, "must have a bufferView or a data URI");
      auto data = decodeDataUri(uri, place(context_.document.name, pointer + "/uri"));
      if (!data) return tl::unexpected(data.error());
      decoded = std::move(*data);
      bytes = decoded;
    }
    return read(key, bytes, pointer);
  }

  Result<std::shared_ptr<const ReadWeb>> read(const WebKey& key, std::span<const std::uint8_t> bytes,
                                              const std::string& pointer) {
    auto& webs = context_.webs;
    auto known = webs.find(key);
    if (key.buffer && known == webs.end() && context_.before != nullptr) {
      const auto before = context_.before->webs.find(key);
      if (before != context_.before->webs.end()) known = webs.emplace(*before).first;
    }
    if (key.buffer && known != webs.end()) return tell(known->second, pointer);
    auto file = parsePhotometricFile(bytes, place(context_.document.name, pointer));
    if (!file) return tl::unexpected(file.error());
    context_.web_bytes += file->web.table.size() * sizeof(float);
    const auto limit = sceneMemoryLimit(context_.limits);
    if (const auto all = context_.claimed_bytes + context_.web_bytes; all > limit.bytes)
      return context_.tooLarge(pointer, sceneMemoryFault(all, limit, "its photometric files"));
    ReadWeb made{SharedWeb(std::make_shared<const LightWeb>(std::move(file->web))), file->frame,
                 std::move(file->warnings)};
    if (!(made.web->lumens > 0.0)) made.warnings.emplace_back("its web is dark in all directions");
    const double whole = 4.0 * std::numbers::pi * static_cast<double>(std::ranges::max(made.web->candela()));
    if (made.web->lumens > 0.0 && made.web->lumens < kNarrowBeam * whole)
      made.warnings.emplace_back(
          "its web is so narrow a beam that what it lights may be missed where the beam is narrower than a texel");
    auto shared = std::make_shared<const ReadWeb>(std::move(made));
    if (key.buffer) webs.emplace(key, shared);
    return tell(std::move(shared), pointer);
  }

  /// Warns once a light.
  std::shared_ptr<const ReadWeb> tell(std::shared_ptr<const ReadWeb> read, const std::string& pointer) {
    if (context_.webs_told.insert(pointer).second)
      for (const auto& warning : read->warnings) context_.warn(pointer, warning);
    return read;
  }

  ImportContext& context_;
  const glm::dmat4& world_;
  Axes axes_;
  std::string node_;
};

}  // namespace

Result<void> placeLights(ImportContext& context, const Json& node, const glm::dmat4& world,
                         const std::string& pointer) {
  const auto *punctual = extensionOf(node, kPunctual), *area = extensionOf(node, kArea), *ies = extensionOf(node, kIes);
  if (punctual == nullptr && area == nullptr && ies == nullptr) return {};
  LightPlacer placer(context, world, pointer);
  if (punctual != nullptr)
    if (auto ok = placer.punctual((*punctual)["light"].get<std::size_t>()); !ok) return ok;
  if (area != nullptr)
    if (auto ok = placer.area((*area)["light"].get<std::size_t>()); !ok) return ok;
  return ies != nullptr ? placer.ies(*ies) : Result<void>{};
}

}  // namespace radiosity::scene
