#include "server/engine/persist/kept_settings.h"

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <sstream>

namespace radiosity::engine {
namespace {

constexpr double kLongestTimeLimitSeconds = 1e9;  ///< as the protocol has it

template <typename T>
std::optional<T> numberIn(const std::map<std::string, std::string>& kept, const std::string& name) {
  const auto found = kept.find(name);
  if (found == kept.end()) return std::nullopt;
  const auto& text = found->second;
  T value{};
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

std::optional<SkySetting> skyIn(const std::string& text) {
  std::istringstream stream(text);
  SkySetting sky;
  stream >> sky.upper.x >> sky.upper.y >> sky.upper.z >> sky.lower.x >> sky.lower.y >> sky.lower.z;
  return stream.fail() ? std::nullopt : std::optional(sky);
}

}  // namespace

std::map<std::string, std::string> keptSettings(const SolveSettings& settings) {
  std::map<std::string, std::string> kept = {{"targetError", fmt::format("{}", settings.target_error)},
                                             {"timeLimit", fmt::format("{}", settings.time_limit_s.value_or(0.0))},
                                             {"texels", fmt::format("{}", settings.texels)},
                                             {"adaptive", settings.adaptive ? "1" : "0"},
                                             {"texelSize", fmt::format("{}", settings.texel_size_m)},
                                             {"seed", fmt::format("{}", settings.seed)},
                                             {"sky", ""},
                                             {"doubleSided", settings.double_sided ? "1" : "0"},
                                             {"method", std::string(nameOf(settings.method))}};
  if (settings.sky) {
    const auto& [u, l] = *settings.sky;
    kept["sky"] = fmt::format("{} {} {} {} {} {}", u.x, u.y, u.z, l.x, l.y, l.z);
  }
  return kept;
}

SolveSettings withKept(SolveSettings settings, const std::map<std::string, std::string>& kept,
                       const std::set<std::string>& named) {
  if (kept.empty()) return settings;  // a new folder
  const auto real = [&](const char* name) { return numberIn<double>(kept, name); };
  const auto whole = [&](const char* name) { return numberIn<std::uint64_t>(kept, name); };
  const auto method = kept.contains("method") ? methodFrom(kept.at("method")) : std::nullopt;
  const bool kept_adaptive = whole("adaptive").value_or(0) == 1;
  if (!named.contains("targetError")) {
    if (const auto error = real("targetError"); error && *error > 0.0 && *error <= 1.0) settings.target_error = *error;
  }
  if (!named.contains("timeLimit")) {
    if (const auto limit = real("timeLimit"); limit && *limit >= 0.0 && *limit <= kLongestTimeLimitSeconds)
      settings.time_limit_s = *limit > 0.0 ? limit : std::nullopt;
  }
  if (!named.contains("texels")) {
    if (const auto texels = whole("texels"); texels && *texels > 0) settings.texels = *texels;
    if (const auto size = real("texelSize"); size && *size >= 0.0 && std::isfinite(*size))
      settings.texel_size_m = *size;
  }
  if (!named.contains("adaptive")) settings.adaptive = kept_adaptive;
  if (!named.contains("seed")) settings.seed = whole("seed").value_or(settings.seed);
  if (const auto sky = kept.find("sky"); sky != kept.end() && !named.contains("sky")) settings.sky = skyIn(sky->second);
  if (!named.contains("doubleSided")) settings.double_sided = whole("doubleSided").value_or(0) == 1;
  if (!named.contains("method")) settings.method = method.value_or(settings.method);
  // As many as usual were not chosen: a million texels alike would take paper mode hours.
  const bool chose = choosesTexels(kept_adaptive, real("texelSize").value_or(0.0), method.value_or(Method::kGather));
  if (!named.contains("texels") && settings.texels == usualTexels(chose)) settings.texels = settings.usualTexels();
  return settings;
}

}  // namespace radiosity::engine
