// Pictures of skies: Radiance HDR and OpenEXR, equirectangular. They come from anywhere: sizes are bounded before
// anything is allocated, rows are reduced as they come, and errors say what is wrong. Pure functions; any thread.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/result.h"
#include "server/scene/values/sky_picture.h"

namespace radiosity::scene {

/// Wider pictures, or higher ones, are refused: a sixteenth of what the sun is wide is one column.
inline constexpr std::size_t kMostSkyColumns = 16'384, kMostSkyRows = 8192;

/// Nits where the picture's numbers are, and reduced to what a SkyImage may have. `where` names the file in errors.
/// kUnsupported: neither format, or parts of them that are not read; kInvalidScene: it is wrong, ends early, or has
/// numbers above kMostSkyNits or that are none; kTooLarge. What filters leave below 0 is 0, what is infinite in an EXR
/// is the largest number that halves have; `warnings`, if not null, gets how many pixels. Cost: of the pixels; memory
/// of the image, and of one block of rows.
[[nodiscard]] Result<SkyImage> readSkyFile(std::span<const std::uint8_t> bytes, const std::string& where,
                                           std::vector<std::string>* warnings = nullptr);

/// The two formats: sky_file.cpp tells them apart.
[[nodiscard]] Result<SkyImage> readHdr(std::span<const std::uint8_t> bytes, const std::string& where);
[[nodiscard]] Result<SkyImage> readExr(std::span<const std::uint8_t> bytes, const std::string& where,
                                       std::vector<std::string>* warnings = nullptr);

/// "image/vnd.radiance" or "image/x-exr"; empty: neither.
[[nodiscard]] std::string_view skyFileType(std::span<const std::uint8_t> bytes);

/// Empty: such a picture may be read.
[[nodiscard]] std::string skySizeFault(std::uint64_t columns, std::uint64_t rows);
/// Of a row; empty: all its numbers may be.
[[nodiscard]] std::string skyRowFault(std::span<const glm::vec3> row, std::size_t number);

}  // namespace radiosity::scene
