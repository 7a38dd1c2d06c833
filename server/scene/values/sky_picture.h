// A sky that is a picture: radiance by direction, and what solves draw from it, found once. Immutable; any thread.
//
// What is much brighter than the rest (a sun, the sky around it, lamps) is told apart as lamps, of which leaves ask by
// rays of their own, in proportion to their light; rays of reflected light, which meet the sky by chance, find the
// rest.
#pragma once

#include <cstddef>
#include <cstdint>
#include <glm/vec3.hpp>
#include <memory>
#include <span>
#include <vector>

#include "server/scene/values/sky_table.h"

namespace radiosity::scene {

/// No number of a picture is larger, nits.
inline constexpr float kMostSkyNits = 1e12F;

/// Equirectangular, nits, linear sRGB: row 0 at the zenith (+Y); the middle column towards +X, columns from there to
/// the right by way of +Z.
struct SkyImage {
  std::size_t width = 0, height = 0;
  std::vector<glm::vec3> texels;  ///< row by row; finite, none below 0

  bool operator==(const SkyImage&) const = default;
};

/// Makes an image of rows that come one by one, so that one of any size takes no more memory than it is reduced to. The
/// light of each direction stays what it is: texels are means over solid angles.
class SkyImageMaker {
 public:
  static constexpr std::size_t kMostWidth = 2048, kMostHeight = 1024;
  /// Of a picture of so many columns and rows, both above 0.
  SkyImageMaker(std::size_t columns, std::size_t rows, std::size_t most_width = kMostWidth,
                std::size_t most_height = kMostHeight);
  /// The next row, from the zenith down; `columns` of them.
  void addRow(std::span<const glm::vec3> row);
  /// After the last row.
  [[nodiscard]] SkyImage take();

 private:
  std::size_t columns_, rows_, next_ = 0;
  SkyImage image_;
  std::vector<glm::dvec3> across_;  ///< a row, reduced
  std::vector<glm::dvec3> sums_;    ///< of the row of the image that is being made
  std::size_t made_ = 0;
};

/// Light of a sky in proportion to one number by direction, of one colour.
struct SkyLamp {
  std::shared_ptr<const std::vector<float>> table;  ///< skyTable()
  std::uint64_t key = 0;                            ///< of the table
  glm::dvec3 light{0.0};                            ///< radiance integrated over directions: lux
};

class SkyPicture {
 public:
  /// Cost: some passes over the texels, and a quarter of a second for the largest there is.
  explicit SkyPicture(SkyImage image);

  [[nodiscard]] const SkyImage& image() const { return image_; }
  [[nodiscard]] std::uint64_t key() const { return key_; }
  /// Interpolated between texels; `direction` of unit length.
  [[nodiscard]] glm::vec3 radiance(const glm::dvec3& direction) const;
  /// Some of it above the horizon, or below it, is not black.
  [[nodiscard]] bool shines(bool above) const { return shines_[above ? 0 : 1]; }

  /// Mean radiance of all but bright() over a rectangle of azimuths, radians, and heights. The azimuth may go beyond
  /// pi.
  [[nodiscard]] glm::dvec3 restOver(double azimuth, double width, double height, double extent) const;
  /// What is more than eight times as bright as the mean of the rest, as up to four lamps: one of the mean colour, and
  /// what channels have more than that. With restOver() all of the picture.
  [[nodiscard]] std::span<const SkyLamp> bright() const { return bright_; }
  /// All of the picture likewise.
  [[nodiscard]] std::span<const SkyLamp> whole() const { return whole_; }
  /// Of memory.
  [[nodiscard]] std::size_t bytes() const;

 private:
  void sumUp(const SkyImage& rest);
  [[nodiscard]] glm::dvec3 sumAt(double column, double height) const;

  SkyImage image_;
  std::uint64_t key_ = 0;
  bool shines_[2] = {false, false};
  std::size_t width_ = 0, height_ = 0;  ///< of the sums
  std::vector<glm::dvec3> sums_;        ///< integrals from the zenith down, and from azimuth -pi on; one more each way
  std::vector<SkyLamp> bright_, whole_;
};

/// Equal where the pictures are.
class SharedSkyPicture {
 public:
  SharedSkyPicture() = default;
  explicit SharedSkyPicture(std::shared_ptr<const SkyPicture> picture) : picture_(std::move(picture)) {}

  explicit operator bool() const { return picture_ != nullptr; }
  const SkyPicture& operator*() const { return *picture_; }
  const SkyPicture* operator->() const { return picture_.get(); }
  bool operator==(const SharedSkyPicture& other) const {
    if (picture_ == other.picture_ || !picture_ || !other.picture_) return picture_ == other.picture_;
    return picture_->key() == other.picture_->key() && picture_->image() == other.picture_->image();
  }

 private:
  std::shared_ptr<const SkyPicture> picture_;
};

}  // namespace radiosity::scene
