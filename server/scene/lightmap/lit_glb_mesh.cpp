#include "server/scene/lightmap/lit_glb_mesh.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <limits>
#include <set>
#include <type_traits>
#include <unordered_map>

#include "common/check.h"
#include "common/task.h"
#include "server/scene/import/accessor.h"
#include "server/scene/lightmap/lit_glb_made.h"

namespace radiosity::scene {
namespace {

// A GLB counts its bytes in 32 bits, and the input's own data is in the file too.
constexpr std::size_t kMaxNewBytes = std::size_t{1} << 30;
constexpr int kArrayBuffer = 34962;
constexpr int kElementArrayBuffer = 34963;

struct CornerKey {
  std::uint32_t vertex;
  glm::vec2 uv;
  bool operator==(const CornerKey&) const = default;
};

struct CornerHash {
  std::size_t operator()(const CornerKey& key) const {
    return key.vertex * 0x9E3779B97F4A7C15U ^ std::bit_cast<std::uint32_t>(key.uv.x) * 0xC2B2AE3D27D4EB4FU ^
           std::bit_cast<std::uint32_t>(key.uv.y) * 0x165667B19E3779F9U;
  }
};

template <typename Component>
void negateComponents(std::uint8_t* bytes, std::size_t size) {
  for (std::size_t at = 0; at + sizeof(Component) <= size; at += sizeof(Component)) {
    Component value;
    std::memcpy(&value, bytes + at, sizeof value);
    // The least whole number has no opposite; glTF takes it for -1 as it does the next.
    if (std::is_integral_v<Component>) value = std::max<Component>(value, -std::numeric_limits<Component>::max());
    value = static_cast<Component>(-value);
    std::memcpy(bytes + at, &value, sizeof value);
  }
}

/// A vector of any type that glTF allows for normals and tangents.
void negate(std::uint8_t* bytes, std::size_t size, int component_type) {
  if (component_type == TINYGLTF_COMPONENT_TYPE_FLOAT) negateComponents<float>(bytes, size);
  if (component_type == TINYGLTF_COMPONENT_TYPE_BYTE) negateComponents<std::int8_t>(bytes, size);
  if (component_type == TINYGLTF_COMPONENT_TYPE_SHORT) negateComponents<std::int16_t>(bytes, size);
}

bool hasTooFewNormals(const tinygltf::Model& model, const Json& attributes) {
  const auto count = [&](const char* name) { return model.accessors[attributes[name].get<std::size_t>()].count; };
  return attributes.contains("NORMAL") && count("NORMAL") < count("POSITION");
}

/// None: an empty array.
Json& targetsOf(Json& primitive) {
  static Json none = Json::array();
  return primitive.contains("targets") ? primitive["targets"] : none;
}

std::size_t textBytes(const Json& json) { return json.dump(-1, ' ', false, Json::error_handler_t::replace).size(); }

}  // namespace

void LitMeshBuilder::append(const void* data, std::size_t size) {
  const auto* first = static_cast<const std::uint8_t*>(data);
  bytes_.insert(bytes_.end(), first, first + size);
}

std::size_t LitMeshBuilder::addView(std::size_t first_byte, std::size_t stride) {
  Json view = {{"buffer", buffer_}, {"byteOffset", first_byte}, {"byteLength", bytes_.size() - first_byte}};
  view["target"] = stride == 0 ? kElementArrayBuffer : kArrayBuffer;
  if (stride != 0) view["byteStride"] = stride;
  auto& views = gltf_["bufferViews"];
  views.push_back(std::move(view));
  return views.size() - 1;
}

std::size_t LitMeshBuilder::addAccessor(Json accessor) {
  gltf_["accessors"].push_back(std::move(accessor));
  return gltf_["accessors"].size() - 1;
}

std::size_t LitMeshBuilder::addIndices(const std::vector<std::uint32_t>& indices) {
  const auto first = bytes_.size();
  append(indices.data(), indices.size() * sizeof(std::uint32_t));
  return addAccessor({{"bufferView", addView(first, 0)},
                      {"componentType", TINYGLTF_COMPONENT_TYPE_UNSIGNED_INT},
                      {"count", indices.size()},
                      {"type", "SCALAR"}});
}

std::size_t LitMeshBuilder::addUvs(const std::vector<glm::vec2>& uvs) {
  const auto first = bytes_.size();
  append(uvs.data(), uvs.size() * sizeof(glm::vec2));
  return addAccessor({{"bufferView", addView(first, sizeof(glm::vec2))},
                      {"componentType", TINYGLTF_COMPONENT_TYPE_FLOAT},
                      {"count", uvs.size()},
                      {"type", "VEC2"}});
}

Result<void> LitMeshBuilder::checkRoom(std::size_t more) const {
  if (bytes_.size() + more <= kMaxNewBytes) return {};
  return fail(ErrorCode::kTooLarge, "the lit scene would have more than 1 GiB of new vertex data", document_.name);
}

tl::unexpected<Error> LitMeshBuilder::tooMuchJson() const {
  return fail(ErrorCode::kTooLarge,
              "the lit scene would have more than 64 MiB of JSON again, for meshes that are there many times",
              document_.name);
}

Result<std::size_t> LitMeshBuilder::copyAccessor(std::size_t accessor, const Elements& elements, const Copy& how) {
  const auto reader = AccessorReader::open(document_, model_, accessor);
  if (!reader) return tl::unexpected(reader.error());
  const auto size = elementBytes(model_.accessors[accessor]);
  const auto stride = (size + 3) / 4 * 4;  // vertex data must be aligned to 4 bytes
  const auto first = bytes_.size();
  if (const auto room = checkRoom(stride * elements.vertices.size()); !room) return tl::unexpected(room.error());
  bytes_.reserve(first + stride * elements.vertices.size());
  const auto of_file = elements.cut != nullptr ? elements.cut->fileVertices() : std::numeric_limits<std::size_t>::max();
  const auto unscaled = reader->unnormalized();
  glm::dvec3 low(std::numeric_limits<double>::max());
  glm::dvec3 high(std::numeric_limits<double>::lowest());
  for (const auto element : elements.vertices) {
    interruptionPoint();
    const auto next = bytes_.size() + stride;
    std::array<double, 4> stored{};
    if (element >= of_file) {
      const auto made =
          madeElement(*reader, model_.accessors[accessor], elements.cut->made[element - of_file], how.made);
      append(made.bytes.data(), size);
      stored = made.stored;
    } else {
      if (const auto* data = reader->bytesAt(element)) append(data, size);
      if (how.with_bounds) stored = unscaled.at(element);
    }
    bytes_.resize(next, 0);
    low = glm::min(low, glm::dvec3(stored[0], stored[1], stored[2]));
    high = glm::max(high, glm::dvec3(stored[0], stored[1], stored[2]));
    if (how.negated) negate(bytes_.data() + next - stride, size, model_.accessors[accessor].componentType);
  }
  auto json = document_.gltf["accessors"][accessor];
  for (const auto* member : {"sparse", "byteOffset", "min", "max", "name", "extras", "extensions"}) json.erase(member);
  json["bufferView"] = addView(first, stride);
  json["count"] = elements.vertices.size();
  if (how.with_bounds) {
    json["min"] = {low.x, low.y, low.z};
    json["max"] = {high.x, high.y, high.z};
  }
  return addAccessor(std::move(json));
}

/// `turned`: seen from behind, where glTF turns normals and tangents around (Khronos' sample viewer: both, and the
/// bitangent).
Result<Json> LitMeshBuilder::copyAttributes(const Json& attributes, const Elements& elements, bool turned) {
  Json out = Json::object();
  for (const auto& [name, accessor] : attributes.items()) {
    const bool is_direction = name == "NORMAL" || name == "TANGENT";
    const bool is_number = name.starts_with("_") &&
                           model_.accessors[accessor.get<std::size_t>()].componentType != TINYGLTF_COMPONENT_TYPE_FLOAT;
    const Copy how{name == "POSITION", turned && is_direction,
                   is_direction ? MadeHow::kUnitLength
                   : is_number  ? MadeHow::kNearest
                                : MadeHow::kBetween};
    const auto copied = copyAccessor(accessor.get<std::size_t>(), elements, how);
    if (!copied) return tl::unexpected(copied.error());
    out[name] = *copied;
  }
  return out;
}

std::vector<LitMeshBuilder::Part> LitMeshBuilder::partsOf(const LitPrimitive& lit) {
  std::set<Part> parts;
  for (std::size_t side = 0; side < 2; ++side) {
    const auto& pages = lit.uv->side[side].page;
    for (std::size_t t = 0; t < pages.size(); ++t)
      if (pages[t] != kNone) parts.insert({side, pages[t], lit.isDark(t)});
  }
  return {parts.begin(), parts.end()};
}

LitMeshBuilder::Vertices LitMeshBuilder::collect(const LitPrimitive& lit, const Part& part) {
  Vertices out;
  std::unordered_map<CornerKey, std::uint32_t, CornerHash> ids;
  const auto& indices = lit.primitive->indices;
  const auto& uv = lit.uv->side[part.side];
  const std::array<std::size_t, 3> order =
      part.side == 0 ? std::array<std::size_t, 3>{0, 1, 2} : std::array<std::size_t, 3>{0, 2, 1};
  for (std::size_t t = 0; t < uv.page.size(); ++t) {
    interruptionPoint();
    if (uv.page[t] != part.page || lit.isDark(t) != part.dark) continue;
    for (const auto c : order) {
      const CornerKey key{indices[3 * t + c], uv.corners[t][c]};
      const auto [found, added] = ids.try_emplace(key, static_cast<std::uint32_t>(out.source.size()));
      if (added) {
        out.source.push_back(key.vertex);
        out.uv.push_back(key.uv);
      }
      out.indices.push_back(found->second);
    }
  }
  return out;
}

Result<Json> LitMeshBuilder::partPrimitive(const Json& source, const LitPrimitive& lit, const Part& part) {
  const bool turned = part.side == 1;
  const auto vertices = collect(lit, part);
  const auto more = vertices.uv.size() * sizeof(glm::vec2) + vertices.indices.size() * sizeof(std::uint32_t);
  if (const auto room = checkRoom(more); !room) return tl::unexpected(room.error());
  auto primitive = source;
  auto attributes = source["attributes"];
  attributes.erase("TEXCOORD_1");
  if (hasTooFewNormals(model_, attributes)) {  // no file may have them
    for (const auto* member : {"NORMAL", "TANGENT"}) {
      attributes.erase(member);
      for (auto& target : targetsOf(primitive)) target.erase(member);
    }
  }
  const Elements elements{vertices.source, lit.cut};
  auto copied = copyAttributes(attributes, elements, turned);
  if (!copied) return copied;
  primitive["attributes"] = std::move(*copied);
  primitive["attributes"]["TEXCOORD_1"] = addUvs(vertices.uv);
  if (primitive.contains("targets")) {
    for (auto& target : primitive["targets"]) {
      auto morph = copyAttributes(target, elements, turned);
      if (!morph) return morph;
      target = std::move(*morph);
    }
  }
  primitive["indices"] = addIndices(vertices.indices);
  primitive["mode"] = TINYGLTF_MODE_TRIANGLES;
  if (primitive.contains("extensions")) {  // its compressed copy knows nothing of the new vertices
    primitive["extensions"].erase("KHR_draco_mesh_compression");
    if (primitive["extensions"].empty()) primitive.erase("extensions");
  }
  if (!primitive.contains("extras") || !primitive["extras"].is_object()) primitive["extras"] = Json::object();
  primitive["extras"]["lightmap"] = part.page;
  if (turned) primitive["extras"]["lightmapSide"] = "back";
  if (part.dark) primitive["extras"]["lightmapEmits"] = false;
  return primitive;
}

Result<Json> LitMeshBuilder::build(const Json& mesh, const std::map<std::uint32_t, LitPrimitive>& lit, bool again) {
  Json out = Json::object(), primitives = Json::array();
  for (const auto& [member, value] : mesh.items()) {
    if (member == "primitives") primitives = value;
    if (member != "primitives" && !(again && member == "extras")) out[member] = value;
  }
  if (again) {
    for (auto& primitive : primitives) primitive.erase("extras");
    if (!takeJson(textBytes(out) + textBytes(primitives))) return tooMuchJson();
  }
  out["primitives"] = Json::array();
  for (std::size_t p = 0; p < primitives.size(); ++p) {
    const auto& source = primitives[p];
    const auto found = lit.find(static_cast<std::uint32_t>(p));
    if (found == lit.end()) {
      out["primitives"].push_back(source);
      continue;
    }
    const auto& use = found->second;
    RAD_CHECK_EQ(use.uv->side[0].page.size() * 3, use.primitive->indices.size());
    RAD_CHECK_EQ(use.uv->side[0].page.size(), use.uv->side[0].corners.size());
    const auto parts = partsOf(use);
    if (parts.empty()) out["primitives"].push_back(source);
    if (parts.size() > 1 && !takeJson((parts.size() - 1) * textBytes(source))) return tooMuchJson();
    for (const auto& part : parts) {
      auto primitive = partPrimitive(source, use, part);
      if (!primitive) return primitive;
      out["primitives"].push_back(std::move(*primitive));
    }
  }
  return out;
}

}  // namespace radiosity::scene
