#include "server/scene/import/import_environment.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <span>
#include <utility>

#include "common/task.h"
#include "server/scene/document/image_decode.h"
#include "server/scene/import/cube_map.h"
#include "server/scene/import/sky_file.h"

namespace radiosity::scene {
namespace {

constexpr const char *kImageBased = "EXT_lights_image_based", *kMaps = "KHR_environment_map";
constexpr double kPi = std::numbers::pi, kMostIntensity = 1e9;
constexpr std::size_t kCoefficients = 9;
/// Pixels of a face's picture at most.
constexpr std::size_t kMostFacePixels = kMostCubeEdge * kMostCubeEdge;
/// What irradiance has of radiance, by coefficient (Ramamoorthi and Hanrahan 2001). Both extensions say that theirs are
/// of irradiance.
constexpr std::array<double, kCoefficients> kSpread{kPi,     2.0 * kPi / 3, 2.0 * kPi / 3, 2.0 * kPi / 3, kPi / 4,
                                                    kPi / 4, kPi / 4,       kPi / 4,       kPi / 4};
/// Of what is made of irradiance, which has no details.
constexpr std::size_t kCoarseWidth = 64, kCoarseHeight = 32;

const Json* member(const Json& object, const char* name) {
  if (!object.is_object()) return nullptr;
  const auto found = object.find(name);
  return found == object.end() ? nullptr : &*found;
}

std::optional<std::size_t> indexOf(const Json* value) {
  if (value == nullptr || !value->is_number_integer() || *value < 0) return std::nullopt;
  return value->get<std::size_t>();
}

class EnvironmentReader {
 public:
  EnvironmentReader(ImportContext& context, std::string pointer)
      : context_(context),
        pointer_(std::move(pointer)),
        json_(context.document.gltf.at(Json::json_pointer(pointer_))),
        is_map_(pointer_.find(kMaps) != std::string::npos) {}

  Result<SkyImage> read() {
    if (!json_.is_object()) return context_.bad(pointer_, "must be an object");
    const auto strength = number(json_, "intensity", 0.0, kMostIntensity, 1.0);
    if (!strength) return tl::unexpected(strength.error());
    strength_ = static_cast<float>(*strength);
    const auto turn = rotation();
    if (!turn) return tl::unexpected(turn.error());
    auto image = readAs(*turn);
    if (!image) return image;
    for (auto& texel : image->texels) texel *= strength_;
    for (std::size_t y = 0; y < image->height; ++y)
      if (auto fault = skyRowFault(std::span(image->texels).subspan(y * image->width, image->width), y); !fault.empty())
        return context_.bad(pointer_, fault);
    return image;
  }

 private:
  Result<SkyImage> readAs(const glm::dquat& turn) {
    auto cube = is_map_ ? cubeOfMap() : cubeOfImages();
    if (cube) return imageOfCube(*cube, turn);
    const bool is_unread = cube.error().code == ErrorCode::kUnsupported;
    if (!is_unread || member(json_, "irradianceCoefficients") == nullptr) return tl::unexpected(cube.error());
    context_.warn(pointer_, "its irradiance is used, without its picture: " + cube.error().message);
    return imageOfIrradiance(turn);
  }

  [[nodiscard]] Result<double> number(const Json& object, const char* name, double least, double most,
                                      double otherwise) const {
    const auto* value = member(object, name);
    if (value == nullptr) return otherwise;
    if (value->is_number() && value->get<double>() >= least && value->get<double>() <= most)
      return value->get<double>();
    return context_.bad(pointer_ + "/" + name, "must be a number that is not negative, and at most 1e9");
  }

  [[nodiscard]] Result<glm::dquat> rotation() const {
    const auto* value = member(json_, "rotation");
    if (value == nullptr) return glm::dquat(1.0, 0.0, 0.0, 0.0);
    std::array<double, 4> q{};
    bool good = value->is_array() && value->size() == 4;
    for (std::size_t i = 0; good && i < 4; ++i) {
      good = (*value)[i].is_number() && std::abs((*value)[i].get<double>()) <= 2.0;
      if (good) q[i] = (*value)[i].get<double>();
    }
    const glm::dquat turn(q[3], q[0], q[1], q[2]);
    if (good && glm::length(turn) > 0.1) return glm::normalize(turn);
    return context_.bad(pointer_ + "/rotation", "must be a quaternion");
  }

  [[nodiscard]] Result<SharedBytes> imageBytes(const Json& index, const std::string& pointer) const {
    const auto image = indexOf(&index);
    if (!image || *image >= context_.document.images.size()) return context_.bad(pointer, "is no image");
    return context_.document.images[*image];
  }

  /// The first mip level: that of no roughness.
  [[nodiscard]] Result<CubeMap> cubeOfImages() const {
    const auto pointer = pointer_ + "/specularImages/0";
    const auto* levels = member(json_, "specularImages");
    if (levels == nullptr || !levels->is_array() || levels->empty() || !(*levels)[0].is_array() ||
        (*levels)[0].size() != 6)
      return context_.bad(pointer, "must be six images");
    CubeMap cube;
    std::size_t edge_of_all = 0;
    for (std::size_t f = 0; f < 6; ++f) {
      interruptionPoint();
      const auto at = pointer + "/" + std::to_string(f);
      const auto bytes = imageBytes((*levels)[0][f], at);
      if (!bytes) return tl::unexpected(bytes.error());
      const auto texture = decodeImage(**bytes, kMostFacePixels, place(context_.document.name, at));
      if (!texture) return tl::unexpected(texture.error());
      const auto edge = static_cast<std::size_t>(texture->width);
      if (texture->width != texture->height || (f > 0 && edge != edge_of_all))
        return context_.bad(at, "must be square, and as large as the other faces");
      edge_of_all = edge;
      cube.faces[f] = faceOf(*texture, cube.size);
    }
    return cube;
  }

  /// Faces are saved mirrored from left to right, and encoded for screens: as sRGB, or, where they have an alpha, with
  /// an exponent of 2.2, and multiplied by it (RGBD, as Babylon.js writes and reads it).
  static std::vector<glm::vec3> faceOf(const Texture& texture, std::size_t& size) {
    const auto edge = static_cast<std::size_t>(texture.width);
    bool is_divided = false;
    for (std::size_t i = 3; i < texture.rgba.size(); i += 4) is_divided = is_divided || texture.rgba[i] < 255;
    std::array<float, 256> linear{};
    for (std::size_t i = 0; i < linear.size(); ++i) {
      const float encoded = static_cast<float>(i) / 255.0F;
      linear[i] = is_divided ? std::pow(encoded, 2.2F) : linearOf(encoded);
    }
    CubeFaceMaker maker(edge);
    std::vector<glm::vec3> row(edge);
    for (std::size_t y = 0; y < edge; ++y) {
      interruptionPoint();
      for (std::size_t x = 0; x < edge; ++x) {
        const auto* rgba = &texture.rgba[4 * (y * edge + x)];
        const float alpha = static_cast<float>(std::max<int>(rgba[3], 1)) / 255.0F;
        row[edge - 1 - x] = glm::vec3(linear[rgba[0]], linear[rgba[1]], linear[rgba[2]]) / alpha;
      }
      maker.addRow(row);
    }
    size = maker.size();
    return maker.take();
  }

  [[nodiscard]] Result<CubeMap> cubeOfMap() {
    const auto* cubes = member(context_.document.gltf["extensions"][kMaps], "cubemaps");
    const auto index = indexOf(member(json_, "cubemap"));
    const bool is_there = cubes != nullptr && cubes->is_array() && index && *index < cubes->size();
    if (!is_there) return context_.bad(pointer_ + "/cubemap", "is no cubemap");
    const auto& cube = (*cubes)[*index];
    const auto at = std::string("/extensions/") + kMaps + "/cubemaps/" + std::to_string(*index);
    const auto strength = number(cube, "intensity", 0.0, kMostIntensity, 1.0);
    if (!strength) return tl::unexpected(strength.error());
    strength_ *= static_cast<float>(*strength);
    const auto* source = member(cube, "source");
    if (source == nullptr) return context_.bad(at + "/source", "is missing");
    const auto bytes = imageBytes(*source, at + "/source");
    if (!bytes) return tl::unexpected(bytes.error());
    return readKtx2Cube(**bytes, indexOf(member(cube, "layer")).value_or(0), place(context_.document.name, at));
  }

  /// What of radiance the coefficients tell: less than none of it is none.
  [[nodiscard]] Result<SkyImage> imageOfIrradiance(const glm::dquat& turn) const {
    const auto& json = json_["irradianceCoefficients"];
    std::array<glm::dvec3, kCoefficients> sh{};
    bool good = json.is_array() && json.size() == kCoefficients;
    for (std::size_t i = 0; good && i < kCoefficients; ++i) {
      good = json[i].is_array() && json[i].size() == 3;
      for (std::size_t c = 0; good && c < 3; ++c) {
        good = json[i][c].is_number() && std::abs(json[i][c].get<double>()) <= kMostIntensity;
        if (good) sh[i][static_cast<int>(c)] = json[i][c].get<double>();
      }
    }
    if (!good) return context_.bad(pointer_ + "/irradianceCoefficients", "must be nine times three numbers");
    SkyImage image{kCoarseWidth, kCoarseHeight, {}};
    for (std::size_t i = 0; i < kCoarseWidth * kCoarseHeight; ++i) {
      const double azimuth = (2.0 * (static_cast<double>(i % kCoarseWidth) + 0.5) / kCoarseWidth - 1.0) * kPi;
      const double polar = (static_cast<double>(i / kCoarseWidth) + 0.5) / kCoarseHeight * kPi;
      const auto d = glm::conjugate(turn) * glm::dvec3(std::sin(polar) * std::cos(azimuth), std::cos(polar),
                                                       std::sin(polar) * std::sin(azimuth));
      // Ramamoorthi and Hanrahan, "An efficient representation for irradiance environment maps", 2001.
      const std::array<double, kCoefficients> basis{0.282095,
                                                    0.488603 * d.y,
                                                    0.488603 * d.z,
                                                    0.488603 * d.x,
                                                    1.092548 * d.x * d.y,
                                                    1.092548 * d.y * d.z,
                                                    0.315392 * (3.0 * d.z * d.z - 1.0),
                                                    1.092548 * d.x * d.z,
                                                    0.546274 * (d.x * d.x - d.y * d.y)};
      glm::dvec3 sum(0.0);
      for (std::size_t k = 0; k < kCoefficients; ++k) sum += basis[k] * sh[k] / kSpread[k];
      image.texels.push_back(glm::vec3(glm::max(sum, 0.0)));
    }
    return image;
  }

  ImportContext& context_;
  std::string pointer_;
  const Json& json_;
  bool is_map_;
  float strength_ = 1.0F;
};

}  // namespace

Result<std::optional<std::string>> environmentOf(const ImportContext& context) {
  const auto& gltf = context.document.gltf;
  const auto* scenes = member(gltf, "scenes");
  const auto shown = indexOf(member(gltf, "scene")).value_or(0);
  if (scenes == nullptr || shown >= scenes->size()) return std::optional<std::string>();
  const auto* used = member((*scenes)[shown], "extensions");
  if (used == nullptr) return std::optional<std::string>();
  struct Names {
    const char *extension, *of_scene, *list;
  };
  for (const auto& names :
       {Names{kImageBased, "light", "lights"}, Names{kMaps, "environment_map", "environment_maps"}}) {
    const auto* of_scene = member(*used, names.extension);
    if (of_scene == nullptr) continue;
    const auto pointer = "/scenes/" + std::to_string(shown) + "/extensions/" + names.extension + "/" + names.of_scene;
    const auto index = indexOf(member(*of_scene, names.of_scene));
    const auto* extensions = member(gltf, "extensions");
    const auto* root = extensions != nullptr ? member(*extensions, names.extension) : nullptr;
    const auto* list = root != nullptr ? member(*root, names.list) : nullptr;
    if (!index || list == nullptr || !list->is_array() || *index >= list->size())
      return context.bad(pointer, std::string("must point into /extensions/") + names.extension + "/" + names.list);
    return std::optional<std::string>(std::string("/extensions/") + names.extension + "/" + names.list + "/" +
                                      std::to_string(*index));
  }
  return std::optional<std::string>();
}

Result<SkyImage> readEnvironment(ImportContext& context, const std::string& pointer) {
  return EnvironmentReader(context, pointer).read();
}

}  // namespace radiosity::scene
