#include "server/scene/import/import_sky.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <limits>
#include <memory>
#include <numbers>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "common/task.h"
#include "server/scene/document/document_uri.h"
#include "server/scene/document/scene_limit.h"
#include "server/scene/import/import_environment.h"
#include "server/scene/import/sky_file.h"
#include "server/scene/values/daylight.h"

namespace radiosity::scene {
namespace {

constexpr double kDegree = std::numbers::pi / 180.0;
constexpr const char* kSky = "/extras/radiositySky";
constexpr double kMostTurn = 1e4, kMostStrength = 1e9, kMostWatts = 2000.0, kMostLux = 1e6;
constexpr double kLeastTurbidity = 1.0, kMostTurbidity = 12.0, kUsualTurbidity = 3.0, kUsualGround = 0.2;
/// Of a sun, degrees: what is wider is a sky.
constexpr double kMostSunAngle = 90.0;

/// What an environment of an extension is known by: its own numbers, and its pictures. Those that are kept with it do
/// not go, so that no other has their addresses.
EnvironmentKey keyOf(const ImportContext& context, const std::string& pointer) {
  const auto& gltf = context.document.gltf;
  EnvironmentKey key{pointer + gltf.at(Json::json_pointer(pointer)).dump(), context.document.images};
  if (const auto maps = gltf["extensions"].find("KHR_environment_map"); maps != gltf["extensions"].end())
    key.text += maps->dump();
  return key;
}

bool isRequired(const Json& gltf, const std::string& pointer) {
  const auto required = gltf.find("extensionsRequired");
  if (required == gltf.end() || !required->is_array()) return false;
  return std::ranges::any_of(*required, [&](const Json& name) {
    return name.is_string() && pointer.starts_with("/extensions/" + name.get<std::string>() + "/");
  });
}

/// A number of an object, and between which it must be.
struct Number {
  const char* member;
  double least, most;
};

class SkyReader {
 public:
  SkyReader(ImportContext& context, const Json& json) : context_(context), json_(json) {}

  /// Of an extension. One that may be left out, and is of a kind that is not read, is.
  Result<void> readEnvironmentAt(const std::string& pointer) {
    const auto key = keyOf(context_, pointer);
    auto ok = take(
        pointer, known(context_.skies.environments, before(&ReadSkies::environments), key, true),
        [&] { return readEnvironment(context_, pointer); },
        [&](const SharedSkyPicture& picture) { context_.skies.environments.emplace(key, picture); });
    if (ok) context_.scene.sky = std::move(sky_);
    if (ok || ok.error().code != ErrorCode::kUnsupported || isRequired(context_.document.gltf, pointer)) return ok;
    context_.warn(pointer, "is left out, and the scene has no sky by it: " + ok.error().message);
    return {};
  }

  Result<void> read() {
    if (auto ok = readColours(); !ok) return ok;
    const auto strength = number(json_, kSky, {"strength", 0.0, kMostStrength}, 1.0);
    const auto turn = number(json_, kSky, {"rotation", -kMostTurn, kMostTurn}, 0.0);
    for (const auto* read : {&strength, &turn})
      if (!*read) return tl::unexpected(read->error());
    sky_.strength = static_cast<float>(*strength);
    sky_.turn_rad = kDegree * *turn;
    const bool has_picture = json_.contains("bufferView") || json_.contains("uri");
    if (has_picture && json_.contains("daylight"))
      return context_.bad(kSky, "must have a picture or daylight, not both");
    if (has_picture)
      if (auto ok = readPicture(); !ok) return ok;
    if (json_.contains("daylight"))
      if (auto ok = readDaylight(json_["daylight"], std::string(kSky) + "/daylight"); !ok) return ok;
    if (!has_picture && !json_.contains("daylight") && !json_.contains("upper"))
      return context_.bad(kSky, "must be an object with upper, bufferView, uri or daylight");
    context_.scene.sky = std::move(sky_);
    return {};
  }

 private:
  [[nodiscard]] Result<double> number(const Json& object, const std::string& pointer, const Number& of,
                                      double otherwise) const {
    const auto found = object.find(of.member);
    if (found == object.end()) return otherwise;
    if (found->is_number() && found->get<double>() >= of.least && found->get<double>() <= of.most)
      return found->get<double>();
    return context_.bad(pointer + "/" + of.member,
                        "must be a number from " + numberText(of.least) + " to " + numberText(of.most));
  }
  static std::string numberText(double number) {
    std::array<char, 32> text{};
    std::snprintf(text.data(), text.size(), "%.10g", number);
    return text.data();
  }

  /// Three finite numbers that are not negative.
  [[nodiscard]] Result<glm::vec3> colour(const char* member) const {
    const auto& value = json_[member];
    glm::vec3 colour(0.0F);
    bool good = value.is_array() && value.size() == 3;
    for (std::size_t c = 0; good && c < 3; ++c) {
      good = value[c].is_number() && value[c].get<double>() >= 0.0 &&
             value[c].get<double>() <= static_cast<double>(kMostSkyNits);
      if (good) colour[static_cast<int>(c)] = value[c].get<float>();
    }
    if (good) return colour;
    return context_.bad(std::string(kSky) + "/" + member, "must be three numbers in nits, each 0 to 1e12");
  }

  Result<void> readColours() {
    if (json_.contains("upper")) {
      const auto upper = colour("upper");
      if (!upper) return tl::unexpected(upper.error());
      sky_.upper = sky_.lower = *upper;
    }
    if (!json_.contains("lower")) return {};
    const auto lower = colour("lower");
    if (!lower) return tl::unexpected(lower.error());
    sky_.lower = *lower;
    return {};
  }

  Result<void> readPicture() {
    interruptionPoint();
    WebKey key;
    Bytes decoded;
    std::span<const std::uint8_t> bytes;
    std::string pointer = kSky;
    if (json_.contains("bufferView")) {
      pointer += "/bufferView";
      const auto& index = json_["bufferView"];
      const auto* view = index.is_number_integer() && index >= 0 && index <= std::numeric_limits<int>::max()
                             ? viewOf(context_.model, index.get<int>())
                             : nullptr;
      if (view == nullptr) return context_.bad(pointer, "is no buffer view");
      const auto& buffer = context_.document.buffers[static_cast<std::size_t>(view->buffer)];
      bytes = std::span(*buffer).subspan(view->byteOffset, view->byteLength);
      key = {buffer, view->byteOffset, view->byteLength};
    } else {
      pointer += "/uri";
      const auto& uri = json_["uri"];
      if (!uri.is_string() || !isDataUri(uri.get<std::string>()))
        return context_.bad(pointer, "must be a data URI here, or the sky must have a bufferView");
      auto data = decodeDataUri(uri.get<std::string>(), place(context_.document.name, pointer));
      if (!data) return tl::unexpected(data.error());
      decoded = std::move(*data);
      bytes = decoded;
    }
    return take(
        pointer, known(context_.skies.pictures, before(&ReadSkies::pictures), key, key.buffer != nullptr),
        [&] {
          std::vector<std::string> warnings;
          auto image = readSkyFile(bytes, place(context_.document.name, pointer), &warnings);
          for (const auto& warning : warnings) context_.warn(pointer, warning);
          return image;
        },
        [&](const SharedSkyPicture& picture) {
          if (key.buffer) context_.skies.pictures.emplace(key, picture);
        });
  }

  template <typename Map>
  [[nodiscard]] const Map* before(Map ReadSkies::*map) const {
    return context_.before != nullptr ? &(context_.before->skies.*map) : nullptr;
  }
  /// That was read for this document, or the one before it.
  template <typename Map>
  [[nodiscard]] static SharedSkyPicture known(const Map& now, const Map* before, const typename Map::key_type& key,
                                              bool may_be) {
    for (const auto* map : {&now, before}) {
      if (!may_be || map == nullptr) continue;
      if (const auto found = map->find(key); found != map->end()) return found->second;
    }
    return {};
  }

  template <typename Read, typename Keep>
  Result<void> take(const std::string& pointer, SharedSkyPicture picture, const Read& read, const Keep& keep) {
    if (!picture) {
      auto image = read();
      if (!image) return tl::unexpected(image.error());
      picture = SharedSkyPicture(std::make_shared<const SkyPicture>(std::move(*image)));
    }
    context_.web_bytes += picture->bytes();
    const auto limit = sceneMemoryLimit(context_.limits);
    if (const auto all = context_.claimed_bytes + context_.web_bytes; all > limit.bytes)
      return context_.tooLarge(pointer, sceneMemoryFault(all, limit, "its sky"));
    if (!picture->shines(true) && !picture->shines(false)) context_.warn(pointer, "the picture is black");
    keep(picture);
    sky_.picture = std::move(picture);
    return {};
  }

  /// What a daylight says of itself; see protocol/README.md.
  struct Daylight {
    int cie = 0;  ///< type; 0: Perez
    SunPlace sun;
    int day_of_year = 172;
    std::optional<double> diffuse, direct;  ///< lux of the CIE, watts of Perez
    double turbidity = kUsualTurbidity, ground = kUsualGround, diameter_deg = kSunDegrees;
    bool has_sun = true;
  };

  Result<void> readDaylight(const Json& json, const std::string& pointer) {
    if (!json.is_object()) return context_.bad(pointer, "must be an object");
    Daylight daylight;
    if (auto ok = readModel(json, pointer, daylight); !ok) return ok;
    if (auto ok = readSunPlace(json, pointer, daylight); !ok) return ok;
    if (auto ok = readLevels(json, pointer, daylight); !ok) return ok;
    if (daylight.sun.altitude <= 0.0) context_.warn(pointer, "the sun is below the horizon: there is no daylight");
    return bake(daylight, pointer, json.dump());
  }

  Result<void> readModel(const Json& json, const std::string& pointer, Daylight& into) const {
    const auto found = json.find("sky");
    if (found == json.end()) return {};
    if (found->is_number_integer() && *found >= 1 && *found <= kCieTypes) {
      into.cie = found->get<int>();
      return {};
    }
    const auto name = found->is_string() ? found->get<std::string>() : std::string();
    if (name == "clear") into.cie = kCieClear;
    if (name == "intermediate") into.cie = kCieIntermediate;
    if (name == "overcast") into.cie = kCieOvercast;
    if (into.cie > 0 || name == "perez") return {};
    return context_.bad(pointer + "/sky", "must be clear, intermediate, overcast, perez, or a CIE type from 1 to 16");
  }

  Result<void> readSunPlace(const Json& json, const std::string& pointer, Daylight& into) const {
    const auto latitude = number(json, pointer, {"latitude", -90.0, 90.0}, 0.0);
    const auto longitude = number(json, pointer, {"longitude", -180.0, 180.0}, 0.0);
    const auto altitude = number(json, pointer, {"altitude", -90.0, 90.0}, 45.0);
    const auto azimuth = number(json, pointer, {"azimuth", -360.0, 360.0}, 180.0);
    for (const auto* read : {&latitude, &longitude, &altitude, &azimuth})
      if (!*read) return tl::unexpected(read->error());
    into.sun = {kDegree * *altitude, kDegree * *azimuth};
    const auto time = json.find("time");
    if (time == json.end()) return {};
    const auto moment = time->is_string() ? momentOf(time->get<std::string>()) : std::nullopt;
    if (!moment)
      return context_.bad(pointer + "/time", "must be a time such as 2026-06-21T12:00+02:00, of 1950 to 2050");
    if (!json.contains("latitude") || !json.contains("longitude"))
      return context_.bad(pointer, "a time needs latitude and longitude");
    into.sun = sunAt(*moment, *latitude, *longitude);
    into.day_of_year = moment->day_of_year;
    return {};
  }

  Result<void> readLevels(const Json& json, const std::string& pointer, Daylight& into) const {
    const double most = into.cie > 0 ? kMostLux : kMostWatts;
    const auto diffuse = number(json, pointer, {"diffuse", 0.0, most}, -1.0);
    const auto direct = number(json, pointer, {"direct", 0.0, most}, -1.0);
    const auto turbidity = number(json, pointer, {"turbidity", kLeastTurbidity, kMostTurbidity}, kUsualTurbidity);
    const auto ground = number(json, pointer, {"ground", 0.0, 1.0}, kUsualGround);
    const auto diameter = number(json, pointer, {"sunAngle", 0.0, kMostSunAngle}, kSunDegrees);
    for (const auto* read : {&diffuse, &direct, &turbidity, &ground, &diameter})
      if (!*read) return tl::unexpected(read->error());
    if (*diffuse >= 0.0) into.diffuse = *diffuse;
    if (*direct >= 0.0) into.direct = *direct;
    into.turbidity = *turbidity;
    into.ground = *ground;
    into.diameter_deg = *diameter;
    const auto sun = json.find("sun");
    if (sun != json.end() && !sun->is_boolean()) return context_.bad(pointer + "/sun", "must be true or false");
    into.has_sun = sun == json.end() || sun->get<bool>();
    return {};
  }

  Result<void> bake(const Daylight& daylight, const std::string& pointer, const std::string& key) {
    auto level = usualLevel(daylight.cie, daylight.sun.altitude, daylight.day_of_year);
    SkyShape shape;
    if (daylight.cie > 0) {
      shape = cieShape(daylight.cie);
      level = {daylight.diffuse.value_or(level.diffuse), daylight.direct.value_or(level.direct)};
    } else {
      auto power = clearPower(daylight.turbidity, daylight.sun.altitude, daylight.day_of_year);
      power = {daylight.diffuse.value_or(power.diffuse), daylight.direct.value_or(power.direct)};
      const auto sky = perezSky(power, daylight.sun.altitude, daylight.day_of_year);
      shape = sky.shape;
      level = sky.level;
    }
    const auto sun = daylight.sun.direction();
    if (sun.y <= 0.0) level = {};
    const double on_ground = level.diffuse + level.direct * std::max(0.0, sun.y);
    const double ground = daylight.ground * on_ground / std::numbers::pi;
    if (daylight.has_sun && level.direct > 0.0) {
      const double c = std::cos(sky_.turn_rad), s = std::sin(sky_.turn_rad);  // it turns with the sky
      sky_.sun = SkySun{{c * sun.x + s * sun.z, sun.y, c * sun.z - s * sun.x},
                        glm::vec3(sky_.strength * static_cast<float>(level.direct)),
                        kDegree * daylight.diameter_deg};
    }
    return take(
        pointer, known(context_.skies.daylights, before(&ReadSkies::daylights), key, true),
        [&]() -> Result<SkyImage> { return daylightImage(shape, sun, level.diffuse, ground); },
        [&](const SharedSkyPicture& picture) { context_.skies.daylights.emplace(key, picture); });
  }

  ImportContext& context_;
  const Json& json_;
  Sky sky_;
};

}  // namespace

Result<void> importSky(ImportContext& context) {
  const auto extras = context.document.gltf.find("extras");
  if (extras == context.document.gltf.end() || !extras->is_object() || !extras->contains("radiositySky")) {
    const auto pointer = environmentOf(context);
    if (!pointer) return tl::unexpected(pointer.error());
    const auto none = Json::object();
    return *pointer ? SkyReader(context, none).readEnvironmentAt(**pointer) : Result<void>{};
  }
  const auto& json = (*extras)["radiositySky"];
  if (json.is_null()) return {};
  if (!json.is_object()) return context.bad(kSky, "must be an object with upper, bufferView, uri or daylight");
  return SkyReader(context, json).read();
}

}  // namespace radiosity::scene
