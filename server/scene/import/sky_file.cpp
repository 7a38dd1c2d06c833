#include "server/scene/import/sky_file.h"

#include <algorithm>
#include <array>

namespace radiosity::scene {
namespace {

constexpr std::array<std::uint8_t, 4> kExrMagic{0x76, 0x2F, 0x31, 0x01};

bool startsWith(std::span<const std::uint8_t> bytes, std::string_view text) {
  return bytes.size() >= text.size() && std::equal(text.begin(), text.end(), bytes.begin(), [](char c, std::uint8_t b) {
           return b == static_cast<std::uint8_t>(c);
         });
}

}  // namespace

std::string_view skyFileType(std::span<const std::uint8_t> bytes) {
  if (startsWith(bytes, "#?")) return "image/vnd.radiance";
  if (bytes.size() >= kExrMagic.size() && std::equal(kExrMagic.begin(), kExrMagic.end(), bytes.begin()))
    return "image/x-exr";
  return {};
}

std::string skySizeFault(std::uint64_t columns, std::uint64_t rows) {
  const auto size = std::to_string(columns) + " x " + std::to_string(rows);
  if (columns == 0 || rows == 0) return "the picture has no pixels (" + size + ")";
  if (columns <= kMostSkyColumns && rows <= kMostSkyRows) return {};
  return "the picture has " + size + " pixels; a sky may have " + std::to_string(kMostSkyColumns) + " x " +
         std::to_string(kMostSkyRows);
}

std::string skyRowFault(std::span<const glm::vec3> row, std::size_t number) {
  for (std::size_t x = 0; x < row.size(); ++x) {
    for (int c = 0; c < 3; ++c) {
      if (row[x][c] >= 0.0F && row[x][c] <= kMostSkyNits) continue;
      return "pixel (" + std::to_string(x) + ", " + std::to_string(number) + ") has " + std::to_string(row[x][c]) +
             "; must be 0 to 1e12";
    }
  }
  return {};
}

Result<SkyImage> readSkyFile(std::span<const std::uint8_t> bytes, const std::string& where,
                             std::vector<std::string>* warnings) {
  const auto type = skyFileType(bytes);
  if (type == "image/vnd.radiance") return readHdr(bytes, where);
  if (type == "image/x-exr") return readExr(bytes, where, warnings);
  return fail(ErrorCode::kUnsupported, "is neither a Radiance HDR nor an OpenEXR picture", where);
}

}  // namespace radiosity::scene
