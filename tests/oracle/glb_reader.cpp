// A GLB reader of the oracle's own, so that a mistake in the server's importer cannot hide in both.
#include <stb_image.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>
#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>
#include <glm/vec4.hpp>
#include <iterator>
#include <nlohmann/json.hpp>
#include <numbers>
#include <stdexcept>

#include "tests/oracle/triangle_scene.h"

namespace radiosity::oracle {
namespace {

using nlohmann::json;

constexpr double kMostReflectance = 0.999;

struct MaterialValues {
  glm::dvec3 reflectance{0.0}, emission_lux{0.0};
  bool double_sided = false;
  bool see_through = false;
  double alpha = 1.0, cutoff = -1.0, transmission = 0.0;
  int texture = -1, texcoord = 0;
  glm::dmat3 texture_transform{1.0};
};

glm::dvec3 vector3(const json& array) {
  return {array.at(0).get<double>(), array.at(1).get<double>(), array.at(2).get<double>()};
}

std::size_t componentSize(int type) {
  switch (type) {
    case 5120:
    case 5121:
      return 1;
    case 5122:
    case 5123:
      return 2;
    case 5125:
    case 5126:
      return 4;
    default:
      throw std::runtime_error("unknown componentType " + std::to_string(type));
  }
}

class Reader {
 public:
  explicit Reader(const std::filesystem::path& file) {
    std::ifstream in(file, std::ios::binary);
    if (!in) throw std::runtime_error("cannot read " + file.string());
    const std::vector<char> bytes{std::istreambuf_iterator<char>(in), {}};
    if (bytes.size() < 20 || std::memcmp(bytes.data(), "glTF", 4) != 0) throw std::runtime_error("not a GLB file");
    const auto json_length = word(bytes, 12);
    if (json_length > bytes.size() - 20) throw std::runtime_error("JSON chunk passes the end of the file");
    const auto bin_at = 20 + static_cast<std::size_t>(json_length);
    gltf_ = json::parse(bytes.begin() + 20, bytes.begin() + static_cast<std::ptrdiff_t>(bin_at));
    if (bin_at + 8 <= bytes.size()) bin_.assign(bytes.begin() + static_cast<std::ptrdiff_t>(bin_at) + 8, bytes.end());
    for (const auto& extension : member("extensionsRequired")) {
      if (extension != "KHR_lights_punctual" && extension != "KHR_texture_transform") {
        throw std::runtime_error("requires the extension " + extension.dump());
      }
    }
  }

  TriangleScene read() {
    for (const auto& image : member("images")) readImage(image);
    for (const auto& material : member("materials")) materials_.push_back(readMaterial(material));
    readSky();
    for (const auto& node : member("nodes")) scene_.node_names.push_back(node.value("name", ""));
    const auto& scenes = member("scenes");
    const auto chosen = gltf_.value("scene", std::size_t{0});
    for (const auto& root : scenes.at(chosen).value("nodes", json::array())) {
      readNode(root.get<std::uint32_t>(), glm::dmat4(1.0), 0);
    }
    return std::move(scene_);
  }

 private:
  static std::uint32_t word(const std::vector<char>& bytes, std::size_t at) {
    std::uint32_t value = 0;
    std::memcpy(&value, bytes.data() + at, 4);
    return value;
  }

  const json& member(const char* name) const {
    static const json kEmpty = json::array();
    const auto found = gltf_.find(name);
    return found == gltf_.end() ? kEmpty : *found;
  }

  void warn(const std::string& text) {
    if (std::find(scene_.warnings.begin(), scene_.warnings.end(), text) == scene_.warnings.end()) {
      scene_.warnings.push_back(text);
    }
  }

  MaterialValues readMaterial(const json& material) {
    MaterialValues values;
    const auto pbr = material.value("pbrMetallicRoughness", json::object());
    const double metallic = pbr.value("metallicFactor", 1.0) * meanMetallic(pbr);
    values.reflectance = pbr.contains("baseColorFactor") ? vector3(pbr["baseColorFactor"]) : glm::dvec3(1.0);
    values.reflectance = glm::min(values.reflectance * (1.0 - metallic), glm::dvec3(kMostReflectance));
    if (material.contains("emissiveFactor")) {
      double strength = 1.0;
      const auto extensions = material.value("extensions", json::object());
      if (extensions.contains("KHR_materials_emissive_strength")) {
        strength = extensions["KHR_materials_emissive_strength"].value("emissiveStrength", 1.0);
      }
      values.emission_lux = std::numbers::pi * strength * vector3(material["emissiveFactor"]);
    }
    values.double_sided = material.value("doubleSided", false);
    if (pbr.contains("baseColorTexture")) readTextureUse(pbr["baseColorTexture"], values);
    if (material.contains("emissiveTexture")) warn("emissive textures are not modelled");
    readOpacity(material, pbr, values);
    return values;
  }

  /// Of the whole texture: 1 where there is none.
  double meanMetallic(const json& pbr) {
    if (!pbr.contains("metallicRoughnessTexture")) return 1.0;
    const auto& use = pbr["metallicRoughnessTexture"];
    const auto& texture = member("textures").at(use.at("index").get<std::size_t>());
    if (!texture.contains("source")) return 1.0;
    const auto& pixels = scene_.textures.at(texture["source"].get<std::size_t>()).rgba;
    double sum = 0.0;
    for (std::size_t i = 2; i < pixels.size(); i += 4) sum += pixels[i] / 255.0;
    return sum / (static_cast<double>(pixels.size()) / 4.0);
  }

  void readTextureUse(const json& use, MaterialValues& values) {
    const auto& texture = member("textures").at(use.at("index").get<std::size_t>());
    values.texture = texture.value("source", -1);
    values.texcoord = use.value("texCoord", 0);
    const auto extensions = use.value("extensions", json::object());
    if (!extensions.contains("KHR_texture_transform")) return;
    const auto& transform = extensions["KHR_texture_transform"];
    values.texcoord = transform.value("texCoord", values.texcoord);
    values.texture_transform = textureMatrix(transform);
  }

  /// Translation times rotation times scale; counter-clockwise as one sees it, v being down.
  static glm::dmat3 textureMatrix(const json& transform) {
    const auto pair = [&](const char* name, double without) {
      const auto found = transform.value(name, std::vector<double>{without, without});
      return glm::dvec2(found.at(0), found.at(1));
    };
    const glm::dvec2 offset = pair("offset", 0.0), scale = pair("scale", 1.0);
    const double angle = transform.value("rotation", 0.0), c = std::cos(angle), s = std::sin(angle);
    const glm::dmat3 translation(1, 0, 0, 0, 1, 0, offset.x, offset.y, 1);
    const glm::dmat3 rotation(c, -s, 0, s, c, 0, 0, 0, 1);
    return translation * rotation * glm::dmat3(scale.x, 0, 0, 0, scale.y, 0, 0, 0, 1);
  }

  static void readOpacity(const json& material, const json& pbr, MaterialValues& values) {
    const auto mode = material.value("alphaMode", std::string("OPAQUE"));
    if (mode != "OPAQUE" && pbr.contains("baseColorFactor")) values.alpha = pbr["baseColorFactor"].at(3).get<double>();
    if (mode == "MASK") values.cutoff = material.value("alphaCutoff", 0.5);
    const auto extensions = material.value("extensions", json::object());
    if (extensions.contains("KHR_materials_transmission")) {
      values.transmission = extensions["KHR_materials_transmission"].value("transmissionFactor", 0.0);
    }
    values.see_through = mode != "OPAQUE" || values.transmission > 0.0;
    // An opaque surface ignores the texture's alpha: only its transmission counts.
    if (mode == "OPAQUE" && values.see_through) values.cutoff = 0.0;
  }

  void readImage(const json& image) {
    Texture texture;
    if (image.contains("bufferView")) {
      const auto& view = member("bufferViews").at(image["bufferView"].get<std::size_t>());
      const auto start = view.value("byteOffset", std::size_t{0});
      const auto length = view.at("byteLength").get<std::size_t>();
      if (start + length > bin_.size()) throw std::runtime_error("image passes the end of its buffer");
      int channels = 0;
      auto* pixels = stbi_load_from_memory(reinterpret_cast<const stbi_uc*>(bin_.data() + start),
                                           static_cast<int>(length), &texture.width, &texture.height, &channels, 4);
      if (pixels == nullptr) throw std::runtime_error("an image cannot be decoded");
      texture.rgba.assign(pixels, pixels + std::size_t{4} * static_cast<std::size_t>(texture.width) *
                                               static_cast<std::size_t>(texture.height));
      stbi_image_free(pixels);
    } else {
      warn("images outside the GLB are taken as white");
      texture = {1, 1, {255, 255, 255, 255}};
    }
    scene_.textures.push_back(std::move(texture));
  }

  void readSky() {
    const auto extras = gltf_.value("extras", json::object());
    if (!extras.is_object() || !extras.contains("radiositySky")) return;
    const auto& sky = extras["radiositySky"];
    if (sky.is_null()) return;
    scene_.has_sky = true;
    scene_.sky_upper = vector3(sky.at("upper"));
    scene_.sky_lower = sky.contains("lower") ? vector3(sky["lower"]) : scene_.sky_upper;
  }

  void readLight(const json& light, const glm::dmat4& world) {
    Lamp lamp;
    const auto type = light.at("type").get<std::string>();
    lamp.kind = type == "point" ? Lamp::Kind::kPoint : type == "spot" ? Lamp::Kind::kSpot : Lamp::Kind::kSun;
    lamp.position = glm::dvec3(world[3]);
    lamp.direction = glm::normalize(-glm::dvec3(world[2]));
    const auto color = light.contains("color") ? vector3(light["color"]) : glm::dvec3(1.0);
    lamp.intensity = color * light.value("intensity", 1.0);
    lamp.range = light.value("range", 0.0);
    if (light.contains("spot")) {
      lamp.inner_rad = light["spot"].value("innerConeAngle", 0.0);
      lamp.outer_rad = light["spot"].value("outerConeAngle", std::numbers::pi / 4);
    }
    scene_.lamps.push_back(lamp);
  }

  static glm::dmat4 localMatrix(const json& node) {
    glm::dmat4 m(1.0);
    if (node.contains("matrix")) {
      for (int i = 0; i < 16; ++i) m[i / 4][i % 4] = node["matrix"].at(static_cast<std::size_t>(i)).get<double>();
      return m;
    }
    if (node.contains("rotation")) {
      const auto& r = node["rotation"];
      m = glm::mat4_cast(glm::normalize(
          glm::dquat(r.at(3).get<double>(), r.at(0).get<double>(), r.at(1).get<double>(), r.at(2).get<double>())));
    }
    if (node.contains("scale")) {
      const auto scale = vector3(node["scale"]);
      for (int axis = 0; axis < 3; ++axis) m[axis] *= scale[axis];
    }
    if (node.contains("translation")) m[3] = glm::dvec4(vector3(node["translation"]), 1.0);
    return m;
  }

  void readNode(std::uint32_t index, const glm::dmat4& parent, int depth) {
    if (depth > 100) throw std::runtime_error("nodes nested too deeply");
    const auto& node = member("nodes").at(index);
    const auto world = parent * localMatrix(node);
    if (node.contains("mesh")) {
      const auto& mesh = member("meshes").at(node["mesh"].get<std::size_t>());
      for (const auto& primitive : mesh.at("primitives")) readPrimitive(primitive, world, index);
    }
    const auto extensions = node.value("extensions", json::object());
    if (extensions.contains("KHR_lights_punctual")) {
      const auto& lights = gltf_.at("extensions").at("KHR_lights_punctual").at("lights");
      readLight(lights.at(extensions["KHR_lights_punctual"].at("light").get<std::size_t>()), world);
    }
    for (const auto& child : node.value("children", json::array())) {
      readNode(child.get<std::uint32_t>(), world, depth + 1);
    }
  }

  /// Calls visit(element, component, value) for every number of an accessor; integers unnormalised.
  template <typename Visit>
  void visitAccessor(std::size_t index, std::size_t components, Visit visit) const {
    const auto& accessor = member("accessors").at(index);
    if (accessor.contains("sparse")) throw std::runtime_error("sparse accessors are not read");
    const auto& view = member("bufferViews").at(accessor.at("bufferView").get<std::size_t>());
    const int type = accessor.at("componentType").get<int>();
    const auto size = componentSize(type);
    const auto count = accessor.at("count").get<std::size_t>();
    const auto stride = view.value("byteStride", size * components);
    const auto start = view.value("byteOffset", std::size_t{0}) + accessor.value("byteOffset", std::size_t{0});
    if (count > 0 && start + (count - 1) * stride + size * components > bin_.size()) {
      throw std::runtime_error("accessor passes the end of its buffer");
    }
    for (std::size_t i = 0; i < count; ++i) {
      for (std::size_t c = 0; c < components; ++c) {
        visit(i, c, number(start + i * stride + c * size, type));
      }
    }
  }

  double number(std::size_t at, int type) const {
    const auto load = [&](auto value) {
      std::memcpy(&value, bin_.data() + at, sizeof value);
      return static_cast<double>(value);
    };
    switch (type) {
      case 5121:
        return load(std::uint8_t{});
      case 5123:
        return load(std::uint16_t{});
      case 5125:
        return load(std::uint32_t{});
      case 5126:
        return load(float{});
      default:
        throw std::runtime_error("componentType " + std::to_string(type) + " is not read");
    }
  }

  std::size_t count(std::size_t accessor) const { return member("accessors").at(accessor).at("count"); }

  void readPrimitive(const json& primitive, const glm::dmat4& world, std::uint32_t node) {
    if (primitive.value("mode", 4) != 4) throw std::runtime_error("only triangle lists are read");
    const auto& attributes = primitive.at("attributes");
    const auto position_accessor = attributes.at("POSITION").get<std::size_t>();
    std::vector<glm::dvec3> positions(count(position_accessor));
    visitAccessor(position_accessor, 3, [&](auto i, auto c, double v) { positions[i][static_cast<int>(c)] = v; });
    for (auto& p : positions) p = glm::dvec3(world * glm::dvec4(p, 1.0));
    std::vector<glm::dvec2> uvs(positions.size());
    if (attributes.contains("TEXCOORD_1")) {
      const auto accessor = attributes["TEXCOORD_1"].get<std::size_t>();
      if (member("accessors").at(accessor).at("componentType") != 5126) warn("TEXCOORD_1 is not float");
      visitAccessor(accessor, 2, [&](auto i, auto c, double v) { uvs.at(i)[static_cast<int>(c)] = v; });
    }
    std::vector<glm::dvec2> texture_uvs(positions.size());
    MaterialValues material;
    if (primitive.contains("material")) material = materials_.at(primitive["material"].get<std::size_t>());
    if (const auto name = "TEXCOORD_" + std::to_string(material.texcoord); attributes.contains(name)) {
      const auto accessor = attributes[name].get<std::size_t>();
      if (member("accessors").at(accessor).at("componentType") != 5126) warn(name + " is not float");
      visitAccessor(accessor, 2, [&](auto i, auto c, double v) { texture_uvs.at(i)[static_cast<int>(c)] = v; });
    }
    for (auto& uv : texture_uvs) uv = glm::dvec2(material.texture_transform * glm::dvec3(uv, 1.0));
    std::vector<glm::dvec3> colours(positions.size(), glm::dvec3(1.0));
    if (attributes.contains("COLOR_0")) readColours(attributes["COLOR_0"].get<std::size_t>(), colours);
    std::vector<std::size_t> indices;
    if (primitive.contains("indices")) {
      const auto accessor = primitive["indices"].get<std::size_t>();
      visitAccessor(accessor, 1, [&](auto, auto, double v) { indices.push_back(static_cast<std::size_t>(v)); });
    } else {
      for (std::size_t i = 0; i < positions.size(); ++i) indices.push_back(i);
    }
    appendTriangles(primitive, {positions, uvs, texture_uvs, colours}, indices, glm::determinant(world) < 0.0, node);
  }

  /// Colours multiply reflectance; integers stand for [0, 1].
  void readColours(std::size_t accessor, std::vector<glm::dvec3>& colours) {
    const auto& description = member("accessors").at(accessor);
    const int type = description.at("componentType").get<int>();
    const double one = type == 5121 ? 255.0 : type == 5123 ? 65535.0 : 1.0;
    visitAccessor(accessor, description.at("type") == "VEC4" ? 4 : 3, [&](auto i, auto c, double v) {
      if (c < 3) colours.at(i)[static_cast<int>(c)] = v / one;
    });
  }

  /// Of the triangle whose first corner is indices[i].
  glm::dvec3 oneColour(const std::vector<glm::dvec3>& colours, const std::vector<std::size_t>& indices, std::size_t i) {
    const auto& colour = colours.at(indices[i]);
    if (colours.at(indices[i + 1]) != colour || colours.at(indices[i + 2]) != colour) {
      warn("vertex colours that vary over a triangle are not modelled");
    }
    return colour;
  }

  struct Corners {
    const std::vector<glm::dvec3>& positions;
    const std::vector<glm::dvec2>&lightmap_uvs, &texture_uvs;
    const std::vector<glm::dvec3>& colours;
  };

  void appendTriangles(const json& primitive, const Corners& corners, const std::vector<std::size_t>& indices,
                       bool flipped, std::uint32_t node) {
    Triangle triangle;
    triangle.node = node;
    MaterialValues values;
    values.reflectance = glm::dvec3(kMostReflectance);  // glTF's default is a perfect metal, ours is white (README)
    if (primitive.contains("material")) {
      triangle.material = primitive["material"].get<std::uint32_t>();
      values = materials_.at(triangle.material);
    }
    triangle.reflectance = values.reflectance;
    triangle.emission_lux = values.emission_lux;
    triangle.double_sided = values.double_sided;
    triangle.texture = values.texture;
    triangle.see_through = values.see_through;
    triangle.alpha = values.alpha;
    triangle.cutoff = values.cutoff;
    triangle.transmission = values.transmission;
    const auto extras = primitive.value("extras", json::object());
    if (extras.is_object()) triangle.lightmap_page = extras.value("lightmap", -1);
    for (std::size_t i = 0; i + 2 < indices.size(); i += 3) {
      for (std::size_t k = 0; k < 3; ++k) {
        const auto vertex = indices[i + (flipped ? 2 - k : k)];
        triangle.corners[k] = corners.positions.at(vertex);
        triangle.lightmap_uv[k] = corners.lightmap_uvs.at(vertex);
        triangle.texture_uv[k] = corners.texture_uvs.at(vertex);
      }
      const auto& [a, b, c] = triangle.corners;
      const auto normal = glm::cross(b - a, c - a);
      if (!(glm::length(normal) > 0.0)) continue;
      triangle.normal = glm::normalize(normal);
      triangle.reflectance =
          glm::min(values.reflectance * oneColour(corners.colours, indices, i), glm::dvec3(kMostReflectance));
      scene_.triangles.push_back(triangle);
    }
  }

  json gltf_;
  std::vector<char> bin_;
  std::vector<MaterialValues> materials_;
  TriangleScene scene_;
};

}  // namespace

TriangleScene readGlb(const std::filesystem::path& file) {
  try {
    return Reader(file).read();
  } catch (const std::exception& error) {
    throw std::runtime_error(file.filename().string() + ": " + error.what());
  }
}

}  // namespace radiosity::oracle
