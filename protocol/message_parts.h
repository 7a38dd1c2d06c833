// Parts that several messages share, to JSON and back. For this folder's .cpp files only.
#pragma once

#include <array>
#include <limits>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "protocol/json_reader.h"
#include "protocol/messages.h"

namespace radiosity::protocol {

inline constexpr std::uint64_t kAnyInteger = std::numeric_limits<std::int64_t>::max();
inline constexpr std::size_t kAnyText = kMaxMessageBytes;
inline constexpr const char* kQuantityNames = "irradiance, radiosity, error, patchId, mipLevel, unshot, normal";

[[nodiscard]] nlohmann::json toJson(const Settings& settings);
[[nodiscard]] nlohmann::json toJson(const Progress& progress);
[[nodiscard]] nlohmann::json toJson(const Sky& sky);
[[nodiscard]] nlohmann::json toJson(const CameraPose& pose);
void read(Reader& reader, Settings& settings);
/// Member "sky"; none where it is missing or null.
void readSky(Reader& reader, std::optional<Sky>& sky);
void read(Reader& reader, Progress& progress);
[[nodiscard]] nlohmann::json toJson(const Planes& planes);
void read(Reader& reader, Planes& planes);

void readStrings(Reader& reader, const char* key, Need need, std::size_t max, std::vector<std::string>& out);
/// An array of three numbers, each at least `low` and at most `high`.
void readTriple(Reader& reader, const char* key, Need need, double low, double high, std::array<double, 3>& out);
/// Members "position" and "target".
void read(Reader& reader, CameraPose& pose);
void readIndices(Reader& reader, const char* key, std::vector<std::uint32_t>& out);

/// Bounds of solve.configure and of the reply that echoes it.
inline constexpr Range kErrorRange{0.0, 1.0, true};
inline constexpr std::uint64_t kMaxTexels = std::uint64_t{1} << 32;
inline constexpr Range kTexelSizeRange{0.0, 1.0e9, false};

}  // namespace radiosity::protocol
