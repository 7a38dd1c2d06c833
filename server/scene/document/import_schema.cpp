#include "server/scene/document/import_schema.h"

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <span>
#include <string_view>

#include "common/task.h"

namespace radiosity::scene {
namespace {

enum class Kind {
  kBool,
  kString,
  kStrings,
  kNumber,
  kNumbers,
  kUint,
  kIndex,
  kIndices,
  kIndexMap,
  kIndexMaps,
  kObject,
  kObjects
};

/// What an index points into.
enum class Ref {
  kAccessors,
  kAreaLights,
  kBufferViews,
  kBuffers,
  kCameras,
  kIesLights,
  kImages,
  kLights,
  kMaterials,
  kMeshes,
  kNodes,
  kSamplers,
  kScenes,
  kSkins,
  kTextures,
  kCount
};

constexpr std::array<const char*, static_cast<std::size_t>(Ref::kCount)> kRefPointers = {
    "/accessors",   "/extensions/EXT_lights_area/lights",
    "/bufferViews", "/buffers",
    "/cameras",     "/extensions/EXT_lights_ies/lights",
    "/images",      "/extensions/KHR_lights_punctual/lights",
    "/materials",   "/meshes",
    "/nodes",       "/samplers",
    "/scenes",      "/skins",
    "/textures"};

// Scene values are 32-bit floats: a double that does not fit would become infinite.
constexpr double kBig = std::numeric_limits<float>::max();
// Exporters that compute in float write 1.0000001; the importer clamps.
constexpr double kSlack = 1e-4;
// Of a morph target: what is far beyond any shape that one models.
constexpr double kMostWeight = 1e6;
// All integers must fit the `int` that tinygltf casts them to.
constexpr double kMaxInt = std::numeric_limits<std::int32_t>::max();

struct Member {
  const char* name = "";
  Kind kind = Kind::kString;
  std::span<const Member> child = {};
  Ref ref = Ref::kCount;
  std::size_t length = 0;  ///< of kNumbers; 0: any
  double min = -kBig;
  double max = kBig;
  bool required = false;
  std::span<const std::string_view> choices = {};  ///< of kString; empty: any
  bool may_dangle = false;                         ///< of kIndex: costs what refers to it, not the scene
};

constexpr Member req(Member m) {
  m.required = true;
  return m;
}
constexpr Member boolean(const char* name) { return {.name = name, .kind = Kind::kBool}; }
constexpr Member string(const char* name) { return {.name = name, .kind = Kind::kString}; }
constexpr Member oneOf(const char* name, std::span<const std::string_view> choices) {
  return {.name = name, .kind = Kind::kString, .choices = choices};
}
constexpr Member strings(const char* name) { return {.name = name, .kind = Kind::kStrings}; }
constexpr Member number(const char* name, double min = -kBig, double max = kBig) {
  return {.name = name, .kind = Kind::kNumber, .min = min, .max = max};
}
constexpr Member numbers(const char* name, std::size_t length, double min = -kBig, double max = kBig) {
  return {.name = name, .kind = Kind::kNumbers, .length = length, .min = min, .max = max};
}
constexpr Member uint(const char* name, double min = 0, double max = kMaxInt) {
  return {.name = name, .kind = Kind::kUint, .min = min, .max = max};
}
constexpr Member index(const char* name, Ref ref) { return {.name = name, .kind = Kind::kIndex, .ref = ref}; }
constexpr Member looseIndex(const char* name, Ref ref) {
  return {.name = name, .kind = Kind::kIndex, .ref = ref, .may_dangle = true};
}
constexpr Member indices(const char* name, Ref ref) { return {.name = name, .kind = Kind::kIndices, .ref = ref}; }
constexpr Member indexMap(const char* name, Ref ref) { return {.name = name, .kind = Kind::kIndexMap, .ref = ref}; }
constexpr Member indexMaps(const char* name, Ref ref) { return {.name = name, .kind = Kind::kIndexMaps, .ref = ref}; }
constexpr Member object(const char* name, std::span<const Member> child) {
  return {.name = name, .kind = Kind::kObject, .child = child};
}
constexpr Member objects(const char* name, std::span<const Member> child) {
  return {.name = name, .kind = Kind::kObjects, .child = child};
}

constexpr std::string_view kAccessorTypes[] = {"SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"};
constexpr std::string_view kAlphaModes[] = {"OPAQUE", "MASK", "BLEND"};
constexpr std::string_view kCameraTypes[] = {"perspective", "orthographic"};
constexpr std::string_view kLightTypes[] = {"point", "spot", "directional"};
constexpr std::string_view kAreaTypes[] = {"rect", "disk"};
constexpr std::string_view kPhotometricTypes[] = {"application/x-ies-lm-63", "application/x-eulumdat"};
// Metres: of the size of a lamp. One that is as large as a country is a mistake.
constexpr double kMostSize = 1e6;

constexpr Member kAsset[] = {req(string("version")), string("minVersion"), string("generator"), string("copyright")};
constexpr Member kFallback[] = {boolean("fallback")};
constexpr Member kBufferExtensions[] = {object("EXT_meshopt_compression", kFallback),
                                        object("KHR_meshopt_compression", kFallback)};
constexpr Member kBuffer[] = {string("name"), string("uri"), req(uint("byteLength", 1)),
                              object("extensions", kBufferExtensions)};
constexpr Member kMeshopt[] = {req(index("buffer", Ref::kBuffers)),
                               uint("byteOffset"),
                               req(uint("byteLength", 1)),
                               req(uint("byteStride", 1, 256)),
                               req(uint("count", 1)),
                               req(string("mode")),
                               string("filter")};
constexpr Member kBufferViewExtensions[] = {object("EXT_meshopt_compression", kMeshopt),
                                            object("KHR_meshopt_compression", kMeshopt)};
constexpr Member kBufferView[] = {string("name"),
                                  req(index("buffer", Ref::kBuffers)),
                                  uint("byteOffset"),
                                  req(uint("byteLength", 1)),
                                  uint("byteStride", 4, 252),
                                  uint("target"),
                                  object("extensions", kBufferViewExtensions)};
constexpr Member componentType() { return req(uint("componentType", 5120, 5126)); }
constexpr Member kSparseIndices[] = {req(index("bufferView", Ref::kBufferViews)), uint("byteOffset"), componentType()};
constexpr Member kSparseValues[] = {req(index("bufferView", Ref::kBufferViews)), uint("byteOffset")};
constexpr Member kSparse[] = {req(uint("count", 1)), req(object("indices", kSparseIndices)),
                              req(object("values", kSparseValues))};
constexpr Member kAccessor[] = {string("name"),
                                index("bufferView", Ref::kBufferViews),
                                uint("byteOffset"),
                                componentType(),
                                boolean("normalized"),
                                req(uint("count", 1)),
                                req(oneOf("type", kAccessorTypes)),
                                object("sparse", kSparse),
                                numbers("min", 0),
                                numbers("max", 0)};
constexpr Member kDraco[] = {req(index("bufferView", Ref::kBufferViews)), req(indexMap("attributes", Ref::kCount))};
constexpr Member kPrimitiveExtensions[] = {object("KHR_draco_mesh_compression", kDraco)};
constexpr Member kPrimitive[] = {
    req(indexMap("attributes", Ref::kAccessors)), index("indices", Ref::kAccessors),
    index("material", Ref::kMaterials),           uint("mode", 0, 6),
    indexMaps("targets", Ref::kAccessors),        object("extensions", kPrimitiveExtensions)};
constexpr Member kMesh[] = {string("name"), req(objects("primitives", kPrimitive)),
                            numbers("weights", 0, -kMostWeight, kMostWeight)};

constexpr Member kNodeLight[] = {req(index("light", Ref::kLights))};
constexpr Member kNodeAreaLight[] = {req(index("light", Ref::kAreaLights))};
constexpr Member kNodeIesLight[] = {req(index("light", Ref::kIesLights)), number("multiplier", 0),
                                    numbers("color", 3, 0)};
constexpr Member kNodeVisibility[] = {boolean("visible")};
constexpr Member kInstancing[] = {req(indexMap("attributes", Ref::kAccessors))};
constexpr Member kNodeExtensions[] = {
    object("KHR_lights_punctual", kNodeLight), object("EXT_lights_area", kNodeAreaLight),
    object("EXT_lights_ies", kNodeIesLight), object("KHR_node_visibility", kNodeVisibility),
    object("EXT_mesh_gpu_instancing", kInstancing)};
constexpr Member kNode[] = {string("name"),
                            index("camera", Ref::kCameras),
                            indices("children", Ref::kNodes),
                            index("skin", Ref::kSkins),
                            index("mesh", Ref::kMeshes),
                            numbers("matrix", 16),
                            numbers("rotation", 4),
                            numbers("scale", 3),
                            numbers("translation", 3),
                            numbers("weights", 0, -kMostWeight, kMostWeight),
                            object("extensions", kNodeExtensions)};

constexpr Member kTextureTransform[] = {numbers("offset", 2), number("rotation"), numbers("scale", 2),
                                        uint("texCoord")};
constexpr Member kTextureInfoExtensions[] = {object("KHR_texture_transform", kTextureTransform)};
constexpr Member kTextureInfo[] = {req(looseIndex("index", Ref::kTextures)), uint("texCoord"), number("scale"),
                                   number("strength"), object("extensions", kTextureInfoExtensions)};
constexpr Member kPbr[] = {numbers("baseColorFactor", 4, -kSlack, 1 + kSlack), object("baseColorTexture", kTextureInfo),
                           number("metallicFactor", -kSlack, 1 + kSlack), number("roughnessFactor"),
                           object("metallicRoughnessTexture", kTextureInfo)};
constexpr Member kEmissiveStrength[] = {number("emissiveStrength", 0)};
constexpr Member kTransmission[] = {number("transmissionFactor", -kSlack, 1 + kSlack),
                                    object("transmissionTexture", kTextureInfo)};
constexpr Member kIor[] = {number("ior")};
constexpr Member kVolume[] = {number("thicknessFactor"), object("thicknessTexture", kTextureInfo),
                              number("attenuationDistance"), numbers("attenuationColor", 3, -kSlack, 1 + kSlack)};
constexpr Member kDiffuseTransmission[] = {number("diffuseTransmissionFactor", -kSlack, 1 + kSlack),
                                           object("diffuseTransmissionTexture", kTextureInfo),
                                           numbers("diffuseTransmissionColorFactor", 3, -kSlack, 1 + kSlack),
                                           object("diffuseTransmissionColorTexture", kTextureInfo)};
constexpr Member kSpecularGlossiness[] = {
    numbers("diffuseFactor", 4, -kSlack, 1 + kSlack), object("diffuseTexture", kTextureInfo),
    numbers("specularFactor", 3, -kSlack, 1 + kSlack), number("glossinessFactor", -kSlack, 1 + kSlack),
    object("specularGlossinessTexture", kTextureInfo)};
constexpr Member kNoMembers[] = {string("name")};
constexpr Member kMaterialExtensions[] = {object("KHR_materials_emissive_strength", kEmissiveStrength),
                                          object("KHR_materials_ior", kIor),
                                          object("KHR_materials_transmission", kTransmission),
                                          object("KHR_materials_diffuse_transmission", kDiffuseTransmission),
                                          object("KHR_materials_volume", kVolume),
                                          object("KHR_materials_pbrSpecularGlossiness", kSpecularGlossiness),
                                          object("KHR_materials_unlit", kNoMembers)};
constexpr Member kMaterial[] = {string("name"),
                                object("pbrMetallicRoughness", kPbr),
                                object("normalTexture", kTextureInfo),
                                object("occlusionTexture", kTextureInfo),
                                object("emissiveTexture", kTextureInfo),
                                numbers("emissiveFactor", 3, 0),
                                oneOf("alphaMode", kAlphaModes),
                                number("alphaCutoff", 0),
                                boolean("doubleSided"),
                                object("extensions", kMaterialExtensions)};

constexpr Member kImage[] = {string("name"), string("uri"), string("mimeType"), index("bufferView", Ref::kBufferViews)};
constexpr Member kPicture[] = {index("source", Ref::kImages)};
constexpr Member kTextureExtensions[] = {object("EXT_texture_webp", kPicture), object("KHR_texture_basisu", kPicture)};
constexpr Member kTexture[] = {string("name"), looseIndex("sampler", Ref::kSamplers),
                               looseIndex("source", Ref::kImages), object("extensions", kTextureExtensions)};
constexpr Member kSampler[] = {string("name"), uint("magFilter"), uint("minFilter"), uint("wrapS"), uint("wrapT")};
constexpr Member kPerspective[] = {number("aspectRatio", 0), req(number("yfov", 0)), number("zfar", 0),
                                   req(number("znear", 0))};
constexpr Member kOrthographic[] = {req(number("xmag")), req(number("ymag")), req(number("zfar", 0)),
                                    req(number("znear", 0))};
constexpr Member kCamera[] = {string("name"), req(oneOf("type", kCameraTypes)), object("perspective", kPerspective),
                              object("orthographic", kOrthographic)};
constexpr Member kSkin[] = {string("name"), req(indices("joints", Ref::kNodes)), index("skeleton", Ref::kNodes),
                            index("inverseBindMatrices", Ref::kAccessors)};
constexpr Member kScene[] = {string("name"), indices("nodes", Ref::kNodes)};
constexpr Member kSpot[] = {number("innerConeAngle", 0), number("outerConeAngle", 0)};
constexpr Member kLight[] = {string("name"),         req(oneOf("type", kLightTypes)),
                             numbers("color", 3, 0), number("intensity", 0),
                             number("range", 0),     object("spot", kSpot)};
constexpr Member kLights[] = {objects("lights", kLight)};
constexpr Member kRectangle[] = {number("aspect", 0, kMostSize)};
constexpr Member kAreaLight[] = {string("name"),         req(oneOf("type", kAreaTypes)), numbers("color", 3, 0),
                                 number("intensity", 0), number("size", 0, kMostSize),   object("rect", kRectangle)};
constexpr Member kAreaLights[] = {objects("lights", kAreaLight)};
constexpr Member kIesLight[] = {string("name"), string("uri"), index("bufferView", Ref::kBufferViews),
                                oneOf("mimeType", kPhotometricTypes)};
constexpr Member kIesLights[] = {objects("lights", kIesLight)};
constexpr Member kRootExtensions[] = {object("KHR_lights_punctual", kLights), object("EXT_lights_area", kAreaLights),
                                      object("EXT_lights_ies", kIesLights)};
constexpr Member kRoot[] = {req(object("asset", kAsset)),
                            strings("extensionsUsed"),
                            strings("extensionsRequired"),
                            objects("accessors", kAccessor),
                            objects("buffers", kBuffer),
                            objects("bufferViews", kBufferView),
                            objects("cameras", kCamera),
                            objects("images", kImage),
                            objects("materials", kMaterial),
                            objects("meshes", kMesh),
                            objects("nodes", kNode),
                            objects("samplers", kSampler),
                            index("scene", Ref::kScenes),
                            objects("scenes", kScene),
                            objects("skins", kSkin),
                            objects("textures", kTexture),
                            object("extensions", kRootExtensions)};

class Checker {
 public:
  Checker(const Json& gltf, const std::string& name, std::vector<std::string>& warnings)
      : name_(name), warnings_(warnings) {
    for (std::size_t i = 0; i < kRefPointers.size(); ++i) sizes_[i] = arraySize(gltf, kRefPointers[i]);
  }

  Result<void> objectAt(const Json& value, std::span<const Member> members, const std::string& pointer) {
    if (!value.is_object()) return bad(pointer, "must be an object");
    for (const auto& member : members) {
      interruptionPoint();
      const auto found = value.find(member.name);
      if (found == value.end()) {
        if (member.required) return bad(pointer, std::string("'") + member.name + "' is missing");
        continue;
      }
      if (auto ok = memberAt(*found, member, pointer + "/" + member.name); !ok) return ok;
    }
    return {};
  }

 private:
  static std::size_t arraySize(const Json& gltf, std::string_view pointer) {
    const Json* at = &gltf;
    while (!pointer.empty()) {
      pointer.remove_prefix(1);
      const auto end = std::min(pointer.find('/'), pointer.size());
      if (!at->is_object()) return 0;
      const auto found = at->find(std::string(pointer.substr(0, end)));
      if (found == at->end()) return 0;
      at = &*found;
      pointer.remove_prefix(end);
    }
    return at->is_array() ? at->size() : 0;
  }

  [[nodiscard]] tl::unexpected<Error> bad(const std::string& pointer, std::string what) const {
    return fail(ErrorCode::kInvalidScene, std::move(what), place(name_, pointer.empty() ? "/" : pointer));
  }

  Result<void> memberAt(const Json& value, const Member& member, const std::string& pointer) {
    switch (member.kind) {
      case Kind::kBool:
        if (!value.is_boolean()) return bad(pointer, "must be true or false");
        return {};
      case Kind::kString:
        return stringAt(value, member, pointer);
      case Kind::kNumber:
        return numberAt(value, member, pointer);
      case Kind::kUint:
      case Kind::kIndex:
        return integerAt(value, member, pointer);
      case Kind::kObject:
        return objectAt(value, member.child, pointer);
      case Kind::kIndexMap:
        return indexMapAt(value, member, pointer);
      default:
        return arrayAt(value, member, pointer);
    }
  }

  Result<void> arrayAt(const Json& value, const Member& member, const std::string& pointer) {
    if (!value.is_array()) return bad(pointer, "must be an array");
    if (value.empty()) warnings_.push_back(place(name_, pointer) + ": empty array");
    if (member.length != 0 && value.size() != member.length) {
      return bad(pointer, "must have " + std::to_string(member.length) + " numbers");
    }
    for (std::size_t i = 0; i < value.size(); ++i) {
      interruptionPoint();
      if (auto ok = elementAt(value[i], member, pointer + "/" + std::to_string(i)); !ok) return ok;
    }
    return {};
  }

  Result<void> elementAt(const Json& value, const Member& member, const std::string& pointer) {
    switch (member.kind) {
      case Kind::kNumbers:
        return numberAt(value, member, pointer);
      case Kind::kIndices:
        return integerAt(value, member, pointer);
      case Kind::kIndexMaps:
        return indexMapAt(value, member, pointer);
      case Kind::kObjects:
        return objectAt(value, member.child, pointer);
      default:
        if (!value.is_string()) return bad(pointer, "must be a string");
        return {};
    }
  }

  Result<void> stringAt(const Json& value, const Member& member, const std::string& pointer) {
    if (!value.is_string()) return bad(pointer, "must be a string");
    if (member.choices.empty()) return {};
    std::string known;
    for (const auto choice : member.choices) {
      if (value.get_ref<const std::string&>() == choice) return {};
      known += (known.empty() ? "" : ", ") + std::string(choice);
    }
    return bad(pointer, "must be one of " + known);
  }

  Result<void> numberAt(const Json& value, const Member& member, const std::string& pointer) {
    if (!value.is_number()) return bad(pointer, "must be a number");
    const auto x = value.get<double>();
    if (!(x >= member.min && x <= member.max)) return bad(pointer, "is out of range: " + value.dump());
    return {};
  }

  Result<void> integerAt(const Json& value, const Member& member, const std::string& pointer) {
    if (member.may_dangle && value.is_number_integer()) return {};
    const bool negative = value.is_number_integer() && !value.is_number_unsigned() && value.get<std::int64_t>() < 0;
    if (!value.is_number_integer() || negative) return bad(pointer, "must be an integer of 0 or more");
    const auto x = value.get<std::uint64_t>();
    if (member.ref != Ref::kCount) {
      const auto size = sizes_[static_cast<std::size_t>(member.ref)];
      if (x < size) return {};
      return bad(pointer, "is " + std::to_string(x) + ", but " + kRefPointers[static_cast<std::size_t>(member.ref)] +
                              " has " + std::to_string(size) + " entries");
    }
    if (x < static_cast<std::uint64_t>(std::max(member.min, 0.0)) || x > static_cast<std::uint64_t>(kMaxInt) ||
        static_cast<double>(x) > member.max) {
      return bad(pointer, "is out of range: " + std::to_string(x));
    }
    return {};
  }

  Result<void> indexMapAt(const Json& value, const Member& member, const std::string& pointer) {
    if (!value.is_object()) return bad(pointer, "must be an object");
    for (const auto& [key, entry] : value.items()) {
      if (auto ok = integerAt(entry, member, pointer + "/" + escapeToken(key)); !ok) return ok;
    }
    return {};
  }

  const std::string& name_;
  std::vector<std::string>& warnings_;
  std::array<std::size_t, kRefPointers.size()> sizes_{};
};

/// A camera must have the object that its type names, and so must a spot light.
Result<void> checkTypeObjects(const Json& gltf, const std::string& name) {
  const auto check = [&](const Json& list, const std::string& pointer, bool spots_only) -> Result<void> {
    for (std::size_t i = 0; i < list.size(); ++i) {
      const auto& type = list[i]["type"].get_ref<const std::string&>();
      if ((spots_only && type != "spot") || list[i].contains(type)) continue;
      return fail(ErrorCode::kInvalidScene, "'" + type + "' is missing",
                  place(name, pointer + "/" + std::to_string(i)));
    }
    return {};
  };
  if (gltf.contains("cameras")) {
    if (auto ok = check(gltf["cameras"], "/cameras", false); !ok) return ok;
  }
  const auto lights = Json::json_pointer("/extensions/KHR_lights_punctual/lights");
  return gltf.contains(lights) ? check(gltf.at(lights), lights.to_string(), true) : Result<void>{};
}

/// glTF versions are "major.minor"; only 2.x is known, and minVersion may not ask for more than 2.0.
Result<void> checkVersion(const Json& asset, const std::string& name) {
  const auto version = asset["version"].get<std::string>();
  if (version != "2" && version.rfind("2.", 0) != 0) {
    return fail(ErrorCode::kUnsupported, "glTF version '" + version + "'; only 2.0 is read",
                place(name, "/asset/version"));
  }
  if (asset.contains("minVersion") && asset["minVersion"] != "2.0") {
    return fail(ErrorCode::kUnsupported, "glTF minVersion " + asset["minVersion"].dump() + "; only 2.0 is read",
                place(name, "/asset/minVersion"));
  }
  return {};
}

}  // namespace

Result<void> checkSchema(const Json& gltf, const std::string& name, std::vector<std::string>& warnings) {
  Checker checker(gltf, name, warnings);
  if (auto ok = checker.objectAt(gltf, kRoot, ""); !ok) return ok;
  if (auto ok = checkTypeObjects(gltf, name); !ok) return ok;
  return checkVersion(gltf["asset"], name);
}

Result<void> checkMaterials(const Json& gltf, const std::string& name, std::vector<std::string>& warnings) {
  static constexpr Member kAlone[] = {objects("materials", kMaterial)};
  return Checker(gltf, name, warnings).objectAt(gltf, kAlone, "");
}

}  // namespace radiosity::scene
