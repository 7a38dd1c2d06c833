#include "client/cli/scene_edits.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <numbers>
#include <optional>
#include <set>
#include <sstream>
#include <string_view>

namespace radiosity::cli {
namespace {

constexpr const char* kLights = "/extensions/KHR_lights_punctual/lights";
constexpr const char* kAreaLights = "/extensions/EXT_lights_area/lights";

enum class Kind { kMaterial, kLight, kAreaLight, kNode };

/// What follows "@NAME.": where it lies, seen from the thing, and how its value is written.
struct Property {
  const char* name;
  Kind kind;
  const char* path;
  enum class Value { kAny, kColor, kBaseColor, kAlpha, kScale } value;
  const char* help;
};

constexpr std::array kProperties = {
    Property{"emissiveStrength", Kind::kMaterial, "/extensions/KHR_materials_emissive_strength/emissiveStrength",
             Property::Value::kAny, "nits at an emissiveFactor of 1"},
    Property{"emissiveFactor", Kind::kMaterial, "/emissiveFactor", Property::Value::kColor, "R,G,B of the light"},
    Property{"color", Kind::kMaterial, "/pbrMetallicRoughness/baseColorFactor", Property::Value::kBaseColor,
             "R,G,B reflected, linear"},
    Property{"alpha", Kind::kMaterial, "/pbrMetallicRoughness/baseColorFactor", Property::Value::kAlpha, "opacity"},
    Property{"metallic", Kind::kMaterial, "/pbrMetallicRoughness/metallicFactor", Property::Value::kAny, "0 to 1"},
    Property{"alphaMode", Kind::kMaterial, "/alphaMode", Property::Value::kAny, "OPAQUE, MASK or BLEND"},
    Property{"alphaCutoff", Kind::kMaterial, "/alphaCutoff", Property::Value::kAny, "of MASK"},
    Property{"doubleSided", Kind::kMaterial, "/doubleSided", Property::Value::kAny, "true or false"},
    Property{"intensity", Kind::kLight, "/intensity", Property::Value::kAny, "candela, or lux of a directional light"},
    Property{"color", Kind::kLight, "/color", Property::Value::kColor, "R,G,B of the light"},
    Property{"range", Kind::kLight, "/range", Property::Value::kAny, "metres"},
    Property{"radius", Kind::kLight, "/extras/radiosityRadius", Property::Value::kAny,
             "metres, of the ball that a point light is, or of a spot's disc"},
    Property{"intensity", Kind::kAreaLight, "/intensity", Property::Value::kAny, "nits"},
    Property{"color", Kind::kAreaLight, "/color", Property::Value::kColor, "R,G,B of the light"},
    Property{"size", Kind::kAreaLight, "/size", Property::Value::kAny,
             "metres: diameter of a disc, height of a rectangle"},
    Property{"aspect", Kind::kAreaLight, "/rect/aspect", Property::Value::kAny, "width of a rectangle / its height"},
    Property{"multiplier", Kind::kNode, "/extensions/EXT_lights_ies/multiplier", Property::Value::kAny,
             "factor of the candela of an IES file"},
    Property{"translation", Kind::kNode, "/translation", Property::Value::kAny, "X,Y,Z in metres"},
    Property{"rotation", Kind::kNode, "/rotation", Property::Value::kAny, "quaternion X,Y,Z,W"},
    Property{"scale", Kind::kNode, "/scale", Property::Value::kScale, "X,Y,Z, none of them 0"},
    Property{"visible", Kind::kNode, "/extensions/KHR_node_visibility/visible", Property::Value::kAny, "true or false"},
    Property{"texelScale", Kind::kNode, "/extras/radiosityTexelScale", Property::Value::kAny,
             "texels a metre, relative to the rest of the scene"},
};

tl::unexpected<Error> bad(std::string message, std::string where = {}) {
  return fail(ErrorCode::kBadInput, std::move(message), std::move(where));
}

std::string escaped(const std::string& token) {
  std::string out;
  for (const char c : token) out += c == '~' ? "~0" : c == '/' ? "~1" : std::string(1, c);
  return out;
}

const Json& arrayAt(const Json& gltf, const std::string& pointer) {
  static const Json kNone = Json::array();
  const Json::json_pointer place(pointer);
  return gltf.contains(place) && gltf.at(place).is_array() ? gltf.at(place) : kNone;
}

std::vector<std::size_t> named(const Json& array, const std::string& name) {
  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < array.size(); ++i) {
    if (array[i].is_object() && array[i].value("name", Json()) == name) found.push_back(i);
  }
  return found;
}

std::string arrayOf(Kind kind) {
  switch (kind) {
    case Kind::kMaterial:
      return "/materials";
    case Kind::kLight:
      return kLights;
    case Kind::kAreaLight:
      return kAreaLights;
    default:
      return "/nodes";
  }
}

std::string nounOf(Kind kind) {
  constexpr std::array kNouns{"material", "light", "area light", "node"};
  return kNouns[static_cast<std::size_t>(kind)];
}

/// A scale of 0 makes a sheet of a body: faces that look both ways in one plane, which no light can tell apart.
bool isScale(const std::array<double, 3>& scale) {
  return std::ranges::all_of(scale, [](double part) { return std::isfinite(part) && part != 0.0; });
}

constexpr auto kNoScale = "each of X, Y and Z must be a finite number other than 0";

/// Names that are there, for an error: the nearest guess is left to the reader.
std::string someNames(const Json& array) {
  std::string text;
  std::size_t count = 0;
  for (const auto& element : array) {
    const auto name = element.is_object() ? element.value("name", std::string()) : std::string();
    if (name.empty()) continue;
    if (++count > 8) return text + ", ...";
    text += (text.empty() ? "" : ", ") + name;
  }
  return text.empty() ? "none has a name" : "there are " + text;
}

/// Materials of the node's mesh, or its light.
std::vector<std::size_t> thingsOfNode(const Json& gltf, const Json& node, Kind kind) {
  std::set<std::size_t> found;
  if (kind == Kind::kLight || kind == Kind::kAreaLight) {
    const Json::json_pointer light(kind == Kind::kLight ? "/extensions/KHR_lights_punctual/light"
                                                        : "/extensions/EXT_lights_area/light");
    if (node.contains(light)) found.insert(node.at(light).get<std::size_t>());
  } else if (node.contains("mesh")) {
    for (const auto& primitive : gltf.at("meshes").at(node["mesh"].get<std::size_t>()).at("primitives")) {
      if (primitive.contains("material")) found.insert(primitive["material"].get<std::size_t>());
    }
  }
  return {found.begin(), found.end()};
}

/// The things of a kind that a name means: the one of that name, or those of the one node of that name.
Result<std::vector<std::size_t>> thingsNamed(const Json& gltf, const std::string& name, Kind kind) {
  const auto& array = arrayAt(gltf, arrayOf(kind));
  auto found = named(array, name);
  if (found.size() > 1)
    return bad(fmt::format("{} {}s are called that; write {}/{} or another of them", found.size(), nounOf(kind),
                           arrayOf(kind), found[0]),
               "@" + name);
  if (!found.empty() || kind == Kind::kNode) return found;
  const auto& nodes = arrayAt(gltf, "/nodes");
  const auto holders = named(nodes, name);
  if (holders.size() > 1) return bad(fmt::format("{} nodes are called that", holders.size()), "@" + name);
  return holders.empty() ? found : thingsOfNode(gltf, nodes[holders[0]], kind);
}

/// JSON, or numbers with commas, or a word.
Json valueOf(const std::string& text) {
  if (auto json = Json::parse(text, nullptr, false); !json.is_discarded()) return json;
  if (auto list = Json::parse("[" + text + "]", nullptr, false); !list.is_discarded()) return list;
  return text;
}

Result<Json> propertyValue(const Property& property, const std::string& text, const Json& before) {
  auto value = valueOf(text);
  if (property.value == Property::Value::kAny) return value;
  if (property.value == Property::Value::kScale) {
    const auto isNumber = [](const Json& part) { return part.is_number(); };
    if (!value.is_array() || value.size() != 3 || !std::ranges::all_of(value, isNumber) ||
        !isScale(value.get<std::array<double, 3>>()))
      return bad(kNoScale, property.name);
    return value;
  }
  if (property.value == Property::Value::kAlpha) {
    if (!value.is_number() || !before.is_array() || before.size() != 4) return bad("must be a number", property.name);
    return Json::array({before[0], before[1], before[2], value});
  }
  if (value.is_number()) value = Json::array({value, value, value});  // grey
  if (property.value == Property::Value::kBaseColor && value.is_array() && value.size() == 3)
    value.push_back(before.is_array() && before.size() == 4 ? before[3] : Json(1.0));
  return value;
}

/// Sets one member; objects on the way that are missing (extras) come with it.
Json setOperation(const Json& thing, const std::string& pointer, const std::string& path, Json value) {
  if (thing.contains(Json::json_pointer(path)))
    return {{"op", "replace"}, {"path", pointer + path}, {"value", std::move(value)}};
  auto at = path;
  for (auto end = at.rfind('/'); end > 0 && !thing.contains(Json::json_pointer(at.substr(0, end)));
       end = at.rfind('/')) {
    value = Json{{at.substr(end + 1), std::move(value)}};
    at = at.substr(0, end);
  }
  return {{"op", "add"}, {"path", pointer + at}, {"value", std::move(value)}};
}

std::string propertyNames() {
  std::set<std::string_view> names;  // `color` is a material's and a light's
  for (const auto& property : kProperties) names.insert(property.name);
  return fmt::format("{}", fmt::join(names, ", "));
}

Result<Json> setProperty(const Json& gltf, const std::string& name, const std::string& property,
                         const std::string& value) {
  bool known = false;
  for (const auto& candidate : kProperties) {
    if (candidate.name != property) continue;
    known = true;
    const auto things = thingsNamed(gltf, name, candidate.kind);
    if (!things) return tl::unexpected(things.error());
    if (things->empty()) continue;
    Json patch = Json::array();
    for (const auto index : *things) {
      const auto& thing = arrayAt(gltf, arrayOf(candidate.kind)).at(index);
      const Json::json_pointer path(candidate.path);
      auto json = propertyValue(candidate, value, thing.contains(path) ? thing.at(path) : Json());
      if (!json) return json;
      patch.push_back(
          setOperation(thing, pointerTo(gltf, arrayOf(candidate.kind), index), candidate.path, std::move(*json)));
    }
    return patch;
  }
  if (!known) return bad(fmt::format("no such property; there are {}", propertyNames()), property);
  for (const auto& candidate : kProperties) {
    if (candidate.name != property) continue;
    return bad(fmt::format("no {} or node that has one is called that; {}", nounOf(candidate.kind),
                           someNames(arrayAt(gltf, arrayOf(candidate.kind)))),
               "@" + name);
  }
  return bad("nothing is called that", "@" + name);
}

using Quaternion = std::array<double, 4>;  // x, y, z, w

Quaternion product(const Quaternion& a, const Quaternion& b) {
  return {a[3] * b[0] + a[0] * b[3] + a[1] * b[2] - a[2] * b[1], a[3] * b[1] - a[0] * b[2] + a[1] * b[3] + a[2] * b[0],
          a[3] * b[2] + a[0] * b[1] - a[1] * b[0] + a[2] * b[3], a[3] * b[3] - a[0] * b[0] - a[1] * b[1] - a[2] * b[2]};
}

template <std::size_t N>
std::array<double, N> numbersOf(const Json& node, const char* member, std::array<double, N> otherwise) {
  if (node.contains(member) && node[member].is_array() && node[member].size() == N) {
    for (std::size_t i = 0; i < N; ++i) otherwise[i] = node[member][i].template get<double>();
  }
  return otherwise;
}

/// `replace` of a member of a node that the server has written out; a sheared one has no such member.
Result<Json> replaceTransform(const Json& gltf, std::size_t index, const char* member, Json value) {
  const auto pointer = pointerTo(gltf, "/nodes", index);
  if (gltf.at("nodes").at(index).contains("matrix"))
    return bad("its matrix shears or flattens, so that it has no translation, rotation and scale", pointer);
  return Json::array({{{"op", "replace"}, {"path", pointer + "/" + member}, {"value", std::move(value)}}});
}

}  // namespace

std::string propertyHelp() {
  std::string text;
  for (const auto& property : kProperties)
    text += fmt::format("  {:17} {}: {}\n", property.name, nounOf(property.kind), property.help);
  return text;
}

std::string pointerTo(const Json& gltf, const std::string& array, std::size_t index) {
  const auto& things = arrayAt(gltf, array);
  const auto name = things.at(index).value("name", std::string());
  const bool unique = !name.empty() && name.size() < 100 && named(things, name).size() == 1;
  return array + "/" + (unique ? "@" + escaped(name) : std::to_string(index));
}

Result<std::size_t> findNode(const Json& gltf, const std::string& node) {
  const auto& nodes = arrayAt(gltf, "/nodes");
  constexpr std::string_view kPrefix = "/nodes/";
  if (node.starts_with("@")) {
    const auto found = named(nodes, node.substr(1));
    if (found.size() == 1) return found[0];
    if (found.empty()) return bad("no node is called that; " + someNames(nodes), node);
    return bad(fmt::format("{} nodes are called that; write /nodes/{} or another of them", found.size(), found[0]),
               node);
  }
  std::size_t index = 0;
  const auto digits = node.starts_with(kPrefix) ? node.substr(kPrefix.size()) : std::string();
  const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), index);
  if (digits.empty() || error != std::errc() || end != digits.data() + digits.size())
    return bad("a node is written @NAME or /nodes/N", node);
  if (index >= nodes.size()) return bad(fmt::format("there are {} nodes", nodes.size()), node);
  return index;
}

Result<Json> setPatch(const Json& gltf, const std::string& target, const std::string& value) {
  if (target.starts_with("/"))
    return Json::array({{{"op", "add"}, {"path", target}, {"value", valueOf(value)}}});  // or replaces
  const auto dot = target.rfind('.');
  if (!target.starts_with("@") || dot == std::string::npos || dot < 2)
    return bad("a target is written @NAME.PROPERTY or as a JSON pointer", target);
  return setProperty(gltf, target.substr(1, dot - 1), target.substr(dot + 1), value);
}

Result<Json> movePatch(const Json& gltf, const std::string& node, const std::array<double, 3>& metres, bool relative) {
  const auto index = findNode(gltf, node);
  if (!index) return tl::unexpected(index.error());
  auto to = metres;
  if (relative) {
    const auto at = numbersOf<3>(gltf["nodes"][*index], "translation", {});
    for (std::size_t i = 0; i < 3; ++i) to[i] += at[i];
  }
  return replaceTransform(gltf, *index, "translation", to);
}

Result<Json> rotatePatch(const Json& gltf, const std::string& node, double degrees, const std::array<double, 3>& axis,
                         bool absolute) {
  const auto index = findNode(gltf, node);
  if (!index) return tl::unexpected(index.error());
  const double length = std::hypot(axis[0], axis[1], axis[2]);
  if (!(length > 0.0)) return bad("the axis has no length", node);
  if (!std::isfinite(degrees)) return bad("DEGREES must be a finite number", node);
  const double half = std::remainder(degrees, 720.0) * std::numbers::pi / 360.0, s = std::sin(half) / length;
  Quaternion turn{axis[0] * s, axis[1] * s, axis[2] * s, std::cos(half)};
  if (!absolute) turn = product(turn, numbersOf<4>(gltf["nodes"][*index], "rotation", {0.0, 0.0, 0.0, 1.0}));
  const double norm = std::hypot(std::hypot(turn[0], turn[1]), std::hypot(turn[2], turn[3]));
  for (auto& part : turn) part /= norm;  // many small turns stay a rotation
  return replaceTransform(gltf, *index, "rotation", turn);
}

Result<Json> scalePatch(const Json& gltf, const std::string& node, const std::array<double, 3>& factor) {
  const auto index = findNode(gltf, node);
  if (!index) return tl::unexpected(index.error());
  if (!isScale(factor)) return bad(kNoScale, node);
  auto scale = numbersOf<3>(gltf["nodes"][*index], "scale", {1.0, 1.0, 1.0});
  const bool was_good = isScale(scale);
  for (std::size_t i = 0; i < 3; ++i) scale[i] *= factor[i];
  if (was_good && !isScale(scale)) return bad("that makes it too large or too small for a number", node);
  return replaceTransform(gltf, *index, "scale", scale);
}

Result<Json> visibilityPatch(const Json& gltf, const std::string& node, bool visible) {
  const auto index = findNode(gltf, node);
  if (!index) return tl::unexpected(index.error());
  return Json::array({setOperation(gltf["nodes"][*index], pointerTo(gltf, "/nodes", *index),
                                   "/extensions/KHR_node_visibility/visible", visible)});
}

Result<Json> removePatch(const Json& gltf, const std::string& node) {
  const auto index = findNode(gltf, node);
  if (!index) return tl::unexpected(index.error());
  Json patch = Json::array();
  const auto detach = [&](const std::string& array, const char* list) {
    const auto& holders = arrayAt(gltf, array);
    for (std::size_t h = 0; h < holders.size(); ++h) {
      auto rest = holders[h].value(list, Json::array());
      const auto found = std::find(rest.begin(), rest.end(), Json(*index));
      if (found == rest.end()) continue;
      rest.erase(found);
      const auto path = pointerTo(gltf, array, h) + "/" + list;
      patch.push_back(rest.empty() ? Json{{"op", "remove"}, {"path", path}}
                                   : Json{{"op", "replace"}, {"path", path}, {"value", std::move(rest)}});
    }
  };
  detach("/scenes", "nodes");
  detach("/nodes", "children");
  if (patch.empty()) return bad("it is in no scene (any more)", node);
  return patch;
}

}  // namespace radiosity::cli
