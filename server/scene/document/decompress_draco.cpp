#include "server/scene/document/decompress_draco.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <limits>
#include <utility>

namespace radiosity::scene {
namespace {

constexpr int kUnsignedByte = 5121, kUnsignedShort = 5123, kUnsignedInt = 5125;
constexpr int kTriangles = 4, kStrip = 5;
constexpr int kArrayBuffer = 34962, kElementArrayBuffer = 34963;
constexpr std::size_t kVertexAlignment = 4;  ///< of vertex data

/// 0: a matrix, which no attribute of ours is.
std::size_t componentsOf(const Json& accessor) {
  constexpr std::array kTypes = {"SCALAR", "VEC2", "VEC3", "VEC4"};
  const auto found = std::ranges::find(kTypes, accessor["type"].get_ref<const std::string&>());
  return found == kTypes.end() ? 0 : static_cast<std::size_t>(found - kTypes.begin()) + 1;
}

template <typename T>
double loadAs(const std::uint8_t* from) {
  T value;
  std::memcpy(&value, from, sizeof value);
  return static_cast<double>(value);
}

double load(const std::uint8_t* from, int component_type) {
  switch (component_type) {
    case 5120:
      return loadAs<std::int8_t>(from);
    case kUnsignedByte:
      return loadAs<std::uint8_t>(from);
    case 5122:
      return loadAs<std::int16_t>(from);
    case kUnsignedShort:
      return loadAs<std::uint16_t>(from);
    case kUnsignedInt:
      return loadAs<std::uint32_t>(from);
    default:
      return loadAs<float>(from);
  }
}

/// Draco rounds, so the bounds that the file states are those of other numbers.
void setBounds(Json& accessor, const Bytes& values) {
  if (!accessor.contains("min") && !accessor.contains("max")) return;
  const auto type = accessor["componentType"].get<int>();
  const auto components = componentsOf(accessor), size = componentBytes(type);
  std::vector<double> low(components, std::numeric_limits<double>::max());
  std::vector<double> high(components, std::numeric_limits<double>::lowest());
  for (std::size_t i = 0; i < values.size() / size; ++i) {
    const auto value = load(values.data() + i * size, type);
    low[i % components] = std::min(low[i % components], value);
    high[i % components] = std::max(high[i % components], value);
  }
  accessor["min"] = low;
  accessor["max"] = high;
}

Bytes padded(const Bytes& values, std::size_t element, std::size_t stride) {
  if (element == stride) return values;
  Bytes out(values.size() / element * stride, 0);
  for (std::size_t i = 0; i < values.size() / element; ++i)
    std::memcpy(out.data() + i * stride, values.data() + i * element, element);
  return out;
}

std::size_t strideOf(const Json& accessor) {
  const auto element = componentsOf(accessor) * componentBytes(accessor["componentType"].get<int>());
  return (element + kVertexAlignment - 1) / kVertexAlignment * kVertexAlignment;
}

void erase(Json& primitive, const char* extension) {
  primitive["extensions"].erase(extension);
  if (primitive["extensions"].empty()) primitive.erase("extensions");
}

}  // namespace

std::vector<DracoPrimitives::Wanted> DracoPrimitives::wantedBy(const Json& primitive, const Json& extension) const {
  std::vector<Wanted> wanted;
  for (const auto& [name, id] : extension["attributes"].items()) {
    const auto accessor = primitive["attributes"].find(name);
    if (accessor != primitive["attributes"].end())
      wanted.push_back({name, id.get<std::int64_t>(), accessor->get<std::size_t>()});
  }
  const bool is_list = primitive.value("mode", kTriangles) == kTriangles && primitive.contains("indices");
  wanted.push_back({"", kIndices, is_list ? primitive["indices"].get<std::size_t>() : kNone});
  return wanted;
}

/// The extension may be left aside where the file has all of it in plain form as well.
bool DracoPrimitives::isPlain(const std::vector<Wanted>& wanted) const {
  return std::ranges::all_of(wanted, [&](const Wanted& one) {
    if (one.accessor == kNone || filled_.contains(one.accessor)) return false;
    return document_.gltf["accessors"][one.accessor].contains("bufferView");
  });
}

Result<DracoRequest> DracoPrimitives::requestFor(const std::vector<Wanted>& wanted, const std::string& pointer) const {
  DracoRequest request;
  request.where = at(pointer + "/extensions/" + kName);
  const auto bad = [&](std::string what, const std::string& where) {
    return fail(ErrorCode::kInvalidScene, std::move(what), at(where));
  };
  for (const auto& one : wanted) {
    if (one.accessor == kNone) continue;
    const auto& accessor = document_.gltf["accessors"][one.accessor];
    const auto count = accessor["count"].get<std::size_t>();
    const auto where = "/accessors/" + std::to_string(one.accessor);
    const auto type = accessor["componentType"].get<int>();
    if (one.id == kIndices) {
      const bool integer = type == kUnsignedByte || type == kUnsignedShort || type == kUnsignedInt;
      if (!integer || accessor["type"] != "SCALAR")
        return bad("accessor must be SCALAR of an unsigned integer type", pointer + "/indices");
      if (count % 3 != 0) return bad("of triangles' indices must be a multiple of 3", where + "/count");
      request.faces = count / 3;
      continue;
    }
    if (componentsOf(accessor) == 0) return bad("no vertex attribute is a matrix", where + "/type");
    if (type == 5124) return bad("is not a component type of glTF: 5124", where + "/componentType");
    if (!request.attributes.empty() && count != request.points)
      return bad("attributes of one Draco stream differ in count", where + "/count");
    request.points = count;
    request.attributes.push_back({static_cast<std::uint32_t>(one.id), type, componentsOf(accessor), at(where)});
  }
  if (request.attributes.empty()) return bad("names no attribute of the primitive", pointer + "/extensions/" + kName);
  return request;
}

Result<std::span<const std::uint8_t>> DracoPrimitives::streamOf(std::size_t index, const std::string& where) const {
  const auto& view = document_.gltf["bufferViews"][index];
  // One that meshopt has decoded lies elsewhere by now; a file compressed twice is no file that anybody writes.
  if (out_.holds(view)) return fail(ErrorCode::kUnsupported, "is compressed by meshopt as well", where);
  const auto& buffer = *document_.buffers[view["buffer"].get<std::size_t>()];
  const auto offset = view.value("byteOffset", std::size_t{0}), length = view["byteLength"].get<std::size_t>();
  if (offset > buffer.size() || length > buffer.size() - offset)
    return fail(ErrorCode::kInvalidScene, "buffer view ends past its buffer", where);
  return std::span(buffer).subspan(offset, length);
}

Json& DracoPrimitives::fill(const Key& key, Bytes bytes, Json view) {
  auto& accessors = document_.gltf["accessors"];
  auto target = std::get<2>(key);
  if (target == kNone) {
    target = accessors.size();
    accessors.push_back(Json::object());
  } else if (filled_.contains(target) || accessors[target].contains("bufferView")) {
    accessors.push_back(Json(accessors[target]));
    target = accessors.size() - 1;
  }
  auto& views = document_.gltf["bufferViews"];
  out_.put(std::move(bytes), view);
  accessors[target]["bufferView"] = views.size();
  accessors[target].erase("byteOffset");
  views.push_back(std::move(view));
  readers_.push_back(target);
  filled_.insert(target);
  done_[key] = target;
  return accessors[target];
}

void DracoPrimitives::addAttribute(const Key& key, const Bytes& values) {
  const auto& declared = document_.gltf["accessors"][std::get<2>(key)];
  const auto element = componentsOf(declared) * componentBytes(declared["componentType"].get<int>());
  const auto stride = strideOf(declared);
  auto& accessor = fill(key, padded(values, element, stride), {{"byteStride", stride}, {"target", kArrayBuffer}});
  setBounds(accessor, values);
}

Result<void> DracoPrimitives::addIndices(const Key& key, const DracoMesh& mesh, std::size_t points) {
  const auto declared = std::get<2>(key);
  const auto type =
      declared == kNone ? kUnsignedInt : document_.gltf["accessors"][declared]["componentType"].get<int>();
  const auto size = componentBytes(type);
  if (size < 4 && points > std::size_t{1} << (8 * size)) {
    return fail(ErrorCode::kInvalidScene, "is too narrow for indices of " + std::to_string(points) + " vertices",
                at("/accessors/" + std::to_string(declared) + "/componentType"));
  }
  Bytes bytes(mesh.corners.size() * size);
  for (std::size_t i = 0; i < mesh.corners.size(); ++i)
    for (std::size_t b = 0; b < size; ++b) bytes[i * size + b] = static_cast<std::uint8_t>(mesh.corners[i] >> (8 * b));
  auto& accessor = fill(key, std::move(bytes), {{"target", kElementArrayBuffer}});
  accessor["componentType"] = type;
  accessor["count"] = mesh.corners.size();
  accessor["type"] = "SCALAR";
  for (const auto* bound : {"min", "max"}) accessor.erase(bound);
  return {};
}

Result<void> DracoPrimitives::decodeInto(std::size_t view, const std::vector<Wanted>& wanted,
                                         const std::string& pointer) {
  auto request = requestFor(wanted, pointer);
  if (!request) return tl::unexpected(request.error());
  const auto stream = streamOf(view, request->where + "/bufferView");
  if (!stream) return tl::unexpected(stream.error());
  std::uint64_t bytes = std::uint64_t{12} * request->faces.value_or(0);
  for (const auto& one : wanted)
    if (one.id != kIndices) bytes += request->points * strideOf(document_.gltf["accessors"][one.accessor]);
  if (auto ok = out_.claim(bytes, dracoWorkingBytes(request->faces.value_or(0)), request->where); !ok) return ok;
  request->room = out_.room();
  request->attribute_room = attribute_room_;
  const auto mesh = decodeDraco(*stream, *request);
  if (!mesh) return tl::unexpected(mesh.error());
  attribute_room_ -= mesh->attribute_bytes;
  if (!request->faces) {  // known only now
    if (auto ok = out_.claim(4 * mesh->corners.size(), 0, request->where); !ok) return ok;
  }
  for (std::size_t i = 0; i < request->attributes.size(); ++i)
    addAttribute({view, wanted[i].id, wanted[i].accessor}, mesh->attributes[i]);
  views_.insert(view);
  return addIndices({view, kIndices, wanted.back().accessor}, *mesh, request->points);
}

Result<void> DracoPrimitives::decode(Json& primitive, const std::string& pointer) {
  const auto* extension = extensionOf(primitive, kName);
  if (extension == nullptr) return {};
  const auto mode = primitive.value("mode", kTriangles);
  if (mode != kTriangles && mode != kStrip) {
    return fail(ErrorCode::kInvalidScene, "must be 4 or 5 with Draco, which knows only triangles",
                at(pointer + "/mode"));
  }
  const auto wanted = wantedBy(primitive, *extension);
  if (!isPlain(wanted)) {
    const auto view = (*extension)["bufferView"].get<std::size_t>();
    const bool all_done = std::ranges::all_of(wanted, [&](const Wanted& one) {
      return done_.contains({view, one.id, one.accessor});
    });
    if (!all_done)
      if (auto ok = decodeInto(view, wanted, pointer); !ok) return ok;
    for (const auto& one : wanted) {
      const auto accessor = done_.at({view, one.id, one.accessor});
      (one.id == kIndices ? primitive["indices"] : primitive["attributes"][one.name]) = accessor;
    }
    primitive["mode"] = kTriangles;
  }
  erase(primitive, kName);
  return {};
}

void DracoPrimitives::reuse(std::size_t view) {
  if (readers_.empty()) return;
  auto& views = document_.gltf["bufferViews"];
  views[view] = std::move(views.back());
  views.erase(views.size() - 1);
  document_.gltf["accessors"][readers_.back()]["bufferView"] = view;
  readers_.pop_back();
}

}  // namespace radiosity::scene
