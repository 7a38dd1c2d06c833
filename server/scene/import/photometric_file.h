// Photometric files of lamps: LM-63 ("IES": 1986 to 2019, types A, B and C) and EULUMDAT. Both come from anywhere:
// counts are bounded before anything is allocated, and errors name the line. Pure functions; any thread.
#pragma once

#include <cstdint>
#include <glm/vec3.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "common/result.h"
#include "server/scene/values/light_web.h"

namespace radiosity::scene {

/// Degrees. Angles of files are given to a hundredth; such as are no further apart are the same, and do not ascend.
inline constexpr double kLeastAngle = 1e-3;
/// Longer files are refused.
inline constexpr std::size_t kMostPhotometricBytes = std::size_t{16} << 20U;

/// How a file's angles lie in the space of the lamp, which shines along its -Z (EXT_lights_ies). Y and Z of the web's
/// own axes, of which the third is cross(across, axis), by type.
enum class WebFrame {
  kC,  ///< the vertical angle from -Z, the horizontal one from +X towards +Y
  kB,  ///< both are 0 at -Z; the vertical one turns about Y towards +X, the horizontal one leans towards -Y
  kA,  ///< both are 0 at -Z; the horizontal one turns about X towards -Y, the vertical one leans towards +X
};

/// In the lamp's space, unit length: the direction of polar angle 0, and of polar angle 90 and azimuth 0. Azimuths grow
/// towards cross(across, axis).
struct WebAxes {
  glm::dvec3 axis{0.0}, across{0.0};
};
[[nodiscard]] WebAxes webAxes(WebFrame frame);

struct PhotometricFile {
  LightWeb web;  ///< in candela, all symmetries written out
  WebFrame frame = WebFrame::kC;
  std::vector<std::string> warnings;  ///< "line 3: ..." or of the whole file
};

/// `where` names the file in errors. kInvalidScene: it is wrong; kUnsupported: TILT is in another file; kTooLarge.
[[nodiscard]] Result<PhotometricFile> parsePhotometricFile(std::span<const std::uint8_t> bytes,
                                                           const std::string& where);

/// What both formats come to before symmetries are written out: columns of candela over polar angles.
struct WebColumns {
  struct Column {
    double azimuth = 0.0;
    std::vector<float> candela;
  };
  std::vector<float> polar;
  std::vector<Column> columns;

  /// Adds to each column its mirror image at an azimuth, where there is none yet. The columns ascend, and do after it.
  void mirror(double about);
  /// A full circle whose last column is not the first again.
  void close();
  [[nodiscard]] LightWeb web() const;
};

/// The two formats: photometric_file.cpp tells them apart. Text is ASCII, or what passes for it.
[[nodiscard]] Result<PhotometricFile> parseIes(std::string_view text, const std::string& where);
[[nodiscard]] Result<PhotometricFile> parseEulumdat(std::string_view text, const std::string& where);

/// The lines of a file, one after the other. Ends of lines: CR, LF or both.
class FileLines {
 public:
  explicit FileLines(std::string_view text) : rest_(text) {}
  /// None: there are no more. Without spaces at its ends.
  [[nodiscard]] std::optional<std::string_view> next();
  /// Of the last one, from 1.
  [[nodiscard]] std::size_t number() const { return number_; }

 private:
  std::string_view rest_;
  std::size_t number_ = 0;
};

/// Finite, and at most 1e12 either way.
[[nodiscard]] std::optional<double> photometricNumber(std::string_view text);

/// "line 7: "
[[nodiscard]] std::string atLine(std::size_t line);

/// "1234 lm"
[[nodiscard]] std::string lumensText(double lumens);

}  // namespace radiosity::scene
