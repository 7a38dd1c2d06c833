#include "client/cli/sky_options.h"

#include <algorithm>
#include <charconv>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <span>
#include <utility>

#include "client/cli/model_merge.h"
#include "client/cli/scene_file.h"

namespace radiosity::cli {
namespace {

constexpr const char* kModels[] = {"clear", "intermediate", "overcast", "perez"};
/// Larger pictures are refused before they are read.
constexpr std::uintmax_t kMostPictureBytes = std::uintmax_t{1} << 30U;

bool isModel(const std::string& text) {
  return std::ranges::any_of(kModels, [&](const char* model) { return text == model; });
}

tl::unexpected<Error> badOption(std::string what, std::string where) {
  return fail(ErrorCode::kBadUsage, std::move(what), std::move(where));
}

/// A plus may stand before it, and spaces around it.
bool number(std::string_view text, double& into) {
  const auto first = text.find_first_not_of(' '), last = text.find_last_not_of(' ');
  if (first == std::string_view::npos) return false;
  text = text.substr(first, last + 1 - first);
  if (text.front() == '+') text.remove_prefix(1);
  const auto* end = text.data() + text.size();
  const auto [read, error] = std::from_chars(text.data(), end, into);
  return error == std::errc() && read == end;
}

/// "2026-06-21T12:00+02:00@48.1,11.6"; the server looks at what stands there.
Result<void> addSun(const std::string& sun, Json& daylight) {
  const std::string_view text(sun);
  const auto at = text.find('@');
  const auto comma = text.find(',', at == std::string_view::npos ? 0 : at);
  double latitude = 0.0, longitude = 0.0;
  if (at == std::string_view::npos || comma == std::string_view::npos ||
      !number(text.substr(at + 1, comma - at - 1), latitude) || !number(text.substr(comma + 1), longitude))
    return badOption("must be a time and a place, such as 2026-06-21T12:00+02:00@48.1,11.6", "--sun " + sun);
  daylight["time"] = std::string(text.substr(0, at));
  daylight["latitude"] = latitude;
  daylight["longitude"] = longitude;
  return {};
}

Result<Json> daylightOf(const SkyOptions& options) {
  Json daylight = Json::object();
  if (!options.sky.empty()) daylight["sky"] = options.sky;
  if (!options.sun.empty())
    if (auto ok = addSun(options.sun, daylight); !ok) return tl::unexpected(ok.error());
  if (options.sun_angle) daylight["sunAngle"] = *options.sun_angle;
  if (options.turbidity) daylight["turbidity"] = *options.turbidity;
  return daylight;
}

void appendWord(std::string& to, std::size_t word) {
  for (unsigned shift = 0; shift < 32; shift += 8) to += static_cast<char>(word >> shift & 0xFFU);
}

void pad(std::string& text, char with) { text.append((4 - text.size() % 4) % 4, with); }

/// glTF 2.0, section 4.4.
Result<std::string> glbOf(const Json& gltf, std::string bin, const std::string& name) {
  constexpr std::size_t kJson = 0x4E4F534A, kBin = 0x004E4942, kMost = 0xFFFF'FFFF;
  auto text = gltf.dump();
  pad(text, ' ');
  pad(bin, '\0');
  const auto size = 12 + 8 + text.size() + (bin.empty() ? 0 : 8 + bin.size());
  if (size > kMost) return fail(ErrorCode::kTooLarge, "would have more than 4 GiB with its sky", name);
  std::string glb = "glTF";
  for (const auto word : {std::size_t{2}, size, text.size(), kJson}) appendWord(glb, word);
  glb += text;
  if (bin.empty()) return glb;
  for (const auto word : {bin.size(), kBin}) appendWord(glb, word);
  return glb + bin;
}

std::string dataUri(const std::string& bytes) {
  return "data:application/octet-stream;base64," +
         base64({reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()});
}

/// Where the first buffer is the bytes of the GLB the picture follows them; else it is in the JSON.
void embed(const std::string& picture, Json& sky, Model& model) {
  if (picture.empty()) return;
  if (model.bin.empty() || model.gltf.at("buffers").at(0).contains("uri")) {
    sky["uri"] = dataUri(picture);
    return;
  }
  pad(model.bin, '\0');
  const auto offset = model.bin.size();
  model.bin += picture;
  model.gltf["buffers"][0]["byteLength"] = model.bin.size();
  sky["bufferView"] = model.gltf["bufferViews"].size();
  model.gltf["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", offset}, {"byteLength", picture.size()}});
}

/// Throws where the file is not the glTF that it seems to be.
Result<SceneBytes> embedInto(Model model, bool is_glb, const SkyChoice& choice, const std::string& name) {
  const auto picture = readPicture(choice);
  if (!picture) return tl::unexpected(picture.error());
  auto sky = choice.sky;
  embed(*picture, sky, model);
  auto& extras = model.gltf["extras"];
  if (!extras.is_object()) extras = Json::object();
  extras["radiositySky"] = std::move(sky);
  if (!is_glb) return SceneBytes{model.gltf.dump(), false};
  auto glb = glbOf(model.gltf, std::move(model.bin), name);
  if (!glb) return tl::unexpected(glb.error());
  return SceneBytes{std::move(*glb), true};
}

}  // namespace

void addSkyOptions(CLI::App& command, SkyOptions& options) {
  command
      .add_option("--sky", options.sky,
                  "light from outside. A picture replaces the scene's sky: FILE.hdr or .exr, equirectangular, nits; so "
                  "does a model of daylight: clear, intermediate, overcast (CIE), perez. Or nits, for scenes without "
                  "a sky of their own: 1000, or R,G,B, or R,G,B/R,G,B (above / below the horizon)")
      ->type_name("SKY");
  command.add_option("--sky-rotation", options.rotation, "turns the picture, or daylight, about the vertical")
      ->check(CLI::Range(-1e4, 1e4).description(""))
      ->type_name("DEGREES");
  command.add_option("--sky-strength", options.strength, "multiplies it; of pictures that are not in nits, too")
      ->check(CLI::Range(0.0, 1e9).description(""))
      ->type_name("FACTOR");
  command
      .add_option(
          "--sun", options.sun,
          "daylight of a time and a place, with its sun: 2026-06-21T12:00+02:00@48.1,11.6 (latitude, longitude; "
          "north is -Z); the sky is Perez's unless --sky names another model")
      ->type_name("TIME@PLACE");
  command.add_option("--sun-angle", options.sun_angle, "diameter of the sun of --sun in degrees (default: 0.533)")
      ->check(CLI::Range(0.0, 90.0).description(""))
      ->type_name("DEGREES");
  command.add_option("--turbidity", options.turbidity, "of the air, for a Perez sky (Linke; default: 3)")
      ->check(CLI::Range(1.0, 12.0).description(""))
      ->type_name("NUMBER");
}

Result<SkyChoice> skyChoice(const SkyOptions& options) {
  SkyChoice choice;
  const bool is_daylight = isModel(options.sky) || !options.sun.empty();
  for (const auto& [given, name] : {std::pair(options.sun_angle.has_value(), "--sun-angle"),
                                    std::pair(options.turbidity.has_value(), "--turbidity")})
    if (given && !is_daylight) return badOption("needs --sun, or a model of daylight as --sky", name);
  const auto colours = protocol::parseSky(options.sky);
  if (is_daylight) {
    if (!options.sky.empty() && !isModel(options.sky))
      return badOption("goes with a model of daylight as --sky alone", "--sun");
    auto daylight = daylightOf(options);
    if (!daylight) return tl::unexpected(daylight.error());
    choice.sky = {{"daylight", std::move(*daylight)}};
  } else if (!options.sky.empty() && colours) {
    choice.colours = *colours;
  } else if (!options.sky.empty()) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(options.sky, error))
      return badOption(
          "is no file, no model (clear, intermediate, overcast, perez), and no nits: " + colours.error().message,
          "--sky " + options.sky);
    if (std::filesystem::file_size(options.sky, error) > kMostPictureBytes || error)
      return badOption("has more than 1 GiB", "--sky " + options.sky);
    choice.picture = options.sky;
    choice.sky = Json::object();
  }
  for (const auto& [value, name] : {std::pair(options.rotation, "rotation"), std::pair(options.strength, "strength")}) {
    if (!value) continue;
    if (!choice.isOfScene())
      return badOption("needs a picture or a model as --sky, or --sun", std::string("--sky-") + name);
    choice.sky[name] = *value;
  }
  return choice;
}

Result<std::string> readPicture(const SkyChoice& choice) {
  if (choice.picture.empty()) return std::string();
  std::ifstream file(choice.picture, std::ios::binary);
  std::string bytes{std::istreambuf_iterator<char>(file), {}};
  if (!file.good() && !file.eof()) return fail(ErrorCode::kBadInput, "cannot be read", choice.picture);
  if (bytes.empty()) return fail(ErrorCode::kBadInput, "is empty", choice.picture);
  return bytes;
}

Result<SceneBytes> withSky(const std::string& scene_path, const SkyChoice& choice) {
  const auto kind = sceneKind(scene_path);
  if (!kind) return tl::unexpected(kind.error());
  Model model;
  if (*kind == SceneKind::kGlb) {
    std::ifstream file(scene_path, std::ios::binary);
    const std::string bytes{std::istreambuf_iterator<char>(file), {}};
    auto split = splitModel(bytes, scene_path);
    if (!split) return tl::unexpected(split.error());
    model = std::move(*split);
  } else {
    const auto text = inlineExternalFiles(scene_path);
    if (!text) return tl::unexpected(text.error());
    model.gltf = Json::parse(*text, nullptr, false);
  }
  // The file may be wrong in any way; the library says so by exceptions, which go no further.
  try {
    return embedInto(std::move(model), *kind == SceneKind::kGlb, choice, scene_path);
  } catch (const Json::exception& e) {
    return fail(ErrorCode::kBadInput, std::string("is not the glTF that it seems to be: ") + e.what(), scene_path);
  }
}

Json skyPatch(const Json& gltf, const SkyChoice& choice, const std::string& uri, std::size_t bytes) {
  Json patch = Json::array();
  const auto add = [&](const std::string& path, Json value) {
    patch.push_back({{"op", "add"}, {"path", path}, {"value", std::move(value)}});
  };
  auto sky = choice.sky;
  if (!uri.empty()) {
    const auto count = [&](const char* list) { return gltf.contains(list) ? gltf[list].size() : std::size_t{0}; };
    for (const char* list : {"buffers", "bufferViews"})
      if (!gltf.contains(list)) add(std::string("/") + list, Json::array());
    sky["bufferView"] = count("bufferViews");
    add("/buffers/-", {{"uri", uri}, {"byteLength", bytes}});
    add("/bufferViews/-", {{"buffer", count("buffers")}, {"byteLength", bytes}});
  }
  if (!gltf.contains("extras") || !gltf["extras"].is_object()) add("/extras", Json::object());
  add("/extras/radiositySky", std::move(sky));
  return patch;
}

Result<Json> skyTurnPatch(const Json& gltf, const SkyOptions& options) {
  const auto sky = gltf.value(Json::json_pointer("/extras/radiositySky"), Json());
  if (!sky.is_object() || !(sky.contains("bufferView") || sky.contains("uri") || sky.contains("daylight")))
    return fail(ErrorCode::kBadUsage, "the scene has no picture or daylight of its own that could be changed",
                options.rotation ? "--sky-rotation" : "--sky-strength");
  Json patch = Json::array();
  for (const auto& [value, name] : {std::pair(options.rotation, "rotation"), std::pair(options.strength, "strength")})
    if (value)
      patch.push_back({{"op", "add"}, {"path", std::string("/extras/radiositySky/") + name}, {"value", *value}});
  return patch;
}

}  // namespace radiosity::cli
